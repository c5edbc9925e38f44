//! The two float types.
//!
//! Roots come from `libm`: its square and cube roots are correctly rounded, and pure Rust.

use super::{Real, Root, Scalar, Unit};

macro_rules! float {
    ($float:ident, $sqrt:path, $cbrt:path, terms: $terms:literal, piece_mm: $piece:literal, ramp_mm: $ramp:literal, q32: $q32:path, fraction: |$f:ident| $fraction:expr) => {
        impl Scalar for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

            #[inline]
            #[allow(clippy::cast_possible_truncation)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            fn to_bits64(self) -> u64 {
                u64::from(self.to_bits())
            }
        }

        impl Unit for $float {
            const SERIES_TERMS: usize = $terms;

            #[inline]
            fn from_fraction($f: u64) -> Self {
                $fraction
            }
        }

        impl Real for $float {
            type Unit = Self;
            const EPSILON: f64 = $float::EPSILON as f64;
            const PIECE_MM_MAX: f64 = $piece;
            const RAMP_MM_MAX: f64 = $ramp;

            fn checked_from_f64(value: f64) -> Option<Self> {
                let narrow = Self::from_f64(value);
                narrow.is_finite().then_some(narrow)
            }

            #[inline]
            fn scaled(self, by: Self) -> Self {
                self * by
            }

            #[inline]
            fn to_unit(self) -> Self {
                self
            }

            #[inline]
            fn from_q32(bits: i64) -> Self {
                bits as Self * (1.0 / 4_294_967_296.0)
            }

            #[inline]
            fn to_q32(self) -> i64 {
                $q32(self)
            }

            #[inline]
            fn round_to_i16(self) -> i16 {
                (if self < 0.0 { self - 0.5 } else { self + 0.5 }) as i16
            }
        }

        impl Root for $float {
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }

            #[inline]
            fn cbrt(self) -> Self {
                $cbrt(self)
            }
        }
    };
}

// f32 keeps the top word only: one conversion instruction on a core with a single-precision FPU.
float!(f32, libm::sqrtf, libm::cbrtf, terms: 7, piece_mm: 16.0, ramp_mm: 16.0e3, q32: f32_to_q32,
    fraction: |fraction| (fraction >> 32) as u32 as Self * (1.0 / 4_294_967_296.0));
float!(f64, libm::sqrt, libm::cbrt, terms: 12, piece_mm: 1.0e6, ramp_mm: 1.0e9, q32: f64_to_q32,
    fraction: |fraction| (fraction >> 11) as Self * (1.0 / 9_007_199_254_740_992.0));

/// The same bits on every core, by what the core has one instruction for.
#[inline]
fn f32_to_q32(x: f32) -> i64 {
    if cfg!(target_pointer_width = "64") { (x * 4_294_967_296.0) as i64 } else { f32_to_q32_in_words(x) }
}

/// A 32-bit core converts f32 to i32 in one instruction and to i64 in a subroutine of sixty. Up to
/// 2¹⁵ (32 m) two of the first do the same: every step is exact, and all parts have the sign of `x`.
#[inline]
fn f32_to_q32_in_words(x: f32) -> i64 {
    let scaled = x * 65_536.0;
    if scaled.abs() < 2_147_483_648.0 {
        let upper = scaled as i32;
        let lower = ((scaled - upper as f32) * 65_536.0) as i32;
        (i64::from(upper) << 16).wrapping_add(i64::from(lower))
    } else {
        (scaled * 65_536.0) as i64
    }
}

#[inline]
fn f64_to_q32(x: f64) -> i64 {
    (x * 4_294_967_296.0) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every f32 whose bits are a multiple of an odd stride, so all exponents and both signs; the
    /// ends of the two ranges; and what is no number.
    #[test]
    fn f32_to_q32_in_words_is_the_plain_conversion() {
        let ends = [0.0, -0.0, 32_768.0, 32_767.998, 2_147_483_648.0, f32::MAX, f32::INFINITY, f32::NAN];
        let all = (0..=u32::MAX / 997).map(|i| f32::from_bits(i * 997));
        for x in all.chain(ends).chain(ends.map(|x| -x)) {
            assert_eq!(f32_to_q32_in_words(x), (x * 4_294_967_296.0) as i64, "{x:e}");
        }
    }
}
