//! Errors of the command line and their exit statuses.

use std::io;
use std::process::ExitCode;

use thiserror::Error;

use crate::board::BoardError;
use crate::board::emulated::EmulatedError;
use crate::board::from_line::FromLineError;
use crate::cli::send::resume::ResumeError;
use crate::drive::DriveError;
use crate::drive::recorded::RecordedError;
use crate::files::FilesError;
use crate::flight::FlightError;
use crate::gcode::GcodeError;
use crate::identify::ScrewError;
use crate::machine::{AxisError, MachineError};
use crate::planning::PlanningError;
use crate::points::PointsError;
use crate::recording::RecordingError;
use crate::simulate::home::HomeError;
use crate::simulate::jog::JogError;
use crate::simulate::session::SessionError;
use crate::simulate::{Probed, RunError, RunSummary};
use crate::toolpath::spline::SplineError;
use crate::trace::RunEnd;
use crate::tuning::TuningError;

/// How a command that printed its results ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything is right.
    Done,
    /// The run ended in a fault, or a check failed.
    Failed,
    /// The run was held, and nothing resumed it.
    Held,
    /// The run was aborted.
    Aborted,
}

impl Outcome {
    /// The outcome of a run.
    #[must_use]
    pub fn of(summary: &RunSummary) -> Self {
        match summary.end {
            // The program would have gone on otherwise, or not at all.
            RunEnd::Finished if summary.probes.iter().any(Probed::disagrees) => Self::Failed,
            RunEnd::Finished => Self::Done,
            RunEnd::Faulted | RunEnd::Cut => Self::Failed,
            RunEnd::Held(_) => Self::Held,
            RunEnd::Aborted => Self::Aborted,
        }
    }

    /// 0, 1, 3 or 4: see [`cli`](super).
    #[must_use]
    pub fn exit_code(self) -> ExitCode {
        ExitCode::from(match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Held => 3,
            Self::Aborted => 4,
        })
    }
}

/// Why a command could not do its work. Displays as one line, and several errors as a line each.
#[derive(Debug, Error)]
pub enum CliError {
    /// A file can't be read.
    #[error("{path}: found {source}, expected a readable file")]
    Read {
        /// The path, as the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
    /// There is no module for a page.
    #[error(
        "{path}: found {found}, expected the module of the page; host/wasm/build of the repository builds it"
    )]
    NoModule {
        /// Where it was looked for.
        path: String,
        /// What is there.
        found: String,
    },
    /// A program can't be begun at a line.
    #[error("{program}:{line}: {source}")]
    FromLine {
        /// The program.
        program: String,
        /// The line asked for.
        line: u32,
        /// Why not.
        source: FromLineError,
    },
    /// The file is no journal of a program under way.
    #[error("{path}: found no journal, expected one that `motion send` has written")]
    NoJournal {
        /// The path, as the user gave it.
        path: String,
    },
    /// A journal's program can't be gone on with.
    #[error("{path}: {source}")]
    Resume {
        /// The path of the journal.
        path: String,
        /// Why not.
        source: ResumeError,
    },
    /// A folder can't be read.
    #[error("{path}: found {source}, expected a folder that can be used")]
    Folder {
        /// The path, as the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A file must not be written, or can't be opened: found before the work.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A file could not be written; the results were printed.
    #[error(transparent)]
    Unwritten(FilesError),
    /// More than one, the one with the command's exit status first.
    #[error("{}", .0.iter().map(Self::to_string).collect::<Vec<_>>().join("\nmotion: "))]
    Several(Vec<Self>),
    /// The run ended before commands were due; its results were printed.
    #[error(
        "--at {commands}: found the end of the run in tick {last_tick}, expected commands within the run"
    )]
    Unreached {
        /// The commands, as the user gave them.
        commands: String,
        /// The last tick of the run.
        last_tick: u64,
        /// How the run ended.
        outcome: Outcome,
    },
    /// Standard output can't be written.
    #[error("standard output: found {0}, expected a place that can be written")]
    Output(#[source] io::Error),
    /// The program is not G-code.
    #[error(transparent)]
    Gcode(#[from] GcodeError),
    /// The file is no list of points.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// A recording of an axis can't be used.
    #[error(transparent)]
    Recorded(#[from] RecordedError),
    /// Measured positions do not determine a screw.
    #[error("{name}: {source}")]
    Screw {
        /// The file, or the simulated machine.
        name: String,
        /// Why not.
        source: ScrewError,
    },
    /// The points have no spline.
    #[error("{place}: found {source}")]
    Spline {
        /// The file, and the line if it is about one.
        place: String,
        /// Why.
        source: SplineError,
    },
    /// The machine file is refused.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// The number type asked for does not hold an axis.
    #[error("machine {machine:?}: {source}")]
    Axis {
        /// The machine's name.
        machine: String,
        /// The axis, and why.
        source: AxisError,
    },
    /// There is no plan.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The run can't be made.
    #[error("{program}: {source}")]
    Run {
        /// The program.
        program: String,
        /// Why.
        source: RunError,
    },
    /// The file is no recording.
    #[error("{path}: {source}")]
    Recording {
        /// The path, as the user gave it.
        path: String,
        /// Why.
        source: RecordingError,
    },
    /// The log has no good frames of a flight recorder.
    #[error("{path}{source}")]
    Flight {
        /// The path, as the user gave it.
        path: String,
        /// Why.
        source: FlightError,
    },
    /// The machine is not homed.
    #[error("{machine}: {source}")]
    Home {
        /// The machine's file.
        machine: String,
        /// Why.
        source: HomeError,
    },
    /// The machine did not jog as asked.
    #[error(transparent)]
    Jog(#[from] JogError),
    /// The drive experiment can't be made, or a fault ended it.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// There is too little to tune an axis by.
    #[error(transparent)]
    Tuning(#[from] TuningError),
    /// A board, or what leads to it, is refused; or it is in a fault.
    #[error("{port}: {source}")]
    Board {
        /// Where it is.
        port: String,
        /// Why.
        source: BoardError,
    },
    /// A program that is planned while it is driven can't be read or planned to its end.
    #[error("{0}; nothing behind that place is driven")]
    Program(Box<dyn std::error::Error + Send + Sync>),
    /// A board can't take connections there.
    #[error("--listen {address}: found {source}, expected an address of this computer that is free")]
    Listen {
        /// The address, as the user gave it.
        address: String,
        /// The system's reason.
        source: io::Error,
    },
    /// There is no emulated board.
    #[error(transparent)]
    Emulated(#[from] EmulatedError),
    /// Programs among several are refused.
    #[error("{}", programs.join("\nmotion: "))]
    Refused {
        /// Why, one by one.
        programs: Vec<String>,
    },
    /// There is no such column.
    #[error("found the column {found}, expected one of {expected}")]
    Column {
        /// The name.
        found: String,
        /// Those that there are.
        expected: String,
    },
    /// Arguments that are right one by one but don't fit together.
    #[error("found {found}, expected {expected}")]
    Arguments {
        /// The combination found.
        found: String,
        /// What would fit.
        expected: &'static str,
    },
}

impl CliError {
    /// The error of a run that ended before commands of its script were due; else `outcome`.
    ///
    /// # Errors
    /// There are such commands.
    pub fn of_unreached(summary: &RunSummary, outcome: Outcome) -> Result<Outcome, Self> {
        if summary.unreached.is_empty() {
            return Ok(outcome);
        }
        let (commands, last_tick) = (summary.unreached.join(","), summary.ticks.saturating_sub(1));
        Err(Self::Unreached { commands, last_tick, outcome })
    }

    /// The last outcome of `parts`, or all their errors; the first of these has the exit status.
    ///
    /// # Errors
    /// A part failed.
    pub fn all(parts: impl IntoIterator<Item = Result<Outcome, Self>>) -> Result<Outcome, Self> {
        let (mut outcome, mut errors) = (Outcome::Done, Vec::new());
        for part in parts {
            match part {
                Ok(found) => outcome = found,
                Err(error) => errors.push(error),
            }
        }
        match errors.len() {
            0 => Ok(outcome),
            1 => Err(errors.remove(0)),
            _ => Err(Self::Several(errors)),
        }
    }

    /// 2 if the user's input is wrong. Otherwise 6 for results that could not be written; 5 for commands that
    /// a finished run did not reach; 1 for a fault, for a plan or a motion that the kernel refuses, for an
    /// experiment that found nothing to measure or too little to tune by, for an axis that found no reference,
    /// and for a board that is in a fault or lost.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Several(errors) => errors.first().map_or(ExitCode::FAILURE, Self::exit_code),
            Self::Output(_) | Self::Unwritten(_) => ExitCode::from(6),
            Self::Unreached { outcome: Outcome::Done, .. } => ExitCode::from(5),
            Self::Unreached { outcome, .. } => outcome.exit_code(),
            Self::Tuning(_) | Self::Run { source: RunError::Rejected(_), .. } => ExitCode::FAILURE,
            Self::Home { source: HomeError::Axis { .. }, .. } => ExitCode::FAILURE,
            Self::Home { source: HomeError::Session(ended), .. }
            | Self::Jog(JogError::Session { source: ended, .. }) => ended_badly(ended),
            Self::Board { source, .. } if !source.is_input() => ExitCode::FAILURE,
            Self::Drive(
                DriveError::Fault { .. }
                | DriveError::NotSteady { .. }
                | DriveError::NoMotion { .. }
                | DriveError::Identification { .. }
                | DriveError::Run(RunError::Rejected(_)),
            ) => ExitCode::FAILURE,
            _ => ExitCode::from(2),
        }
    }
}

/// A fault, or motion that the kernel refuses, is not wrong input.
fn ended_badly(error: &SessionError) -> ExitCode {
    match error {
        SessionError::Fault { .. } | SessionError::Moves | SessionError::Run(RunError::Rejected(_)) => {
            ExitCode::FAILURE
        }
        SessionError::Run(_) => ExitCode::from(2),
    }
}
