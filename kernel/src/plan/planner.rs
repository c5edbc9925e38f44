//! The planner's entry: plans blocks, from feed to feed, as ramps over exact lengths of path.
//!
//! Consumes blocks with their exact ends and the caller's memory; produces [`PlannedRamp`]s. It makes one
//! plan with ramps that span blocks and one with a pair of ramps per block, and takes the faster. Both are
//! legal; which one is faster depends on how often the ceilings change. If no spanning plan is found, the
//! pairs are the fallback.

use super::attention::Attention;
use super::ramps::ramps;
use super::spanning::{Node, plan_spanning_unless};
use super::two_pass::{Block, BlockPlan, PlanError, check, merge_each, plan_unless};
use crate::law::{PlannedRamp, Ramp, SegmentError};
use crate::units::Position;

/// The path to be planned.
pub struct Path<'a> {
    /// The blocks, in order.
    pub blocks: &'a mut [Block<f64>],
    /// The end of each block.
    pub ends: &'a mut [Position],
    /// The start of the first block.
    pub start: Position,
    /// The feeds at the start of the first block and at the end of the last \[mm/s\].
    pub feeds_mm_s: [f64; 2],
    /// The control tick that the ramps are for \[s\].
    pub tick_s: f64,
}

/// The effort spent on a fast plan. [`Effort::Merged`] and [`Effort::Spanning`] merge equal neighbours in the
/// caller's memory, whose content is then meaningless.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// One pair of ramps per block.
    PerBlock,
    /// One pair of ramps per group of equal neighbours.
    Merged,
    /// Ramps that span any number of blocks, where that is faster than one pair per group of equal
    /// neighbours.
    Spanning,
    /// Ramps that span the first blocks, where that is faster than one pair per block.
    SpanningFirst {
        /// Number of blocks that may be spanned. If there are more and spanning is faster, the plan ends
        /// after these blocks, at the feed where the pairs of the other blocks begin.
        most: usize,
    },
}

/// The planner's working memory. Its content before and after is meaningless.
pub struct Memory<'a> {
    /// One place per block.
    pub plans: &'a mut [BlockPlan<f64>],
    /// As many as [`nodes_for`](super::nodes_for) the blocks that may be spanned.
    pub nodes: &'a mut [Node],
}

/// The result of planning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// There was room for all ramps, and they cover all blocks.
    pub is_whole: bool,
    /// The time that they take \[s\], if so.
    pub time_s: f64,
}

/// Times whose relative difference is smaller are equal but for rounding; then the pairs are taken.
const EQUAL: f64 = 1.0e-12;

/// Plans `path` and hands the ramps of the faster plan to `put` in path order, each with its number from 0.
/// If a number comes again, it replaces the ramp that had it and all ramps after that one. `put` returns
/// whether there was room; if not, the rest of that plan is omitted.
///
/// # Errors
/// A figure is out of range, the path is too short for its start or end feed, a ramp is beyond the tick's
/// range, or there is too little working memory.
pub fn plan_ramps(
    path: Path<'_>,
    effort: Effort,
    memory: Memory<'_>,
    put: &mut impl FnMut(usize, PlannedRamp) -> bool,
) -> Result<Planned, PlanError> {
    plan_ramps_unless(&Attention::undivided(), path, effort, memory, put)
}

/// [`plan_ramps`], given up where something more urgent waits.
///
/// # Errors
/// As [`plan_ramps`], and [`PlanError::GivenUp`].
pub fn plan_ramps_unless(
    attention: &Attention<'_>,
    path: Path<'_>,
    effort: Effort,
    memory: Memory<'_>,
    put: &mut impl FnMut(usize, PlannedRamp) -> bool,
) -> Result<Planned, PlanError> {
    let Path { blocks, ends, start, feeds_mm_s: [start_mm_s, end_mm_s], tick_s } = path;
    let Memory { plans, nodes } = memory;
    let most = match effort {
        Effort::PerBlock | Effort::Merged => 0,
        Effort::Spanning => blocks.len(),
        Effort::SpanningFirst { most } => most.min(blocks.len()),
    };
    let spans_all = most > 0 && most == blocks.len();
    let mut spanning = None;
    // Merging rounds the blocks' lengths: if all blocks may be spanned, span them before merging.
    if spans_all {
        spanning =
            span(attention, Stretch { blocks, ends, start, tick_s }, [start_mm_s, end_mm_s], nodes, put)?;
    }
    let mut count = blocks.len();
    if matches!(effort, Effort::Merged | Effort::Spanning) {
        check(blocks, start_mm_s, end_mm_s)?;
        count = merge_each(blocks, |from, to| {
            if let Some(&end) = ends.get(from)
                && let Some(place) = ends.get_mut(to)
            {
                *place = end;
            }
        });
    }
    let places = plans.len();
    let plans = plans.get_mut(..count).ok_or(PlanError::Room { of: "plans", needed: count, places })?;
    let all = Stretch { blocks, ends, start, tick_s }.first(count);
    match (plan_unless(attention, all.blocks, start_mm_s, end_mm_s, plans), spanning) {
        (Ok(()), _) => {}
        // Ramps over several blocks reach feeds at the ends that pairs don't.
        (Err(PlanError::TooShortToBrake { .. } | PlanError::TooShortToAccelerate { .. }), Some(found)) => {
            return Ok(found);
        }
        (Err(error), _) => return Err(error),
    }
    let compared = if spans_all { count } else { most };
    if let (false, Some(BlockPlan { exit_mm_s, .. })) = (spans_all, plans.get(..most).and_then(<[_]>::last)) {
        spanning = span(attention, all.first(most), [start_mm_s, *exit_mm_s], nodes, put)?;
    }
    if let Some(found) = spanning {
        let by_pairs = pairs(attention, all.first(compared), plans, &mut |_, _| true);
        if by_pairs == Err(PlanError::GivenUp) {
            return by_pairs;
        }
        if by_pairs.is_err() || by_pairs.is_ok_and(|by_pairs| found.time_s < by_pairs.time_s * (1.0 - EQUAL))
        {
            return Ok(Planned { is_whole: found.is_whole && spans_all, ..found });
        }
    }
    pairs(attention, all, plans, put)
}

/// Blocks with their exact ends.
#[derive(Clone, Copy)]
struct Stretch<'a> {
    blocks: &'a [Block<f64>],
    ends: &'a [Position],
    start: Position,
    tick_s: f64,
}

impl Stretch<'_> {
    fn first(self, count: usize) -> Self {
        let (blocks, ends) = (self.blocks.get(..count), self.ends.get(..count));
        Self { blocks: blocks.unwrap_or(self.blocks), ends: ends.unwrap_or(self.ends), ..self }
    }
}

/// The ramps of one plan on their way to the caller.
struct Out<'a, F> {
    put: &'a mut F,
    count: usize,
    planned: Planned,
}

impl<'a, F: FnMut(usize, PlannedRamp) -> bool> Out<'a, F> {
    fn new(put: &'a mut F) -> Self {
        Self { put, count: 0, planned: Planned { is_whole: true, time_s: 0.0 } }
    }

    fn put(&mut self, ramp: PlannedRamp) {
        self.planned.time_s += ramp.ramp.duration_s();
        self.planned.is_whole = self.planned.is_whole && (self.put)(self.count, ramp);
        self.count += 1;
    }
}

/// Puts one pair of ramps per block, according to `plans`.
fn pairs(
    attention: &Attention<'_>,
    stretch: Stretch<'_>,
    plans: &[BlockPlan<f64>],
    put: &mut impl FnMut(usize, PlannedRamp) -> bool,
) -> Result<Planned, PlanError> {
    let (mut out, mut start) = (Out::new(put), stretch.start);
    for ((block, plan), &end) in stretch.blocks.iter().zip(plans).zip(stretch.ends) {
        if attention.is_wanted() {
            return Err(PlanError::GivenUp);
        }
        let made = ramps(block, plan, start, end, stretch.tick_s);
        for ramp in made.map_err(|error| PlanError::Ramp { start, error })?.into_iter().flatten() {
            out.put(ramp);
        }
        if !out.planned.is_whole {
            break;
        }
        start = end;
    }
    Ok(out.planned)
}

/// Puts ramps that span blocks; `None` if there is no such plan in the tick's range.
// In its own stack frame: its working memory takes many kilobytes.
#[inline(never)]
fn span(
    attention: &Attention<'_>,
    stretch: Stretch<'_>,
    [start_mm_s, end_mm_s]: [f64; 2],
    nodes: &mut [Node],
    put: &mut impl FnMut(usize, PlannedRamp) -> bool,
) -> Result<Option<Planned>, PlanError> {
    let mut out = Out::new(put);
    // A ramp ends where the next one starts, so it waits until that is known.
    let (mut waiting, mut start, mut is_made) = (None, stretch.start, true);
    let mut end_at = |end: Option<Position>, next: Option<Ramp<f64>>| {
        let Some(end) = end else {
            is_made = false;
            return;
        };
        if let Some(ramp) = core::mem::replace(&mut waiting, next) {
            match placed(&ramp, end - start, stretch.tick_s) {
                Ok(ramp) => ramp.into_iter().for_each(|ramp| out.put(ramp)),
                Err(_) => is_made = false,
            }
            start = end;
        }
    };
    let mut start_at = |start_mm: f64, ramp: &Ramp<f64>| {
        end_at(Position::from_mm(start_mm).map(|length| stretch.start + length), Some(*ramp));
    };
    let found =
        plan_spanning_unless(attention, stretch.blocks, [start_mm_s, end_mm_s], nodes, &mut start_at)?;
    end_at(stretch.ends.last().copied(), None);
    Ok(found.filter(|_| is_made).map(|_| out.planned))
}

/// `ramp` over `length`; `None` for a cruise that has no length after rounding.
fn placed(ramp: &Ramp<f64>, length: Position, tick_s: f64) -> Result<Option<PlannedRamp>, SegmentError> {
    if !ramp.is_cruise() {
        PlannedRamp::new(ramp, length, tick_s).map(Some)
    } else if length > Position::ZERO {
        PlannedRamp::cruise(ramp.from_mm_s, length, tick_s).map(Some)
    } else {
        Ok(None)
    }
}
