//! Harmonic motion: amplitude and phase of the actual against the commanded velocity (S4).
//!
//! Circles of constant feed ask both axes for the same velocity at every frequency. Two amplitudes are read,
//! because they differ as soon as the current limit bends the sine into a triangle: the *swing*, half the
//! distance from the greatest to the least velocity, which is what a plot shows, and the *fundamental*, which
//! a least-squares sine has. A triangle's fundamental is 8/π² of its swing. Set and actual velocities are
//! differences of positions from tick to tick, so the effect of differencing on a sine cancels.

use core::f64::consts::TAU;

use super::HALF_POWER;
use super::circle_motion::Circle;
use super::experiment::{DriveError, Recording, differences};
use crate::machine::Machine;
use crate::sine::{Baseline, as_lag_rad, fit};

/// No phase is given for a velocity below this fraction of the commanded one.
const LEAST_RATIO: f64 = 1e-3;
/// Resolution of a −3 dB frequency \[Hz\].
const RESOLUTION_HZ: f64 = 0.01;

/// One axis at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// The axis, from 0.
    pub axis: usize,
    /// Half the distance from the greatest to the least actual velocity, over the commanded amplitude.
    pub swing_ratio: f64,
    /// Amplitude of the sine in the actual velocity, over the commanded amplitude.
    pub fundamental_ratio: f64,
    /// Phase of that sine against the command \[rad\]; a lag is negative.
    pub phase_rad: f64,
    /// The lag as a time \[s\].
    pub delay_s: f64,
    /// Third harmonic over the fundamental, positive where it makes the velocity more pointed: 0 for a sine,
    /// 1/9 for a triangle.
    pub third_harmonic: f64,
}

/// The responses of both axes at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicFigures {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Feed, the amplitude of the commanded velocities \[mm/s\].
    pub feed_mm_s: f64,
    /// The plane's first axis, then its second.
    pub axes: [Response; 2],
}

/// The amplitude that a bandwidth is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amplitude {
    /// Half the distance from peak to peak.
    Swing,
    /// The fundamental's amplitude.
    Fundamental,
}

impl Response {
    /// The ratio of this amplitude.
    #[must_use]
    pub fn ratio(&self, amplitude: Amplitude) -> f64 {
        match amplitude {
            Amplitude::Swing => self.swing_ratio,
            Amplitude::Fundamental => self.fundamental_ratio,
        }
    }
}

/// Runs the motion on `machine` with its gains and reads it. For an open loop, pass
/// [`open_loop`](super::experiment::open_loop)`(&machine)`.
///
/// # Errors
/// Those of [`Circle::record`]; an axis that does not move.
pub fn measure(machine: &Machine, circle: &Circle) -> Result<HarmonicFigures, DriveError> {
    figures(&circle.record(machine)?, circle)
}

/// Reads a recording of the motion.
///
/// # Errors
/// The feed was not held long enough, or an axis did not move.
pub fn figures(recording: &Recording, circle: &Circle) -> Result<HarmonicFigures, DriveError> {
    let [first, second] = circle.axes();
    Ok(HarmonicFigures {
        frequency_hz: circle.frequency_hz,
        feed_mm_s: circle.feed_mm_s,
        axes: [response(recording, circle, first)?, response(recording, circle, second)?],
    })
}

fn response(recording: &Recording, circle: &Circle, axis: usize) -> Result<Response, DriveError> {
    let ticks = circle.measured(recording)?;
    let tick_s = recording.tick_s();
    let set: Vec<f64> = ticks.iter().map(|tick| tick.axes[axis].set_mm).collect();
    let actual: Vec<f64> = ticks.iter().map(|tick| tick.axes[axis].act_mm).collect();
    let (set, actual) = (differences(&set, tick_s), differences(&actual, tick_s));
    let omega_per_s = TAU * circle.frequency_hz;
    // As many whole periods as possible, so that harmonics and drift do not leak into the sine.
    let period = 1.0 / (circle.frequency_hz * tick_s);
    let periods = ((set.len() as f64 + 0.5) / period).floor().max(1.0);
    let whole = ((periods * period).round() as usize).min(set.len());
    let [set, actual] = [&set[..whole], &actual[..whole]];
    let [commanded, found] = [set, actual].map(|values| fit(values, omega_per_s, tick_s, Baseline::Mean));
    let third = fit(actual, 3.0 * omega_per_s, tick_s, Baseline::Mean);
    if !(commanded.amplitude > 0.0 && found.amplitude > LEAST_RATIO * commanded.amplitude) {
        return Err(DriveError::NoMotion {
            experiment: recording.experiment.clone(),
            axis: recording.machine.axes[axis].name.clone(),
        });
    }
    let (least, greatest) =
        actual.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    let phase_rad = as_lag_rad(found.phase_rad - commanded.phase_rad);
    Ok(Response {
        axis,
        swing_ratio: 0.5 * (greatest - least) / commanded.amplitude,
        fundamental_ratio: found.amplitude / commanded.amplitude,
        phase_rad,
        delay_s: -phase_rad / omega_per_s,
        third_harmonic: third.amplitude / found.amplitude
            * libm::cos(third.phase_rad - 3.0 * found.phase_rad),
    })
}

/// The lowest frequency from `from_hz` to `to_hz` at which an axis of the plane (0: its first) falls below −3
/// dB \[Hz\]; `None` if it does not. Searches in steps of `by_hz`, then by bisection.
///
/// # Errors
/// Those of [`measure`].
pub fn bandwidth(
    machine: &Machine,
    start: &Circle,
    (from_hz, to_hz, by_hz): (f64, f64, f64),
    axis: usize,
    amplitude: Amplitude,
) -> Result<Option<f64>, DriveError> {
    let is_below = |frequency_hz: f64| -> Result<bool, DriveError> {
        let found = measure(machine, &Circle { frequency_hz, ..*start })?;
        Ok(found.axes[axis.min(1)].ratio(amplitude) < HALF_POWER)
    };
    first_crossing((from_hz, to_hz, by_hz), RESOLUTION_HZ, is_below)
}

/// The lowest frequency at which `is_beyond` begins to hold, to `resolution_hz`.
pub(super) fn first_crossing(
    (from_hz, to_hz, by_hz): (f64, f64, f64),
    resolution_hz: f64,
    is_beyond: impl Fn(f64) -> Result<bool, DriveError>,
) -> Result<Option<f64>, DriveError> {
    super::experiment::within("frequency step [Hz]", by_hz, (resolution_hz, 1e3))?;
    let mut low = from_hz;
    if is_beyond(low)? {
        return Ok(None);
    }
    while low < to_hz {
        let mut high = (low + by_hz).min(to_hz);
        if is_beyond(high)? {
            while high - low > resolution_hz {
                let middle = low.midpoint(high);
                if is_beyond(middle)? { high = middle } else { low = middle }
            }
            return Ok(Some(low.midpoint(high)));
        }
        low = high;
    }
    Ok(None)
}

/// The frequency at which a current limit alone makes a triangle of −3 dB out of the velocity \[Hz\]:
/// a/(4·0.707·F), because the velocity crosses from −0.707·F to 0.707·F within half a period at the
/// acceleration a.
#[must_use]
pub fn current_limited_hz(accel_limit_mm_s2: f64, feed_mm_s: f64) -> f64 {
    accel_limit_mm_s2 / (4.0 * HALF_POWER * feed_mm_s)
}
