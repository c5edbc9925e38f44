//! One stretch, from full stop to full stop: ceilings, look-ahead, ramps.

use motion_kernel::law::PlannedRamp;
use motion_kernel::plan::{Block, Ceiling};

use super::Mode;
use super::ceilings::junction_feed;
use super::error::AtLine;
use super::lookahead::LookAhead;
use super::profile::FeedProfile;
use crate::machine::Machine;
use crate::toolpath::{Element, on_path};
use crate::trace::TracedBlock;

/// A block of a stretch, before planning.
#[derive(Clone, Copy, Debug)]
pub struct StretchBlock<const N: usize = 3> {
    /// Program line.
    pub line: u32,
    /// Geometry.
    pub element: Element<N>,
    /// The geometry's arc length \[mm\].
    pub length_mm: f64,
    /// Ceiling with its reason, and the law for its ramps.
    pub ceiling: Ceiling<f64>,
    /// The same whatever the program's feed.
    pub greatest: Ceiling<f64>,
    /// The program's feed along the block \[mm/s\]; infinite for a rapid.
    pub feed_mm_s: f64,
    /// Greatest feed through the junction at its end \[mm/s\].
    pub junction_mm_s: f64,
    /// The program lets the path be changed within a tolerance.
    pub is_smoothed: bool,
    /// Greatest distance from the programmed path and of it from the block, over its tolerance: a bound, 0
    /// where the path is exact.
    pub tolerance_share: f64,
}

impl<const N: usize> StretchBlock<N> {
    /// The greatest feed into the block behind it \[mm/s\]; 0 where the machine has to stop.
    pub(super) fn junction_feed(&self, after: &Self, machine: &Machine<N>) -> f64 {
        let is_smoothed = self.is_smoothed && after.is_smoothed;
        junction_feed([&self.element, &after.element], is_smoothed, machine)
    }

    /// The block as look-ahead sees it.
    pub(super) fn for_lookahead(&self) -> Block<f64> {
        let Ceiling { feed_mm_s: cap_mm_s, law, .. } = self.ceiling;
        Block { length_mm: self.length_mm, cap_mm_s, junction_mm_s: self.junction_mm_s, law }
    }
}

/// What becomes known of a path that grows, in its order. A ramp may come before the blocks it spans.
pub(super) enum Known<const N: usize> {
    /// The next block.
    Block(StretchBlock<N>),
    /// The next ramp or cruise.
    Ramp(PlannedRamp),
    /// The stretch ends here, at rest.
    End,
}

/// Stretches that grow block by block.
pub(super) struct Growing<'m, const N: usize> {
    machine: &'m Machine<N>,
    ahead: LookAhead,
    /// The last block, until the feed to the next one is known.
    last: Option<StretchBlock<N>>,
    end_mm: f64,
    ramps: Vec<PlannedRamp>,
    /// The last block is the last one of a section.
    is_cut: bool,
}

impl<'m, const N: usize> Growing<'m, N> {
    /// Before the first block.
    pub(super) fn new(machine: &'m Machine<N>, mode: Mode) -> Self {
        let ahead = LookAhead::new(mode, machine.tick_s);
        Self { machine, ahead, last: None, end_mm: 0.0, ramps: Vec::new(), is_cut: false }
    }

    /// Takes a section's blocks; the path goes on behind them without a stop, or not. An error comes with the program line.
    pub(super) fn take(
        &mut self,
        blocks: Vec<StretchBlock<N>>,
        goes_on: bool,
        known: &mut impl FnMut(Known<N>) -> AtLine<()>,
    ) -> AtLine<()> {
        for block in blocks {
            if let Some(mut last) = self.last.take() {
                // Within a section it is known already.
                if std::mem::take(&mut self.is_cut) {
                    last.junction_mm_s = last.junction_feed(&block, self.machine);
                    self.ahead.set_junction(last.junction_mm_s);
                }
                self.give(last, known)?;
            }
            self.end_mm += block.length_mm;
            let end = on_path(self.end_mm).map_err(|error| (block.line, error.into()))?;
            self.ahead.push(block.line, block.for_lookahead(), end);
            self.last = Some(block);
        }
        if goes_on {
            self.is_cut = true;
            return self.settle(true, known);
        }
        self.end(known)
    }

    /// The path ends here, at rest, if it has not yet.
    pub(super) fn end(&mut self, known: &mut impl FnMut(Known<N>) -> AtLine<()>) -> AtLine<()> {
        self.is_cut = false;
        match self.last.take() {
            Some(last) => self.give(StretchBlock { junction_mm_s: 0.0, ..last }, known),
            None => Ok(()),
        }
    }

    /// Gives out a block, and ends the stretch where motion stops behind it.
    fn give(&mut self, block: StretchBlock<N>, known: &mut impl FnMut(Known<N>) -> AtLine<()>) -> AtLine<()> {
        known(Known::Block(block))?;
        if block.junction_mm_s > 0.0 {
            return Ok(());
        }
        self.settle(false, known)?;
        self.end_mm = 0.0;
        known(Known::End)
    }

    fn settle(&mut self, goes_on: bool, known: &mut impl FnMut(Known<N>) -> AtLine<()>) -> AtLine<()> {
        self.ahead.settle(goes_on, &mut self.ramps)?;
        self.ramps.drain(..).try_for_each(|ramp| known(Known::Ramp(ramp)))
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
    /// A stretch of blocks with the ramps over them.
    pub(super) fn new(start_mm: f64, blocks: Vec<StretchBlock<N>>, ramps: &[PlannedRamp]) -> Self {
        let lengths_mm = blocks.iter().map(|block| block.length_mm);
        let ends_mm = lengths_mm.scan(0.0, |end_mm, length_mm| {
            *end_mm += length_mm;
            Some(*end_mm)
        });
        let ends_mm = ends_mm.collect();
        Self { start_mm, blocks, ends_mm, profile: FeedProfile::new(ramps) }
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
                is_rapid: block.feed_mm_s.is_infinite(),
            });
            start_mm = end_mm;
        }
        records
    }
}
