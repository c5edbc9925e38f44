//! The background's end of the two streams: every item is checked against its predecessor before it enters.

use core::sync::atomic::Ordering;

use heapless::spsc::Producer;

use super::accept::Acceptance;
use super::counter::count;
use super::item::{FeedItem, PathItem, Refused};
use super::room::{enter, has_room};
use super::shared::Shared;
use crate::law::{FeedSegment, Ticks};
use crate::num::Real;
use crate::path::Piece;
use crate::units::Position;

/// The background's end of the streams.
pub struct Feeder<'a, R: Real, const AXES: usize> {
    pub(super) path: Producer<'a, PathItem<R, AXES>>,
    pub(super) feed: Producer<'a, FeedItem<R>>,
    pub(super) shared: &'a Shared,
    pub(super) accept: Acceptance<R, AXES>,
}

/// Enters items without any check, as if memory had been corrupted.
#[cfg(test)]
impl<R: Real, const AXES: usize> Feeder<'_, R, AXES> {
    pub(crate) fn piece_unchecked(&mut self, piece: Piece<R, AXES>) {
        assert!(self.path.enqueue(PathItem::Piece(piece)).is_ok());
        count(&self.shared.path_entered);
    }

    pub(crate) fn segment_unchecked(&mut self, segment: FeedSegment<R>) {
        assert!(self.feed.enqueue(FeedItem::Segment(segment)).is_ok());
        count(&self.shared.feed_entered);
    }

    pub(crate) fn end_unchecked(&mut self, at: [Position; AXES]) {
        assert!(self.path.enqueue(PathItem::EndOfStretch(at)).is_ok());
        assert!(self.feed.enqueue(FeedItem::EndOfStretch).is_ok());
        count(&self.shared.path_entered);
        count(&self.shared.feed_entered);
        count(&self.shared.stretches);
    }
}

impl<R: Real, const AXES: usize> Feeder<'_, R, AXES> {
    /// From now on refuses pieces that leave `travel` anywhere, not only at their ends.
    #[cfg(feature = "guards")]
    pub fn bound(&mut self, travel: crate::path::Travel<AXES>) {
        self.accept.bound(super::bounds::Bounds::new(travel));
    }

    /// Enters a piece of path.
    ///
    /// # Errors
    /// The queue is full, or the piece does not continue its predecessor.
    #[inline(never)]
    pub fn piece(&mut self, piece: Piece<R, AXES>) -> Result<(), Refused<Piece<R, AXES>>> {
        let mut next = self.accept;
        next.piece(&piece).map_err(Refused::Invalid)?;
        enter(&mut self.path, PathItem::Piece(piece)).map_err(|_| Refused::Full(piece))?;
        self.accept = next;
        self.publish();
        count(&self.shared.path_entered);
        Ok(())
    }

    /// Enters a feed segment.
    ///
    /// # Errors
    /// The queue is full, or the segment does not continue its predecessor or exceeds a limit.
    #[inline(never)]
    pub fn segment(&mut self, segment: FeedSegment<R>) -> Result<(), Refused<FeedSegment<R>>> {
        let mut next = self.accept;
        next.segment(&segment).map_err(Refused::Invalid)?;
        enter(&mut self.feed, FeedItem::Segment(segment)).map_err(|_| Refused::Full(segment))?;
        self.accept = next;
        self.publish();
        count(&self.shared.feed_entered);
        Ok(())
    }

    /// Ends the stretch exactly at `position`, in both streams.
    ///
    /// # Errors
    /// A queue is full, the streams have measured different lengths, the feed is not 0, or the path
    /// does not end there.
    #[inline(never)]
    pub fn end_stretch(&mut self, position: [Position; AXES]) -> Result<(), Refused<[Position; AXES]>> {
        let mut next = self.accept;
        next.end_of_stretch(position).map_err(Refused::Invalid)?;
        if !(has_room(&self.path) && has_room(&self.feed)) {
            return Err(Refused::Full(position));
        }
        // Both queues have room, and only this end fills them: neither can fail.
        let path = enter(&mut self.path, PathItem::EndOfStretch(position));
        let feed = enter(&mut self.feed, FeedItem::EndOfStretch);
        debug_assert!(path.is_ok() && feed.is_ok(), "room for both ends");
        if path.is_err() || feed.is_err() {
            return Err(Refused::Full(position));
        }
        self.accept = next;
        self.publish();
        count(&self.shared.path_entered);
        count(&self.shared.feed_entered);
        count(&self.shared.stretches);
        Ok(())
    }

    /// Tells the intake which stream is ahead: after the item that changes it has entered, and before it is
    /// counted. A tick in between finds the announced item in its queue, and that queue not full yet. If the
    /// item were counted first, its queue could be full while the other one was still said to cover it.
    #[inline(never)]
    pub(super) fn publish(&mut self) {
        let ahead = self.accept.feed_ahead_of_path();
        self.shared.feed_covers_path.store(ahead.is_ge(), Ordering::Release);
        self.shared.path_covers_feed.store(ahead.is_le(), Ordering::Release);
    }

    /// Rests for `duration` between stretches.
    ///
    /// # Errors
    /// The queue is full, or a stretch is under way.
    #[inline(never)]
    pub fn dwell(&mut self, duration: Ticks) -> Result<(), Refused<Ticks>> {
        let mut next = self.accept;
        next.dwell(duration).map_err(Refused::Invalid)?;
        enter(&mut self.feed, FeedItem::Dwell(duration)).map_err(|_| Refused::Full(duration))?;
        count(&self.shared.feed_entered);
        self.accept = next;
        Ok(())
    }

    /// Rests until told to resume, between stretches.
    ///
    /// # Errors
    /// The queue is full, or a stretch is under way.
    pub fn program_stop(&mut self) -> Result<(), Refused<()>> {
        self.accept.at_rest().map_err(Refused::Invalid)?;
        enter(&mut self.feed, FeedItem::ProgramStop).map_err(|_| Refused::Full(()))?;
        count(&self.shared.feed_entered);
        Ok(())
    }
}
