//! Fixed point, for cores without an FPU.
//!
//! Formats, by derivation:
//!
//! | type | format | range | step | what it holds |
//! |---|---|---|---|---|
//! | `I3F29` (`Unit`) | 3.29 in 32 bits | ±4 | 1.9·10⁻⁹ | normalised time, shapes (≤ 1), directions (≤ 1), series coefficients (≤ 3.2) |
//! | [`Fixed`] (`Real`) | 32.32 in 64 bits | ±2.1·10⁹ | 2.3·10⁻¹⁰ | mm, mm/s, mm/s², mm/s³, mm/s⁴, gains |
//!
//! The widest quantity is snap: 2·10⁹ mm/s⁴ is a rise of 1 µs at 700 mm/s³. The smallest step matters
//! for offsets and velocities: 0.23 pm, and 0.23 nm/s. A length times a normalised quantity is good to
//! length·2⁻³⁰: 15 nm·10⁻³ over a piece of 16 mm, a sixtieth of a 0.1 µm count over the metre that a
//! long ramp adds.
//!
//! A product of two `Unit`s is one 32×32→64-bit multiplication; of a [`Fixed`] and a `Unit` two; of
//! two [`Fixed`] four, of which the tick has a few dozen: the chain rule's and the regulator's.
//!
//! Products are rounded down. Sums and products of accepted input can't overflow: items are checked
//! for it when they are made ([`FeedSegment`](crate::law::FeedSegment), [`Piece`](crate::path::Piece)).

use core::ops::{Add, Div, Mul, Neg, Sub};

use fixed::types::{I3F29, I32F32};

use super::{Real, Root, Scalar, Unit};

/// A quantity in steps of 2⁻³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(I32F32);

impl Fixed {
    /// Steps of 2⁻³².
    #[must_use]
    pub const fn from_bits(bits: i64) -> Self {
        Self(I32F32::from_bits(bits))
    }

    /// Steps of 2⁻³².
    #[must_use]
    pub const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }
}

/// a·b/2³² of signed 32.32 numbers, rounded down, from four 32×32→64-bit products. The generic 128-bit
/// product of the compiler is a subroutine several times as long on a 32-bit core.
#[inline]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const fn multiply(a: i64, b: i64) -> i64 {
    let (a_high, a_low) = (a >> 32, a as u32 as u64);
    let (b_high, b_low) = (b >> 32, b as u32 as u64);
    let low = (a_low * b_low) >> 32;
    let cross = a_high.wrapping_mul(b_low as i64).wrapping_add(b_high.wrapping_mul(a_low as i64));
    (a_high.wrapping_mul(b_high) << 32).wrapping_add(cross).wrapping_add(low as i64)
}

/// a·b/2²⁹ of a 32.32 and a 3.29 number, rounded down, from two 32×32→64-bit products.
#[inline]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const fn multiply_unit(a: i64, b: i32) -> i64 {
    let (high, low, b) = (a >> 32, a as u32 as i64, b as i64);
    (high.wrapping_mul(b) << 3).wrapping_add(low.wrapping_mul(b) >> 29)
}

impl Add for Fixed {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl Sub for Fixed {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

impl Neg for Fixed {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}

impl Mul for Fixed {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::from_bits(multiply(self.to_bits(), other.to_bits()))
    }
}

impl Div for Fixed {
    type Output = Self;
    /// Rounded towards zero; saturates, also for a divisor of 0. Background only.
    fn div(self, other: Self) -> Self {
        match self.0.checked_div(other.0) {
            Some(quotient) => Self(quotient),
            None if (self.to_bits() < 0) == (other.to_bits() < 0) => Self(I32F32::MAX),
            None => Self(I32F32::MIN),
        }
    }
}

impl Scalar for Fixed {
    const ZERO: Self = Self(I32F32::ZERO);
    const ONE: Self = Self(I32F32::ONE);

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn from_f64(value: f64) -> Self {
        Self::from_bits((value * 4_294_967_296.0 + if value < 0.0 { -0.5 } else { 0.5 }) as i64)
    }

    fn to_f64(self) -> f64 {
        self.0.to_num()
    }

    fn to_bits64(self) -> u64 {
        self.to_bits().cast_unsigned()
    }
}

impl Real for Fixed {
    type Unit = I3F29;
    const EPSILON: f64 = 1.0 / 4_294_967_296.0;
    const PIECE_MM_MAX: f64 = 16.0;
    const RAMP_MM_MAX: f64 = 90.0e3;

    fn checked_from_f64(value: f64) -> Option<Self> {
        (libm::fabs(value) < 2_147_483_648.0).then(|| Self::from_f64(value))
    }

    #[inline]
    fn scaled(self, by: I3F29) -> Self {
        Self::from_bits(multiply_unit(self.to_bits(), by.to_bits()))
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn to_unit(self) -> I3F29 {
        I3F29::from_bits((self.to_bits() >> 3) as i32)
    }

    #[inline]
    fn from_q32(bits: i64) -> Self {
        Self::from_bits(bits)
    }

    #[inline]
    fn to_q32(self) -> i64 {
        self.to_bits()
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn round_to_i16(self) -> i16 {
        // Halves away from zero: of the magnitude, then with its sign.
        let bits = self.to_bits();
        let magnitude = (bits.unsigned_abs().saturating_add(1 << 31)) >> 32;
        if bits < 0 { -(magnitude.min(32_768) as i32) as i16 } else { magnitude.min(32_767) as i16 }
    }
}

impl Root for Fixed {
    /// Rounded down; 0 for what is below it.
    fn sqrt(self) -> Self {
        let square = u128::from(self.to_bits().max(0).unsigned_abs()) << 32;
        Self::from_bits(integer_root::<2>(square))
    }

    /// Rounded towards zero.
    fn cbrt(self) -> Self {
        let cube = u128::from(self.to_bits().unsigned_abs()) << 64;
        let root = integer_root::<3>(cube);
        Self::from_bits(if self.to_bits() < 0 { -root } else { root })
    }
}

/// The greatest integer whose `N`-th power is at most `value`, bit by bit; `N` is 2 or 3 and `value`
/// below 2¹²⁷, so the root is below 2⁶⁴⸍… and its powers fit.
fn integer_root<const N: u32>(value: u128) -> i64 {
    let mut root: u64 = 0;
    // The highest bit the root can have: 48 of a square root of 2⁹⁵, 43 of a cube root of 2¹²⁷.
    let mut bit: u64 = 1 << if N == 2 { 47 } else { 42 };
    while bit > 0 {
        let candidate = root | bit;
        let wide = u128::from(candidate);
        let power = if N == 2 { wide * wide } else { wide * wide * wide };
        if power <= value {
            root = candidate;
        }
        bit >>= 1;
    }
    root.cast_signed()
}

impl Scalar for I3F29 {
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::ONE;

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn from_f64(value: f64) -> Self {
        Self::from_bits((value * 536_870_912.0 + if value < 0.0 { -0.5 } else { 0.5 }) as i32)
    }

    fn to_f64(self) -> f64 {
        self.to_num()
    }

    fn to_bits64(self) -> u64 {
        u64::from(self.to_bits().cast_unsigned())
    }
}

impl Unit for I3F29 {
    const SERIES_TERMS: usize = 8;

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn from_fraction(fraction: u64) -> Self {
        Self::from_bits((fraction >> 35) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> u64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *state ^ (*state >> 29)
    }

    /// Against the exact product in 128 bits, rounded down, for every product that fits.
    #[test]
    fn products_are_the_exact_ones_rounded_down() {
        let mut state = 3;
        let mut fitting = 0;
        for _ in 0..1_000_000 {
            let a = random(&mut state).cast_signed() >> (random(&mut state) % 64);
            let b = random(&mut state).cast_signed() >> (random(&mut state) % 64);
            let exact = (i128::from(a) * i128::from(b)) >> 32;
            if let Ok(exact) = i64::try_from(exact) {
                fitting += 1;
                assert_eq!(multiply(a, b), exact, "{a} {b}");
            }
            let unit = b as i32;
            let exact = (i128::from(a) * i128::from(unit)) >> 29;
            if let Ok(exact) = i64::try_from(exact) {
                assert_eq!(multiply_unit(a, unit), exact, "{a} {unit}");
            }
        }
        assert!(fitting > 400_000, "{fitting}");
    }

    #[test]
    fn roots_are_the_greatest_below() {
        let mut state = 5;
        for _ in 0..20_000 {
            let bits = (random(&mut state) >> 1 >> (random(&mut state) % 60)).cast_signed();
            let value = Fixed::from_bits(bits);
            let root = u128::from(value.sqrt().to_bits().unsigned_abs());
            let square = u128::from(bits.unsigned_abs()) << 32;
            assert!(root * root <= square && (root + 1) * (root + 1) > square, "{bits}");
            let root = u128::from(value.cbrt().to_bits().unsigned_abs());
            let cube = u128::from(bits.unsigned_abs()) << 64;
            assert!(root * root * root <= cube && (root + 1).pow(3) > cube, "{bits}");
            assert_eq!((-value).cbrt(), -value.cbrt());
        }
    }

    #[test]
    fn conversions_saturate_and_round() {
        assert_eq!(Fixed::from_f64(1e30).to_bits(), i64::MAX);
        assert_eq!(Fixed::from_f64(f64::NAN), Fixed::ZERO);
        assert_eq!(Fixed::checked_from_f64(f64::NAN), None);
        assert_eq!(Fixed::checked_from_f64(-2.2e9), None);
        for (value, expected) in
            [(0.5, 1), (-0.5, -1), (0.49, 0), (32_767.6, 32_767), (-32_768.4, -32_768), (-4e5, -32_768)]
        {
            assert_eq!(Fixed::from_f64(value).round_to_i16(), expected, "{value}");
        }
        assert_eq!(Fixed::ONE / Fixed::ZERO, Fixed(I32F32::MAX));
        assert_eq!((-Fixed::ONE / Fixed::ZERO), Fixed(I32F32::MIN));
    }
}
