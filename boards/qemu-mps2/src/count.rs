//! Counts executed instructions with the core's timer.
//!
//! The emulator's virtual time is told to advance by a fixed time with every instruction (`-icount`), so the
//! timer counts instructions. How many of its steps make one is measured at the start, whatever the clock.

use core::hint::black_box;

use crate::processor::{Timer, WRAP, now, spend};

/// Instructions of the calibration.
const KNOWN: u32 = 1000;

/// A calibrated counter.
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    /// Steps of the timer for nothing at all, and for [`KNOWN`] instructions more.
    nothing: u32,
    known: u32,
}

impl Counter {
    /// Starts the timer and calibrates it.
    pub fn new(timer: &mut Timer) -> Self {
        timer.count();
        // The first reading after the start differs by a step.
        let _ = steps(|| ());
        let nothing = steps(|| ());
        let known = steps(|| spend(KNOWN / 2));
        Self { nothing, known: known - nothing }
    }

    /// What `work` returns, and the instructions it took.
    #[inline(always)]
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        let before = now();
        let result = black_box(work());
        let after = now();
        (result, self.instructions((after.wrapping_sub(before) & WRAP).into()))
    }

    /// The instructions of so many steps of the timer from one reading to another.
    pub fn instructions(&self, steps: u64) -> u32 {
        // 32 bits would end below the longest polls.
        let (steps, known) = (steps.saturating_sub(self.nothing.into()), u64::from(self.known));
        ((steps * u64::from(KNOWN) + known / 2) / known) as u32
    }
}

#[inline(always)]
fn steps<T>(work: impl FnOnce() -> T) -> u32 {
    let before = now();
    black_box(work());
    now().wrapping_sub(before) & WRAP
}
