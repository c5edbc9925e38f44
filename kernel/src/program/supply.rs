//! Keeps the two streams filled.
//!
//! Consumes the [`Item`]s of a [`Source`]; at every call it offers them to the [`Feeder`] until that is full. Here an item is
//! converted to the kernel's number type, so a board needs room for only one item in addition to its queues.

use core::convert::Infallible;
use core::task::Poll;

use super::{Item, Source};
use crate::law::{FeedSegment, SegmentError, Ticks};
use crate::num::Real;
use crate::path::{Piece, PieceError};
use crate::queue::{Feeder, Refused, Rejection};
use crate::units::Position;

/// Why an item can't be executed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SupplyError<E> {
    /// The source failed to provide the item.
    Source(E),
    /// The item is no piece of path in this number type.
    Piece(PieceError),
    /// The item is no feed segment in this number type.
    Segment(SegmentError),
    /// The item may not follow the ones before it.
    Rejected(Rejection),
    /// The item switches outputs, and nothing here does; see [`Switching`](super::Switching).
    NoOutputs,
}

impl SupplyError<Infallible> {
    /// The same for any source.
    #[must_use]
    pub fn of_any_source<E>(self) -> SupplyError<E> {
        match self {
            Self::Source(never) => match never {},
            Self::Piece(error) => SupplyError::Piece(error),
            Self::Segment(error) => SupplyError::Segment(error),
            Self::Rejected(rejection) => SupplyError::Rejected(rejection),
            Self::NoOutputs => SupplyError::NoOutputs,
        }
    }
}

impl<E: core::fmt::Display> core::fmt::Display for SupplyError<E> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Source(error) => error.fmt(f),
            Self::Piece(error) => error.fmt(f),
            Self::Segment(error) => error.fmt(f),
            Self::Rejected(rejection) => rejection.fmt(f),
            Self::NoOutputs => f.write_str("spindle or coolant is to be switched, and there are no outputs"),
        }
    }
}

impl<E: core::fmt::Debug + core::fmt::Display> core::error::Error for SupplyError<E> {}

/// An item in the kernel's number type.
#[derive(Clone, Copy, Debug)]
pub enum Ready<R: Real, const AXES: usize> {
    /// For the path stream.
    Piece(Piece<R, AXES>),
    /// For the feed stream.
    Segment(FeedSegment<R>),
    /// For both streams.
    EndOfStretch([Position; AXES]),
    /// Rest for a time.
    Dwell(Ticks),
    /// Rest until told to resume.
    Stop,
    /// Not for a stream.
    Block,
}

impl<const AXES: usize> Item<AXES> {
    /// The item in the number type `R`, for ticks of `tick_s`.
    ///
    /// # Errors
    /// The number type does not hold it, or it is none for the streams.
    #[doc(hidden)]
    #[inline(never)]
    pub fn ready<R: Real, E>(&self, tick_s: f64) -> Result<Ready<R, AXES>, SupplyError<E>> {
        Ok(match *self {
            Self::Line { line, start, direction, length } => {
                Ready::Piece(Piece::line(line, start, direction, length).map_err(SupplyError::Piece)?)
            }
            Self::Septic { line, start, coefficients, length } => {
                Ready::Piece(Piece::septic(line, start, coefficients, length).map_err(SupplyError::Piece)?)
            }
            Self::Feed(planned) => Ready::Segment(planned.segment(tick_s).map_err(SupplyError::Segment)?),
            Self::EndOfStretch(end) => Ready::EndOfStretch(end),
            Self::Dwell(duration) => Ready::Dwell(duration),
            Self::Stop => Ready::Stop,
            Self::Switch(_) => return Err(SupplyError::NoOutputs),
            Self::Block(_) => Ready::Block,
        })
    }
}

/// The state of the supply.
#[derive(Debug)]
pub struct Supply<R: Real, const AXES: usize, I, E> {
    items: I,
    tick_s: f64,
    /// An item made ready but not yet taken by the queues.
    pending: Option<Ready<R, AXES>>,
    is_at_end: bool,
    /// The source had none for now when it was last asked.
    is_late: bool,
    /// The error that ended it. The failed item is gone, and the next one would not continue the queued path.
    error: Option<SupplyError<E>>,
}

impl<R: Real, const AXES: usize, E: Clone, I: Source<AXES, Error = E>> Supply<R, AXES, I, E> {
    /// A supply with all of `items` still to do, for ticks of `tick_s`.
    pub fn new(items: I, tick_s: f64) -> Self {
        Self { items, tick_s, pending: None, is_at_end: false, is_late: false, error: None }
    }

    /// Whether everything has been offered and taken; never after an error.
    pub fn is_empty(&self) -> bool {
        self.is_at_end && self.pending.is_none() && self.error.is_none()
    }

    /// Whether everything that the source gave has been taken, and it has no more for now; never after an error.
    pub fn is_waiting(&self) -> bool {
        self.is_late && self.pending.is_none() && self.error.is_none()
    }

    /// The source, for sources that take instructions.
    pub fn source_mut(&mut self) -> &mut I {
        &mut self.items
    }

    /// Fills the streams.
    ///
    /// # Errors
    /// The next item can't be executed; items queued before it are untouched. Every later call returns the
    /// same error.
    pub fn fill(&mut self, feeder: &mut Feeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        if let Some(error) = &self.error {
            return Err(error.clone());
        }
        self.fill_on(feeder).inspect_err(|error| self.error = Some(error.clone()))
    }

    #[inline(never)]
    fn fill_on(&mut self, feeder: &mut Feeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        loop {
            let ready = match self.pending.take() {
                Some(ready) => ready,
                None => {
                    let polled = self.items.poll_next();
                    self.is_late = polled.is_pending();
                    match polled {
                        Poll::Ready(Some(item)) => item.map_err(SupplyError::Source)?.ready(self.tick_s)?,
                        Poll::Ready(None) => {
                            self.is_at_end = true;
                            return Ok(());
                        }
                        Poll::Pending => return Ok(()),
                    }
                }
            };
            let is_taken = match ready {
                Ready::Piece(piece) => is_taken(feeder.piece(piece)),
                Ready::Segment(segment) => is_taken(feeder.segment(segment)),
                Ready::EndOfStretch(end) => is_taken(feeder.end_stretch(end)),
                Ready::Dwell(duration) => is_taken(feeder.dwell(duration)),
                Ready::Stop => is_taken(feeder.program_stop()),
                Ready::Block => Ok(true),
            };
            if !is_taken.map_err(SupplyError::Rejected)? {
                self.pending = Some(ready);
                return Ok(());
            }
        }
    }
}

/// Whether the queue had room.
pub(crate) fn is_taken<T>(answer: Result<(), Refused<T>>) -> Result<bool, Rejection> {
    match answer {
        Ok(()) => Ok(true),
        Err(Refused::Full(_)) => Ok(false),
        Err(Refused::Invalid(rejection)) => Err(rejection),
    }
}
