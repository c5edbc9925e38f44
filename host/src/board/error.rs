//! Why a board or a wire refuses. Displays as "found …, expected …", without the port's name.

use std::io;

use motion_kernel::hal::BoardOutputs;
use motion_kernel::link::{Build, HomingFailure, Identity, PushError, WriteError};
use motion_kernel::program::ProgramError;
use thiserror::Error;

use super::scope::ScopeError;
use super::trigger::{CAPTURE_MAX, Condition};
use crate::simulate::RunError;
use crate::simulate::home::HomesError;
use crate::simulate::jog::JogError;

/// What a board and a program have to agree on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Agreement {
    /// The version of the link's protocol, and the form of its messages.
    Build,
    /// The version of the format of items.
    Format,
    /// The number of axes.
    Axes,
    /// The control tick.
    Tick,
    /// The machine's parameters, by their checksum.
    Machine,
}

/// Why a board does not drive a program.
#[derive(Debug, Error)]
pub enum BoardError {
    /// The wire can't be opened.
    #[error("found {0}, expected a board")]
    Wire(#[from] io::Error),
    /// Every tick can't be had of it.
    #[error("{0}")]
    Scope(#[from] ScopeError),
    /// Nothing answers.
    #[error("found no answer, expected a board that speaks the link's protocol")]
    Silent,
    /// The board is for something else.
    #[error("found a board with {}, expected {}", shown(*.what, .found), shown(*.what, .expected))]
    Disagrees {
        /// In what.
        what: Agreement,
        /// What the board has.
        found: String,
        /// What the program is for.
        expected: String,
    },
    /// The program switches what the board has no output for.
    #[error("{program}:{line}: found {found}, expected what the board has outputs for: {}", outputs(*.has))]
    Outputs {
        /// The program.
        program: String,
        /// Its line.
        line: u32,
        /// What it switches.
        found: &'static str,
        /// What there is.
        has: BoardOutputs,
    },
    /// The drives are off, and were not to be switched on.
    #[error("found the drives off, expected --enable, which switches them on")]
    Off,
    /// The drives do not go on.
    #[error("found drives that stay off, expected {}",
        if *.is_ready { "them on" } else { "inputs that allow it: the emergency stop closed, no drive in a fault" })]
    StaysOff {
        /// The inputs allow it.
        is_ready: bool,
    },
    /// Somebody has switched the drives off.
    #[error("found the drives switched off, expected them on")]
    SwitchedOff,
    /// The board is in a fault.
    #[error("fault in tick {tick}: {told}")]
    Fault {
        /// The tick in which it was found.
        tick: u64,
        /// What.
        told: String,
    },
    /// The board has a part of this program.
    #[error(
        "found {has} of the program's {}items (its end is one) on the board, expected --continue to go on after them, or --restart to \
         give them up",
        .of.map_or_else(String::new, |of| format!("{of} "))
    )]
    Begun {
        /// Items that the board has.
        has: u32,
        /// Items of the program, where that is known.
        of: Option<u32>,
    },
    /// The program can't be gone on with.
    #[error(
        "found {why}, expected a program that was held or waits for --continue: where the drives were off it can only be \
         driven from its start, with --restart"
    )]
    Interrupted {
        /// Why not.
        why: &'static str,
    },
    /// Another sender has the board.
    #[error("found another sender that has asked the board since, expected to be the only one")]
    Replaced,
    /// The board does not come to rest.
    #[error("found a board that does not come to rest, expected an abort to be obeyed")]
    Moves,
    /// The board has another program.
    #[error(
        "found a board with another program under way, expected one at rest, or --restart to give that up"
    )]
    Busy,
    /// The board has nothing of this program.
    #[error("found nothing of this program on the board, expected some of it for --continue")]
    NotBegun,
    /// The program can't be read or planned to its end. What was before has been driven.
    #[error("{0}")]
    Program(Box<dyn std::error::Error + Send + Sync>),
    /// There is no way to the program's start.
    #[error("found no way to the program's start: {0}")]
    NoWay(motion_kernel::straight::StraightError),
    /// There is no such jog from where the machine stands.
    #[error("found a jog {0}")]
    Jog(motion_kernel::jog::JogError),
    /// An axis is not homed.
    #[error("axis {axis}: {failure}")]
    NotHomed {
        /// Its name.
        axis: String,
        /// Why.
        failure: HomingFailure,
    },
    /// There is no such axis to home.
    #[error(transparent)]
    NoHoming(#[from] HomesError),
    /// The flight recorder runs again.
    #[error("found a fault that was cleared while its ticks were read, expected it to stay")]
    FlightCleared,
    /// The flight recorder has kept nothing.
    #[error(
        "found an empty flight recorder, expected a fault since the board started, or since the last one was cleared"
    )]
    NoFlight,
    /// The board was reset.
    #[error(
        "found a board that has started anew, expected it to go on: it had confirmed {confirmed} items{at}"
    )]
    Reset {
        /// Items that it had confirmed.
        confirmed: u32,
        /// The program line there.
        at: String,
    },
    /// The board can't read or execute an item.
    #[error("found an item that the board refuses{at}, expected all to be executable")]
    Item {
        /// The program line there.
        at: String,
    },
    /// The board does not take new parameters.
    #[error("found {}", refusal(.0))]
    Parameters(WriteError),
    /// It was given parameters, and has started anew with others.
    #[error(
        "found a board that has started anew with the machine {found:08x}, expected {expected:08x}, which it was given"
    )]
    OtherMachine {
        /// The checksum of its parameters.
        found: u32,
        /// Of those that it was given.
        expected: u32,
    },
    /// What it has are no parameters.
    #[error("found parameters on the board that can't be read: {0}")]
    NoParameters(ProgramError),
    /// Something is under way.
    #[error("found a program, a jog or homing under way, expected the machine to have nothing to do")]
    UnderWay,
    /// Nothing is under way.
    #[error("found nothing to go on with, expected a program under way")]
    NothingUnderWay,
    /// There is no program.
    #[error("found no program, expected one to be loaded")]
    NoProgram,
    /// It would be too fast.
    #[error("found an override of {} %, expected at most 200 %", f64::from(*.permille) / 10.0)]
    Override {
        /// What was asked for \[0.1 %\].
        permille: u16,
    },
    /// There is no such key.
    #[error("found a key {0}")]
    Key(#[from] JogError),
    /// The trigger's axis is none of the machine.
    #[error("found the trigger {0}, expected an axis of the machine")]
    Trigger(Condition),
    /// Too many ticks are to be captured.
    #[error("found {ticks} ticks to capture, expected at most {CAPTURE_MAX}")]
    Capture {
        /// How many were asked for.
        ticks: usize,
    },
    /// The machine can't be simulated.
    #[error("{0}")]
    Simulator(#[from] RunError),
    /// An item can't be sent.
    #[error("found an item that can't be sent: {0}")]
    Push(PushError),
}

impl BoardError {
    /// The board is of a build whose messages this one does not read.
    #[must_use]
    pub fn foreign(build: &Build) -> Self {
        Self::Disagrees { what: Agreement::Build, found: in_words(build), expected: in_words(&Build::THIS) }
    }

    /// Whether a board has `axes` axes, which the link needs before anything else.
    ///
    /// # Errors
    /// It has others.
    pub fn unless_linked(identity: &Identity, axes: usize) -> Result<(), Self> {
        if usize::from(identity.axes) == axes {
            return Ok(());
        }
        let (found, expected) = (identity.axes.to_string(), axes.to_string());
        Err(Self::Disagrees { what: Agreement::Axes, found, expected })
    }

    /// Whether the user's input is wrong, and not what the board or the wire did.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Wire(_)
            | Self::Silent
            | Self::StaysOff { .. }
            | Self::SwitchedOff
            | Self::Fault { .. }
            | Self::Reset { .. }
            | Self::Item { .. }
            | Self::Replaced
            | Self::Moves
            | Self::NotHomed { .. }
            | Self::FlightCleared
            | Self::NoFlight
            | Self::NoParameters(_)
            | Self::OtherMachine { .. }
            | Self::Simulator(_)
            | Self::Scope(_)
            | Self::Push(_) => false,
            Self::Disagrees { .. }
            | Self::Outputs { .. }
            | Self::Off
            | Self::Begun { .. }
            | Self::Busy
            | Self::NotBegun
            | Self::Program(_)
            | Self::Interrupted { .. }
            | Self::Parameters(_)
            | Self::UnderWay
            | Self::NothingUnderWay
            | Self::NoProgram
            | Self::NoHoming(_)
            | Self::Override { .. }
            | Self::Key(_)
            | Self::Trigger(_)
            | Self::Capture { .. }
            | Self::NoWay(_)
            | Self::Jog(_) => true,
        }
    }
}

/// What a build is, as far as the other end has to know it.
#[must_use]
pub fn in_words(build: &Build) -> String {
    let &Build { protocol, schema, kernel: [major, minor, patch] } = build;
    format!("kernel {major}.{minor}.{patch}, whose link is protocol {protocol} with messages {schema:08x}")
}

fn shown(what: Agreement, value: &str) -> String {
    match what {
        Agreement::Build => value.to_owned(),
        Agreement::Format => format!("format {value} of items"),
        Agreement::Axes => format!("{value} axes"),
        Agreement::Tick => format!("a tick of {value} s"),
        Agreement::Machine => format!("the machine {value}"),
    }
}

fn refusal(error: &WriteError) -> String {
    match error {
        WriteError::DrivesOn => "the drives on, expected them off for new parameters".to_owned(),
        WriteError::Length { room } => {
            format!("more parameters than the board has room for, expected {room} bytes")
        }
        WriteError::Unsuitable => {
            "parameters that the board refuses, expected its axes and tick, and counts that its inputs pass"
                .to_owned()
        }
        WriteError::Storage => "a board that can't store parameters, expected one that can".to_owned(),
    }
}

fn outputs(has: BoardOutputs) -> &'static str {
    match has {
        BoardOutputs::None => "none",
        BoardOutputs::FixedSpeed => "a spindle that turns clockwise at one speed, and coolant",
        BoardOutputs::CommandedSpeed => "a spindle at any speed, and coolant",
    }
}
