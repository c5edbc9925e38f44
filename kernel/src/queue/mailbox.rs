//! The words that background and tick write for each other.
//!
//! The promise is for one core. The tick is an interrupt of it: it runs to its end, and may come between any
//! two accesses of the background. Two things rely on that: the background takes a change back by asking for
//! none and then checks whether the tick was faster; and it reads several words of [`ProgressWords`].
//!
//! The rest also holds for a tick on another core. Two release/acquire pairs matter: `change`'s, so that a
//! list that is followed is complete, and `generation`'s, so that no change is overlooked. Those of `owned`
//! and `refused` do not matter: a list's own queue orders `owned` before its items, and no other read depends
//! on `refused`. The test `handover` checks both promises; docs/PROMISES.md says in which interleavings.

use super::change::Change;
use super::counter::count;
use super::handover::{AtomicU32, Ordering};
use super::progress::ProgressWords;

/// The mailbox between background and tick.
#[derive(Debug)]
pub(super) struct Mailbox {
    change: AtomicU32,
    /// The word of a change that came too late.
    refused: AtomicU32,
    /// A bit for each list that the background fills or has filled; the tick empties the others.
    owned: AtomicU32,
    /// Counts the background's writes to the words above, so that the tick reads only this one if there is
    /// nothing new.
    generation: AtomicU32,
    /// 1 if the tick asks for a stop on the path.
    stop_wanted: AtomicU32,
    /// Where the tick is.
    pub(super) progress: ProgressWords,
}

impl Mailbox {
    pub(super) const fn new() -> Self {
        Self {
            change: AtomicU32::new(Change::NONE),
            refused: AtomicU32::new(Change::NONE),
            owned: AtomicU32::new(1),
            generation: AtomicU32::new(0),
            stop_wanted: AtomicU32::new(0),
            progress: ProgressWords::new(),
        }
    }

    /// Resets to the state after [`Mailbox::new`], but for the generation, which goes on. Neither end may be in use.
    pub(super) fn reset(&self) {
        for word in [&self.change, &self.refused] {
            word.store(Change::NONE, Ordering::Relaxed);
        }
        self.owned.store(1, Ordering::Relaxed);
        count(&self.generation);
        self.progress.reset();
        self.stop_wanted.store(0, Ordering::Relaxed);
    }

    /// Asks for a stop, from the tick, until the streams are split anew.
    pub(super) fn want_stop(&self) {
        self.stop_wanted.store(1, Ordering::Release);
    }

    /// Whether the tick asks for a stop.
    pub(super) fn is_stop_wanted(&self) -> bool {
        self.stop_wanted.load(Ordering::Acquire) != 0
    }

    /// Asks for a change, from the background; replaces one that has not been followed yet.
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

    /// Where that number is.
    pub(super) fn generation_word(&self) -> &AtomicU32 {
        &self.generation
    }

    /// The change asked for, if it was not refused, and the lists owned, for another tick to go on from.
    pub(super) fn words(&self) -> (u32, u32) {
        let change = if self.is_refused() { Change::NONE } else { self.change.load(Ordering::Acquire) };
        (change, self.owned.load(Ordering::Acquire))
    }

    /// Sets both as another background has them.
    pub(super) fn set_words(&self, (change, owned): (u32, u32)) {
        self.change.store(change, Ordering::Release);
        self.owned.store(owned, Ordering::Release);
        count(&self.generation);
    }

    /// A number that differs from before if the background has written.
    #[inline]
    pub(super) fn generation(&self) -> u32 {
        self.generation.load(Ordering::Acquire)
    }

    /// The change asked for, with its word.
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
