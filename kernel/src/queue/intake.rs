//! The tick's end of the streams; it only takes.

use core::sync::atomic::Ordering;

use heapless::spsc::Consumer;

use super::item::{FeedItem, PathItem};
use super::lists::Lists;
use super::room::Fill;
use super::shared::Shared;
use crate::law::{Phase, Ticks};
use crate::num::Real;

/// Where the tick is in what it was handed.
#[cfg(feature = "scope")]
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct IntakeState {
    /// The list under way, and how many of its items are done.
    pub(crate) list: u8,
    pub(crate) done: u32,
    /// The words of the mailbox.
    pub(crate) change: u32,
    pub(crate) owned: u32,
    /// Number of pieces and ends of stretch that are done.
    pub(crate) path_taken: u32,
}

/// The tick's end of the streams.
pub struct Intake<'a, R: Real, const AXES: usize> {
    pub(super) path: Consumer<'a, PathItem<R, AXES>>,
    /// The feed stream; under live control the list under way.
    pub(super) feed: Consumer<'a, FeedItem<R>>,
    pub(super) shared: &'a Shared,
    /// Number of stretches whose path is done.
    pub(super) finished: u32,
    pub(super) path_fill: Fill,
    pub(super) feed_fill: Fill,
    pub(super) lists: Lists<'a, R>,
}

impl<R: Real, const AXES: usize> Intake<'_, R, AXES> {
    /// Whether feed comes in lists, under live control.
    #[inline]
    pub(crate) fn is_live(&self) -> bool {
        self.lists.is_live()
    }

    /// Asks the background for a stop on the path; returns whether it can make one (under live control).
    pub(crate) fn want_stop(&self) -> bool {
        self.lists.want_stop()
    }

    /// Drops everything queued, as if the streams had been split anew. The mailbox of the lists has been reset.
    #[cfg(feature = "live")]
    pub(super) fn restart(&mut self) {
        while self.path.dequeue().is_some() {}
        self.finished = 0;
        self.path_fill = self.path_fill.restarted(&self.shared.path_entered);
        self.feed_fill = self.feed_fill.restarted(&self.shared.feed_entered);
        self.lists.restart(&mut self.feed);
    }

    /// Where the tick is in what it was handed.
    #[cfg(feature = "scope")]
    pub(crate) fn state(&self) -> IntakeState {
        let ((list, done), (change, owned)) = (self.lists.place(), self.lists.words());
        IntakeState { list, done, change, owned, path_taken: self.path_fill.taken() }
    }

    /// After a restart: goes on from the state of the intake of other streams.
    #[cfg(feature = "scope")]
    pub(crate) fn go_to(&mut self, state: &IntakeState) {
        self.lists.go_to(&mut self.feed, (state.list, state.done));
    }

    /// Empties a list that is not under way.
    #[cfg(feature = "scope")]
    pub(crate) fn clear_list(&mut self, list: u8) {
        self.lists.clear(list);
    }

    /// Begins a tick: the producer has had its turn.
    #[inline]
    pub(crate) fn start_tick(&mut self) {
        self.path_fill.start_tick();
        self.feed_fill.start_tick();
        self.lists.poll();
    }

    /// The first item of the feed stream: the one under way, or the next.
    #[inline]
    pub(crate) fn feed(&self) -> Option<&FeedItem<R>> {
        self.feed.peek()
    }

    /// Drops the first item of the feed stream, which is done.
    #[inline]
    pub(crate) fn drop_feed(&mut self) {
        self.feed_fill.take_one();
        self.feed.dequeue();
        if self.lists.is_live() {
            self.lists.item_done(&mut self.feed);
        }
    }

    /// The first item of the path stream: the one under way, or the next.
    #[inline]
    pub(crate) fn path(&self) -> Option<&PathItem<R, AXES>> {
        self.path.peek()
    }

    /// Drops the first item of the path stream, a piece that is done.
    #[inline]
    pub(crate) fn drop_piece(&mut self) {
        self.path_fill.take_one();
        self.path.dequeue();
    }

    /// Drops the first item of the path stream, the end of a stretch that is done.
    #[inline]
    pub(crate) fn drop_end_of_path(&mut self) {
        self.drop_piece();
        self.finished = self.finished.wrapping_add(1);
    }

    /// Whether a stretch may begin: its end is queued, or a queue was full when the tick began, so that no
    /// more can enter it, and the other queue was full too or covers as much path. A list of live control
    /// ends at rest on queued path and may always begin.
    #[inline]
    pub(crate) fn may_start(&self) -> bool {
        let feed_full = || self.feed_fill.was_full(&self.shared.feed_entered);
        let path_full = || self.path_fill.was_full(&self.shared.path_entered);
        self.lists.is_live()
            || self.shared.stretches.load(Ordering::Acquire) != self.finished
            || (path_full() && (feed_full() || self.shared.feed_covers_path.load(Ordering::Acquire)))
            || (feed_full() && self.shared.path_covers_feed.load(Ordering::Acquire))
    }

    /// Whether a change is asked for inside the item under way, or at a place already passed, or is due with
    /// nothing under way.
    #[inline]
    pub(crate) fn is_change_due(&self) -> bool {
        self.lists.is_change_due()
    }

    /// The first item of the list asked for, if that takes over within the item under way.
    pub(crate) fn feed_after_change(&self) -> Option<&FeedItem<R>> {
        self.lists.feed_after_change()
    }

    /// Whether the change that is due takes over between items.
    pub(crate) fn takes_over_between_items(&self) -> bool {
        self.lists.takes_over_between_items()
    }

    /// Follows the change.
    pub(crate) fn take_over(&mut self) {
        self.lists.take_over(&mut self.feed);
    }

    /// Refuses the change: it came too late.
    pub(crate) fn refuse(&mut self) {
        self.lists.refuse();
    }

    /// Tells the background where the executor is at the end of a tick.
    #[inline]
    pub(crate) fn publish(&self, inside: Option<(Phase, Ticks)>, waits: bool) {
        self.lists.publish(inside, waits);
    }
}
