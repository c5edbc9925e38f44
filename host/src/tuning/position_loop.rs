//! The position loop that is proposed, and how well the recordings tell its margins.

use motion_kernel::axis::Gains;

use super::gains::{best, kd_max, scaled, written};
use super::margins::Margins;
use crate::identify::{AxisParametersFound, Estimate, Identification};
use crate::machine::AxisSettings;

/// Half an interval over a margin, up to which the margin is known well enough.
const MARGINS_KNOWN: f64 = 0.01;

/// A loop over the drive that explains the recordings best.
#[derive(Clone, Debug)]
pub(super) struct PositionLoop {
    /// The regulator's gains, as they are written.
    pub(super) gains: Gains,
    /// Those of the loop: the drive's velocity is not quite what commands say.
    pub(super) loop_gains: Gains,
    pub(super) margins: Margins,
    pub(super) phase_margin_deg: Estimate,
    /// Infinite if there is none.
    pub(super) gain_margin: Estimate,
}

impl PositionLoop {
    /// The loop for `axis`; `None` if no gains keep margins.
    pub(super) fn new(axis: &AxisSettings, found: &Identification, tick_s: f64) -> Option<Self> {
        let (parameters, drive) = (&found.parameters, &found.parameters.drive());
        let limit = parameters.accel_limit_mm_s2;
        let limit_mm_s2 = if limit.is_determined() { limit.value } else { axis.accel_mm_s2 };
        let kd_max = kd_max(drive, tick_s, found.figures.reading_error_mm(), limit_mm_s2);
        let gain = command_gain(parameters);
        let gains = written(scaled(best(drive, tick_s, kd_max)?, 1.0 / gain));
        let loop_gains = scaled(gains, gain);
        let margins = Margins::of(drive, loop_gains, tick_s);
        let drives = found.alternatives.drives.iter();
        let others: Vec<Margins> = drives.map(|drive| Margins::of(drive, loop_gains, tick_s)).collect();
        let estimate =
            |of: fn(&Margins) -> f64| found.alternatives.estimate(of(&margins), others.iter().map(of));
        Some(Self {
            gains,
            loop_gains,
            margins,
            phase_margin_deg: estimate(|margins| margins.phase_deg),
            gain_margin: estimate(|margins| margins.gain),
        })
    }

    /// Frequencies at which the drive has to be known better: where a margin is read that is not known well enough \[Hz\].
    pub(super) fn unclear_hz(&self) -> Vec<f64> {
        let Self { margins, phase_margin_deg, gain_margin, .. } = self;
        let is_unclear = |margin: &Estimate| margin.half_width_95 > MARGINS_KNOWN * margin.value.abs();
        let read = [(phase_margin_deg, margins.phase_hz), (gain_margin, margins.gain_hz)];
        read.into_iter().filter(|(margin, _)| is_unclear(margin)).map(|(_, hz)| hz).collect()
    }
}

/// Actual over nominal scale; 1 where the recordings do not tell it from 1.
pub(super) fn command_gain(parameters: &AxisParametersFound) -> f64 {
    let gain = parameters.command_gain;
    let is_told = (gain.value - 1.0).abs() > gain.half_width_95.max(1e-3);
    if is_told && gain.value > 0.0 { gain.value } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position_loop(phase_half_width: f64, gain: f64, gain_half_width: f64) -> PositionLoop {
        let of = |value: f64, half_width_95: f64| Estimate { value, half_width_95 };
        PositionLoop {
            gains: Gains::default(),
            loop_gains: Gains::default(),
            margins: Margins {
                crossover_hz: 30.0,
                phase_deg: 40.0,
                phase_hz: 20.0,
                gain,
                gain_hz: 70.0,
                sensitivity: 2.0,
            },
            phase_margin_deg: of(40.0, phase_half_width),
            gain_margin: of(gain, gain_half_width),
        }
    }

    #[test]
    fn margins_are_unclear_beyond_a_hundredth() {
        assert!(position_loop(0.39, 2.5, 0.024).unclear_hz().is_empty());
        assert_eq!(position_loop(0.41, 2.5, 0.024).unclear_hz(), [20.0]);
        assert_eq!(position_loop(0.39, 2.5, 0.026).unclear_hz(), [70.0]);
        assert_eq!(position_loop(0.41, 2.5, f64::INFINITY).unclear_hz(), [20.0, 70.0]);
        assert!(position_loop(0.39, f64::INFINITY, 0.0).unclear_hz().is_empty());
    }
}
