//! One axis: from its set-point and its encoder to a converter code.
//!
//! Consumes a [`Setpoint`] and [`Counts`]; produces a [`DacCode`]. In the tick, no loop, no failure: a
//! fault is reported, not thrown.
//!
//! - [`scale`]: mm ↔ counts, mm/s ↔ volts;
//! - [`regulator`]: S4 (1), P(ID) on the following error plus feedforward of velocity, acceleration
//!   and jerk, with saturation and anti-windup.
//!
//! Configuration ([`AxisConfig`]) is immutable and separate from state ([`AxisState`]), so gains can
//! change without a bump.

pub mod regulator;
pub mod scale;

pub use regulator::{Command, Feedforward, Gains, Regulator, RegulatorState};
pub use scale::{EncoderScale, OutputScale, ScaleError};

use crate::num::Real;
use crate::path::Setpoint;
use crate::units::{Counts, DacCode, Position};

/// What is fixed about an axis while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfig<R> {
    /// Encoder counts to position.
    pub encoder: EncoderScale,
    /// Velocity command to converter code.
    pub output: OutputScale<R>,
    /// The regulator.
    pub regulator: Regulator<R>,
    /// Following error at which the axis faults \[mm\].
    pub following_error_limit_mm: R,
}

/// What changes about an axis from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisState<R> {
    /// Added to the encoder's position: set by homing.
    pub offset: Position,
    /// The regulator's.
    pub regulator: RegulatorState<R>,
    /// Largest |following error| since it was last cleared \[mm\].
    pub peak_following_error_mm: R,
}

/// The outcome of one tick of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisOutput<R> {
    /// Actual position from the encoder.
    pub actual: Position,
    /// Following error: set-point − actual \[mm\].
    pub following_error_mm: R,
    /// What the converter is to put out.
    pub code: DacCode,
    /// The output reached the limit.
    pub saturated: bool,
    /// The following error is beyond its limit.
    pub lost: bool,
}

impl<R: Real> AxisState<R> {
    /// Declares the encoder's present reading to be `position`.
    pub fn set_position(&mut self, config: &AxisConfig<R>, counts: Counts, position: Position) {
        self.offset = position - config.encoder.position(counts);
    }

    /// The actual position at the encoder's reading.
    #[inline]
    pub fn position(&self, config: &AxisConfig<R>, counts: Counts) -> Position {
        config.encoder.position(counts) + self.offset
    }

    /// The output of an axis whose drive is off: the voltage at which it stands still.
    #[inline]
    pub fn stand_still(
        &self,
        config: &AxisConfig<R>,
        setpoint: &Setpoint<R>,
        counts: Counts,
    ) -> AxisOutput<R> {
        let actual = self.position(config, counts);
        AxisOutput {
            actual,
            following_error_mm: (setpoint.position - actual).to_offset(),
            code: config.output.code(R::ZERO),
            saturated: false,
            lost: false,
        }
    }

    /// One control tick.
    #[inline]
    pub fn tick(&mut self, config: &AxisConfig<R>, setpoint: &Setpoint<R>, counts: Counts) -> AxisOutput<R> {
        let actual = self.position(config, counts);
        // Subtracted in fixed point, converted afterwards.
        let following_error_mm: R = (setpoint.position - actual).to_offset();
        self.peak_following_error_mm = self.peak_following_error_mm.max(following_error_mm.abs());
        let command =
            config.regulator.tick(&mut self.regulator, following_error_mm, setpoint, config.output.limits());
        AxisOutput {
            actual,
            following_error_mm,
            code: config.output.code(command.velocity_mm_s),
            saturated: command.saturated,
            // Written so that what is not a number counts as lost.
            lost: !(following_error_mm.abs() <= config.following_error_limit_mm),
        }
    }
}
