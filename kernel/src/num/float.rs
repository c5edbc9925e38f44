//! The two float types.
//!
//! Square roots come from `libm`: correctly rounded, and pure Rust.

use super::cube_root::{cbrt, cbrtf};
use super::{Real, Root, Scalar, Unit};

macro_rules! float {
    ($float:ident, $sqrt:path, $cbrt:ident, $half:path, terms: $terms:literal, piece_mm: $piece:literal, ramp_mm: $ramp:literal, q32: $from_q32:path, $q32:path, fraction: |$f:ident| $fraction:expr) => {
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

            #[inline]
            fn abs(self) -> Self {
                <$float>::abs(self)
            }
        }

        impl Unit for $float {
            const SERIES_TERMS: usize = $terms;
            const LIMIT: f64 = f64::INFINITY;

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
            const SETPOINT_MAX: Option<[f64; 3]> = None;

            // Configuration asks for it in many places.
            #[inline(never)]
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
                $from_q32(bits)
            }

            #[inline]
            fn to_q32(self) -> i64 {
                $q32(self)
            }

            #[inline]
            fn round_to_i16(self) -> i16 {
                // Two saturations, each of them one instruction where it matters.
                let nearest = (self + (0.5 as Self).copysign(self)) as i32;
                nearest.clamp(i16::MIN.into(), i16::MAX.into()) as i16
            }
        }

        impl Root for $float {
            const LIMITS: (f64, f64) = (0.0, f64::INFINITY);
            const FEEDS_MM_S: (f64, f64) = (0.0, f64::INFINITY);
            const LENGTH_MIN_MM: f64 = 0.0;

            #[inline]
            fn rounded_up(self) -> Self {
                self
            }

            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }

            #[inline]
            fn cbrt(self) -> Self {
                $cbrt(self)
            }

            #[inline]
            fn cbrt_quotient(self, per: Self) -> Self {
                $cbrt(self / per)
            }

            #[inline]
            fn half(self) -> Self {
                $half(self)
            }

            #[inline]
            fn half_product(self, by: Self) -> Self {
                $half(self * by)
            }

            #[inline]
            fn times_per(self, by: Self, per: Self) -> Self {
                self * by / per
            }

            #[inline]
            fn sqrt_product(self, other: Self) -> Self {
                $sqrt(self * other)
            }

            #[inline]
            fn root_of_squares(self, other: Self) -> Self {
                $sqrt(self * self + other * other)
            }

            #[inline]
            fn root_of_square_and_quotient(self, of: Self, per: Self) -> Self {
                $sqrt(self * self + of / per)
            }

            #[inline]
            fn spacing(self) -> Self {
                self.abs() * $float::EPSILON
            }
        }
    };
}

// f32 keeps the top word only: one conversion instruction on a core with a single-precision FPU.
float!(f32, libm::sqrtf, cbrtf, half_f32, terms: 7, piece_mm: 16.0, ramp_mm: 16.0e3, q32: f32_from_q32, f32_to_q32,
    fraction: |fraction| (fraction >> 32) as u32 as Self * (1.0 / 4_294_967_296.0));
float!(f64, libm::sqrt, cbrt, half_f64, terms: 12, piece_mm: 1.0e6, ramp_mm: 1.0e9, q32: f64_from_q32, f64_to_q32,
    fraction: |fraction| (fraction >> 11) as Self * (1.0 / 9_007_199_254_740_992.0));

#[inline]
fn half_f32(x: f32) -> f32 {
    x * 0.5
}

/// A product is a subroutine on a core without f64, and a halved exponent is not. Told by the width of pointers: of
/// cores of 32 bits few have f64, and lose little by it.
#[inline]
fn half_f64(x: f64) -> f64 {
    if cfg!(target_pointer_width = "32") { half_by_exponent(x) } else { x * 0.5 }
}

#[inline(never)]
fn half_by_exponent(x: f64) -> f64 {
    /// One, as an exponent in its place.
    const ONE: u64 = 1 << (f64::MANTISSA_DIGITS - 1);
    let exponent = x.to_bits() & f64::INFINITY.to_bits();
    let is_halved = exponent > ONE && exponent < f64::INFINITY.to_bits();
    if is_halved { f64::from_bits(x.to_bits() - ONE) } else { half_by_product(x) }
}

/// Of 0, of what is subnormal or becomes it, and of what is not finite.
// A call of its own: a product in place would be made in any case, and then chosen.
#[cold]
#[inline(never)]
fn half_by_product(x: f64) -> f64 {
    x * 0.5
}

/// Whether `x` is a number, and not infinite. By its bits: the library's becomes a hundred bytes wherever it
/// is asked on a core without f64.
pub(crate) fn is_finite(x: f64) -> bool {
    x.to_bits() << 1 < f64::INFINITY.to_bits() << 1
}

/// Whether `x` is a number from `least` to `most`. By their bits, as numbers are ordered: a comparison is a
/// subroutine on a core without f64.
#[inline(never)]
pub(crate) fn is_within(x: f64, least: f64, most: f64) -> bool {
    let order = |x: f64| {
        let magnitude = (x.to_bits() << 1 >> 1).cast_signed();
        if x.is_sign_negative() { -magnitude } else { magnitude }
    };
    (order(least)..=order(most)).contains(&order(x))
}

/// 2³², as what it adds to an exponent in its place.
const Q32: u64 = 32 << (f64::MANTISSA_DIGITS - 1);

/// A quantity in steps of 2⁻³², not rounded; for 0 and what is not too great for that. By its exponent, because a
/// product is a subroutine on a core without f64.
pub(crate) fn in_q32(x: f64) -> f64 {
    let bits = x.to_bits();
    f64::from_bits(if bits << 1 == 0 { bits } else { bits.wrapping_add(Q32) })
}

/// The quantity that is `steps` of 2⁻³²; for 0 and what is not too small for that.
pub(crate) fn of_q32(steps: f64) -> f64 {
    let bits = steps.to_bits();
    f64::from_bits(if bits << 1 == 0 { bits } else { bits.wrapping_sub(Q32) })
}

/// `x` without its fraction, for 0 ≤ x < 2⁶⁴; of anything else some number. The language's casts of f64
/// saturate, which takes a core without f64 four comparisons in software wherever one is.
#[inline(never)]
pub(crate) fn whole(x: f64) -> u64 {
    const FRACTION_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    let bits = x.to_bits();
    let last = 1 << FRACTION_BITS;
    let digits = bits & (last - 1) | last;
    // The exponent of the last digit, with the same bias as that of the first.
    let exponent = (bits >> FRACTION_BITS) as u32;
    let unit = 1023 + FRACTION_BITS;
    if exponent < unit {
        digits.checked_shr(unit - exponent).unwrap_or(0)
    } else {
        digits.wrapping_shl(exponent - unit)
    }
}

/// A 32-bit core converts i32 to f32 in one instruction and i64 in a subroutine of fifty, so every core goes
/// by halves. The lower half is taken with its sign: a small value is all in it, and is rounded once; a
/// larger one is off by 2⁻²⁶ mm before its own rounding.
#[inline]
#[allow(clippy::cast_possible_truncation)]
fn f32_from_q32(bits: i64) -> f32 {
    let lower = bits as i32;
    let upper = (bits.wrapping_sub(i64::from(lower)) >> 32) as i32;
    upper as f32 + lower as f32 * (1.0 / 4_294_967_296.0)
}

#[inline]
fn f64_from_q32(bits: i64) -> f64 {
    bits as f64 * (1.0 / 4_294_967_296.0)
}

/// The other way likewise, in whole millimetres and what is left: both conversions are one instruction on a
/// 32-bit core, and both steps between them are exact. Truncated to steps of 2⁻³¹.
#[inline]
#[allow(clippy::cast_possible_truncation)]
fn f32_to_q32(x: f32) -> i64 {
    let upper = x as i32;
    let lower = ((x - upper as f32) * 2_147_483_648.0) as i32;
    (i64::from(upper) << 32).wrapping_add(i64::from(lower) << 1)
}

#[inline]
fn f64_to_q32(x: f64) -> i64 {
    (x * 4_294_967_296.0) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Positions of all sizes and signs: rounded once below half a millimetre, within one last place above
    /// it.
    #[test]
    fn f32_from_q32_is_the_plain_conversion_to_a_last_place() {
        let random = Random::new(1);
        for _ in 0..10_000_000 {
            let bits = random.of_any_size();
            let (found, plain) = (f32_from_q32(bits), bits as f32 * (1.0 / 4_294_967_296.0));
            if i32::try_from(bits).is_ok() {
                assert_eq!(found.to_bits(), plain.to_bits(), "{bits}");
            } else {
                assert!((found - plain).abs() <= plain.abs() * f32::EPSILON, "{bits}: {found} {plain}");
            }
        }
    }

    /// Every f32 whose bits are a multiple of an odd stride, so all exponents and both signs, as far as
    /// positions go; the ends of the range; and what is no number.
    #[test]
    fn f32_to_q32_truncates_to_two_steps() {
        let ends = [0.0, 1.0, 32_768.0, 32_767.998, 2_147_483_500.0];
        let all = (0..=u32::MAX / 997).map(|i| f32::from_bits(i * 997));
        for x in all.chain(ends).chain(ends.map(|x| -x)).filter(|x| x.abs() < 2_147_483_648.0) {
            assert_eq!(f32_to_q32(x), (x * 2_147_483_648.0) as i64 * 2, "{x:e}");
        }
        assert_eq!(f32_to_q32(f32::NAN), 0);
    }

    /// Against products, over all exponents and both signs.
    #[test]
    fn halves_are_products() {
        let random = Random::new(4);
        let ends = [0.0, -0.0, f64::INFINITY, f64::MIN_POSITIVE, 2.0 * f64::MIN_POSITIVE, f64::MAX];
        let all = (0..1_000_000).map(|_| f64::from_bits(random.next())).filter(|x| !x.is_nan());
        for x in all.chain(ends) {
            assert_eq!(half_by_exponent(x).to_bits(), (x * 0.5).to_bits(), "{x:e}");
        }
        assert!(half_by_exponent(f64::NAN).is_nan());
    }

    /// Against products.
    #[test]
    fn scaled_numbers_are_products() {
        let random = Random::new(6);
        for x in (0..100_000).map(|_| random.log(1e-140, 1e140)).chain([0.0, 1.0]) {
            assert_eq!(in_q32(x), x * 4_294_967_296.0, "{x:e}");
            assert_eq!(in_q32(-x).to_bits(), (-x * 4_294_967_296.0).to_bits(), "{x:e}");
            assert_eq!(of_q32(in_q32(-x)).to_bits(), (-x).to_bits(), "{x:e}");
        }
    }

    /// Against the language's own, over all exponents and both signs.
    #[test]
    fn whole_and_finite_are_the_languages() {
        let random = Random::new(3);
        for _ in 0..1_000_000 {
            let any = f64::from_bits(random.next());
            assert_eq!(is_finite(any), any.is_finite(), "{any:e}");
            assert_eq!(is_within(any, -1e3, 1e9), (-1e3..=1e9).contains(&any), "{any:e}");
            // Exponents from 2⁻¹¹ to 2⁶³.
            let exponent = 1012 + random.below(75);
            let x = f64::from_bits(exponent << 52 | random.next() >> 12);
            assert_eq!(whole(x), x as u64, "{x:e}");
        }
        for x in
            [0.0, f64::MIN_POSITIVE, 1.0, 1.0_f64.next_down(), 4_294_967_296.0, 9_223_372_036_854_775_808.0]
        {
            assert_eq!(whole(x), x as u64, "{x:e}");
        }
        for x in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX, f64::MIN, 0.0, -0.0] {
            assert_eq!(is_finite(x), x.is_finite(), "{x:e}");
            assert_eq!(is_within(x, 0.0, f64::MAX), x >= 0.0 && x.is_finite(), "{x:e}");
            assert_eq!(is_within(x, -0.0, f64::MAX), x >= 0.0 && x.is_finite(), "{x:e}");
            assert_eq!(is_within(x, f64::NEG_INFINITY, -1.0), x <= -1.0, "{x:e}");
        }
    }
}
