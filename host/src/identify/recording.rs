//! The recording of a run for identification: commands and encoder readings, tick by tick.
//!
//! Identification uses nothing else: neither set-points nor gains of the regulator, and no parameter of a
//! simulation. So a recording may come from an open or a closed loop.

use super::IdentifyError;

/// Ticks below which no recording is evaluated.
const TICKS_MIN: usize = 50;

/// One run of one axis: what the converter put out and what the encoder read, tick by tick.
///
/// The axis is at rest when it begins, under the command it begins with: 0, or a trim that holds it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisRecording {
    /// Control tick \[s\], > 0; the same in all runs.
    pub tick_s: f64,
    /// The converter's output in velocity: code × nominal scale, held over the tick \[mm/s\].
    pub command_mm_s: Vec<f64>,
    /// Encoder position latched at the start of the tick \[mm\].
    pub actual_mm: Vec<f64>,
    /// Ticks at the beginning that are simulated and not compared. 0 if the drive was just enabled or never
    /// moved. A drive that stopped against friction keeps torque in its integrator, which the recording does
    /// not show and the first motion forgets: then cover that first motion and 0.2 s.
    pub lead_in_ticks: usize,
    /// Frequency of a harmonic motion \[Hz\]; `None` for everything else. Only the harmonic figures need it.
    pub harmonic_hz: Option<f64>,
}

impl AxisRecording {
    /// Checks run number `run`, counted from 1.
    pub(super) fn check(&self, run: usize, expected_tick_s: f64) -> Result<(), IdentifyError> {
        let Self { tick_s, command_mm_s, actual_mm, lead_in_ticks, .. } = self;
        if !(tick_s.is_finite() && *tick_s > 0.0) {
            return Err(IdentifyError::Tick { run, tick_s: *tick_s });
        }
        if (tick_s / expected_tick_s - 1.0).abs() > 1e-9 {
            return Err(IdentifyError::DifferentTicks { run, tick_s: *tick_s, expected_s: expected_tick_s });
        }
        let (commands, positions) = (command_mm_s.len(), actual_mm.len());
        if commands != positions {
            return Err(IdentifyError::Lengths { run, commands, positions });
        }
        let ticks = positions.saturating_sub(*lead_in_ticks);
        if ticks < TICKS_MIN {
            return Err(IdentifyError::TooShort { run, ticks, needed: TICKS_MIN });
        }
        for (quantity, values) in [("command_mm_s", command_mm_s), ("actual_mm", actual_mm)] {
            if let Some(tick) = values.iter().position(|value| !value.is_finite()) {
                return Err(IdentifyError::NotFinite { run, quantity, tick, value: values[tick] });
            }
        }
        if let Some(value) = self.harmonic_hz.filter(|hz| !(hz.is_finite() && *hz > 0.0)) {
            return Err(IdentifyError::NotFinite { run, quantity: "harmonic_hz", tick: 0, value });
        }
        Ok(())
    }

    /// The command of an axis at rest \[mm/s\]: what holds it, the trim included.
    pub(super) fn rest_mm_s(&self) -> f64 {
        self.command_mm_s.first().copied().unwrap_or_default()
    }

    /// The position of an axis without any lag at the start of each tick \[mm\].
    pub(super) fn commanded_mm(&self) -> Vec<f64> {
        let mut position_mm = 0.0;
        let travelled = self.command_mm_s.iter().map(|command_mm_s| {
            let before_mm = position_mm;
            position_mm += command_mm_s * self.tick_s;
            before_mm
        });
        travelled.collect()
    }
}

/// Checks that the axis moves at all; in some of the runs friction may hold it.
pub(super) fn check_motion(runs: &[AxisRecording]) -> Result<(), IdentifyError> {
    let (mut travel_mm, mut commanded_mm) = (0.0_f64, 0.0_f64);
    for run in runs {
        let (travelled_mm, asked_mm) = (span(&run.actual_mm), span(&run.commanded_mm()));
        if travelled_mm > 0.0 && travelled_mm >= 0.1 * asked_mm {
            return Ok(());
        }
        (travel_mm, commanded_mm) = (travel_mm.max(travelled_mm), commanded_mm.max(asked_mm));
    }
    Err(IdentifyError::NeverMoved { travel_mm, commanded_mm })
}

/// The difference of the greatest and the smallest value.
pub(super) fn span(values: &[f64]) -> f64 {
    let (least, most) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
    (most - least).max(0.0)
}

/// The encoder's step: the least difference between two readings of the runs \[mm\].
///
/// Differences below a billionth of the travel are the rounding of the numbers, not of an encoder.
pub(super) fn resolution_mm(runs: &[AxisRecording]) -> f64 {
    let floor_mm = 1e-9 * runs.iter().map(|run| span(&run.actual_mm)).fold(0.0, f64::max).max(1e-6);
    let steps = runs.iter().flat_map(|run| run.actual_mm.windows(2)).map(|pair| (pair[1] - pair[0]).abs());
    let least_mm = steps.filter(|&step| step > floor_mm).fold(f64::INFINITY, f64::min);
    if least_mm.is_finite() { least_mm } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> AxisRecording {
        AxisRecording {
            tick_s: 0.5e-3,
            command_mm_s: vec![10.0; 100],
            actual_mm: (0..100).map(|tick| 0.005 * f64::from(tick)).collect(),
            ..AxisRecording::default()
        }
    }

    #[test]
    fn what_cannot_be_evaluated_is_said() {
        let of = |change: &dyn Fn(&mut AxisRecording)| {
            let mut run = recording();
            change(&mut run);
            run.check(2, 0.5e-3)
        };
        assert_eq!(of(&|_| {}), Ok(()));
        assert_eq!(of(&|run| run.tick_s = 0.0), Err(IdentifyError::Tick { run: 2, tick_s: 0.0 }));
        assert_eq!(
            of(&|run| run.tick_s = 1e-3),
            Err(IdentifyError::DifferentTicks { run: 2, tick_s: 1e-3, expected_s: 0.5e-3 })
        );
        assert_eq!(
            of(&|run| run.actual_mm.truncate(99)),
            Err(IdentifyError::Lengths { run: 2, commands: 100, positions: 99 })
        );
        assert_eq!(
            of(&|run| run.lead_in_ticks = 60),
            Err(IdentifyError::TooShort { run: 2, ticks: 40, needed: TICKS_MIN })
        );
        assert_eq!(
            of(&|run| run.actual_mm[7] = f64::INFINITY),
            Err(IdentifyError::NotFinite { run: 2, quantity: "actual_mm", tick: 7, value: f64::INFINITY })
        );
        let mut still = recording();
        still.actual_mm.fill(3.0);
        assert_eq!(check_motion(&[still.clone(), recording()]), Ok(()));
        assert!(matches!(check_motion(&[still]), Err(IdentifyError::NeverMoved { travel_mm: 0.0, .. })));
    }

    #[test]
    fn the_encoder_step_is_the_least_difference() {
        let mut run = recording();
        run.actual_mm = (0..100).map(|tick| 0.001 * f64::from(tick * tick % 7)).collect();
        assert!((resolution_mm(&[run]) - 0.001).abs() < 1e-12);
    }
}
