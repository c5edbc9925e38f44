//! Planned motion as data: what a board has in flash, or is sent.
//!
//! Consumes what a planner made, for whatever number type; produces pieces and segments of the kernel's,
//! into the two streams. Background.
//!
//! - [`Item`]: one item of a program, in f64 and position steps; made into the same bits on every target;
//! - [`supply`]: keeps the two streams filled from items;
//! - [`mod@check`]: whether all of a program can be executed, before any of it is;
//! - [`mod@bytes`]: a program as bytes, with the machine it is for.

mod array;
pub mod bytes;
pub mod check;
pub mod supply;
mod wire;

pub use bytes::{Header, Items, ProgramError, Reader, write};
pub use check::{CheckError, check};
pub use supply::{Supply, SupplyError};

use serde::{Deserialize, Serialize};

use crate::law::{Limits, Ramp, Ticks};
use crate::units::Position;

/// One thing for the streams. Within a stretch, pieces and ramps come in the order of the path positions
/// where they start, so that whichever queue is full, the other one is as far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Item<const AXES: usize> {
    /// A straight piece of path, see [`Piece::line`](crate::path::Piece::line).
    Line {
        /// The program line it came from.
        line: u32,
        /// Where it starts.
        #[serde(with = "array")]
        start: [Position; AXES],
        /// A unit vector.
        #[serde(with = "array")]
        direction: [f64; AXES],
        /// Its length.
        length: Position,
    },
    /// A curved piece of path, see [`Piece::septic`](crate::path::Piece::septic).
    Septic {
        /// The program line it came from.
        line: u32,
        /// Where it starts.
        #[serde(with = "array")]
        start: [Position; AXES],
        /// q₁ … q₇ of every axis, parts of the length.
        #[serde(with = "array")]
        coefficients: [[f64; 7]; AXES],
        /// Its length.
        length: Position,
    },
    /// The feed over a length of path; a cruise is a ramp between equal feeds.
    Feed {
        /// The ramp.
        ramp: Ramp<f64>,
        /// The length.
        length: Position,
    },
    /// The stretch ends here, at rest.
    EndOfStretch(#[serde(with = "array")] [Position; AXES]),
    /// Rest, between stretches.
    Dwell(Ticks),
    /// Rest until told to resume, between stretches.
    Stop,
    /// What the feed over the next length of path is held to; the path's blocks follow each other without a gap. What
    /// live control makes other plans with.
    Block(PathBlock),
}

/// A length of path with what holds its feed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathBlock {
    /// Its length.
    pub length: Position,
    /// The program's feed \[mm/s\]; infinite for a rapid.
    pub feed_mm_s: f64,
    /// At up to the program's feed.
    pub programmed: Allowed,
    /// Whatever the program says.
    pub greatest: Allowed,
    /// Greatest feed through the joint at its end \[mm/s\]; 0 at the stretch's end.
    pub joint_mm_s: f64,
}

/// What geometry and machine allow on a block.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Allowed {
    /// Greatest feed \[mm/s\].
    pub cap_mm_s: f64,
    /// Limits of ramps up to that feed.
    pub limits: Limits<f64>,
}
