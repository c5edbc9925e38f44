//! Circles of constant feed: R = F/(2πf) (S4 (2)).
//!
//! At constant feed both axes of the circle's plane move as sines, and the amplitude of their velocity is the
//! feed at every frequency. The motion starts at rest on the circle, reaches its feed within about a
//! revolution, settles, and is measured last.

use core::f64::consts::TAU;

use super::AXES;
use super::experiment::{Demands, DriveError, Recording, raised, within};
use crate::gcode::Plane;
use crate::machine::Machine;
use crate::simulate::RunOptions;
use crate::trace::{AxisTick, TraceRow};

/// Revolutions for reaching the feed and for braking from it.
const RAMP_REVOLUTIONS: f64 = 6.0;
/// Relative margin of the limits above what the circle needs: radii are rounded.
const LIMIT_MARGIN: f64 = 1e-3;
/// Least frequency \[Hz\]: a revolution of 20 s.
const FREQUENCY_HZ_MIN: f64 = 0.05;
/// Ticks of a revolution at the greatest frequency.
const TICKS_PER_REVOLUTION_MIN: f64 = 10.0;

/// A circle to be driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Revolutions per second \[Hz\], 0.05 to a tenth of the tick's frequency.
    pub frequency_hz: f64,
    /// Feed \[mm/s\], above 0, within reach of the outputs.
    pub feed_mm_s: f64,
    /// The plane: X and Y, or another pair.
    pub plane: Plane,
    /// Time at constant feed before measuring \[s\]. A bed of 13 Hz and 3 % damping needs 3 s.
    pub settle_s: f64,
    /// Least measured time \[s\]; a whole revolution if that is longer.
    pub measured_s: f64,
}

/// The plane in which an axis is driven: with X or Y the other of the two, with Z X.
#[must_use]
pub fn plane_of(axis: usize) -> Plane {
    if axis == 2 { Plane::Zx } else { Plane::Xy }
}

impl Circle {
    /// 3 s to settle, 1 s to measure, in X and Y.
    #[must_use]
    pub fn new(frequency_hz: f64, feed_mm_s: f64) -> Self {
        Self { frequency_hz, feed_mm_s, plane: Plane::Xy, settle_s: 3.0, measured_s: 1.0 }
    }

    /// R = F/(2πf) (S4 (2)), rounded to the digits of a program \[mm\].
    #[must_use]
    pub fn radius_mm(&self) -> f64 {
        let radius_mm = self.feed_mm_s / (TAU * self.frequency_hz);
        (radius_mm * 1e10).round() / 1e10
    }

    /// The two axes that move: the plane's first, on which the motion starts at its greatest, and its second.
    #[must_use]
    pub fn axes(&self) -> [usize; 2] {
        let [first, second, _] = self.plane.axes();
        [first, second]
    }

    /// Measured time \[s\]: at least one revolution.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        self.measured_s.max(1.0 / self.frequency_hz)
    }

    /// Runs it on `machine`, with the machine's gains and with limits raised as far as needed.
    ///
    /// # Errors
    /// A quantity is out of its range, the machine can't reach the feed, or a fault ended the run.
    pub fn record(&self, machine: &Machine) -> Result<Recording, DriveError> {
        self.record_with(&RunOptions::default(), machine)
    }

    /// [`Circle::record`] with run options. All revolutions are one stretch.
    ///
    /// # Errors
    /// The errors of [`Circle::record`], and a correction that can't be used.
    pub fn record_with(&self, options: &RunOptions<'_>, machine: &Machine) -> Result<Recording, DriveError> {
        self.check(machine.tick_s)?;
        let &Self { frequency_hz, feed_mm_s, plane, .. } = self;
        let machine = raised(machine, &self.demands(machine.path.curve_feed_share), &self.axes())?;
        let [first, second] = self.axes();
        let (letters, offsets) = (["X", "Y", "Z"], ["I", "J", "K"]);
        let select = match plane {
            Plane::Xy => "G17",
            Plane::Zx => "G18",
            Plane::Yz => "G19",
        };
        let held_s = self.settle_s + self.span_s() + Recording::MARGIN_S;
        let revolutions = (held_s * frequency_hz + RAMP_REVOLUTIONS).ceil() as usize;
        // Counter-clockwise from the circle's outermost point on its first axis.
        let revolution = format!(
            "G3 {}0 {}0 {}{:.10} {}0\n",
            letters[first],
            letters[second],
            offsets[first],
            -self.radius_mm(),
            offsets[second],
        );
        let program =
            format!("G21 G90 G61 {select} F{:.10}\n{}M2\n", feed_mm_s * 60.0, revolution.repeat(revolutions));
        let experiment = format!("circles at {frequency_hz} Hz and {} mm/min", feed_mm_s * 60.0);
        Recording::with(options, experiment, &program, machine, feed_mm_s)
    }

    /// Checks that all its quantities are in range, for ticks of `tick_s`.
    ///
    /// # Errors
    /// The first quantity that is not.
    pub fn check(&self, tick_s: f64) -> Result<(), DriveError> {
        let fastest_hz = 1.0 / (TICKS_PER_REVOLUTION_MIN * tick_s);
        within("frequency [Hz]", self.frequency_hz, (FREQUENCY_HZ_MIN, fastest_hz))?;
        within("feed [mm/min]", self.feed_mm_s * 60.0, (1.0, 1e6))?;
        within("settling time [s]", self.settle_s, (0.0, 60.0))?;
        within("measuring time [s]", self.measured_s, (0.0, 60.0))
    }

    /// The limits that a circle needs at constant feed, over the share of them that planning uses.
    fn demands(&self, curve_feed_share: f64) -> Demands {
        let omega_per_s = TAU * self.frequency_hz / curve_feed_share;
        let accel_mm_s2 = self.feed_mm_s / curve_feed_share * omega_per_s * (1.0 + LIMIT_MARGIN);
        let jerk_mm_s3 = accel_mm_s2 * omega_per_s * (1.0 + LIMIT_MARGIN);
        let snap_mm_s4 = jerk_mm_s3 * omega_per_s * (1.0 + LIMIT_MARGIN);
        Demands { feed_mm_s: self.feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4 }
    }

    /// The ticks to measure.
    ///
    /// # Errors
    /// The feed was not held long enough.
    pub fn measured<'run>(&self, recording: &'run Recording) -> Result<&'run [TraceRow], DriveError> {
        Ok(&recording.ticks[recording.steady(self.settle_s, self.span_s())?])
    }

    /// The set and the actual point of a tick, from the circle's centre \[mm\].
    pub(super) fn relative_to_centre(&self, axes: &[AxisTick; AXES]) -> ([f64; 2], [f64; 2]) {
        let [first, second] = self.axes();
        let radius_mm = self.radius_mm();
        (
            [axes[first].set_mm + radius_mm, axes[second].set_mm],
            [axes[first].act_mm + radius_mm, axes[second].act_mm],
        )
    }
}
