//! Checks a whole program for everything that the streams would refuse, without streams; for live control
//! also for the blocks that it plans with.
//!
//! Consumes items; produces the first refusal. Background: as much work as filling the streams, and nothing
//! is kept. If it accepts a program, [`Supply`](super::Supply) hands it over without an error. It refuses a
//! program that switches outputs: a board that has them checks [`switches_as_stops`](super::switches_as_stops). Only the tick
//! can tell the rest: how many pieces end in one ([`PIECES_PER_TICK_MAX`](crate::exec::PIECES_PER_TICK_MAX)),
//! and whether the streams are filled fast enough.

use super::supply::{Ready, SupplyError};
use super::{Header, Item};
use crate::num::Real;
use crate::queue::Acceptance;
use crate::units::Position;

/// What is wrong with a program.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CheckError<E> {
    /// It starts beyond the range of positions.
    Start {
        /// The axis, from 0.
        axis: usize,
        /// The start position \[mm\].
        mm: f64,
    },
    /// An item can't be executed.
    Item {
        /// The item, from 0.
        index: u32,
        /// Why.
        cause: SupplyError<E>,
    },
    /// Up to an item, or after the last one, path is not covered by blocks, or blocks cover no path.
    #[cfg(feature = "live")]
    NotHeld {
        /// The item, from 0.
        index: u32,
    },
    /// It ends inside a stretch.
    Unfinished,
}

impl<E: core::fmt::Display> core::fmt::Display for CheckError<E> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Start { axis, mm } => {
                write!(f, "start of axis {axis} at {mm} mm: expected at most ±{} mm", Position::LIMIT_MM)
            }
            Self::Item { index, cause } => write!(f, "item {index}: {cause}"),
            #[cfg(feature = "live")]
            Self::NotHeld { index } => {
                write!(
                    f,
                    "item {index}: path and blocks differ, expected blocks before the path that they hold the feed of"
                )
            }
            Self::Unfinished => write!(f, "no end of the last stretch"),
        }
    }
}

impl<E: core::fmt::Debug + core::fmt::Display> core::error::Error for CheckError<E> {}

/// Checks that a kernel of the number type `R` can execute all of `items`, from the program with `header`.
///
/// # Errors
/// The first thing that is wrong.
pub fn check<R: Real, const AXES: usize, E>(
    header: &Header<AXES>,
    items: impl Iterator<Item = Result<Item<AXES>, E>>,
) -> Result<(), CheckError<E>> {
    each::<R, AXES, E>(header, items, |_, _| Ok(()))
}

/// The same for a kernel under live control: in every stretch, blocks come before the path that they cover,
/// and end with it.
///
/// # Errors
/// The first thing that is wrong.
#[cfg(feature = "live")]
pub fn check_live<R: Real, const AXES: usize, E>(
    header: &Header<AXES>,
    items: impl Iterator<Item = Result<Item<AXES>, E>>,
) -> Result<(), CheckError<E>> {
    let (mut held, mut count) = (Held::default(), 0);
    each::<R, AXES, E>(header, items, |index, item| {
        count = index.wrapping_add(1);
        if held.goes_on(item) { Ok(()) } else { Err(CheckError::NotHeld { index }) }
    })?;
    if held.is_whole() { Ok(()) } else { Err(CheckError::NotHeld { index: count }) }
}

fn each<R: Real, const AXES: usize, E>(
    header: &Header<AXES>,
    items: impl Iterator<Item = Result<Item<AXES>, E>>,
    mut and: impl FnMut(u32, &Item<AXES>) -> Result<(), CheckError<E>>,
) -> Result<(), CheckError<E>> {
    for (axis, start) in header.start.iter().enumerate() {
        if !start.is_within_limit() {
            return Err(CheckError::Start { axis, mm: start.to_mm() });
        }
    }
    let mut accept = Acceptance::<R, AXES>::new(header.rules, header.start);
    let mut index: u32 = 0;
    for item in items {
        let at_item = |cause| CheckError::Item { index, cause };
        let item = item.map_err(SupplyError::Source).map_err(at_item)?;
        let ready = item.ready(header.tick_s).map_err(at_item)?;
        take(&mut accept, &ready).map_err(at_item)?;
        and(index, &item)?;
        index = index.wrapping_add(1);
    }
    accept.at_rest().map_err(|_| CheckError::Unfinished)
}

/// The length of a stretch, and how much of it is covered by blocks.
#[cfg(feature = "live")]
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    path: Position,
    blocks: Position,
}

#[cfg(feature = "live")]
impl Held {
    fn goes_on<const AXES: usize>(&mut self, item: &Item<AXES>) -> bool {
        match item {
            Item::Block(block) => {
                self.blocks = self.blocks + block.length;
                block.length >= Position::ZERO
            }
            Item::Line { length, .. } | Item::Septic { length, .. } => {
                self.path = self.path + *length;
                self.path <= self.blocks
            }
            Item::EndOfStretch(_) => {
                let is_whole = self.is_whole();
                *self = Self::default();
                is_whole
            }
            Item::Feed(_) => true,
            // Blocks of a stretch have begun: these stand between stretches.
            Item::Dwell(_) | Item::Stop | Item::Switch(_) => self.blocks == Position::ZERO,
        }
    }

    fn is_whole(&self) -> bool {
        self.path == self.blocks
    }
}

// In its own stack frame: an item takes hundreds of bytes.
#[inline(never)]
fn take<R: Real, const AXES: usize, E>(
    accept: &mut Acceptance<R, AXES>,
    ready: &Ready<R, AXES>,
) -> Result<(), SupplyError<E>> {
    match ready {
        Ready::Piece(piece) => accept.piece(piece),
        Ready::Segment(segment) => accept.segment(segment),
        Ready::EndOfStretch(end) => accept.end_of_stretch(*end),
        Ready::Dwell(duration) => accept.dwell(*duration),
        Ready::Stop => accept.at_rest(),
        Ready::Block => Ok(()),
    }
    .map_err(SupplyError::Rejected)
}
