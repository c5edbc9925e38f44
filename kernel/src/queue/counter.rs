//! Counters with a single writer.

use super::handover::{AtomicU32, Ordering};

/// Adds one. There is a single writer, so that cores without read-modify-write instructions count too.
pub(super) fn count(counter: &AtomicU32) {
    counter.store(counter.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
}
