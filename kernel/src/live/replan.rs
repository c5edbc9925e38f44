//! The feed from a splice on, planned anew over the blocks that are known.
//!
//! Consumes a splice, a feed override and the [`Lookahead`]; produces ramps and cruises to rest where the known path ends.
//! Background. Two stages and one pair of ramps for neighbours that are alike, as [`plan`]; over the blocks that come
//! first with ramps that span them, where that is faster, to the feed that the plan behind them begins with.

use heapless::Vec;

use super::brake::LENGTH_ROUNDING_MM;
use super::list::{Item, LIST_ITEMS, List};
use super::lookahead::Lookahead;
use super::splice::{SLIVER, Splice};
use crate::law::{Law, Limits};
use crate::plan::spanning::spans_of;
use crate::plan::{Block, BlockPlan, FeedSpan, Node, nodes_for, plan, plan_spanning, segments};
use crate::units::Position;

/// Over so many blocks ramps may span: a list seldom reaches farther, and what they need goes with it.
const SPANNED: usize = 16;
/// By such a part limits may differ within a block: those of chords of an arc do, and many blocks are much slower than one.
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
    /// In the order in which they are tried: one without a place to stop from does not rule out the other.
    pub(super) const IN_ORDER: [Self; 2] = [Self::Spanning, Self::PerBlock];
}

/// How much of a plan a list has taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// All of it.
    Whole,
    /// What there was room for.
    Part,
}

/// The first items of a plan from `from` to rest at `end`, into `list`, as many as it has room for. `None` if there is no plan: the feed is above the ceiling, or the path too short to brake.
pub(super) fn replan<const BLOCKS: usize>(
    lookahead: &Lookahead<BLOCKS>,
    from: &Splice,
    feed_override: f64,
    end: Position,
    ramps: Ramps,
    tick_s: f64,
    list: &mut List,
) -> Option<Reach> {
    let heads = list.len();
    // What is alike may be too soft where one has to brake at once.
    for alike in [ALIKE, 0.0] {
        let mut blocks = Blocks::<BLOCKS>::new(lookahead, from, feed_override, end, alike)?;
        let planned = blocks.plan(from, ramps, tick_s, list);
        if planned.is_some() {
            return planned;
        }
        list.truncate(heads);
        if !blocks.are_softer {
            break;
        }
    }
    None
}

/// The blocks that a plan is made for.
struct Blocks<const BLOCKS: usize> {
    blocks: Vec<Block<f64>, BLOCKS>,
    ends: Vec<Position, BLOCKS>,
    /// One of them has limits below its own.
    are_softer: bool,
}

impl<const BLOCKS: usize> Blocks<BLOCKS> {
    /// Those from a splice to `end`. Neighbours with one ceiling are one block, with the least limits of all of them, if
    /// none of these are `alike` parts below another's.
    #[inline(never)]
    fn new(
        lookahead: &Lookahead<BLOCKS>,
        from: &Splice,
        feed_override: f64,
        end: Position,
        alike: f64,
    ) -> Option<Self> {
        let mut found = Self { blocks: Vec::new(), ends: Vec::new(), are_softer: false };
        // A sliver of a block belongs to the one behind it.
        let (mut start, mut most) = (from.at, None::<Limits<f64>>);
        for block in lookahead.from(from).take_while(|block| block.start() < end) {
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
                    last.law = Law::new(least).ok()?;
                    continue;
                }
            }
            let law = Law::new(limits).ok()?;
            let next = Block { length_mm, cap_mm_s, junction_mm_s: block.junction_mm_s(), law };
            found.blocks.push(next).ok()?;
            found.ends.push(block_end).ok()?;
            most = Some(limits);
        }
        Some(found)
    }

    /// See [`replan`].
    #[inline(never)]
    fn plan(&mut self, from: &Splice, ramps: Ramps, tick_s: f64, list: &mut List) -> Option<Reach> {
        let (blocks, ends) = (&mut self.blocks, &self.ends);
        let mut plans: Vec<BlockPlan<f64>, BLOCKS> = Vec::new();
        plans.resize(blocks.len(), BlockPlan::default()).ok()?;
        if plan(blocks, from.feed_mm_s, 0.0, &mut plans).is_err() {
            // Where one has to brake at once the feed may be a rounding too high for the length.
            blocks.first_mut()?.length_mm += LENGTH_ROUNDING_MM;
            plan(blocks, from.feed_mm_s, 0.0, &mut plans).ok()?;
        } else if ramps == Ramps::Spanning && blocks.len() > 1 {
            let count = blocks.len().min(SPANNED);
            let (first, plans, ends) = (blocks.get(..count)?, plans.get(..count)?, ends.get(..count)?);
            let heads = list.len();
            if let Some(reach) = span(first, plans, from, *ends.last()?, tick_s, list) {
                return Some(if count == blocks.len() { reach } else { Reach::Part });
            }
            list.truncate(heads);
        }
        let mut start = from.at;
        for ((block, plan), &block_end) in blocks.iter().zip(&plans).zip(ends) {
            let made = segments::<f64, f64>(block, plan, start, block_end, tick_s).ok()?;
            for segment in made.iter().flatten() {
                if list.is_full() {
                    return Some(Reach::Part);
                }
                list.push(Item::Feed { ramp: *segment.as_ramp(), length: segment.length() });
            }
            start = block_end;
        }
        Some(Reach::Whole)
    }
}

/// Whether none is `alike` parts below the other.
fn is_alike(least: &Limits<f64>, greatest: &Limits<f64>, alike: f64) -> bool {
    let is_near = |least: f64, greatest: f64| least >= greatest * (1.0 - alike);
    is_near(least.accel_mm_s2, greatest.accel_mm_s2)
        && is_near(least.jerk_mm_s3, greatest.jerk_mm_s3)
        && is_near(least.snap_mm_s4, greatest.snap_mm_s4)
}

/// The same over `blocks`, to the feed and the position that their `plans` end with, by ramps that may span them. `None` where
/// that is not faster.
// In a frame of its own: what it works with takes many kilobytes.
#[inline(never)]
fn span(
    blocks: &[Block<f64>],
    plans: &[BlockPlan<f64>],
    from: &Splice,
    end: Position,
    tick_s: f64,
    list: &mut List,
) -> Option<Reach> {
    let mut nodes = [Node::EMPTY; nodes_for(SPANNED)];
    let mut spans: Vec<FeedSpan, { LIST_ITEMS + 1 }> = Vec::new();
    let mut is_cut = false;
    let to_mm_s = plans.last()?.exit_mm_s;
    let time_s = plan_spanning(blocks, from.feed_mm_s, to_mm_s, &mut nodes, &mut |span| {
        is_cut |= spans.push(span).is_err();
    });
    if !(time_s.ok()?? < spans_of(blocks, plans, &mut |_| {})) {
        return None;
    }
    let (mut start, mut rest) = (from.at, &spans[..]);
    while let [span, next @ ..] = rest {
        if list.is_full() {
            return Some(Reach::Part);
        }
        let span_end = match next.first() {
            Some(next) => from.at + Position::from_mm(next.start_mm)?,
            // What was cut off behind it is gone, and with it where it ends.
            None if is_cut => return Some(Reach::Part),
            None => end,
        };
        let length = span_end - start;
        if let Some(segment) = span.segment::<f64>(length, tick_s).ok()? {
            list.push(Item::Feed { ramp: *segment.as_ramp(), length });
        }
        (start, rest) = (span_end, next);
    }
    Some(Reach::Whole)
}
