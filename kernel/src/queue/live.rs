//! Streams whose feed can be changed while it is under way: one path, three feed lists.
//!
//! Consumes pieces, and lists of feed items that each end at rest; hands them to the executor. What a list
//! may hold is checked as in [`Feeder`](super::Feeder); that it ends at rest on queued path is the
//! responsibility of the one who fills it (`kernel/live`).

use heapless::spsc::{Producer, Queue};

use super::accept::{Acceptance, PathRules};
use super::change::{Change, LIST_ITEMS, LISTS, Progress};
use super::counter::count;
use super::density::Density;
#[cfg(feature = "scope")]
use super::handover::{AtomicU32, Ordering};
use super::intake::Intake;
use super::item::{FeedItem, PathItem, Refused};
use super::lists::Lists;
use super::mailbox::Mailbox;
use super::rejection::Rejection;
#[cfg(feature = "scope")]
use super::room::has_room;
use super::room::{Fill, enter, length};
use super::shared::Shared;
use super::streams::Streams;
use super::watch::Watched;
#[cfg(any(test, feature = "watch"))]
use super::watch::{Access, Watcher};
use crate::law::{FeedSegment, Ticks};
use crate::num::Real;
use crate::path::Piece;
#[cfg(feature = "scope")]
use crate::scope::{Begun, Handed, Log};
use crate::units::Position;

/// Storage of a path and three feed lists: `PIECES` − 1 pieces, `SEGMENTS` − 1 items a list.
#[derive(Debug)]
pub struct LiveStreams<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize> {
    first: Streams<R, AXES, PIECES, SEGMENTS>,
    second: Queue<FeedItem<R>, SEGMENTS>,
    third: Queue<FeedItem<R>, SEGMENTS>,
    mailbox: Mailbox,
}

impl<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize>
    LiveStreams<R, AXES, PIECES, SEGMENTS>
{
    /// Empty streams.
    #[must_use]
    pub const fn new() -> Self {
        Self { first: Streams::new(), second: Queue::new(), third: Queue::new(), mailbox: Mailbox::new() }
    }

    /// Splits into the two ends, for a machine that stands at `position`; the first list is under way and
    /// empty. Everything queued before is dropped.
    pub fn split(
        &mut self,
        rules: PathRules,
        position: [Position; AXES],
    ) -> (LiveFeeder<'_, R, AXES>, Intake<'_, R, AXES>) {
        const { assert!(SEGMENTS > LIST_ITEMS, "a list has room for what live control makes") };
        while self.second.dequeue().is_some() {}
        while self.third.dequeue().is_some() {}
        let Streams { path, feed, shared } = &mut self.first;
        while path.dequeue().is_some() {}
        while feed.dequeue().is_some() {}
        let shared: &Shared = shared;
        let mailbox = &self.mailbox;
        mailbox.reset();
        let (path_in, path_out) = path.split();
        let (first_in, first_out) = feed.split();
        let (second_in, second_out) = self.second.split();
        let (third_in, third_out) = self.third.split();
        let acceptance = Acceptance::new(rules, position);
        let feeder = LiveFeeder {
            path: path_in,
            lists: [first_in, second_in, third_in],
            shared,
            mailbox,
            path_accept: acceptance,
            feed_accept: acceptance,
            filled: None,
            changes: 0,
            #[cfg(feature = "scope")]
            log: None,
            #[cfg(any(test, feature = "watch"))]
            watcher: None,
        };
        let intake = Intake {
            path: path_out,
            feed: first_out,
            shared,
            finished: 0,
            path_fill: Fill::new(&shared.path_entered, PIECES - 1),
            feed_fill: Fill::new(&shared.feed_entered, SEGMENTS - 1),
            lists: Lists::new(mailbox, [second_out, third_out]),
        };
        (feeder, intake)
    }
}

impl<R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize> Default
    for LiveStreams<R, AXES, PIECES, SEGMENTS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// What the background writes to the mailbox.
#[derive(Clone, Copy)]
enum Word {
    Own(u8),
    GiveUp(u8),
    Ask(Change),
    AskNothing,
}

/// The background's end.
pub struct LiveFeeder<'a, R: Real, const AXES: usize> {
    path: Producer<'a, PathItem<R, AXES>>,
    lists: [Producer<'a, FeedItem<R>>; LISTS as usize],
    shared: &'a Shared,
    mailbox: &'a Mailbox,
    path_accept: Acceptance<R, AXES>,
    /// Acceptance of the list being filled.
    feed_accept: Acceptance<R, AXES>,
    filled: Option<u8>,
    /// Number of changes asked for so far.
    changes: u32,
    /// Who is told what the tick was handed.
    #[cfg(feature = "scope")]
    log: Option<&'a mut Log<AXES>>,
    #[cfg(any(test, feature = "watch"))]
    watcher: Watcher<'a>,
}

impl<'a, R: Real, const AXES: usize> LiveFeeder<'a, R, AXES> {
    /// Begins an access to what the tick shares, which ends where this is dropped.
    #[cfg(any(test, feature = "watch"))]
    fn access(&self) -> Watched<'a> {
        Watched::begin(self.watcher)
    }

    /// Nothing.
    #[cfg(not(any(test, feature = "watch")))]
    #[inline(always)]
    fn access(&self) -> Watched {
        Watched
    }

    /// From now on `watcher` is called before and after every access to what the tick shares.
    #[cfg(any(test, feature = "watch"))]
    #[doc(hidden)]
    pub fn watch(&mut self, watcher: &'a dyn Fn(Access)) {
        self.watcher = Some(watcher);
    }

    /// Begins anew, for a machine that stands at `position`, as if the streams had been split anew: everything queued is
    /// dropped; rules and travel stay. For a caller that has both ends, so that no tick comes meanwhile. False, and nothing is
    /// changed, if `intake` is the end of other streams.
    #[must_use]
    pub fn restart(&mut self, intake: &mut Intake<'_, R, AXES>, position: [Position; AXES]) -> bool {
        if !core::ptr::eq(self.shared, intake.shared) {
            return false;
        }
        let _access = self.access();
        self.mailbox.reset();
        intake.restart();
        self.path_accept = self.path_accept.restarted(position);
        self.feed_accept = self.path_accept;
        (self.filled, self.changes) = (None, 0);
        true
    }

    /// Where the number of the words is that were written to the mailbox.
    #[cfg(feature = "scope")]
    pub(crate) fn generation(&self) -> &'a AtomicU32 {
        self.mailbox.generation_word()
    }

    /// From now on `log` is told what the tick is handed.
    #[cfg(feature = "scope")]
    pub fn set_log(&mut self, log: &'a mut Log<AXES>) {
        self.log = Some(log);
    }

    /// Who is told what the tick is handed.
    #[cfg(feature = "scope")]
    pub fn log_mut(&mut self) -> Option<&mut Log<AXES>> {
        self.log.as_deref_mut()
    }

    /// Tells the log that [`LiveFeeder::restart`] has begun anew, after `tick`: with the items of the program after so many
    /// aborts, from the one with the number `first` on.
    #[cfg(feature = "scope")]
    pub fn note_restart(&mut self, tick: u64, position: [Position; AXES], from: Option<(u16, u32)>) {
        let path_entered = self.shared.path_entered.load(Ordering::Relaxed);
        if let Some(log) = &mut self.log {
            let (aborts, first) = from.unwrap_or_default();
            log.restart(tick, position, Begun { aborts, first, path_entered, is_own: from.is_none() });
        }
    }

    /// From now on refuses pieces that leave `travel` anywhere, not only at their ends.
    #[cfg(feature = "guards")]
    pub fn bound(&mut self, travel: crate::path::Travel<AXES>) {
        self.path_accept.bound(super::bounds::Bounds::new(travel));
    }
}

/// Used by live control, and by the tests of this seam.
#[doc(hidden)]
impl<R: Real, const AXES: usize> LiveFeeder<'_, R, AXES> {
    /// Enters a piece of path that is driven at `fastest_mm_s` at most.
    ///
    /// # Errors
    /// The queue is full, the piece does not continue its predecessor, or at that feed it asks an axis for
    /// more than the number type holds.
    pub fn piece(&mut self, piece: Piece<R, AXES>, fastest_mm_s: f64) -> Result<(), Refused<Piece<R, AXES>>> {
        let mut next = self.path_accept;
        next.piece(&piece).map_err(Refused::Invalid)?;
        next.fits_at(&piece, fastest_mm_s).map_err(Refused::Invalid)?;
        let _access = self.access();
        enter(&mut self.path, PathItem::Piece(piece)).map_err(|_| Refused::Full(piece))?;
        self.path_accept = next;
        count(&self.shared.path_entered);
        Ok(())
    }

    /// Ends the path of a stretch exactly at `position`.
    ///
    /// # Errors
    /// The queue is full, or the path does not end there.
    pub fn end_of_path(&mut self, position: [Position; AXES]) -> Result<(), Refused<[Position; AXES]>> {
        let mut next = self.path_accept;
        next.end_of_path(position).map_err(Refused::Invalid)?;
        let _access = self.access();
        enter(&mut self.path, PathItem::EndOfStretch(position)).map_err(|_| Refused::Full(position))?;
        self.path_accept = next;
        count(&self.shared.path_entered);
        Ok(())
    }

    /// Number of pieces and ends of stretch that are queued, including the one under way.
    #[must_use]
    pub fn path_queued(&self) -> usize {
        let _access = self.access();
        length(&self.path)
    }

    /// The executor's progress.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let _access = self.access();
        self.mailbox.progress.progress()
    }

    /// Whether a list can be begun now.
    #[must_use]
    pub fn has_free_list(&self) -> bool {
        self.free_list().is_some()
    }

    fn free_list(&self) -> Option<u8> {
        let _access = self.access();
        let is_free =
            |(list, queue): &(u8, &Producer<'_, _>)| !self.mailbox.is_owned(*list) && length(queue) == 0;
        (0..LISTS).zip(&self.lists).find(is_free).map(|(list, _)| list)
    }

    /// Takes an empty list that is neither under way nor asked for, to be filled from path position `start`
    /// at `feed_mm_s`, after `density`. `None` if there is none now.
    pub fn begin(&mut self, start: Position, feed_mm_s: R, density: Density) -> Option<u8> {
        let free = self.free_list()?;
        self.write(Word::Own(free));
        self.feed_accept = self.path_accept.feed_from(start, feed_mm_s, density);
        self.filled = Some(free);
        Some(free)
    }

    /// Appends a segment to the list that was begun.
    ///
    /// # Errors
    /// The list is full, or the segment does not continue it or exceeds a limit.
    pub fn segment(&mut self, list: u8, segment: FeedSegment<R>) -> Result<(), Refused<FeedSegment<R>>> {
        let mut next = self.feed_accept;
        next.segment(&segment).map_err(Refused::Invalid)?;
        self.append(list, FeedItem::Segment(segment)).map_err(|_| Refused::Full(segment))?;
        self.feed_accept = next;
        Ok(())
    }

    /// Appends the end of the stretch, whose path is `path` long and complete in the queue.
    ///
    /// # Errors
    /// The list is full, the feed is not 0, or its length differs from the path's.
    pub fn end_of_feed(&mut self, list: u8, path: Position) -> Result<(), Refused<()>> {
        self.feed_accept.feed_ends(path).map_err(Refused::Invalid)?;
        self.append(list, FeedItem::EndOfStretch).map_err(|_| Refused::Full(()))?;
        self.feed_accept = self.feed_accept.feed_after_stretch();
        Ok(())
    }

    /// Appends a rest, between stretches.
    ///
    /// # Errors
    /// The list is full, a stretch is under way, or too many items would end within one tick.
    pub fn dwell(&mut self, list: u8, duration: Ticks) -> Result<(), Refused<Ticks>> {
        let mut next = self.feed_accept;
        next.feed_dwell(duration).map_err(Refused::Invalid)?;
        self.append(list, FeedItem::Dwell(duration)).map_err(|_| Refused::Full(duration))?;
        self.feed_accept = next;
        Ok(())
    }

    /// Appends a rest until told to resume, between stretches.
    ///
    /// # Errors
    /// The list is full, or a stretch is under way.
    pub fn program_stop(&mut self, list: u8) -> Result<(), Refused<()>> {
        self.feed_accept.feed_at_rest().map_err(Refused::Invalid)?;
        self.append(list, FeedItem::ProgramStop).map_err(|_| Refused::Full(()))
    }

    fn append(&mut self, list: u8, item: FeedItem<R>) -> Result<(), FeedItem<R>> {
        let _access = self.access();
        match self.lists.get_mut(usize::from(list)) {
            Some(queue) => enter(queue, item),
            None => Err(item),
        }
    }

    /// Writes a word to the mailbox, and logs it.
    fn write(&mut self, word: Word) {
        let _access = self.access();
        #[cfg(feature = "scope")]
        let begin = self.mailbox.progress.ticks();
        match word {
            Word::Own(list) => self.mailbox.own(list, true),
            Word::GiveUp(list) => self.mailbox.own(list, false),
            Word::Ask(change) => self.mailbox.ask(Some(change), self.changes),
            Word::AskNothing => self.mailbox.ask(None, 0),
        }
        #[cfg(feature = "scope")]
        if let Some(log) = &mut self.log {
            // A tick in between has seen the word or has not.
            let is_certain = self.mailbox.progress.ticks() == begin;
            log.hand(
                is_certain.then(|| self.mailbox.generation()),
                match word {
                    Word::Own(list) => Handed::Begin { list },
                    Word::GiveUp(list) => Handed::GiveUp { list },
                    Word::Ask(change) => Handed::Change(change.to_word(self.changes)),
                    Word::AskNothing => Handed::Change(Change::NONE),
                },
            );
        }
    }

    /// Number of items that a list still has room for.
    #[must_use]
    pub fn room(&self, list: u8) -> usize {
        let _access = self.access();
        self.lists.get(usize::from(list)).map_or(0, |queue| queue.capacity().saturating_sub(length(queue)))
    }

    /// Asks for a change to the list begun last; replaces a change asked for before. The caller must ensure
    /// that the list begins where it takes over and that its path is queued.
    ///
    /// # Errors
    /// The list is not the one begun last, or does not end at rest. Then nothing is asked for.
    pub fn change(&mut self, change: Change) -> Result<(), Rejection> {
        let Change { from, to, after, .. } = change;
        if self.filled != Some(to) || from == to || from >= LISTS || after > Change::AFTER_MAX {
            return Err(Rejection::NoChange { from, to, after });
        }
        let feed_mm_s = self.feed_accept.feed_mm_s();
        if feed_mm_s > R::ZERO {
            return Err(Rejection::Moving { feed_mm_s: feed_mm_s.to_f64() });
        }
        self.changes = self.changes.wrapping_add(1);
        self.write(Word::Ask(change));
        Ok(())
    }

    /// Takes back the change asked for. The tick may have followed it already.
    pub fn no_change(&mut self) {
        self.write(Word::AskNothing);
    }

    /// Whether the change asked for came too late.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        let _access = self.access();
        self.mailbox.is_refused()
    }

    /// Whether a fault asks for a stop on the path; never again after the streams are split anew.
    #[must_use]
    pub fn is_stop_wanted(&self) -> bool {
        let _access = self.access();
        self.mailbox.is_stop_wanted()
    }

    /// Gives up a list: the tick empties it.
    pub fn give_up(&mut self, list: u8) {
        self.write(Word::GiveUp(list));
    }
}

/// What was handed to another tick, handed to this one again. Nothing is checked: it was, there.
#[cfg(feature = "scope")]
impl<R: Real, const AXES: usize> LiveFeeder<'_, R, AXES> {
    /// Whether an item of path has room.
    pub(crate) fn has_path_room(&self) -> bool {
        has_room(&self.path)
    }

    /// Enters an item of path; false if there is no room.
    pub(crate) fn enter_again(&mut self, item: PathItem<R, AXES>) -> bool {
        let has_room = enter(&mut self.path, item).is_ok();
        if has_room {
            count(&self.shared.path_entered);
        }
        has_room
    }

    /// Appends an item to a list; false if there is no room.
    pub(crate) fn append_again(&mut self, list: u8, item: FeedItem<R>) -> bool {
        self.append(list, item).is_ok()
    }

    /// Sets the mailbox as another one was.
    pub(crate) fn set_words(&mut self, change: u32, owned: u32) {
        self.mailbox.set_words((change, owned));
    }

    /// Takes a list, or gives it up.
    pub(crate) fn own_again(&mut self, list: u8, owned: bool) {
        self.mailbox.own(list, owned);
    }

    /// Asks for the change of a word.
    pub(crate) fn ask_again(&mut self, word: u32) {
        let (_, owned) = self.mailbox.words();
        self.mailbox.set_words((word, owned));
    }
}
