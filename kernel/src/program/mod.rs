//! Planned motion as data: a program in a board's flash, or sent to it.
//!
//! Consumes a planner's output for any number type; produces pieces and segments of the kernel's number type,
//! into the two streams. Background.
//!
//! - [`Item`]: one item of a program, in f64 and position steps; converted to the same bits on every target;
//! - [`Source`]: where items come from, perhaps later;
//! - [`Switching`]: a source that waits where outputs are to be switched;
//! - `supply`: keeps the two streams filled from items;
//! - `check`: whether all of a program can be executed, before any of it is;
//! - `bytes`: a program as bytes, with the machine it is for.
//!
//! ```
//! use core::convert::Infallible;
//!
//! use motion_kernel::exec::{ExecState, Executor};
//! use motion_kernel::law::{Limits, Ticks};
//! use motion_kernel::program::{Item, ProgramError, Reader, Supply};
//! use motion_kernel::queue::{PathRules, Streams};
//! use motion_kernel::units::Position;
//!
//! // What is no program is refused as a whole.
//! assert!(matches!(Reader::<1>::new(b"G1 X10 F600"), Err(ProgramError::NotAProgram)));
//!
//! // Items of any source fill the streams: here two dwells of 1 ms and a program stop.
//! let dwell = Item::<1>::Dwell(Ticks::from_seconds(0.001, 0.0005).expect("some ticks"));
//! let items = [dwell, dwell, Item::Stop].map(Ok::<_, Infallible>);
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 18, 10>::new();
//! let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
//! let mut supply = Supply::new(items.into_iter(), 0.0005);
//! supply.fill(&mut feeder).expect("items that can be executed");
//! assert!(supply.is_empty());
//! let mut executor = Executor::new([Position::ZERO]);
//! let states = [(); 5].map(|()| executor.tick(&mut intake).expect("no fault").state);
//! assert_eq!(states[1], ExecState::Dwell);
//! assert_eq!(states[4], ExecState::Stopped);
//! ```

mod bytes;
mod check;
mod checksum;
pub mod compact;
mod source;
pub(crate) mod supply;
mod switching;
mod wire;

#[cfg(feature = "compensation")]
pub use bytes::write_compensated;
#[cfg(all(feature = "live", feature = "guards"))]
pub use bytes::write_homed;
pub use bytes::{FORMAT, Header, Items, ProgramError, Reader, write};
#[cfg(feature = "live")]
pub use check::check_live;
pub use check::{CheckError, check};
pub use checksum::Checksum;
pub use source::Source;
pub use supply::{Supply, SupplyError};
pub use switching::{Switching, switches_as_stops};
#[cfg(feature = "link")]
pub(crate) use wire::take;

use serde::{Deserialize, Serialize};

use crate::hal::OutputState;
use crate::law::{Limits, PlannedRamp, Ticks};
#[cfg(feature = "live")]
use crate::num::Real;
use crate::units::Position;

/// One item of a program. Within a stretch, pieces and ramps come in the order of the path positions where
/// they start, so that both queues are always filled equally far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Item<const AXES: usize> {
    /// A straight piece of path, see [`Piece::line`](crate::path::Piece::line).
    Line {
        /// The program line it came from.
        line: u32,
        /// Where it starts.
        #[serde(with = "crate::array")]
        start: [Position; AXES],
        /// A unit vector.
        #[serde(with = "crate::array")]
        direction: [f64; AXES],
        /// Its length.
        length: Position,
    },
    /// A curved piece of path, see [`Piece::septic`](crate::path::Piece::septic).
    Septic {
        /// The program line it came from.
        line: u32,
        /// Where it starts.
        #[serde(with = "crate::array")]
        start: [Position; AXES],
        /// q₁ … q₇ of every axis, as fractions of the length.
        #[serde(with = "crate::array")]
        coefficients: [[f64; 7]; AXES],
        /// Its length.
        length: Position,
    },
    /// The feed over a length of path; a cruise is a ramp between equal feeds.
    Feed(PlannedRamp),
    /// The stretch ends here, at rest.
    EndOfStretch(#[serde(with = "crate::array")] [Position; AXES]),
    /// Rest, between stretches.
    Dwell(Ticks),
    /// Rest until told to resume, between stretches.
    Stop,
    /// Spindle and coolant switch at rest, between stretches. Only a [`Switching`] source takes it: elsewhere it
    /// is refused, because nothing would switch.
    Switch(OutputState),
    /// The limits of the feed over the next length of path; blocks follow each other without a gap. Live
    /// control plans anew with them; a kernel without it reads no programs with blocks.
    #[cfg_attr(not(feature = "live"), serde(skip))]
    Block(PathBlock),
}

/// The feed and limits that geometry and machine allow on a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Greatest feed \[mm/s\].
    pub cap_mm_s: f64,
    /// Limits of ramps up to that feed.
    pub limits: Limits<f64>,
}

/// A length of path with the limits of its feed.
// All figures of one kind: reading them takes less flash than a struct of structs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathBlock {
    /// Its length.
    pub length: Position,
    /// The program's feed, then cap and limits up to that feed, then cap and limits at any feed, then the
    /// junction's feed.
    #[serde(with = "crate::array")]
    figures: [f64; 10],
}

impl PathBlock {
    /// A block of `length` with the program's feed \[mm/s\], infinite for a rapid; with what is allowed up to
    /// that feed, and at any feed.
    #[must_use]
    pub fn new(
        length: Position,
        feed_mm_s: f64,
        programmed: Allowed,
        greatest: Allowed,
        junction_mm_s: f64,
    ) -> Self {
        let [p, g] = [programmed, greatest].map(|Allowed { cap_mm_s, limits }| {
            [cap_mm_s, limits.accel_mm_s2, limits.jerk_mm_s3, limits.snap_mm_s4]
        });
        let figures = [feed_mm_s, p[0], p[1], p[2], p[3], g[0], g[1], g[2], g[3], junction_mm_s];
        Self { length, figures }
    }

    /// Whether another block limits the feed to the same figures, whatever their lengths and junctions.
    #[must_use]
    pub fn holds_like(&self, other: &Self) -> bool {
        let [held @ .., _] = self.figures;
        let [other @ .., _] = other.figures;
        held == other
    }

    /// The same block, longer by `next`, and with its end.
    #[must_use]
    pub fn with(self, next: &Self) -> Self {
        let ([held @ .., _], [.., junction_mm_s]) = (self.figures, next.figures);
        let [feed, a, b, c, d, e, f, g, h] = held;
        Self { length: self.length + next.length, figures: [feed, a, b, c, d, e, f, g, h, junction_mm_s] }
    }

    /// The same block with limits clamped to the number type, for plans that are driven in it.
    #[cfg(feature = "live")]
    #[must_use]
    pub(crate) fn within_range<R: Real>(self) -> Self {
        // A peak that reaches its limit may be rounded up.
        let most = R::from_f64(f64::MAX).to_f64() * (1.0 - 1.0e-6);
        let [feed, cap, a, j, s, greatest_cap, greatest_a, greatest_j, greatest_s, junction] = self.figures;
        let [a, j, s, greatest_a, greatest_j, greatest_s] =
            [a, j, s, greatest_a, greatest_j, greatest_s].map(|limit| limit.min(most));
        let figures = [feed, cap, a, j, s, greatest_cap, greatest_a, greatest_j, greatest_s, junction];
        Self { figures, ..self }
    }

    /// Greatest feed through the junction at its end \[mm/s\]; 0 at the stretch's end.
    #[must_use]
    pub fn junction_mm_s(&self) -> f64 {
        let [.., junction_mm_s] = self.figures;
        junction_mm_s
    }

    /// The program's feed \[mm/s\]; infinite for a rapid.
    #[doc(hidden)]
    #[must_use]
    pub fn feed_mm_s(&self) -> f64 {
        let [feed_mm_s, ..] = self.figures;
        feed_mm_s
    }

    /// What is allowed up to the program's feed.
    #[doc(hidden)]
    #[must_use]
    pub fn programmed(&self) -> Allowed {
        let [_, cap_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4, ..] = self.figures;
        Allowed { cap_mm_s, limits: Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 } }
    }

    /// What is allowed at any feed.
    #[must_use]
    pub fn greatest(&self) -> Allowed {
        let [.., cap_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4, _] = self.figures;
        Allowed { cap_mm_s, limits: Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 } }
    }
}
