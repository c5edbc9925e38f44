//! A screw's pitch error: a table of points, and the smooth curve through them.

use serde::{Deserialize, Serialize};

use super::super::check::Check;
use crate::num::{Real, is_within};
use crate::units::Position;

/// Most points of a table.
pub const COMPENSATION_POINTS_MAX: usize = 32;
/// Greatest error at a point, in either direction \[µm\].
pub const PITCH_ERROR_UM_MAX: f64 = 300.0;
/// Greatest slope from point to point, in either direction \[mm/mm\].
pub const PITCH_ERROR_SLOPE_MAX: f64 = 0.02;
/// Least and greatest distance of two points \[mm\].
pub const PITCH_ERROR_SPACING_MM: [f64; 2] = [0.01, 1000.0];
/// Points are whole steps of this \[mm\].
const STEP_MM: f64 = 1.0e-5;
const STEPS_PER_UM: f64 = 100.0;
/// How far off a place in a table may be, over its distance from the start and the table's length: 2⁻³² \[1/mm\].
#[cfg(test)]
const PLACE_PER_MM2: f64 = 1.0 / 4_294_967_296.0;

/// The error of a screw over its travel: where the load is, less where the motor is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PitchError {
    /// Where the first point lies \[mm\], within ±10⁶.
    pub start_mm: f64,
    /// Distance of two points \[mm\], within [`PITCH_ERROR_SPACING_MM`].
    pub spacing_mm: f64,
    /// How many points there are, from 2 to [`COMPENSATION_POINTS_MAX`].
    pub(super) points: u16,
    /// The first point follows the last one again, everywhere; else the end points hold beyond the ends.
    pub repeats: bool,
    /// Points in steps of 10 nm; those that there are not are 0.
    #[serde(with = "crate::array")]
    pub(super) steps: [i16; COMPENSATION_POINTS_MAX],
}

impl PitchError {
    /// The table through `points_um` \[µm\], each rounded to 10 nm. `None` for fewer points than 2 or more than
    /// [`COMPENSATION_POINTS_MAX`], and for one beyond [`PITCH_ERROR_UM_MAX`]. The other figures are checked where the
    /// axes are [compensated](super::super::AxesConfig::compensated).
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
        self.points_um().nth(index)
    }

    /// The errors at all points \[µm\].
    pub fn points_um(&self) -> impl Iterator<Item = f64> + '_ {
        self.points().iter().map(|&step| f64::from(step) / STEPS_PER_UM)
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

    /// The greatest curvature of the curve through the points, in either direction \[1/mm\]: times a velocity's square it is
    /// what the motor has to accelerate by.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        let count = self.points().len();
        let point = |index: usize| {
            let index = if self.repeats {
                index.checked_rem(count)
            } else {
                Some(index.min(count.saturating_sub(1)))
            };
            index.and_then(|index| self.points().get(index)).map_or(0, |&step| i32::from(step))
        };
        let intervals = if self.repeats { count } else { count.saturating_sub(1) };
        // At both ends of every interval, between which it is linear, from twice the slopes there.
        let most = (0..intervals).fold(0, |most, index| {
            let (from, to) = (point(index), point(index + 1));
            let before = match index.checked_sub(1) {
                Some(before) => point(before),
                None if self.repeats => point(count.saturating_sub(1)),
                None => to,
            };
            let after = if !self.repeats && index + 1 >= intervals { from } else { point(index + 2) };
            let (m0, m1, h) = (to - before, after - from, to - from);
            let [left, right] = [6 * h - 2 * m0 - m1, m0 + 2 * m1 - 6 * h].map(i32::unsigned_abs);
            core::cmp::max(most, core::cmp::max(left, right))
        });
        f64::from(most) * STEP_MM / (self.spacing_mm * self.spacing_mm)
    }
}

/// A [`PitchError`] made for the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Table<R> {
    start: Position,
    /// From the first point to the last one, or to the first one again.
    length: Position,
    /// 2⁶⁴ over the length in steps of positions: a place in the table is a fraction of its length, for one product. It is
    /// rounded: a place is off by 2⁻³²/mm of its distance from the start, times the length.
    per_length: u64,
    intervals: u16,
    repeats: bool,
    pub(super) per_spacing: R,
    step_mm: R,
    half_step_mm: R,
    steps: [i16; COMPENSATION_POINTS_MAX],
}

/// The curve at a place: its value, and its first and second derivative by intervals \[mm\].
pub(super) struct Curve<R> {
    pub(super) error_mm: R,
    pub(super) first_mm: R,
    pub(super) second_mm: R,
}

impl<R: Real> Table<R> {
    pub(super) fn new(check: &mut Check, error: &PitchError) -> Self {
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
    pub(super) fn at(&self, load: Position) -> Curve<R> {
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::num::Fixed;
    use crate::random::Random;

    fn of_table<R: Real>(error: PitchError) -> Table<R> {
        Check::all(|check| Table::new(check, &error)).expect("a table")
    }

    /// A table with random figures, its slope at most the greatest.
    pub(in super::super) fn random_table(random: &Random) -> PitchError {
        let count = 2 + random.below(31) as usize;
        let spacing_mm = 0.05 * 400.0_f64.powf(random.unit());
        let most_um = (0.99 * PITCH_ERROR_SLOPE_MAX * spacing_mm * 1e3).min(150.0);
        let points: Vec<f64> = (0..count).map(|_| most_um * (random.unit() - 0.5)).collect();
        let start_mm = 2000.0 * (random.unit() - 0.5);
        PitchError::new(start_mm, spacing_mm, &points, random.below(2) == 0).expect("a table")
    }

    /// Value, slope and curvature by intervals, in Hermite's basis, from points and slopes found by their numbers \[mm\].
    pub(in super::super) fn expected(error: &PitchError, mm: f64) -> [f64; 3] {
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

    /// No place bends more, and one as much.
    #[test]
    fn the_greatest_curvature_is_found() {
        for seed in 0..300 {
            let error = random_table(&Random::new(seed));
            let curvature = error.curvature();
            let intervals = error.point_count() - usize::from(!error.repeats);
            let mut most = 0.0_f64;
            for interval in 0..intervals {
                for t in [1e-7, 0.3, 0.5, 0.8, 1.0 - 1e-7] {
                    let mm = error.start_mm + (interval as f64 + t) * error.spacing_mm;
                    most = most.max(expected(&error, mm)[2].abs() / error.spacing_mm.powi(2));
                }
            }
            assert!((most - curvature).abs() <= 1e-3 * curvature, "seed {seed}: {most} {curvature}");
        }
    }
}
