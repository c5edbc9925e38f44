//! Changes from one feed list to another, and what background and tick tell each other about them.
//!
//! A *feed list* holds a complete motion: it ends at rest. Motion is changed by making another list ready and
//! saying where in the list under way it takes over, in one word ([`Change`]): after a number of its items,
//! or inside the next one, whose beginning the other list's first segment then repeats. The tick follows that
//! word exactly, whenever it finds it, or refuses it if it has passed the place; until then it is on a motion
//! that ends at rest. So the background may take as long as it likes.
//!
//! The tick in turn tells its count, where the executor is ([`Progress`]), and whether a fault asks for a
//! stop.

use crate::law::{Phase, Ticks};

/// Number of feed lists: one under way, one to follow, one for a more urgent command.
pub(crate) const LISTS: u8 = 3;
/// The most items of a feed list: its queue needs one place more.
pub(crate) const LIST_ITEMS: usize = 15;

/// Where a list takes over from the one under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// The list under way, below `LISTS`.
    pub from: u8,
    /// The list that takes over.
    pub to: u8,
    /// After this many items of `from`.
    pub after: u32,
    /// Within the item that follows them: the first segment of `to` is that item with another end.
    pub within: bool,
}

impl Change {
    /// Enough for the number of items in a list.
    const AFTER_BITS: u32 = 8;
    /// The greatest [`Change::after`].
    pub const AFTER_MAX: u32 = (1 << Self::AFTER_BITS) - 1;
    /// No change is asked for.
    pub(crate) const NONE: u32 = u32::MAX;

    /// The word of the `number`th change: no two words that the tick may compare are equal.
    pub(super) fn to_word(self, number: u32) -> u32 {
        u32::from(self.from) << 30
            | u32::from(self.to) << 28
            | u32::from(self.within) << 27
            | (number & 0x7_FFFF) << Self::AFTER_BITS
            | self.after & Self::AFTER_MAX
    }

    pub(crate) fn from_word(word: u32) -> Option<Self> {
        let (from, to) = ((word >> 30) as u8, (word >> 28 & 3) as u8);
        let within = word >> 27 & 1 == 1;
        (from < LISTS && to < LISTS).then_some(Self { from, to, after: word & Self::AFTER_MAX, within })
    }
}

/// Where the executor was at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of ticks so far.
    pub tick: u32,
    /// The list under way.
    pub list: u8,
    /// Number of its items that are done.
    pub done: u32,
    /// Inside a segment: its phase, and the time left in it.
    pub inside: Option<(Phase, Ticks)>,
    /// Inside a dwell or a program stop, which are done as soon as they begin.
    pub waits: bool,
}

/// A list and the number of its items done, as one number that increases with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ListPlace(pub(super) u32);

impl ListPlace {
    /// A place that no list reaches.
    pub(super) const NEVER: Self = Self(u32::MAX);
    const LIST_BIT: u32 = 30;
    pub(super) const DONE_BITS: u32 = 27;

    pub(super) fn new(list: u8, done: u32) -> Self {
        Self(u32::from(list) << Self::LIST_BIT | done)
    }

    pub(super) fn list(self) -> u8 {
        (self.0 >> Self::LIST_BIT) as u8
    }

    pub(super) fn done(self) -> u32 {
        self.0 & ((1 << Self::DONE_BITS) - 1)
    }

    /// The place after one more item. A list holds far fewer items than the number has room for.
    pub(super) fn next(self) -> Self {
        Self(self.0.wrapping_add(1))
    }
}
