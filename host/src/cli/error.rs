//! Errors of the command line and their exit statuses.

use std::io;
use std::process::ExitCode;

use thiserror::Error;

use crate::drive::DriveError;
use crate::flight::FlightError;
use crate::gcode::GcodeError;
use crate::machine::{AxisError, MachineError};
use crate::planning::PlanningError;
use crate::points::PointsError;
use crate::recording::RecordingError;
use crate::simulate::RunError;
use crate::simulate::home::HomeError;
use crate::simulate::jog::JogError;
use crate::simulate::session::SessionError;
use crate::toolpath::spline::SplineError;
use crate::tuning::TuningError;

/// How a command that ran to its end ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything is as it should be.
    Done,
    /// The run ended in a fault, or a check failed.
    Failed,
}

impl Outcome {
    /// 0 or 1.
    #[must_use]
    pub fn exit_code(self) -> ExitCode {
        match self {
            Self::Done => ExitCode::SUCCESS,
            Self::Failed => ExitCode::FAILURE,
        }
    }
}

/// Why a command could not do its work. Displays as one line.
#[derive(Debug, Error)]
pub enum CliError {
    /// A file can't be read.
    #[error("{path}: found {source}, expected a readable file")]
    Read {
        /// As the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A file can't be written.
    #[error("{path}: found {source}, expected a file that can be written")]
    Write {
        /// As the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
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
    /// The number type that was asked for does not hold an axis.
    #[error("machine {machine:?}: {source}")]
    Axis {
        /// The machine's name.
        machine: String,
        /// Which axis, and why.
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
        /// As the user gave it.
        path: String,
        /// Why.
        source: RecordingError,
    },
    /// The log has no good frames of a flight recorder.
    #[error("{path}{source}")]
    Flight {
        /// As the user gave it.
        path: String,
        /// Why.
        source: FlightError,
    },
    /// The machine is not homed.
    #[error("{machine}: {source}")]
    Home {
        /// Its file.
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
    /// There is nothing to tune an axis by.
    #[error(transparent)]
    Tuning(#[from] TuningError),
    /// Programs among several are refused.
    #[error("{}", programs.join("\nmotion: "))]
    Refused {
        /// Why, one by one.
        programs: Vec<String>,
    },
    /// Arguments that are right one by one and don't fit together.
    #[error("found {found}, expected {expected}")]
    Arguments {
        /// What they amount to.
        found: String,
        /// What would fit.
        expected: &'static str,
    },
}

impl CliError {
    /// 2, but for output that failed, for a plan that the kernel refuses, for an experiment that ended in a fault or
    /// found nothing to measure, for one that found too little to tune by, for an axis that found no reference, and for a
    /// jog or a homing that ended in a fault or that the kernel refuses: these are not the user's input.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Output(_) | Self::Tuning(_) | Self::Run { source: RunError::Rejected(_), .. } => {
                ExitCode::FAILURE
            }
            Self::Home { source: HomeError::Axis { .. }, .. } => ExitCode::FAILURE,
            Self::Home { source: HomeError::Session(ended), .. }
            | Self::Jog(JogError::Session { source: ended, .. }) => ended_badly(ended),
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

/// A fault, or motion that the kernel refuses, is not the user's input.
fn ended_badly(error: &SessionError) -> ExitCode {
    match error {
        SessionError::Fault(_) | SessionError::Moves | SessionError::Run(RunError::Rejected(_)) => {
            ExitCode::FAILURE
        }
        SessionError::Run(_) => ExitCode::from(2),
    }
}
