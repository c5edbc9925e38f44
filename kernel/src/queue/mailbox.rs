//! The words that background and tick write for one another.

use super::change::{Change, ListPlace, Progress};
use super::counter::count;
use super::handover::{AtomicU32, Ordering};
use crate::law::{Phase, Ticks};

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
        self.stop_wanted.store(0, Ordering::Relaxed);
    }

    /// The tick asks for a stop, until the streams are split anew.
    pub(super) fn want_stop(&self) {
        self.stop_wanted.store(1, Ordering::Release);
    }

    /// Whether the tick asks for a stop.
    pub(super) fn is_stop_wanted(&self) -> bool {
        self.stop_wanted.load(Ordering::Acquire) != 0
    }

    /// The background asks for a change, in place of one that has not come about.
    pub(super) fn ask(&self, change: Option<Change>, number: u32) {
        let word = change.map_or(Change::NONE, |change| change.to_word(number));
        self.change.store(word, Ordering::Release);
        count(&self.generation);
    }

    /// Whether the change that was asked for last came too late.
    pub(super) fn is_refused(&self) -> bool {
        let asked = self.change.load(Ordering::Relaxed);
        asked != Change::NONE && self.refused.load(Ordering::Acquire) == asked
    }

    pub(super) fn own(&self, list: u8, owned: bool) {
        let (bits, bit) = (self.owned.load(Ordering::Relaxed), 1 << list);
        self.owned.store(if owned { bits | bit } else { bits & !bit }, Ordering::Release);
        count(&self.generation);
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
