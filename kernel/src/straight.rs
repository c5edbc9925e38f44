//! One straight stretch from rest to rest, as the items of a program.
//!
//! Consumes where the machine stands, where it is to go and what holds the feed; produces what the
//! [`Director`](crate::live::Director) drives as any other program: a jog, or the way to a program's start.
//!
//! Background; an item at a time, no memory for the path.

use core::convert::Infallible;

use crate::law::{Law, LimitError, Limits, Ramp, SegmentError};
use crate::num::Root;
use crate::plan::{Block, BlockPlan, plan, segments};
use crate::program::{Allowed, Item, PathBlock};
use crate::units::Position;

/// Pieces of path are at most so long, in every number type.
const PIECE: Position = Position::from_bits(16 << 32);

/// Why there is no straight stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StraightError {
    /// A limit is not a positive number.
    Limit(LimitError),
    /// It is longer than the kernel's range \[mm\].
    Length {
        /// Its length.
        length_mm: f64,
    },
    /// There is no motion of the law over its length.
    Segment(SegmentError),
}

impl core::fmt::Display for StraightError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Limit(error) => error.fmt(f),
            Self::Length { length_mm } => {
                write!(f, "a straight of {length_mm} mm: expected at most {} mm", Position::LIMIT_MM)
            }
            Self::Segment(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for StraightError {}

/// The items of a straight stretch; none where it has no length.
#[derive(Clone, Debug)]
pub struct Straight<const AXES: usize> {
    start: [Position; AXES],
    end: [Position; AXES],
    direction: [f64; AXES],
    length: Position,
    block: Option<PathBlock>,
    /// How far pieces and feed are given out.
    path: Position,
    feed: Position,
    ramps: [Option<(Ramp<f64>, Position)>; 3],
    is_ended: bool,
}

impl<const AXES: usize> Straight<AXES> {
    /// From rest at `start` to rest at `end` with ramps within `limits`, at a feed of `feed_mm_s` above 0, at most
    /// `most_mm_s` under an override, for ticks of `tick_s`.
    ///
    /// # Errors
    /// It can't be driven; nothing else fails once it is made.
    pub fn new(
        start: [Position; AXES],
        end: [Position; AXES],
        limits: Limits<f64>,
        [feed_mm_s, most_mm_s]: [f64; 2],
        tick_s: f64,
    ) -> Result<Self, StraightError> {
        let mut way_mm = [0.0; AXES];
        for ((way_mm, &start), &end) in way_mm.iter_mut().zip(&start).zip(&end) {
            *way_mm = (end - start).to_mm();
        }
        // Along one axis the root is exact, so the length is, too.
        let length_mm = Root::sqrt(way_mm.iter().map(|mm| mm * mm).sum::<f64>());
        let length = Position::from_mm(length_mm).ok_or(StraightError::Length { length_mm })?;
        let law = Law::new(limits).map_err(StraightError::Limit)?;
        let (mut direction, mut ramps, mut block) = ([0.0; AXES], [None; 3], None);
        if length > Position::ZERO {
            direction = way_mm.map(|mm| mm / length_mm);
            let planned = Block { length_mm: length.to_mm(), cap_mm_s: feed_mm_s, joint_mm_s: 0.0, law };
            let mut plans = [BlockPlan::default()];
            // From rest to rest there always is a plan.
            let _ = plan(&[planned], 0.0, 0.0, &mut plans);
            let [of_block] = plans;
            let made = segments::<f64, f64>(&planned, &of_block, Position::ZERO, length, tick_s);
            ramps = made.map_err(StraightError::Segment)?.map(|segment| {
                let segment = segment?;
                Some((*segment.as_ramp(), segment.length()))
            });
            let allowed = |cap_mm_s| Allowed { cap_mm_s, limits };
            block = Some(PathBlock::new(length, feed_mm_s, allowed(feed_mm_s), allowed(most_mm_s), 0.0));
        }
        Ok(Self {
            start,
            end,
            direction,
            length,
            block,
            path: Position::ZERO,
            feed: Position::ZERO,
            ramps,
            is_ended: length == Position::ZERO,
        })
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> [Position; AXES] {
        self.end
    }

    /// The position `path` after its start.
    fn after(&self, path: Position) -> [Position; AXES] {
        let (mut position, path_mm) = (self.start, path.to_mm());
        for (position, direction) in position.iter_mut().zip(&self.direction) {
            // Within what it is a part of.
            *position = *position + Position::from_mm(direction * path_mm).unwrap_or(Position::ZERO);
        }
        position
    }
}

impl<const AXES: usize> Iterator for Straight<AXES> {
    type Item = Result<Item<AXES>, Infallible>;

    /// Path and feed in the order of where they start, so that whichever queue is full, the other one is as far.
    fn next(&mut self) -> Option<Self::Item> {
        if let Some(block) = self.block.take() {
            return Some(Ok(Item::Block(block)));
        }
        if self.path < self.length && self.path <= self.feed {
            let length = PIECE.min(self.length - self.path);
            let start = self.after(self.path);
            self.path = self.path + length;
            return Some(Ok(Item::Line { line: 0, start, direction: self.direction, length }));
        }
        if let Some((ramp, length)) = self.ramps.iter_mut().find_map(Option::take) {
            self.feed = self.feed + length;
            return Some(Ok(Item::Feed { ramp, length }));
        }
        if core::mem::replace(&mut self.is_ended, true) {
            return None;
        }
        Some(Ok(Item::EndOfStretch(self.end)))
    }
}
