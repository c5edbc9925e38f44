//! [`Real`] and [`Root`] of the two float types.
//!
//! Roots come from `libm`: its square and cube roots are correctly rounded, and pure Rust.

use super::sine;
use super::{Real, Root};

macro_rules! float {
    ($float:ident, $sine:path, $sqrt:path, $cbrt:path, terms: $terms:literal, piece_mm: $piece:literal, fraction: |$f:ident| $fraction:expr) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: f64 = $float::EPSILON as f64;
            const SERIES_TERMS: usize = $terms;
            const PIECE_MM_MAX: f64 = $piece;

            #[inline]
            #[allow(clippy::cast_possible_truncation)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline]
            fn from_fraction($f: u64) -> Self {
                $fraction
            }

            #[inline]
            fn from_q32(bits: i64) -> Self {
                bits as Self * (1.0 / 4_294_967_296.0)
            }

            #[inline]
            fn to_q32(self) -> i64 {
                (self * 4_294_967_296.0) as i64
            }

            #[inline]
            fn round_to_i16(self) -> i16 {
                (if self < 0.0 { self - 0.5 } else { self + 0.5 }) as i16
            }

            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }

            #[inline]
            fn sin_cos_half_turn(x: Self) -> (Self, Self) {
                $sine(x)
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
float!(f32, sine::sin_cos_f32, libm::sqrtf, libm::cbrtf, terms: 4, piece_mm: 16.0,
    fraction: |fraction| (fraction >> 32) as u32 as Self * (1.0 / 4_294_967_296.0));
float!(f64, sine::sin_cos_f64, libm::sqrt, libm::cbrt, terms: 7, piece_mm: 1.0e6,
    fraction: |fraction| (fraction >> 11) as Self * (1.0 / 9_007_199_254_740_992.0));
