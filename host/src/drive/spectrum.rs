//! The frequency response in a step response: the Fourier transform of its derivative.

use super::model::Complex;

/// Greatest frequency at which −3 dB is searched, as a fraction of the tick's frequency.
const NYQUIST: f64 = 0.5;
/// Steps of that search \[Hz\].
const SEARCH_HZ: f64 = 0.25;
const BISECTIONS: u32 = 40;

/// The impulse response of a velocity, as differences from tick to tick.
#[derive(Clone, Debug)]
pub struct Spectrum {
    impulses: Vec<f64>,
    tick_s: f64,
}

impl Spectrum {
    /// The spectrum from backward differences of positions: `velocities[i]` is the mean velocity over tick i
    /// after the step.
    #[must_use]
    pub fn new(velocities: &[f64], tick_s: f64) -> Self {
        let mut before = 0.0;
        let impulses = velocities.iter().map(|&v| v - core::mem::replace(&mut before, v)).collect();
        Self { impulses, tick_s }
    }

    /// Response at a frequency, relative to that at rest. Impulse i is centred on the start of tick i,
    /// because each velocity is the mean over its tick.
    #[must_use]
    pub fn at(&self, frequency_hz: f64) -> Complex {
        let omega_tick = core::f64::consts::TAU * frequency_hz * self.tick_s;
        let (mut sum, mut rest) = (Complex::ZERO, 0.0);
        for (index, &impulse) in self.impulses.iter().enumerate() {
            let (sine, cosine) = libm::sincos(-omega_tick * index as f64);
            sum = sum + Complex::new(impulse * cosine, impulse * sine);
            rest += impulse;
        }
        if rest.abs() > 0.0 { sum * Complex::new(1.0 / rest, 0.0) } else { Complex::ZERO }
    }

    /// The lowest frequency at which the amplitude is below `ratio` times that at rest \[Hz\].
    #[must_use]
    pub fn passes(&self, ratio: f64) -> Option<f64> {
        let amplitude = |frequency_hz: f64| self.at(frequency_hz).magnitude();
        let most_hz = NYQUIST / self.tick_s;
        let count = (most_hz / SEARCH_HZ) as u32;
        let above = (1..=count).map(|i| f64::from(i) * SEARCH_HZ).find(|&f| amplitude(f) < ratio)?;
        let (mut low, mut high) = (above - SEARCH_HZ, above);
        for _ in 0..BISECTIONS {
            let middle = low.midpoint(high);
            if amplitude(middle) < ratio { high = middle } else { low = middle }
        }
        Some(low.midpoint(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::HALF_POWER;

    /// A lag of first order: −3 dB at 1/(2πT), −45° there.
    #[test]
    fn a_lag_has_its_corner() {
        let (lag_s, tick_s) = (0.008, 0.0001);
        let position = |t: f64| t + lag_s * ((-t / lag_s).exp() - 1.0);
        let mean = |i: u32| (position(f64::from(i + 1) * tick_s) - position(f64::from(i) * tick_s)) / tick_s;
        let velocities: Vec<f64> = (0..2000).map(mean).collect();
        let spectrum = Spectrum::new(&velocities, tick_s);
        let corner_hz = 1.0 / (core::f64::consts::TAU * lag_s);
        let found_hz = spectrum.passes(HALF_POWER).expect("a bandwidth");
        assert!((found_hz - corner_hz).abs() < 1e-3 * corner_hz, "{found_hz} {corner_hz}");
        assert!((spectrum.at(corner_hz).phase_rad().to_degrees() + 45.0).abs() < 0.1);
    }
}
