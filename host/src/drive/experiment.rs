//! A program on a changed machine, and its recording.
//!
//! Limits of planning protect a machine in production. An experiment asks what the drive itself can do, so it
//! raises them as far as its motion needs. The range of the output stays unchanged.

use std::ops::Range;

use motion_kernel::axis::{Feedforward, Gains};
use motion_kernel::law::Pulse;

use super::AXES;
use crate::gcode::{self, GcodeError};
use crate::identify::IdentifyError;
use crate::machine::{AxisSettings, Machine};
use crate::planning::{Mode, PlanningError, plan_program};
use crate::simulate::{self, RunError, RunOptions};
use crate::trace::{AxisTick, TraceRow, TracedFault};

/// Relative tolerance for comparing feeds and limits in f32.
pub(super) const ROUNDING: f64 = 1e-6;
/// Following error that an open loop may reach \[mm\]: nothing holds the axis to its path.
const OPEN_LOOP_ERROR_MM: f64 = 1000.0;
/// Following error that a closed loop may reach, when it starts at full motion from rest \[mm\].
pub(super) const CLOSED_LOOP_ERROR_MM: f64 = 10.0;
/// Fraction of a counter register's range that a tick may cover, as for machine files: an axis may be twice
/// as fast as its feed while it catches up.
const COUNTER_SHARE: f64 = 0.25;
/// Time between the last measured tick and the end of constant feed \[s\]: set-points may lag the feed.
const END_MARGIN_S: f64 = 0.05;

/// Why an experiment could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// A quantity is out of its range.
    #[error("found {quantity} {value}, expected {expected}")]
    Quantity {
        /// The quantity's name and unit.
        quantity: &'static str,
        /// The value that was given.
        value: f64,
        /// The range.
        expected: String,
    },
    /// The feed is beyond the output of an axis.
    #[error(
        "found a feed of {feed_mm_min} mm/min, expected at most {reachable_mm_min:.1} mm/min, what the ±{limit_v} V \
         of axis {axis} reach"
    )]
    Feed {
        /// The axis's name.
        axis: String,
        /// The feed that was asked for \[mm/min\].
        feed_mm_min: f64,
        /// The greatest feed of the output \[mm/min\].
        reachable_mm_min: f64,
        /// The output's limit \[V\].
        limit_v: f64,
    },
    /// The feed is beyond what the counter register of an axis can follow.
    #[error(
        "found a feed of {feed_mm_min} mm/min, expected at most {most_mm_min:.1} mm/min, what the encoder's register of \
         axis {axis} can follow"
    )]
    Counter {
        /// The axis's name.
        axis: String,
        /// The feed that was asked for \[mm/min\].
        feed_mm_min: f64,
        /// The greatest feed that the register can follow \[mm/min\].
        most_mm_min: f64,
    },
    /// The motion is no program.
    #[error(transparent)]
    Program(#[from] GcodeError),
    /// The motion can't be planned.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The run can't be made.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The run ended in a fault.
    #[error("{experiment}: {}{} in tick {}: {}", .fault.fault, on_axis(.fault), .fault.tick, .fault.detail)]
    Fault {
        /// The experiment.
        experiment: String,
        /// The fault.
        fault: TracedFault,
    },
    /// The planned feed was not held long enough to be measured.
    #[error("{experiment}: found {found_s:.3} s at constant feed, expected {needed_s:.3} s")]
    NotSteady {
        /// The experiment.
        experiment: String,
        /// Time for which the feed was constant \[s\].
        found_s: f64,
        /// Time needed \[s\].
        needed_s: f64,
    },
    /// The axis does not answer like a velocity servo.
    #[error("identification of axis {axis}: {source}")]
    Identification {
        /// The axis's name.
        axis: String,
        /// The value that was found.
        source: IdentifyError,
    },
    /// The axis did not move, so there is nothing to relate.
    #[error("{experiment}: axis {axis} did not move")]
    NoMotion {
        /// The experiment.
        experiment: String,
        /// The axis's name.
        axis: String,
    },
}

fn on_axis(fault: &TracedFault) -> String {
    fault.axis.as_ref().map_or_else(String::new, |axis| format!(" of axis {axis}"))
}

/// Checks a quantity that has to be in `range`, ends included.
pub(super) fn within(quantity: &'static str, value: f64, range: (f64, f64)) -> Result<(), DriveError> {
    if value >= range.0 && value <= range.1 {
        return Ok(());
    }
    let expected = format!("a number from {} to {}", range.0, range.1);
    Err(DriveError::Quantity { quantity, value, expected })
}

/// The feedforward terms of the machine that act.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Terms {
    /// The velocity's only.
    V,
    /// Velocity and acceleration.
    Va,
    /// Velocity, acceleration and jerk.
    Vaj,
    /// Everything the machine has, including lead, tables and the drive's inverse.
    #[default]
    AsIs,
}

impl Terms {
    /// The name in figures and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::V => "V",
            Self::Va => "VA",
            Self::Vaj => "VAJ",
            Self::AsIs => "as is",
        }
    }

    /// `machine` with these terms only, on every axis.
    #[must_use]
    pub fn of(self, machine: &Machine) -> Machine {
        let mut machine = machine.clone();
        for axis in &mut machine.axes {
            let all = axis.feedforward;
            let Feedforward { velocity, accel_s, jerk_s2, .. } = all;
            // The paper's terms only, without lead.
            let vaj = Feedforward { velocity, accel_s, jerk_s2, ..Feedforward::default() };
            axis.feedforward = match self {
                Self::V => Feedforward { accel_s: 0.0, jerk_s2: 0.0, ..vaj },
                Self::Va => Feedforward { jerk_s2: 0.0, ..vaj },
                Self::Vaj => vaj,
                Self::AsIs => all,
            };
        }
        machine
    }
}

/// `machine` without feedback, driven by the velocity feedforward alone, with gain 1 (S4: kp = ki = kd = 0,
/// F_a = F_J = 0).
#[must_use]
pub fn open_loop(machine: &Machine) -> Machine {
    let mut machine = machine.clone();
    for axis in &mut machine.axes {
        axis.gains = Gains::default();
        axis.feedforward = Feedforward { velocity: 1.0, ..Feedforward::default() };
        axis.following_error_limit_mm = OPEN_LOOP_ERROR_MM;
    }
    machine
}

/// The velocity that the encoder's register can follow \[mm/s\].
fn countable_mm_s(axis: &AxisSettings, tick_s: f64) -> f64 {
    let range_counts = match axis.timer {
        hal_sim::TimerBits::Sixteen => f64::from(u16::MAX),
        hal_sim::TimerBits::ThirtyTwo => f64::from(u32::MAX),
    };
    COUNTER_SHARE * range_counts * axis.mm_per_count.abs() / tick_s
}

/// The greatest feed of an experiment that moves all of `axes` \[mm/s\]: what their outputs reach and their
/// encoders can follow.
#[must_use]
pub fn fastest_mm_s(machine: &Machine, axes: &[usize]) -> f64 {
    let of = |axis: &AxisSettings| axis.reachable_mm_s().min(countable_mm_s(axis, machine.tick_s));
    axes.iter().filter_map(|&axis| machine.axes.get(axis)).map(of).fold(f64::INFINITY, f64::min)
}

/// The limits that an experiment's motion needs of a machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demands {
    pub(super) feed_mm_s: f64,
    pub(super) accel_mm_s2: f64,
    pub(super) jerk_mm_s3: f64,
    pub(super) snap_mm_s4: f64,
}

/// `machine` with limits raised to the demands, for motion of `moved` axes.
///
/// # Errors
/// An output or a counter register does not reach the feed.
pub(super) fn raised(machine: &Machine, demands: &Demands, moved: &[usize]) -> Result<Machine, DriveError> {
    let feed_mm_min = demands.feed_mm_s * 60.0;
    for axis in moved.iter().filter_map(|&axis| machine.axes.get(axis)) {
        let reachable_mm_s = axis.reachable_mm_s();
        if demands.feed_mm_s > reachable_mm_s * (1.0 + ROUNDING) {
            return Err(DriveError::Feed {
                axis: axis.name.clone(),
                feed_mm_min,
                reachable_mm_min: reachable_mm_s * 60.0,
                limit_v: axis.output_limit_v,
            });
        }
        let most_mm_s = countable_mm_s(axis, machine.tick_s);
        if demands.feed_mm_s > most_mm_s {
            let axis = axis.name.clone();
            return Err(DriveError::Counter { axis, feed_mm_min, most_mm_min: most_mm_s * 60.0 });
        }
    }
    let mut machine = machine.clone();
    let (path, more) = (&mut machine.path, 1.0 + ROUNDING);
    // What is found from an experiment was proven with the papers' law.
    path.pulse = Pulse::Sin2;
    path.feed_mm_s = path.feed_mm_s.max(demands.feed_mm_s * more);
    path.accel_mm_s2 = path.accel_mm_s2.max(demands.accel_mm_s2);
    path.jerk_mm_s3 = path.jerk_mm_s3.max(demands.jerk_mm_s3);
    path.snap_mm_s4 = path.snap_mm_s4.max(demands.snap_mm_s4);
    // Turns of a circle meet without a step, except for rounding.
    path.accel_step_mm_s2 = path.accel_step_mm_s2.max(demands.accel_mm_s2);
    for axis in &mut machine.axes {
        axis.feed_mm_s = axis.feed_mm_s.max(demands.feed_mm_s * more);
        axis.accel_mm_s2 = axis.accel_mm_s2.max(demands.accel_mm_s2);
        axis.jerk_mm_s3 = axis.jerk_mm_s3.max(demands.jerk_mm_s3);
        axis.snap_mm_s4 = axis.snap_mm_s4.max(demands.snap_mm_s4);
        axis.following_error_limit_mm = axis.following_error_limit_mm.max(CLOSED_LOOP_ERROR_MM);
    }
    Ok(machine)
}

/// A run of an experiment.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The experiment's name, for messages.
    pub experiment: String,
    /// The machine as it ran: gains and limits of the experiment.
    pub machine: Machine,
    /// The feed that was held \[mm/s\].
    pub feed_mm_s: f64,
    /// Every tick, from the first motion on.
    pub ticks: Vec<TraceRow>,
}

impl Recording {
    /// Plans `program` (G-code) for `machine` and runs it.
    ///
    /// # Errors
    /// The program can't be planned or run, or a fault ended it.
    pub fn of(
        experiment: String,
        program: &str,
        machine: Machine,
        feed_mm_s: f64,
    ) -> Result<Self, DriveError> {
        Self::with(&RunOptions::default(), experiment, program, machine, feed_mm_s)
    }

    /// [`Recording::of`] with run options, but without guards: the axis may be driven beyond their bounds.
    ///
    /// # Errors
    /// Those of [`Recording::of`], and a correction that can't be used.
    pub fn with(
        options: &RunOptions<'_>,
        experiment: String,
        program: &str,
        machine: Machine,
        feed_mm_s: f64,
    ) -> Result<Self, DriveError> {
        let program = gcode::read(&experiment, program.as_bytes())?;
        let plan = plan_program(&experiment, &program, &machine, Mode::Spanning)?;
        let mut ticks = Vec::with_capacity((plan.time_s / machine.tick_s) as usize + 2);
        let options = RunOptions { is_unguarded: true, ..*options };
        let summary = simulate::run_with(&options, &plan, &machine, &mut |tick| ticks.push(*tick))?;
        match summary.faults.into_iter().next() {
            Some(fault) => Err(DriveError::Fault { experiment, fault }),
            None => Ok(Self { experiment, machine, feed_mm_s, ticks }),
        }
    }

    /// The control tick \[s\].
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.machine.tick_s
    }

    /// One axis, tick by tick.
    pub fn axis(&self, axis: usize) -> impl DoubleEndedIterator<Item = &AxisTick> + ExactSizeIterator {
        let axis = axis.min(AXES - 1);
        self.ticks.iter().map(move |tick| &tick.axes[axis])
    }

    /// The last `measured_s` at constant feed, which must have been held for `settle_s` before.
    ///
    /// # Errors
    /// The feed was not held that long.
    pub fn steady(&self, settle_s: f64, measured_s: f64) -> Result<Range<usize>, DriveError> {
        let is_steady = |tick: &TraceRow| (tick.v_mm_s - self.feed_mm_s).abs() <= ROUNDING * self.feed_mm_s;
        let from = self.ticks.iter().position(is_steady).unwrap_or(0);
        let to = self.ticks.iter().rposition(is_steady).map_or(0, |last| last + 1);
        let in_ticks = |seconds: f64| (seconds / self.tick_s()).round() as usize;
        let needed = in_ticks(settle_s) + in_ticks(measured_s) + in_ticks(END_MARGIN_S);
        if to.saturating_sub(from) < needed {
            return Err(DriveError::NotSteady {
                experiment: self.experiment.clone(),
                found_s: to.saturating_sub(from) as f64 * self.tick_s(),
                needed_s: needed as f64 * self.tick_s(),
            });
        }
        let end = to - in_ticks(END_MARGIN_S);
        Ok(end - in_ticks(measured_s)..end)
    }

    /// Additional time that a run has to hold its feed, beyond settling and measuring \[s\].
    pub(super) const MARGIN_S: f64 = 2.0 * END_MARGIN_S;
}

/// Rates of change of successive values: one fewer than `values` \[1/s of their unit\].
#[must_use]
pub fn differences(values: &[f64], tick_s: f64) -> Vec<f64> {
    values.windows(2).map(|pair| (pair[1] - pair[0]) / tick_s).collect()
}
