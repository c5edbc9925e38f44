//! `motion resume`: goes on with a program after a power cut, of the board, the PC, or both.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use motion_kernel::num::Root;
use motion_kernel::program::Checksum;
use thiserror::Error;

use super::confirm::Middle;
use super::journal::{Record, default_path};
use super::{SendArguments, job_name, send_program};
use crate::board::{Connection, Job};
use crate::cli::error::{CliError, Outcome};
use crate::cli::input;
use crate::cli::port::{DriveArguments, PortArguments};
use crate::cli::scope::ScopeArguments;
use crate::gcode::{Program, StepKind};
use crate::planning::PlanningError;

const EXAMPLES: &str = "\
Examples:
  motion resume --port /dev/ttyACM0            goes on with what `motion send` drove there last
  motion resume part.journal.json --port /dev/ttyACM0 --enable --homed
                                               after the board was off, and the machine was homed

The program goes on at the start of the piece of path that was under way. The machine first moves straight there, with
spindle and coolant on as the program has them: bring it to a place from where that way is free.

A board that was off does not know where the machine is: home it, so that the board's zero is the one of before, and say so
with --homed. A board that has run since still knows it.

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
    /// The machine is homed: the board's zero is the one of before.
    #[arg(long)]
    homed: bool,
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
}

/// A journal that is gone on with.
pub(super) struct Resumed {
    path: PathBuf,
    record: Record,
    is_homed: bool,
}

/// Reads the journal, and goes on.
///
/// # Errors
/// The journal is refused, or what it is about is not the same any more; else those of [`send`](super::send).
pub fn resume(arguments: &ResumeArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let &ResumeArguments { ref journal, ref port, homed, yes, drives, ref scope, json } = arguments;
    let path = match journal.clone().or_else(|| default_path(&port.port)) {
        Some(path) => path,
        None => {
            let found = "no journal".to_owned();
            return Err(CliError::Arguments { found, expected: "one to go on with" });
        }
    };
    let record = Record::read(&path)?;
    let resumed = Resumed { path, record, is_homed: homed };
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
    pub(super) fn rest<R: Root, const M: usize>(
        &self,
        program: &Program,
        (job, input): (&Job<M>, u32),
        is_confirmed: bool,
        connection: &Connection<M>,
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
        if !self.is_homed && (record.session.is_none() || connection.session() != record.session) {
            return Err(self.refused(ResumeError::Position));
        }
        let item = job.item_behind(record.driven);
        let name = record.program.display().to_string();
        let rest = job.from_item::<R>(item).map_err(|problem| PlanningError::at_line(&name, problem))?;
        let begins =
            rest.line_of(0).map_or_else(|| "behind the path".to_owned(), |line| format!("at line {line}"));
        let place = format!("{name} was interrupted in line {}: goes on {begins}", record.line);
        let tool = tool_behind(program, rest.begin.stops);
        Ok((rest, Middle { place, tool, is_confirmed }))
    }
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
