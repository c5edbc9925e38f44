//! The kernel's look-ahead over a list of blocks, and the result on exact path positions.

use motion_kernel::law::FeedSegment;
use motion_kernel::num::Real;
use motion_kernel::plan::{Block, BlockPlan, PlanError, merge_equal, plan, segments};
use motion_kernel::units::Position;

use super::Mode;
use super::error::Problem;
use crate::toolpath::on_path;

/// A planned block: what was planned, and where on the stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    pub block: Block<f64>,
    pub plan: BlockPlan<f64>,
    pub start: Position,
    pub end: Position,
    /// Index of the original block, or of the first of those that were merged.
    pub first: usize,
}

impl Planned {
    /// An error comes with the index of the original block.
    pub(super) fn segments<R: Real>(&self, tick_s: f64) -> Result<Vec<FeedSegment<R>>, (usize, Problem)> {
        let all = segments(&self.block, &self.plan, self.start, self.end, tick_s)
            .map_err(|error| (self.first, Problem::Segment { error, tick_s }))?;
        Ok(all.into_iter().flatten().collect())
    }
}

/// Plans blocks that end at `ends_mm`, merged or not. An error comes with the index of the original block.
pub(super) fn lookahead(
    mut blocks: Vec<Block<f64>>,
    ends_mm: &[f64],
    start_feed_mm_s: f64,
    end_feed_mm_s: f64,
    mode: Mode,
) -> Result<Vec<Planned>, (usize, Problem)> {
    let mut ends = Vec::with_capacity(blocks.len());
    for (index, &end_mm) in ends_mm.iter().enumerate() {
        ends.push(on_path(end_mm).map_err(|error| (index, error.into()))?);
    }
    // Whether two neighbours merge depends on them alone.
    let merges = |mut pair: [Block<f64>; 2]| mode == Mode::Merged && merge_equal(&mut pair) == 1;
    let firsts: Vec<usize> = (0..blocks.len())
        .filter(|&index| index.checked_sub(1).is_none_or(|before| !merges([blocks[before], blocks[index]])))
        .collect();
    if mode == Mode::Merged {
        let merged = merge_equal(&mut blocks);
        blocks.truncate(merged);
    }
    let mut plans = vec![BlockPlan::default(); blocks.len()];
    plan(&blocks, start_feed_mm_s, end_feed_mm_s, &mut plans).map_err(|error| {
        let block = match error {
            PlanError::Block { block, .. } => block,
            _ => 0,
        };
        (firsts.get(block).copied().unwrap_or(0), error.into())
    })?;
    let mut start = Position::ZERO;
    let mut planned = Vec::with_capacity(blocks.len());
    for (index, (block, plan)) in blocks.into_iter().zip(plans).enumerate() {
        let first = firsts[index];
        let end = ends[firsts.get(index + 1).copied().unwrap_or(ends.len()) - 1];
        planned.push(Planned { block, plan, start, end, first });
        start = end;
    }
    Ok(planned)
}

#[cfg(test)]
mod tests {
    use motion_kernel::law::{Law, Limits};

    use super::*;

    /// Blocks of no length too belong to the block they were merged into.
    #[test]
    fn merged_blocks_know_their_first() {
        let law = Law::new(Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 })
            .expect("positive limits");
        let block = |length_mm, cap_mm_s| Block { length_mm, cap_mm_s, joint_mm_s: f64::INFINITY, law };
        let blocks = vec![block(0.0, 80.0), block(50.0, 80.0), block(0.0, 40.0), block(25.0, 40.0)];
        for (mode, expected) in [
            (Mode::Merged, &[(0, 50.0), (2, 75.0)][..]),
            (Mode::PerBlock, &[(0, 0.0), (1, 50.0), (2, 50.0), (3, 75.0)][..]),
        ] {
            let planned =
                lookahead(blocks.clone(), &[0.0, 50.0, 50.0, 75.0], 0.0, 0.0, mode).expect("a plan");
            let found: Vec<(usize, f64)> = planned.iter().map(|p| (p.first, p.end.to_mm())).collect();
            assert_eq!(found, expected);
        }
    }
}
