//! An arch of jerk in normalised time, the same for every ramp.
//!
//! With x = t/t₁ in \[0, 1\] the rising phase of S1 (1)–(6) is one arch; the edges of a pulse with a plateau
//! are its halves, with t₁ = 2e.
//!
//! | quantity | scale | shape |
//! |---|---|---|
//! | jerk | Jp | sin²πx |
//! | acceleration | Jp·t₁ | x/2 − sin 2πx/(4π) |
//! | feed gained | Jp·t₁² | x²/4 − sin²πx/(4π²) |
//! | length gained | Jp·t₁³ | x³/12 − x/(8π²) + sin 2πx/(16π³) |
//! | snap | π·Jp/t₁ | sin 2πx |
//!
//! The middle three are differences of nearly equal terms when x is small: with a sine in f32, the length has
//! lost every digit at x = 0.005. So it is done the other way round: feed and length are power series, and
//! the sine follows from them. With y = 2x, C = 4π² times the feed gained and B = 4π² times the length
//! gained,
//!
//! ```text
//! jerk = π²y²/4 − C     acceleration = π²y³/24 − B     snap = π·(y − 4·acceleration)
//! ```
//!
//! (the coefficients are those of [`Coefficients`](crate::num::Coefficients)), where cancellation costs jerk
//! and acceleration less than two bits, and snap keeps its absolute error. The series run up to x = 1/2;
//! beyond, the shapes are those at 1 − x mirrored. The falling phase is the rising one run backwards from the
//! ramp's end, so both ends of a ramp have the full relative precision. All coefficients and intermediate
//! results stay below 4, so 32-bit fixed point is enough.
//!
//! In the tick: two series of constant length side by side, a dozen more multiplications, no division.
//!
//! [`Shape::closed`] has the closed forms, with any sine of [`crate::num::sine`].

use crate::num::sine::SineCosine;
use crate::num::{Root, SERIES_TERMS_MAX, Unit};

/// Newton steps after which [`Shape::where_speed_is`] has its last digit in f64.
const SPEED_STEPS_MAX: usize = 8;

/// Relative error of [`Shape::about_where_speed_is`], in time and in length.
pub(super) const ABOUT_WITHIN: [f64; 2] = [1.0e-4, 6.0e-4];
/// x/√w and the length gained over x·w² as polynomials of w = √(4·speed), interpolated in Chebyshev's nodes
/// of \[0, 1\].
const ABOUT_TIME: [f64; 5] = [0.742_574_33, 0.131_734_09, 0.080_664_49, -0.031_184_95, 0.076_290_74];
const ABOUT_LENGTH: [f64; 5] = [0.049_999_16, 0.010_402_43, 0.004_873_61, 0.002_285_99, 0.003_136_08];

/// Errors of [`Shape::about_where_missing_is`]: of the time, relative, and of the length, absolute.
pub(super) const ABOUT_MISSING_WITHIN: [f64; 2] = [3.0e-5, 5.0e-7];
/// The feed gained in an edge over x⁴, its slope over x³ and its integral over x⁵, as powers of x²: the first terms of their
/// series, from sin²y = y² − y⁴/3 + 2y⁶/45 − y⁸/315 + 2y¹⁰/14175 − … with y = πx.
const EDGE_SPEED: [f64; 5] = {
    let square = core::f64::consts::PI * core::f64::consts::PI;
    let fourth = square * square;
    [
        square / 12.0,
        -fourth / 90.0,
        fourth * square / 1260.0,
        -fourth * fourth / 28_350.0,
        fourth * fourth * square / 935_550.0,
    ]
};
const EDGE_ACCEL: [f64; 5] = {
    let [a, b, c, d, e] = EDGE_SPEED;
    [4.0 * a, 6.0 * b, 8.0 * c, 10.0 * d, 12.0 * e]
};
const EDGE_LENGTH: [f64; 5] = {
    let [a, b, c, d, e] = EDGE_SPEED;
    [a / 5.0, b / 7.0, c / 9.0, d / 11.0, e / 13.0]
};
/// The first of them nearly, as one number, for a first guess.
const EDGE_SPEED_MEAN: f64 = 0.66;

/// The law's shapes at one normalised time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape<U> {
    /// 0 … 1 … 0.
    pub jerk: U,
    /// 0 … 1/2.
    pub accel: U,
    /// 0 … 1/4.
    pub speed: U,
    /// 0 … 1/12 − 1/(8π²).
    pub length: U,
    /// 0 … 1 … −1 … 0.
    pub snap: U,
}

impl<U: Unit> Shape<U> {
    /// At x = 1/2, where a plateau begins.
    pub(super) fn middle() -> Self {
        let unit = U::from_f64;
        let square = core::f64::consts::PI * core::f64::consts::PI;
        Self {
            jerk: U::ONE,
            accel: unit(0.25),
            speed: unit(1.0 / 16.0 - 0.25 / square),
            length: unit(1.0 / 96.0 - 1.0 / (16.0 * square)),
            snap: U::ZERO,
        }
    }

    /// The place in the phase where the feed gained is `speed` of its scale, 0 … 1/4, and the shapes there.
    /// Background.
    ///
    /// Newton's method on a convex function from above: the result is never below the root except by
    /// rounding.
    pub(super) fn where_speed_is<R: Root<Unit = U>>(speed: R) -> (R, Self) {
        // Just above the root.
        let above = R::from_f64(1.0 + ABOUT_WITHIN[0]);
        let mut x = (Self::about_where_speed_is(speed).0 * above).min(R::ONE);
        let mut shape = Self::at(x.to_unit());
        for _ in 0..SPEED_STEPS_MAX {
            let accel = R::ONE.scaled(shape.accel);
            let next = x - (R::ONE.scaled(shape.speed) - speed) / accel;
            // `<` also ends on NaN.
            if !(next < x && next > R::ZERO) {
                break;
            }
            x = next;
            shape = Self::at(x.to_unit());
        }
        (x, shape)
    }

    /// Approximates [`where_speed_is`](Self::where_speed_is) and the length gained there, to the relative
    /// errors [`ABOUT_WITHIN`]. Near 0 both are powers of w = √(4·`speed`) but for a factor, and these
    /// factors are polynomials of w.
    pub(super) fn about_where_speed_is<R: Root<Unit = U>>(speed: R) -> (R, R) {
        let w = (speed * R::from_f64(4.0)).sqrt();
        let polynomial = |coefficients: &[f64; 5]| {
            coefficients.iter().rev().fold(R::ZERO, |sum, &coefficient| sum * w + R::from_f64(coefficient))
        };
        let x = w.sqrt() * polynomial(&ABOUT_TIME);
        (x, x * w * w * polynomial(&ABOUT_LENGTH))
    }

    /// In a closing edge that ends with the acceleration `accel`, 1/2 and more: about the time that is left where
    /// `missing` of the feed is still to be gained, and the length that an edge gains in that time, to the errors
    /// [`ABOUT_MISSING_WITHIN`].
    ///
    /// With S(x) the feed that an edge gains, `missing` = `accel`·x − S(x): two Newton steps, the first with a rough S.
    pub(super) fn about_where_missing_is<R: Root<Unit = U>>(missing: R, accel: R) -> (R, R) {
        let series = |coefficients: &[f64; 5], square: R| {
            coefficients.iter().rev().fold(R::ZERO, |sum, &each| sum * square + R::from_f64(each))
        };
        let alone = missing / accel;
        let rough = R::from_f64(EDGE_SPEED_MEAN) * alone * alone * alone;
        let x = alone + rough * alone / (accel - R::from_f64(4.0) * rough);
        let (square, cube) = (x * x, x * x * x);
        let (speed, slope) = (cube * x * series(&EDGE_SPEED, square), cube * series(&EDGE_ACCEL, square));
        let x = x + (missing - accel * x + speed) / (accel - slope);
        let square = x * x;
        (x, square * square * x * series(&EDGE_LENGTH, square))
    }

    /// The shapes at `z` in \[0, 1/2\]: an edge. In the tick.
    #[inline]
    #[must_use]
    pub(super) fn at_edge(z: U) -> Self {
        use core::f64::consts::PI;
        let unit = U::from_f64;
        let y = z + z;
        let square = y * y;
        let cube = square * y;
        let b = series(U::SINE_TAIL, square) * (cube * square);
        let c = series(U::COSINE_TAIL, square) * (square * square);
        let accel = cube * unit(PI * PI / 24.0) - b;
        let jerk = square * unit(PI * PI / 4.0) - c;
        let twice = accel + accel;
        let snap = (y - (twice + twice)) * unit(PI);
        let scale = unit(1.0 / (4.0 * PI * PI));
        Self { jerk, accel, speed: c * scale, length: b * scale, snap }
    }

    /// The shapes at `x` in \[0, 1\].
    #[inline]
    #[must_use]
    pub fn at(x: U) -> Self {
        use core::f64::consts::PI;
        let unit = U::from_f64;
        let half = unit(0.5);
        if !(x > half) {
            return Self::at_edge(x);
        }
        // Exact: 1 − x loses no digit for x above 1/2.
        let z = U::ONE - x;
        let Self { jerk, accel, speed, length, snap } = Self::at_edge(z);
        // From x³ + z³ = 1 − 3xz and x² − z² = x − z.
        let length_sum = unit(1.0 / 12.0 - 1.0 / (8.0 * PI * PI)) - unit(0.25) * (x * z);
        Self {
            jerk,
            accel: half - accel,
            speed: half * (x - half) + speed,
            length: length_sum - length,
            snap: -snap,
        }
    }

    /// The shapes at `x` in \[0, 1\] as S1 writes them, with the sine of `B`: `Shape::closed::<Own>(x)`.
    ///
    /// [`Shape::at`] is better at the ramp's ends; `tests/expected/functions.md` shows by how much. In
    /// absolute error these are better for jerk, acceleration and snap.
    #[inline]
    #[must_use]
    pub fn closed<B: SineCosine<U>>(x: U) -> Self {
        use core::f64::consts::PI;
        let unit = U::from_f64;
        let mirrored = x > unit(0.5);
        let (sine, cosine) = B::sin_cos(if mirrored { U::ONE - x } else { x });
        let square = sine * sine;
        let product = sine * cosine;
        let double = if mirrored { -(product + product) } else { product + product };
        let x_square = x * x;
        Self {
            jerk: square,
            accel: x * unit(0.5) - double * unit(1.0 / (4.0 * PI)),
            speed: x_square * unit(0.25) - square * unit(1.0 / (4.0 * PI * PI)),
            length: x * (x_square * unit(1.0 / 12.0) - unit(1.0 / (8.0 * PI * PI)))
                + double * unit(1.0 / (16.0 * PI * PI * PI)),
            snap: double,
        }
    }
}

#[inline]
fn series<U: Unit>(coefficients: &[U; SERIES_TERMS_MAX], square: U) -> U {
    let mut sum = U::ZERO;
    for &coefficient in coefficients.iter().take(U::SERIES_TERMS).rev() {
        sum = sum * square + coefficient;
    }
    sum
}

#[cfg(test)]
mod tests {
    use fixed::types::I3F29;

    use super::*;
    use crate::num::Scalar;
    use crate::num::sine::Own;

    /// The halves must meet, and end where S1 (7)–(9) say.
    #[test]
    fn halves_meet_and_end_where_the_paper_says() {
        let (below, above) = (Shape::at(0.5_f64), Shape::at(0.5_f64.next_up()));
        for (b, a) in [
            (below.jerk, above.jerk),
            (below.accel, above.accel),
            (below.speed, above.speed),
            (below.length, above.length),
            (below.snap, above.snap),
        ] {
            assert!((b - a).abs() <= 2e-15, "{b:e} {a:e}");
        }
        let end = Shape::at(1.0_f64);
        assert!((end.accel - 0.5).abs() < 1e-16 && (end.speed - 0.25).abs() < 1e-16);
        let length = 1.0 / 12.0 - 1.0 / (8.0 * core::f64::consts::PI.powi(2));
        assert!((end.length - length).abs() < 1e-16);
        assert_eq!((end.jerk, end.snap), (0.0, 0.0));
    }

    /// The estimate against Newton's method, over the whole range.
    #[test]
    fn about_where_a_speed_is() {
        let mut worst = [0.0_f64; 2];
        for i in 0..=1_000_000_u32 {
            let speed = 0.25 * (f64::from(i) / 1_000_000.0).powi(4);
            let (x, shape) = Shape::<f64>::where_speed_is(speed);
            let about: (f64, f64) = Shape::<f64>::about_where_speed_is(speed);
            assert!(i > 0 || about == (0.0, 0.0));
            if shape.length > f64::MIN_POSITIVE {
                worst[0] = worst[0].max((about.0 / x - 1.0).abs());
                worst[1] = worst[1].max((about.1 / shape.length - 1.0).abs());
            }
        }
        println!("time, length: {worst:?}");
        assert!(worst[0] < ABOUT_WITHIN[0] && worst[1] < ABOUT_WITHIN[1], "{worst:?}");
    }

    /// The estimate in a closing edge: what it was made from is found again, whatever the acceleration at its end.
    #[test]
    fn about_where_a_speed_is_missing() {
        let mut worst = [0.0_f64; 2];
        for (step, i) in (0..=60).flat_map(|step| (1..=2000).map(move |i| (step, i))) {
            let (accel, x) = (0.5 * 1.2_f64.powi(step), 0.5 * f64::from(i) / 2000.0);
            let shape = Shape::at(x);
            let (about, length) = Shape::<f64>::about_where_missing_is(accel * x - shape.speed, accel);
            worst[0] = worst[0].max((about / x - 1.0).abs());
            worst[1] = worst[1].max((length - Shape::at(about.min(0.5)).length).abs());
        }
        println!("time, length: {worst:?}");
        assert!(worst[0] < ABOUT_MISSING_WITHIN[0] && worst[1] < ABOUT_MISSING_WITHIN[1], "{worst:?}");
    }

    /// f64 against the closed forms, which are good where they don't cancel.
    #[test]
    fn shapes_are_those_of_the_closed_forms() {
        let mut worst = [0.0_f64; 5];
        for i in 0..=1_000_000_u32 {
            let x = f64::from(i) / 1_000_000.0;
            let (shape, closed) = (Shape::at(x), Shape::closed::<Own>(x));
            let pairs = [
                (shape.jerk, closed.jerk),
                (shape.accel, closed.accel),
                (shape.speed, closed.speed),
                (shape.length, closed.length),
                (shape.snap, closed.snap),
            ];
            for (worst, (series, closed)) in worst.iter_mut().zip(pairs) {
                *worst = worst.max((series - closed).abs());
            }
        }
        println!("f64 against closed forms: {worst:?}");
        assert!(worst.iter().all(|&worst| worst < 1.6e-15), "{worst:?}");
    }

    /// f32 against f64 at the same argument: the stated bound over the whole range.
    #[test]
    fn f32_keeps_its_relative_precision_down_to_the_edge() {
        let mut worst = [0.0_f64; 3];
        for i in 0..=200_000_u32 {
            let x = 10.0_f64.powf(f64::from(i) / 200_000.0 * 6.0 - 6.0) as f32;
            let (narrow, wide) = (Shape::at(x), Shape::at(f64::from(x)));
            let pairs =
                [(narrow.accel, wide.accel), (narrow.speed, wide.speed), (narrow.length, wide.length)];
            for (worst, (narrow, wide)) in worst.iter_mut().zip(pairs) {
                *worst = worst.max(((f64::from(narrow) - wide) / wide).abs());
            }
        }
        println!("f32 relative error, acceleration, speed, length: {worst:?}");
        assert!(worst[0] < 5e-7 && worst[1] < 5e-7 && worst[2] < 2e-6, "{worst:?}");
    }

    /// Fixed point against f64 at the same argument: a few of its steps.
    #[test]
    fn fixed_point_is_good_to_a_few_steps() {
        let mut worst = [0.0_f64; 5];
        for i in 0..=1_000_000_u64 {
            let x = I3F29::from_fraction(i << 44);
            let (narrow, wide) = (Shape::at(x), Shape::at(x.to_f64()));
            let pairs = [
                (narrow.jerk, wide.jerk),
                (narrow.accel, wide.accel),
                (narrow.speed, wide.speed),
                (narrow.length, wide.length),
                (narrow.snap, wide.snap),
            ];
            for (worst, (narrow, wide)) in worst.iter_mut().zip(pairs) {
                *worst = worst.max((narrow.to_f64() - wide).abs() * 536_870_912.0);
            }
        }
        println!("fixed point, steps of error: {worst:.2?}");
        assert!(worst[..4].iter().all(|&steps| steps < 10.0) && worst[4] < 70.0, "{worst:?}");
    }
}
