//! The items of the two streams.

use super::rejection::Rejection;
use crate::law::{FeedSegment, Ticks};
use crate::num::Real;
use crate::path::Piece;
use crate::units::Position;

/// An item of the path stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PathItem<R: Real, const AXES: usize> {
    /// Geometry.
    Piece(Piece<R, AXES>),
    /// The stretch ends exactly here.
    EndOfStretch([Position; AXES]),
}

/// An item of the feed stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedItem<R> {
    /// A ramp or a cruise.
    Segment(FeedSegment<R>),
    /// Rest for a time, between stretches.
    Dwell(Ticks),
    /// Rest until told to resume, between stretches.
    ProgramStop,
    /// The stretch ends, at rest.
    EndOfStretch,
}

/// An item that did not enter its queue. Exhaustive on purpose: there is no third way to stay out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refused<T> {
    /// The queue is full; here is the item back. Offer it again later.
    Full(T),
    /// The item must not enter; the stream is as it was before.
    Invalid(Rejection),
}
