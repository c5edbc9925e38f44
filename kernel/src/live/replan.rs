//! Plans the feed anew from a splice, over the known blocks.
//!
//! Consumes a splice, a feed override and the [`Lookahead`]; produces ramps and cruises to rest where the
//! known path ends. Background. Similar neighbours are merged and share one pair of ramps; over the first
//! blocks, ramps may span blocks where that is faster.

use heapless::Vec;

use super::brake::LENGTH_ROUNDING_MM;
use super::list::{Item, List};
use super::lookahead::Lookahead;
use super::splice::{SLIVER, Splice};
use crate::law::{Law, Limits};
use crate::plan::{
    Attention, Block, BlockPlan, Effort, Memory, Node, Path, PlanError, nodes_for, plan_ramps_unless,
};
use crate::units::Position;

/// Number of blocks that ramps may span: a list seldom reaches farther, and the planner's memory grows with
/// it.
const SPANNED: usize = 16;
/// Relative difference of limits up to which blocks are merged: the chords of an arc differ by less, and many
/// short blocks are much slower than one.
const ALIKE: f64 = 0.02;

/// How a stretch is planned anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ramps {
    /// A ramp may span blocks where that is faster.
    Spanning,
    /// One pair a block.
    PerBlock,
}

impl Ramps {
    /// The order in which they are tried: if one leaves no place to stop from, the other still may.
    pub(super) const IN_ORDER: [Self; 2] = [Self::Spanning, Self::PerBlock];
}

/// How much of a plan a list has taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// The whole plan.
    Whole,
    /// As much as there was room for.
    Part,
}

impl Reach {
    fn of(is_whole: bool) -> Self {
        if is_whole { Self::Whole } else { Self::Part }
    }
}

/// Appends a plan from `from` to rest at `end` to `list`, as many items as it has room for. `None` if there
/// is no plan: the feed is above the ceiling, the path is too short to brake, or something more urgent waits.
pub(super) fn replan<const BLOCKS: usize>(
    attention: &Attention<'_>,
    lookahead: &Lookahead<BLOCKS>,
    from: &Splice,
    feed_override: f64,
    end: Position,
    ramps: Ramps,
    list: &mut List,
) -> Option<Reach> {
    let heads = list.len();
    // Merged blocks share their lowest limits, which may be too low to brake immediately; then retry with
    // equal ones merged only.
    for alike in [ALIKE, 0.0] {
        let mut blocks = Blocks::<BLOCKS>::new(attention, lookahead, from, feed_override, end, alike)?;
        let planned = blocks.plan(attention, from, ramps, list);
        if planned.is_some() {
            return planned;
        }
        list.truncate(heads);
        if !blocks.are_softer || attention.is_wanted() {
            break;
        }
    }
    None
}

/// The blocks that a plan is made for.
struct Blocks<const BLOCKS: usize> {
    blocks: Vec<Block<f64>, BLOCKS>,
    ends: Vec<Position, BLOCKS>,
    /// A merged block has limits below the ones of its parts.
    are_softer: bool,
}

impl<const BLOCKS: usize> Blocks<BLOCKS> {
    /// Blocks from a splice to `end`. Neighbours with the same ceiling are merged and get their least limits,
    /// if these are at most the fraction `alike` below the greatest ones. `None` if something more urgent waits.
    #[inline(never)]
    fn new(
        attention: &Attention<'_>,
        lookahead: &Lookahead<BLOCKS>,
        from: &Splice,
        feed_override: f64,
        end: Position,
        alike: f64,
    ) -> Option<Self> {
        let mut found = Self { blocks: Vec::new(), ends: Vec::new(), are_softer: false };
        // A sliver of a block belongs to the next block.
        let (mut start, mut most) = (from.at, None::<Limits<f64>>);
        for block in lookahead.from(from).take_while(|block| block.start() < end) {
            if attention.is_wanted() {
                return None;
            }
            let (cap_mm_s, limits) = block.allowed(feed_override);
            let block_end = block.end().min(end);
            if block_end - start <= SLIVER && block_end < end {
                continue;
            }
            let length_mm = (block_end - start).to_mm();
            start = block_end;
            if let (Some(last), Some(last_end), Some(group)) =
                (found.blocks.last_mut(), found.ends.last_mut(), most)
            {
                let least = last.law.limits().least(&limits);
                let greatest = group.greatest(&limits);
                let is_joined = last.cap_mm_s == cap_mm_s && last.junction_mm_s >= cap_mm_s;
                if is_joined && is_alike(&least, &greatest, alike) {
                    (*last_end, most) = (block_end, Some(greatest));
                    found.are_softer |= least != greatest;
                    last.length_mm += length_mm;
                    last.junction_mm_s = block.junction_mm_s();
                    last.law = Law::new(lookahead.pulse(), least).ok()?;
                    continue;
                }
            }
            let law = Law::new(lookahead.pulse(), limits).ok()?;
            let next = Block { length_mm, cap_mm_s, junction_mm_s: block.junction_mm_s(), law };
            found.blocks.push(next).ok()?;
            found.ends.push(block_end).ok()?;
            most = Some(limits);
        }
        Some(found)
    }

    /// See [`replan`].
    // In its own stack frame: the planner's memory takes kilobytes.
    #[inline(never)]
    fn plan(
        &mut self,
        attention: &Attention<'_>,
        from: &Splice,
        ramps: Ramps,
        list: &mut List,
    ) -> Option<Reach> {
        let mut plans: Vec<BlockPlan<f64>, BLOCKS> = Vec::new();
        plans.resize(self.blocks.len(), BlockPlan::default()).ok()?;
        let mut nodes = [Node::EMPTY; nodes_for(SPANNED)];
        let (heads, tick_s) = (list.len(), list.tick_s());
        let ends = &mut self.ends;
        let mut plan = |blocks: &mut [Block<f64>], effort| {
            let path =
                Path { blocks, ends: &mut *ends, start: from.at, feeds_mm_s: [from.feed_mm_s, 0.0], tick_s };
            let memory = Memory { plans: &mut plans, nodes: &mut nodes };
            plan_ramps_unless(attention, path, effort, memory, &mut |index, ramp| {
                list.truncate(heads + index);
                let has_room = !list.is_full();
                if has_room {
                    list.push(Item::Feed(ramp));
                }
                has_room
            })
        };
        let effort = match ramps {
            Ramps::Spanning if self.blocks.len() > 1 => Effort::SpanningFirst { most: SPANNED },
            Ramps::Spanning | Ramps::PerBlock => Effort::PerBlock,
        };
        match plan(&mut self.blocks, effort) {
            Ok(planned) => Some(Reach::of(planned.is_whole)),
            Err(PlanError::Ramp { .. } | PlanError::GivenUp) => None,
            Err(_) => {
                // If it must brake immediately, the feed may be too high for the length by a rounding error.
                self.blocks.first_mut()?.length_mm += LENGTH_ROUNDING_MM;
                plan(&mut self.blocks, Effort::PerBlock).ok().map(|planned| Reach::of(planned.is_whole))
            }
        }
    }
}

/// Whether no limit of `least` is more than the fraction `alike` below that of `greatest`.
fn is_alike(least: &Limits<f64>, greatest: &Limits<f64>, alike: f64) -> bool {
    let is_near = |least: f64, greatest: f64| least >= greatest * (1.0 - alike);
    is_near(least.accel_mm_s2, greatest.accel_mm_s2)
        && is_near(least.jerk_mm_s3, greatest.jerk_mm_s3)
        && is_near(least.snap_mm_s4, greatest.snap_mm_s4)
}
