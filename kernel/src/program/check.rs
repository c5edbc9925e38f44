//! A whole program against all that the streams would refuse, without streams.
//!
//! Consumes items; produces nothing but the first refusal. Background: as much work as filling the streams, and
//! nothing is kept. What it accepts, [`Supply`](super::Supply) hands over without an error. What only time tells is
//! left to the tick: how many pieces end in one ([`PIECES_PER_TICK_MAX`](crate::exec::PIECES_PER_TICK_MAX)), and
//! whether the streams are filled fast enough.

use super::supply::{Ready, SupplyError};
use super::{Header, Item};
use crate::num::Real;
use crate::queue::Acceptance;
use crate::units::Position;

/// What is wrong with a program.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CheckError<E> {
    /// It starts farther out than positions reach.
    Start {
        /// The axis, from 0.
        axis: usize,
        /// Where \[mm\].
        mm: f64,
    },
    /// An item can't be executed.
    Item {
        /// Which, from 0.
        index: u32,
        /// Why.
        cause: SupplyError<E>,
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
            Self::Unfinished => write!(f, "no end of the last stretch"),
        }
    }
}

impl<E: core::fmt::Debug + core::fmt::Display> core::error::Error for CheckError<E> {}

/// Whether a kernel of the number type `R` can execute all of `items`, which are of the program with `header`.
///
/// # Errors
/// The first thing that is wrong.
pub fn check<R: Real, const AXES: usize, E>(
    header: &Header<AXES>,
    items: impl Iterator<Item = Result<Item<AXES>, E>>,
) -> Result<(), CheckError<E>> {
    for (axis, start) in header.start.iter().enumerate() {
        if !start.is_within_limit() {
            return Err(CheckError::Start { axis, mm: start.to_mm() });
        }
    }
    let mut accept = Acceptance::<R, AXES>::new(header.rules, header.start);
    let mut index: u32 = 0;
    for item in items {
        item.map_err(SupplyError::Source)
            .and_then(|item| item.ready(header.tick_s))
            .and_then(|ready| take(&mut accept, &ready))
            .map_err(|cause| CheckError::Item { index, cause })?;
        index = index.wrapping_add(1);
    }
    accept.at_rest().map_err(|_| CheckError::Unfinished)
}

// In a frame of its own: an item takes hundreds of bytes.
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
