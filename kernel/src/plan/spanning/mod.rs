//! Ramps that span blocks.
//!
//! Consumes the same blocks as [`plan`](super::plan()); produces ramps and cruises over path length that begin and end
//! wherever it is best, not at junctions. Every ceiling is kept at every point, and a ramp uses no more than the least
//! limits of all the blocks it crosses.
//!
//! - `intervals`: divides the stretch at the minima of its ceilings;
//! - `ascent`: the ramps up one side of an interval, below its steps;
//! - `ramp_fit`: one of these ramps;
//! - `peak`: the greatest feed of an interval, between its two sides.
//!
//! Works in f64 on slices of the caller, allocates nothing. Time goes with the number of blocks; chains of minima
//! that cannot be reached cost more, up to a bound beyond which there is no such plan.

mod ascent;
mod intervals;
mod peak;
mod ramp_fit;

pub use intervals::Node;

use self::ascent::{Ascent, AscentRamp};
use self::intervals::{Interval, Intervals};
use self::peak::{Sides, lowest_fits};
use super::lookahead::{Block, BlockPlan, PlanError, check};
use crate::law::Ramp;

/// A ramp or a cruise, with its place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedSpan {
    /// Where it starts \[mm\].
    pub start_mm: f64,
    /// Its length \[mm\].
    pub length_mm: f64,
    /// The ramp; a cruise has equal feeds and t₂ = its duration.
    pub ramp: Ramp<f64>,
}

impl FeedSpan {
    /// At one feed > 0 from one position to another.
    pub(super) fn cruise(start_mm: f64, end_mm: f64, feed_mm_s: f64) -> Self {
        let length_mm = end_mm - start_mm;
        Self { start_mm, length_mm, ramp: Ramp::cruise(feed_mm_s, length_mm / feed_mm_s) }
    }
}

/// Places for nodes that are enough for any list of so many blocks.
#[must_use]
pub const fn nodes_for(blocks: usize) -> usize {
    2 * blocks + 2
}

/// Lengths that differ by no more are equal \[mm\].
pub(super) const ROUNDING_MM: f64 = 1.0e-9;

/// Plans a stretch with ramps that may span blocks, and hands every ramp and cruise to `put`, in path order. Returns
/// the time it takes \[s\], or `None` where no such plan was found (one pair of ramps a block may still be possible).
///
/// # Errors
/// A figure is out of range, or `places` is shorter than [`nodes_for`] says.
pub fn plan_spanning(
    blocks: &[Block<f64>],
    start_mm_s: f64,
    end_mm_s: f64,
    places: &mut [Node],
    put: &mut impl FnMut(FeedSpan),
) -> Result<Option<f64>, PlanError> {
    check(blocks, start_mm_s, end_mm_s)?;
    let room = places.len();
    let Some(mut intervals) = Intervals::new(blocks, start_mm_s, end_mm_s, places) else {
        return Err(PlanError::Output { blocks: nodes_for(blocks.len()), plans: room });
    };
    // Several kilobytes each: used for all intervals.
    let (mut up, mut down) = (Ascent::NONE, Ascent::NONE);
    if !intervals.settle(|intervals, interval| lowest_fits(interval, intervals, &mut up, &mut down)) {
        return Ok(None);
    }
    let mut out = Out { at_mm: 0.0, time_s: 0.0, put };
    for interval in intervals.in_order() {
        out.cruise(interval.start_mm, interval.enter_mm_s);
        if drive(&interval, &intervals, &mut up, &mut down, &mut out).is_none() {
            return Ok(None);
        }
    }
    Ok(Some(out.time_s))
}

/// One pair of ramps a block, as [`plan`](super::plan()) found them; returns the time they take \[s\].
pub(crate) fn spans_of(
    blocks: &[Block<f64>],
    plans: &[BlockPlan<f64>],
    put: &mut impl FnMut(FeedSpan),
) -> f64 {
    let mut out = Out { at_mm: 0.0, time_s: 0.0, put };
    let mut end_mm = 0.0;
    for (block, plan) in blocks.iter().zip(plans) {
        end_mm += block.length_mm;
        let rise = Ramp::new(&block.law, plan.enter_mm_s, plan.peak_mm_s);
        let fall = Ramp::new(&block.law, plan.peak_mm_s, plan.exit_mm_s);
        if !rise.is_cruise() {
            out.ramp(&rise);
        }
        out.cruise(end_mm - fall.length_mm(), plan.peak_mm_s);
        if !fall.is_cruise() {
            out.ramp(&fall);
        }
    }
    out.time_s
}

/// Where spans go.
struct Out<'a, F> {
    at_mm: f64,
    time_s: f64,
    put: &'a mut F,
}

impl<F: FnMut(FeedSpan)> Out<'_, F> {
    fn cruise(&mut self, to_mm: f64, feed_mm_s: f64) {
        if to_mm > self.at_mm && feed_mm_s > 0.0 {
            let span = FeedSpan::cruise(self.at_mm, to_mm, feed_mm_s);
            (self.put)(span);
            self.time_s += span.ramp.duration_s();
        }
        self.at_mm = self.at_mm.max(to_mm);
    }

    fn ramp(&mut self, ramp: &Ramp<f64>) {
        let length_mm = ramp.length_mm();
        (self.put)(FeedSpan { start_mm: self.at_mm, length_mm, ramp: *ramp });
        self.time_s += ramp.duration_s();
        self.at_mm += length_mm;
    }
}

/// Up, along and down.
fn drive<F: FnMut(FeedSpan)>(
    interval: &Interval,
    intervals: &Intervals<'_>,
    up: &mut Ascent,
    down: &mut Ascent,
    out: &mut Out<'_, F>,
) -> Option<()> {
    let Some(sides) = Sides::new(interval, intervals) else { return Some(()) };
    let peak = sides.best(up, down)?;
    let mut feed = interval.enter_mm_s;
    for AscentRamp { start_mm, ramp } in up.ramps() {
        out.cruise(interval.start_mm + start_mm, feed);
        out.ramp(ramp);
        feed = ramp.to_mm_s;
    }
    feed = peak;
    for AscentRamp { start_mm, ramp } in down.ramps().rev() {
        let ramp = ramp.reversed();
        out.cruise(interval.end_mm - start_mm - ramp.length_mm(), feed);
        out.ramp(&ramp);
        feed = ramp.to_mm_s;
    }
    out.cruise(interval.end_mm, feed);
    Some(())
}
