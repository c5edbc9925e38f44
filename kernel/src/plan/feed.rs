//! Planned blocks as feed segments.
//!
//! Consumes a block's plan and its exact start and end on the path; produces up to three segments
//! that fill it without a gap of a single position step: accelerate, cruise, brake.

use super::lookahead::{Block, BlockPlan};
use crate::law::{FeedSegment, Ramp, SegmentError};
use crate::num::{Real, Root};
use crate::units::Position;

/// The segments of one block from path position `start` to `end`, in order; `None` where the block
/// has no such part.
///
/// # Errors
/// The positions do not fit the block's length, or a figure is beyond the tick's range.
pub fn segments<R: Real, P: Root>(
    block: &Block<P>,
    plan: &BlockPlan<P>,
    start: Position,
    end: Position,
    tick_s: f64,
) -> Result<[Option<FeedSegment<R>>; 3], SegmentError> {
    let rise = Ramp::new(&block.law, plan.enter_mm_s, plan.peak_mm_s);
    let fall = Ramp::new(&block.law, plan.peak_mm_s, plan.exit_mm_s);
    let rounded = |ramp: &Ramp<P>| {
        let mm = ramp.length_mm().to_f64();
        Position::from_mm(mm).ok_or(SegmentError::OutOfRange { quantity: "ramp length [mm]", value: mm })
    };
    let top = start + rounded(&rise)?;
    let brake = end - rounded(&fall)?;
    // With no room to cruise the two ramps meet but for rounding: they are made to meet.
    let rounding_mm = block.length_mm.spacing().to_f64();
    let meets = (brake - top).to_mm() <= GAP_MM + 16.0 * rounding_mm;
    let (top, brake) = match (meets, rise.duration_s() > P::ZERO, fall.duration_s() > P::ZERO) {
        (true, true, true) => (top, top),
        (true, true, false) => (end, end),
        (true, false, true) => (start, start),
        (false, _, _) | (true, false, false) => (top, brake),
    };
    let feed_mm_s = plan.peak_mm_s.to_f64();
    let made = |ramp: &Ramp<P>, length: Position| {
        if length == Position::ZERO { Ok(None) } else { FeedSegment::ramp(ramp, length, tick_s).map(Some) }
    };
    let cruise = if brake > top { Some(FeedSegment::cruise(feed_mm_s, brake - top, tick_s)?) } else { None };
    Ok([made(&rise, top - start)?, cruise, made(&fall, end - brake)?])
}

/// Less than this between two ramps is rounding \[mm\].
const GAP_MM: f64 = 4.0e-9;
