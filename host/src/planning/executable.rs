//! A plan in the kernel's terms, checked against the number type and against the bounds of a tick.
//!
//! Consumes a [`Plan`]; produces the items of the two streams. A program that is denser than the executor's
//! bounds, or beyond the number type's range, is refused here, with its line, before anything moves.

use core::convert::Infallible;

use motion_kernel::law::{FeedSegment, Ticks};
use motion_kernel::num::Real;
use motion_kernel::program::{Item, write};
use motion_kernel::units::Position;

use super::density::{PiecePace, SegmentPace};
use super::error::{PlanningError, Problem};
use super::lookahead::PlannedSegment;
use super::stretch::Stretch;
use super::{Item as PlanItem, Plan};
use crate::machine::Machine;
use crate::toolpath::{Placed, compile, exact};

/// What the two streams are fed with.
#[derive(Clone, Debug)]
pub struct Executable {
    /// In order.
    pub items: Vec<Item<3>>,
    /// The control tick they are for \[s\].
    pub tick_s: f64,
}

impl Executable {
    /// The executable form of `plan`, for kernels of the number type `R`.
    ///
    /// # Errors
    /// A move can't be made into pieces, a figure is beyond the number type, or more pieces or segments than
    /// the tick's bound fall into one tick.
    pub fn new<R: Real>(plan: &Plan) -> Result<Self, PlanningError> {
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
                    stretch_items::<R>(stretch, plan.tick_s, &mut piece_pace, &mut segment_pace, &mut items)
                        .map_err(|(line, problem)| fail(line, problem))?;
                }
                &PlanItem::Dwell { line, seconds } => {
                    let dwell = Ticks::from_seconds(seconds, plan.tick_s)
                        .ok_or_else(|| fail(line, Problem::Dwell { seconds, tick_s: plan.tick_s }))?;
                    piece_pace.dwell(seconds);
                    segment_pace.next(dwell).map_err(|problem| fail(line, problem))?;
                    items.push(Item::Dwell(dwell));
                }
                PlanItem::Stop { .. } => items.push(Item::Stop),
            }
        }
        Ok(Self { items, tick_s: plan.tick_s })
    }

    /// The program with the machine it was planned for, as bytes for a board.
    #[must_use]
    pub fn to_bytes(&self, machine: &Machine) -> Vec<u8> {
        let mut bytes = Vec::new();
        // Entries of three axes fit the format.
        write(&machine.header(), &self.items, &mut bytes).expect("three axes");
        bytes
    }

    /// The items, as the kernel's [`Supply`](motion_kernel::program::Supply) takes them.
    pub fn supplied(&self) -> impl Iterator<Item = Result<Item<3>, Infallible>> + '_ {
        self.items.iter().map(|&item| Ok(item))
    }
}

fn stretch_items<R: Real>(
    stretch: &Stretch,
    tick_s: f64,
    piece_pace: &mut PiecePace,
    segment_pace: &mut SegmentPace,
    items: &mut Vec<Item<3>>,
) -> Result<(), (u32, Problem)> {
    let (mut pieces, mut piece_blocks) = (Vec::new(), Vec::new());
    let (mut start_mm, mut end) = (0.0, [0.0; 3]);
    for (index, block) in stretch.blocks.iter().enumerate() {
        start_mm = compile::<R>(&block.element, block.line, start_mm, &mut pieces)
            .map_err(|error| (block.line, error.into()))?;
        piece_blocks.resize(pieces.len(), index);
        (_, end) = block.element.ends_mm();
    }
    piece_pace.stretch(stretch, &pieces, &piece_blocks, tick_s)?;
    let mut feed = Vec::new();
    for &PlannedSegment { ramp, length, block } in &stretch.planned {
        let at_line = |problem: Problem| (stretch.blocks[block].line, problem);
        // What the number type cannot hold is refused here.
        let segment = FeedSegment::<R>::ramp(&ramp, length, tick_s)
            .map_err(|error| at_line(Problem::Segment { error, tick_s }))?;
        segment_pace.next(segment.duration()).map_err(at_line)?;
        feed.push(Placed { length, item: Item::Feed { ramp, length } });
    }
    in_order_of_start(&pieces, &feed, items);
    let last_line = stretch.blocks.last().map_or(0, |block| block.line);
    let end = exact(end).map_err(|error| (last_line, error.into()))?;
    items.push(Item::EndOfStretch(end));
    Ok(())
}

/// Both streams as one, in the order of the path positions where the items start.
fn in_order_of_start(pieces: &[Placed], feed: &[Placed], items: &mut Vec<Item<3>>) {
    let (mut feed, mut feed_start) = (feed.iter(), Position::ZERO);
    let mut next_feed = feed.next();
    let mut piece_start = Position::ZERO;
    for piece in pieces {
        while let Some(segment) = next_feed
            && feed_start < piece_start
        {
            items.push(segment.item);
            feed_start = feed_start + segment.length;
            next_feed = feed.next();
        }
        items.push(piece.item);
        piece_start = piece_start + piece.length;
    }
    items.extend(next_feed.into_iter().chain(feed).map(|segment| segment.item));
}
