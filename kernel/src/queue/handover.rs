//! What background and tick hand over through: words and queues. The test `handover` puts its own in their place.

pub(super) use core::sync::atomic::{AtomicU32, Ordering};

#[cfg(feature = "live")]
pub(super) use heapless::spsc::Consumer;
