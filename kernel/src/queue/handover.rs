//! The words and queues between background and tick. The test `handover` replaces them by its own.

pub(super) use core::sync::atomic::{AtomicU32, Ordering};

#[cfg(feature = "live")]
pub(super) use heapless::spsc::Consumer;
