//! Background and tick as far as they use mailbox and lists: what `LiveFeeder` with live control, and the executor, do.

use std::sync::Arc;

use motion_kernel::internals::Phase;
use motion_kernel::law::Ticks;

use super::change::{Change, LISTS, Progress};
use super::item::FeedItem;
use super::lists::Lists;
use super::mailbox::Mailbox;
use super::ring::{Consumer, Ring};

type Item = FeedItem<f64>;
pub(super) type Rings = [Arc<Ring<Item>>; LISTS as usize];

/// Items of a list.
pub(super) const ITEMS: u32 = 2;

/// An item of the `change`th list; the one under way at first is the 0th.
static NUMBERED: [Item; 8] = {
    let mut items = [Item::ProgramStop; 8];
    let mut number = 0;
    while number < items.len() {
        items[number] = Item::Dwell(Ticks::from_bits(number as u64));
        number += 1;
    }
    items
};

fn number(item: &Item) -> u32 {
    match item {
        Item::Dwell(number) => number.to_bits() as u32,
        _ => unreachable!("items are numbers"),
    }
}

/// The lists' queues; the first one is filled.
pub(super) fn rings() -> Rings {
    let rings: Rings = std::array::from_fn(|list| Ring::new(list as u8));
    fill(&rings[0], 0);
    rings
}

fn fill(ring: &Ring<Item>, change: u32) {
    for index in 0..ITEMS {
        ring.enqueue(&NUMBERED[(change * ITEMS + index) as usize]);
    }
}

/// What the tick says of the time inside an item, so that it shows what belongs to different ticks.
fn inside(tick: u32, list: u8, done: u32) -> Option<(Phase, Ticks)> {
    let bits = u64::from(tick) << 32 | u64::from(list) << 16 | u64::from(done);
    Some((if tick.is_multiple_of(2) { Phase::Rise } else { Phase::Fall }, Ticks::from_bits(bits)))
}

/// The background.
pub(super) struct Background<'a> {
    pub(super) mailbox: &'a Mailbox,
    pub(super) rings: &'a Rings,
    pub(super) current: u8,
    pub(super) next: Option<u8>,
}

impl Background<'_> {
    /// Touches every word once, and writes those of the background, before ticks come.
    pub(super) fn start(&self) {
        self.mailbox.own(0, true);
        self.mailbox.ask(Some(Change { from: 0, to: 1, after: 0, within: false }), 0);
        let _ = (self.mailbox.is_refused(), self.mailbox.is_stop_wanted(), self.mailbox.progress.progress());
        self.mailbox.ask(None, 0);
    }

    /// Asks for the `number`th change where a list is free and no change is under way.
    pub(super) fn ask(&mut self, number: u32) {
        let is_free = |&list: &u8| !self.mailbox.is_owned(list) && self.rings[usize::from(list)].is_empty();
        let done = self.settle().done;
        if self.next.is_some() {
            return;
        }
        let Some(to) = (0..LISTS).find(is_free) else { return };
        self.mailbox.own(to, true);
        fill(&self.rings[usize::from(to)], number);
        let change = Change { from: self.current, to, after: (done + 1).min(ITEMS), within: false };
        self.mailbox.ask(Some(change), number);
        self.next = Some(to);
    }

    /// Takes back the change that was asked for last, unless the tick is on it.
    pub(super) fn take_back(&mut self) {
        self.mailbox.ask(None, 0);
        self.follow();
        if let Some(next) = self.next.take() {
            self.give_up(next);
        }
    }

    /// Reads where the tick is.
    pub(super) fn read_progress(&mut self) {
        self.follow();
    }

    /// What became of the change that was asked for last.
    fn settle(&mut self) -> Progress {
        if self.mailbox.is_refused() {
            self.take_back();
        }
        self.follow()
    }

    fn follow(&mut self) -> Progress {
        let progress = self.mailbox.progress.progress();
        let Progress { tick, list, done, .. } = progress;
        assert!(
            progress.inside.is_none() || progress.inside == inside(tick, list, done),
            "what was read of the tick's place belongs to several ticks: {progress:?}"
        );
        if let Some(next) = self.next.take_if(|next| *next == list) {
            self.give_up(self.current);
            self.current = next;
        }
        progress
    }

    fn give_up(&self, list: u8) {
        self.rings[usize::from(list)].give_up();
        self.mailbox.own(list, false);
    }
}

/// The tick: it does an item a tick.
pub(super) struct Tick<'a> {
    lists: Lists<'a, f64>,
    feed: Consumer<'a, Item>,
    /// The number of the next item.
    next: u32,
    /// Items of the list under way that are done.
    done: u32,
    ticks: u32,
    /// Whether it says how long the item under way still takes.
    says_time: bool,
}

impl<'a> Tick<'a> {
    pub(super) fn new(mailbox: &'a Mailbox, [first, second, third]: &Rings, says_time: bool) -> Self {
        let lists = Lists::new(mailbox, [Consumer::new(second), Consumer::new(third)]);
        Self { lists, feed: Consumer::new(first), next: 0, done: 0, ticks: 0, says_time }
    }

    pub(super) fn tick(&mut self) {
        self.lists.poll();
        if self.lists.is_change_due() {
            if self.lists.takes_over_between_items() {
                self.lists.take_over(&mut self.feed);
                self.begin();
            } else {
                self.lists.refuse();
            }
        }
        if let Some(item) = self.feed.take() {
            assert_eq!(number(item), self.next, "an item is missing");
            (self.next, self.done) = (self.next + 1, self.done + 1);
            let list = self.feed.list();
            self.lists.item_done(&mut self.feed);
            if self.feed.list() != list {
                self.begin();
            }
        }
        self.ticks += 1;
        let inside = inside(self.ticks, self.feed.list(), self.done);
        self.lists.publish(inside.filter(|_| self.says_time), false);
    }

    /// Another list has taken over.
    fn begin(&mut self) {
        let first = number(self.feed.peek().expect("a list takes over that has no items"));
        assert_eq!(first % ITEMS, 0, "a list takes over without its first item");
        assert!(!self.feed.is_given_up(), "a list takes over that was taken back");
        (self.next, self.done) = (first, 0);
    }
}

/// After the background has ended: a few more ticks, and what was asked for last is followed or refused, and what was given
/// up is empty.
pub(super) fn finish(mut tick: Tick<'_>, mailbox: &Mailbox, rings: &Rings) {
    for _ in 0..=ITEMS {
        tick.tick();
    }
    let is_followed = |change: Change| mailbox.is_refused() || tick.feed.list() == change.to;
    assert!(mailbox.asked().is_none_or(|(_, change)| is_followed(change)), "a change is forgotten");
    for (list, ring) in (0..LISTS).zip(rings) {
        assert!(mailbox.is_owned(list) || ring.is_empty(), "a list that was given up is not emptied");
    }
}
