//! A plan in the kernel's terms, checked against the bounds of a tick.
//!
//! Consumes a [`Plan`]; produces the items of the two streams for a number type. A program that is
//! denser than the executor's bounds is refused here, with its line, before anything moves.

use motion_kernel::law::{FeedSegment, Ticks};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::units::Position;

use super::density::{PiecePace, SegmentPace};
use super::error::{PlanningError, Problem};
use super::stretch::Stretch;
use super::{Item, Plan};
use crate::toolpath::{compile, exact};

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
        let (mut piece_pace, mut segment_pace) = (PiecePace::default(), SegmentPace::default());
        let mut items = Vec::with_capacity(plan.items.len());
        for item in &plan.items {
            items.push(match item {
                Item::Stretch(stretch) => {
                    stretch_item(stretch, plan.tick_s, &mut piece_pace, &mut segment_pace)
                        .map_err(|(line, problem)| fail(line, problem))?
                }
                &Item::Dwell { line, seconds } => {
                    let dwell = Ticks::from_seconds(seconds, plan.tick_s)
                        .ok_or_else(|| fail(line, Problem::Dwell { seconds, tick_s: plan.tick_s }))?;
                    piece_pace.dwell(seconds);
                    segment_pace.next(dwell).map_err(|problem| fail(line, problem))?;
                    ExecutableItem::Dwell(dwell)
                }
                Item::Stop { .. } => ExecutableItem::Stop,
            });
        }
        Ok(Self { items })
    }
}

fn stretch_item<R: Real>(
    stretch: &Stretch,
    tick_s: f64,
    piece_pace: &mut PiecePace,
    segment_pace: &mut SegmentPace,
) -> Result<ExecutableItem<R>, (u32, Problem)> {
    let (mut pieces, mut piece_blocks) = (Vec::new(), Vec::new());
    let (mut start_mm, mut end) = (0.0, [0.0; 3]);
    for (index, block) in stretch.blocks.iter().enumerate() {
        start_mm = compile(&block.element, block.line, start_mm, &mut pieces)
            .map_err(|error| (block.line, error.into()))?;
        piece_blocks.resize(pieces.len(), index);
        (_, end) = block.element.ends_mm();
    }
    piece_pace.stretch(stretch, &pieces, &piece_blocks, tick_s)?;
    let mut segments = Vec::new();
    for planned in &stretch.planned {
        let at_line = |(block, problem): (usize, Problem)| (stretch.blocks[block].line, problem);
        for segment in planned.segments::<R>(tick_s).map_err(at_line)? {
            let duration = segment.duration();
            segment_pace.next(duration).map_err(|problem| at_line((planned.first, problem)))?;
            segments.push(segment);
        }
    }
    let last_line = stretch.blocks.last().map_or(0, |block| block.line);
    let end = exact(end).map_err(|error| (last_line, error.into()))?;
    Ok(ExecutableItem::Stretch { start_mm: stretch.start_mm, pieces, segments, end })
}
