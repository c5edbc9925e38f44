//! Sine and cosine of a fraction of a half turn, by one of three backends.
//!
//! A backend is a type without values; what computes with it takes it as a parameter, as
//! `Shape::closed` does.
//!
//! | backend | for | what it is |
//! |---|---|---|
//! | [`Own`] | f32, f64, `I3F29` | power series up to π/4 in the type's own arithmetic |
//! | [`Libm`] | f32, f64 | musl's functions, in pure Rust; its f32 computes in f64 |
//! | `Micromath` (feature `micromath`) | f32 | a parabola of a parabola, good to three digits |
//!
//! `tests/expected/functions.md` has the errors of each, and of the law's shapes evaluated with each. What
//! follows from it:
//!
//! - The tick's default is no sine at all, but the series of `Shape::at`. Whatever the sine, the closed forms
//!   lose acceleration, feed and length at a ramp's ends, where the series keep their relative precision. In
//!   absolute error the closed forms with [`Own`] are the better ones for jerk, acceleration and snap, most
//!   of all in fixed point.
//! - Where a sine is wanted, it is [`Own`]: as good as libm's, the only one in fixed point, exact at 0 and
//!   1/2, and its f32 needs no f64, which a single-precision FPU does not have.
//! - [`Libm`] is the independent implementation that [`Own`] is held against, and serves where a core has
//!   f64.
//! - `Micromath` is 10⁴ times worse than [`Own`] in f32: no part of a position. It would do for a jerk that
//!   is only fed forward, to a drive that is known to a percent.
//!
//! The argument counts half turns (x = θ/π), so that [`Own`] reduces it exactly: the octant comes from
//! comparing x with 1/4. It computes with y = 2x, so that all coefficients stay below 2. The series are cut
//! off where the first term left out is below half a unit in the last place:
//!
//! | type | sine to | omitted at π/4 | cosine to | omitted at π/4 |
//! |---|---|---|---|---|
//! | f32 | θ⁹ | 1.8·10⁻⁹ | θ¹⁰ | 1.1·10⁻¹⁰ |
//! | `I3F29` | θ¹¹ | 6.9·10⁻¹² | θ¹⁰ | 1.1·10⁻¹⁰ |
//! | f64 | θ¹⁵ | 4.6·10⁻¹⁷ | θ¹⁶ | 2.0·10⁻¹⁸ |
//!
//! What remains is rounding. The other two take θ = πx, rounded.

use fixed::types::I3F29;

use super::{Scalar, Unit, table};

/// Sine and cosine for the numbers `U`.
pub trait SineCosine<U: Unit> {
    /// What it is called in a table.
    const NAME: &'static str;
    /// Its largest absolute error.
    const ERROR: f64;

    /// (sin πx, cos πx) for `x` in \[0, 1/2\]; outside it means nothing, but does not fail.
    #[must_use]
    fn sin_cos(x: U) -> (U, U);
}

/// Power series in the type's own arithmetic.
#[derive(Clone, Copy, Debug)]
pub struct Own;

/// (−1)^k·(π/2)^(2k+1)/(2k+1)!, k = 0 …: sin(πy/2) over y.
const SINE: [f64; 8] = [
    core::f64::consts::FRAC_PI_2,
    -0.645_964_097_506_246_253_656,
    0.079_692_626_246_167_045_120_5,
    -0.004_681_754_135_318_688_100_69,
    0.000_160_441_184_787_359_821_873,
    -0.000_003_598_843_235_212_085_340_46,
    0.000_000_056_921_729_219_679_268_117_8,
    -0.000_000_000_668_803_510_981_146_723_248,
];
/// (−1)^k·(π/2)^(2k)/(2k)!, k = 0 …: cos(πy/2).
const COSINE: [f64; 9] = [
    1.0,
    -1.233_700_550_136_169_827_35,
    0.253_669_507_901_048_013_637,
    -0.020_863_480_763_352_960_873_1,
    0.000_919_260_274_839_426_580_242,
    -0.000_025_202_042_373_060_605_481_1,
    0.000_000_471_087_477_881_817_150_367,
    -0.000_000_006_386_603_083_791_852_241_09,
    0.000_000_000_065_659_631_149_794_723_622_1,
];

macro_rules! own {
    ($unit:ty, error: $error:expr, sine: $sine:literal, cosine: $cosine:literal, $table:path) => {
        impl SineCosine<$unit> for Own {
            const NAME: &'static str = "own";
            const ERROR: f64 = $error;

            #[inline]
            fn sin_cos(x: $unit) -> ($unit, $unit) {
                const SINES: [$unit; $sine] = $table(&SINE);
                const COSINES: [$unit; $cosine] = $table(&COSINE);
                let y = x + x;
                let beyond = y > <$unit>::from_f64(0.5);
                // Exact: 1 − y loses no digit for y above 1/2.
                let y = if beyond { <$unit as Scalar>::ONE - y } else { y };
                let square = y * y;
                let (sine, cosine) = (series(&SINES, square) * y, series(&COSINES, square));
                if beyond { (cosine, sine) } else { (sine, cosine) }
            }
        }
    };
}

own!(f32, error: 1.0e-7, sine: 5, cosine: 6, table::f32s);
own!(I3F29, error: 1.5 / STEPS, sine: 6, cosine: 6, table::fixed_points);
own!(f64, error: 2.3e-16, sine: 8, cosine: 9, table::f64s);

/// Steps of `I3F29` in one.
const STEPS: f64 = 536_870_912.0;

#[inline]
fn series<U: Unit, const N: usize>(coefficients: &[U; N], square: U) -> U {
    let mut sum = U::ZERO;
    for &coefficient in coefficients.iter().rev() {
        sum = sum * square + coefficient;
    }
    sum
}

/// `libm`'s.
#[derive(Clone, Copy, Debug)]
pub struct Libm;

impl SineCosine<f32> for Libm {
    const NAME: &'static str = "libm";
    const ERROR: f64 = 1.2e-7;

    #[inline]
    fn sin_cos(x: f32) -> (f32, f32) {
        libm::sincosf(x * core::f32::consts::PI)
    }
}

impl SineCosine<f64> for Libm {
    const NAME: &'static str = "libm";
    const ERROR: f64 = 2.3e-16;

    #[inline]
    fn sin_cos(x: f64) -> (f64, f64) {
        libm::sincos(x * core::f64::consts::PI)
    }
}

/// `micromath`'s.
#[cfg(feature = "micromath")]
#[derive(Clone, Copy, Debug)]
pub struct Micromath;

#[cfg(feature = "micromath")]
impl SineCosine<f32> for Micromath {
    const NAME: &'static str = "micromath";
    const ERROR: f64 = 1.1e-3;

    #[inline]
    fn sin_cos(x: f32) -> (f32, f32) {
        let (sine, cosine) = micromath::F32(x * core::f32::consts::PI).sin_cos();
        (sine.0, cosine.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// πx as a sum of two doubles, so that the argument's rounding (2⁻⁵³·θ) is put back to first order.
    fn oracle(x: f64) -> (f64, f64) {
        const PI_LOW: f64 = 1.224_646_799_147_353_2e-16;
        let high = x * core::f64::consts::PI;
        let low = x.mul_add(core::f64::consts::PI, -high) + x * PI_LOW;
        let (sine, cosine) = (libm::sin(high), libm::cos(high));
        (sine + cosine * low, cosine - sine * low)
    }

    fn worst<U: Unit>() -> f64
    where
        Own: SineCosine<U>,
    {
        let mut worst = 0.0_f64;
        for i in 0..=1_000_000_u32 {
            let x = U::from_f64(f64::from(i) / 2_000_000.0);
            let (sine, cosine) = Own::sin_cos(x);
            let (exact_sine, exact_cosine) = oracle(x.to_f64());
            worst = worst.max((sine.to_f64() - exact_sine).abs()).max((cosine.to_f64() - exact_cosine).abs());
        }
        println!("worst {worst:.3e}");
        worst
    }

    /// The own ones against `libm` in f64. (All of them are held against 31 digits in `tests/functions.rs`.)
    #[test]
    fn own_errors_are_as_stated() {
        assert!(worst::<f32>() <= <Own as SineCosine<f32>>::ERROR);
        assert!(worst::<I3F29>() <= <Own as SineCosine<I3F29>>::ERROR);
        // The oracle's own error included.
        assert!(worst::<f64>() <= <Own as SineCosine<f64>>::ERROR + 1.2e-16);
    }

    #[test]
    fn own_ends_are_exact() {
        fn check<U: Unit>()
        where
            Own: SineCosine<U>,
        {
            assert_eq!(Own::sin_cos(U::ZERO), (U::ZERO, U::ONE));
            assert_eq!(Own::sin_cos(U::from_f64(0.5)), (U::ONE, U::ZERO));
        }
        check::<f32>();
        check::<I3F29>();
        check::<f64>();
    }
}
