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
//! Products are rounded down. Sums and products of accepted input don't overflow, because of what is refused
//! before:
//!
//! | what | where | how |
//! |---|---|---|
//! | scales of a ramp | [`FeedSegment`](crate::law::FeedSegment), when it is made | each fits, and sums of them stay between its feeds |
//! | a septic's sums | [`Piece::septic`](crate::path::Piece::septic) | Σ k(k−1)(k−2)·\|qₖ\| and its like below 4 |
//! | set-points and what leads to them | [`Feeder`](crate::queue::Feeder), where piece and feed meet | the chain rule with greatest values, at most [`Real::SETPOINT_MAX`] |
//! | feedforward | [`AxesConfig`](crate::axis::AxesConfig) | gains times [`Real::SETPOINT_MAX`] within an eighth of the range |
//! | tables of feedforward | [`AxesConfig`](crate::axis::AxesConfig) | what is looked up is at most 10⁹ + 2·10⁹ times a tick of 0.02 s, is cut at the reach, and brought below 1 by a power of two, then to ±4 points; a table gives at most 2¹⁵ steps of 10 mm/s |
//! | feedback | [`AxesConfig`](crate::axis::AxesConfig) | gains times the following-error limit within an eighth; beyond the limit the axis is lost and no gain is applied |
//!
//! They wrap if they do; in a build with debug assertions that is found.
//!
//! # Planning
//!
//! Plans ([`Law`](crate::law::Law), [`reach`](crate::law::reach()), [`plan`](crate::plan::plan()),
//! [`Ceiling`](crate::plan::Ceiling), [`junction`](crate::plan::junction())) run in 32.32 too. What is
//! accepted is bounded so that everything made of it fits; the bounds are [`Root::LIMITS`],
//! [`Root::FEEDS_MM_S`], [`Root::LENGTH_MIN_MM`] and
//! [`Position::LIMIT_MM`](crate::units::Position::LIMIT_MM). The step is 2⁻³² throughout, s below.
//!
//! | quantity | accepted or at most | why it fits, and what its step is worth |
//! |---|---|---|
//! | A, J, DJ: limits | 1 … 10⁹ | twice the greatest fits; s is 2.3·10⁻¹⁰ of the least |
//! | v: ceilings, feeds | 10⁻³ … 10⁶ mm/s, or 0 | below, a ramp from rest is shorter than s |
//! | L: lengths | 10⁻⁶ … 10⁶ mm, or 0 | s is a part of 2.3·10⁻⁴ of the shortest, and exactly a position step |
//! | J' = min(J, √(A·DJ·2/π)) | 8·10⁸ | root of the whole product; rounded down |
//! | 2e' = πJ'/DJ, 2A/J' | 8·10⁴ s, 2·10⁹ s | quotients of whole products; the first from 13 s up, the second from 8·10⁻⁵ s up |
//! | A/J' + e' | 10⁹ s | where A/J' is greatest, J' is 1 and e' no longer than that |
//! | J'·(P − e')·P, and x₁ of it, P = 2e' | A, then saturates | J' × (P − e') ≤ A + 8·J'·s, because P is at most A/J' + e' + 8 s |
//! | x₂ = 2A²/J', A·(A/J' + e') | saturates | beyond 2³¹ mm/s acceleration never fixes a ramp |
//! | √(J'/2), (DJ/2π)^⅓ | 0.5 … 2.3·10⁴ | divisors of roots: the error of a time is at most 3 s |
//! | √(x/J' + e'²/4) with a plateau | 2.1·10⁴ s | of whole squares: √x/√J' ≤ 7·10³ s, e'/2 ≤ 2·10⁴ s |
//! | times of ramps | 10⁸ s | from √x/√(J'/2), x^⅓/(DJ/2π)^⅓, x/A; up to 8 s (1.9 ns) too long, never too short |
//! | length of a ramp | saturates | (F₀ + F)·t/2 of the whole product, to the nearest s; saturated is longer than any block |
//! | sums of two such | – | never taken: a length less one of them is compared with the other |
//! | Newton: k·L/w, x + 2F | saturates, 4·10⁷ mm/s | the equation divided by w, so that no w³ or w⁴ is taken |
//! | the same for P: L/P, 3x + 2F + e'J'·P | saturates, 6·10⁷ mm/s | P ≤ (2L/J')^⅓ makes x ≤ J'·P² ≤ (2L)^⅔·J'^⅓ = 1.5·10⁷; e'J' ≤ A, and e'J'·P is no more than x |
//! | slope by y: 2·3y²/J'/(2P − e) | saturates | y³ is a change of feed, so y² ≤ 1.2·10⁵ |
//! | √((F − a)² + 2AL) | 4·10⁷ mm/s | of whole squares, √(2AL) of a whole product |
//! | κ, √κ', ∛κ'' and their inverses | 2·10⁹ per mm, 5·10⁸ mm | R⁻³ itself has no digits left at 1 m; up to 9 s too much |
//! | κ·v, √κ'·v, ∛κ''·v | 1/s | multiplied by v, a, j one at a time, so that products end below a limit |
//!
//! The ends of these ranges with each other are planned with, for either law, in a build that finds what wraps
//! (`plan` in `tests`). What follows, and is tested: no ramp exceeds a limit of acceleration, jerk or snap by more than a part of
//! 10⁻⁹ (its times are too long rather than too short; the rest is the rounding of constants), no ramp is
//! longer than its block, no ceiling or junction is exceeded. Ceilings and junctions keep their limits to
//! 10⁻⁸. A stretch takes at most a part of 10⁻⁶ longer than planned in f64, plus the part that s is of its
//! shortest block. Planned lengths are position steps, so that they add up exactly.

use core::ops::{Add, Div, Mul, Neg, Sub};

use fixed::types::{I3F29, I32F32};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Real, Root, Scalar, Unit};

/// A quantity in steps of 2⁻³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(I32F32);

impl Fixed {
    /// Steps of 2⁻³².
    #[must_use]
    pub(crate) const fn from_bits(bits: i64) -> Self {
        Self(I32F32::from_bits(bits))
    }

    /// Steps of 2⁻³².
    #[must_use]
    pub(crate) const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }
}

/// As its bits.
impl Serialize for Fixed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_i64(self.to_bits())
    }
}

impl<'de> Deserialize<'de> for Fixed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        i64::deserialize(deserializer).map(Self::from_bits)
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
        debug_assert!(self.0.checked_add(other.0).is_some(), "{self:?} + {other:?}");
        Self(self.0.wrapping_add(other.0))
    }
}

impl Sub for Fixed {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        debug_assert!(self.0.checked_sub(other.0).is_some(), "{self:?} - {other:?}");
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
        debug_assert!(self.0.checked_mul(other.0).is_some(), "{self:?} * {other:?}");
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
    // A part of 0.93 of the range: the rest is for rounding.
    const SETPOINT_MAX: Option<[f64; 3]> = Some([1.0e6, 1.0e9, 2.0e9]);

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
    const LIMITS: (f64, f64) = (1.0, 1.0e9);
    const FEEDS_MM_S: (f64, f64) = (1.0e-3, 1.0e6);
    const LENGTH_MIN_MM: f64 = 1.0e-6;

    fn rounded_up(self) -> Self {
        self + Self::from_bits(8)
    }

    /// Rounded down; 0 for what is below it.
    fn sqrt(self) -> Self {
        self.sqrt_product(Self::ONE)
    }

    /// Rounded towards zero.
    fn cbrt(self) -> Self {
        let root = integer_root::<3>(u128::from(self.to_bits().unsigned_abs()) << 64);
        Self::from_bits(if self.to_bits() < 0 { -root } else { root })
    }

    fn cbrt_quotient(self, per: Self) -> Self {
        self.cbrt() / per.cbrt()
    }

    fn times_per(self, by: Self, per: Self) -> Self {
        let (product, per) =
            (i128::from(self.to_bits()) * i128::from(by.to_bits()), i128::from(per.to_bits()));
        if per == 0 {
            return saturated(if product < 0 { i128::MIN } else { i128::MAX });
        }
        let half = if product < 0 { -(per.abs() / 2) } else { per.abs() / 2 };
        saturated((product + half) / per)
    }

    fn sqrt_product(self, other: Self) -> Self {
        let positive = |value: Self| u128::from(value.to_bits().max(0).unsigned_abs());
        Self::from_bits(integer_root::<2>(positive(self) * positive(other)))
    }

    fn root_of_squares(self, other: Self) -> Self {
        let square = |value: Self| u128::from(value.to_bits().unsigned_abs()).pow(2);
        Self::from_bits(integer_root::<2>(square(self) + square(other)))
    }

    fn root_of_square_and_quotient(self, of: Self, per: Self) -> Self {
        self.root_of_squares(of.sqrt() / per.sqrt())
    }

    fn spacing(self) -> Self {
        Self::from_bits(1)
    }
}

#[allow(clippy::cast_possible_truncation)]
fn saturated(bits: i128) -> Fixed {
    Fixed::from_bits(bits.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64)
}

/// The greatest integer whose `N`-th power is at most `value`, bit by bit; saturates. `N` is 2, or 3 with
/// `value` below 2¹²⁷: no power that is tried outgrows 128 bits.
fn integer_root<const N: u32>(value: u128) -> i64 {
    let mut root: u64 = 0;
    // The highest bit the root can have.
    let mut bit: u64 = if value == 0 { 0 } else { 1 << (value.ilog2() / N) };
    while bit > 0 {
        let candidate = root | bit;
        let wide = u128::from(candidate);
        let power = if N == 2 { wide * wide } else { wide * wide * wide };
        if power <= value {
            root = candidate;
        }
        bit >>= 1;
    }
    i64::try_from(root).unwrap_or(i64::MAX)
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
    const LIMIT: f64 = 4.0;

    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn from_fraction(fraction: u64) -> Self {
        Self::from_bits((fraction >> 35) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Against the exact product in 128 bits, rounded down, for every product that fits.
    #[test]
    fn products_are_the_exact_ones_rounded_down() {
        let random = Random::new(3);
        let mut fitting = 0;
        for _ in 0..1_000_000 {
            let a = random.of_any_size();
            let b = random.of_any_size();
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
        let random = Random::new(5);
        for _ in 0..20_000 {
            let bits = (random.next() >> 1 >> random.below(60)).cast_signed();
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

    /// What keeps a product whole: within half a step and a step of the exact value, whatever the sizes.
    #[test]
    fn whole_products_round_once_and_saturate() {
        let random = Random::new(7);
        let wide = || random.of_any_size();
        for _ in 0..200_000 {
            let [a, b, c] = [wide(), wide(), wide()];
            let [x, y, z] = [a, b, c].map(Fixed::from_bits);
            let found = i128::from(x.times_per(y, z).to_bits());
            let (product, per) = (i128::from(a) * i128::from(b), i128::from(c));
            if found == i128::from(i64::MAX) || found == i128::from(i64::MIN) {
                let is_beyond = per == 0 || product.abs() >= (per * found).abs() - per.abs() / 2;
                assert!(is_beyond, "{a} {b} {c}");
            } else {
                assert!((product - found * per).abs() * 2 <= per.abs(), "{a} {b} {c}: {found}");
            }
            let (a, b) = (a.max(0), b.max(0));
            let root = Fixed::from_bits(a).sqrt_product(Fixed::from_bits(b)).to_bits();
            let (root, product) = (i128::from(root), i128::from(a) * i128::from(b));
            assert!(root * root <= product && (root + 1) * (root + 1) > product, "{a} {b}");
            let root = x.root_of_squares(y).to_bits();
            let squares = x.to_bits().unsigned_abs() as u128;
            let squares = squares * squares + (y.to_bits().unsigned_abs() as u128).pow(2);
            let root = root.unsigned_abs() as u128;
            assert!(root * root <= squares, "{x:?} {y:?}");
            assert!(root == i64::MAX as u128 || (root + 1) * (root + 1) > squares, "{x:?} {y:?}");
        }
        assert_eq!(Fixed::ONE.times_per(Fixed::ONE, Fixed::ZERO).to_bits(), i64::MAX);
        assert_eq!((-Fixed::ONE).times_per(Fixed::ONE, Fixed::ZERO).to_bits(), i64::MIN);
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
