//! The law in normalised time, the same for every ramp.
//!
//! With x = t/t₁ in \[0, 1\] the rising phase of S1 (1)–(6) is
//!
//! | quantity | scale | shape |
//! |---|---|---|
//! | jerk | Jp | sin²πx |
//! | acceleration | Jp·t₁ | x/2 − sin πx·cos πx/(2π) |
//! | feed gained | Jp·t₁² | x²/4 − sin²πx/(4π²) |
//! | length gained | Jp·t₁³ | x³/12 − x/(8π²) + sin πx·cos πx/(8π³) |
//! | snap | π·Jp/t₁ | 2·sin πx·cos πx |
//!
//! The middle three are differences of nearly equal terms when x is small: in f32 the length has
//! lost every digit at x = 0.005. Below [`SERIES_BELOW`] they are summed as power series. The
//! falling phase is the rising one run backwards from the ramp's end, so both ends of a ramp have
//! the full relative precision.
//!
//! In the tick: about thirty multiplications, no division, no loop but the series' constant one.

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

/// Below this normalised time the shapes are power series.
pub const SERIES_BELOW: f64 = 0.125;

/// (−1)^(n+1)·(2π)^(2n+1)/((2n+1)!·4π), n = 1 ….
const ACCEL: [f64; 7] = [
    3.289_868_133_696_452_872_9,
    -6.493_939_402_266_829_149_1,
    6.104_058_371_906_694_838_3,
    -3.346_924_520_659_814_464_6,
    1.201_193_490_153_381_702_4,
    -0.303_982_168_127_633_415_55,
    0.057_146_357_036_289_068_847,
];
/// (−1)^(n+1)·(2π)^(2n+2)/((2n+2)!·8π²), n = 1 ….
const SPEED: [f64; 7] = [
    0.822_467_033_424_113_218_24,
    -1.082_323_233_711_138_191_5,
    0.763_007_296_488_336_854_79,
    -0.334_692_452_065_981_446_46,
    0.100_099_457_512_781_808_53,
    -0.021_713_012_009_116_672_539,
    0.003_571_647_314_768_066_803,
];
/// (−1)^(n+1)·(2π)^(2n+3)/((2n+3)!·16π³), n = 1 ….
const LENGTH: [f64; 7] = [
    0.164_493_406_684_822_643_65,
    -0.154_617_604_815_876_884_5,
    0.084_778_588_498_704_094_976,
    -0.030_426_586_551_452_858_769,
    0.007_699_958_270_213_985_271_8,
    -0.001_447_534_133_941_111_502_6,
    0.000_210_096_900_868_709_811_94,
];

impl<R: Real> Shape<R> {
    /// The shapes at `x` in \[0, 1\].
    #[inline]
    #[must_use]
    pub fn at(x: R) -> Self {
        use core::f64::consts::PI;
        let half = R::from_f64(0.5);
        let (sine, cosine) = if x > half {
            let (sine, cosine) = R::sin_cos_half_turn(R::ONE - x);
            (sine, -cosine)
        } else {
            R::sin_cos_half_turn(x)
        };
        let jerk = sine * sine;
        let product = sine * cosine;
        let square = x * x;
        let (accel, speed, length) = if x < R::from_f64(SERIES_BELOW) {
            let cube = square * x;
            (
                cube * series(&ACCEL, square),
                square * square * series(&SPEED, square),
                square * cube * series(&LENGTH, square),
            )
        } else {
            (
                half * x - product * R::from_f64(1.0 / (2.0 * PI)),
                R::from_f64(0.25) * square - jerk * R::from_f64(1.0 / (4.0 * PI * PI)),
                x * (square * R::from_f64(1.0 / 12.0) - R::from_f64(1.0 / (8.0 * PI * PI)))
                    + product * R::from_f64(1.0 / (8.0 * PI * PI * PI)),
            )
        };
        Self { jerk, accel, speed, length, snap: product + product }
    }
}

#[inline]
fn series<R: Real>(coefficients: &[f64; 7], square: R) -> R {
    let mut sum = R::ZERO;
    for &coefficient in coefficients.iter().take(R::SERIES_TERMS).rev() {
        sum = sum * square + R::from_f64(coefficient);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both forms must meet where one takes over from the other, and end where S1 (7)–(9) say.
    #[test]
    fn forms_meet_and_end_where_the_paper_says() {
        let (below, above) = (Shape::at(SERIES_BELOW.next_down()), Shape::at(SERIES_BELOW));
        for (b, a, tolerance) in [
            (below.accel, above.accel, 3e-15),
            (below.speed, above.speed, 3e-14),
            (below.length, above.length, 1e-13),
        ] {
            assert!((b - a).abs() <= tolerance * a, "{b:e} {a:e}");
        }
        let end = Shape::at(1.0_f64);
        assert!((end.accel - 0.5).abs() < 1e-16 && (end.speed - 0.25).abs() < 1e-16);
        let length = 1.0 / 12.0 - 1.0 / (8.0 * core::f64::consts::PI.powi(2));
        assert!((end.length - length).abs() < 1e-16);
        assert_eq!((end.jerk, end.snap), (0.0, 0.0));
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
        println!("f32 relative error, acceleration, speed, length: {worst:.2?}");
        assert!(worst[0] < 2e-6 && worst[1] < 6e-6 && worst[2] < 6e-5, "{worst:?}");
    }
}
