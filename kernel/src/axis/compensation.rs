//! Compensation of a screw: what lies between the encoder at the motor and the load.
//!
//! ```text
//! encoder = load + c,   c = −e(load) − b·σ
//! ```
//!
//! e is the pitch error, load − motor, over where the load is: a smooth curve through the points of a table, which lies over
//! a stretch of the travel, or repeats with every turn of the screw. b is the backlash; σ is 0 after motion in positive
//! direction and 1 after motion in negative direction. When the commanded direction changes, σ goes from one to the other in
//! a fixed time, over a septic: from rest to rest, jerk without a step. A reversal while that is under way waits for its end.
//!
//! **Between points** lies a cubic with the points' central differences for slopes (Catmull–Rom): velocity has no steps. Beyond
//! the ends of a stretch the end points hold, and the slope is 0 at them.
//!
//! **Positions are the load's.** c goes into the offset between encoder and position, so that set and actual position, following
//! error, travel and references are the load's; the regulator sees the same error. c belongs to the position that is regulated
//! to: behind the preview. Its derivatives go to feedforward, which comes before that, so they are those of the present set-point;
//! of the table's jerk, the part with the axis' own jerk alone.
//!
//! In the tick, without a loop, a division or a failure. An axis without compensation pays for the question alone.
//!
//! ```
//! use motion_kernel::axis::{AxisCompensation, Backlash, PitchError};
//!
//! let compensation = AxisCompensation {
//!     backlash: Some(Backlash { play_mm: 0.02, take_up_s: 0.01 }),
//!     // 2 µm more at the middle of a screw of 600 mm than at its ends.
//!     pitch_error: PitchError::new(-300.0, 300.0, &[0.0, 2.0, 0.0], false),
//! };
//! assert_eq!(compensation.pitch_error.map(|table| table.point_um(1)), Some(Some(2.0)));
//! assert_eq!(PitchError::new(0.0, 5.0, &[0.0, 400.0], false), None, "more than can be told");
//! ```

use serde::{Deserialize, Serialize};

use super::check::{Check, fits};
use super::{AxesConfig, AxesError, AxisConfig, AxisState};
use crate::num::Real;
use crate::path::Setpoint;
use crate::units::{Counts, Position};

mod pitch_error;
mod take_up;

pub use pitch_error::{
    COMPENSATION_POINTS_MAX, PITCH_ERROR_SLOPE_MAX, PITCH_ERROR_SPACING_MM, PITCH_ERROR_UM_MAX, PitchError,
};
use pitch_error::{Curve, Table};
use take_up::TakeUp;
pub use take_up::{BACKLASH_MM_MAX, Backlash, TAKE_UP_PEAKS, TAKE_UP_TICKS_MAX};

/// Set velocity from which on a direction is one \[mm/s\]: less may be rounding of an axis that stands while others move.
const MOVING_MM_S: f64 = 1.0e-3;
/// Rounds in which the error where the load is, is found from where the encoder is: each leaves a twentieth or less.
const SETTLING_ROUNDS: u8 = 4;

/// The compensation of a machine; a compiled program carries it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compensation<const AXES: usize> {
    /// Of each axis; `None` for none.
    #[serde(with = "crate::array")]
    pub axes: [Option<AxisCompensation>; AXES],
}

impl<const AXES: usize> Compensation<AXES> {
    /// No axis is compensated.
    pub const NONE: Self = Self { axes: [None; AXES] };
}

/// The compensation of an axis, for any number type.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisCompensation {
    /// The play that is taken up when the direction changes.
    pub backlash: Option<Backlash>,
    /// The screw's error.
    pub pitch_error: Option<PitchError>,
}

/// [`AxisCompensation`] made for the tick. Immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CompensationConfig<R> {
    table: Option<Table<R>>,
    take_up: Option<TakeUp<R>>,
    preview_ticks: u8,
    /// Greatest velocity that the output can command \[mm/s\]: beyond, feedforward of the table's slope does not grow.
    most_mm_s: R,
    moving_mm_s: R,
}

/// The state of compensation. The default is that after motion in positive direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct CompensationState {
    /// c, as it is in the axis' offset.
    applied: Position,
    /// Ticks until the take-up under way has passed the preview, too.
    ticks_left: u16,
    /// The commanded direction is the negative one.
    is_negative: bool,
}

impl<R: Real> CompensationConfig<R> {
    fn new(
        check: &mut Check,
        compensation: &AxisCompensation,
        config: &AxisConfig<R>,
        preview_ticks: u8,
        tick_s: f64,
    ) -> Self {
        let (low, high) = config.output.limits();
        let most_mm_s = low.abs().min(high.abs());
        let table: Option<Table<R>> = compensation.pitch_error.as_ref().map(|error| Table::new(check, error));
        if let Some(Table { per_spacing, .. }) = &table {
            // The second derivative is below 16 times the greatest change; times the square of intervals per second.
            let per_s = per_spacing.to_f64() * most_mm_s.to_f64();
            let accel_mm_s2 = 16.0 * PITCH_ERROR_SLOPE_MAX / per_spacing.to_f64() * per_s * per_s;
            let expected = "an acceleration by the pitch error within the kernel's range";
            check.that(fits::<R>(8.0 * accel_mm_s2), "velocity at 10 V [mm/s]", most_mm_s.to_f64(), expected);
        }
        let take_up = compensation.backlash.as_ref();
        let take_up = take_up.map(|backlash| TakeUp::new(check, backlash, most_mm_s.to_f64(), tick_s));
        Self { table, take_up, preview_ticks, most_mm_s, moving_mm_s: R::from_f64(MOVING_MM_S) }
    }

    /// All ticks of a take-up, those included after which position set-points have passed it.
    fn take_up_ticks(&self) -> u16 {
        // At most 60000 + 24.
        self.take_up.as_ref().map_or(0, |take_up| take_up.ticks + u16::from(self.preview_ticks))
    }

    /// c where the load is, behind the preview.
    fn at(&self, state: CompensationState, load: Position) -> Position {
        let mut compensation_mm = R::ZERO;
        if let Some(table) = &self.table {
            compensation_mm = -table.at(load).error_mm;
        }
        if let Some(take_up) = &self.take_up {
            let since = self.take_up_ticks().saturating_sub(state.ticks_left);
            let since = since.saturating_sub(self.preview_ticks.into());
            compensation_mm = compensation_mm + take_up.at(since, state.is_negative);
        }
        Position::from_offset(compensation_mm)
    }

    /// The next tick of a take-up; begins one if the commanded direction has changed.
    fn tick(&self, state: &mut CompensationState, velocity_mm_s: R) {
        if self.take_up.is_none() {
            return;
        }
        if state.ticks_left == 0 {
            let least = self.moving_mm_s;
            let is_other = if state.is_negative { velocity_mm_s > least } else { velocity_mm_s < -least };
            if !is_other {
                return;
            }
            state.is_negative = !state.is_negative;
            state.ticks_left = self.take_up_ticks();
        }
        state.ticks_left = state.ticks_left.saturating_sub(1);
    }

    /// The set-point with the derivatives of c: the motor's.
    fn motor(&self, state: CompensationState, setpoint: &Setpoint<R>) -> Setpoint<R> {
        let mut motor = *setpoint;
        if let Some(table) = &self.table {
            let Curve { first_mm, second_mm, .. } = table.at(setpoint.position);
            let velocity_mm_s = setpoint.velocity_mm_s.max(-self.most_mm_s).min(self.most_mm_s);
            let per_s = velocity_mm_s * table.per_spacing;
            let slope = first_mm * table.per_spacing;
            motor.velocity_mm_s = motor.velocity_mm_s - slope * setpoint.velocity_mm_s;
            motor.accel_mm_s2 = motor.accel_mm_s2 - slope * setpoint.accel_mm_s2 - second_mm * per_s * per_s;
            motor.jerk_mm_s3 = motor.jerk_mm_s3 - slope * setpoint.jerk_mm_s3;
        }
        if let Some(take_up) = &self.take_up
            && state.ticks_left > 0
        {
            take_up.add(&mut motor, self.take_up_ticks().saturating_sub(state.ticks_left), state.is_negative);
        }
        motor
    }
}

impl<R: Real, const AXES: usize> AxesConfig<R, AXES> {
    /// The same axes with `compensation`, for a control tick of `tick_s`. Background.
    ///
    /// # Errors
    /// The first figure that is out of its range or beyond the number type.
    pub fn compensated(mut self, compensation: &Compensation<AXES>, tick_s: f64) -> Result<Self, AxesError> {
        let preview_ticks = self.preview_ticks;
        for (axis, (config, figures)) in self.axes.iter_mut().zip(&compensation.axes).enumerate() {
            let Some(figures) = figures else { continue };
            let made =
                Check::all(|check| CompensationConfig::new(check, figures, config, preview_ticks, tick_s));
            config.compensation = Some(made.map_err(|cause| AxesError { axis, cause })?);
        }
        Ok(self)
    }
}

impl<R: Real> AxisState<R> {
    /// The motor's set-point; the load's offset becomes that of the position that is regulated to.
    #[inline(never)]
    pub(super) fn compensate(
        &mut self,
        config: &CompensationConfig<R>,
        setpoint: &Setpoint<R>,
        set: Position,
    ) -> Setpoint<R> {
        config.tick(&mut self.compensation, setpoint.velocity_mm_s);
        self.apply(config.at(self.compensation, set));
        config.motor(self.compensation, setpoint)
    }

    /// Changes c in the offset.
    fn apply(&mut self, compensation: Position) {
        self.offset = self.offset - (compensation - self.compensation.applied);
        self.compensation.applied = compensation;
    }

    /// The offset of a load that may be anywhere: of an axis that is not regulated. Comes closer with every call.
    #[inline(never)]
    pub(super) fn follow_load(&mut self, config: &AxisConfig<R>, counts: Counts) {
        if let Some(compensation) = &config.compensation {
            let load = self.position(config, counts);
            self.apply(compensation.at(self.compensation, load));
        }
    }

    /// The offset of a load that rests where the encoder reads `counts`.
    pub(crate) fn find_load(&mut self, config: &AxisConfig<R>, counts: Counts) {
        for _ in 0..SETTLING_ROUNDS {
            self.follow_load(config, counts);
        }
    }

    /// Whether a take-up is under way.
    pub(super) fn takes_up(&self) -> bool {
        self.compensation.ticks_left > 0
    }

    /// A take-up that was cut short counts as done.
    pub(super) fn end_take_up(&mut self) {
        self.compensation.ticks_left = 0;
    }

    /// The load is at `load` where it was referred to: c of that place is in the offset.
    pub(super) fn refer_load(&mut self, config: &AxisConfig<R>, load: Position) {
        if let Some(compensation) = &config.compensation {
            self.compensation.applied = compensation.at(self.compensation, load);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::pitch_error::tests::{expected, random_table};
    use super::*;
    use crate::axis::{AxisOutput, ScaleError};
    use crate::fixture::figures;
    use crate::num::Fixed;
    use crate::random::Random;

    const TICK_S: f64 = 0.0005;

    fn compensated<R: Real>(
        compensation: AxisCompensation,
        preview_ticks: u8,
    ) -> Result<AxisConfig<R>, ScaleError> {
        let config = AxesConfig::<R, 1>::new(&[figures()], TICK_S).map_err(|error| error.cause)?;
        AxesConfig { preview_ticks, ..config }
            .compensated(&Compensation { axes: [Some(compensation)] }, TICK_S)
            .map(|axes| axes.axes[0])
            .map_err(|error| error.cause)
    }

    /// To and fro, with reversals of all kinds: the offset moves by the play's share, once for each, and rests in between.
    #[test]
    fn a_reversal_waits_for_the_take_up_before_it() {
        for preview_ticks in [0, 5] {
            let backlash = Backlash { play_mm: 0.02, take_up_s: 0.005 };
            let compensation = AxisCompensation { backlash: Some(backlash), pitch_error: None };
            let config = compensated::<f64>(compensation, preview_ticks).expect("valid");
            let mut axis = AxisState::<f64>::default();
            let play_mm = |axis: &mut AxisState<f64>, velocity_mm_s: f64, ticks: u32| {
                for _ in 0..ticks {
                    let setpoint = Setpoint { velocity_mm_s, ..Setpoint::default() };
                    axis.tick(&config, &setpoint, &mut AxisOutput::default());
                }
                -axis.offset.to_mm()
            };
            let near =
                |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            near(play_mm(&mut axis, 10.0, 50), 0.0);
            // Noise of an axis that stands is no direction.
            near(play_mm(&mut axis, -9e-4, 50), 0.0);
            near(play_mm(&mut axis, -2e-3, 1 + u32::from(preview_ticks)), play_mm(&mut axis.clone(), 0.0, 0));
            // Ten ticks, and those of the preview; at rest, too.
            near(play_mm(&mut axis, 0.0, 9), -0.02);
            near(play_mm(&mut axis, 0.0, 50), -0.02);
            // There and, within it, back: first it ends.
            let half_mm = play_mm(&mut axis, 1.0, 5 + u32::from(preview_ticks));
            near(half_mm, -0.01);
            near(play_mm(&mut axis, -1.0, 5), 0.0);
            near(play_mm(&mut axis, -1.0, 10 + u32::from(preview_ticks)), -0.02);
        }
    }

    /// What is told is the load's, whatever the motor has to do for it; and a load that was moved by hand is found.
    #[test]
    fn positions_are_the_loads() {
        fn holds<R: Real>(tolerance_mm: f64) {
            for seed in 0..200 {
                let random = Random::new(seed);
                let error = random_table(&random);
                let backlash = Backlash { play_mm: 0.001 + 0.2 * random.unit(), take_up_s: 0.02 };
                let compensation = AxisCompensation { backlash: Some(backlash), pitch_error: Some(error) };
                let config = compensated::<R>(compensation, 0).expect("valid");
                let mut axis = AxisState::<R>::default();
                let at = |mm: f64| Counts((mm / figures().mm_per_count).round() as i64);
                // Motor and encoder at 3 mm, the load said to be at −7.
                let reach_mm = error.spacing_mm * error.point_count() as f64;
                let load_mm = error.start_mm + reach_mm * random.unit();
                axis.refer(&config, at(3.0), Position::from_mm(load_mm).expect("near"));
                assert!((axis.position(&config, at(3.0)).to_mm() - load_mm).abs() < tolerance_mm);
                let motor_of = |load_mm: f64| load_mm - expected(&error, load_mm)[0];
                let origin_mm = 3.0 - motor_of(load_mm);
                let moved_mm = load_mm + reach_mm * (2.0 * random.unit() - 1.0);
                let mut output =
                    AxisOutput { counts: at(origin_mm + motor_of(moved_mm)), ..AxisOutput::default() };
                let found_mm = axis.stand_here(&config, &mut output).to_mm();
                // Half a count.
                assert!((found_mm - moved_mm).abs() < 0.6 * figures().mm_per_count, "seed {seed}");
                axis.tick(&config, &Setpoint::default(), &mut output);
                assert!(output.following_error_mm.to_f64().abs() < 1e-6, "seed {seed}: {output:?}");
                assert!((output.actual.to_mm() - moved_mm).abs() < 0.6 * figures().mm_per_count);
            }
        }
        holds::<f32>(1e-7);
        holds::<f64>(1e-9);
        holds::<Fixed>(1e-7);
    }

    /// Homed after motion in either direction, and then through the play to the other side: the load is where it is said to be.
    #[test]
    fn a_reference_holds_on_both_sides_of_the_play() {
        for seed in 0..100 {
            let random = Random::new(seed);
            let (error, play_mm) = (random_table(&random), 0.1);
            let backlash = Backlash { play_mm, take_up_s: 0.02 };
            let compensation = AxisCompensation { backlash: Some(backlash), pitch_error: Some(error) };
            let config = compensated::<f64>(compensation, 3).expect("valid");
            let at = |mm: f64| Counts((mm / figures().mm_per_count).round() as i64);
            let load = Position::from_mm(error.start_mm + random.unit()).expect("near");
            for sign in [-1.0, 1.0] {
                let mut axis = AxisState::<f64>::default();
                // With a motor that is where it has to be.
                let tick = |axis: &mut AxisState<f64>, velocity_mm_s: f64| {
                    let setpoint = Setpoint { position: load, velocity_mm_s, ..Setpoint::default() };
                    let counts = at((load - axis.offset).to_mm());
                    axis.tick(
                        &config,
                        &setpoint,
                        &mut AxisOutput { counts, set: load, ..AxisOutput::default() },
                    );
                };
                let taken_up = |axis: &mut AxisState<f64>, velocity_mm_s: f64| {
                    (0..60).for_each(|_| tick(axis, velocity_mm_s));
                };
                taken_up(&mut axis, -sign);
                taken_up(&mut axis, sign);
                axis.refer(&config, at(5.0), load);
                let off_mm = |axis: &AxisState<f64>, motor_mm: f64| {
                    (axis.position(&config, at(motor_mm)) - load).to_mm().abs()
                };
                assert!(off_mm(&axis, 5.0) < 1e-8, "seed {seed}, {sign}");
                taken_up(&mut axis, -sign);
                let off_mm = off_mm(&axis, 5.0 - sign * play_mm);
                // Both places are rounded to counts.
                assert!(off_mm < 1.01 * figures().mm_per_count, "seed {seed}, {sign}: {off_mm}");
                // A take-up that is cut short counts as done.
                tick(&mut axis, sign);
                let mut output = AxisOutput { counts: at(5.0), ..AxisOutput::default() };
                let found = axis.stand_here(&config, &mut output);
                // It is found from 0.1 mm off, in four rounds that leave a twentieth each.
                assert!((found - load).to_mm().abs() < play_mm / 160_000.0, "seed {seed}, {sign}");
            }
        }
    }

    #[test]
    fn figures_out_of_their_ranges_are_refused_by_name() {
        let refused = |backlash, pitch_error| {
            let found = compensated::<Fixed>(AxisCompensation { backlash, pitch_error }, 0);
            found.err().map(|error| error.quantity)
        };
        let play = |play_mm, take_up_s| refused(Some(Backlash { play_mm, take_up_s }), None);
        assert_eq!(play(0.02, 0.01), None);
        for none in [0.0, -0.02, 1.001, f64::NAN] {
            assert_eq!(play(none, 0.01), Some("backlash [mm]"), "{none}");
        }
        for none in [0.0, 1e-4, 31.0, f64::NAN, f64::INFINITY] {
            assert_eq!(play(0.02, none), Some("ticks of a take-up"), "{none}");
        }
        assert_eq!(play(1.0, 0.0005), Some("velocity of a take-up [mm/s]"));
        let table = |start_mm, spacing_mm, points_um: &[f64], repeats| {
            refused(None, Some(PitchError::new(start_mm, spacing_mm, points_um, repeats).expect("a table")))
        };
        assert_eq!(table(0.0, 5.0, &[0.0, 10.0], true), None);
        assert_eq!(table(1.1e6, 5.0, &[0.0, 10.0], true), Some("start of the pitch error [mm]"));
        assert_eq!(table(f64::NAN, 5.0, &[0.0, 10.0], true), Some("start of the pitch error [mm]"));
        for none in [0.009, 1001.0, f64::NAN, -1.0] {
            assert_eq!(
                table(0.0, none, &[0.0, 0.0], true),
                Some("spacing of the pitch error [mm]"),
                "{none}"
            );
        }
        assert_eq!(table(0.0, 0.5, &[0.0, 10.1], false), Some("slope of the pitch error [mm/mm]"));
        // The last interval of one that repeats leads to the first point.
        assert_eq!(table(0.0, 0.5, &[0.0, 9.0, 18.0], false), None);
        assert_eq!(table(0.0, 0.5, &[0.0, 9.0, 18.0], true), Some("slope of the pitch error [mm/mm]"));
        let none =
            PitchError { points: 33, ..PitchError::new(0.0, 5.0, &[0.0, 0.0], true).expect("a table") };
        assert_eq!(refused(None, Some(none)), Some("points of the pitch error"));
        let mut high = PitchError::new(0.0, 500.0, &[0.0, 0.0], true).expect("a table");
        high.steps[1] = i16::MIN;
        assert_eq!(refused(None, Some(high)), Some("pitch error [µm]"));
        for points in [&[0.0][..], &[0.0; 33], &[0.0, 300.1], &[0.0, f64::NAN]] {
            assert_eq!(PitchError::new(0.0, 5.0, points, false), None);
        }
    }
}
