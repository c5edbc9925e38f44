//! The atomic words of this room. The check of the hand-over in every interleaving puts its own in their place.

pub(super) use core::sync::atomic::{AtomicU32, Ordering};
