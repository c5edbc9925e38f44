//! Drives a job on a board: drives on, to the program's start, the program.
//!
//! Consumes what is heard of a [`Connection`]; produces the link's commands and items, one [`Sender::advance`] after the
//! other, and never waits.

use std::sync::Arc;
use std::time::{Duration, Instant};

use motion_kernel::hal::{BoardOutputs, Spindle};
use motion_kernel::link::{Event, HomingProgress, Identity, Mode, State, Status};
use motion_kernel::program::{FORMAT, Item};
use motion_kernel::straight::Straight;

use super::connection::{ANSWER, Connection, Heard};
use super::error::{Agreement, BoardError};
use super::items::{InPlanning, Items, Next, Said};
use super::job::Job;
use crate::simulate::faults;
use crate::simulate::jog::WantedJog;

/// The longest time for drives to go on.
const ENABLE: Duration = Duration::from_secs(5);
/// The longest time for an abort: a stop from any feed, and a busy board.
const REST: Duration = Duration::from_secs(60);

/// What is to become of a program that the board has already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Found {
    /// It stays, and the job is refused.
    #[default]
    Stays,
    /// If it is the job's, the job goes on after it.
    Continued,
    /// It is given up.
    GivenUp,
}

/// What a sender may do.
#[derive(Clone, Copy, Debug, Default)]
pub struct Permissions {
    /// To switch the drives on.
    pub enables: bool,
    /// To clear a fault before that.
    pub clears_fault: bool,
    /// To switch the drives off at the end.
    pub disables: bool,
    /// About what it finds.
    pub found: Found,
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Waits for the board's answer.
    Greets,
    /// Has a fault cleared.
    Clears,
    /// Has the drives switched on.
    Enables,
    /// Has what the board had given up.
    GivesUp,
    /// Drives to the program's start.
    ToStart,
    /// Drives the program.
    Drives,
    /// Has the drives switched off.
    Disables,
    /// Has axes homed.
    Homes,
    /// Comes to rest after an abort.
    Aborts,
    /// All is driven.
    Done,
    /// It was aborted, and is at rest.
    Aborted,
}

/// Drives a job.
pub struct Sender<const M: usize> {
    job: Arc<Job<M>>,
    items: Items<M>,
    /// Items that the board has from another sender, which are to be skipped.
    skips: u32,
    /// The end of the program under way is pushed.
    is_ended: bool,
    outputs: OutputCheck,
    /// Names of the machine's axes, for errors.
    axes: Arc<[String]>,
    may: Permissions,
    step: Step,
    since: Instant,
    /// The operator has held: nothing here starts motion.
    is_held: bool,
    /// The way to the job's start, with what is switched before it. It is a program of its own, or the beginning of the job's
    /// where that has switched something: between two programs all is off.
    way: Vec<Item<M>>,
    /// All there is to drive is a jog, with a dead man.
    jog: Option<(WantedJog, u16)>,
    /// All there is to do is to home axes, the lowest bit is the first one's, with a dead man.
    homes: Option<(u16, u16)>,
    /// Items pushed of the program under way, its end among them.
    pushed: usize,
}

impl<const M: usize> Sender<M> {
    /// Before the greeting.
    #[must_use]
    pub fn new(job: Arc<Job<M>>, axes: Arc<[String]>, may: Permissions) -> Self {
        let items = Items::Whole { job: Arc::clone(&job), next: 0 };
        Self::of(job, items, axes, may)
    }

    /// The same of a job whose items are planned while they are driven.
    #[must_use]
    pub fn planned(job: Arc<Job<M>>, planned: InPlanning<M>, axes: Arc<[String]>, may: Permissions) -> Self {
        Self::of(job, Items::Planned(Box::new(planned)), axes, may)
    }

    fn of(job: Arc<Job<M>>, items: Items<M>, axes: Arc<[String]>, may: Permissions) -> Self {
        Self {
            job,
            items,
            skips: 0,
            is_ended: false,
            outputs: OutputCheck::default(),
            axes,
            may,
            step: Step::Greets,
            since: Instant::now(),
            is_held: false,
            way: Vec::new(),
            jog: None,
            homes: None,
            pushed: 0,
        }
    }

    /// What the program has said since the last call, where it is planned while it is driven.
    pub fn take_said(&mut self) -> Vec<Said> {
        self.items.take_said()
    }

    /// Drives a jog and nothing else, which is a way of its own. After a silence of `dead_man_ms` the board holds.
    #[must_use]
    pub fn jogs(self, jog: WantedJog, dead_man_ms: u16) -> Self {
        Self { jog: Some((jog, dead_man_ms)), ..self }
    }

    /// Has axes homed and does nothing else: the lowest bit is the first one's. After a silence of `dead_man_ms` the board ends it.
    #[must_use]
    pub fn homes(self, axes: u16, dead_man_ms: u16) -> Self {
        Self { homes: Some((axes, dead_man_ms)), ..self }
    }

    /// How far it is.
    #[must_use]
    pub fn step(&self) -> Step {
        self.step
    }

    /// The operator holds: also what this would start next.
    pub fn hold(&mut self, connection: &mut Connection<M>) {
        self.is_held = true;
        // Where the board has not answered, nothing of this moves.
        let _ = connection.command(|link| link.press(Mode::Hold));
    }

    /// The operator resumes. False where the board is lost: it would start whenever the wire is back.
    pub fn resume(&mut self, connection: &mut Connection<M>) -> bool {
        if connection.is_lost() {
            return false;
        }
        self.is_held = false;
        // Before there is a program, the sender starts.
        if matches!(self.step, Step::ToStart | Step::Drives) {
            let _ = connection.command(|link| link.press(Mode::Run));
        }
        true
    }

    /// Starts what it is about to drive, unless the operator holds.
    fn run(&self, connection: &mut Connection<M>) {
        if !self.is_held {
            let _ = connection.command(|link| link.press(Mode::Run));
        }
    }

    /// The operator has aborted the program.
    pub fn abort(&mut self, connection: &mut Connection<M>) {
        if connection.command(|link| link.abort()) {
            self.go(Step::Aborts);
        }
    }

    fn go(&mut self, step: Step) {
        (self.step, self.since) = (step, Instant::now());
    }

    /// Takes what is heard.
    ///
    /// # Errors
    /// The board does not fit, was reset, or refuses an item.
    pub fn hear(&mut self, heard: &Heard<M>) -> Result<(), BoardError> {
        let event = match heard {
            Heard::Board(event) => event,
            Heard::Lost(_) => {
                self.is_held = true;
                return Ok(());
            }
            Heard::Back => return Ok(()),
        };
        match *event {
            Event::Replaced => Err(BoardError::Replaced),
            Event::Welcome(identity) => check(&self.job, &identity),
            Event::Foreign(build) => Err(BoardError::foreign(&build)),
            Event::Refused(identity) => check(&self.job, &identity).and(Err(BoardError::Silent)),
            Event::Restarted { confirmed } => {
                let of_program =
                    if self.step == Step::Drives { self.of_job(confirmed).unwrap_or(0) } else { 0 };
                Err(BoardError::Reset { confirmed: of_program, at: self.line_at(confirmed) })
            }
            Event::Unreadable { item } => Err(BoardError::Item { at: self.line_at(item) }),
            Event::Ready { .. }
            | Event::Status(_)
            | Event::Parameters { .. }
            | Event::Written { .. }
            | Event::Scope { .. }
            | Event::Flight { .. } => Ok(()),
        }
    }

    /// Does what can be done now. What motion does is told by the connection's status.
    ///
    /// # Errors
    /// The board is in a fault, or not to be used as it is.
    pub fn advance(&mut self, connection: &mut Connection<M>) -> Result<Step, BoardError> {
        if self.step == Step::Greets && self.since.elapsed() > ANSWER {
            return Err(BoardError::Silent);
        }
        let (Some(&status), Some(next)) = (connection.status(), connection.next()) else {
            // A command may have got lost, and comes again.
            return Ok(self.step);
        };
        // What becomes of homing in a fault the board tells.
        let may_be_faulted = match self.step {
            Step::Greets => true,
            Step::Clears => self.since.elapsed() <= ENABLE,
            _ => false,
        };
        if let Some(fault) = status.fault.filter(|_| !may_be_faulted) {
            return Err(self.fault(fault));
        }
        match self.step {
            Step::Greets => self.greeted(&status, next, connection)?,
            Step::Clears if status.fault.is_none() => self.enable(connection),
            Step::Enables if status.state != State::Off => self.approach(&status, connection)?,
            Step::Enables if self.since.elapsed() > ENABLE => {
                return Err(BoardError::StaysOff { is_ready: status.is_ready });
            }
            Step::GivesUp | Step::Aborts
                if self.since.elapsed() > REST
                    && !matches!(status.state, State::Held | State::Idle | State::Off) =>
            {
                return Err(BoardError::Moves);
            }
            Step::GivesUp if matches!(status.state, State::Held | State::Idle) => {
                self.approach(&status, connection)?;
            }
            Step::Aborts if matches!(status.state, State::Held | State::Idle | State::Off) => {
                if let Some(error) = self.items.take_failure() {
                    return Err(error);
                }
                self.go(Step::Aborted);
            }
            Step::ToStart | Step::Drives => self.drive(&status, connection)?,
            Step::Homes => self.home(&status, connection)?,
            Step::Disables if status.state == State::Off => self.go(Step::Done),
            Step::Disables
            | Step::Clears
            | Step::Enables
            | Step::GivesUp
            | Step::Aborts
            | Step::Done
            | Step::Aborted => {}
        }
        Ok(self.step)
    }

    /// The board has answered, and told what it does.
    fn greeted(
        &mut self,
        status: &Status<M>,
        next: u32,
        connection: &mut Connection<M>,
    ) -> Result<(), BoardError> {
        if let Some(fault) = status.fault
            && !(self.may.clears_fault && self.may.enables)
        {
            return Err(self.fault(fault));
        }
        let of = self.items.count().map(|count| count as u32 + 1);
        let program = connection.controls().program;
        let is_mine = program == self.job.name && next > 0;
        let is_finished = status.state == State::Idle && status.taken == next && status.is_ended;
        match self.may.found {
            // With a way of its own it has other items than were sent.
            Found::Continued if !is_mine || !self.job.begin.lead.is_empty() => {
                return Err(BoardError::NotBegun);
            }
            Found::Continued if status.fault.is_some() => {
                return Err(BoardError::Interrupted { why: "a fault" });
            }
            Found::Continued if status.state == State::Off => {
                return Err(BoardError::Interrupted { why: "the drives off" });
            }
            Found::Continued => {
                (self.pushed, self.skips) = (next as usize, next);
                self.go(Step::Drives);
                self.run(connection);
                return Ok(());
            }
            Found::Stays if is_mine && !is_finished => return Err(BoardError::Begun { has: next, of }),
            // The way to the start has no name.
            Found::Stays if program != 0 && next > 0 && !is_finished => return Err(BoardError::Busy),
            Found::Stays | Found::GivenUp => {}
        }
        if status.fault.is_some() {
            connection.command(|link| link.clear_fault());
            self.go(Step::Clears);
            return Ok(());
        }
        if status.state == State::Off {
            if !self.may.enables {
                return Err(BoardError::Off);
            }
            self.enable(connection);
            return Ok(());
        }
        connection.command(|link| link.abort());
        self.go(Step::GivesUp);
        Ok(())
    }

    fn enable(&mut self, connection: &mut Connection<M>) {
        connection.command(|link| link.enable(true));
        self.go(Step::Enables);
    }

    /// The board is at rest and waits for a program.
    fn approach(&mut self, status: &Status<M>, connection: &mut Connection<M>) -> Result<(), BoardError> {
        (self.pushed, self.is_ended) = (0, false);
        if let Some((axes, dead_man_ms)) = self.homes {
            let _ = connection.command(|link| link.home(axes, dead_man_ms));
            self.go(Step::Homes);
            return Ok(());
        }
        if let Some((jog, dead_man_ms)) = self.jog {
            self.way = jog
                .on_board(status.set)
                .map_err(BoardError::Jog)?
                .map(|item| item.unwrap_or_else(|never| match never {}))
                .collect();
            let _ = connection.command(|link| link.control(|controls| controls.dead_man_ms = dead_man_ms));
            self.run(connection);
            self.go(Step::ToStart);
            return Ok(());
        }
        let way: Straight<M> =
            motion_board::runs::to_start(&self.job.header, status.set).map_err(BoardError::NoWay)?;
        self.way = self.job.begin.lead.clone();
        self.way.extend(way.map(|item| item.unwrap_or_else(|never| match never {})));
        if self.way.is_empty() || !self.job.begin.lead.is_empty() {
            self.begin(connection);
            return Ok(());
        }
        self.run(connection);
        self.go(Step::ToStart);
        Ok(())
    }

    /// Begins the job's program.
    fn begin(&mut self, connection: &mut Connection<M>) {
        (self.pushed, self.is_ended) = (0, false);
        self.items.rewind();
        let _ = connection.command(|link| link.begin(self.job.name));
        self.run(connection);
        self.go(Step::Drives);
    }

    /// How many pieces of path and ends of stretches of the whole program are driven to their end; none before the program.
    #[must_use]
    pub fn driven(&self, status: &Status<M>) -> Option<u32> {
        if !matches!(self.step, Step::Drives | Step::Disables | Step::Done) {
            return None;
        }
        let is_path =
            |item: &&Item<M>| matches!(item, Item::Line { .. } | Item::Septic { .. } | Item::EndOfStretch(_));
        let of_way = self.way.iter().filter(is_path).count() as u32;
        Some(self.job.begin.path + status.driven.saturating_sub(of_way))
    }

    /// Sees what has become of homing.
    fn home(&mut self, status: &Status<M>, connection: &mut Connection<M>) -> Result<(), BoardError> {
        match status.homing {
            HomingProgress::Done => self.end(connection),
            HomingProgress::Failed { axis, failure } => {
                let axis = usize::from(axis);
                let axis = self.axes.get(axis).cloned().unwrap_or_else(|| format!("axis {axis}"));
                return Err(BoardError::NotHomed { axis, failure });
            }
            HomingProgress::None | HomingProgress::UnderWay { .. } => {}
        }
        Ok(())
    }

    /// Pushes items, and sees whether all are driven.
    fn drive(&mut self, status: &Status<M>, connection: &mut Connection<M>) -> Result<(), BoardError> {
        match status.state {
            State::Off => return Err(BoardError::SwitchedOff),
            State::Refused => return Err(BoardError::Item { at: self.line_at(status.taken) }),
            _ => {}
        }
        self.push(connection)?;
        if self.is_ended && self.step == Step::Drives && self.items.has_failed() {
            if self.items.is_in_stretch() {
                // What the board has of it does not end.
                self.abort(connection);
            } else if status.state == State::Idle && connection.has_all() {
                return self.items.take_failure().map_or(Ok(()), Err);
            }
            return Ok(());
        }
        if self.is_ended && connection.is_driven() {
            if self.step == Step::ToStart && self.jog.is_none() {
                self.way.clear();
                self.begin(connection);
            } else {
                self.end(connection);
            }
        }
        Ok(())
    }

    /// Pushes items while there is room for them, and behind the last one the end.
    fn push(&mut self, connection: &mut Connection<M>) -> Result<(), BoardError> {
        let has = connection.identity().map(|identity| identity.outputs);
        while !self.is_ended {
            let next = match self.way.get(self.pushed) {
                Some(item) => Next::Item(item),
                None if self.step == Step::ToStart => Next::End,
                None => self.items.next(),
            };
            let is_of_way = self.pushed < self.way.len();
            match next {
                Next::Wait => return Ok(()),
                Next::Item(item) if self.skips > 0 => {
                    connection.skip(item);
                    self.outputs.pass(item);
                    self.skips -= 1;
                    self.items.advance();
                    continue;
                }
                Next::Item(item) => {
                    if let Some((found, has)) =
                        has.and_then(|has| Some((self.outputs.check(item, has)?, has)))
                    {
                        // It is at rest there.
                        let (program, line) = (self.items.name().to_owned(), self.items.last_line());
                        self.items.fail(BoardError::Outputs { program, line, found, has });
                        continue;
                    }
                    if !connection.push(Some(item)).map_err(BoardError::Push)? {
                        return Ok(());
                    }
                    self.outputs.pass(item);
                }
                Next::End if self.skips > 0 => {
                    // The board has the end, too.
                    (self.skips, self.is_ended) = (0, true);
                }
                Next::End => {
                    if !connection.push(None).map_err(BoardError::Push)? {
                        return Ok(());
                    }
                    self.is_ended = true;
                }
            }
            self.pushed += 1;
            if !is_of_way && !self.is_ended {
                self.items.advance();
            }
        }
        Ok(())
    }

    /// All is driven.
    fn end(&mut self, connection: &mut Connection<M>) {
        if self.jog.is_some() || self.homes.is_some() {
            // At rest nothing is to be held.
            let _ = connection.command(|link| link.control(|controls| controls.dead_man_ms = 0));
        }
        if self.may.disables {
            let _ = connection.command(|link| link.enable(false));
            self.go(Step::Disables);
        } else {
            self.go(Step::Done);
        }
    }

    fn fault(&self, fault: motion_kernel::fault::Fault<f64>) -> BoardError {
        let name = |axis: usize| self.axes.get(axis).cloned().unwrap_or_else(|| format!("axis {axis}"));
        BoardError::Fault { tick: fault.tick, told: faults::told(&fault.kind, name) }
    }

    /// The number in the job of an item of the program under way; none of an item of the way.
    fn of_job(&self, item: u32) -> Option<u32> {
        item.checked_sub(self.way.len() as u32)
    }

    /// The program line of an item of the program under way, in words.
    fn line_at(&self, item: u32) -> String {
        let line = self.of_job(item).and_then(|item| self.items.line_of(item));
        line.map_or_else(String::new, |line| format!(", at line {line} of the program"))
    }
}

/// Whether the board is one for the job.
///
/// # Errors
/// In what it is not.
pub fn check<const M: usize>(job: &Job<M>, identity: &Identity) -> Result<(), BoardError> {
    let pairs = [
        (Agreement::Format, identity.format.to_string(), FORMAT.to_string()),
        (Agreement::Axes, identity.axes.to_string(), M.to_string()),
        (Agreement::Tick, identity.tick_s.to_string(), job.header.tick_s.to_string()),
        (Agreement::Machine, format!("{:08x}", identity.machine), format!("{:08x}", job.machine)),
    ];
    match pairs.into_iter().find(|(_, found, expected)| found != expected) {
        Some((what, found, expected)) => Err(BoardError::Disagrees { what, found, expected }),
        None => Ok(()),
    }
}

/// Whether the board has the outputs that the job switches.
///
/// # Errors
/// It has not: the program's line before which it is switched.
pub fn check_outputs<const M: usize>(
    program: &str,
    job: &Job<M>,
    has: BoardOutputs,
) -> Result<(), BoardError> {
    let mut check = OutputCheck::default();
    for (number, item) in (0_u32..).zip(job.begin.lead.iter().chain(&job.items)) {
        if let Some(found) = check.check(item, has) {
            let number = number.saturating_sub(job.begin.lead.len() as u32);
            let (program, line) = (program.to_owned(), job.line_of(number).unwrap_or(0));
            return Err(BoardError::Outputs { program, line, found, has });
        }
        check.pass(item);
    }
    Ok(())
}

/// Whether a board has the outputs that items switch, one after the other.
#[derive(Clone, Copy, Debug, Default)]
struct OutputCheck {
    /// The speed with which the spindle was switched on first.
    speed_rpm: Option<f64>,
}

impl OutputCheck {
    /// What the next item switches, if there is no output for it.
    fn check<const M: usize>(self, item: &Item<M>, has: BoardOutputs) -> Option<&'static str> {
        let Item::Switch(to) = item else { return None };
        match has {
            BoardOutputs::CommandedSpeed => None,
            BoardOutputs::None => Some("spindle or coolant"),
            BoardOutputs::FixedSpeed if to.spindle == Spindle::Counterclockwise => Some("M4"),
            BoardOutputs::FixedSpeed
                if to.spindle_turns()
                    && self.speed_rpm.is_some_and(|speed_rpm| speed_rpm != to.speed_rpm) =>
            {
                Some("a second speed of the spindle")
            }
            BoardOutputs::FixedSpeed => None,
        }
    }

    fn pass<const M: usize>(&mut self, item: &Item<M>) {
        if let Item::Switch(to) = item
            && to.spindle_turns()
        {
            self.speed_rpm.get_or_insert(to.speed_rpm);
        }
    }
}
