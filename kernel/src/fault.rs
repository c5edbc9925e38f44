//! What can go wrong on the machine: typed, with its tick and its figures, and how it ends.
//!
//! Rejections of bad input are another matter: [`crate::queue::Rejection`].

pub(crate) mod reaction;

use crate::exec::ExecFault;
pub use reaction::{Reaction, Reactions};

/// What went wrong, where and when.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Fault<R> {
    /// The tick in which it was found.
    pub tick: u64,
    /// What.
    pub kind: FaultKind<R>,
}

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultKind<R> {
    /// The executor could not go on.
    Executor(ExecFault),
    /// The following error of an axis is beyond its limit.
    FollowingError {
        /// The axis, from 0.
        axis: usize,
        /// Set-point − actual \[mm\].
        error_mm: R,
    },
    /// The encoder of an axis does not count where the axis is commanded to move.
    EncoderLost {
        /// The axis, from 0.
        axis: usize,
    },
    /// The encoder of an axis counted what no motor moves in a tick.
    EncoderJump {
        /// The axis, from 0.
        axis: usize,
        /// By how much \[mm\].
        jump_mm: R,
    },
    /// An axis moves against its command.
    Runaway {
        /// The axis, from 0.
        axis: usize,
    },
    /// The output of an axis is at its limit for too long.
    Saturated {
        /// The axis, from 0.
        axis: usize,
    },
    /// The set position of an axis is beyond its travel.
    SoftLimit {
        /// The axis, from 0.
        axis: usize,
    },
    /// The set position of an axis jumped: a piece or segment is corrupted.
    SetpointJump {
        /// The axis, from 0.
        axis: usize,
        /// By how much \[mm\].
        jump_mm: R,
    },
    /// A set value or the command of an axis is not a number.
    NotFinite {
        /// The axis, from 0.
        axis: usize,
    },
    /// The encoders could not be read.
    Encoder,
    /// The digital inputs could not be read.
    Inputs,
    /// The converter could not be written.
    Output,
    /// The drives could not be enabled or disabled.
    Enable,
    /// The emergency stop is open.
    EmergencyStop,
    /// A drive reports a fault.
    Drive {
        /// The axis, from 0.
        axis: usize,
    },
    /// A drive is not ready, although it is enabled and has had its time to settle.
    DriveNotReady {
        /// The axis, from 0.
        axis: usize,
    },
    /// A limit switch was reached, or motion is towards one that is.
    LimitSwitch {
        /// The axis, from 0.
        axis: usize,
    },
    /// A tick took longer than its period. Reported by the board, see [`TickMonitor`](crate::tick_monitor::TickMonitor).
    TickOverrun,
    /// Ticks did not come. Reported by the board.
    TickMissed {
        /// How many.
        ticks: u32,
    },
}

impl<R> FaultKind<R> {
    /// How it ends; the emergency stop as the machine says.
    #[must_use]
    pub const fn reaction(&self, emergency_stop: Reaction) -> Reaction {
        match self {
            Self::EmergencyStop => emergency_stop,
            // Feedback, drives and set-points are good.
            Self::Saturated { .. } | Self::SoftLimit { .. } | Self::TickOverrun | Self::TickMissed { .. } => {
                Reaction::Stop
            }
            // The drives obey, but set-points or feedback are not to be trusted, or the path is left already.
            Self::Executor(_)
            | Self::FollowingError { .. }
            | Self::EncoderJump { .. }
            | Self::SetpointJump { .. }
            | Self::NotFinite { .. }
            | Self::Inputs
            | Self::Drive { .. }
            | Self::DriveNotReady { .. }
            | Self::LimitSwitch { .. } => Reaction::Ramp,
            // Nobody knows what a drive does, or no voltage reaches it.
            Self::EncoderLost { .. } | Self::Runaway { .. } | Self::Encoder | Self::Output | Self::Enable => {
                Reaction::Immediate
            }
        }
    }
}
