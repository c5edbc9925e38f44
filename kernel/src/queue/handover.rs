//! What background and tick hand over through: words and queues. `tests/handover.rs` puts its own in their place, to run
//! the mailbox and the tick's lists in every interleaving.

pub(super) use core::sync::atomic::{AtomicU32, Ordering};

#[cfg(feature = "live")]
pub(super) use heapless::spsc::Consumer;
