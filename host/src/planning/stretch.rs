//! One stretch, from full stop to full stop: ceilings, look-ahead, feed segments.

use motion_kernel::law::FeedSegment;
use motion_kernel::num::Real;
use motion_kernel::plan::{Block, BlockPlan, Ceiling, merge_equal, plan, segments};
use motion_kernel::units::Position;

use super::error::Problem;
use super::profile::FeedProfile;
use super::{FeedRecord, Mode};
use crate::record::BlockRecord;
use crate::toolpath::Element;

/// A block of a stretch, before planning.
#[derive(Clone, Copy, Debug)]
pub struct StretchBlock {
    /// Program line.
    pub line: u32,
    /// Geometry.
    pub element: Element,
    /// Ceiling with its reason, and the law for its ramps.
    pub ceiling: Ceiling<f64>,
    /// Greatest feed through the joint at its end \[mm/s\].
    pub joint_mm_s: f64,
}

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

/// A planned stretch.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Where it starts, from the program's start \[mm\].
    pub start_mm: f64,
    /// Its blocks, as programmed.
    pub blocks: Vec<StretchBlock>,
    /// Path position of every block's end, from the stretch's start \[mm\].
    ends_mm: Vec<f64>,
    /// As planned; fewer than `blocks` where neighbours were merged.
    pub(super) planned: Vec<Planned>,
    /// Feed and time over the stretch.
    pub profile: FeedProfile,
}

impl Stretch {
    /// Plans blocks that start and end at rest. An error comes with the program line.
    pub(super) fn new(
        blocks: Vec<StretchBlock>,
        start_mm: f64,
        mode: Mode,
        tick_s: f64,
    ) -> Result<Self, (u32, Problem)> {
        let first_line = blocks.first().map_or(0, |block| block.line);
        let mut end_mm = 0.0;
        let mut ends_mm = Vec::with_capacity(blocks.len());
        let mut plan_blocks = Vec::with_capacity(blocks.len());
        for block in &blocks {
            let length_mm = block.element.length_mm();
            end_mm += length_mm;
            ends_mm.push(end_mm);
            plan_blocks.push(Block {
                length_mm,
                cap_mm_s: block.ceiling.feed_mm_s,
                joint_mm_s: block.joint_mm_s,
                law: block.ceiling.law,
            });
        }
        let planned = lookahead(plan_blocks, &ends_mm, 0.0, 0.0, mode).map_err(|p| (first_line, p))?;
        let profile = FeedProfile::new(&planned, tick_s).map_err(|p| (first_line, p))?;
        Ok(Self { start_mm, blocks, ends_mm, planned, profile })
    }

    /// Its length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.ends_mm.last().copied().unwrap_or(0.0)
    }

    /// Path positions of the blocks' ends, from the stretch's start \[mm\].
    #[must_use]
    pub fn ends_mm(&self) -> &[f64] {
        &self.ends_mm
    }

    pub(super) fn block_records(&self) -> Vec<BlockRecord> {
        let mut start_mm = 0.0;
        let mut records = Vec::with_capacity(self.blocks.len());
        for (block, &end_mm) in self.blocks.iter().zip(&self.ends_mm) {
            let cap_mm_s = block.ceiling.feed_mm_s;
            let law = block.ceiling.law;
            let view = Block { length_mm: end_mm - start_mm, cap_mm_s, joint_mm_s: block.joint_mm_s, law };
            let (plan, time_s) = self.profile.over(start_mm, end_mm);
            records.push(BlockRecord {
                line: block.line,
                kind: block.element.kind(),
                start_mm: self.start_mm + start_mm,
                length_mm: end_mm - start_mm,
                cap_mm_s,
                cap_reason: plan.reason(&view, block.ceiling.reason).name(),
                enter_mm_s: plan.enter_mm_s,
                peak_mm_s: plan.peak_mm_s,
                exit_mm_s: plan.exit_mm_s,
                time_s,
            });
            start_mm = end_mm;
        }
        records
    }

    pub(super) fn feed_records(&self) -> Vec<FeedRecord> {
        self.profile.records(self.start_mm)
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
        let end = Position::from_mm(end_mm).ok_or(motion_kernel::law::SegmentError::OutOfRange {
            quantity: "length of the stretch [mm]",
            value: end_mm,
        })?;
        planned.push(Planned { block, plan, start, end });
        start = end;
    }
    Ok(planned)
}
