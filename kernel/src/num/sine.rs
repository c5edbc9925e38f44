//! Sine and cosine of a fraction of a half turn, in pure f32 and pure f64.
//!
//! The argument counts half turns (x = θ/π), so the reduction is exact: the octant comes from
//! comparing x with 1/4. Up to θ = π/4 the power series is cut off where the first omitted term is
//! below half a unit in the last place:
//!
//! | type | sine to | omitted at π/4 | cosine to | omitted at π/4 |
//! |---|---|---|---|---|
//! | f32 | θ⁹ | 1.8·10⁻⁹ | θ¹⁰ | 1.1·10⁻¹⁰ |
//! | f64 | θ¹⁵ | 4.6·10⁻¹⁷ | θ¹⁶ | 2.0·10⁻¹⁸ |
//!
//! What remains is rounding. `libm::sinf` computes in f64, which a single-precision FPU emulates at
//! more than a thousand instructions; this needs about twenty multiplications.

/// Largest absolute error of [`sin_cos_f32`].
pub const SINE_ERROR_F32: f64 = 1.2e-7;
/// Largest absolute error of [`sin_cos_f64`].
pub const SINE_ERROR_F64: f64 = 2.3e-16;

// (−1)^k π^(2k+1)/(2k+1)! and (−1)^k π^(2k)/(2k)!
const SINE: [f64; 8] = [
    core::f64::consts::PI,
    -5.167_712_780_049_970_029_2,
    2.550_164_039_877_345_443_9,
    -0.599_264_529_320_792_076_89,
    0.082_145_886_611_128_228_799,
    -0.007_370_430_945_714_350_777_3,
    0.000_466_302_805_767_612_564_42,
    -0.000_021_915_353_447_830_215_827,
];
const COSINE: [f64; 9] = [
    1.0,
    -4.934_802_200_544_679_309_4,
    4.058_712_126_416_768_218_2,
    -1.335_262_768_854_589_495_9,
    0.235_330_630_358_893_204_54,
    -0.025_806_891_390_014_060_013,
    0.001_929_574_309_403_923_047_9,
    -0.000_104_638_104_924_845_707_12,
    0.000_004_303_069_587_032_947_007_3,
];

macro_rules! sin_cos {
    ($name:ident, $float:ident, $sine_terms:literal, $cosine_terms:literal) => {
        #[inline]
        #[allow(clippy::cast_possible_truncation)]
        /// (sin πx, cos πx) for `x` in \[0, 1/2\], in the type's own arithmetic.
        #[must_use]
        pub fn $name(x: $float) -> ($float, $float) {
            let beyond = x > 0.25;
            let x = if beyond { 0.5 - x } else { x };
            let square = x * x;
            let mut sine: $float = 0.0;
            for &term in SINE[..$sine_terms].iter().rev() {
                sine = sine * square + term as $float;
            }
            sine *= x;
            let mut cosine: $float = 0.0;
            for &term in COSINE[..$cosine_terms].iter().rev() {
                cosine = cosine * square + term as $float;
            }
            if beyond { (cosine, sine) } else { (sine, cosine) }
        }
    };
}

sin_cos!(sin_cos_f32, f32, 5, 6);
sin_cos!(sin_cos_f64, f64, 8, 9);

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the duplication formulas from a series at θ/64, in f64 for f32 and with a
    /// compensated argument for f64 (`libm` on the half of the range where its argument is exact).
    #[test]
    fn stated_error_holds() {
        let (mut worst_f32, mut worst_f64) = (0.0_f64, 0.0_f64);
        for i in 0..=1_000_000_u32 {
            let x = f64::from(i) / 2_000_000.0;
            let (sine, cosine) = sin_cos_f64(x);
            let (exact_sine, exact_cosine) = oracle(x);
            worst_f64 = worst_f64.max((sine - exact_sine).abs()).max((cosine - exact_cosine).abs());
            let narrow = x as f32;
            let (sine, cosine) = sin_cos_f32(narrow);
            let (exact_sine, exact_cosine) = oracle(f64::from(narrow));
            worst_f32 = worst_f32
                .max((f64::from(sine) - exact_sine).abs())
                .max((f64::from(cosine) - exact_cosine).abs());
        }
        println!("sine error f32 {worst_f32:.3e} f64 {worst_f64:.3e}");
        assert!(worst_f32 <= SINE_ERROR_F32, "{worst_f32:e}");
        assert!(worst_f64 <= SINE_ERROR_F64 + 1.2e-16, "{worst_f64:e}, oracle's own error included");
    }

    /// πx as a sum of two doubles, so that the argument's rounding (2⁻⁵³·θ) is put back to first order.
    fn oracle(x: f64) -> (f64, f64) {
        const PI_LOW: f64 = 1.224_646_799_147_353_2e-16;
        let high = x * core::f64::consts::PI;
        let low = x.mul_add(core::f64::consts::PI, -high) + x * PI_LOW;
        let (sine, cosine) = (libm::sin(high), libm::cos(high));
        (sine + cosine * low, cosine - sine * low)
    }

    #[test]
    fn ends_are_exact() {
        assert_eq!(sin_cos_f32(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_f32(0.5), (1.0, 0.0));
        assert_eq!(sin_cos_f64(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_f64(0.5), (1.0, 0.0));
    }
}
