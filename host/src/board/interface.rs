//! A board as an operator has it, whatever its axes and its numbers: for programs of others, and for the panel.
//!
//! Commands return at once, and what becomes of them is told by [`Board::step`], which is to be called over and over. For a
//! program that only waits there are [`wait_for`] and [`wait_until_at_rest`].

use std::time::{Duration, Instant};

use motion_kernel::link::State;
use serde::Serialize;

use super::error::BoardError;
use super::items::Source;
use super::trigger::Condition;
use crate::gcode::AXES_MAX;
use crate::simulate::jog::Press;
use crate::trace::RunTrace;

/// A board with its machine.
pub trait Board: Send {
    /// What it is.
    fn info(&self) -> &BoardInfo;

    /// What it does, as it has told last.
    fn state(&self) -> BoardState;

    /// Goes on: listens for at most `wait`, and sends what there is to send. Tells what has happened since.
    fn step(&mut self, wait: Duration) -> Vec<BoardEvent>;

    /// Whether the board has confirmed everything that was commanded. Before, a command may be lost with the wire.
    fn is_settled(&self) -> bool;

    /// Reads and plans a program, beside everything else; [`BoardEvent::Loaded`] or [`BoardEvent::NotLoaded`] tells what came of
    /// it. It takes the place of the one before.
    ///
    /// # Errors
    /// A program is under way.
    fn load(&mut self, source: Source) -> Result<(), BoardError>;

    /// Drives the program from its start: first straight to where it begins.
    ///
    /// # Errors
    /// There is no program, something is under way, or the board is lost, off or in a fault.
    fn start(&mut self) -> Result<(), BoardError>;

    /// Comes to rest on the path.
    fn hold(&mut self);

    /// Goes on after a hold, or a program stop.
    ///
    /// # Errors
    /// The board is lost: it would start whenever the wire is back.
    fn resume(&mut self) -> Result<(), BoardError>;

    /// Comes to rest on the path, and gives up the rest.
    fn abort(&mut self);

    /// Sets the feed override \[0.1 %\].
    ///
    /// # Errors
    /// More than 2000 is asked for, or the board has not answered.
    fn set_override(&mut self, permille: u16) -> Result<(), BoardError>;

    /// Rest at the end of every program block.
    fn set_single_block(&mut self, is_on: bool);

    /// Switches the drives. What was under way is given up.
    ///
    /// # Errors
    /// They are to go on in a fault.
    fn set_drives(&mut self, are_on: bool) -> Result<(), BoardError>;

    /// Clears a fault.
    fn clear_fault(&mut self);

    /// Presses a jog key, at `feed_mm_s` or at the axis' greatest feed, until [`Board::release_key`], its distance, or the soft
    /// limit. Its own release after ticks does not count. Where nothing is heard of this side for the dead man's time, the
    /// board holds by itself.
    ///
    /// # Errors
    /// There is no such axis or feed, something is under way, or the board is lost, off or in a fault.
    fn press_key(&mut self, press: &Press, feed_mm_s: Option<f64>) -> Result<(), BoardError>;

    /// Releases the jog key, if one is pressed.
    fn release_key(&mut self);

    /// Homes these axes one after the other, in the machine's order; without any, all that have `[axis.homing]`. A hold or an abort
    /// ends it at rest. Where nothing is heard of this side for the dead man's time, the board ends it by itself.
    ///
    /// # Errors
    /// An axis has no `[axis.homing]`, something is under way, or the board is lost, off or in a fault.
    fn home(&mut self, axes: &[String]) -> Result<(), BoardError>;

    /// Has every tick told from now on: asks for the board's parameters first, which takes a moment. It is to be done before
    /// anything moves.
    ///
    /// # Errors
    /// Something is under way, or the board's ticks can't be had.
    fn watch_ticks(&mut self) -> Result<(), BoardError>;

    /// Keeps the ticks around the next one where `trigger` holds, or the next `after` ones; see
    /// [`BoardEvent::Captured`].
    ///
    /// # Errors
    /// There is no axis of the trigger's name, too much is asked for, or ticks are not watched and can't be now.
    fn capture(&mut self, trigger: Option<Condition>, before: usize, after: usize) -> Result<(), BoardError>;

    /// What was captured.
    fn take_capture(&mut self) -> Option<RunTrace<AXES_MAX>>;
}

/// What a board is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoardInfo {
    /// The machine's name.
    pub machine: String,
    /// Where the board is.
    pub port: String,
    /// The control tick \[s\].
    pub tick_s: f64,
    /// Whether it computes in fixed point.
    pub is_fixed_point: bool,
    /// Its axes.
    pub axes: Vec<BoardAxis>,
}

/// An axis of a board.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoardAxis {
    /// Its name.
    pub name: String,
    /// `mm`, or `°`.
    pub unit: &'static str,
    /// Soft limits \[mm, °\].
    pub travel_mm: Option<[f64; 2]>,
    /// Its greatest feed \[mm/s, °/s\].
    pub feed_mm_s: f64,
    /// Whether it can be homed.
    pub has_homing: bool,
}

/// What is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UnderWay {
    /// Nothing of this side.
    #[default]
    Nothing,
    /// The program.
    Program,
    /// A jog.
    Jog,
    /// Homing.
    Homing,
}

/// What a board does.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BoardState {
    /// Whether the wire is broken, or the board silent. What follows is what it has told before.
    pub is_lost: bool,
    /// The tick; it wraps.
    pub tick: u32,
    /// The machine's state; none before the board has told it.
    #[serde(serialize_with = "as_words")]
    pub state: Option<State>,
    /// What this side has under way.
    pub under_way: UnderWay,
    /// The board holds a program that another start of this side, or somebody else, has begun; [`Board::abort`] gives it up.
    pub is_foreign: bool,
    /// Set position of each axis \[mm, °\].
    pub set_mm: Vec<f64>,
    /// Actual position of each axis \[mm, °\].
    pub actual_mm: Vec<f64>,
    /// Feed along the path \[mm/s\].
    pub feed_mm_s: f64,
    /// The program line; 0 at rest.
    pub line: u32,
    /// The feed override \[0.1 %\].
    pub override_permille: u16,
    /// Rest after every block.
    pub is_single_block: bool,
    /// Whether the inputs allow the drives to be on.
    pub is_ready: bool,
    /// Whether each axis is homed.
    pub homed: Vec<bool>,
    /// The axis that is being homed.
    pub homing: Option<String>,
    /// What went wrong, until it is cleared.
    pub fault: Option<String>,
    /// Stops on the path because items came too late.
    pub starvations: u32,
    /// The program that is loaded.
    pub program: Option<String>,
    /// Items of the program that the board has taken, of how many.
    pub items: Option<[usize; 2]>,
    /// Ticks are to be captured, and are not yet.
    pub is_capturing: bool,
}

/// What has happened.
#[derive(Debug)]
pub enum BoardEvent {
    /// The wire is broken, or nothing comes any more: the board comes to rest on the path. It holds when the wire is back.
    Lost(String),
    /// The wire is back.
    Back,
    /// The board has started anew; nothing is under way.
    Restarted,
    /// A program is read and planned, with notes for the operator.
    Loaded(Vec<String>),
    /// A program is refused.
    NotLoaded(BoardError),
    /// The program is at a stop, with what it says of it.
    Stopped(String),
    /// All of it is driven.
    Done(UnderWay),
    /// It was aborted, or released, and the machine is at rest.
    Aborted(UnderWay),
    /// It has ended for this reason.
    Failed(UnderWay, BoardError),
    /// There is something for [`Board::take_capture`].
    Captured {
        /// Ticks in between that are missing.
        missing: u64,
    },
    /// Ticks are not told any more: one differed.
    ScopeFailed(String),
    /// Somebody else has asked the board since: it obeys this side no more.
    Replaced,
}

/// The word for a state.
#[must_use]
pub fn state_words(state: State) -> &'static str {
    match state {
        State::Off => "drives off",
        State::Idle => "idle",
        State::Moving => "moving",
        State::Dwell => "dwell",
        State::Stopped => "program stop",
        State::Starved => "waiting for items",
        State::Held => "held",
        State::Refused => "refused",
        State::Homing => "homing",
    }
}

// As serde calls it.
#[allow(clippy::ref_option)]
fn as_words<S: serde::Serializer>(state: &Option<State>, to: S) -> Result<S::Ok, S::Error> {
    state.map(state_words).serialize(to)
}

/// Steps until `is_it`, which sees every event, says so of one, for at most `limit`; the first such event, if there was one.
pub fn wait_for(
    board: &mut dyn Board,
    limit: Duration,
    is_it: &mut dyn FnMut(&BoardEvent) -> bool,
) -> Option<BoardEvent> {
    let begin = Instant::now();
    while begin.elapsed() < limit {
        // All of them are looked at.
        let events = board.step(Duration::from_millis(5)).into_iter().filter(|event| is_it(event));
        if let Some(event) = events.collect::<Vec<_>>().into_iter().next() {
            return Some(event);
        }
    }
    None
}

/// Steps until what is under way has come to its end, for at most `limit`. Whether it has come to it, or was aborted; none if
/// neither within the limit.
///
/// # Errors
/// Why it has ended early.
pub fn wait_until_at_rest(board: &mut dyn Board, limit: Duration) -> Result<Option<bool>, BoardError> {
    let mut is_end = |event: &BoardEvent| {
        matches!(event, BoardEvent::Done(_) | BoardEvent::Aborted(_) | BoardEvent::Failed(..))
    };
    match wait_for(board, limit, &mut is_end) {
        Some(BoardEvent::Failed(_, error)) => Err(error),
        Some(event) => Ok(Some(matches!(event, BoardEvent::Done(_)))),
        None => Ok(None),
    }
}
