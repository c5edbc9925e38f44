//! Harmonic motion under a growing load: the velocity turns triangular, the acceleration flat (S4).
//!
//! Where the current limit acts, the acceleration stays at what the limit gives the load. This plateau gives
//! the admissible acceleration, or the load that a motion admits. Only a simulated machine changes its load
//! on request.

use super::circle_motion::Circle;
use super::experiment::{DriveError, Recording, open_loop};
use super::harmonic::{self, Response};
use crate::machine::Machine;

/// Time over which accelerations are averaged \[s\]: second differences of readings are coarse.
const AVERAGED_S: f64 = 0.005;
/// Least share of the time for which a triangular velocity, except at its corners, holds the plateau.
const PLATEAU_SHARE: f64 = 0.5;
/// The third harmonic from which the velocity counts as a triangle. A triangle has 1/9, a sine none.
const TRIANGLE_FROM: f64 = 0.03;

/// An axis under one load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertiaFigures {
    /// Added inertia over the unloaded axis's \[1\].
    pub load_inertia_ratio: f64,
    /// Amplitude, phase and third harmonic of the velocity.
    pub response: Response,
    /// Greatest |acceleration| \[mm/s²\].
    pub peak_accel_mm_s2: f64,
    /// The |acceleration| that is exceeded half of the time \[mm/s²\]: the plateau's, if there is one.
    pub plateau_accel_mm_s2: f64,
    /// The velocity is triangular: the current limit acts.
    pub is_limited: bool,
}

/// `machine` with the first axis of the motion under a load.
#[must_use]
pub fn loaded(machine: &Machine, axis: usize, load_inertia_ratio: f64) -> Machine {
    let mut machine = machine.clone();
    if let Some(axis) = machine.axes.get_mut(axis) {
        axis.drive.load_inertia_ratio = load_inertia_ratio;
    }
    machine
}

/// Runs the motion in open loop with one axis of its plane under the load.
///
/// # Errors
/// A load is below 0 or above 1000; otherwise as [`harmonic::measure`].
pub fn measure(
    machine: &Machine,
    circle: &Circle,
    axis: usize,
    load_inertia_ratio: f64,
) -> Result<(InertiaFigures, Recording), DriveError> {
    super::experiment::within("load inertia ratio", load_inertia_ratio, (0.0, 1000.0))?;
    let recording = circle.record(&open_loop(&loaded(machine, axis, load_inertia_ratio)))?;
    let figures = harmonic::figures(&recording, circle)?;
    let response = figures.axes.into_iter().find(|found| found.axis == axis).unwrap_or(figures.axes[0]);
    let mut accel: Vec<f64> =
        accelerations(&recording, circle, response.axis)?.into_iter().map(|(_, a)| a.abs()).collect();
    accel.sort_unstable_by(f64::total_cmp);
    let at_share = |share: f64| {
        let last = accel.len().saturating_sub(1);
        accel.get((share * last as f64) as usize).copied().unwrap_or(0.0)
    };
    let found = InertiaFigures {
        load_inertia_ratio,
        response,
        peak_accel_mm_s2: at_share(1.0),
        plateau_accel_mm_s2: at_share(PLATEAU_SHARE),
        is_limited: response.third_harmonic > TRIANGLE_FROM,
    };
    Ok((found, recording))
}

/// Accelerations over the measured time, from second differences of encoder readings \[s, mm/s²\].
///
/// # Errors
/// The feed was not held long enough.
pub fn accelerations(
    recording: &Recording,
    circle: &Circle,
    axis: usize,
) -> Result<Vec<(f64, f64)>, DriveError> {
    let ticks = circle.measured(recording)?;
    let tick_s = recording.tick_s();
    let half = ((0.5 * AVERAGED_S / tick_s).round() as usize).max(1);
    let span_s = half as f64 * tick_s;
    let accel = |(index, part): (usize, &[crate::trace::TraceRow])| {
        let [a, b, c] = [0, half, 2 * half].map(|at| part[at].axes[axis].act_mm);
        ((index + half) as f64 * tick_s, (c - b - (b - a)) / (span_s * span_s))
    };
    Ok(ticks.windows(2 * half + 1).enumerate().map(accel).collect())
}
