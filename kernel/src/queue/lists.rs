//! The tick's end of the feed lists: follows or refuses the changes that the background asks for, and empties
//! the lists that it gave up.

use super::change::{Change, LISTS, ListPlace};
use super::handover::Consumer;
use super::item::FeedItem;
use super::mailbox::Mailbox;
use crate::law::{Phase, Ticks};
use crate::num::Real;

/// Number of items of a given-up list that are dropped per tick. Each costs some twenty instructions; a list
/// of sixteen places is empty eight ticks after it was given up.
const DROPPED_PER_TICK: usize = 2;

/// The lists, if feed comes in lists.
pub(super) struct Lists<'a, R: Real>(Option<LiveLists<'a, R>>);

/// The lists of live control; the one under way is the intake's feed.
struct LiveLists<'a, R: Real> {
    mailbox: &'a Mailbox,
    /// The current list, and the number of its items done.
    place: ListPlace,
    others: [(u8, Consumer<'a, FeedItem<R>>); LISTS as usize - 1],
    /// The generation that has been dealt with.
    seen: u32,
    /// The place from which a change is due; never reached if none is asked for.
    due: ListPlace,
    /// The change asked for, as of the tick's start, with its word.
    change: Option<(u32, Change)>,
    /// The last word that came too late.
    refused: Option<u32>,
}

impl<'a, R: Real> Lists<'a, R> {
    /// No lists: feed is one stream.
    pub(super) const NONE: Self = Self(None);

    /// Begins with the first list under way; takes the second and the third.
    pub(super) fn new(mailbox: &'a Mailbox, [second, third]: [Consumer<'a, FeedItem<R>>; 2]) -> Self {
        Self(Some(LiveLists {
            mailbox,
            place: ListPlace::new(0, 0),
            others: [(1, second), (2, third)],
            seen: mailbox.generation(),
            due: ListPlace::NEVER,
            change: None,
            refused: None,
        }))
    }

    /// Drops everything and begins as after [`Lists::new`], with the first list as `feed` again. The mailbox has been reset.
    pub(super) fn restart(&mut self, feed: &mut Consumer<'a, FeedItem<R>>) {
        let Some(lists) = &mut self.0 else { return };
        for (list, queue) in &mut lists.others {
            if *list == 0 {
                *list = lists.place.list();
                core::mem::swap(queue, feed);
            }
            while queue.dequeue().is_some() {}
        }
        while feed.dequeue().is_some() {}
        (lists.place, lists.seen) = (ListPlace::new(0, 0), lists.mailbox.generation());
        (lists.due, lists.change, lists.refused) = (ListPlace::NEVER, None, None);
    }

    #[inline]
    pub(super) fn is_live(&self) -> bool {
        self.0.is_some()
    }

    /// What the background asks for; see [`Mailbox::words`].
    pub(super) fn words(&self) -> (u32, u32) {
        self.0.as_ref().map_or((Change::NONE, 0), |lists| lists.mailbox.words())
    }

    /// The list under way, and how many of its items are done.
    pub(super) fn place(&self) -> (u8, u32) {
        self.0.as_ref().map_or((0, 0), |lists| (lists.place.list(), lists.place.done()))
    }

    /// After [`Lists::restart`]: goes on at a place.
    pub(super) fn go_to(&mut self, feed: &mut Consumer<'a, FeedItem<R>>, (list, done): (u8, u32)) {
        let Some(lists) = &mut self.0 else { return };
        for (other, queue) in &mut lists.others {
            if *other == list {
                *other = lists.place.list();
                core::mem::swap(queue, feed);
                break;
            }
        }
        lists.place = ListPlace::new(list, done);
    }

    /// Empties a list that is not under way.
    pub(super) fn clear(&mut self, list: u8) {
        for (_, queue) in
            self.0.iter_mut().flat_map(|lists| &mut lists.others).filter(|(other, _)| *other == list)
        {
            while queue.dequeue().is_some() {}
        }
    }

    /// Asks the background for a stop; returns whether it can make one.
    pub(super) fn want_stop(&self) -> bool {
        let Some(lists) = &self.0 else { return false };
        lists.mailbox.want_stop();
        true
    }

    /// Reads what the background asks for, and drops items of lists that it gave up.
    #[inline]
    pub(super) fn poll(&mut self) {
        if let Some(lists) = &mut self.0 {
            let generation = lists.mailbox.generation();
            if lists.seen != generation {
                lists.poll(generation);
            }
        }
    }

    /// Counts one more item of the list under way as done.
    #[inline(never)]
    pub(super) fn item_done(&mut self, feed: &mut Consumer<'a, FeedItem<R>>) {
        let Some(lists) = &mut self.0 else { return };
        lists.place = lists.place.next();
        if lists.due == lists.place && lists.change.is_some_and(|(_, change)| !change.within) {
            self.take_over(feed);
        }
    }

    #[inline]
    pub(super) fn is_change_due(&self) -> bool {
        self.0.as_ref().is_some_and(|lists| lists.due <= lists.place)
    }

    pub(super) fn feed_after_change(&self) -> Option<&FeedItem<R>> {
        let lists = self.0.as_ref()?;
        let (_, change) = lists.change.filter(|(_, change)| change.within && lists.due == lists.place)?;
        lists.others.iter().find(|(list, _)| *list == change.to)?.1.peek()
    }

    pub(super) fn takes_over_between_items(&self) -> bool {
        self.0.as_ref().is_some_and(|lists| lists.due == lists.place)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn take_over(&mut self, feed: &mut Consumer<'a, FeedItem<R>>) {
        let Some(lists) = &mut self.0 else { return };
        let Some((_, change)) = lists.forget() else { return };
        for (list, queue) in &mut lists.others {
            if *list == change.to {
                *list = lists.place.list();
                lists.place = ListPlace::new(change.to, 0);
                core::mem::swap(queue, feed);
                // Lists already given up are emptied from the next tick on.
                lists.seen = lists.seen.wrapping_sub(1);
                return;
            }
        }
    }

    #[cold]
    pub(super) fn refuse(&mut self) {
        let Some(lists) = &mut self.0 else { return };
        if let Some((word, _)) = lists.forget() {
            lists.refused = Some(word);
            lists.mailbox.refuse(word);
        }
    }

    #[inline]
    pub(super) fn publish(&self, inside: Option<(Phase, Ticks)>, waits: bool) {
        if let Some(lists) = &self.0 {
            lists.mailbox.progress.publish(lists.place, inside, waits);
        }
    }
}

impl<R: Real> LiveLists<'_, R> {
    /// Handles a new generation, in as many ticks as it takes to empty the lists given up.
    #[cold]
    #[inline(never)]
    fn poll(&mut self, generation: u32) {
        let mailbox = self.mailbox;
        self.change = mailbox
            .asked()
            .filter(|(word, change)| change.from == self.place.list() && self.refused != Some(*word));
        self.due =
            self.change.map_or(ListPlace::NEVER, |(_, change)| ListPlace::new(change.from, change.after));
        for _ in 0..DROPPED_PER_TICK {
            // First the item, then the owner: if an item entered after its list was taken again, the list
            // reads as owned.
            let is_given_up = |(list, queue): &&mut (u8, Consumer<'_, _>)| {
                queue.peek().is_some() && !mailbox.is_owned(*list)
            };
            let Some((_, queue)) = self.others.iter_mut().find(is_given_up) else {
                self.seen = generation;
                break;
            };
            queue.dequeue();
        }
    }

    /// Forgets the change asked for, and returns it.
    fn forget(&mut self) -> Option<(u32, Change)> {
        self.due = ListPlace::NEVER;
        self.change.take()
    }
}
