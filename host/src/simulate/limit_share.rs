//! On how much of the path some limit holds the motion back.
//!
//! Consumes the executed ticks; produces the share of the path length on which the feed is at its block's
//! ceiling, or acceleration, jerk or snap, as vectors of the linear axes or of an axis, are at their limit. The
//! rest of the length is what a better plan could still gain on. A sin² pulse touches the limits of jerk and
//! snap only at the top of its curves, so that ramps count for little; one with a plateau holds its jerk
//! there, so that only its edges do not count. A plan that wastes nothing is still below 1.

use super::job::RunInfo;
use crate::trace::{TraceRow, TracedBlock};

/// At this part of itself a limit counts as reached.
const REACHED: f64 = 0.98;
/// Positions are rounded \[mm\].
const ROUNDING_MM: f64 = 1.0e-9;

/// Collects ticks.
pub(super) struct LimitShare<'run, const N: usize> {
    info: &'run RunInfo,
    /// Which places have linear axes, and whether all axes are: only then snap along the path tells of its limit, as rotary
    /// axes may make the path longer than the limit counts.
    linear: [bool; N],
    is_linear: bool,
    /// Blocks that do not end before the latest tick.
    blocks: &'run [TracedBlock],
    limited_mm: f64,
    length_mm: f64,
}

impl<'run, const N: usize> LimitShare<'run, N> {
    pub(super) fn new(info: &'run RunInfo) -> Self {
        let (linear, is_linear) = (info.linear_places(), !info.has_rotary_axis());
        Self { info, linear, is_linear, blocks: &info.blocks, limited_mm: 0.0, length_mm: 0.0 }
    }

    pub(super) fn add(&mut self, tick: &TraceRow<N>) {
        let ends_before = |block: &&TracedBlock| block.start_mm + block.length_mm < tick.s_mm - ROUNDING_MM;
        self.blocks = &self.blocks[self.blocks.iter().take_while(ends_before).count()..];
        let step_mm = tick.v_mm_s * self.info.tick_s;
        self.length_mm += step_mm;
        if self.is_limited(tick) {
            self.limited_mm += step_mm;
        }
    }

    fn is_limited(&self, tick: &TraceRow<N>) -> bool {
        let path = &self.info.limits;
        let reached = |value: f64, limit: f64| value.abs() >= REACHED * limit;
        let vector = |of: fn(&crate::trace::AxisTick) -> f64| {
            let axes = tick.axes.iter().zip(self.linear).filter(|(_, is_linear)| *is_linear);
            axes.map(|(axis, _)| of(axis).powi(2)).sum::<f64>().sqrt()
        };
        self.blocks.first().is_some_and(|block| reached(tick.v_mm_s, block.cap_mm_s))
            || reached(vector(|axis| axis.acc_mm_s2), path.accel_mm_s2)
            || reached(vector(|axis| axis.jerk_mm_s3), path.jerk_mm_s3)
            || self.is_linear && reached(tick.snap_mm_s4, path.snap_mm_s4)
            || tick.axes.iter().zip(&self.info.axes).any(|(axis, limits)| {
                reached(axis.vel_mm_s, limits.feed_mm_s)
                    || reached(axis.acc_mm_s2, limits.accel_mm_s2)
                    || reached(axis.jerk_mm_s3, limits.jerk_mm_s3)
            })
    }

    /// From 0 to 1; 0 if nothing moved.
    pub(super) fn share(&self) -> f64 {
        if self.length_mm > 0.0 { self.limited_mm / self.length_mm } else { 0.0 }
    }
}
