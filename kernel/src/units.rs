//! Quantities whose mix-up would break a machine, as types.
//!
//! Everything else is a plain number with its unit in its name. Used by every room; holds no logic
//! beyond the conversions between these types.
//!
//! ```
//! use motion_kernel::units::{DacCode, Position};
//!
//! let position = Position::from_mm(12.5).expect("within a kilometre");
//! assert_eq!(position.to_bits(), 25 << 31); // exactly, in steps of 2⁻³² mm
//! assert_eq!(Position::from_mm(2.0e6), None);
//! assert_eq!(DacCode::from_volts(-5.0_f64), DacCode(-16384));
//! ```

use fixed::types::I32F32;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::num::{Real, of_q32};

const STEPS_PER_MM: f64 = 4_294_967_296.0;

/// A position or a length in mm, in steps of 2⁻³² mm (0.23 pm), from −2³¹ to 2³¹ mm.
///
/// Path positions and axis positions are kept in this type because a float degrades with distance:
/// in f32 the fourth decimal is lost at 1.7 m. Subtract first, convert the difference afterwards.
///
/// All arithmetic wraps. Inputs are bounded to ±10⁶ mm when they are accepted
/// ([`Position::LIMIT_MM`]), so wrapping can't be reached by accepted work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position(I32F32);

#[cfg(feature = "defmt")]
impl defmt::Format for Position {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=f64} mm", self.to_mm());
    }
}

impl Position {
    /// The origin.
    pub const ZERO: Self = Self(I32F32::ZERO);
    /// The largest coordinate and stretch length that the kernel accepts \[mm\]: one kilometre.
    pub const LIMIT_MM: f64 = 1.0e6;

    /// Steps of 2⁻³² mm.
    #[must_use]
    pub const fn from_bits(bits: i64) -> Self {
        Self(I32F32::from_bits(bits))
    }

    /// Steps of 2⁻³² mm.
    #[must_use]
    pub const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// The nearest step to `mm`; `None` if `mm` is not finite or beyond ±[`Self::LIMIT_MM`].
    /// Background only.
    #[must_use]
    #[inline(never)]
    pub fn from_mm(mm: f64) -> Option<Self> {
        const FRACTION_BITS: u32 = f64::MANTISSA_DIGITS - 1;
        const { assert!(Self::LIMIT_MM < 1_048_576.0, "the last digit is below half a step") };
        // By its digits: on a core without f64 a comparison, a product and a sum are subroutines.
        let bits = mm.to_bits();
        let magnitude = bits & (u64::MAX >> 1);
        if magnitude > Self::LIMIT_MM.to_bits() {
            return None;
        }
        // Twice the last digit is `lost` places below a step; of a subnormal number nothing remains anyway.
        let digits = magnitude & ((1 << FRACTION_BITS) - 1) | 1 << FRACTION_BITS;
        let lost = (1023 + FRACTION_BITS - 32 - 1) - (magnitude >> FRACTION_BITS) as u32;
        let doubled = digits.checked_shr(lost).unwrap_or(0);
        // To the nearest step, halves to even: half a step is the lowest digit left, if all that was lost is 0.
        let is_more = digits.checked_shl(u64::BITS.wrapping_sub(lost)).unwrap_or(0) != 0;
        let steps = doubled >> 1;
        let is_up = doubled & 1 == 1 && (is_more || steps & 1 == 1);
        let steps = (steps + u64::from(is_up)).cast_signed();
        Some(Self::from_bits(if bits >> 63 == 1 { -steps } else { steps }))
    }

    /// The value in mm, rounded to f64 (exact up to 2 m). For records and reports, not for the tick.
    #[must_use]
    #[inline(never)]
    pub fn to_mm(self) -> f64 {
        of_q32(self.to_bits() as f64)
    }

    /// Whether it is within ±[`Self::LIMIT_MM`].
    #[must_use]
    pub(crate) fn is_within_limit(self) -> bool {
        self.to_bits().unsigned_abs() <= (Self::LIMIT_MM * STEPS_PER_MM) as u64
    }

    /// A short local offset in mm as a step count, see [`Real::to_q32`].
    #[must_use]
    pub(crate) fn from_offset<R: Real>(offset_mm: R) -> Self {
        Self::from_bits(offset_mm.to_q32())
    }

    /// The value as a local offset in mm; exact to the resolution of `R`.
    #[doc(hidden)]
    #[must_use]
    pub fn to_offset<R: Real>(self) -> R {
        R::from_q32(self.to_bits())
    }
}

/// As its steps of 2⁻³² mm.
impl Serialize for Position {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_bits().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        i64::deserialize(deserializer).map(Self::from_bits)
    }
}

/// As those steps.
#[cfg(feature = "link")]
impl postcard_schema::Schema for Position {
    const SCHEMA: &'static postcard_schema::schema::NamedType = i64::SCHEMA;
}

impl core::ops::Add for Position {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl core::ops::Sub for Position {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

impl core::ops::Neg for Position {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}

/// An encoder position in counts since power-up, extended to 64 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub struct Counts(pub i64);

/// A two's-complement code of a 16-bit ±10 V converter: −32768 is −10 V, 0 is 0 V, 32767 is one
/// step below +10 V. The only door between volts and the converter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DacCode(pub i16);

impl DacCode {
    /// 0 V.
    pub const ZERO: Self = Self(0);
    /// The converter's full scale \[V\].
    pub const FULL_SCALE_V: f64 = 10.0;
    /// Codes per volt.
    pub const PER_VOLT: f64 = 32768.0 / Self::FULL_SCALE_V;

    /// The code nearest to `output_v`, halves away from zero; saturates at the ends of the range.
    /// A value that is not a number gives 0 V.
    #[must_use]
    pub fn from_volts<R: Real>(output_v: R) -> Self {
        Self((output_v * R::from_f64(Self::PER_VOLT)).round_to_i16())
    }

    /// The voltage of this code \[V\].
    #[must_use]
    pub fn to_volts(self) -> f64 {
        f64::from(self.0) / Self::PER_VOLT
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Against the conversions of `fixed`, over all sizes and signs, halves of a step, and both ends.
    #[test]
    fn converts_as_fixed_does() {
        let ends = [0.0, -0.0, 1.0e6, 1.0e6_f64.next_up(), f64::NAN, f64::INFINITY, f64::MIN_POSITIVE];
        let random = Random::new(5);
        for index in 0..1_000_000 {
            let bits = random.of_any_size();
            assert_eq!(
                Position::from_bits(bits).to_mm().to_bits(),
                I32F32::from_bits(bits).to_num::<f64>().to_bits()
            );
            assert_eq!(
                Position::from_bits(bits).is_within_limit(),
                bits.unsigned_abs() <= 1_000_000 << 32,
                "{bits}"
            );
            let near = (bits >> 11) as f64 * 0.5 / STEPS_PER_MM;
            let mm = ends.get(index).copied().unwrap_or(if index % 2 == 0 {
                near
            } else {
                f64::from_bits(random.next())
            });
            for mm in [mm, -mm] {
                let expected =
                    if libm::fabs(mm) <= Position::LIMIT_MM { I32F32::checked_from_num(mm) } else { None };
                assert_eq!(
                    Position::from_mm(mm).map(Position::to_bits),
                    expected.map(I32F32::to_bits),
                    "{mm:e}"
                );
            }
        }
    }
}
