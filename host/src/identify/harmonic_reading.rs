//! Figures of harmonic motion, read off the recording without any model: points of the Bode plot (S4).

use core::f64::consts::PI;

use super::recording::AxisRecording;
use crate::sine::{Baseline, fit};

/// Amplitude and delay of one harmonic motion, of positions. What is commanded is what the converter puts
/// out, in a closed loop too: the figures are the drive's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicReading {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Amplitude of the commanded velocity \[mm/s\].
    pub amplitude_mm_s: f64,
    /// Actual over commanded amplitude.
    pub gain: f64,
    /// Delay of the actual velocity after a commanded one that is not held over ticks \[s\], below one
    /// period.
    pub delay_s: f64,
}

/// The frequency at which the amplitude has fallen by 3 dB, for one velocity amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bandwidth {
    /// Amplitude of the commanded velocity \[mm/s\].
    pub amplitude_mm_s: f64,
    /// Frequency, interpolated between harmonic motions \[Hz\].
    pub frequency_hz: f64,
}

/// Periods left out, in which the motion grows and decays.
const GROWTH_PERIODS: f64 = 1.5;
const DECAY_PERIODS: f64 = 1.0;

/// The figures of a harmonic run; `None` for other runs and for less than one steady period.
pub(super) fn harmonic_reading(run: &AxisRecording) -> Option<HarmonicReading> {
    let frequency_hz = run.harmonic_hz?;
    let period = 1.0 / (frequency_hz * run.tick_s);
    let first = run.lead_in_ticks as f64 + GROWTH_PERIODS * period;
    let periods = ((run.actual_mm.len() as f64 - DECAY_PERIODS * period - first) / period).floor();
    if !(periods >= 1.0 && period >= 4.0) {
        return None;
    }
    let steady = first as usize..(first + periods * period) as usize;
    let omega = 2.0 * PI / period;
    let actual = fit(run.actual_mm.get(steady.clone())?, omega, 1.0, Baseline::Line);
    let commanded = run.commanded_mm();
    let command = fit(commanded.get(steady)?, omega, 1.0, Baseline::Line);
    if !(command.amplitude > 0.0) {
        return None;
    }
    let lag = command.phase_rad - actual.phase_rad;
    Some(HarmonicReading {
        frequency_hz,
        amplitude_mm_s: command.amplitude * 2.0 * PI * frequency_hz,
        gain: actual.amplitude / command.amplitude,
        delay_s: lag.rem_euclid(2.0 * PI) / (2.0 * PI * frequency_hz) + run.tick_s / 2.0,
    })
}

/// −3 dB points, one for each velocity amplitude that was run at frequencies on both sides of it.
pub(super) fn bandwidths(figures: &[HarmonicReading]) -> Vec<Bandwidth> {
    let mut left = figures.to_vec();
    left.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut found = Vec::new();
    while let Some(first) = left.first().copied() {
        let is_like =
            |point: &HarmonicReading| (point.amplitude_mm_s / first.amplitude_mm_s - 1.0).abs() < 0.05;
        let group: Vec<HarmonicReading> = left.iter().copied().filter(is_like).collect();
        left.retain(|point| !is_like(point));
        let limit = 0.5_f64.sqrt();
        let crossing = group.windows(2).find(|pair| pair[0].gain >= limit && pair[1].gain < limit);
        if let Some([above, below]) = crossing {
            let share = (above.gain - limit) / (above.gain - below.gain);
            let frequency_hz = above.frequency_hz + share * (below.frequency_hz - above.frequency_hz);
            found.push(Bandwidth { amplitude_mm_s: first.amplitude_mm_s, frequency_hz });
        }
        if !is_like(&first) {
            // An amplitude that is no number is like nothing, not even itself.
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_and_delay_of_a_delayed_sine() {
        let (tick_s, hz, delay_s) = (0.5e-3, 10.0, 3.2e-3);
        let omega = 2.0 * PI * hz;
        let at = |time_s: f64| 5.0 + 0.8 * 40.0 / omega * (omega * (time_s - delay_s)).sin();
        let run = AxisRecording {
            tick_s,
            command_mm_s: (0..2000).map(|tick| 40.0 * (omega * tick_s * f64::from(tick)).cos()).collect(),
            actual_mm: (0..2000).map(|tick| at(tick_s * f64::from(tick))).collect(),
            harmonic_hz: Some(hz),
            ..AxisRecording::default()
        };
        let figures = harmonic_reading(&run).unwrap();
        assert!((figures.gain - 0.8).abs() < 1e-3, "{figures:?}");
        assert!((figures.amplitude_mm_s - 40.0).abs() < 0.05, "{figures:?}");
        assert!((figures.delay_s - delay_s).abs() < 1e-6, "{figures:?}");
    }

    #[test]
    fn the_bandwidth_is_interpolated() {
        let point =
            |frequency_hz, gain| HarmonicReading { frequency_hz, amplitude_mm_s: 30.0, gain, delay_s: 0.0 };
        let found = bandwidths(&[point(40.0, 0.607_106_78), point(20.0, 0.807_106_78), point(10.0, 1.0)]);
        assert_eq!(found.len(), 1);
        assert!((found[0].frequency_hz - 30.0).abs() < 1e-5);
        assert!(
            bandwidths(&[point(10.0, 1.0), HarmonicReading { amplitude_mm_s: f64::NAN, ..point(9.0, 0.1) }])
                .is_empty()
        );
    }
}
