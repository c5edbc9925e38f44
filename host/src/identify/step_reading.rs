//! Figures of a velocity step from rest, read off the recording without any model (S4).

use super::differences::Parabolas;
use super::recording::AxisRecording;

/// A step response. Velocities and accelerations come from local parabolas, which have no lag; backward
/// differences, as S4 has them, find delays longer by about half a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReading {
    /// The command stepped to \[mm/s\].
    pub feed_mm_s: f64,
    /// The time from the command's step to where the steepest tangent of the velocity leaves 0 \[s\].
    pub delay_s: f64,
    /// The time from there to where the tangent reaches the final velocity \[s\].
    pub time_constant_s: f64,
    /// The overshoot of the velocity, over its final value.
    pub overshoot: f64,
    /// Time from the command's step to the last time outside of ±0.28 % of the final velocity, which is S4's
    /// ±0.02 m/min at 7.2 m/min \[s\]. `None` if the encoder does not resolve that, or it has not settled
    /// when the command changes again.
    pub settling_s: Option<f64>,
    /// Greatest acceleration \[mm/s²\].
    pub peak_accel_mm_s2: f64,
}

/// S4's ±0.02 m/min at 7.2 m/min.
const SETTLED_BAND: f64 = 0.02 / 7.2;

/// Standing command before a step \[s\].
const REST_S: f64 = 0.03;

/// Standing command after it \[s\].
const CRUISE_S: f64 = 0.1;

/// All steps from rest of a run.
pub(super) fn step_reading(run: &AxisRecording, resolution_mm: f64) -> Vec<StepReading> {
    let (command, rest_mm_s) = (&run.command_mm_s, run.rest_mm_s());
    let (rest, cruise) = (ticks(REST_S, run.tick_s), ticks(CRUISE_S, run.tick_s));
    let mut figures = Vec::new();
    let mut at = rest;
    while at + cruise <= command.len() {
        let feed = command[at];
        let is_step = feed != rest_mm_s && command[at - rest..at].iter().all(|&before| before == rest_mm_s);
        let stands = command[at..].iter().take_while(|&&after| after == feed).count();
        if is_step && stands >= cruise {
            figures.extend(step(run, resolution_mm, at, stands));
        }
        at += stands;
    }
    figures
}

fn ticks(time_s: f64, tick_s: f64) -> usize {
    ((time_s / tick_s) as usize).max(1)
}

fn step(run: &AxisRecording, resolution_mm: f64, at: usize, stands: usize) -> Option<StepReading> {
    let tick_s = run.tick_s;
    let feed = run.command_mm_s[at] - run.rest_mm_s();
    let start = at - ticks(REST_S, tick_s) / 2;
    let readings: Vec<f64> =
        run.actual_mm[start..at + stands].iter().map(|reading| reading * feed.signum()).collect();
    let since_step_s = |index: usize| (index as f64 - (at - start) as f64) * tick_s;
    let steepest = |parabolas: Parabolas| parabolas.of(&readings).max_by(|a, b| a.2.total_cmp(&b.2));

    let (_, _, about_mm_s2) = steepest(Parabolas::over(5e-3, tick_s))?;
    let parabolas = Parabolas::resolving(0.01 * about_mm_s2, resolution_mm, tick_s);
    let (index, velocity, accel) = steepest(parabolas)?;
    let late: Vec<f64> =
        parabolas.of(&readings).map(|(_, v, _)| v).filter(|v| *v > 0.5 * feed.abs()).collect();
    let last = &late[late.len() - late.len() / 4..];
    let final_mm_s = last.iter().sum::<f64>() / last.len() as f64;
    if !(accel > 0.0 && final_mm_s > 0.0) {
        return None;
    }
    let peak = late.iter().copied().fold(0.0, f64::max);
    let band = SETTLED_BAND * final_mm_s;
    let outside = parabolas.of(&readings).filter(|(_, v, _)| (v - final_mm_s).abs() > band).last();
    let is_resolved = 4.0 * parabolas.velocity_error_mm_s(resolution_mm) < band;
    let end = readings.len() - parabolas.half() - 1;
    let settled = outside.filter(|&(index, ..)| is_resolved && index + ticks(0.02, tick_s) < end);
    Some(StepReading {
        feed_mm_s: feed,
        delay_s: since_step_s(index) - velocity / accel,
        time_constant_s: final_mm_s / accel,
        overshoot: (peak / final_mm_s - 1.0).max(0.0),
        settling_s: settled.map(|(index, ..)| since_step_s(index)),
        peak_accel_mm_s2: accel,
    })
}
