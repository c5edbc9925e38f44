//! Figures of a run, collected tick by tick.

use super::probing::Probed;
use crate::axis_unit::AxisUnit;
use crate::gcode::Axis;
use crate::trace::{RunEnd, TraceRow, TracedCommand, TracedFault, TracedSwitch};

/// The figures of a run.
#[derive(Clone, Debug, Default)]
pub struct RunSummary {
    /// How it ended.
    pub end: RunEnd,
    /// How far it came along the path \[mm\].
    pub reached_mm: f64,
    /// The G-code line that it came to, from 1; 0 if it did not move.
    pub reached_line: u32,
    /// Ticks from the first motion to the end of the program.
    pub ticks: u64,
    /// Control tick \[s\].
    pub tick_s: f64,
    /// Duration of the plan, dwells included, stops not \[s\].
    pub planned_time_s: f64,
    /// Executed duration, dwells included, stops and the ticks in which outputs were switched not \[s\].
    pub time_s: f64,
    /// Path length \[mm\].
    pub path_length_mm: f64,
    /// Greatest feed \[mm/s\].
    pub max_feed_mm_s: f64,
    /// Greatest |acceleration| along the path \[mm/s²\].
    pub max_accel_mm_s2: f64,
    /// Greatest |jerk| along the path \[mm/s³\].
    pub max_jerk_mm_s3: f64,
    /// Greatest |snap| along the path \[mm/s⁴\].
    pub max_snap_mm_s4: f64,
    /// Share of the path length on which some limit holds the motion back: the feed is at its block's
    /// ceiling, or acceleration, jerk or snap of the path or of an axis at 98 % of their limit or more.
    pub limit_active_share: f64,
    /// Per axis that there is.
    pub axes: Vec<AxisSummary>,
    /// Greatest distance of the linear axes' actual position from the programmed path \[µm\].
    pub contour_error_um_max: f64,
    /// Commands of live control that were given, in order.
    pub commands: Vec<TracedCommand>,
    /// Commands of the script that were not given, because the run ended before their ticks: `TICK:COMMAND`.
    pub unreached: Vec<String>,
    /// What came of probing moves, in order; those that the run did not come to are left out.
    pub probes: Vec<Probed>,
    /// Switches of spindle and coolant, in order.
    pub outputs: Vec<TracedSwitch>,
    /// Faults, in order.
    pub faults: Vec<TracedFault>,
    /// What was accepted and not acted on, and how the run was made.
    pub notices: Vec<String>,
}

/// The figures of one axis. Of a rotary one read m° for µm.
#[derive(Clone, Debug)]
pub struct AxisSummary {
    /// Name.
    pub name: String,
    /// The axis of a program that moves it.
    pub letter: Axis,
    /// Greatest |following error| \[µm\].
    pub following_error_um_max: f64,
    /// Root of the mean square of the following error \[µm\].
    pub following_error_um_rms: f64,
    /// Set − actual position after settling \[counts\].
    pub end_error_counts: i64,
    /// Greatest |output| \[V\].
    pub output_v_max: f64,
}

impl AxisSummary {
    /// Of an axis that has not run.
    pub(super) fn new(name: &str, letter: Axis) -> Self {
        Self {
            name: name.to_owned(),
            letter,
            following_error_um_max: 0.0,
            following_error_um_rms: 0.0,
            end_error_counts: 0,
            output_v_max: 0.0,
        }
    }

    /// What the axis counts.
    #[must_use]
    pub fn unit(&self) -> AxisUnit {
        AxisUnit::of(self.letter)
    }
}

/// Collects ticks into figures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collector<const N: usize> {
    max: [f64; 4],
    error_um_max: [f64; N],
    error_um_square_sum: [f64; N],
    output_v_max: [f64; N],
    contour_um_max: f64,
    reached_mm: f64,
    reached_line: u32,
    ticks: u64,
}

impl<const N: usize> Collector<N> {
    /// Before the first tick.
    pub(super) fn new() -> Self {
        Self {
            max: [0.0; 4],
            error_um_max: [0.0; N],
            error_um_square_sum: [0.0; N],
            output_v_max: [0.0; N],
            contour_um_max: 0.0,
            reached_mm: 0.0,
            reached_line: 0,
            ticks: 0,
        }
    }

    /// Ticks so far.
    pub(super) fn ticks(&self) -> u64 {
        self.ticks
    }

    pub(super) fn add(&mut self, tick: &TraceRow<N>) {
        self.ticks += 1;
        let along = [tick.v_mm_s, tick.a_mm_s2, tick.j_mm_s3, tick.snap_mm_s4];
        for (max, value) in self.max.iter_mut().zip(along) {
            *max = max.max(value.abs());
        }
        for (index, axis) in tick.axes.iter().enumerate() {
            self.error_um_max[index] = self.error_um_max[index].max(axis.err_um.abs());
            self.error_um_square_sum[index] += axis.err_um * axis.err_um;
            self.output_v_max[index] = self.output_v_max[index].max(axis.out_v.abs());
        }
        self.contour_um_max = self.contour_um_max.max(tick.contour_um);
        self.reached_mm = self.reached_mm.max(tick.s_mm);
        // At rest between two stretches there is none.
        self.reached_line = if tick.line > 0 { tick.line } else { self.reached_line };
    }

    pub(super) fn fill(&self, summary: &mut RunSummary) {
        summary.ticks = self.ticks;
        [summary.max_feed_mm_s, summary.max_accel_mm_s2, summary.max_jerk_mm_s3, summary.max_snap_mm_s4] =
            self.max;
        summary.contour_error_um_max = self.contour_um_max;
        (summary.reached_mm, summary.reached_line) = (self.reached_mm, self.reached_line);
        for (index, axis) in summary.axes.iter_mut().enumerate() {
            axis.following_error_um_max = self.error_um_max[index];
            axis.following_error_um_rms = (self.error_um_square_sum[index] / self.ticks.max(1) as f64).sqrt();
            axis.output_v_max = self.output_v_max[index];
        }
    }
}
