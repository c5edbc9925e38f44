//! A plan in the kernel's terms, checked against the bounds of a tick.
//!
//! Consumes a [`Plan`]; produces the items of the two streams for a number type. A program that is
//! denser than the executor's bounds is refused here, with its line, before anything moves.

use motion_kernel::exec::PIECES_PER_TICK_MAX;
use motion_kernel::law::{FeedSegment, Ticks};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::queue::SEGMENTS_PER_TICK_MAX;
use motion_kernel::units::Position;

use super::error::{PlanningError, Problem};
use super::stretch::Stretch;
use super::{Item, Plan};
use crate::toolpath::{Vector, compile};

/// What the two streams are fed with.
#[derive(Clone, Debug)]
pub struct Executable<R: Real> {
    /// In order.
    pub items: Vec<ExecutableItem<R>>,
}

/// One thing to feed.
#[derive(Clone, Debug)]
pub enum ExecutableItem<R: Real> {
    /// Motion from one full stop to the next.
    Stretch {
        /// Path position of its start, from the program's start \[mm\].
        start_mm: f64,
        /// The path.
        pieces: Vec<Piece<R, 3>>,
        /// The feed over it.
        segments: Vec<FeedSegment<R>>,
        /// Exactly where it ends.
        end: [Position; 3],
    },
    /// Rest.
    Dwell(Ticks),
    /// Program stop.
    Stop,
}

impl<R: Real> Executable<R> {
    /// The executable form of `plan`.
    ///
    /// # Errors
    /// A move can't be made into pieces, or more pieces or segments than the tick's bound fall into
    /// one tick.
    pub fn new(plan: &Plan) -> Result<Self, PlanningError> {
        let fail = |line: u32, problem: Problem| PlanningError {
            source_name: plan.source.clone(),
            place: line.into(),
            problem,
        };
        let mut pace = Pace::default();
        let mut items = Vec::with_capacity(plan.items.len());
        for item in &plan.items {
            items.push(match item {
                Item::Stretch(stretch) => {
                    let item = stretch_item(stretch, plan.tick_s).map_err(|(line, p)| fail(line, p))?;
                    if let ExecutableItem::Stretch { segments, .. } = &item {
                        let line = stretch.blocks.first().map_or(0, |block| block.line);
                        for segment in segments {
                            pace.next(segment.duration()).map_err(|p| fail(line, p))?;
                        }
                    }
                    item
                }
                &Item::Dwell { line, seconds } => {
                    let dwell = Ticks::from_seconds(seconds, plan.tick_s).ok_or_else(|| {
                        fail(line, Problem::Dwell { seconds, longest_s: Ticks::LIMIT * plan.tick_s })
                    })?;
                    pace.next(dwell).map_err(|p| fail(line, p))?;
                    ExecutableItem::Dwell(dwell)
                }
                Item::Stop { .. } => ExecutableItem::Stop,
            });
        }
        Ok(Self { items })
    }
}

fn stretch_item<R: Real>(stretch: &Stretch, tick_s: f64) -> Result<ExecutableItem<R>, (u32, Problem)> {
    let first_line = stretch.blocks.first().map_or(0, |block| block.line);
    let (mut pieces, mut piece_blocks) = (Vec::new(), Vec::new());
    let (mut start_mm, mut end) = (0.0, [0.0; 3]);
    for (index, block) in stretch.blocks.iter().enumerate() {
        start_mm = compile(&block.element, block.line, start_mm, &mut pieces)
            .map_err(|error| (block.line, error.into()))?;
        piece_blocks.resize(pieces.len(), index);
        (_, end) = block.element.ends_mm();
    }
    not_too_dense(stretch, &pieces, &piece_blocks, tick_s)?;
    let mut segments = Vec::new();
    for planned in &stretch.planned {
        segments.extend(planned.segments(tick_s).map_err(|problem| (first_line, problem))?);
    }
    let end = exact(end).map_err(|problem| (first_line, problem))?;
    Ok(ExecutableItem::Stretch { start_mm: stretch.start_mm, pieces, segments, end })
}

fn exact(point: Vector) -> Result<[Position; 3], Problem> {
    let mut exact = [Position::ZERO; 3];
    for (exact, mm) in exact.iter_mut().zip(point) {
        *exact = Position::from_mm(mm)
            .ok_or(crate::toolpath::CompileError::OutOfRange { length_mm: 0.0, at_mm: point })?;
    }
    Ok(exact)
}

/// However the ticks fall, at most [`PIECES_PER_TICK_MAX`] pieces end within one: any so many in a row
/// are at least as long as the way of one tick at their highest feed.
fn not_too_dense<R: Real>(
    stretch: &Stretch,
    pieces: &[Piece<R, 3>],
    piece_blocks: &[usize],
    tick_s: f64,
) -> Result<(), (u32, Problem)> {
    for (window, blocks) in pieces.windows(PIECES_PER_TICK_MAX).zip(piece_blocks.windows(PIECES_PER_TICK_MAX))
    {
        let length_mm: f64 = window.iter().map(|piece| piece.length().to_mm()).sum();
        let (first, last) = (blocks[0], blocks[PIECES_PER_TICK_MAX - 1]);
        let cap = |block: usize| stretch.blocks[block].ceiling.feed_mm_s;
        if (first..=last).all(|block| length_mm >= cap(block) * tick_s) {
            continue;
        }
        // The ceilings alone do not tell: look at the planned feed.
        let ends = stretch.ends_mm();
        let from_mm = if first == 0 { 0.0 } else { ends[first - 1] };
        let feed_mm_s = stretch.profile.over(from_mm, ends[last]).0.peak_mm_s;
        if length_mm < feed_mm_s * tick_s {
            let problem = Problem::DensePieces {
                pieces: PIECES_PER_TICK_MAX,
                length_mm,
                feed_mm_s,
                feed_max_mm_s: length_mm / tick_s,
                tick_s,
            };
            return Err((stretch.blocks[last].line, problem));
        }
    }
    Ok(())
}

/// The latest durations, as the queue looks at them.
#[derive(Default)]
struct Pace(std::collections::VecDeque<Ticks>);

impl Pace {
    fn next(&mut self, duration: Ticks) -> Result<(), Problem> {
        self.0.push_back(duration);
        if self.0.len() > SEGMENTS_PER_TICK_MAX {
            self.0.pop_front();
        }
        let together = self.0.iter().fold(Ticks::ZERO, |sum, &one| sum.plus(one));
        if self.0.len() == SEGMENTS_PER_TICK_MAX && together < Ticks::ONE {
            return Err(Problem::DenseSegments { segments: SEGMENTS_PER_TICK_MAX, ticks: together.to_f64() });
        }
        Ok(())
    }
}
