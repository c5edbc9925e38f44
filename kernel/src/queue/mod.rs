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
//!
//! ```
//! use motion_kernel::law::Limits;
//! use motion_kernel::path::Piece;
//! use motion_kernel::queue::{PathRules, Refused, Rejection, Streams};
//! use motion_kernel::units::Position;
//!
//! let at = |mm| Position::from_mm(mm).expect("within a kilometre");
//! let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 18, 10>::new();
//! let (mut feeder, _intake) = streams.split(rules, [at(0.0)]);
//! let line = |from_mm| Piece::line(1, [at(from_mm)], [1.0], at(4.0)).expect("a line");
//! assert_eq!(feeder.piece(line(0.0)), Ok(()));
//! // The next piece begins where the first one ends.
//! let refused = feeder.piece(line(5.0));
//! assert!(matches!(refused, Err(Refused::Invalid(Rejection::Gap { axis: 0, .. }))));
//! ```

mod accept;
#[cfg(feature = "live")]
mod change;
#[cfg(feature = "live")]
mod live;

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};

use crate::axis::{Correction, CorrectionError};
use crate::law::{FeedSegment, Ticks};
use crate::num::Real;
use crate::path::Piece;
#[cfg(feature = "guards")]
use crate::path::Travel;
use crate::units::Position;

pub(crate) use accept::Acceptance;
pub use accept::Density;
pub use accept::{PathRules, Rejection, SEGMENTS_PER_TICK_MAX};
#[cfg(feature = "live")]
pub use change::{Change, LISTS, Progress};
#[cfg(feature = "live")]
pub use live::{LiveFeeder, LiveStreams};

/// An item of the path stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathItem<R: Real, const AXES: usize> {
    /// Geometry.
    Piece(Piece<R, AXES>),
    /// The stretch ends exactly here.
    EndOfStretch([Position; AXES]),
}

/// An item of the feed stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedItem<R> {
    /// A ramp or a cruise.
    Segment(FeedSegment<R>),
    /// Rest for a time, between stretches.
    Dwell(Ticks),
    /// Rest until told to resume, between stretches.
    ProgramStop,
    /// The stretch ends, at rest.
    EndOfStretch,
}

/// An item that did not enter its queue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refused<T> {
    /// The queue is full; here is the item back. Offer it again later.
    Full(T),
    /// The item must not enter; the stream is as it was before.
    Invalid(Rejection),
}

/// Storage of both streams: `PIECES` − 1 and `SEGMENTS` − 1 items (one place tells full from empty). What is being
/// executed stays where it is: nothing is copied in the tick. With fewer than 18 pieces or 10 segments a program
/// that uses the tick's bounds to the full can starve, because a queue is refilled between ticks only; with 64 and
/// 64 the streams of a machine with three f32 axes take 17 KiB.
#[derive(Debug)]
pub struct Streams<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize> {
    path: Queue<PathItem<R, AXES>, PIECES>,
    feed: Queue<FeedItem<R>, SEGMENTS>,
    shared: Shared,
}

/// What the feeder tells the intake besides the items. Written by the feeder only.
#[derive(Debug)]
struct Shared {
    /// Ends of stretch entered so far.
    stretches: AtomicU32,
    /// Items entered so far, in either stream. The queue's own length takes a division.
    path_entered: AtomicU32,
    feed_entered: AtomicU32,
    /// In the stretch being entered, the feed covers at least as much path as the pieces.
    feed_covers_path: AtomicBool,
    /// And the pieces at least as much as the feed.
    path_covers_feed: AtomicBool,
    /// Where motion can be changed.
    #[cfg(feature = "live")]
    mailbox: change::Mailbox,
}

impl<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize>
    Streams<R, AXES, PIECES, SEGMENTS>
{
    /// Empty streams.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            path: Queue::new(),
            feed: Queue::new(),
            shared: Shared {
                stretches: AtomicU32::new(0),
                path_entered: AtomicU32::new(0),
                feed_entered: AtomicU32::new(0),
                feed_covers_path: AtomicBool::new(true),
                path_covers_feed: AtomicBool::new(true),
                #[cfg(feature = "live")]
                mailbox: change::Mailbox::new(),
            },
        }
    }

    /// The two ends, for a machine that stands at `position`. What was queued before is dropped.
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
            Feeder { path: path_in, feed: feed_in, shared, accept: accept::Acceptance::new(rules, position) };
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
            #[cfg(feature = "live")]
            lists: None,
            correction: None,
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

/// The background's end of the streams.
pub struct Feeder<'a, R: Real, const AXES: usize> {
    path: Producer<'a, PathItem<R, AXES>>,
    feed: Producer<'a, FeedItem<R>>,
    shared: &'a Shared,
    accept: accept::Acceptance<R, AXES>,
}

/// Into the queues without any check, as if memory had changed behind it.
#[cfg(all(test, feature = "guards"))]
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
    /// Refuses pieces that leave `travel` from now on, all of each, not only its ends.
    #[cfg(feature = "guards")]
    pub fn bound(&mut self, travel: Travel<AXES>) {
        self.accept.bound(travel);
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
        // Room was there and only this end fills the queues: neither can fail.
        let path = enter(&mut self.path, PathItem::EndOfStretch(position));
        let feed = enter(&mut self.feed, FeedItem::EndOfStretch);
        debug_assert!(path.is_ok() && feed.is_ok());
        self.accept = next;
        self.publish();
        count(&self.shared.path_entered);
        count(&self.shared.feed_entered);
        count(&self.shared.stretches);
        Ok(())
    }

    /// Tells the intake which stream is ahead: behind the item that changes it, and before that is counted. A tick
    /// that comes in between finds what is said to be ahead in its queue, and that queue, which had room, not full yet.
    /// Counted first, a queue would be full while the other one was still said to cover it.
    #[inline(never)]
    fn publish(&mut self) {
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

/// Always. A queue takes remainders by its places, and where the compiler does not know that there are any it links
/// a panic; their number less one is the capacity.
#[inline]
fn has_places<T>(queue: &Producer<'_, T>) -> bool {
    queue.capacity() != usize::MAX
}

/// Enters an item; gives it back if the queue is full.
#[inline(never)]
fn enter<T>(queue: &mut Producer<'_, T>, item: T) -> Result<(), T> {
    if has_places(queue) { queue.enqueue(item) } else { Err(item) }
}

#[inline]
fn has_room<T>(queue: &Producer<'_, T>) -> bool {
    has_places(queue) && queue.ready()
}

/// How many items are queued.
#[cfg(feature = "live")]
fn length<T>(queue: &Producer<'_, T>) -> usize {
    if has_places(queue) { queue.len() } else { 0 }
}

/// One more. There is a single writer, so that cores without read-modify-write instructions count too.
fn count(counter: &AtomicU32) {
    counter.store(counter.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
}

/// How full a queue was as the tick began.
#[derive(Clone, Copy, Debug)]
struct Fill {
    so_far: u32,
    before_tick: u32,
    capacity: i32,
}

impl Fill {
    /// Of an empty queue.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    fn new(entered: &AtomicU32, capacity: usize) -> Self {
        let so_far = entered.load(Ordering::Relaxed);
        Self { so_far, before_tick: so_far, capacity: capacity as i32 }
    }

    /// Whether the queue was full as the tick began: the producer has not had its turn since.
    fn was_full(&self, entered: &AtomicU32) -> bool {
        // Below 0 where the tick has met the producer between an item and its count.
        entered.load(Ordering::Acquire).wrapping_sub(self.before_tick).cast_signed() >= self.capacity
    }
}

/// The tick's end of the streams.
pub struct Intake<'a, R: Real, const AXES: usize> {
    path: Consumer<'a, PathItem<R, AXES>>,
    feed: Consumer<'a, FeedItem<R>>,
    shared: &'a Shared,
    finished: u32,
    path_fill: Fill,
    feed_fill: Fill,
    #[cfg(feature = "live")]
    lists: Option<live::Lists<'a, R>>,
    correction: Option<Correction<'a, R, AXES>>,
}

impl<'a, R: Real, const AXES: usize> Intake<'a, R, AXES> {
    /// What was learnt of a stretch to come. Another one replaces it; there is no way back to none but one without
    /// knots.
    ///
    /// # Errors
    /// Under live control, where motion keeps no times that could have been learnt. Never without.
    #[inline]
    pub fn correct(&mut self, correction: Correction<'a, R, AXES>) -> Result<(), CorrectionError> {
        #[cfg(feature = "live")]
        if self.lists.is_some() {
            return Err(CorrectionError::LiveControl);
        }
        self.correction = Some(correction);
        Ok(())
    }

    #[inline]
    pub(crate) fn correction(&mut self) -> Option<&mut Correction<'a, R, AXES>> {
        self.correction.as_mut()
    }

    /// Asks the background for a stop on the path; whether it can make one, under live control.
    #[cfg(feature = "guards")]
    pub(crate) fn want_stop(&self) -> bool {
        #[cfg(feature = "live")]
        if self.lists.is_some() {
            self.shared.mailbox.want_stop();
            return true;
        }
        false
    }

    /// A new tick: the producer has had its turn.
    #[inline]
    pub(crate) fn start_tick(&mut self) {
        self.path_fill.before_tick = self.path_fill.so_far;
        self.feed_fill.before_tick = self.feed_fill.so_far;
        #[cfg(feature = "live")]
        self.poll_changes();
    }

    /// The first item of the feed stream: the one under way, or the next.
    #[inline]
    pub(crate) fn feed(&self) -> Option<&FeedItem<R>> {
        self.feed.peek()
    }

    /// The first item of the feed stream is done.
    #[inline]
    pub(crate) fn drop_feed(&mut self) {
        self.feed_fill.so_far = self.feed_fill.so_far.wrapping_add(1);
        self.feed.dequeue();
        #[cfg(feature = "live")]
        if self.lists.is_some() {
            self.count_done();
        }
    }

    /// The first item of the path stream: the one under way, or the next.
    #[inline]
    pub(crate) fn path(&self) -> Option<&PathItem<R, AXES>> {
        self.path.peek()
    }

    /// The first item of the path stream, a piece, is done.
    #[inline]
    pub(crate) fn drop_piece(&mut self) {
        self.path_fill.so_far = self.path_fill.so_far.wrapping_add(1);
        self.path.dequeue();
    }

    /// The first item of the path stream, the end of a stretch, is done.
    #[inline]
    pub(crate) fn drop_end_of_path(&mut self) {
        self.drop_piece();
        self.finished = self.finished.wrapping_add(1);
    }

    /// Whether a stretch may begin: its end is queued; or a queue was full when the tick began, so that
    /// no more of it can be had, and the other queue was full too or covers as much path.
    #[inline]
    pub(crate) fn may_start(&self) -> bool {
        #[cfg(feature = "live")]
        if self.lists.is_some() {
            // What is handed over ends at rest on the path that is there.
            return true;
        }
        let feed_full = || self.feed_fill.was_full(&self.shared.feed_entered);
        let path_full = || self.path_fill.was_full(&self.shared.path_entered);
        self.shared.stretches.load(Ordering::Acquire) != self.finished
            || (path_full() && (feed_full() || self.shared.feed_covers_path.load(Ordering::Acquire)))
            || (feed_full() && self.shared.path_covers_feed.load(Ordering::Acquire))
    }
}
