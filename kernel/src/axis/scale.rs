//! Units of an axis: encoder counts ↔ mm, velocity command ↔ volts ↔ converter code.
//!
//! The only place where these units meet. Configuration, made in the background from f64 figures.

use super::check::{Check, fits};
use crate::num::{Real, whole};
use crate::units::{Counts, DacCode, Position};

/// A scale that can't be used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScaleError {
    /// The quantity, with its unit.
    pub quantity: &'static str,
    /// The value given.
    pub value: f64,
    /// What is expected.
    pub expected: &'static str,
}

impl core::fmt::Display for ScaleError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} {}: expected {}", self.quantity, self.value, self.expected)
    }
}

impl core::error::Error for ScaleError {}

/// Length per encoder count, with 64 fractional bits: over 2³¹ counts it is off by less than half a
/// position step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderScale {
    /// mm per count in 2⁻⁶⁴ mm, in two halves; the upper one has the sign.
    step_high: i32,
    step_low: u32,
}

impl EncoderScale {
    /// A scale of `mm_per_count` mm per count; negative for an encoder that counts in the negative direction.
    ///
    /// Refused unless |mm_per_count| is from 10⁻⁸ to 0.5 mm, exclusive.
    pub(super) fn new(check: &mut Check, mm_per_count: f64) -> Self {
        let size = libm::fabs(mm_per_count);
        let expected = "a magnitude between 1e-8 and 0.5";
        check.that(size > 1.0e-8 && size < 0.5, "encoder resolution [mm/count]", mm_per_count, expected);
        let (upper, rest) = digits(size);
        let (lower, rest) = digits(rest);
        let step = (upper << 32 | lower).cast_signed();
        // Rounded down: the remainder of a negative value makes it the next lower one.
        let step = match (mm_per_count < 0.0, rest > 0.0) {
            (false, _) => step,
            (true, false) => step.wrapping_neg(),
            (true, true) => !step,
        };
        Self { step_high: (step >> 32) as i32, step_low: step as u32 }
    }

    /// The position of `counts`. In the tick: four 32×32-bit products.
    #[inline]
    #[must_use]
    pub fn position(&self, counts: Counts) -> Position {
        // Halves times halves; a product beyond 64 bits is beyond the range.
        let (counts_high, counts_low) = (counts.0 >> 32, counts.0 & 0xFFFF_FFFF);
        let (step_high, step_low) = (i64::from(self.step_high), i64::from(self.step_low));
        let lowest = ((counts_low as u64).wrapping_mul(step_low as u64) >> 32) as i64;
        let middle = counts_low.wrapping_mul(step_high).wrapping_add(counts_high.wrapping_mul(step_low));
        let highest = counts_high.wrapping_mul(step_high) << 32;
        Position::from_bits(highest.wrapping_add(middle).wrapping_add(lowest))
    }

    /// Millimetres per count, with its sign.
    #[must_use]
    pub(crate) fn mm_per_count(&self) -> f64 {
        (f64::from(self.step_high) + f64::from(self.step_low) / 4_294_967_296.0) / 4_294_967_296.0
    }
}

/// The first 32 binary digits of a fraction, and the rest.
fn digits(fraction: f64) -> (u64, f64) {
    let scaled = fraction * 4_294_967_296.0;
    let digits = whole(scaled);
    (digits, scaled - f64::from(digits as u32))
}

/// Velocity command to converter code: gain, offset trim, limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputScale<R> {
    codes_per_mm_s: R,
    offset_codes: R,
    /// The velocity commands at which the output reaches −limit and +limit \[mm/s\].
    limits: (R, R),
}

impl<R: Real> OutputScale<R> {
    /// `mm_s_at_10_v` is the axis velocity at +10 V (negative if +10 V moves in negative direction);
    /// `offset_v` is added to every output so that a command of 0 holds the drive still;
    /// `limit_v` bounds the output.
    ///
    /// Refused if the gain is 0, not finite or beyond the number type, the limit is not in (0, 10\] V, or the
    /// trim is not below the limit.
    pub(super) fn new(check: &mut Check, mm_s_at_10_v: f64, offset_v: f64, limit_v: f64) -> Self {
        let full = DacCode::FULL_SCALE_V;
        let is_limit = limit_v > 0.0 && limit_v <= full;
        check.that(is_limit, "output limit [V]", limit_v, "more than 0 and at most 10");
        let is_below = libm::fabs(offset_v) < limit_v;
        check.that(is_below, "output offset [V]", offset_v, "a magnitude below the output limit");
        let volts_per_mm_s = full / mm_s_at_10_v;
        let (codes_per_mm_s, offset_codes) =
            (volts_per_mm_s * DacCode::PER_VOLT, offset_v * DacCode::PER_VOLT);
        let (down, up) = ((limit_v + offset_v) / volts_per_mm_s, (limit_v - offset_v) / volts_per_mm_s);
        // If the gain is not finite, neither are the limits.
        let fits = fits::<R>(codes_per_mm_s) && fits::<R>(offset_codes) && fits::<R>(down) && fits::<R>(up);
        let expected = "a number other than 0 within the kernel's range";
        check.that(fits, "velocity at 10 V [mm/s]", mm_s_at_10_v, expected);
        let (a, b) = (-R::from_f64(down), R::from_f64(up));
        Self {
            codes_per_mm_s: R::from_f64(codes_per_mm_s),
            offset_codes: R::from_f64(offset_codes),
            limits: if a < b { (a, b) } else { (b, a) },
        }
    }

    /// Least and greatest velocity command the output can express \[mm/s\].
    pub fn limits(&self) -> (R, R) {
        self.limits
    }

    /// The code for a velocity command \[mm/s\] within the limits.
    #[inline]
    pub fn code(&self, velocity_mm_s: R) -> DacCode {
        DacCode((velocity_mm_s * self.codes_per_mm_s + self.offset_codes).round_to_i16())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn counts_to_position_is_exact_to_a_step_over_the_whole_range() {
        for mm_per_count in [1e-4, 5e-4, -1e-3, 1.0 / 4096.0, 1.27e-6] {
            let scale = Check::all(|check| EncoderScale::new(check, mm_per_count)).expect("valid");
            let mut counts = 1_i64;
            while counts < 1 << 31 {
                for counts in [counts, -counts, counts * 3 / 2] {
                    let found = scale.position(Counts(counts)).to_bits();
                    // Exact: the f64 resolution as a fraction of 2⁶⁴, the product in 128 bits.
                    let step = (mm_per_count * 2.0_f64.powi(64)) as i128;
                    let exact = (i128::from(counts) * step) >> 32;
                    assert!((i128::from(found) - exact).abs() <= 1, "{mm_per_count} {counts}");
                }
                counts *= 2;
            }
        }
    }

    /// Rounded down in steps of 2⁻⁶⁴ mm, as with the library's floor.
    #[test]
    fn a_count_is_rounded_down() {
        let random = Random::new(19);
        for _ in 0..100_000 {
            // Of 25 binary orders, with few digits and with all.
            let zeros = random.below(53);
            let digits = random.next() >> 12 >> zeros << zeros;
            let size = f64::from_bits((997 + random.below(25)) << 52 | digits);
            for mm_per_count in [size, -size] {
                let scaled = mm_per_count * 4_294_967_296.0;
                let high = libm::floor(scaled);
                let expected = EncoderScale {
                    step_high: high as i32,
                    step_low: ((scaled - high) * 4_294_967_296.0) as u32,
                };
                assert_eq!(
                    Check::all(|check| EncoderScale::new(check, mm_per_count)),
                    Ok(expected),
                    "{size:e}"
                );
            }
        }
    }

    #[test]
    fn eighty_million_counts_are_eight_metres() {
        let scale = Check::all(|check| EncoderScale::new(check, 1e-4)).expect("valid");
        let error_mm = scale.position(Counts(80_000_000)).to_mm() - 8000.0;
        assert!(error_mm.abs() < 1e-9, "{error_mm:e}");
    }

    #[test]
    fn output_reaches_its_limits_and_trims() {
        let new = |mm_s_at_10_v, offset_v, limit_v| {
            Check::all(|check| OutputScale::<f32>::new(check, mm_s_at_10_v, offset_v, limit_v))
        };
        let output = new(1000.0 / 3.0, 0.5, 10.0).expect("valid");
        assert_eq!(output.code(0.0), DacCode(1638));
        assert_eq!(output.code(output.limits().1), DacCode(i16::MAX));
        assert_eq!(output.code(output.limits().0), DacCode(i16::MIN));
        let reversed = new(-100.0, 0.0, 5.0).expect("valid");
        assert_eq!(reversed.code(50.0), DacCode(-16384));
        assert!(new(0.0, 0.0, 10.0).is_err());
        assert!(new(f64::INFINITY, 0.0, 10.0).is_err());
        assert!(new(100.0, 10.0, 10.0).is_err());
        assert!(new(100.0, 0.0, 10.1).is_err());
    }
}
