//! From one feed list to another: what background and tick tell each other.
//!
//! A *feed list* holds a complete motion: it ends at rest. Motion is changed by making another list ready and saying
//! where in the list under way it takes over, in one word ([`Change`]): after so many items of it, or inside the next
//! one, whose beginning the other list's first segment then repeats. The tick follows that word exactly, whenever it
//! finds it, or refuses it if it has passed the place; until then it is on a motion that ends at rest. So the background
//! may take as long as it likes.
//!
//! The other way go a count of ticks, where the executor is ([`Progress`]), and whether a fault asks for a stop.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::law::{Phase, Ticks};

/// How many feed lists there are: one under way, one to follow, one for what is more urgent.
pub const LISTS: u8 = 3;
/// The most items of a feed list: its queue needs one place more.
pub const LIST_ITEMS: usize = 15;

/// Where a list takes over from the one under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// The list under way, below [`LISTS`].
    pub from: u8,
    /// The list that takes over.
    pub to: u8,
    /// After so many items of `from`.
    pub after: u32,
    /// Within the item that follows them: the first segment of `to` is that item with another end.
    pub within: bool,
}

impl Change {
    /// More than a list has items.
    const AFTER_BITS: u32 = 8;
    /// The greatest [`Change::after`].
    pub const AFTER_MAX: u32 = (1 << Self::AFTER_BITS) - 1;
    /// No change is asked for.
    const NONE: u32 = u32::MAX;

    /// As the word of the `number`th change: no two that the tick may compare are equal.
    fn to_word(self, number: u32) -> u32 {
        u32::from(self.from) << 30
            | u32::from(self.to) << 28
            | u32::from(self.within) << 27
            | (number & 0x7_FFFF) << Self::AFTER_BITS
            | self.after & Self::AFTER_MAX
    }

    fn from_word(word: u32) -> Option<Self> {
        let (from, to) = ((word >> 30) as u8, (word >> 28 & 3) as u8);
        let within = word >> 27 & 1 == 1;
        (from < LISTS && to < LISTS).then_some(Self { from, to, after: word & Self::AFTER_MAX, within })
    }
}

/// Where the executor was at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Ticks so far.
    pub tick: u32,
    /// The list under way.
    pub list: u8,
    /// Items of it that are done.
    pub done: u32,
    /// Inside a segment: its phase, and how long that still takes.
    pub inside: Option<(Phase, Ticks)>,
    /// Inside a dwell or a program stop, which are done as soon as they begin.
    pub waits: bool,
}

/// A list, and how many items of it are done, as one number that goes up with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ListPlace(u32);

impl ListPlace {
    /// No list has so many items.
    pub(super) const NEVER: Self = Self(u32::MAX);
    const LIST_BIT: u32 = 30;
    const DONE_BITS: u32 = 27;

    pub(super) fn new(list: u8, done: u32) -> Self {
        Self(u32::from(list) << Self::LIST_BIT | done)
    }

    pub(super) fn list(self) -> u8 {
        (self.0 >> Self::LIST_BIT) as u8
    }

    fn done(self) -> u32 {
        self.0 & ((1 << Self::DONE_BITS) - 1)
    }

    /// One more is done. A list holds far fewer than there is room for.
    pub(super) fn next(self) -> Self {
        Self(self.0.wrapping_add(1))
    }
}

/// The mailbox between the two.
#[derive(Debug)]
pub(super) struct Mailbox {
    change: AtomicU32,
    /// A change that came too late.
    refused: AtomicU32,
    /// A bit for each list that the background fills or has filled; the tick empties the others.
    owned: AtomicU32,
    /// Counts what the background writes of the words above, so that the tick looks at one where there is nothing new.
    generation: AtomicU32,
    /// The tick asks for a stop on the path: 1.
    #[cfg(feature = "guards")]
    stop_wanted: AtomicU32,
    tick: AtomicU32,
    /// A [`ListPlace`] with the phase, and whether it waits, in the bits that it leaves.
    place: AtomicU32,
    left_high: AtomicU32,
    left_low: AtomicU32,
}

/// Reads of [`Mailbox`] that a tick may interrupt; the second one is not interrupted, a tick apart.
const READS: usize = 4;

impl Mailbox {
    const WAITS_BIT: u32 = ListPlace::DONE_BITS;
    const PHASE_BIT: u32 = Self::WAITS_BIT + 1;

    pub(super) const fn new() -> Self {
        Self {
            change: AtomicU32::new(Change::NONE),
            refused: AtomicU32::new(Change::NONE),
            owned: AtomicU32::new(1),
            generation: AtomicU32::new(0),
            #[cfg(feature = "guards")]
            stop_wanted: AtomicU32::new(0),
            tick: AtomicU32::new(0),
            place: AtomicU32::new(0),
            left_high: AtomicU32::new(0),
            left_low: AtomicU32::new(0),
        }
    }

    /// As after [`Mailbox::new`]. Neither end is in use.
    pub(super) fn reset(&self) {
        for word in [&self.change, &self.refused] {
            word.store(Change::NONE, Ordering::Relaxed);
        }
        self.owned.store(1, Ordering::Relaxed);
        for word in [&self.generation, &self.tick, &self.place, &self.left_high, &self.left_low] {
            word.store(0, Ordering::Relaxed);
        }
        #[cfg(feature = "guards")]
        self.stop_wanted.store(0, Ordering::Relaxed);
    }

    /// The tick asks for a stop, until the streams are split anew.
    #[cfg(feature = "guards")]
    pub(super) fn want_stop(&self) {
        self.stop_wanted.store(1, Ordering::Release);
    }

    /// Whether the tick asks for a stop.
    #[cfg(feature = "guards")]
    pub(super) fn is_stop_wanted(&self) -> bool {
        self.stop_wanted.load(Ordering::Acquire) != 0
    }

    /// The background asks for a change, in place of one that has not come about.
    pub(super) fn ask(&self, change: Option<Change>, number: u32) {
        let word = change.map_or(Change::NONE, |change| change.to_word(number));
        self.change.store(word, Ordering::Release);
        super::count(&self.generation);
    }

    /// Whether the change that was asked for last came too late.
    pub(super) fn is_refused(&self) -> bool {
        let asked = self.change.load(Ordering::Relaxed);
        asked != Change::NONE && self.refused.load(Ordering::Acquire) == asked
    }

    pub(super) fn own(&self, list: u8, owned: bool) {
        let (bits, bit) = (self.owned.load(Ordering::Relaxed), 1 << list);
        self.owned.store(if owned { bits | bit } else { bits & !bit }, Ordering::Release);
        super::count(&self.generation);
    }

    /// Another number than before if the background has written.
    #[inline]
    pub(super) fn generation(&self) -> u32 {
        self.generation.load(Ordering::Acquire)
    }

    /// Where the executor is, as far as the background can know.
    pub(super) fn progress(&self) -> Progress {
        let mut progress = self.read();
        for _ in 0..READS {
            if progress.tick == self.tick.load(Ordering::Acquire) {
                break;
            }
            progress = self.read();
        }
        progress
    }

    fn read(&self) -> Progress {
        let tick = self.tick.load(Ordering::Acquire);
        let place = self.place.load(Ordering::Acquire);
        let (high, low) = (self.left_high.load(Ordering::Acquire), self.left_low.load(Ordering::Acquire));
        let left = Ticks::from_bits(u64::from(high) << 32 | u64::from(low));
        let phase = match place >> Self::PHASE_BIT & 3 {
            1 => Some(Phase::Rise),
            2 => Some(Phase::Hold),
            3 => Some(Phase::Fall),
            _ => None,
        };
        Progress {
            tick,
            list: ListPlace(place).list(),
            done: ListPlace(place).done(),
            waits: place >> Self::WAITS_BIT & 1 == 1,
            inside: phase.map(|phase| (phase, left)),
        }
    }

    /// The tick says where it is.
    #[inline]
    pub(super) fn publish(&self, ListPlace(place): ListPlace, inside: Option<(Phase, Ticks)>, waits: bool) {
        let (phase, left) = inside.map_or((0, Ticks::ZERO), |(phase, left)| (phase as u32 + 1, left));
        let place = place | phase << Self::PHASE_BIT | u32::from(waits) << Self::WAITS_BIT;
        self.place.store(place, Ordering::Relaxed);
        let bits = left.to_bits();
        self.left_high.store((bits >> 32) as u32, Ordering::Relaxed);
        self.left_low.store(bits as u32, Ordering::Relaxed);
        self.tick.store(self.tick.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
    }

    /// What is asked for, with its word.
    #[inline]
    pub(super) fn asked(&self) -> Option<(u32, Change)> {
        let word = self.change.load(Ordering::Acquire);
        Change::from_word(word).map(|change| (word, change))
    }

    #[inline]
    pub(super) fn is_owned(&self, list: u8) -> bool {
        self.owned.load(Ordering::Acquire) >> list & 1 == 1
    }

    pub(super) fn refuse(&self, word: u32) {
        self.refused.store(word, Ordering::Release);
    }
}
