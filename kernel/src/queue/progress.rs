//! The tick's progress, in several words.
//!
//! A reader on the tick's core sees the words of one tick: it never sees half a tick, and reads again if it
//! was interrupted. A reader on another core may see words of two ticks.

use super::change::{ListPlace, Progress};
use super::handover::{AtomicU32, Ordering};
use crate::law::{Phase, Ticks};

/// The tick's place.
#[derive(Debug)]
pub(super) struct ProgressWords {
    tick: AtomicU32,
    /// A [`ListPlace`]; its spare bits hold the phase and whether motion waits.
    place: AtomicU32,
    left_high: AtomicU32,
    left_low: AtomicU32,
}

/// Number of repeated reads: no more ticks can come within so few accesses.
const READS: usize = 4;

impl ProgressWords {
    const WAITS_BIT: u32 = ListPlace::DONE_BITS;
    const PHASE_BIT: u32 = Self::WAITS_BIT + 1;

    pub(super) const fn new() -> Self {
        Self {
            tick: AtomicU32::new(0),
            place: AtomicU32::new(0),
            left_high: AtomicU32::new(0),
            left_low: AtomicU32::new(0),
        }
    }

    /// Resets to the state after [`ProgressWords::new`].
    pub(super) fn reset(&self) {
        for word in [&self.tick, &self.place, &self.left_high, &self.left_low] {
            word.store(0, Ordering::Relaxed);
        }
    }

    /// The number of ticks.
    pub(super) fn ticks(&self) -> u32 {
        self.tick.load(Ordering::Acquire)
    }

    /// The executor's progress, as far as the background can know.
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

    /// Publishes the tick's progress.
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
}
