//! The feed from a junction on, planned anew over the blocks that are known.
//!
//! Consumes a junction, a feed override and the [`Road`]; produces ramps and cruises to rest where the known path ends.
//! Background. Two stages and one pair of ramps for equal neighbours together, as [`plan`].

use heapless::Vec;

use super::list::{Item, List};
use super::road::{Junction, LENGTH_ROUNDING_MM, Road, SLIVER};
use crate::law::Law;
use crate::plan::{Block, BlockPlan, merge_equal, plan, segments};
use crate::units::Position;

/// The first items of a plan from `from` to rest at `end`, into `list`, as many as it has room for; whether that is all
/// of it. `None` if there is no plan: the feed is above the ceiling, or the path too short to brake.
pub(super) fn replan<const BLOCKS: usize>(
    road: &Road<BLOCKS>,
    from: &Junction,
    feed_override: f64,
    end: Position,
    tick_s: f64,
    list: &mut List,
) -> Option<bool> {
    let mut blocks: Vec<Block<f64>, BLOCKS> = Vec::new();
    let mut ends: Vec<Position, BLOCKS> = Vec::new();
    // A sliver of a block belongs to the one behind it.
    let mut start = from.at;
    for block in road.from(from).take_while(|block| block.start < end) {
        let (cap_mm_s, limits) = block.allowed(feed_override);
        let block_end = block.end.min(end);
        if block_end - start <= SLIVER && block_end < end {
            continue;
        }
        let (length_mm, joint_mm_s) = ((block_end - start).to_mm(), block.joint_mm_s());
        let next = Block { length_mm, cap_mm_s, joint_mm_s, law: Law::new(limits).ok()? };
        start = block_end;
        if let (Some(last), Some(last_end)) = (blocks.last_mut(), ends.last_mut()) {
            let mut pair = [*last, next];
            if merge_equal(&mut pair) == 1 {
                ([*last, _], *last_end) = (pair, block_end);
                continue;
            }
        }
        blocks.push(next).ok()?;
        ends.push(block_end).ok()?;
    }
    let mut plans: Vec<BlockPlan<f64>, BLOCKS> = Vec::new();
    plans.resize(blocks.len(), BlockPlan::default()).ok()?;
    if plan(&blocks, from.feed_mm_s, 0.0, &mut plans).is_err() {
        // Where one has to brake at once the feed may be a rounding too high for the length.
        blocks.first_mut()?.length_mm += LENGTH_ROUNDING_MM;
        plan(&blocks, from.feed_mm_s, 0.0, &mut plans).ok()?;
    }
    let mut start = from.at;
    for ((block, plan), &block_end) in blocks.iter().zip(&plans).zip(&ends) {
        let made = segments::<f64, f64>(block, plan, start, block_end, tick_s).ok()?;
        for segment in made.iter().flatten() {
            if list.is_full() {
                return Some(false);
            }
            list.push(Item::Feed { ramp: *segment.as_ramp(), length: segment.length() });
        }
        start = block_end;
    }
    Some(true)
}
