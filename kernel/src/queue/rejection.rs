//! Why an item is refused before the tick can meet it.

use super::density::SEGMENTS_PER_TICK_MAX;
use crate::units::Position;

/// Why an item may not enter. Each variant names the quantity and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Rejection {
    /// A piece does not start where its predecessor ends.
    Gap {
        /// The axis, from 0.
        axis: usize,
        /// The gap \[mm\].
        gap_mm: f64,
    },
    /// A piece does not continue in the direction in which its predecessor ends.
    Corner {
        /// The angle between the tangents \[rad\].
        angle_rad: f64,
    },
    /// A segment does not start at the feed at which its predecessor ends.
    FeedStep {
        /// The predecessor's \[mm/s\].
        from_mm_s: f64,
        /// The segment's \[mm/s\].
        to_mm_s: f64,
    },
    /// A segment exceeds a limit, or asks an axis on its piece of path for more than the number type holds.
    Limit {
        /// The quantity, with its unit.
        quantity: &'static str,
        /// The segment's value, or an axis' where piece and segment meet.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// More segments or dwells than the executor handles would end within one tick.
    Dense {
        /// Total duration \[ticks\] of this segment and its predecessors, as many as the executor handles in
        /// a tick; it must be at least 1.
        ticks: f64,
    },
    /// A stretch would end before motion is at rest.
    Moving {
        /// The feed \[mm/s\].
        feed_mm_s: f64,
    },
    /// The two streams have measured different lengths of the same stretch.
    Lengths {
        /// The pieces' \[mm\].
        path_mm: f64,
        /// The segments' \[mm\].
        feed_mm: f64,
    },
    /// A piece leaves the travel of an axis.
    Travel {
        /// The axis, from 0.
        axis: usize,
        /// A position outside the travel \[mm\].
        mm: f64,
    },
    /// A stretch has no length.
    Empty,
    /// A dwell or stop is inside a stretch; they belong between stretches.
    InsideStretch,
    /// The blocks of a stretch are longer or shorter than its path.
    Blocks {
        /// The blocks' \[mm\].
        blocks_mm: f64,
        /// The pieces' \[mm\].
        path_mm: f64,
    },
    /// No block gives the feed of this path: live control could not brake on it.
    NoBlock,
    /// There is no place, although room had been left: an error of live control, not of the program.
    Full {
        /// What there is no place for.
        what: &'static str,
        /// Number of places.
        places: usize,
    },
    /// A change between the wrong feed lists. It must go to the list filled last, from another list, after no
    /// more items than the word holds.
    NoChange {
        /// The list under way.
        from: u8,
        /// The list asked for.
        to: u8,
        /// Number of items of `from` driven before.
        after: u32,
    },
    /// A stretch's length or a position is beyond the kernel's range.
    Range {
        /// The length or coordinate \[mm\].
        mm: f64,
    },
}

#[cfg(feature = "live")]
impl Rejection {
    /// The rejection for more `what` than `places`.
    #[cold]
    pub(crate) fn full(what: &'static str, places: usize) -> Self {
        Self::Full { what, places }
    }
}

impl core::fmt::Display for Rejection {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Gap { axis, gap_mm } => write!(f, "gap of {gap_mm} mm to the predecessor on axis {axis}"),
            Self::Corner { angle_rad } => write!(f, "corner of {angle_rad} rad inside a stretch"),
            Self::FeedStep { from_mm_s, to_mm_s } => {
                write!(f, "feed steps from {from_mm_s} to {to_mm_s} mm/s")
            }
            Self::Limit { quantity, value, limit } => write!(f, "{quantity} {value} exceeds {limit}"),
            Self::Dense { ticks } => {
                write!(f, "{SEGMENTS_PER_TICK_MAX} segments in {ticks} ticks: expected at least 1")
            }
            Self::Moving { feed_mm_s } => write!(f, "stretch ends at {feed_mm_s} mm/s: expected rest"),
            Self::Lengths { path_mm, feed_mm } => {
                write!(f, "{path_mm} mm of path, {feed_mm} mm of feed: expected equal lengths")
            }
            Self::Travel { axis, mm } => write!(f, "position {mm} mm of axis {axis}: expected its travel"),
            Self::Empty => write!(f, "a stretch without any length"),
            Self::Full { what, places } => write!(f, "more {what} than the {places} that there is room for"),
            Self::Blocks { blocks_mm, path_mm } => {
                write!(f, "{blocks_mm} mm of blocks, {path_mm} mm of path: expected equal lengths")
            }
            Self::NoBlock => write!(f, "path without a block, expected one that says what holds its feed"),
            Self::NoChange { from, to, after } => {
                write!(
                    f,
                    "change to list {to} after {after} items of list {from}: expected the one filled last"
                )
            }
            Self::InsideStretch => write!(f, "dwell or stop inside a stretch"),
            Self::Range { mm } => write!(f, "{mm} mm: expected at most ±{} mm", Position::LIMIT_MM),
        }
    }
}

impl core::error::Error for Rejection {}
