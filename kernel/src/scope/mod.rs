//! A scope for all quantities of every tick, by replay.
//!
//! What a tick consumes determines it: a PC that knows that, and the kernel's state before it, runs the same kernel and has
//! every quantity of the tick, for some five bytes.
//!
//! ```text
//! board                                                        PC
//! ─────                                                        ──
//! tick        Recorder ─► Ring ───────┐
//!                                     ├─► BoardScope ─► link ─► Replay ─► Trace of every tick
//! background  LiveFeeder ─► Log ──────┘                            ▲
//!                                                       items ─────┘
//! ```
//!
//! - `tick_record`, `record`, `ring`: what a tick consumed, as the tick leaves it; faults and failures of the hardware, too;
//! - `log`: the lists of feed that live control hands to the tick, and what else the background does;
//! - `snapshot`: the kernel's state between two ticks;
//! - `wire`: a tick as bytes;
//! - `board`, `replay`: the two ends.
//!
//! **Pieces of path are not sent.** The PC has sent them itself, as items; when they entered their queue does not matter,
//! because under live control a tick never waits for one. Lists are sent as they were planned.
//!
//! **Nothing is repeated.** A frame that was lost, or a tick for whose record there was no room, makes a gap. A snapshot ends it,
//! wherever motion is. So telemetry never needs more than the room that is left.
//!
//! **Every tick is compared**, by a byte of a digest of what was read, set and put out.

mod board;
mod log;
mod record;
mod replay;
mod ring;
#[cfg(test)]
mod ring_tests;
mod snapshot;
mod tick_record;
mod wire;
/// Those of the ring; its check has its own.
mod words {
    pub(super) use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU16, AtomicU32, AtomicUsize, Ordering};
}

pub use board::{BODY_MAX, BoardScope, Body, ScopeMemory};
pub(crate) use log::{Begun, Handed};
pub use log::{Command, Log};
pub use record::{Failures, Noting, Recorder};
pub use replay::{Items, Replay, ReplayError, Told};
