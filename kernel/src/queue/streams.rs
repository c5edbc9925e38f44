//! The memory of two streams, and its two ends.

use core::sync::atomic::Ordering;

use heapless::spsc::Queue;

use super::accept::{Acceptance, PathRules};
use super::feeder::Feeder;
use super::intake::Intake;
use super::item::{FeedItem, PathItem};
use super::lists::Lists;
use super::room::Fill;
use super::shared::Shared;
use crate::num::Real;
use crate::units::Position;

/// Storage of both streams: `PIECES` − 1 and `SEGMENTS` − 1 items (one place distinguishes full from empty).
/// The item being executed stays in its place: nothing is copied in the tick. With fewer than 18 pieces or 10
/// segments a program that uses the tick's bounds fully can starve, because a queue is only refilled between
/// ticks; with 64 and 64 the streams of a machine with three f32 axes take 17 KiB.
#[derive(Debug)]
pub struct Streams<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize> {
    pub(super) path: Queue<PathItem<R, AXES>, PIECES>,
    pub(super) feed: Queue<FeedItem<R>, SEGMENTS>,
    pub(super) shared: Shared,
}

impl<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize>
    Streams<R, AXES, PIECES, SEGMENTS>
{
    /// Empty streams.
    #[must_use]
    pub const fn new() -> Self {
        Self { path: Queue::new(), feed: Queue::new(), shared: Shared::new() }
    }

    /// Splits into the two ends, for a machine that stands at `position`. Everything queued before is
    /// dropped.
    #[inline(never)]
    pub fn split(
        &mut self,
        rules: PathRules,
        position: [Position; AXES],
    ) -> (Feeder<'_, R, AXES>, Intake<'_, R, AXES>) {
        while self.path.dequeue().is_some() {}
        while self.feed.dequeue().is_some() {}
        let (path_in, path_out) = self.path.split();
        let (feed_in, feed_out) = self.feed.split();
        let shared: &Shared = &self.shared;
        let mut feeder =
            Feeder { path: path_in, feed: feed_in, shared, accept: Acceptance::new(rules, position) };
        feeder.publish();
        let path = Fill::new(&shared.path_entered, PIECES - 1);
        let feed = Fill::new(&shared.feed_entered, SEGMENTS - 1);
        let finished = shared.stretches.load(Ordering::Relaxed);
        let intake = Intake {
            path: path_out,
            feed: feed_out,
            shared,
            finished,
            path_fill: path,
            feed_fill: feed,
            lists: Lists::NONE,
        };
        (feeder, intake)
    }
}

impl<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize> Default
    for Streams<R, AXES, PIECES, SEGMENTS>
{
    fn default() -> Self {
        Self::new()
    }
}
