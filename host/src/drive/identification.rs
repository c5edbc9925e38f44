//! The runs of identification, through the kernel.
//!
//! Steps there and back move one axis at a time, circles two. All are open loop, as in S4, so no regulator
//! distorts the drive's response. Only the converter's output and the encoder's readings of each run are
//! used.

use super::AXES;
use super::circle_motion::{Circle, plane_of};
use super::experiment::{DriveError, Recording, fastest_mm_s, open_loop, raised};
use super::step;
use crate::identify::{AxisRecording, Excitation};
use crate::machine::Machine;

/// Revolutions that a circle makes besides those that are measured.
const RAMP_PERIODS: u32 = 6;
/// The part of what a pair of axes reaches that its circles take.
const PAIR_SHARE: f64 = 0.95;

const LETTERS: [&str; AXES] = ["X", "Y", "Z"];

/// What axis `axis` (from 0) reaches \[mm/s\].
///
/// # Errors
/// There is no such axis.
pub fn reach_mm_s(machine: &Machine, axis: usize) -> Result<f64, DriveError> {
    check_axis(axis)?;
    Ok(fastest_mm_s(machine, &[axis]))
}

fn check_axis(axis: usize) -> Result<(), DriveError> {
    super::experiment::within("axis", axis as f64, (0.0, AXES as f64 - 1.0))
}

/// One run of axis `axis` (from 0).
///
/// # Errors
/// There is no such axis, or the run can't be made.
pub fn recording(
    machine: &Machine,
    axis: usize,
    excitation: &Excitation,
) -> Result<AxisRecording, DriveError> {
    check_axis(axis)?;
    let machine = &with_noise_of_its_own(machine, excitation);
    // Steps move this axis, circles another one, too, which may be slower.
    let plane = plane_of(axis);
    let [first, second, _] = plane.axes();
    let in_pairs_mm_s = PAIR_SHARE * fastest_mm_s(machine, &[first, second]);
    let recording = match *excitation {
        Excitation::Steps { feed_mm_s, cruise_s, rest_s } => {
            steps(machine, axis, feed_mm_s, cruise_s, rest_s)?
        }
        Excitation::Harmonic { amplitude_mm_s, frequency_hz, periods } => {
            // Reaching the feed and braking takes some of the periods.
            let measured = periods.saturating_sub(RAMP_PERIODS).max(1);
            let circle = Circle {
                plane,
                settle_s: 0.0,
                measured_s: f64::from(measured) / frequency_hz,
                ..Circle::new(frequency_hz, amplitude_mm_s.min(in_pairs_mm_s))
            };
            circle.record(&open_loop(machine))?
        }
    };
    Ok(of_axis(&recording, axis, excitation.harmonic_hz()))
}

/// A machine of which every run has other noise, as a real one has. The same noise in all of them would count as many errors of one
/// kind.
fn with_noise_of_its_own(machine: &Machine, excitation: &Excitation) -> Machine {
    let run = match *excitation {
        Excitation::Steps { feed_mm_s, .. } => feed_mm_s.to_bits(),
        Excitation::Harmonic { frequency_hz, .. } => frequency_hz.to_bits().rotate_left(1),
    };
    let mut machine = machine.clone();
    for noise in machine.axes.iter_mut().filter_map(|axis| axis.noise.as_mut()) {
        noise.seed ^= run;
    }
    machine
}

/// 0 → feed → 0 → −feed → 0, each change within one tick.
fn steps(
    machine: &Machine,
    axis: usize,
    feed_mm_s: f64,
    cruise_s: f64,
    rest_s: f64,
) -> Result<Recording, DriveError> {
    let machine = raised(&open_loop(machine), &step::demands(feed_mm_s, machine.tick_s), &[axis])?;
    let (letter, feed_mm_min, far_mm) = (LETTERS[axis], feed_mm_s * 60.0, feed_mm_s * cruise_s);
    let program = format!(
        "G21 G90 G61 F{feed_mm_min:.10}\nG4 P{rest_s}\nG1 {letter}{far_mm:.10}\nG4 P{rest_s}\nG1 {letter}0\nG4 P{rest_s}\nM2\n"
    );
    let experiment = format!("steps of axis {} to {feed_mm_min:.1} mm/min", machine.axes[axis].name);
    Recording::of(experiment, &program, machine, feed_mm_s)
}

fn of_axis(recording: &Recording, axis: usize, harmonic_hz: Option<f64>) -> AxisRecording {
    let settings = &recording.machine.axes[axis];
    let mm_s_per_volt = settings.mm_s_at_10_v / 10.0;
    AxisRecording {
        tick_s: recording.tick_s(),
        command_mm_s: recording.axis(axis).map(|tick| tick.out_v * mm_s_per_volt).collect(),
        actual_mm: recording.axis(axis).map(|tick| tick.act_mm).collect(),
        lead_in_ticks: 0,
        harmonic_hz,
    }
}
