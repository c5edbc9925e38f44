//! Blocks and ramps as items for the kernel, in the order of the path, while the stretch still grows.
//!
//! Consumes blocks and ramps as they become known; produces pieces, blocks and ramps, each where it starts. What is denser than
//! the executor's bounds, or beyond the number type's range, is refused with its line, before it is given out. The items of a
//! stretch are the same however it becomes known.

use std::collections::VecDeque;
use std::marker::PhantomData;

use motion_kernel::exec::PIECES_PER_TICK_MAX;
use motion_kernel::law::{PlannedRamp, Ticks};
use motion_kernel::num::Real;
use motion_kernel::plan::Ceiling;
use motion_kernel::program::{Allowed, Item, PathBlock};
use motion_kernel::units::Position;

use super::ceilings::few_digits;
use super::density::{PiecePace, SegmentPace};
use super::error::{AtLine, Problem, named};
use super::profile::{PlacedRamp, ROUNDING_MM};
use super::stretch::StretchBlock;
use crate::gcode::Axis;
use crate::toolpath::{Placed, compile, exact, on_path};

/// Blocks with equal ceilings that become one at most. So the wait for the next one is bounded.
const MERGED_MAX: u32 = 256;

/// Makes items for kernels of the number type `R`.
pub(super) struct Items<R, const N: usize> {
    tick_s: f64,
    axes: [Option<Axis>; N],
    piece_pace: PiecePace,
    segment_pace: SegmentPace,
    stretch: Open<N>,
    number: PhantomData<R>,
}

/// A stretch, as far as its items are not given out.
#[derive(Default)]
struct Open<const N: usize> {
    /// Where its blocks end so far \[mm\], and in the machine's space; and the line of the last one.
    end_mm: f64,
    to: Option<[f64; N]>,
    line: u32,
    /// Pieces: those that are given out and may share a tick with others, then those that are not.
    pieces: VecDeque<Piece<N>>,
    given: usize,
    /// Pieces that were dropped before.
    dropped: usize,
    /// Pieces whose density was not looked at, of those that are not given out.
    paced: usize,
    /// Blocks whose pieces may still turn out to be too dense for their feed.
    blocks: VecDeque<Block>,
    /// Blocks with equal ceilings so far, and how many.
    merged: Option<(Position, PathBlock, u32)>,
    /// Blocks to be given out.
    path_blocks: VecDeque<(Position, PathBlock)>,
    /// Ramps to be given out.
    ramps: VecDeque<(Position, PlannedRamp)>,
    /// Ramps with their times, as far as pieces lie on them; and where and when the last one ends \[mm, s\].
    profile: VecDeque<PlacedRamp>,
    planned: Position,
    planned_mm: f64,
    planned_s: f64,
}

/// A piece's place on the path, and the greatest feed \[mm/s\] at which no more pieces end in a tick around it than the
/// executor's bound.
struct Piece<const N: usize> {
    start: Position,
    end: Position,
    placed: Placed<N>,
    line: u32,
    ceiling_mm_s: f64,
    most_mm_s: f64,
}

/// A block with the numbers of its first piece and the one behind its last.
struct Block {
    start: Position,
    end: Position,
    feed_mm_s: f64,
    ceiling: Ceiling<f64>,
    greatest: Ceiling<f64>,
    junction_mm_s: f64,
    pieces: (usize, usize),
}

impl<R: Real, const N: usize> Items<R, N> {
    /// For a machine with this control tick \[s\] and these axes.
    pub(super) fn new(tick_s: f64, axes: [Option<Axis>; N]) -> Self {
        Self {
            tick_s,
            axes,
            piece_pace: PiecePace::default(),
            segment_pace: SegmentPace::default(),
            stretch: Open::default(),
            number: PhantomData,
        }
    }

    /// The next block of the stretch.
    pub(super) fn block(&mut self, block: &StretchBlock<N>) -> AtLine<()> {
        let line = block.line;
        let placed = self.stretch.add::<R>(block, self.tick_s);
        placed.map_err(|problem| (line, named(problem, &self.axes)))
    }

    /// The next ramp or cruise of the stretch.
    pub(super) fn ramp(&mut self, planned: PlannedRamp) -> AtLine<()> {
        let (open, tick_s) = (&mut self.stretch, self.tick_s);
        let line = open.line_at(open.planned);
        // What the number type cannot hold is refused here.
        let segment = planned.segment::<R>(tick_s);
        let segment = segment.map_err(|error| (line, Problem::Segment { error, tick_s }))?;
        self.segment_pace.next(segment.duration()).map_err(|problem| (line, problem))?;
        open.ramps.push_back((open.planned, planned));
        let placed = PlacedRamp { start_mm: open.planned_mm, start_s: open.planned_s, planned };
        open.planned = open.planned + planned.length;
        open.planned_mm += placed.length_mm();
        open.planned_s += placed.time_s();
        open.profile.push_back(placed);
        Ok(())
    }

    /// Gives out what is known to be as it is.
    pub(super) fn give(&mut self, put: &mut impl FnMut(Item<N>) -> AtLine<()>) -> AtLine<()> {
        self.pace(Some(self.stretch.planned))?;
        let limit = self.stretch.limit();
        self.stretch.give(Some(limit), put)
    }

    /// Gives out the rest of the stretch, which ends here.
    pub(super) fn end(&mut self, put: &mut impl FnMut(Item<N>) -> AtLine<()>) -> AtLine<()> {
        self.stretch.finish_blocks(true);
        self.pace(None)?;
        self.stretch.give(None, put)?;
        let open = std::mem::take(&mut self.stretch);
        self.piece_pace.end((open.planned_s, open.end_mm));
        if let Some(to) = open.to {
            let end = exact(to).map_err(|error| (open.line, named(error.into(), &self.axes)))?;
            put(Item::EndOfStretch(end))?;
        }
        Ok(())
    }

    /// A dwell between stretches.
    pub(super) fn dwell(&mut self, line: u32, seconds: f64) -> AtLine<Item<N>> {
        let dwell = Ticks::from_seconds(seconds, self.tick_s)
            .ok_or((line, Problem::Dwell { seconds, tick_s: self.tick_s }))?;
        self.piece_pace.dwell(seconds);
        self.segment_pace.next(dwell).map_err(|problem| (line, problem))?;
        Ok(Item::Dwell(dwell))
    }

    /// Looks at the times of the pieces that end before a place, or of all.
    fn pace(&mut self, until: Option<Position>) -> AtLine<()> {
        let open = &mut self.stretch;
        while let Some(piece) =
            open.pieces.get(open.paced).filter(|piece| until.is_none_or(|until| piece.end <= until))
        {
            let (end_mm, line) = (piece.end.to_mm(), piece.line);
            // At a junction, the ramp that ends there.
            while open.profile.len() > 1
                && open.profile.get(1).is_some_and(|next| next.start_mm + ROUNDING_MM < end_mm)
            {
                open.profile.pop_front();
            }
            let time_s = open.profile.front().map_or(0.0, |placed| placed.at(end_mm).1);
            let (length_mm, ceiling_mm_s) = (piece.placed.length.to_mm(), piece.ceiling_mm_s);
            self.piece_pace
                .piece((time_s, end_mm), length_mm, ceiling_mm_s, self.tick_s)
                .map_err(|problem| (line, problem))?;
            open.paced += 1;
        }
        Ok(())
    }
}

impl<const N: usize> Open<N> {
    fn add<R: Real>(&mut self, block: &StretchBlock<N>, tick_s: f64) -> Result<(), Problem> {
        // A piece is made as the one before lets expect.
        let mut placed: Vec<Placed<N>> = self.pieces.back().map(|piece| piece.placed).into_iter().collect();
        let before = placed.len();
        let mut start = on_path(self.end_mm)?;
        let first = self.dropped + self.pieces.len();
        let block_start = start;
        self.end_mm = compile::<R, N>(&block.element, block.line, self.end_mm, &mut placed)?;
        for placed in placed.into_iter().skip(before) {
            let end = start + placed.length;
            let ceiling_mm_s = block.ceiling.feed_mm_s;
            let most_mm_s = f64::INFINITY;
            self.pieces.push_back(Piece { start, end, placed, line: block.line, ceiling_mm_s, most_mm_s });
            start = end;
            self.see_density(tick_s);
        }
        let pieces = (first, self.dropped + self.pieces.len());
        (self.to, self.line) = (Some(block.element.ends_mm().1), block.line);
        self.blocks.push_back(Block {
            start: block_start,
            end: on_path(self.end_mm)?,
            feed_mm_s: block.feed_mm_s,
            ceiling: block.ceiling,
            greatest: block.greatest,
            junction_mm_s: block.junction_mm_s,
            pieces,
        });
        self.finish_blocks(false);
        Ok(())
    }

    /// The feed at which the latest pieces all end within a tick.
    fn see_density(&mut self, tick_s: f64) {
        let Some(first) = self.pieces.len().checked_sub(PIECES_PER_TICK_MAX) else { return };
        let mut together = self.pieces.range_mut(first..);
        let Some(start) = together.next().map(|piece| piece.start) else { return };
        let length = together.next_back().map_or(start, |piece| piece.end) - start;
        let feed_mm_s = length.to_mm() / tick_s;
        for piece in self.pieces.range_mut(first..) {
            piece.most_mm_s = piece.most_mm_s.min(feed_mm_s);
        }
    }

    /// Moves on blocks whose ceilings no further piece changes.
    fn finish_blocks(&mut self, is_end: bool) {
        let known = self.dropped + self.pieces.len();
        while let Some(block) =
            self.blocks.pop_front_if(|block| is_end || block.pieces.1 + PIECES_PER_TICK_MAX <= known + 1)
        {
            let own =
                block.pieces.0.saturating_sub(self.dropped)..block.pieces.1.saturating_sub(self.dropped);
            let most_mm_s = self.pieces.range(own).map(|piece| piece.most_mm_s).fold(f64::INFINITY, f64::min);
            let allowed = |ceiling: &Ceiling<f64>| Allowed {
                cap_mm_s: ceiling.feed_mm_s.min(few_digits(most_mm_s)),
                limits: ceiling.law.limits(),
            };
            let next = PathBlock::new(
                block.end - block.start,
                block.feed_mm_s,
                allowed(&block.ceiling),
                allowed(&block.greatest),
                block.junction_mm_s,
            );
            self.merged = match self.merged.take() {
                Some((start, last, count))
                    if count < MERGED_MAX
                        && last.junction_mm_s() >= last.greatest().cap_mm_s
                        && last.holds_like(&next) =>
                {
                    Some((start, last.with(&next), count + 1))
                }
                Some((start, last, _)) => {
                    self.path_blocks.push_back((start, last));
                    Some((block.start, next, 1))
                }
                None => Some((block.start, next, 1)),
            };
        }
        if is_end && let Some((start, last, _)) = self.merged.take() {
            self.path_blocks.push_back((start, last));
        }
    }

    /// Items that start before this place are known.
    fn limit(&self) -> Position {
        let waiting = self.blocks.front().map(|block| block.start);
        let merged = self.merged.as_ref().map(|&(start, _, _)| start);
        let unpaced = self.pieces.get(self.paced).map(|piece| piece.start);
        let known = [waiting, merged, unpaced].into_iter().flatten().fold(self.planned, Position::min);
        // Where no block is known yet, nothing is.
        if self.to.is_none() {
            Position::ZERO
        } else {
            known.min(self.pieces.back().map_or(known, |last| last.end))
        }
    }

    /// Gives out the items that start before a limit: a block before its piece, and that before its ramp.
    fn give(&mut self, limit: Option<Position>, put: &mut impl FnMut(Item<N>) -> AtLine<()>) -> AtLine<()> {
        loop {
            let block = self.path_blocks.front().map(|&(start, _)| start);
            let piece = self.pieces.get(self.given).map(|piece| piece.start);
            let ramp = self.ramps.front().map(|&(start, _)| start);
            let Some(first) = [block, piece, ramp].into_iter().flatten().min() else { break };
            if limit.is_some_and(|limit| first >= limit) {
                break;
            }
            if block == Some(first) {
                if let Some((_, block)) = self.path_blocks.pop_front() {
                    put(Item::Block(block))?;
                }
            } else if piece == Some(first) {
                if let Some(piece) = self.pieces.get(self.given) {
                    put(piece.placed.item)?;
                }
                self.given += 1;
            } else if let Some((_, ramp)) = self.ramps.pop_front() {
                put(Item::Feed(ramp))?;
            }
        }
        // Those that later ones may share a tick with stay.
        let kept = PIECES_PER_TICK_MAX.min(self.given);
        let waiting = self.blocks.front().map_or(usize::MAX, |block| block.pieces.0 - self.dropped);
        let dropped = (self.given - kept).min(waiting).min(self.paced);
        self.pieces.drain(..dropped);
        self.dropped += dropped;
        self.given -= dropped;
        self.paced -= dropped;
        Ok(())
    }

    /// The program line of the path at a place.
    fn line_at(&self, at: Position) -> u32 {
        let index = self.pieces.partition_point(|piece| piece.end <= at);
        self.pieces.get(index).map_or(self.line, |piece| piece.line)
    }
}
