//! The velocity step of S4: open loop, the feed jumps from rest within one tick.
//!
//! Time counts from the tick that puts the step out. Delay and time constant are read from the tangent at the
//! steepest rise of the velocity: it crosses 0 at the delay and rises to the step within the time constant.
//! Velocities come from encoder readings. One count in a tick is a coarse velocity (0.2 mm/s at 0.1 µm and
//! 0.5 ms), so velocities are means over [`AVERAGED_S`]; the peaks of acceleration and jerk are plain
//! backward differences, as S4 gives them.

use super::AXES;
use super::experiment::{Demands, DriveError, Recording, differences, open_loop, raised, within};
use super::spectrum::Spectrum;
use crate::machine::Machine;

/// Time over which velocities are averaged \[s\]: rounding of 0.1 µm is then 0.04 mm/s, a thirtieth of a per
/// cent of S4's step, and the overshoot loses half a per cent of itself.
pub const AVERAGED_S: f64 = 0.0025;
/// Time over which the steepest rise is searched \[s\].
const SLOPE_S: f64 = 0.0015;
/// The band in which the velocity counts as settled \[mm/s\]: ±0.02 m/min (S4).
pub const BAND_MM_S: f64 = 20.0 / 60.0;
/// Least output that counts as the step \[V\]: two steps of a 16-bit converter.
const STEP_V_MIN: f64 = 6e-4;
/// Factor of each limit over the one before, from F·f_c of S4 on, with which the ramp is over in less than a
/// tick.
const STEEPNESS: f64 = 100.0;

/// A step to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The axis, from 0.
    pub axis: usize,
    /// Velocity after the step \[mm/s\], 1/60 and more, within reach of the output.
    pub feed_mm_s: f64,
    /// Time for which it is held and recorded \[s\], 0.05 to 60.
    pub duration_s: f64,
}

/// The limits that a step of the feed within one tick needs.
pub(super) fn demands(feed_mm_s: f64, tick_s: f64) -> Demands {
    let steeper = STEEPNESS / tick_s;
    let accel_mm_s2 = feed_mm_s * steeper;
    Demands {
        feed_mm_s,
        accel_mm_s2,
        jerk_mm_s3: accel_mm_s2 * steeper,
        snap_mm_s4: accel_mm_s2 * steeper * steeper,
    }
}

/// The figures of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepFigures {
    /// Dead time by the tangent method \[s\].
    pub delay_s: f64,
    /// Time constant by the tangent method \[s\].
    pub time_constant_s: f64,
    /// Greatest velocity beyond the step, as a part of it; 0 if there is none.
    pub overshoot: f64,
    /// The time when the velocity was last outside ± [`BAND_MM_S`] \[s\]; none if that was at the end of the
    /// recording.
    pub settling_s: Option<f64>,
    /// Greatest second difference of encoder readings \[mm/s²\].
    pub peak_accel_mm_s2: f64,
    /// Greatest third difference of encoder readings \[mm/s³\].
    pub peak_jerk_mm_s3: f64,
    /// −3 dB of the step's spectrum \[Hz\]; `None` if the recording is too short to tell.
    pub bandwidth_hz: Option<f64>,
}

impl Step {
    /// S4's step, to 7.2 m/min, on the first axis.
    #[must_use]
    pub fn reference() -> Self {
        Self { axis: 0, feed_mm_s: 120.0, duration_s: 0.4 }
    }

    /// Runs it on `machine`, open loop: a straight move with limits so high that the feed steps within one
    /// tick.
    ///
    /// # Errors
    /// A quantity is out of its range, the output does not reach the feed, or a fault ended the run.
    pub fn record(&self, machine: &Machine) -> Result<Recording, DriveError> {
        let &Self { axis, feed_mm_s, duration_s } = self;
        within("axis", axis as f64, (0.0, AXES as f64 - 1.0))?;
        within("feed [mm/min]", feed_mm_s * 60.0, (1.0, 1e6))?;
        within("duration [s]", duration_s, (0.05, 60.0))?;
        let machine = raised(&open_loop(machine), &demands(feed_mm_s, machine.tick_s), &[axis])?;
        let (letter, feed_mm_min) = (["X", "Y", "Z"][axis], feed_mm_s * 60.0);
        let program =
            format!("G21 G90 G61 G1 {letter}{:.10} F{feed_mm_min:.10}\nM2\n", feed_mm_s * duration_s);
        let experiment = format!("step of axis {} to {feed_mm_min} mm/min", machine.axes[axis].name);
        Recording::of(experiment, &program, machine, feed_mm_s)
    }

    /// Runs it and reads the figures.
    ///
    /// # Errors
    /// Those of [`Step::record`], and an axis that does not follow.
    pub fn measure(&self, machine: &Machine) -> Result<(StepFigures, StepResponse), DriveError> {
        let recording = self.record(machine)?;
        let response = self.response(&recording);
        match response.figures() {
            Some(figures) => Ok((figures, response)),
            None => Err(DriveError::NoMotion {
                experiment: recording.experiment,
                axis: recording.machine.axes[self.axis].name.clone(),
            }),
        }
    }

    /// The axis' motion from the tick of the step on, as long as the step was held.
    #[must_use]
    pub fn response(&self, recording: &Recording) -> StepResponse {
        let rest_v = recording.machine.axes[self.axis].output_offset_v;
        let is_step = |tick: &crate::trace::AxisTick| (tick.out_v - rest_v).abs() > STEP_V_MIN;
        let first = recording.axis(self.axis).position(is_step).unwrap_or(0);
        let held = recording.axis(self.axis).rposition(is_step).map_or(0, |last| last + 1);
        let positions_mm =
            recording.ticks[first..held.max(first)].iter().map(|tick| tick.axes[self.axis].act_mm).collect();
        StepResponse { feed_mm_s: self.feed_mm_s, tick_s: recording.tick_s(), positions_mm }
    }
}

/// Encoder readings from the tick of the step on.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResponse {
    /// The step \[mm/s\].
    pub feed_mm_s: f64,
    /// The control tick \[s\].
    pub tick_s: f64,
    /// A reading per tick \[mm\]; the first is that of the tick which put the step out.
    pub positions_mm: Vec<f64>,
}

impl StepResponse {
    /// A time in ticks, at least one.
    fn ticks(&self, seconds: f64) -> usize {
        ((seconds / self.tick_s).round() as usize).max(1)
    }

    /// Velocities over `ticks` ticks: the time in the middle of each, with the half tick of a backward
    /// difference stamped with its end, and the velocity \[s, mm/s\].
    fn velocities_over(&self, ticks: usize) -> Vec<(f64, f64)> {
        let span_s = ticks as f64 * self.tick_s;
        let middle = |index: usize| (index as f64 + 0.5 * ticks as f64 + 0.5) * self.tick_s;
        let mean = |(index, pair): (usize, &[f64])| (middle(index), (pair[ticks] - pair[0]) / span_s);
        self.positions_mm.windows(ticks + 1).enumerate().map(mean).collect()
    }

    /// Averaged velocities: time and velocity \[s, mm/s\].
    #[must_use]
    pub fn velocities(&self) -> Vec<(f64, f64)> {
        self.velocities_over(self.ticks(AVERAGED_S))
    }

    /// Differences of neighbouring encoder readings: velocity, acceleration and jerk \[mm/s, mm/s², mm/s³\].
    /// Each begins with the tick after the step.
    #[must_use]
    pub fn rates(&self) -> [Vec<f64>; 3] {
        let velocity = differences(&self.positions_mm, self.tick_s);
        // At rest before the step.
        let after_rest = |rates: &[f64]| {
            let with_rest: Vec<f64> = core::iter::once(0.0).chain(rates.iter().copied()).collect();
            differences(&with_rest, self.tick_s)
        };
        let accel = after_rest(&velocity);
        let jerk = after_rest(&accel);
        [velocity, accel, jerk]
    }

    /// Its frequency response.
    #[must_use]
    pub fn spectrum(&self) -> Spectrum {
        Spectrum::new(&differences(&self.positions_mm, self.tick_s), self.tick_s)
    }

    /// The figures; `None` if the axis did not move in the direction of the step.
    #[must_use]
    pub fn figures(&self) -> Option<StepFigures> {
        let velocities = self.velocities();
        let slope_ticks = self.ticks(SLOPE_S);
        let mut steepest = (0.0, 0.0, 0.0);
        for span in velocities.windows(slope_ticks + 1) {
            let (from, to) = (span[0], span[slope_ticks]);
            let slope_mm_s2 = (to.1 - from.1) / (to.0 - from.0);
            if slope_mm_s2 > steepest.0 {
                let mean = span.iter().map(|point| point.1).sum::<f64>() / span.len() as f64;
                steepest = (slope_mm_s2, from.0.midpoint(to.0), mean);
            }
        }
        let (slope_mm_s2, at_s, velocity_mm_s) = steepest;
        if !(slope_mm_s2 > 0.0) {
            return None;
        }
        let greatest_mm_s = velocities.iter().map(|point| point.1).fold(0.0, f64::max);
        let outside = velocities.iter().rposition(|point| (point.1 - self.feed_mm_s).abs() > BAND_MM_S);
        let settling_s = match outside {
            None => Some(0.0),
            Some(last) if last + 1 == velocities.len() => None,
            Some(last) => Some(velocities[last].0),
        };
        let [_, accel, jerk] = self.rates();
        let greatest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        Some(StepFigures {
            delay_s: at_s - velocity_mm_s / slope_mm_s2,
            time_constant_s: self.feed_mm_s / slope_mm_s2,
            overshoot: (greatest_mm_s / self.feed_mm_s - 1.0).max(0.0),
            settling_s,
            peak_accel_mm_s2: greatest(&accel),
            peak_jerk_mm_s3: greatest(&jerk),
            bandwidth_hz: self.spectrum().passes(super::HALF_POWER),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A velocity that waits 2 ms and rises straight within 10 ms to 100 mm/s, by its readings.
    #[test]
    fn a_straight_rise_is_its_own_tangent() {
        let tick_s = 5e-4;
        let position = |tick: u32| {
            let t = (f64::from(tick) * tick_s - 0.002).max(0.0);
            if t < 0.01 { 0.5 * 1e4 * t * t } else { 0.5 + 100.0 * (t - 0.01) }
        };
        let positions_mm = (0..200).map(position).collect();
        let response = StepResponse { feed_mm_s: 100.0, tick_s, positions_mm };
        let found = response.figures().expect("figures");
        // A backward difference is stamped with its end, half a tick late.
        assert!((found.delay_s - 0.002_25).abs() < 1e-9, "{found:?}");
        assert!((found.time_constant_s - 0.01).abs() < 1e-9);
        assert!(found.overshoot.abs() < 1e-9 && found.settling_s.is_some());
        assert!((found.peak_accel_mm_s2 - 1e4).abs() < 1e-3);
        let still = StepResponse { positions_mm: vec![0.0; 100], ..response };
        assert_eq!(still.figures(), None);
    }
}
