//! Faults of the machine: their kinds and figures, and the reaction to each.
//!
//! Bad input is not a fault; see [`crate::queue::Rejection`].
//!
//! ```
//! # use hal_sim::closed_loop::InMemory;
//! # use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
//! # use motion_kernel::kernel::Kernel;
//! # use motion_kernel::law::Limits;
//! # use motion_kernel::queue::{PathRules, Streams};
//! # use motion_kernel::units::{Counts, DacCode, Position};
//! use motion_kernel::fault::FaultKind;
//!
//! # let axis = AxisFigures {
//! #     mm_per_count: 0.0001,
//! #     mm_s_at_10_v: 100.0,
//! #     output_offset_v: 0.0,
//! #     output_limit_v: 10.0,
//! #     gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
//! #     feedforward: Feedforward::default(),
//! #     following_error_limit_mm: 0.5,
//! # };
//! # let config = AxesConfig::<f32, 1>::new(&[axis], 0.0005).expect("an axis");
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! # let mut streams = Streams::<f32, 1, 18, 10>::new();
//! # let (_, mut intake) = streams.split(rules, [Position::ZERO]);
//! # let mut hal = InMemory { counts: [Counts(0)], codes: [DacCode(0)], enabled: None };
//! let mut kernel = Kernel::new(&config, [Position::ZERO], [Counts(0)]);
//! kernel.enable(0);
//! kernel.tick(&mut intake, &mut hal);
//! // Somebody turns the axis by 1 mm, more than its limit of 0.5 mm.
//! hal.counts = [Counts(10_000)];
//! kernel.tick(&mut intake, &mut hal);
//! let fault = kernel.fault().expect("a following error");
//! assert_eq!(fault.tick, 1);
//! assert!(matches!(fault.kind, FaultKind::FollowingError { axis: 0, error_mm } if error_mm < -0.99));
//! ```

pub(crate) mod reaction;
#[cfg(feature = "link")]
mod schema;

use serde::{Deserialize, Serialize};

use crate::exec::ExecFault;
use crate::num::Real;
pub use reaction::{Reaction, Reactions};

/// What went wrong, and when.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub struct Fault<R> {
    /// The tick in which it was found.
    pub tick: u64,
    /// What went wrong.
    pub kind: FaultKind<R>,
}

/// The kinds of fault. Exhaustive on purpose: a program that reacts to faults should not build with one that
/// it does not know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultKind<R> {
    /// The executor could not continue.
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
    /// The encoder of an axis counted more than any motor moves in a tick.
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
    /// The output of an axis was at its limit for too long.
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
    /// A tick took longer than its period. Reported by the board, see
    /// [`TickMonitor`](crate::tick_monitor::TickMonitor).
    TickOverrun,
    /// Ticks were missed. Reported by the board.
    TickMissed {
        /// How many.
        ticks: u32,
    },
}

impl<R> FaultKind<R> {
    /// The reaction to it; `emergency_stop` is the machine's reaction to the emergency stop.
    #[must_use]
    pub const fn reaction(&self, emergency_stop: Reaction) -> Reaction {
        match self {
            Self::EmergencyStop => emergency_stop,
            // Feedback, drives and set-points are still good.
            Self::Saturated { .. } | Self::SoftLimit { .. } | Self::TickOverrun | Self::TickMissed { .. } => {
                Reaction::Stop
            }
            // The drives obey, but set-points or feedback can't be trusted, or the path is already left.
            Self::Executor(_)
            | Self::FollowingError { .. }
            | Self::EncoderJump { .. }
            | Self::SetpointJump { .. }
            | Self::NotFinite { .. }
            | Self::Inputs
            | Self::Drive { .. }
            | Self::DriveNotReady { .. }
            | Self::LimitSwitch { .. } => Reaction::Ramp,
            // It is unknown what a drive does, or no voltage reaches it.
            Self::EncoderLost { .. } | Self::Runaway { .. } | Self::Encoder | Self::Output | Self::Enable => {
                Reaction::Immediate
            }
        }
    }
}

impl<R> FaultKind<R> {
    /// The axes whose counts can't be trusted any more, the lowest bit is the first one's.
    pub(crate) fn axes_without_counts(&self) -> u32 {
        match *self {
            Self::EncoderLost { axis } | Self::EncoderJump { axis, .. } => axis_bit(axis),
            Self::Encoder => u32::MAX,
            _ => 0,
        }
    }
}

/// The bit of an axis in a set of axes, 0 if there is none for it.
pub(crate) fn axis_bit(axis: usize) -> u32 {
    u32::try_from(axis).ok().and_then(|axis| 1u32.checked_shl(axis)).unwrap_or_default()
}

impl<R: Real> Fault<R> {
    /// The same in f64.
    #[must_use]
    pub fn to_f64(&self) -> Fault<f64> {
        use FaultKind as Kind;
        let kind = match self.kind {
            Kind::Executor(cause) => Kind::Executor(cause),
            Kind::FollowingError { axis, error_mm } => {
                Kind::FollowingError { axis, error_mm: error_mm.to_f64() }
            }
            Kind::EncoderLost { axis } => Kind::EncoderLost { axis },
            Kind::EncoderJump { axis, jump_mm } => Kind::EncoderJump { axis, jump_mm: jump_mm.to_f64() },
            Kind::Runaway { axis } => Kind::Runaway { axis },
            Kind::Saturated { axis } => Kind::Saturated { axis },
            Kind::SoftLimit { axis } => Kind::SoftLimit { axis },
            Kind::SetpointJump { axis, jump_mm } => Kind::SetpointJump { axis, jump_mm: jump_mm.to_f64() },
            Kind::NotFinite { axis } => Kind::NotFinite { axis },
            Kind::Encoder => Kind::Encoder,
            Kind::Inputs => Kind::Inputs,
            Kind::Output => Kind::Output,
            Kind::Enable => Kind::Enable,
            Kind::EmergencyStop => Kind::EmergencyStop,
            Kind::Drive { axis } => Kind::Drive { axis },
            Kind::DriveNotReady { axis } => Kind::DriveNotReady { axis },
            Kind::LimitSwitch { axis } => Kind::LimitSwitch { axis },
            Kind::TickOverrun => Kind::TickOverrun,
            Kind::TickMissed { ticks } => Kind::TickMissed { ticks },
        };
        Fault { tick: self.tick, kind }
    }
}
