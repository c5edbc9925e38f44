//! The law in normalised time, the same for every ramp.
//!
//! With x = t/t₁ in \[0, 1\] the rising phase of S1 (1)–(6) is
//!
//! | quantity | scale | shape |
//! |---|---|---|
//! | jerk | Jp | sin²πx |
//! | acceleration | Jp·t₁ | x/2 − sin 2πx/(4π) |
//! | feed gained | Jp·t₁² | x²/4 − sin²πx/(4π²) |
//! | length gained | Jp·t₁³ | x³/12 − x/(8π²) + sin 2πx/(16π³) |
//! | snap | π·Jp/t₁ | sin 2πx |
//!
//! The middle three are differences of nearly equal terms when x is small: with a sine in f32, the
//! length has lost every digit at x = 0.005. So it goes the other way round: feed and length are
//! power series, and what is left of them is the sine. With B the length and C the feed gained,
//!
//! ```text
//! acceleration = π²x³/3 − 4π²·B     snap = 2πx − 4π·acceleration     jerk = π²x² − 4π²·C
//! ```
//!
//! where cancelling costs acceleration and jerk less than two bits, and snap keeps its absolute error.
//! The series run up to x = 1/2; beyond, the shapes are those at 1 − x mirrored. The falling phase is the rising one run backwards
//! from the ramp's end, so both ends of a ramp have the full relative precision.
//!
//! In the tick: two series of constant length side by side, a dozen multiplications more, no
//! division, and no branch that depends on the time but the mirror, which is a choice of values.

use crate::num::Real;

/// The law's shapes at one normalised time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape<R> {
    /// 0 … 1 … 0.
    pub jerk: R,
    /// 0 … 1/2.
    pub accel: R,
    /// 0 … 1/4.
    pub speed: R,
    /// 0 … 1/12 − 1/(8π²).
    pub length: R,
    /// 0 … 1 … −1 … 0.
    pub snap: R,
}

/// (−1)^(n+1)·(2π)^(2n+2)/((2n+2)!·8π²), n = 1 …: feed gained, over x⁴.
const SPEED: [f64; SERIES_TERMS_MAX] = [
    0.822_467_033_424_113_218_24,
    -1.082_323_233_711_138_191_5,
    0.763_007_296_488_336_854_79,
    -0.334_692_452_065_981_446_46,
    0.100_099_457_512_781_808_53,
    -0.021_713_012_009_116_672_539,
    0.003_571_647_314_768_066_803,
    -0.000_460_794_066_104_234_011_55,
    0.000_047_872_159_398_086_408_91,
    -0.000_004_090_729_654_415_627_033_8,
    0.000_000_292_564_372_470_197_272_52,
    -0.000_000_017_769_197_650_054_187_018,
];
/// (−1)^(n+1)·(2π)^(2n+3)/((2n+3)!·16π³), n = 1 …: length gained, over x⁵.
const LENGTH: [f64; SERIES_TERMS_MAX] = [
    0.164_493_406_684_822_643_65,
    -0.154_617_604_815_876_884_5,
    0.084_778_588_498_704_094_976,
    -0.030_426_586_551_452_858_769,
    0.007_699_958_270_213_985_271_8,
    -0.001_447_534_133_941_111_502_6,
    0.000_210_096_900_868_709_811_94,
    -0.000_024_252_319_268_643_895_345,
    0.000_002_279_626_638_004_114_71,
    -0.000_000_177_857_811_061_549_001_47,
    0.000_000_011_702_574_897_880_789_09,
    -0.000_000_000_658_118_431_483_488_08,
];
/// Terms that f64 resolves up to x = 1/2: the first one left out is below 7·10⁻¹⁷ of the sum's
/// first.
const SERIES_TERMS_MAX: usize = 12;

impl<R: Real> Shape<R> {
    /// The shapes at `x` in \[0, 1\].
    #[inline]
    #[must_use]
    pub fn at(x: R) -> Self {
        use core::f64::consts::PI;
        let real = R::from_f64;
        let half = real(0.5);
        let mirrored = x > half;
        // Exact: 1 − x loses no digit for x above 1/2.
        let left = R::ONE - x;
        let z = if mirrored { left } else { x };
        let square = z * z;
        let cube = square * z;
        let length = series(&LENGTH, square) * (cube * square);
        let speed = series(&SPEED, square) * (square * square);
        let accel = cube * real(PI * PI / 3.0) - length * real(4.0 * PI * PI);
        let snap = z * real(2.0 * PI) - accel * real(4.0 * PI);
        let jerk = square * real(PI * PI) - speed * real(4.0 * PI * PI);
        if mirrored {
            // From x³ + z³ = 1 − 3xz and x² − z² = x − z.
            let length_sum = real(1.0 / 12.0 - 1.0 / (8.0 * PI * PI)) - real(0.25) * (x * z);
            Self {
                jerk,
                accel: half - accel,
                speed: half * (x - half) + speed,
                length: length_sum - length,
                snap: -snap,
            }
        } else {
            Self { jerk, accel, speed, length, snap }
        }
    }
}

#[inline]
fn series<R: Real>(coefficients: &[f64; SERIES_TERMS_MAX], square: R) -> R {
    let mut sum = R::ZERO;
    for &coefficient in coefficients.iter().take(R::SERIES_TERMS).rev() {
        sum = sum * square + R::from_f64(coefficient);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// f64 against the closed forms, which are good where they don't cancel.
    #[test]
    fn shapes_are_those_of_the_closed_forms() {
        use core::f64::consts::PI;
        let mut worst = [0.0_f64; 5];
        for i in 0..=1_000_000_u32 {
            let x = f64::from(i) / 1_000_000.0;
            let (sine, cosine) = f64::sin_cos_half_turn(x.min(1.0 - x));
            let double = 2.0 * sine * if x > 0.5 { -cosine } else { cosine };
            let shape = Shape::at(x);
            let pairs = [
                (shape.jerk, sine * sine),
                (shape.accel, x / 2.0 - double / (4.0 * PI)),
                (shape.speed, x * x / 4.0 - sine * sine / (4.0 * PI * PI)),
                (shape.length, x * x * x / 12.0 - x / (8.0 * PI * PI) + double / (16.0 * PI.powi(3))),
                (shape.snap, double),
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
}
