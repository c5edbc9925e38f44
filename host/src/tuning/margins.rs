//! Margins of the position loop L = kp·G/s, in the linear model with its bed.

use core::f64::consts::{PI, TAU};

use hal_sim::DriveParameters;

use crate::drive::model::{Complex, response};

/// Frequencies per decade that are looked at: a resonance of 3 % damping is 40 of them wide.
const PER_DECADE: f64 = 1500.0;
/// The lowest frequency \[Hz\]; loops of position servos cross far above.
const LEAST_HZ: f64 = 0.5;

/// How far a loop is from swinging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// The last frequency at which the loop has a gain of 1 \[Hz\].
    pub crossover_hz: f64,
    /// Phase margin: the additional lag that it bears, the least of all crossings \[°\].
    pub phase_deg: f64,
    /// Gain margin: the factor by which its gain might be greater. Infinite if there is none.
    pub gain: f64,
    /// Greatest magnification of an error, |1/(1 + L)|.
    pub sensitivity: f64,
}

impl Margins {
    /// The margins of a loop with gain `kp_per_s` over `drive`, in ticks of `tick_s`.
    #[must_use]
    pub fn of(drive: &DriveParameters, kp_per_s: f64, tick_s: f64) -> Self {
        let mut margins = Self { crossover_hz: 0.0, phase_deg: 180.0, gain: f64::INFINITY, sensitivity: 1.0 };
        let decades = libm::log10(0.5 / tick_s / LEAST_HZ);
        let mut before: Option<(Complex, f64, f64)> = None;
        for index in 0..=(decades * PER_DECADE) as u32 {
            let frequency_hz = LEAST_HZ * libm::pow(10.0, f64::from(index) / PER_DECADE);
            let open = open_loop(drive, kp_per_s, tick_s, frequency_hz);
            let magnitude = open.magnitude();
            // Unwrapped: the phase never changes by half a circle from one frequency to the next.
            let phase = before.map_or(open.phase_rad(), |(_, _, last)| {
                let change = open.phase_rad() - last;
                last + change - TAU * libm::round(change / TAU)
            });
            let closed = Complex::new(1.0 + open.re, open.im).magnitude();
            margins.sensitivity = margins.sensitivity.max(1.0 / closed);
            if let Some((_, last_magnitude, last_phase)) = before {
                if (last_magnitude >= 1.0) != (magnitude >= 1.0) {
                    margins.crossover_hz = frequency_hz;
                    margins.phase_deg = margins.phase_deg.min((PI + phase).to_degrees());
                }
                if last_phase > -PI && phase <= -PI {
                    margins.gain = margins.gain.min(1.0 / magnitude);
                }
            }
            before = Some((open, magnitude, phase));
        }
        margins
    }

    /// The additional delay that the loop bears \[s\]: its phase margin at its crossover.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.phase_deg / 360.0 / self.crossover_hz
    }

    /// Whether a closed loop with these margins is stable: true if the gain may grow and the phase may lag.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.gain > 1.0 && self.phase_deg > 0.0
    }
}

/// The position loop L = kp·G/s at a frequency.
#[must_use]
pub fn open_loop(drive: &DriveParameters, kp_per_s: f64, tick_s: f64, frequency_hz: f64) -> Complex {
    let s = Complex::new(0.0, TAU * frequency_hz);
    Complex::new(kp_per_s, 0.0) * response(drive, tick_s, frequency_hz) / s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures of an independent computation for S4's X axis: 36.29 Hz, 38.56°, 2.186, 2.298.
    #[test]
    fn margins_of_the_reference() {
        let found = Margins::of(&hal_sim::REFERENCE_X, 230.0, 5e-4);
        assert!((found.crossover_hz - 36.291).abs() < 0.1, "{found:?}");
        assert!((found.phase_deg - 38.559).abs() < 0.2, "{found:?}");
        assert!((found.gain - 2.186).abs() < 0.01, "{found:?}");
        assert!((found.sensitivity - 2.298).abs() < 0.01, "{found:?}");
        assert!(found.is_stable() && !Margins::of(&hal_sim::REFERENCE_X, 230.0 * 2.25, 5e-4).is_stable());
    }
}
