//! Places on the path where one list ends and another may begin.

use crate::units::Position;

/// A shorter path is only rounding, not path to plan on: a ramp over it would have no length in position
/// steps. Less than the error that a segment's length may have.
pub(super) const SLIVER: Position = Position::from_bits(32);

/// A place where a plan may begin: on the path of a stretch, at a feed that does not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Splice {
    /// The stretch, from 0.
    pub(super) stretch: u32,
    /// Path position from the start of the stretch.
    pub(super) at: Position,
    /// Feed \[mm/s\].
    pub(super) feed_mm_s: f64,
}

impl Splice {
    /// Whether the machine is at rest there.
    pub(super) fn is_at_rest(&self) -> bool {
        self.feed_mm_s <= 0.0
    }
}

/// The end of a program block: a path position of its stretch, or the start of the next stretch for one that
/// ends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockEnd {
    pub(super) stretch: u32,
    pub(super) at: Position,
}

impl BlockEnd {
    /// Whether a place is at this end, but for rounding (a [`SLIVER`]).
    pub(super) fn is_at(&self, place: &Splice) -> bool {
        let gap = self.at - place.at;
        self.stretch == place.stretch && gap <= SLIVER && -gap <= SLIVER
    }
}

impl From<Splice> for BlockEnd {
    fn from(Splice { stretch, at, .. }: Splice) -> Self {
        Self { stretch, at }
    }
}

/// How far the path of a stretch is known to a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// To its end.
    Whole(Position),
    /// As far as it is queued, or as far as single block lets a plan go.
    SoFar(Position),
}

impl Extent {
    /// Where it ends.
    pub(super) fn end(self) -> Position {
        match self {
            Self::Whole(end) | Self::SoFar(end) => end,
        }
    }

    /// Whether that is the whole stretch.
    pub(super) fn is_whole(self) -> bool {
        matches!(self, Self::Whole(_))
    }
}

/// Whether a stretch comes before another one. Stretch numbers wrap.
pub(super) fn is_before(stretch: u32, other: u32) -> bool {
    stretch.wrapping_sub(other).cast_signed() < 0
}
