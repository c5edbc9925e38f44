//! The two bounded streams between background and tick: geometry, and feed over the same length.
//!
//! Consumes [`Piece`]s and [`FeedSegment`]s from the planner; hands them to the executor. Single
//! producer, single consumer, lock-free. The producer's end, [`Feeder`], checks every item against
//! its predecessor before it enters, so the tick never meets an item that can't be executed; a full
//! queue returns the item. The consumer's end, [`Intake`], only takes.
//!
//! A *stretch* is the motion from one full stop to the next. Both streams mark its end with an item
//! of their own; [`Feeder::end_stretch`] enters the two together and only if both streams have
//! measured the same length.

mod handover;
mod counter;

mod accept;
#[cfg(feature = "guards")]
mod bounds;
#[cfg(not(feature = "guards"))]
#[path = "unbounded.rs"]
mod bounds;
mod density;
mod feeder;
mod intake;
mod item;
mod rejection;
mod room;
mod shared;
mod streams;

#[cfg(feature = "live")]
mod change;
#[cfg(feature = "live")]
mod lists;
#[cfg(not(feature = "live"))]
#[path = "no_lists.rs"]
mod lists;
#[cfg(feature = "live")]
mod live;
#[cfg(feature = "live")]
mod mailbox;

pub(crate) use accept::Acceptance;
pub use accept::PathRules;
#[cfg(feature = "live")]
pub use change::{Change, LIST_ITEMS, LISTS, Progress};
pub use density::{Density, SEGMENTS_PER_TICK_MAX};
pub use feeder::Feeder;
pub use intake::Intake;
pub use item::{FeedItem, PathItem, Refused};
#[cfg(feature = "live")]
pub use live::{LiveFeeder, LiveStreams};
pub use rejection::Rejection;
pub use streams::Streams;
