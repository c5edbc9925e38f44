//! A quadrature encoder on a timer, as the board sees it.
//!
//! Consumes the true position; produces [`Counts`]. On the way lies the register of a 16- or 32-bit timer,
//! extended by the kernel's own [`CountExtender`], so a simulation wraps where a board would, and loses
//! counts where a board would: when the axis moves half the register's range between two readings.
//!
//! The extended count starts at the encoder's count at power-up, as on a board that reads an absolute
//! position once. Constant cost, cannot fail.

use motion_kernel::hal::CountExtender;
use motion_kernel::units::Counts;

use crate::noise::SplitMix64;
use crate::parameter::{ParameterError, finite, positive};

/// The width of the timer that counts the edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimerBits {
    /// A 16-bit counter register.
    Sixteen,
    /// A 32-bit counter register.
    ThirtyTwo,
}

/// Reading noise: a uniformly distributed error of whole counts in every reading, not accumulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderNoise {
    /// Largest error in either direction \[counts\].
    pub amplitude_counts: u16,
    /// The same seed gives the same errors.
    pub seed: u64,
}

/// An encoder. Immutable once given to a [`SimEncoder`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderParameters {
    /// Travel per count \[mm\], > 0.
    pub resolution_mm: f64,
    /// The count at position 0.
    pub offset_counts: i32,
    /// Width of the timer register.
    pub timer: TimerBits,
    /// Reading noise; `None` for an exact encoder.
    pub noise: Option<EncoderNoise>,
}

/// The encoder of the reference axes: 0.1 µm a count, as in S4, on a 32-bit timer.
pub const REFERENCE_ENCODER: EncoderParameters =
    EncoderParameters { resolution_mm: 1e-4, offset_counts: 0, timer: TimerBits::ThirtyTwo, noise: None };

/// The extender of either register width.
#[derive(Clone, Debug)]
enum Extender {
    Sixteen(CountExtender<u16>),
    ThirtyTwo(CountExtender<u32>),
}

/// An encoder with its timer and the noise's state.
#[derive(Clone, Debug)]
pub struct SimEncoder {
    parameters: EncoderParameters,
    extender: Extender,
    counts_at_power_up: i64,
    noise: SplitMix64,
}

impl SimEncoder {
    /// An encoder that powers up at `position_mm`.
    ///
    /// # Errors
    /// `resolution_mm` not above 0, or a value that is not finite.
    pub fn new(parameters: EncoderParameters, position_mm: f64) -> Result<Self, ParameterError> {
        positive("resolution_mm", parameters.resolution_mm)?;
        finite("position_mm", position_mm)?;
        let counts_at_power_up = exact_counts(&parameters, position_mm);
        let extender = match parameters.timer {
            TimerBits::Sixteen => Extender::Sixteen(CountExtender::new(counts_at_power_up as u16)),
            TimerBits::ThirtyTwo => Extender::ThirtyTwo(CountExtender::new(counts_at_power_up as u32)),
        };
        let seed = parameters.noise.map_or(0, |noise| noise.seed);
        Ok(Self { parameters, extender, counts_at_power_up, noise: SplitMix64::new(seed) })
    }

    /// The parameters this was made from.
    #[must_use]
    pub fn parameters(&self) -> &EncoderParameters {
        &self.parameters
    }

    /// Reads the timer with the axis at `position_mm` and extends the reading. Positions up to about
    /// 10¹⁵ counts are exact.
    pub fn latch(&mut self, position_mm: f64) -> Counts {
        let error_counts = self.parameters.noise.map_or(0, |noise| self.noise.within(noise.amplitude_counts));
        let edges = exact_counts(&self.parameters, position_mm).wrapping_add(error_counts);
        // The casts cut the count down to what the register holds.
        let Counts(since_power_up) = match &mut self.extender {
            Extender::Sixteen(extender) => extender.extend(edges as u16),
            Extender::ThirtyTwo(extender) => extender.extend(edges as u32),
        };
        Counts(self.counts_at_power_up.wrapping_add(since_power_up))
    }
}

/// The count nearest to `position_mm`, halves upwards.
fn exact_counts(parameters: &EncoderParameters, position_mm: f64) -> i64 {
    let travel_counts = libm::floor(position_mm / parameters.resolution_mm + 0.5) as i64;
    travel_counts.wrapping_add(i64::from(parameters.offset_counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoder(parameters: EncoderParameters, position_mm: f64) -> SimEncoder {
        SimEncoder::new(parameters, position_mm).unwrap()
    }

    #[test]
    fn rounds_to_the_nearest_count() {
        let parameters = EncoderParameters { resolution_mm: 0.25, ..REFERENCE_ENCODER };
        let mut encoder = encoder(parameters, 0.0);
        for (position_mm, counts) in [(0.124, 0), (0.125, 1), (-0.125, 0), (-0.126, -1), (10.0, 40)] {
            assert_eq!(encoder.latch(position_mm), Counts(counts), "{position_mm} mm");
        }
    }

    #[test]
    fn both_timers_wrap_and_agree() {
        // At 1 mm a reading, 10 000 counts, the 16-bit register wraps every seven readings.
        let narrow = EncoderParameters { timer: TimerBits::Sixteen, offset_counts: -7, ..REFERENCE_ENCODER };
        let wide = EncoderParameters { timer: TimerBits::ThirtyTwo, ..narrow };
        let (mut narrow, mut wide) = (encoder(narrow, 0.0), encoder(wide, 0.0));
        for step in (0..200).chain((-200..200).rev()) {
            let counts = Counts(step * 10_000 - 7);
            assert_eq!(narrow.latch(step as f64), counts);
            assert_eq!(wide.latch(step as f64), counts);
        }
    }

    #[test]
    fn a_wide_register_wraps_at_its_own_end() {
        let parameters = EncoderParameters { offset_counts: i32::MAX, ..REFERENCE_ENCODER };
        let mut encoder = encoder(parameters, 0.0);
        for step in 0..300_000 {
            let counts = Counts(i64::from(i32::MAX) + step * 10_000);
            assert_eq!(encoder.latch(step as f64), counts);
        }
    }

    #[test]
    fn half_a_range_between_readings_loses_counts() {
        let parameters = EncoderParameters { timer: TimerBits::Sixteen, ..REFERENCE_ENCODER };
        let mut encoder = encoder(parameters, 0.0);
        assert_eq!(encoder.latch(3.2767), Counts(32_767));
        assert_eq!(encoder.latch(3.2767 + 3.2768), Counts(32_767 - 32_768));
    }

    #[test]
    fn the_count_at_power_up_is_kept() {
        let parameters = EncoderParameters { offset_counts: 123, ..REFERENCE_ENCODER };
        assert_eq!(encoder(parameters, 500.0).latch(500.0), Counts(5_000_123));
    }

    #[test]
    fn noise_is_bounded_repeatable_and_not_accumulated() {
        let noisy = |seed| EncoderParameters {
            noise: Some(EncoderNoise { amplitude_counts: 3, seed }),
            ..REFERENCE_ENCODER
        };
        let readings = |seed| {
            let mut encoder = encoder(noisy(seed), 0.0);
            core::array::from_fn::<i64, 1000, _>(|_| encoder.latch(1.0).0 - 10_000)
        };
        assert_eq!(readings(5), readings(5));
        assert_ne!(readings(5), readings(6));
        assert!(readings(5).iter().all(|error| error.abs() <= 3));
        assert!([-3, 3].iter().all(|end| readings(5).contains(end)));
    }

    #[test]
    fn a_resolution_of_zero_is_refused() {
        let parameters = EncoderParameters { resolution_mm: 0.0, ..REFERENCE_ENCODER };
        let refusal = ParameterError::OutOfRange { quantity: "resolution_mm", value: 0.0 };
        assert_eq!(SimEncoder::new(parameters, 0.0).unwrap_err(), refusal);
    }
}
