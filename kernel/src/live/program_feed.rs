//! The program's own feed as read so far, with a cursor to the item that is handed over next.
//!
//! Items in lists stay here until they are driven, so taking back a list only moves the cursor. Background;
//! bounded by its places.

use heapless::Deque;

use super::list::{Item, LIST_ITEMS, List};
use super::splice::is_before;
use crate::law::{PlannedRamp, Ramp};
use crate::queue::Rejection;
use crate::units::Position;

/// Feed, ends of stretch and rests in the program's order. Of a stretch that is planned anew, only its end is
/// used.
#[derive(Debug)]
pub(super) struct ProgramFeed<const PLACES: usize> {
    items: Deque<Item, PLACES>,
    /// Number of first items that the list under way holds.
    under_way: usize,
    /// The next item to hand over, counted from the first.
    cursor: usize,
    /// The last stretch that is planned anew; all stretches before it are, too.
    replanned: Option<u32>,
}

impl<const PLACES: usize> ProgramFeed<PLACES> {
    pub(super) const fn new() -> Self {
        Self { items: Deque::new(), under_way: 0, cursor: 0, replanned: None }
    }

    /// Forgets everything.
    pub(super) fn restart(&mut self) {
        self.items.clear();
        (self.under_way, self.cursor, self.replanned) = (0, 0, None);
    }

    /// Whether there is a place for one more item, and for an end of stretch that waits for the path queue.
    pub(super) fn has_room(&self) -> bool {
        const { assert!(PLACES >= 4 * LIST_ITEMS, "places for what lies ahead, and for two lists") };
        let ahead = self.items.len().saturating_sub(self.cursor);
        // Two lists hold the other items.
        ahead + 2 * LIST_ITEMS < PLACES
    }

    /// Appends an item that was read.
    pub(super) fn push(&mut self, item: Item) -> Result<(), Rejection> {
        self.items.push_back(item).map_err(|_| Rejection::full("items of the program ahead", PLACES))
    }

    /// The item at the cursor.
    pub(super) fn peek(&self) -> Option<&Item> {
        self.items.get(self.cursor)
    }

    /// Whether everything read is in lists.
    pub(super) fn is_empty(&self) -> bool {
        self.peek().is_none()
    }

    /// Moves the cursor over an item that a list holds, and keeps the list's version of it in case that is
    /// taken back.
    pub(super) fn advance(&mut self, item: Item) {
        self.set(self.cursor, item);
        self.cursor += 1;
    }

    /// Moves the cursor back over the list's items `from..to`. Drops feed that is planned anew on the way.
    pub(super) fn take_back(&mut self, list: &List, from: usize, to: usize) {
        let keeps_feed = !self.replans(list.start().stretch);
        let items = list.items().take(to).skip(from);
        let mut count = items.filter(|item| keeps_feed || !item.is_feed()).count();
        while count > 0 && self.cursor > 0 {
            self.cursor -= 1;
            if keeps_feed || !self.peek().is_some_and(Item::is_feed) {
                count -= 1;
            } else {
                self.drop(1);
            }
        }
    }

    /// Moves the cursor back to the end of the items that the list under way holds.
    pub(super) fn roll_back(&mut self) {
        self.cursor = self.under_way;
    }

    /// Another list is under way: drops the items before it, which are driven or planned anew.
    pub(super) fn follow(&mut self) {
        let gone = self.under_way.min(self.cursor);
        for _ in 0..gone {
            self.items.pop_front();
        }
        self.cursor -= gone;
        self.under_way = self.cursor;
    }

    /// Splits the item at the cursor, which must be a cruise, after `part` and returns that part, which is then
    /// at the cursor. `None` if there is no feed, or no place for the rest.
    pub(super) fn split_cruise(&mut self, part: Position) -> Option<Item> {
        let &Item::Feed(PlannedRamp { ramp: Ramp { from_mm_s: feed_mm_s, .. }, length }) = self.peek()?
        else {
            return None;
        };
        let cruise = |length: Position| {
            Item::Feed(PlannedRamp { ramp: Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s), length })
        };
        let (first, rest) = (cruise(part), cruise(length - part));
        // The items before the cursor are fewer than those after it, so those move.
        self.items.push_front(first).ok()?;
        for index in 0..self.cursor {
            self.copy(index + 1, index);
        }
        self.set(self.cursor, first);
        self.set(self.cursor + 1, rest);
        Some(first)
    }

    /// Whether a stretch is planned anew.
    pub(super) fn replans(&self, stretch: u32) -> bool {
        self.replanned.is_some_and(|last| !is_before(last, stretch))
    }

    /// Marks the stretches up to this one as planned anew.
    pub(super) fn replan_through(&mut self, stretch: u32) {
        if !self.replans(stretch) {
            self.replanned = Some(stretch);
        }
    }

    /// Marks the rest of a stretch, which is at the cursor, as planned anew.
    pub(super) fn replan_from(&mut self, stretch: u32) {
        self.replan_through(stretch);
        self.drop_feed();
    }

    /// Drops the feed at the cursor, which is planned anew.
    pub(super) fn drop_feed(&mut self) {
        let mut dropped = 0;
        while self.items.get(self.cursor + dropped).is_some_and(Item::is_feed) {
            dropped += 1;
        }
        self.drop(dropped);
    }

    /// Drops `count` items at the cursor. The items before it are fewer, so those move.
    fn drop(&mut self, count: usize) {
        if count == 0 {
            return;
        }
        for index in (0..self.cursor).rev() {
            self.copy(index, index + count);
        }
        for _ in 0..count {
            self.items.pop_front();
        }
        if self.cursor < self.under_way {
            self.under_way = self.under_way.saturating_sub(count);
        }
    }

    fn copy(&mut self, from: usize, to: usize) {
        if let Some(&item) = self.items.get(from) {
            self.set(to, item);
        }
    }

    fn set(&mut self, index: usize, item: Item) {
        if let Some(place) = self.items.get_mut(index) {
            *place = item;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Ticks;
    use crate::live::splice::Splice;

    const DWELL: Item = Item::Dwell(Ticks::ONE);

    fn feed(mm: f64) -> Item {
        let length = Position::from_mm(mm).expect("in range");
        Item::Feed(PlannedRamp { ramp: Ramp::cruise(1.0, mm), length })
    }

    /// The first `count` items in a list under way.
    fn handed(items: &[Item], count: usize) -> (ProgramFeed<64>, List) {
        let mut program = ProgramFeed::new();
        for item in items {
            program.push(*item).expect("room");
        }
        let mut list = List::new(Splice { stretch: 0, at: Position::ZERO, feed_mm_s: 1.0 }, 1.0);
        for item in &items[..count] {
            program.advance(list.push(*item));
        }
        program.follow();
        (program, list)
    }

    /// The items from the cursor on.
    fn ahead(program: &ProgramFeed<64>) -> Vec<Item> {
        program.items.iter().skip(program.cursor).copied().collect()
    }

    /// A command takes back the items it replaces in the list under way; if it is refused, they are under way
    /// again.
    #[test]
    fn what_is_taken_back_comes_again() {
        let items = [feed(1.0), feed(2.0), Item::End, DWELL, feed(3.0)];
        let (mut program, list) = handed(&items, 4);
        program.take_back(&list, 1, 4);
        assert_eq!(ahead(&program), items[1..]);
        program.roll_back();
        assert_eq!(ahead(&program), items[4..]);
    }

    /// Of a stretch that is planned anew, only its end and the rests come again; its feed is dropped and no
    /// longer counts.
    #[test]
    fn feed_that_is_planned_anew_does_not_come_again() {
        let items = [DWELL, DWELL, feed(1.0), feed(2.0), Item::End, feed(3.0), Item::End];
        let (mut program, list) = handed(&items, 5);
        program.replan_through(0);
        program.take_back(&list, 1, 5);
        assert_eq!(ahead(&program), [DWELL, Item::End, feed(3.0), Item::End]);
        program.roll_back();
        assert_eq!(ahead(&program), [feed(3.0), Item::End]);
        program.replan_from(1);
        assert_eq!(ahead(&program), [Item::End]);
        assert_eq!(program.under_way, program.cursor);
    }

    /// Only items that the list under way no longer needs make room.
    #[test]
    fn there_is_room_for_what_two_lists_may_take_back() {
        let mut program = ProgramFeed::<64>::new();
        while program.has_room() {
            program.push(feed(1.0)).expect("room");
        }
        assert_eq!(ahead(&program).len(), 64 - 2 * LIST_ITEMS);
        for _ in 0..2 {
            for _ in 0..LIST_ITEMS {
                program.advance(feed(1.0));
            }
            while program.has_room() {
                program.push(feed(1.0)).expect("room: the lists hold the others");
            }
        }
        program.push(Item::End).expect_err("no place for one that nobody left");
    }

    #[test]
    fn a_cruise_is_split_at_the_cursor() {
        let items = [feed(1.0), feed(4.0), Item::End];
        let (mut program, _) = handed(&items, 1);
        let part = program.split_cruise(Position::from_mm(1.0).expect("in range"));
        assert_eq!(part, Some(feed(1.0)));
        assert_eq!(ahead(&program), [feed(1.0), feed(3.0), Item::End]);
        program.advance(feed(1.0));
        assert_eq!(program.split_cruise(Position::from_bits(1)).map(|item| item.is_feed()), Some(true));
    }
}
