//! The kernel's look-ahead over a list of blocks, and the result on exact path positions.

use motion_kernel::law::{FeedSegment, SegmentError};
use motion_kernel::num::Real;
use motion_kernel::plan::{Block, BlockPlan, merge_equal, plan, segments};
use motion_kernel::units::Position;

use super::Mode;
use super::error::Problem;

/// A planned block: what was planned, and where on the stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    pub block: Block<f64>,
    pub plan: BlockPlan<f64>,
    pub start: Position,
    pub end: Position,
}

impl Planned {
    pub(super) fn segments<R: Real>(&self, tick_s: f64) -> Result<Vec<FeedSegment<R>>, Problem> {
        let all = segments(&self.block, &self.plan, self.start, self.end, tick_s)?;
        Ok(all.into_iter().flatten().collect())
    }
}

/// Plans blocks that end at `ends_mm`, merged or not.
pub(super) fn lookahead(
    mut blocks: Vec<Block<f64>>,
    ends_mm: &[f64],
    start_feed_mm_s: f64,
    end_feed_mm_s: f64,
    mode: Mode,
) -> Result<Vec<Planned>, Problem> {
    let lengths: Vec<f64> = blocks.iter().map(|block| block.length_mm).collect();
    if mode == Mode::Merged {
        let merged = merge_equal(&mut blocks);
        blocks.truncate(merged);
    }
    let mut plans = vec![BlockPlan::default(); blocks.len()];
    plan(&blocks, start_feed_mm_s, end_feed_mm_s, &mut plans)?;
    // Merged blocks end where their last one ends: found by adding up the same lengths in the same order.
    let mut original = lengths.iter().zip(ends_mm);
    let mut start = Position::ZERO;
    let mut planned = Vec::with_capacity(blocks.len());
    for (block, plan) in blocks.into_iter().zip(plans) {
        let (mut length_mm, mut end_mm) = (0.0, start.to_mm());
        while length_mm < block.length_mm {
            let Some((&length, &end)) = original.next() else { break };
            length_mm += length;
            end_mm = end;
        }
        let end = Position::from_mm(end_mm)
            .ok_or(SegmentError::OutOfRange { quantity: "length of the stretch [mm]", value: end_mm })?;
        planned.push(Planned { block, plan, start, end });
        start = end;
    }
    Ok(planned)
}
