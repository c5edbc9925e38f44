//! One stretch, from full stop to full stop: ceilings, look-ahead, ramps.

use motion_kernel::plan::{Block, Ceiling};

use super::Mode;
use super::error::Problem;
use super::lookahead::lookahead;
use super::profile::FeedProfile;
use crate::toolpath::Element;
use crate::trace::TracedBlock;

/// A block of a stretch, before planning.
#[derive(Clone, Copy, Debug)]
pub struct StretchBlock<const N: usize = 3> {
    /// Program line.
    pub line: u32,
    /// Geometry.
    pub element: Element<N>,
    /// Ceiling with its reason, and the law for its ramps.
    pub ceiling: Ceiling<f64>,
    /// The same whatever the program's feed.
    pub greatest: Ceiling<f64>,
    /// The program's feed along the block \[mm/s\]; infinite for a rapid.
    pub feed_mm_s: f64,
    /// Greatest feed through the junction at its end \[mm/s\].
    pub junction_mm_s: f64,
    /// Greatest distance from the programmed path and of it from the block, over its tolerance: a bound, 0
    /// where the path is exact.
    pub tolerance_share: f64,
}

impl<const N: usize> StretchBlock<N> {
    /// The block as look-ahead sees it.
    pub(super) fn for_lookahead(&self) -> Block<f64> {
        let Ceiling { feed_mm_s: cap_mm_s, law, .. } = self.ceiling;
        Block { length_mm: self.element.length_mm(), cap_mm_s, junction_mm_s: self.junction_mm_s, law }
    }
}

/// A planned stretch.
#[derive(Clone, Debug)]
pub struct Stretch<const N: usize = 3> {
    /// Its start, from the program's start \[mm\].
    pub start_mm: f64,
    /// The stretch's blocks, as programmed.
    pub blocks: Vec<StretchBlock<N>>,
    /// Path position of every block's end, from the stretch's start \[mm\].
    ends_mm: Vec<f64>,
    /// Feed and time over the stretch.
    pub profile: FeedProfile,
}

impl<const N: usize> Stretch<N> {
    /// Plans blocks that start and end at rest. An error comes with the program line.
    pub(super) fn new(
        blocks: Vec<StretchBlock<N>>,
        start_mm: f64,
        mode: Mode,
        tick_s: f64,
    ) -> Result<Self, (u32, Problem)> {
        let mut end_mm = 0.0;
        let mut ends_mm = Vec::with_capacity(blocks.len());
        let mut plan_blocks = Vec::with_capacity(blocks.len());
        for block in &blocks {
            let block = block.for_lookahead();
            end_mm += block.length_mm;
            ends_mm.push(end_mm);
            plan_blocks.push(block);
        }
        let at_line = |(block, problem): (usize, Problem)| (blocks[block].line, problem);
        let planned = lookahead(&plan_blocks, &ends_mm, [0.0; 2], mode, tick_s).map_err(at_line)?;
        let profile = FeedProfile::new(&planned);
        Ok(Self { start_mm, blocks, ends_mm, profile })
    }

    /// Path position of every block's end, from the stretch's start \[mm\].
    #[must_use]
    pub fn ends_mm(&self) -> &[f64] {
        &self.ends_mm
    }

    /// The stretch's blocks, as look-ahead sees them.
    #[must_use]
    pub fn for_lookahead(&self) -> Vec<Block<f64>> {
        self.blocks.iter().map(StretchBlock::for_lookahead).collect()
    }

    /// The stretch's length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.ends_mm.last().copied().unwrap_or(0.0)
    }

    pub(super) fn block_records(&self) -> Vec<TracedBlock> {
        let mut start_mm = 0.0;
        let mut records = Vec::with_capacity(self.blocks.len());
        for (block, &end_mm) in self.blocks.iter().zip(&self.ends_mm) {
            let cap_mm_s = block.ceiling.feed_mm_s;
            let law = block.ceiling.law;
            let view =
                Block { length_mm: end_mm - start_mm, cap_mm_s, junction_mm_s: block.junction_mm_s, law };
            let (plan, time_s) = self.profile.over(start_mm, end_mm);
            records.push(TracedBlock {
                line: block.line,
                kind: block.element.kind().into(),
                start_mm: self.start_mm + start_mm,
                length_mm: end_mm - start_mm,
                cap_mm_s,
                cap_reason: plan.reason(&view, block.ceiling.reason).name().into(),
                enter_mm_s: plan.enter_mm_s,
                peak_mm_s: plan.peak_mm_s,
                exit_mm_s: plan.exit_mm_s,
                time_s,
            });
            start_mm = end_mm;
        }
        records
    }
}
