//! What the two ends of the streams share, apart from the items.

use core::sync::atomic::{AtomicBool, AtomicU32};

/// What the feeder tells the intake, apart from the items. Only the feeder writes it.
#[derive(Debug)]
pub(super) struct Shared {
    /// Number of ends of stretch entered so far.
    pub(super) stretches: AtomicU32,
    /// Number of items entered so far, per stream. The queue's own length needs a division.
    pub(super) path_entered: AtomicU32,
    pub(super) feed_entered: AtomicU32,
    /// In the stretch being entered, the feed covers at least as much path as the pieces.
    pub(super) feed_covers_path: AtomicBool,
    /// In the stretch being entered, the pieces cover at least as much path as the feed.
    pub(super) path_covers_feed: AtomicBool,
}

impl Shared {
    pub(super) const fn new() -> Self {
        Self {
            stretches: AtomicU32::new(0),
            path_entered: AtomicU32::new(0),
            feed_entered: AtomicU32::new(0),
            feed_covers_path: AtomicBool::new(true),
            path_covers_feed: AtomicBool::new(true),
        }
    }
}
