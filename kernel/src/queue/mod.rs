//! The two bounded streams between background and tick: geometry, and feed over the same length.
//!
//! Consumes [`Piece`](crate::path::Piece)s and [`FeedSegment`](crate::law::FeedSegment)s from the planner;
//! hands them to the executor. Single producer, single consumer, lock-free. The producer's end, [`Feeder`],
//! checks every item against its predecessor before it enters, so the tick never meets an item that can't be
//! executed; a full queue returns the item. The consumer's end, [`Intake`], only takes.
//!
//! A *stretch* is the motion from one full stop to the next. Both streams mark its end with an item
//! of their own; [`Feeder::end_stretch`] enters the two together and only if both streams have
//! measured the same length.
//!
//! ```
//! use motion_kernel::law::Limits;
//! use motion_kernel::path::Piece;
//! use motion_kernel::queue::{PathRules, Refused, Rejection, Streams};
//! use motion_kernel::units::Position;
//!
//! let at = |mm| Position::from_mm(mm).expect("within a kilometre");
//! let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 18, 10>::new();
//! let (mut feeder, _intake) = streams.split(rules, [at(0.0)]);
//! let line = |from_mm| Piece::line(1, [at(from_mm)], [1.0], at(4.0)).expect("a line");
//! assert_eq!(feeder.piece(line(0.0)), Ok(()));
//! // The next piece begins where the first one ends.
//! let refused = feeder.piece(line(5.0));
//! assert!(matches!(refused, Err(Refused::Invalid(Rejection::Gap { axis: 0, .. }))));
//! ```

mod handover;
mod counter;

mod accept;
#[cfg(feature = "guards")]
mod bounds;
#[cfg(not(feature = "guards"))]
#[path = "unbounded.rs"]
mod bounds;
pub(crate) mod density;
mod feeder;
mod intake;
pub(crate) mod item;
mod rejection;
mod room;
mod shared;
mod streams;

#[cfg(feature = "live")]
pub(crate) mod change;
#[cfg(feature = "live")]
mod lists;
#[cfg(not(feature = "live"))]
#[path = "no_lists.rs"]
mod lists;
#[cfg(feature = "live")]
mod live;
#[cfg(feature = "live")]
mod mailbox;
#[cfg(feature = "live")]
mod progress;
#[cfg(all(feature = "live", any(test, feature = "watch")))]
pub(crate) mod watch;
#[cfg(all(feature = "live", not(any(test, feature = "watch"))))]
#[path = "unwatched.rs"]
mod watch;

pub(crate) use accept::Acceptance;
pub use accept::PathRules;
#[cfg(feature = "live")]
pub(crate) use change::{Change, Progress};
#[cfg(feature = "live")]
pub(crate) use change::{LIST_ITEMS, LISTS};
#[cfg(feature = "live")]
pub(crate) use density::Density;
pub use density::SEGMENTS_PER_TICK_MAX;
pub use feeder::Feeder;
pub use intake::Intake;
#[cfg(feature = "scope")]
pub(crate) use intake::IntakeState;
pub use item::Refused;
pub(crate) use item::{FeedItem, PathItem};
#[cfg(feature = "live")]
pub use live::{LiveFeeder, LiveStreams};
pub use rejection::Rejection;
pub use streams::Streams;
