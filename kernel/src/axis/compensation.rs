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
//! to: behind the preview. Its derivatives go to feedforward, which comes before that, so they are those of the present set-point.
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
use crate::num::{Real, is_within};
use crate::path::Setpoint;
use crate::units::{Counts, Position};

/// Most points of a table.
pub const COMPENSATION_POINTS_MAX: usize = 32;
/// Greatest error at a point, in either direction \[µm\].
pub const PITCH_ERROR_UM_MAX: f64 = 300.0;
/// Greatest slope from point to point, in either direction \[mm/mm\].
pub const PITCH_ERROR_SLOPE_MAX: f64 = 0.02;
/// Least and greatest distance of two points \[mm\].
pub const PITCH_ERROR_SPACING_MM: [f64; 2] = [0.01, 1000.0];
/// Greatest backlash \[mm\].
pub const BACKLASH_MM_MAX: f64 = 1.0;
/// Greatest velocity, acceleration and jerk of a take-up over its backlash in its time: b/T, b/T², b/T³ times these.
pub const TAKE_UP_PEAKS: [f64; 3] = [2.1875, 7.513_188_404_399_293, 52.5];

/// Points are whole steps of this \[mm\].
const STEP_MM: f64 = 1.0e-5;
const STEPS_PER_UM: f64 = 100.0;
/// A take-up has at most so many ticks.
const TAKE_UP_TICKS_MAX: f64 = 60_000.0;
/// Set velocity from which on a direction is one \[mm/s\]: less may be rounding of an axis that stands while others move.
const MOVING_MM_S: f64 = 1.0e-3;
/// How far off a place in a table may be, over its distance from the start and the table's length: 2⁻³² \[1/mm\].
#[cfg(test)]
const PLACE_PER_MM2: f64 = 1.0 / 4_294_967_296.0;
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

/// Play between motor and load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Backlash {
    /// The play \[mm\], above 0, at most [`BACKLASH_MM_MAX`].
    pub play_mm: f64,
    /// How long the motor takes to go through it \[s\], from a tick to 60000; not faster than the axis' output
    /// ([`TAKE_UP_PEAKS`]).
    pub take_up_s: f64,
}

/// The error of a screw over its travel: where the load is, less where the motor is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PitchError {
    /// Where the first point lies \[mm\], within ±10⁶.
    pub start_mm: f64,
    /// Distance of two points \[mm\], within [`PITCH_ERROR_SPACING_MM`].
    pub spacing_mm: f64,
    /// How many points there are, from 2 to [`COMPENSATION_POINTS_MAX`].
    points: u16,
    /// The first point follows the last one again, everywhere; else the end points hold beyond the ends.
    pub repeats: bool,
    /// Points in steps of 10 nm; those that there are not are 0.
    #[serde(with = "crate::array")]
    steps: [i16; COMPENSATION_POINTS_MAX],
}

impl PitchError {
    /// The table through `points_um` \[µm\], each rounded to 10 nm. `None` for fewer points than 2 or more than
    /// [`COMPENSATION_POINTS_MAX`], and for one beyond [`PITCH_ERROR_UM_MAX`]. The other figures are checked where the
    /// axes are [compensated](AxesConfig::compensated).
    #[must_use]
    pub fn new(start_mm: f64, spacing_mm: f64, points_um: &[f64], repeats: bool) -> Option<Self> {
        let count = points_um.len();
        let are_errors = points_um.iter().all(|&um| is_within(um, -PITCH_ERROR_UM_MAX, PITCH_ERROR_UM_MAX));
        if !(2..=COMPENSATION_POINTS_MAX).contains(&count) || !are_errors {
            return None;
        }
        let mut steps = [0; COMPENSATION_POINTS_MAX];
        for (step, um) in steps.iter_mut().zip(points_um) {
            *step = libm::round(um * STEPS_PER_UM) as i16;
        }
        Some(Self { start_mm, spacing_mm, points: count as u16, repeats, steps })
    }

    /// The points in steps.
    fn points(&self) -> &[i16] {
        self.steps.get(..self.points.into()).unwrap_or_default()
    }

    /// How many points there are.
    #[must_use]
    pub fn point_count(&self) -> usize {
        self.points().len()
    }

    /// The error at a point, from 0 \[µm\].
    #[must_use]
    pub fn point_um(&self, index: usize) -> Option<f64> {
        self.points().get(index).map(|&step| f64::from(step) / STEPS_PER_UM)
    }

    /// The greatest slope from point to point, in either direction \[mm/mm\].
    #[must_use]
    pub fn slope(&self) -> f64 {
        let points = self.points();
        let after = points.iter().skip(1).chain(points.first().filter(|_| self.repeats));
        let change = points.iter().zip(after).fold(0, |most, (&from, &to)| {
            core::cmp::max(most, (i32::from(to) - i32::from(from)).unsigned_abs())
        });
        f64::from(change) * STEP_MM / self.spacing_mm
    }
}

/// A [`PitchError`] made for the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Table<R> {
    start: Position,
    /// From the first point to the last one, or to the first one again.
    length: Position,
    /// 2⁶⁴ over the length in steps of positions: a place in the table is a fraction of its length, for one product. It is
    /// rounded: a place is off by 2⁻³²/mm of its distance from the start, times the length.
    per_length: u64,
    intervals: u16,
    repeats: bool,
    per_spacing: R,
    step_mm: R,
    half_step_mm: R,
    steps: [i16; COMPENSATION_POINTS_MAX],
}

/// The curve at a place: its value, and its first and second derivative by intervals \[mm\].
struct Curve<R> {
    error_mm: R,
    first_mm: R,
    second_mm: R,
}

impl<R: Real> Table<R> {
    fn new(check: &mut Check, error: &PitchError) -> Self {
        let &PitchError { start_mm, spacing_mm, points, repeats, steps } = error;
        check.within([-1.0e6, 1.0e6], "start of the pitch error [mm]", start_mm, "a number from -1e6 to 1e6");
        let expected = "a number from 0.01 to 1000";
        check.within(PITCH_ERROR_SPACING_MM, "spacing of the pitch error [mm]", spacing_mm, expected);
        let count = f64::from(points);
        let expected = "from 2 to 32";
        check.within([2.0, COMPENSATION_POINTS_MAX as f64], "points of the pitch error", count, expected);
        let most = error.points().iter().fold(0, |most, step| core::cmp::max(most, step.unsigned_abs()));
        let most_um = f64::from(most) / STEPS_PER_UM;
        let expected = "at most 300 in either direction";
        check.within([0.0, PITCH_ERROR_UM_MAX], "pitch error [µm]", most_um, expected);
        let expected = "at most 0.02 from point to point";
        check.within(
            [0.0, PITCH_ERROR_SLOPE_MAX],
            "slope of the pitch error [mm/mm]",
            error.slope(),
            expected,
        );
        let intervals = points.saturating_sub(u16::from(!repeats));
        let length_mm = spacing_mm * f64::from(intervals);
        let length = Position::from_mm(length_mm).unwrap_or_default();
        Self {
            start: Position::from_mm(start_mm).unwrap_or_default(),
            length,
            per_length: u64::MAX.checked_div(length.to_bits().unsigned_abs()).unwrap_or_default(),
            intervals,
            repeats,
            per_spacing: R::from_f64(1.0 / spacing_mm),
            step_mm: R::from_f64(STEP_MM),
            half_step_mm: R::from_f64(0.5 * STEP_MM),
            steps,
        }
    }

    /// A point; behind the last one of a table that repeats, the first one again.
    fn step(&self, index: usize) -> i32 {
        let last = usize::from(self.intervals);
        let index = if self.repeats && index >= last { index - last } else { index };
        self.steps.get(index).copied().unwrap_or_default().into()
    }

    /// The curve where the load is.
    fn at(&self, load: Position) -> Curve<R> {
        let ahead = (load - self.start).to_bits();
        let intervals = usize::from(self.intervals);
        let holds = |index: usize| Curve {
            error_mm: steps::<R>(self.step(index)) * self.step_mm,
            first_mm: R::ZERO,
            second_mm: R::ZERO,
        };
        if !self.repeats {
            if ahead <= 0 {
                return holds(0);
            }
            if ahead >= self.length.to_bits() {
                return holds(intervals);
            }
        }
        // Modulo 2⁶⁴, as a fraction of the length: a table that repeats needs no remainder.
        let fraction = ahead.cast_unsigned().wrapping_mul(self.per_length) >> 32;
        let place = fraction * u64::from(self.intervals);
        let index = (place >> 32) as usize;
        let t = R::from_q32((place & 0xFFFF_FFFF).cast_signed());
        let (from, to) = (self.step(index), self.step(index + 1));
        // At an end that holds, its neighbour is its own mirror image.
        let before = match index.checked_sub(1) {
            Some(before) => self.step(before),
            None if self.repeats => self.step(intervals.saturating_sub(1)),
            None => to,
        };
        let after = if !self.repeats && index + 1 >= intervals { from } else { self.step(index + 2) };
        // Twice the slopes at both ends; with h = to − from: error = from + t·(m₀ + t·(b + t·a)).
        let (m0, m1, h) = (to - before, after - from, to - from);
        let (a, b) = (m0 + m1 - 4 * h, 6 * h - 2 * m0 - m1);
        let [m0, a, b] = [m0, a, b].map(|twice| steps::<R>(twice) * self.half_step_mm);
        let ta = t * a;
        let (ta2, ta3) = (ta + ta, ta + ta + ta);
        Curve {
            error_mm: steps::<R>(from) * self.step_mm + t * (m0 + t * (b + ta)),
            first_mm: m0 + t * (b + b + ta3),
            second_mm: b + b + ta2 + ta2 + ta2,
        }
    }
}

fn steps<R: Real>(steps: i32) -> R {
    R::from_q32(i64::from(steps) << 32)
}

/// A [`Backlash`] made for the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TakeUp<R> {
    play_mm: R,
    ticks: u16,
    per_tick: R,
    /// Over the play and the time T: b/T, b/T², b/T³.
    velocity_mm_s: R,
    accel_mm_s2: R,
    jerk_mm_s3: R,
}

impl<R: Real> TakeUp<R> {
    fn new(check: &mut Check, backlash: &Backlash, most_mm_s: f64, tick_s: f64) -> Self {
        let &Backlash { play_mm, take_up_s } = backlash;
        let is_play = play_mm > 0.0 && play_mm <= BACKLASH_MM_MAX;
        check.that(is_play, "backlash [mm]", play_mm, "a number above 0, at most 1");
        // Whole ticks, one at least: what is rounded is less than a tick.
        let ticks = libm::round(take_up_s / tick_s);
        let expected = "from one tick to 60000";
        check.within([1.0, TAKE_UP_TICKS_MAX], "ticks of a take-up", ticks, expected);
        let take_up_s = ticks * tick_s;
        let [velocity_mm_s, accel_mm_s2, jerk_mm_s3] = [
            play_mm / take_up_s,
            play_mm / take_up_s / take_up_s,
            play_mm / take_up_s / take_up_s / take_up_s,
        ];
        let [peak, _, peak_of_jerk] = TAKE_UP_PEAKS;
        let expected = "a take-up that the output reaches, within the kernel's range";
        let is_reached = peak * velocity_mm_s <= most_mm_s && fits::<R>(8.0 * peak_of_jerk * jerk_mm_s3);
        check.that(is_reached, "velocity of a take-up [mm/s]", peak * velocity_mm_s, expected);
        Self {
            play_mm: R::from_f64(play_mm),
            ticks: ticks as u16,
            per_tick: R::from_f64(1.0 / ticks),
            velocity_mm_s: R::from_f64(velocity_mm_s),
            accel_mm_s2: R::from_f64(accel_mm_s2),
            jerk_mm_s3: R::from_f64(jerk_mm_s3),
        }
    }

    /// c of the play, after so many ticks of a take-up to the side \[mm\].
    fn at(&self, ticks: u16, is_negative: bool) -> R {
        let share = if ticks >= self.ticks {
            R::ONE
        } else {
            let u = number::<R>(ticks) * self.per_tick;
            let u2 = u * u;
            let [c4, c5, c6, c7] = [35, 84, 70, 20].map(number::<R>);
            u2 * u2 * (c4 - u * (c5 - u * (c6 - u * c7)))
        };
        let share = if is_negative { share } else { R::ONE - share };
        -(self.play_mm * share)
    }

    /// Adds velocity, acceleration and jerk of c after so many ticks of a take-up to the side.
    fn add(&self, setpoint: &mut Setpoint<R>, ticks: u16, is_negative: bool) {
        if ticks >= self.ticks {
            return;
        }
        let u = number::<R>(ticks) * self.per_tick;
        let w = u * (R::ONE - u);
        let [s1, s2, s3, five] = [140, 420, 840, 5].map(number::<R>);
        let velocity = self.velocity_mm_s * (s1 * w * w * w);
        let accel = self.accel_mm_s2 * (s2 * w * w * (R::ONE - u - u));
        let jerk = self.jerk_mm_s3 * (s3 * w * (R::ONE - five * w));
        let signed = |value: R| if is_negative { -value } else { value };
        setpoint.velocity_mm_s = setpoint.velocity_mm_s + signed(velocity);
        setpoint.accel_mm_s2 = setpoint.accel_mm_s2 + signed(accel);
        setpoint.jerk_mm_s3 = setpoint.jerk_mm_s3 + signed(jerk);
    }
}

fn number<R: Real>(count: u16) -> R {
    R::from_q32(i64::from(count) << 32)
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

    fn of_table<R: Real>(error: PitchError) -> Table<R> {
        Check::all(|check| Table::new(check, &error)).expect("a table")
    }

    /// A table with random figures, its slope at most the greatest.
    fn random_table(random: &Random) -> PitchError {
        let count = 2 + random.below(31) as usize;
        let spacing_mm = 0.05 * 400.0_f64.powf(random.unit());
        let most_um = (0.99 * PITCH_ERROR_SLOPE_MAX * spacing_mm * 1e3).min(150.0);
        let points: Vec<f64> = (0..count).map(|_| most_um * (random.unit() - 0.5)).collect();
        let start_mm = 2000.0 * (random.unit() - 0.5);
        PitchError::new(start_mm, spacing_mm, &points, random.below(2) == 0).expect("a table")
    }

    /// Value, slope and curvature by intervals, in Hermite's basis, from points and slopes found by their numbers \[mm\].
    fn expected(error: &PitchError, mm: f64) -> [f64; 3] {
        let count = error.point_count() as i64;
        let point = |index: i64| {
            let index =
                if error.repeats { index.rem_euclid(count) } else { index.clamp(0, count - 1) } as usize;
            error.point_um(index).expect("a point") * 1e-3
        };
        let place = (mm - error.start_mm) / error.spacing_mm;
        let last = (count - 1) as f64;
        if !(error.repeats || place > 0.0 && place < last) {
            return [point(if place > 0.0 { count } else { 0 }), 0.0, 0.0];
        }
        let (index, t) = (place.floor() as i64, place - place.floor());
        let slope = |index: i64| {
            let is_end = !error.repeats && (index == 0 || index == count - 1);
            if is_end { 0.0 } else { (point(index + 1) - point(index - 1)) / 2.0 }
        };
        let ends = [point(index), slope(index), point(index + 1), slope(index + 1)];
        let bases = [
            [2.0 * t * t * t - 3.0 * t * t + 1.0, 6.0 * t * t - 6.0 * t, 12.0 * t - 6.0],
            [t * t * t - 2.0 * t * t + t, 3.0 * t * t - 4.0 * t + 1.0, 6.0 * t - 4.0],
            [-2.0 * t * t * t + 3.0 * t * t, -6.0 * t * t + 6.0 * t, -12.0 * t + 6.0],
            [t * t * t - t * t, 3.0 * t * t - 2.0 * t, 6.0 * t - 2.0],
        ];
        core::array::from_fn(|order| ends.iter().zip(&bases).map(|(end, basis)| end * basis[order]).sum())
    }

    /// Random tables at random places, in all number types.
    #[test]
    fn a_table_is_a_smooth_curve_through_its_points() {
        fn holds<R: Real>(error: &PitchError, mm: f64, tolerance_mm: f64, seed: u64) {
            let curve = of_table::<R>(*error).at(Position::from_mm(mm).expect("near"));
            let found = [curve.error_mm, curve.first_mm, curve.second_mm].map(R::to_f64);
            // How far off the place may be, in intervals: every derivative changes by less than 20 times the change a point.
            let length_mm = error.spacing_mm * error.point_count() as f64;
            let off = (mm - error.start_mm).abs() * length_mm * PLACE_PER_MM2 / error.spacing_mm;
            let tolerance_mm = tolerance_mm + 20.0 * off * error.slope() * error.spacing_mm;
            for (found, expected) in found.into_iter().zip(expected(error, mm)) {
                // A step of 10 nm has five digits in fixed point.
                let is_near = (found - expected).abs() < tolerance_mm + 1.2e-5 * expected.abs();
                assert!(is_near, "seed {seed}, {mm}: {found:e} {expected:e} of {error:?}");
            }
        }
        for seed in 0..300 {
            let random = Random::new(seed);
            let error = random_table(&random);
            let reach_mm = error.spacing_mm * error.point_count() as f64;
            for _ in 0..100 {
                let mut mm = error.start_mm + reach_mm * (3.0 * random.unit() - 1.0);
                // Curvature steps at points: not there.
                let part = ((mm - error.start_mm) / error.spacing_mm).rem_euclid(1.0);
                if !(1e-3..0.999).contains(&part) {
                    mm += 0.01 * error.spacing_mm;
                }
                // Places are multiples of 2⁻³² of the length; curvatures are up to 3 mm.
                holds::<f64>(&error, mm, 1e-7, seed);
                holds::<f32>(&error, mm, 5e-7, seed);
                holds::<Fixed>(&error, mm, 5e-7, seed);
            }
            // The points themselves, or 64 turns further on.
            for index in 0..error.point_count() {
                let turn_mm = if error.repeats { 64.0 * reach_mm } else { 0.0 };
                let mm = error.start_mm + error.spacing_mm * index as f64 + turn_mm;
                let at = Position::from_mm(mm).expect("near");
                let found = of_table::<f64>(error).at(at).error_mm;
                let point_mm = error.point_um(index).expect("a point") * 1e-3;
                let off_mm = (mm - error.start_mm).abs() * reach_mm * PLACE_PER_MM2;
                let tolerance_mm = 1e-8 + 2.0 * error.slope() * off_mm;
                assert!(
                    (found - point_mm).abs() < tolerance_mm,
                    "seed {seed}, point {index}: {found} {point_mm}"
                );
            }
        }
    }

    /// Against Bernstein's form of the septic, and differences of it; to either side.
    #[test]
    fn a_take_up_goes_from_rest_to_rest() {
        let share = |u: f64| -> f64 {
            [35.0, 21.0, 7.0, 1.0]
                .iter()
                .zip(4..)
                .map(|(c, k): (&f64, i32)| c * u.powi(k) * (1.0 - u).powi(7 - k))
                .sum()
        };
        let backlash = Backlash { play_mm: 0.02, take_up_s: 0.01 };
        let take_up: TakeUp<f64> =
            Check::all(|check| TakeUp::new(check, &backlash, 1000.0, TICK_S)).expect("a take-up");
        let (h, mut peaks) = (1e-3, [0.0_f64; 3]);
        for ticks in 0..=25_u16 {
            let u = (f64::from(ticks) / 20.0).min(1.0);
            assert!((take_up.at(ticks, true) + 0.02 * share(u)).abs() < 1e-15);
            assert!((take_up.at(ticks, false) + 0.02 * (1.0 - share(u))).abs() < 1e-15);
            if !(1..20).contains(&ticks) {
                continue;
            }
            let [below, above, below2, above2] = [-h, h, -2.0 * h, 2.0 * h].map(|step| share(u + step));
            let first = (above - below) / (2.0 * h);
            let second = (above - 2.0 * share(u) + below) / (h * h);
            let third = (above2 - 2.0 * above + 2.0 * below - below2) / (2.0 * h * h * h);
            for is_negative in [true, false] {
                let mut motor = Setpoint::<f64>::default();
                take_up.add(&mut motor, ticks, is_negative);
                let sign = if is_negative { -1.0 } else { 1.0 };
                for (found, (expected, tolerance)) in
                    [motor.velocity_mm_s, motor.accel_mm_s2, motor.jerk_mm_s3].into_iter().zip([
                        (sign * 0.02 * first / 0.01, 1e-4),
                        (sign * 0.02 * second / 1e-4, 0.02),
                        (sign * 0.02 * third / 1e-6, 100.0),
                    ])
                {
                    assert!((found - expected).abs() < tolerance, "{ticks}: {found} {expected}");
                }
                let found = [motor.velocity_mm_s, motor.accel_mm_s2, motor.jerk_mm_s3];
                peaks = core::array::from_fn(|order| peaks[order].max(found[order].abs()));
            }
        }
        let most = [0.02 / 0.01, 0.02 / 1e-4, 0.02 / 1e-6];
        for order in 0..3 {
            let most = TAKE_UP_PEAKS[order] * most[order];
            assert!(peaks[order] <= most * 1.000_001 && peaks[order] > 0.9 * most, "{peaks:?}");
        }
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
