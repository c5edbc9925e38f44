//! Amplitude and phase of the drive over frequency, open loop: from a step, from harmonics, and of the linear
//! model.
//!
//! The methods agree as long as the drive is linear. A step and a harmonic of the same feed meet the current
//! limit in different ways, and the model has no limit: where the curves part, the limit acts.

use core::f64::consts::TAU;

use super::circle_motion::{Circle, plane_of};
use super::experiment::{DriveError, open_loop};
use super::harmonic::{self, Response};
use super::model;
use super::spectrum::Spectrum;
use super::step::{Step, StepFigures};
use crate::machine::Machine;
use crate::sine::as_lag_rad;

/// Amplitude ratio and phase at a frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Actual over commanded velocity.
    pub ratio: f64,
    /// A lag is negative \[rad\].
    pub phase_rad: f64,
}

/// One frequency by the three methods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodePoint {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// The response from the step's spectrum. It includes the half tick for which the output is held, like
    /// the others.
    pub step: Point,
    /// The response from harmonic motion.
    pub harmonic: Response,
    /// The response of the linear model.
    pub model: Point,
}

/// The curves of one axis.
#[derive(Clone, Debug)]
pub struct Bode {
    /// The axis, from 0.
    pub axis: usize,
    /// Feed of the step and of the harmonics \[mm/s\].
    pub feed_mm_s: f64,
    /// The responses, by frequency.
    pub points: Vec<BodePoint>,
    /// The step's figures.
    pub step: StepFigures,
}

/// Measures the curves of `axis` at the given frequencies, at one feed. `progress` is called after each.
///
/// # Errors
/// The errors of [`Step::measure`] and [`harmonic::measure`].
pub fn measure(
    machine: &Machine,
    axis: usize,
    feed_mm_s: f64,
    frequencies_hz: &[f64],
    progress: &mut dyn FnMut(),
) -> Result<Bode, DriveError> {
    let (step, response) = Step { axis, feed_mm_s, ..Step::reference() }.measure(machine)?;
    let spectrum = response.spectrum();
    let open = open_loop(machine);
    let mut points = Vec::with_capacity(frequencies_hz.len());
    for &frequency_hz in frequencies_hz {
        let circle = Circle { plane: plane_of(axis), ..Circle::new(frequency_hz, feed_mm_s) };
        let found = harmonic::measure(&open, &circle)?;
        let harmonic = found.axes.into_iter().find(|found| found.axis == axis).unwrap_or(found.axes[0]);
        let drive = &machine.axes[axis].drive;
        points.push(BodePoint {
            frequency_hz,
            step: point_of(&spectrum, frequency_hz, machine.tick_s),
            harmonic,
            model: point(model::response(drive, machine.tick_s, frequency_hz)),
        });
        progress();
    }
    Ok(Bode { axis, feed_mm_s, points, step })
}

fn point(response: model::Complex) -> Point {
    Point { ratio: response.magnitude(), phase_rad: as_lag_rad(response.phase_rad()) }
}

/// A harmonic command is held over its ticks, which delays it by half of one; a step is not.
fn point_of(spectrum: &Spectrum, frequency_hz: f64, tick_s: f64) -> Point {
    let found = spectrum.at(frequency_hz);
    let held_rad = 0.5 * TAU * frequency_hz * tick_s;
    Point { ratio: found.magnitude(), phase_rad: as_lag_rad(found.phase_rad() - held_rad) }
}
