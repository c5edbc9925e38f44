//! `motion resume`: goes on with a program after a power cut, of the board, the PC, or both.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use motion_kernel::program::Checksum;
use thiserror::Error;

use super::confirm::Middle;
use super::journal::{Record, default_path};
use super::{SendArguments, job_name, send_program};
use crate::board::{Connection, Job, in_numbers};
use crate::cli::error::{CliError, Outcome};
use crate::cli::input;
use crate::cli::port::{DriveArguments, PortArguments};
use crate::cli::scope::ScopeArguments;
use crate::gcode::{Program, StepKind};
use crate::machine::{AxisSettings, Machine};
use crate::planning::PlanningError;

const EXAMPLES: &str = "\
Examples:
  motion resume --port /dev/ttyACM0            goes on with what `motion send` drove there last
  motion home --machine mine.toml --port /dev/ttyACM0 --enable
  motion resume part.journal.json --port /dev/ttyACM0
                                               after the board was off: its axes have [axis.homing]
  motion resume part.journal.json --port /dev/ttyACM0 --enable --homed
                                               the same of a machine whose axes are brought to their zero by hand

The program goes on at the start of the piece of path that was under way. The machine first moves straight there, with
spindle and coolant on as the program has them: bring it to a place from where that way is free.

A board that was off does not know where the machine is. Axes with [axis.homing] have to be homed with `motion home --port`, as
they were when the program was driven; the board says which are. Of the others say with --homed that the board's zero is the
one of before. A board that has run since still knows it, but for an axis whose encoder was lost.

Exit status: that of `motion send`; 2 if program, machine or options are not those of the journal.";

/// Go on with a program after a power cut, where `motion send` has left off.
///
/// Program, machine file, subroutines, tools and parameters have to be those of before.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ResumeArguments {
    /// The journal that `motion send` has written; without it, the last one of the port.
    journal: Option<PathBuf>,
    #[command(flatten)]
    port: PortArguments,
    /// The axes without [axis.homing] are at their place: the board's zero is the one of before.
    #[arg(long)]
    homed: bool,
    /// Go on although an axis with [axis.homing] is not homed: the board's zero is the one of before all the same.
    #[arg(long)]
    ignore_homing: bool,
    /// Confirm the first motion, for scripts.
    #[arg(long)]
    yes: bool,
    #[command(flatten)]
    drives: DriveArguments,
    #[command(flatten)]
    scope: ScopeArguments,
    /// Print lines of JSON, as `motion send` does.
    #[arg(long)]
    json: bool,
}

/// The longest time for a status.
const ANSWER: Duration = Duration::from_secs(5);

/// Why a journal's program can't be gone on with. Displays as "found …, expected …".
#[derive(Debug, Error)]
pub enum ResumeError {
    /// It was driven to its end.
    #[error("found a program that was driven to its end, expected one that was interrupted")]
    Finished,
    /// Its file has changed.
    #[error(
        "found {program} with the checksum {found:08x}, expected {expected:08x}: the program as it was begun"
    )]
    Program {
        /// The file.
        program: String,
        /// Its checksum.
        found: u32,
        /// That of before.
        expected: u32,
    },
    /// The machine has changed.
    #[error("found a machine with the checksum {found:08x}, expected {expected:08x}: the machine as it was")]
    Machine {
        /// Its checksum.
        found: u32,
        /// That of before.
        expected: u32,
    },
    /// Something else has changed.
    #[error(
        "found other motion than was begun, expected the same subroutines, tools and parameters, the same board and the same \
         version of `motion`"
    )]
    Items,
    /// Nobody knows where the machine is.
    #[error(
        "found a board that has started anew and does not know where the machine is, expected --homed once the machine is homed"
    )]
    Position,
    /// An axis is not homed.
    #[error(
        "found axis {0} not homed, expected it homed by `motion home --port`, or --ignore-homing if the board's zero is the one of before"
    )]
    NotHomed(String),
    /// An axis was not homed when the program was driven.
    #[error(
        "found a program that was driven before axis {0} was homed: its zero of then is lost, expected --ignore-homing once the \
         board's zero is the one of before"
    )]
    HomedSince(String),
}

/// A journal that is gone on with.
pub(super) struct Resumed {
    path: PathBuf,
    record: Record,
    is_homed: bool,
    ignores_homing: bool,
}

/// Reads the journal, and goes on.
///
/// # Errors
/// The journal is refused, or what it is about is not the same any more; else those of [`send`](super::send).
pub fn resume(arguments: &ResumeArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let &ResumeArguments { ref journal, ref port, homed, ignore_homing, yes, drives, ref scope, json } =
        arguments;
    let path = match journal.clone().or_else(|| default_path(&port.port)) {
        Some(path) => path,
        None => {
            let found = "no journal".to_owned();
            return Err(CliError::Arguments { found, expected: "one to go on with" });
        }
    };
    let record = Record::read(&path)?;
    let resumed = Resumed { path, record, is_homed: homed, ignores_homing: ignore_homing };
    if resumed.record.is_finished {
        return Err(resumed.refused(ResumeError::Finished));
    }
    let record = &resumed.record;
    let found = Checksum::of(&input::read(&record.program)?.text);
    if found != record.program_sum {
        let (program, expected) = (record.program.display().to_string(), record.program_sum);
        return Err(resumed.refused(ResumeError::Program { program, found, expected }));
    }
    let arguments = SendArguments {
        program: record.program.clone(),
        port: port.clone(),
        machine: record.machine.clone(),
        reading: record.reading.clone(),
        from_line: None,
        stream: false,
        yes,
        drives,
        journal: Some(resumed.path.clone()),
        continues: false,
        restart: false,
        no_spindle: record.no_spindle,
        scope: scope.clone(),
        json,
    };
    send_program(&arguments, Some(&resumed), out)
}

impl Resumed {
    fn refused(&self, source: ResumeError) -> CliError {
        CliError::Resume { path: self.path.display().to_string(), source }
    }

    /// Whether a program on the board is the one that was interrupted, or is this one begun anew.
    pub(super) fn is_of(&self, program: u32) -> bool {
        [self.record.job, self.record.name].contains(&program)
    }

    /// What is left of the whole `job`, which is made of what has the checksum `input`, if that is the one of before, on a board that knows where the machine is.
    pub(super) fn rest<const N: usize, const M: usize>(
        &self,
        machine: &Machine<N>,
        program: &Program,
        (job, input): (&Job<M>, u32),
        is_confirmed: bool,
        connection: &mut Connection<M>,
    ) -> Result<(Job<M>, Middle), CliError> {
        let record = &self.record;
        let (found, expected) = (job.machine, record.machine_sum);
        if found != expected {
            return Err(self.refused(ResumeError::Machine { found, expected }));
        }
        // It may have been planned while it was driven.
        if ![job.name, job_name(input, job.machine)].contains(&record.job) {
            return Err(self.refused(ResumeError::Items));
        }
        self.require_place(machine, connection)?;
        let item = job.item_behind(record.driven);
        let name = record.program.display().to_string();
        let rest = in_numbers!(connection.numbers(), R => job.from_item::<R>(item));
        let rest = rest.map_err(|problem| PlanningError::at_line(&name, problem))?;
        let begins =
            rest.line_of(0).map_or_else(|| "behind the path".to_owned(), |line| format!("at line {line}"));
        let place = format!("{name} was interrupted in line {}: goes on {begins}", record.line);
        let tool = tool_behind(program, rest.begin.stops);
        Ok((rest, Middle { place, tool, is_confirmed }))
    }
}

impl Resumed {
    /// Whether the board knows where the machine is.
    fn require_place<const N: usize, const M: usize>(
        &self,
        machine: &Machine<N>,
        connection: &mut Connection<M>,
    ) -> Result<(), CliError> {
        let record = &self.record;
        let has_run = record.session.is_some() && connection.session() == record.session;
        let axes = machine.driven_axes();
        let is_told = |axis: &AxisSettings| axis.homing.is_some();
        if !has_run && !self.is_homed && !axes.iter().all(is_told) {
            return Err(self.refused(ResumeError::Position));
        }
        if self.ignores_homing || !axes.iter().any(is_told) {
            return Ok(());
        }
        let homed = homed(connection).ok_or_else(|| self.refused(ResumeError::Position))?;
        for (number, axis) in axes.iter().enumerate().filter(|(_, axis)| is_told(axis)) {
            let was_homed = record.homed.as_ref().and_then(|homed| homed.get(number).copied());
            let is_homed = homed.get(number).copied().unwrap_or(false);
            if !is_homed && (was_homed == Some(true) || !has_run) {
                return Err(self.refused(ResumeError::NotHomed(axis.name.clone())));
            }
            // What was not driven yet has no zero to lose.
            let had_zero = record.homed.is_some() || record.driven > 0;
            if is_homed && had_zero && was_homed != Some(true) {
                return Err(self.refused(ResumeError::HomedSince(axis.name.clone())));
            }
        }
        Ok(())
    }
}

/// Which axes the board says are homed; none if it does not say.
fn homed<const M: usize>(connection: &mut Connection<M>) -> Option<[bool; M]> {
    let begin = Instant::now();
    while connection.status().is_none() && begin.elapsed() < ANSWER {
        connection.step(Duration::from_millis(10), &mut |_| {});
    }
    connection.status().map(|status| status.homed.map(|homed| homed.is_some()))
}

/// The tool in the spindle after so many program stops; 0: none that the program knows of.
fn tool_behind(program: &Program, stops: usize) -> u32 {
    let is_stop = |kind: &StepKind| matches!(kind, StepKind::Stop | StepKind::ToolChange { .. });
    let next = program.steps.iter().enumerate().filter(|(_, step)| is_stop(&step.kind)).nth(stops);
    match next.map_or(program.steps.len(), |(step, _)| step).checked_sub(1) {
        Some(step) => program.tool_at(step),
        None => 0,
    }
}
