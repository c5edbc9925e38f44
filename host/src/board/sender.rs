//! Drives a job on a board: drives on, to the program's start, the program.
//!
//! Consumes what is heard of a [`Connection`]; produces the link's commands and items, one [`Sender::advance`] after the
//! other, and never waits.

use std::time::{Duration, Instant};

use motion_kernel::hal::{BoardOutputs, Spindle};
use motion_kernel::link::{Event, Identity, Mode, PROTOCOL, State, Status};
use motion_kernel::program::{FORMAT, Item};
use motion_kernel::straight::Straight;

use super::connection::{Connection, Heard};
use super::error::{Agreement, BoardError};
use super::job::Job;
use crate::simulate::faults;

/// The longest time for an answer.
const ANSWER: Duration = Duration::from_secs(10);
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
    /// Comes to rest after an abort.
    Aborts,
    /// All is driven.
    Done,
    /// It was aborted, and is at rest.
    Aborted,
}

/// Drives a job.
pub struct Sender<'a, const M: usize> {
    job: &'a Job<M>,
    /// Names of the machine's axes, for errors.
    axes: &'a [String],
    may: Permissions,
    step: Step,
    since: Instant,
    /// The operator has held: nothing here starts motion.
    is_held: bool,
    way: Vec<Item<M>>,
    /// Items pushed of the way or the job, the end of it among them.
    pushed: usize,
}

impl<'a, const M: usize> Sender<'a, M> {
    /// Before the greeting.
    #[must_use]
    pub fn new(job: &'a Job<M>, axes: &'a [String], may: Permissions) -> Self {
        let since = Instant::now();
        Self { job, axes, may, step: Step::Greets, since, is_held: false, way: Vec::new(), pushed: 0 }
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
            Event::Welcome(identity) => self.check(&identity),
            Event::Refused(identity) => self.check(&identity).and(Err(BoardError::Silent)),
            Event::Restarted { confirmed } => {
                let of_program = if self.step == Step::Drives { confirmed } else { 0 };
                Err(BoardError::Reset { confirmed: of_program, at: self.line_at(of_program) })
            }
            Event::Unreadable { item } => Err(BoardError::Item { at: self.line_at(item) }),
            Event::Ready { .. }
            | Event::Status(_)
            | Event::Parameters { .. }
            | Event::Written { .. }
            | Event::Scope { .. } => Ok(()),
        }
    }

    /// Whether the board is one for the job.
    ///
    /// # Errors
    /// In what it is not.
    pub fn check(&self, identity: &Identity) -> Result<(), BoardError> {
        let job = self.job;
        let pairs = [
            (Agreement::Protocol, identity.protocol.to_string(), PROTOCOL.to_string()),
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
                self.go(Step::Aborted);
            }
            Step::ToStart | Step::Drives => self.drive(&status, connection)?,
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
        let of = self.job.items.len() as u32 + 1;
        let program = connection.controls().program;
        let is_mine = program == self.job.name && next > 0;
        let is_finished = status.state == State::Idle && status.taken == next && status.is_ended;
        match self.may.found {
            Found::Continued if !is_mine => return Err(BoardError::NotBegun),
            Found::Continued if status.fault.is_some() => {
                return Err(BoardError::Interrupted { why: "a fault" });
            }
            Found::Continued if status.state == State::Off => {
                return Err(BoardError::Interrupted { why: "the drives off" });
            }
            Found::Continued => {
                self.pushed = next as usize;
                self.job.items.iter().take(self.pushed).for_each(|item| connection.skip(item));
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
        let way: Straight<M> =
            motion_board::runs::to_start(&self.job.header, status.set).map_err(BoardError::NoWay)?;
        self.way = way.map(|item| item.unwrap_or_else(|never| match never {})).collect();
        if self.way.is_empty() {
            self.begin(connection);
            return Ok(());
        }
        self.pushed = 0;
        self.run(connection);
        self.go(Step::ToStart);
        Ok(())
    }

    /// Begins the program, at its start.
    fn begin(&mut self, connection: &mut Connection<M>) {
        self.pushed = 0;
        let _ = connection.command(|link| link.begin(self.job.name));
        self.run(connection);
        self.go(Step::Drives);
    }

    /// Pushes items, and sees whether all are driven.
    fn drive(&mut self, status: &Status<M>, connection: &mut Connection<M>) -> Result<(), BoardError> {
        let items = if self.step == Step::ToStart { &self.way } else { &self.job.items };
        match status.state {
            State::Off => return Err(BoardError::SwitchedOff),
            State::Refused => return Err(BoardError::Item { at: self.line_at(status.taken) }),
            _ => {}
        }
        while self.pushed <= items.len()
            && connection.push(items.get(self.pushed)).map_err(BoardError::Push)?
        {
            self.pushed += 1;
        }
        if self.pushed > items.len() && connection.is_driven() {
            if self.step == Step::ToStart {
                self.begin(connection);
            } else {
                self.end(connection);
            }
        }
        Ok(())
    }

    /// All is driven.
    fn end(&mut self, connection: &mut Connection<M>) {
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

    /// The program line of an item, in words.
    fn line_at(&self, item: u32) -> String {
        self.job.line_of(item).map_or_else(String::new, |line| format!(", at line {line} of the program"))
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
    let mut speed_rpm = None;
    for (number, item) in (0..).zip(&job.items) {
        let Item::Switch(to) = item else { continue };
        let found = match has {
            BoardOutputs::CommandedSpeed => continue,
            BoardOutputs::None => "spindle or coolant",
            BoardOutputs::FixedSpeed if to.spindle == Spindle::Counterclockwise => "M4",
            BoardOutputs::FixedSpeed
                if to.spindle_turns() && *speed_rpm.get_or_insert(to.speed_rpm) != to.speed_rpm =>
            {
                "a second speed of the spindle"
            }
            BoardOutputs::FixedSpeed => continue,
        };
        let (program, line) = (program.to_owned(), job.line_of(number).unwrap_or(0));
        return Err(BoardError::Outputs { program, line, found, has });
    }
    Ok(())
}
