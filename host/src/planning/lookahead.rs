//! The kernel's look-ahead over a list of blocks, and the result on exact path positions.

use motion_kernel::law::Ramp;
use motion_kernel::plan::{
    Block, BlockPlan, FeedSpan, Node, PlanError, merge_equal, nodes_for, plan, plan_spanning, segments,
};
use motion_kernel::units::Position;

use super::Mode;
use super::error::Problem;
use crate::toolpath::on_path;

/// A planned ramp or cruise over an exact length of path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlannedSegment {
    pub ramp: Ramp<f64>,
    pub length: Position,
    /// Index of the block in which it starts.
    pub block: usize,
}

/// Plans blocks that end at `ends_mm`, from one feed to another: with ramps that span blocks where that is faster,
/// or with one pair of ramps a block. An error comes with the index of the block.
pub(super) fn lookahead(
    blocks: &[Block<f64>],
    ends_mm: &[f64],
    start_feed_mm_s: f64,
    end_feed_mm_s: f64,
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedSegment>, (usize, Problem)> {
    let mut ends = Vec::with_capacity(blocks.len());
    for (index, &end_mm) in ends_mm.iter().enumerate() {
        ends.push(on_path(end_mm).map_err(|error| (index, error.into()))?);
    }
    let per_block = per_block(blocks, &ends, start_feed_mm_s, end_feed_mm_s, mode, tick_s)?;
    if mode == Mode::PerBlock {
        return Ok(per_block);
    }
    // Whatever speaks against this plan does not speak against the other.
    let spanning = spanning(blocks, ends_mm, &ends, start_feed_mm_s, end_feed_mm_s, tick_s).ok().flatten();
    // One is as legal as the other; which is faster depends on how often the ceilings change.
    Ok(match spanning {
        Some(spanning) if time_s(&spanning) < time_s(&per_block) => spanning,
        _ => per_block,
    })
}

/// How long they take \[s\].
pub(super) fn time_s(segments: &[PlannedSegment]) -> f64 {
    segments.iter().map(|segment| segment.ramp.duration_s()).sum()
}

/// One pair of ramps a block; in [`Mode::Spanning`] for all equal neighbours together.
fn per_block(
    blocks: &[Block<f64>],
    ends: &[Position],
    start_feed_mm_s: f64,
    end_feed_mm_s: f64,
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedSegment>, (usize, Problem)> {
    // Whether two neighbours merge depends on them alone.
    let merges = |mut pair: [Block<f64>; 2]| mode == Mode::Spanning && merge_equal(&mut pair) == 1;
    let firsts: Vec<usize> = (0..blocks.len())
        .filter(|&index| index.checked_sub(1).is_none_or(|before| !merges([blocks[before], blocks[index]])))
        .collect();
    let mut merged = blocks.to_vec();
    if mode == Mode::Spanning {
        let count = merge_equal(&mut merged);
        merged.truncate(count);
    }
    let mut plans = vec![BlockPlan::default(); merged.len()];
    plan(&merged, start_feed_mm_s, end_feed_mm_s, &mut plans).map_err(|error| {
        let block = match error {
            PlanError::Block { block, .. } => block,
            _ => 0,
        };
        (firsts.get(block).copied().unwrap_or(0), error.into())
    })?;
    let mut start = Position::ZERO;
    let mut planned = Vec::with_capacity(3 * merged.len());
    for (index, (block, plan)) in merged.iter().zip(&plans).enumerate() {
        let first = firsts[index];
        let end = ends[firsts.get(index + 1).copied().unwrap_or(ends.len()) - 1];
        let all = segments::<f64, f64>(block, plan, start, end, tick_s)
            .map_err(|error| (first, Problem::Segment { error, tick_s }))?;
        planned.extend(all.iter().flatten().map(|segment| PlannedSegment {
            ramp: *segment.as_ramp(),
            length: segment.length(),
            block: first,
        }));
        start = end;
    }
    Ok(planned)
}

/// Ramps that span blocks, if there is such a plan.
fn spanning(
    blocks: &[Block<f64>],
    ends_mm: &[f64],
    ends: &[Position],
    start_feed_mm_s: f64,
    end_feed_mm_s: f64,
    tick_s: f64,
) -> Result<Option<Vec<PlannedSegment>>, (usize, Problem)> {
    let mut places = vec![Node::EMPTY; nodes_for(blocks.len())];
    let mut spans: Vec<FeedSpan> = Vec::new();
    let time_s =
        plan_spanning(blocks, start_feed_mm_s, end_feed_mm_s, &mut places, &mut |span| spans.push(span))
            .map_err(|error| (0, error.into()))?;
    if time_s.is_none() {
        return Ok(None);
    }
    let last = ends.last().copied().unwrap_or(Position::ZERO);
    let (mut start, mut block) = (Position::ZERO, 0);
    let mut planned = Vec::with_capacity(spans.len());
    for (index, span) in spans.iter().enumerate() {
        while block + 1 < ends_mm.len() && ends_mm[block] <= span.start_mm {
            block += 1;
        }
        let end = match spans.get(index + 1) {
            Some(next) => on_path(next.start_mm).map_err(|error| (block, error.into()))?,
            None => last,
        };
        let length = end - start;
        start = end;
        let segment = span.segment::<f64>(length, tick_s);
        if let Some(segment) = segment.map_err(|error| (block, Problem::Segment { error, tick_s }))? {
            planned.push(PlannedSegment { ramp: *segment.as_ramp(), length, block });
        }
    }
    Ok(Some(planned))
}

#[cfg(test)]
mod tests {
    use motion_kernel::law::{Law, Limits};

    use super::*;

    /// Blocks of no length too belong to the block they were merged into.
    #[test]
    fn segments_know_their_block() {
        let law = Law::new(Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 })
            .expect("positive limits");
        let block = |length_mm, cap_mm_s| Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law };
        let blocks = [block(0.0, 80.0), block(50.0, 80.0), block(0.0, 40.0), block(25.0, 40.0)];
        for (mode, expected) in [(Mode::Spanning, &[0, 2][..]), (Mode::PerBlock, &[1, 3][..])] {
            let planned =
                lookahead(&blocks, &[0.0, 50.0, 50.0, 75.0], 0.0, 0.0, mode, 0.0005).expect("a plan");
            let mut found: Vec<usize> = planned.iter().map(|segment| segment.block).collect();
            found.dedup();
            assert_eq!(found, expected, "{mode:?}");
            let length = planned.iter().fold(Position::ZERO, |sum, segment| sum + segment.length);
            assert!((length.to_mm() - 75.0).abs() < 1e-9);
        }
    }
}
