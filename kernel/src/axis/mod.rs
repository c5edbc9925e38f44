//! One axis: from its set-point and its encoder to a converter code.
//!
//! Consumes a [`Setpoint`] and [`Counts`]; produces a [`DacCode`]. In the tick, no loop, no failure: a
//! fault is reported, not thrown.
//!
//! - `scale`: mm ↔ counts, mm/s ↔ volts;
//! - `preview`: position set-points delayed, so that feedforward comes early;
//! - `feedforward`: F_V, F_a, F_J of S4 (1), and the inverse of the drive;
//! - `regulator`: S4 (1), P(ID) on the following error plus feedforward, with saturation and anti-windup;
//! - `correction`: the learnt correction of a stretch, added to feedforward;
//! - `compensation`: a screw's pitch error and backlash (feature `compensation`);
//! - `guard`: whether encoder, drive and set-point make sense together (feature `guards`).
//!
//! Configuration ([`AxesConfig`], [`AxisConfig`]) is immutable and separate from state ([`AxisState`]), so
//! gains can change without a bump.
//!
//! ```
//! use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
//! use motion_kernel::units::Counts;
//!
//! let axis = AxisFigures {
//!     mm_per_count: 0.0001,
//!     mm_s_at_10_v: 100.0,
//!     output_offset_v: 0.0,
//!     output_limit_v: 10.0,
//!     gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
//!     feedforward: Feedforward::default(),
//!     following_error_limit_mm: 0.5,
//! };
//! let config = AxesConfig::<f32, 1>::new(&[axis], 0.0005)?;
//! let actual = config.axes[0].encoder.position(Counts(10_000));
//! assert!((actual.to_mm() - 1.0).abs() < 1e-9);
//! assert_eq!(config.axes[0].output.code(50.0).to_volts(), 5.0);
//!
//! // A refusal names the axis and the figure.
//! let refused = AxesConfig::<f32, 1>::new(&[AxisFigures { mm_per_count: 0.0, ..axis }], 0.0005);
//! assert_eq!(refused.map_err(|error| error.axis), Err(0));
//! # Ok::<(), motion_kernel::axis::AxesError>(())
//! ```

mod check;
#[cfg(feature = "compensation")]
mod compensation;
mod correction;
pub(crate) mod feedforward;
#[cfg(feature = "guards")]
mod guard;
#[cfg(not(feature = "guards"))]
#[path = "limit_only.rs"]
mod guard;
mod guards;
mod preview;
mod regulator;
mod scale;

#[cfg(feature = "compensation")]
pub use compensation::{
    AxisCompensation, BACKLASH_MM_MAX, Backlash, COMPENSATION_POINTS_MAX, Compensation,
    PITCH_ERROR_SLOPE_MAX, PITCH_ERROR_SPACING_MM, PITCH_ERROR_UM_MAX, PitchError, TAKE_UP_PEAKS,
    TAKE_UP_TICKS_MAX,
};
#[cfg(feature = "compensation")]
use compensation::{CompensationConfig, CompensationState};
pub use correction::{Correction, CorrectionError, KNOT_TICKS_MAX};
pub use feedforward::{
    BED_TICK_SHARE_MAX, BedInverse, DriveInverse, Feedforward, TABLE_POINTS, Table, Tables,
};
pub use guards::{GuardFigures, Guards};
pub(crate) use preview::Preview;
pub use preview::{LEAD_ROUNDING_TICKS, PREVIEW_TICKS_MAX};
pub use regulator::Gains;
use regulator::{Regulator, RegulatorState};
pub use scale::{EncoderScale, OutputScale, ScaleError};

use serde::{Deserialize, Serialize};

use check::{Check, fits};
#[cfg(feature = "guards")]
pub(crate) use guard::{AxisFault, SAMPLE_TICKS};
use guard::{Guard, GuardConfig};

use crate::fault::reaction::Reactions;
use crate::num::Real;
use crate::path::Setpoint;
use crate::units::{Counts, DacCode, Position};

/// An axis' figures for any number type, as in the machine file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisFigures {
    /// Travel per encoder count \[mm\], a magnitude from 10⁻⁸ to 0.5, exclusive; negative for an encoder that
    /// counts the other way.
    pub mm_per_count: f64,
    /// Velocity at +10 V \[mm/s\], not 0; negative if +10 V moves in negative direction.
    pub mm_s_at_10_v: f64,
    /// Added to every output \[V\], below the limit in magnitude.
    pub output_offset_v: f64,
    /// Greatest output in either direction \[V\], above 0, at most 10.
    pub output_limit_v: f64,
    /// Feedback gains.
    pub gains: Gains,
    /// Feedforward.
    pub feedforward: Feedforward,
    /// Following error at which the axis faults \[mm\], > 0.
    pub following_error_limit_mm: f64,
}

/// The configuration of an axis, fixed while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfig<R> {
    /// Encoder counts to position.
    pub encoder: EncoderScale,
    /// Velocity command to converter code.
    pub output: OutputScale<R>,
    /// The regulator.
    pub(crate) regulator: Regulator<R>,
    /// Following error above which the axis faults \[mm\].
    pub following_error_limit_mm: R,
    guard: GuardConfig<R>,
    #[cfg(feature = "compensation")]
    compensation: Option<CompensationConfig<R>>,
}

/// The configuration of all axes of a machine, fixed while they run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxesConfig<R, const AXES: usize> {
    /// Each axis.
    pub axes: [AxisConfig<R>; AXES],
    /// Number of ticks by which position set-points are delayed.
    pub preview_ticks: u8,
    /// The reactions to faults; without the feature `guards` all are immediate.
    pub reactions: Reactions,
}

/// An axis that can't be used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxesError {
    /// The axis, from 0.
    pub axis: usize,
    /// What is wrong with it.
    pub cause: ScaleError,
}

impl core::fmt::Display for AxesError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "axis {}: {}", self.axis, self.cause)
    }
}

impl core::error::Error for AxesError {}

impl<R: Real, const AXES: usize> AxesConfig<R, AXES> {
    const ONE_AT_LEAST: () = assert!(AXES > 0, "a machine has an axis");

    /// The axes for a control tick of `tick_s`, guarded only by the limits of their following errors.
    /// Background.
    ///
    /// # Errors
    /// The first figure that is out of its range or beyond the number type's.
    pub fn new(figures: &[AxisFigures; AXES], tick_s: f64) -> Result<Self, AxesError> {
        let () = Self::ONE_AT_LEAST;
        let preview_ticks = Self::preview_ticks(figures, tick_s)?;
        let (mut check, mut axis) = (Check::default(), 0);
        let axes = figures.each_ref().map(|figures| {
            let config = AxisConfig::checked(&mut check, figures, preview_ticks, tick_s);
            axis += usize::from(check.refused.is_none());
            config
        });
        // The axes before it are those without a refusal.
        let made = Self { axes, preview_ticks, reactions: Reactions::IMMEDIATE };
        check.refused.map_or(Ok(made), |cause| Err(AxesError { axis, cause }))
    }

    /// Number of ticks by which these axes need their position set-points delayed, for the longest lead.
    ///
    /// # Errors
    /// A lead is not from 0 to [`PREVIEW_TICKS_MAX`] ticks; the first such.
    #[doc(hidden)]
    pub fn preview_ticks(figures: &[AxisFigures; AXES], tick_s: f64) -> Result<u8, AxesError> {
        preview::preview_ticks(figures, tick_s).map_err(|(axis, cause)| AxesError { axis, cause })
    }
}

impl<R: Real> AxisConfig<R> {
    /// The axis for a control tick of `tick_s`, with position set-points delayed by `preview_ticks`.
    /// Background.
    ///
    /// # Errors
    /// The first figure that is out of its range or beyond the number type's.
    #[doc(hidden)]
    pub fn new(figures: &AxisFigures, preview_ticks: u8, tick_s: f64) -> Result<Self, ScaleError> {
        Check::all(|check| Self::checked(check, figures, preview_ticks, tick_s))
    }

    #[inline(never)]
    fn checked(check: &mut Check, figures: &AxisFigures, preview_ticks: u8, tick_s: f64) -> Self {
        let &AxisFigures { mm_per_count, mm_s_at_10_v, output_offset_v, output_limit_v, .. } = figures;
        let limit_mm = figures.following_error_limit_mm;
        let expected = "a positive number within the kernel's range";
        check.that(limit_mm > 0.0 && fits::<R>(limit_mm), "following error limit [mm]", limit_mm, expected);
        Self {
            encoder: EncoderScale::new(check, mm_per_count),
            output: OutputScale::new(check, mm_s_at_10_v, output_offset_v, output_limit_v),
            regulator: Regulator::new(
                check,
                figures.gains,
                &figures.feedforward,
                preview_ticks,
                tick_s,
                limit_mm,
            ),
            following_error_limit_mm: R::from_f64(limit_mm),
            guard: GuardConfig::limit_only(limit_mm),
            #[cfg(feature = "compensation")]
            compensation: None,
        }
    }

    /// The following error at which the axis faults in a motion \[mm\].
    pub fn following_error_limit_mm_in(&self, setpoint: &Setpoint<R>) -> R {
        self.guard.limit_mm(self.following_error_limit_mm, setpoint)
    }
}

/// The state of an axis, which changes from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisState<R> {
    /// Added to the encoder's position for that of the load: set by homing, and moved by compensation.
    pub offset: Position,
    /// The regulator's state.
    pub(crate) regulator: RegulatorState<R>,
    /// Largest |following error| since it was last cleared \[mm\].
    pub peak_following_error_mm: R,
    guard: Guard<R>,
    #[cfg(feature = "compensation")]
    compensation: CompensationState,
}

/// The outcome of one tick of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisOutput<R> {
    /// The encoder's reading at the start of the tick.
    pub counts: Counts,
    /// The position set-point that is regulated to: the present one, or a past one if there is a preview.
    pub set: Position,
    /// Actual position from the encoder.
    pub actual: Position,
    /// Following error: set-point − actual \[mm\].
    pub following_error_mm: R,
    /// The code for the converter.
    pub code: DacCode,
    /// The output reached the limit.
    pub saturated: bool,
    /// The following error is beyond its limit, or another guard found the axis broken. Then no gain is
    /// applied to it: the output is that of standing still.
    pub lost: bool,
}

impl<R: Real> AxisState<R> {
    /// Declares the encoder's present reading to be `position`.
    #[doc(hidden)]
    pub fn set_position(&mut self, config: &AxisConfig<R>, counts: Counts, position: Position) {
        self.refer(config, counts, position);
        self.guard = Guard::at(counts);
    }

    /// Declares a reading of the encoder, not the present one, to be `position`. The guards remember counts,
    /// so their state stays valid.
    #[inline]
    pub(crate) fn refer(&mut self, config: &AxisConfig<R>, counts: Counts, position: Position) {
        self.offset = position - config.encoder.position(counts);
        #[cfg(feature = "compensation")]
        self.refer_load(config, position);
    }

    /// The actual position at the encoder's reading.
    #[inline]
    pub(crate) fn position(&self, config: &AxisConfig<R>, counts: Counts) -> Position {
        config.encoder.position(counts) + self.offset
    }

    /// Resets the regulator and takes the actual position as the set position, which it returns.
    #[inline(never)]
    pub(crate) fn stand_here(&mut self, config: &AxisConfig<R>, output: &mut AxisOutput<R>) -> Position {
        #[cfg(feature = "compensation")]
        {
            self.end_take_up();
            self.find_load(config, output.counts);
        }
        output.set = self.position(config, output.counts);
        self.regulator = RegulatorState::default();
        self.guard.stand_here();
        output.set
    }

    /// The output of an axis whose drive is off: the voltage at which it stands still. `output` is used as in
    /// [`AxisState::tick`].
    #[inline]
    pub(crate) fn stand_still(&mut self, config: &AxisConfig<R>, output: &mut AxisOutput<R>) {
        let error_mm = self.hold_still(config, output);
        self.guard.watch(error_mm - self.regulator.last_error_mm(), output.counts);
        self.regulator.watch(error_mm);
    }

    /// Makes the output of [`AxisState::stand_still`]; returns the error that the regulator is to remember.
    #[inline]
    fn hold_still(&mut self, config: &AxisConfig<R>, output: &mut AxisOutput<R>) -> R {
        let AxisOutput { counts, set, .. } = *output;
        #[cfg(feature = "compensation")]
        self.follow_load(config, counts);
        let actual = self.position(config, counts);
        *output = AxisOutput {
            counts,
            set,
            actual,
            following_error_mm: (set - actual).to_offset(),
            code: config.output.code(R::ZERO),
            saturated: false,
            lost: false,
        };
        // Clamped, so that the change to the next tick is within what the gains were accepted for.
        let limit_mm = config.following_error_limit_mm;
        output.following_error_mm.max(-limit_mm).min(limit_mm)
    }

    /// One control tick. Feedforward is made of `setpoint`, the present one. On entry `output` has the
    /// encoder's reading and the position to regulate to; on return it is complete.
    ///
    /// Beyond the limit of the following error the axis is lost and its regulator does not move: with a
    /// broken encoder, the gains' products may exceed the number type.
    // Not inlined: three copies of it would fight for the registers.
    #[inline(never)]
    pub fn tick(&mut self, config: &AxisConfig<R>, setpoint: &Setpoint<R>, output: &mut AxisOutput<R>) {
        #[cfg(feature = "compensation")]
        if let Some(compensation) = &config.compensation {
            let motor = self.compensate(compensation, setpoint, output.set);
            if self.takes_up() {
                self.guard.take_up(config);
            }
            return self.regulate(config, &motor, output);
        }
        self.regulate(config, setpoint, output);
    }

    /// The tick but for compensation.
    // Once in the image, whoever calls it.
    #[cfg_attr(feature = "compensation", inline(never))]
    #[cfg_attr(not(feature = "compensation"), inline)]
    fn regulate(&mut self, config: &AxisConfig<R>, setpoint: &Setpoint<R>, output: &mut AxisOutput<R>) {
        let actual = self.position(config, output.counts);
        // Subtracted in fixed point, converted afterwards.
        let following_error_mm: R = (output.set - actual).to_offset();
        let size_mm = following_error_mm.abs();
        self.peak_following_error_mm = self.peak_following_error_mm.max(size_mm);
        let last_error_mm = self.regulator.last_error_mm();
        if !self.guard.allows(config, following_error_mm, last_error_mm, output.counts, setpoint) {
            return self.lose(config, output);
        }
        let command =
            config.regulator.tick(&mut self.regulator, following_error_mm, setpoint, config.output.limits());
        if !self.guard.allows_command(command.velocity_mm_s, config.output.limits().1) {
            return self.lose(config, output);
        }
        output.actual = actual;
        output.following_error_mm = following_error_mm;
        output.code = config.output.code(command.velocity_mm_s);
        output.saturated = command.saturated;
        output.lost = false;
    }

    fn lose(&mut self, config: &AxisConfig<R>, output: &mut AxisOutput<R>) {
        let error_mm = self.hold_still(config, output);
        self.regulator.watch(error_mm);
        output.lost = true;
    }

    /// Forgets what the guard saw before the drive was enabled.
    pub(crate) fn restart_guard(&mut self) {
        self.guard.restart();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::{Fixed, Scalar};

    /// An encoder that jumps by ten kilometres, with gains that would make more of it than fixed point holds.
    #[test]
    fn an_axis_that_is_lost_stands_still_and_overflows_nothing() {
        let figures = AxisFigures {
            mm_per_count: 1e-4,
            mm_s_at_10_v: 1000.0 / 3.0,
            output_offset_v: 0.5,
            output_limit_v: 10.0,
            gains: Gains { kp_per_s: 230.0, ki_per_s2: 1e4, kd: 1.0 },
            feedforward: Feedforward::default(),
            following_error_limit_mm: 1.0,
        };
        let config = AxisConfig::<Fixed>::new(&figures, 0, 5e-4).expect("valid");
        let setpoint = Setpoint::default();
        let at = |mm: f64| AxisOutput { counts: Counts((mm * 1e4) as i64), ..AxisOutput::default() };
        for mm in [1e7, -1e7, 2e9, 1.001] {
            let mut axis = AxisState::default();
            let mut output = at(mm);
            axis.tick(&config, &setpoint, &mut output);
            assert!(output.lost && output.code == config.output.code(Fixed::ZERO), "{mm}: {output:?}");
            assert!((output.following_error_mm.to_f64() + mm).abs() < 1e-3, "{mm}: {output:?}");
            assert_eq!(axis.peak_following_error_mm, output.following_error_mm.abs());
            // And back again.
            let mut output = at(0.0);
            axis.tick(&config, &setpoint, &mut output);
            assert!(!output.lost);
        }
        let mut output = at(0.9999);
        AxisState::default().tick(&config, &setpoint, &mut output);
        assert!(!output.lost && output.code != config.output.code(Fixed::ZERO));
    }
}
