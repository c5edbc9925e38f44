//! The figures of a run, from one pass over its ticks.

use std::collections::BTreeSet;

use crate::axis_unit::AxisUnit;
use crate::trace::{RunEnd, RunTrace, TraceRow};

/// A path counts as finished when less than this is left of it \[mm\]. Far above rounding, far below any
/// tolerance.
const FINISHED_WITHIN_MM: f64 = 1e-3;

/// An axis counts as moved when its set position spans more than this \[mm\].
const MOVED_BEYOND_MM: f64 = 1e-6;

/// The part of the feed below which an axis stands still compared with the others.
const STILL_PART: f64 = 1e-3;

/// How the run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Nothing ran.
    Empty,
    /// The whole path was run, without a fault.
    Done,
    /// No fault, but something stopped the run before the end of its program.
    Unfinished,
    /// At least one fault was latched.
    Faulted,
}

/// Smallest and largest of the finite values seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Smallest value.
    pub(super) low: f64,
    /// Largest value.
    pub(super) high: f64,
}

impl Default for Span {
    fn default() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY }
    }
}

impl Span {
    /// Takes a value in, if it is finite.
    pub(super) fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
        }
    }

    /// Largest magnitude, 0 if nothing was seen.
    pub(super) fn magnitude(self) -> f64 {
        if self.is_empty() { 0.0 } else { self.low.abs().max(self.high.abs()) }
    }

    /// Largest minus smallest, 0 if nothing was seen.
    pub(super) fn width(self) -> f64 {
        if self.is_empty() { 0.0 } else { self.high - self.low }
    }

    /// Whether no finite value was seen.
    pub(super) fn is_empty(self) -> bool {
        self.low > self.high
    }
}

/// A stretch of time in which the program, or a command, lets the machine stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rest {
    /// "dwell", "stopped" or "held".
    pub(super) state: &'static str,
    /// Begin \[s\].
    pub(super) from_s: f64,
    /// End \[s\].
    pub(super) to_s: f64,
}

/// Figures of one axis. Of a rotary one read ° for mm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisSummary {
    /// Set position \[mm\].
    pub(super) set_mm: Span,
    /// Set velocity \[mm/s\].
    pub(super) vel_mm_s: Span,
    /// Following error \[µm\].
    pub(super) err_um: Span,
    /// Root mean square of the following error \[µm\].
    pub(super) err_um_rms: f64,
    /// Output \[V\].
    pub(super) out_v: Span,
}

impl AxisSummary {
    /// Whether the program moved the axis.
    pub(super) fn moved(&self) -> bool {
        self.set_mm.width() > MOVED_BEYOND_MM
    }
}

/// Figures of the whole run.
#[derive(Clone, Debug)]
pub(super) struct Summary {
    /// How it ended.
    pub(super) outcome: Outcome,
    /// Ticks times their length \[s\].
    pub(super) executed_time_s: f64,
    /// Length of the planned path \[mm\].
    pub(super) path_length_mm: f64,
    /// How far along it the run came \[mm\].
    pub(super) path_done_mm: f64,
    /// Feed \[mm/s\].
    pub(super) feed_mm_s: Span,
    /// Acceleration along the path \[mm/s²\].
    pub(super) accel_mm_s2: Span,
    /// Jerk along the path \[mm/s³\].
    pub(super) jerk_mm_s3: Span,
    /// Snap along the path \[mm/s⁴\].
    pub(super) snap_mm_s4: Span,
    /// Contour error \[µm\]; empty without linear axes.
    pub(super) contour_um: Span,
    /// Dwells and program stops, in order.
    pub(super) rests: Vec<Rest>,
    /// Per axis that there is.
    pub(super) axes: Vec<AxisSummary>,
    /// The linear axes.
    pub(super) linear: Vec<usize>,
    /// Pairs of linear axes that at some time moved together, while those before them stood; but for pairs with the
    /// first.
    pub(super) moved_together: BTreeSet<(usize, usize)>,
    /// Values in the trace that are not finite and can therefore not be shown.
    pub(super) not_finite: u64,
}

impl Summary {
    /// Reads a trace once.
    pub(super) fn of<const N: usize>(trace: &RunTrace<N>) -> Self {
        let mut path = [Span::default(); 4];
        let mut axes = vec![AxisSummary::default(); trace.axes.len()];
        let mut squares = vec![(0.0, 0u64); axes.len()];
        let mut done_mm = Span::default();
        let mut contour_um = Span::default();
        let units = trace.axes.iter().enumerate();
        let mut linear: Vec<usize> =
            units.filter(|(_, axis)| axis.unit() == AxisUnit::Millimetre).map(|(index, _)| index).collect();
        // X, Y and Z before U, V and W, whatever the order of the machine.
        linear.sort_by_key(|&index| trace.axes[index].letter);
        let mut moved_together = BTreeSet::new();
        let mut not_finite = 0;
        for tick in &trace.ticks {
            done_mm.add(tick.s_mm);
            if !linear.is_empty() {
                contour_um.add(tick.contour_um);
            }
            not_finite += u64::from(!tick.contour_um.is_finite());
            let still = |axis: usize| tick.axes[axis].vel_mm_s.abs() <= STILL_PART * tick.v_mm_s.abs();
            let first_moving = linear.iter().position(|&axis| !still(axis));
            if let Some(place) = first_moving.filter(|&place| place > 0) {
                let others = linear[place + 1..].iter().filter(|&&axis| !still(axis));
                moved_together.extend(others.map(|&axis| (linear[place], axis)));
            }
            for (span, value) in path.iter_mut().zip(along_path(tick)) {
                span.add(value);
                not_finite += u64::from(!value.is_finite());
            }
            for ((axis, square), value) in axes.iter_mut().zip(&mut squares).zip(&tick.axes) {
                axis.set_mm.add(value.set_mm);
                axis.vel_mm_s.add(value.vel_mm_s);
                axis.err_um.add(value.err_um);
                axis.out_v.add(value.out_v);
                if value.err_um.is_finite() {
                    *square = (square.0 + value.err_um * value.err_um, square.1 + 1);
                }
                let shown = [value.set_mm, value.err_um, value.out_v];
                not_finite += shown.iter().filter(|v| !v.is_finite()).count() as u64;
            }
        }
        for (axis, (sum, number)) in axes.iter_mut().zip(squares) {
            axis.err_um_rms = if number > 0 { (sum / number as f64).sqrt() } else { 0.0 };
        }
        let path_length_mm = trace.blocks.iter().map(|block| block.length_mm).sum();
        let path_done_mm = if done_mm.is_empty() { 0.0 } else { done_mm.high };
        let outcome = if !trace.faults.is_empty() {
            Outcome::Faulted
        } else if trace.ticks.is_empty() {
            Outcome::Empty
        } else if trace.end != RunEnd::Finished || path_done_mm < path_length_mm - FINISHED_WITHIN_MM {
            Outcome::Unfinished
        } else {
            Outcome::Done
        };
        let [feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4] = path;
        Self {
            outcome,
            executed_time_s: trace.ticks.len() as f64 * trace.tick_s,
            path_length_mm,
            path_done_mm,
            feed_mm_s,
            accel_mm_s2,
            jerk_mm_s3,
            snap_mm_s4,
            contour_um,
            rests: rests(trace),
            axes,
            linear,
            moved_together,
            not_finite,
        }
    }
}

/// Dwells, program stops and holds: ticks that follow each other in one of these states.
fn rests<const N: usize>(trace: &RunTrace<N>) -> Vec<Rest> {
    let mut rests = Vec::new();
    for ticks in trace.ticks.chunk_by(|a, b| a.state == b.state) {
        let [first, ..] = ticks else { continue };
        if ["dwell", "stopped", "held"].contains(&first.state) {
            let from_s = first.tick as f64 * trace.tick_s;
            let to_s = from_s + ticks.len() as f64 * trace.tick_s;
            rests.push(Rest { state: first.state, from_s, to_s });
        }
    }
    rests
}

/// Feed and its three derivatives.
fn along_path<const N: usize>(tick: &TraceRow<N>) -> [f64; 4] {
    [tick.v_mm_s, tick.a_mm_s2, tick.j_mm_s3, tick.snap_mm_s4]
}
