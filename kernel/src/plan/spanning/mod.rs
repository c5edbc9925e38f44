//! Ramps that span blocks.
//!
//! Consumes the same blocks as [`plan`](super::plan()); produces ramps and cruises over path length that
//! begin and end wherever it is best, not at junctions. Every ceiling is kept at every point, and a ramp
//! stays within the least limits of all blocks it crosses.
//!
//! - `intervals`: divides the stretch at the minima of its ceilings;
//! - `ascent`: the ramps up one side of an interval, below its steps;
//! - `ramp_fit`: one of these ramps;
//! - `peak`: the greatest feed of an interval, between its two sides.
//!
//! Works in f64 on slices of the caller, allocates nothing. Its time is proportional to the number of blocks;
//! chains of minima that can't be reached cost more, up to a bound beyond which there is no spanning plan.

mod ascent;
mod intervals;
mod peak;
mod ramp_fit;

pub use intervals::Node;

use self::ascent::{Ascent, AscentRamp};
use self::intervals::{Interval, Intervals};
use self::peak::{Sides, lowest_fits};
use super::attention::Attention;
use super::two_pass::{Block, PlanError, check};
use crate::law::Ramp;

/// Number of places for nodes that is enough for any list of `blocks` blocks.
#[must_use]
pub const fn nodes_for(blocks: usize) -> usize {
    2 * blocks + 2
}

/// Lengths that differ by no more than this are equal \[mm\].
const ROUNDING_MM: f64 = 1.0e-9;

/// Plans a stretch with ramps that may span blocks, and hands every ramp and cruise to `put` with the place
/// where it starts \[mm\], in path order. Returns the time it takes \[s\], or `None` if no such plan was
/// found: one pair of ramps per block may still be possible.
///
/// # Errors
/// A figure is out of range, or `places` is shorter than [`nodes_for`] says.
pub fn plan_spanning(
    blocks: &[Block<f64>],
    start_mm_s: f64,
    end_mm_s: f64,
    places: &mut [Node],
    put: &mut impl FnMut(f64, &Ramp<f64>),
) -> Result<Option<f64>, PlanError> {
    plan_spanning_unless(&Attention::undivided(), blocks, [start_mm_s, end_mm_s], places, put)
}

/// [`plan_spanning`], given up where something more urgent waits.
pub(super) fn plan_spanning_unless(
    attention: &Attention<'_>,
    blocks: &[Block<f64>],
    [start_mm_s, end_mm_s]: [f64; 2],
    places: &mut [Node],
    put: &mut impl FnMut(f64, &Ramp<f64>),
) -> Result<Option<f64>, PlanError> {
    check(blocks, start_mm_s, end_mm_s)?;
    let room = places.len();
    let Some(mut intervals) = Intervals::new(blocks, start_mm_s, end_mm_s, places, attention) else {
        return Err(PlanError::Room { of: "nodes", needed: nodes_for(blocks.len()), places: room });
    };
    // Several kilobytes each, so used for all intervals.
    let (mut up, mut down) = (Ascent::NONE, Ascent::NONE);
    up.attend(attention);
    down.attend(attention);
    let found = spanned(&mut intervals, &mut up, &mut down, put);
    // What was given up looks as if nothing fitted.
    if attention.is_wanted() { Err(PlanError::GivenUp) } else { Ok(found) }
}

/// The time of the ramps over all intervals \[s\].
fn spanned(
    intervals: &mut Intervals<'_>,
    up: &mut Ascent<'_>,
    down: &mut Ascent<'_>,
    put: &mut impl FnMut(f64, &Ramp<f64>),
) -> Option<f64> {
    if !intervals.settle(|intervals, interval| lowest_fits(interval, intervals, up, down)) {
        return None;
    }
    let mut out = Out { attention: intervals.attention, at_mm: 0.0, time_s: 0.0, put };
    for interval in intervals.in_order() {
        out.cruise(interval.start_mm, interval.enter_mm_s);
        drive(&interval, intervals, up, down, &mut out)?;
    }
    Some(out.time_s)
}

/// The receiver of ramps, and where the next one starts.
struct Out<'a, F> {
    attention: &'a Attention<'a>,
    at_mm: f64,
    time_s: f64,
    put: &'a mut F,
}

impl<F: FnMut(f64, &Ramp<f64>)> Out<'_, F> {
    fn cruise(&mut self, to_mm: f64, feed_mm_s: f64) {
        if to_mm > self.at_mm && feed_mm_s > 0.0 {
            self.put(&Ramp::cruise(feed_mm_s, (to_mm - self.at_mm) / feed_mm_s));
        }
        self.at_mm = self.at_mm.max(to_mm);
    }

    fn ramp(&mut self, ramp: &Ramp<f64>) {
        self.put(ramp);
        self.at_mm += ramp.length_mm();
    }

    fn put(&mut self, ramp: &Ramp<f64>) {
        // To make each ready takes a while; of what is given up nothing is used.
        if !self.attention.is_wanted() {
            (self.put)(self.at_mm, ramp);
        }
        self.time_s += ramp.duration_s();
    }
}

/// Drives an interval: up, along and down.
fn drive<F: FnMut(f64, &Ramp<f64>)>(
    interval: &Interval,
    intervals: &Intervals<'_>,
    up: &mut Ascent<'_>,
    down: &mut Ascent<'_>,
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
