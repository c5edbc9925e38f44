//! The circle test of S4, closed loop: the distance of the machine from the circle.
//!
//! Everything is read from the encoders over the last second at constant feed. The radius deviation is the
//! distance of the actual point from the centre, less the programmed radius: the contour error δ is its
//! extreme values, the form deviation Δδ their difference. The following error is set less actual position,
//! tick by tick.

use super::circle_motion::Circle;
use super::experiment::{DriveError, Recording};
use super::harmonic::first_crossing;
use crate::machine::Machine;

/// Resolution of the frequency at which the contour error passes a limit \[Hz\].
const RESOLUTION_HZ: f64 = 0.01;

/// The figures of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircleFigures {
    /// The plane's first and second axis, from 0.
    pub axes: [usize; 2],
    /// Turns per second \[Hz\].
    pub frequency_hz: f64,
    /// Feed \[mm/s\].
    pub feed_mm_s: f64,
    /// Radius \[mm\].
    pub radius_mm: f64,
    /// Greatest radius deviation, outwards positive \[µm\].
    pub contour_um_max: f64,
    /// Least radius deviation \[µm\].
    pub contour_um_min: f64,
    /// Greatest |following error| of the plane's first and second axis \[µm\].
    pub following_um: [f64; 2],
}

impl CircleFigures {
    /// Contour error: the greatest |radius deviation| \[µm\].
    #[must_use]
    pub fn contour_um(&self) -> f64 {
        self.contour_um_max.abs().max(self.contour_um_min.abs())
    }

    /// The errors of this circle and those of `other`, in turns \[µm\]: contour error, form deviation, following error of the
    /// first and of the second axis.
    #[must_use]
    pub fn errors_um_beside(&self, other: &Self) -> [f64; 8] {
        [
            self.contour_um(),
            other.contour_um(),
            self.form_um(),
            other.form_um(),
            self.following_um[0],
            other.following_um[0],
            self.following_um[1],
            other.following_um[1],
        ]
    }

    /// Form deviation: greatest less least radius \[µm\].
    #[must_use]
    pub fn form_um(&self) -> f64 {
        self.contour_um_max - self.contour_um_min
    }
}

/// Drives the circle on `machine` with its gains: 3 s to settle, the last second measured.
///
/// # Errors
/// Those of [`Circle::record`].
pub fn measure(machine: &Machine, frequency_hz: f64, feed_mm_s: f64) -> Result<CircleFigures, DriveError> {
    let circle = Circle::new(frequency_hz, feed_mm_s);
    figures(&circle.record(machine)?, &circle)
}

/// Reads a recording of the circle.
///
/// # Errors
/// The feed was not held long enough.
pub fn figures(recording: &Recording, circle: &Circle) -> Result<CircleFigures, DriveError> {
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    for (_, deviation_um) in deviations(recording, circle)? {
        least = least.min(deviation_um);
        greatest = greatest.max(deviation_um);
    }
    let mut following_um = [0.0_f64; 2];
    for tick in circle.measured(recording)? {
        for (greatest, axis) in following_um.iter_mut().zip(circle.axes()) {
            *greatest = greatest.max(tick.axes[axis].err_um.abs());
        }
    }
    Ok(CircleFigures {
        axes: circle.axes(),
        frequency_hz: circle.frequency_hz,
        feed_mm_s: circle.feed_mm_s,
        radius_mm: circle.radius_mm(),
        contour_um_max: greatest,
        contour_um_min: least,
        following_um,
    })
}

/// Angle of the set point, −π to π, and radius deviation of every measured tick \[rad, µm\].
///
/// # Errors
/// The feed was not held long enough.
pub fn deviations(recording: &Recording, circle: &Circle) -> Result<Vec<(f64, f64)>, DriveError> {
    let radius_mm = circle.radius_mm();
    let deviation = |tick: &crate::trace::TraceRow| {
        let (set, actual) = circle.relative_to_centre(&tick.axes);
        (libm::atan2(set[1], set[0]), (libm::hypot(actual[0], actual[1]) - radius_mm) * 1e3)
    };
    Ok(circle.measured(recording)?.iter().map(deviation).collect())
}

fn check_limit(limit_um: f64) -> Result<(), DriveError> {
    super::experiment::within("contour limit [µm]", limit_um, (1e-3, 1e6))
}

/// The lowest frequency in `range_hz` (from, to, steps of the search) at which the contour error passes
/// `limit_um` \[Hz\]; `None` if it does not, or if it is above the limit from the start.
///
/// # Errors
/// Those of [`measure`].
pub fn limit_frequency(
    machine: &Machine,
    feed_mm_s: f64,
    limit_um: f64,
    range_hz: (f64, f64, f64),
) -> Result<Option<f64>, DriveError> {
    check_limit(limit_um)?;
    let is_beyond = |frequency_hz| Ok(measure(machine, frequency_hz, feed_mm_s)?.contour_um() > limit_um);
    first_crossing(range_hz, RESOLUTION_HZ, is_beyond)
}

/// Circles over a list of frequencies, on one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The feedforward terms that acted, in words.
    pub name: &'static str,
    /// The machine as it ran.
    pub machine: Machine,
    /// The circles, by frequency.
    pub circles: Vec<CircleFigures>,
    /// Frequency at which the contour error passes the limit \[Hz\]; `None` if it does not, or if it starts
    /// above it.
    pub limit_hz: Option<f64>,
}

/// Drives the circles of `frequencies_hz` on `machine`, called `name`, and searches `range_hz` for the
/// frequency at which the contour error passes `limit_um`. `progress` is called after each circle of the
/// list.
///
/// # Errors
/// Those of [`measure`].
pub fn sweep(
    machine: Machine,
    name: &'static str,
    feed_mm_s: f64,
    frequencies_hz: &[f64],
    (limit_um, range_hz): (f64, (f64, f64, f64)),
    progress: &mut dyn FnMut(),
) -> Result<Sweep, DriveError> {
    // Before the work.
    check_limit(limit_um)?;
    let mut circles = Vec::with_capacity(frequencies_hz.len());
    for &frequency_hz in frequencies_hz {
        circles.push(measure(&machine, frequency_hz, feed_mm_s)?);
        progress();
    }
    let limit_hz = limit_frequency(&machine, feed_mm_s, limit_um, range_hz)?;
    Ok(Sweep { name, machine, circles, limit_hz })
}
