//! A plan in the kernel's terms, checked against the number type and against the bounds of a tick.
//!
//! Consumes a [`Plan`]; produces the items of the two streams. A program that is denser than the executor's
//! bounds, or beyond the number type's range, is refused here, with its line, before anything moves.

use core::convert::Infallible;

use motion_kernel::exec::PIECES_PER_TICK_MAX;
use motion_kernel::law::Ticks;
use motion_kernel::num::Real;
use motion_kernel::plan::Ceiling;
use motion_kernel::program::{Allowed, Item, PathBlock};
use motion_kernel::units::Position;

use super::ceilings::few_digits;
use super::compiled::bytes;
use super::density::{PiecePace, SegmentPace};
use super::error::{PlanningError, Problem};
use super::lookahead::block_at;
use super::stretch::Stretch;
use super::{Item as PlanItem, Plan};
use crate::gcode::Axis;
use crate::machine::Machine;
use crate::toolpath::{CompileError, Placed, compile, exact, on_path};

/// The items of the two streams.
#[derive(Clone, Debug)]
pub struct Executable<const N: usize = 3> {
    /// The items, in order.
    pub items: Vec<Item<N>>,
    /// The control tick they are for \[s\].
    pub tick_s: f64,
}

impl<const N: usize> Executable<N> {
    /// The executable form of `plan`, for kernels of the number type `R`.
    ///
    /// # Errors
    /// A move can't be made into pieces, a figure is beyond the number type, or more pieces or segments than
    /// the tick's bound fall into one tick.
    pub fn new<R: Real>(plan: &Plan<N>) -> Result<Self, PlanningError> {
        let fail = |line: u32, problem: Problem| PlanningError {
            source_name: plan.source.clone(),
            place: line.into(),
            problem,
        };
        let (mut piece_pace, mut segment_pace) = (PiecePace::default(), SegmentPace::default());
        let mut items = Vec::with_capacity(plan.items.len());
        for item in &plan.items {
            match item {
                PlanItem::Stretch(stretch) => {
                    stretch_items::<R, N>(
                        stretch,
                        plan.tick_s,
                        &mut piece_pace,
                        &mut segment_pace,
                        &mut items,
                    )
                    .map_err(|(line, problem)| fail(line, named(problem, &plan.axes)))?;
                }
                &PlanItem::Dwell { line, seconds } => {
                    let dwell = Ticks::from_seconds(seconds, plan.tick_s)
                        .ok_or_else(|| fail(line, Problem::Dwell { seconds, tick_s: plan.tick_s }))?;
                    piece_pace.dwell(seconds);
                    segment_pace.next(dwell).map_err(|problem| fail(line, problem))?;
                    items.push(Item::Dwell(dwell));
                }
                PlanItem::Switch { to, .. } => items.push(Item::Switch(*to)),
                PlanItem::Stop { .. } => items.push(Item::Stop),
            }
        }
        Ok(Self { items, tick_s: plan.tick_s })
    }

    /// The bytes for a board without live control.
    pub fn without_blocks(&self) -> impl Iterator<Item = &Item<N>> {
        self.items.iter().filter(|item| !matches!(item, Item::Block(_)))
    }

    /// The program with the machine it was planned for, as bytes for a board without live control: without
    /// blocks.
    #[must_use]
    pub fn to_bytes(&self, machine: &Machine<N>) -> Vec<u8> {
        bytes(machine, self.without_blocks())
    }

    /// The same for a board with live control.
    #[must_use]
    pub fn to_live_bytes(&self, machine: &Machine<N>) -> Vec<u8> {
        bytes(machine, &self.items)
    }

    /// The items of motion, as the kernel's [`Supply`](motion_kernel::program::Supply) takes them: without switches of
    /// outputs.
    pub fn supplied(&self) -> impl Iterator<Item = Result<Item<N>, Infallible>> + '_ {
        self.items.iter().filter(|item| !matches!(item, Item::Switch(_))).map(|&item| Ok(item))
    }
}

/// A problem that names the axis that it is about.
fn named<const N: usize>(problem: Problem, axes: &[Option<Axis>; N]) -> Problem {
    match problem {
        Problem::Geometry(CompileError::Coordinate { axis: place, mm: found }) => {
            axes.get(place).copied().flatten().map_or(problem, |axis| Problem::Coordinate { axis, found })
        }
        problem => problem,
    }
}

fn stretch_items<R: Real, const N: usize>(
    stretch: &Stretch<N>,
    tick_s: f64,
    piece_pace: &mut PiecePace,
    segment_pace: &mut SegmentPace,
    items: &mut Vec<Item<N>>,
) -> Result<(), (u32, Problem)> {
    let (mut pieces, mut piece_blocks) = (Vec::new(), Vec::new());
    let (mut start_mm, mut end) = (0.0, [0.0; N]);
    for (index, block) in stretch.blocks.iter().enumerate() {
        start_mm = compile::<R, N>(&block.element, block.line, start_mm, &mut pieces)
            .map_err(|error| (block.line, error.into()))?;
        piece_blocks.resize(pieces.len(), index);
        (_, end) = block.element.ends_mm();
    }
    piece_pace.stretch(stretch, &pieces, &piece_blocks, tick_s)?;
    let ends = block_ends(stretch)?;
    let (mut feed, mut start) = (Vec::new(), Position::ZERO);
    for placed in stretch.profile.ramps() {
        let at_line = |problem: Problem| (stretch.blocks[block_at(&ends, start)].line, problem);
        // What the number type cannot hold is refused here.
        let segment = placed.planned.segment::<R>(tick_s);
        let segment = segment.map_err(|error| at_line(Problem::Segment { error, tick_s }))?;
        segment_pace.next(segment.duration()).map_err(at_line)?;
        let length = placed.planned.length;
        feed.push(Placed { length, item: Item::Feed(placed.planned) });
        start = start + length;
    }
    let blocks = path_blocks(stretch, &ends, &Dense::of(&pieces, tick_s));
    in_order_of_start(&blocks, &pieces, &feed, items);
    let last_line = stretch.blocks.last().map_or(0, |block| block.line);
    let end = exact(end).map_err(|error| (last_line, error.into()))?;
    items.push(Item::EndOfStretch(end));
    Ok(())
}

/// A piece's place on the path, and the greatest feed \[mm/s\] at which no more pieces end in a tick around
/// it than the executor's bound.
struct Dense {
    start: Position,
    end: Position,
    most_mm_s: f64,
}

impl Dense {
    fn of<const N: usize>(pieces: &[Placed<N>], tick_s: f64) -> Vec<Self> {
        let mut end = Position::ZERO;
        let place = |piece: &Placed<N>| {
            let start = end;
            end = end + piece.length;
            Self { start, end, most_mm_s: f64::INFINITY }
        };
        let mut all: Vec<Self> = pieces.iter().map(place).collect();
        for first in 0..all.len().saturating_sub(PIECES_PER_TICK_MAX - 1) {
            let together = &mut all[first..first + PIECES_PER_TICK_MAX];
            let length = together[PIECES_PER_TICK_MAX - 1].end - together[0].start;
            let feed_mm_s = length.to_mm() / tick_s;
            for piece in together {
                piece.most_mm_s = piece.most_mm_s.min(feed_mm_s);
            }
        }
        all
    }

    /// The greatest feed on the path from `start` to `end`.
    fn most_mm_s(all: &[Self], start: Position, end: Position) -> f64 {
        let within =
            all.partition_point(|piece| piece.end <= start)..all.partition_point(|piece| piece.start < end);
        all.get(within).unwrap_or(&[]).iter().map(|piece| piece.most_mm_s).fold(f64::INFINITY, f64::min)
    }
}

/// Where each block ends.
fn block_ends<const N: usize>(stretch: &Stretch<N>) -> Result<Vec<Position>, (u32, Problem)> {
    let ends = stretch.blocks.iter().zip(stretch.ends_mm());
    ends.map(|(block, &end_mm)| on_path(end_mm).map_err(|error| (block.line, error.into()))).collect()
}

/// The ceilings of the feed along the path. Neighbours with equal ceilings are one block.
fn path_blocks<const N: usize>(stretch: &Stretch<N>, ends: &[Position], dense: &[Dense]) -> Vec<Placed<N>> {
    let allowed = |ceiling: &Ceiling<f64>, most_mm_s: f64| Allowed {
        cap_mm_s: ceiling.feed_mm_s.min(few_digits(most_mm_s)),
        limits: ceiling.law.limits(),
    };
    let mut blocks: Vec<PathBlock> = Vec::new();
    let mut start = Position::ZERO;
    for (block, &end) in stretch.blocks.iter().zip(ends) {
        let most_mm_s = Dense::most_mm_s(dense, start, end);
        let next = PathBlock::new(
            end - start,
            block.feed_mm_s,
            allowed(&block.ceiling, most_mm_s),
            allowed(&block.greatest, most_mm_s),
            block.junction_mm_s,
        );
        start = end;
        match blocks.last_mut() {
            Some(last) if last.junction_mm_s() >= last.greatest().cap_mm_s && last.holds_like(&next) => {
                *last = last.with(&next);
            }
            _ => blocks.push(next),
        }
    }
    blocks.into_iter().map(|block| Placed { length: block.length, item: Item::Block(block) }).collect()
}

/// Blocks and both streams as one, in the order of the path positions where the items start.
pub(super) fn in_order_of_start<const N: usize>(
    blocks: &[Placed<N>],
    pieces: &[Placed<N>],
    feed: &[Placed<N>],
    items: &mut Vec<Item<N>>,
) {
    let mut ordered: Vec<(Position, Item<N>)> = Vec::with_capacity(blocks.len() + pieces.len() + feed.len());
    for kind in [blocks, pieces, feed] {
        let mut start = Position::ZERO;
        for placed in kind {
            ordered.push((start, placed.item));
            start = start + placed.length;
        }
    }
    // Stable: where all three start, a block comes before its piece, and that before its feed.
    ordered.sort_by_key(|&(start, _)| start);
    items.extend(ordered.into_iter().map(|(_, item)| item));
}
