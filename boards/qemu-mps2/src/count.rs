//! Counts executed instructions with SysTick.
//!
//! The emulator's virtual time is told to advance by a fixed time with every instruction (`-icount`), so the
//! timer counts instructions. How many of its steps make one is measured at the start, whatever the clock.

use core::arch::asm;
use core::hint::black_box;

use cortex_m::peripheral::{SYST, syst::SystClkSource};

const WRAP: u32 = 0x00FF_FFFF;
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
    pub fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(WRAP);
        timer.clear_current();
        timer.enable_counter();
        // The first reading after the start differs by a step.
        let _ = steps(|| ());
        let nothing = steps(|| ());
        let known = steps(|| {
            // Sound: counts a register down, two instructions a turn.
            unsafe {
                asm!("2:", "subs {turns}, {turns}, #1", "bne 2b", turns = inout(reg) KNOWN / 2 => _,
                    options(nomem, nostack))
            }
        });
        Self { nothing, known: known - nothing }
    }

    /// What `work` returns, and the instructions it took.
    #[inline(always)]
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        let before = SYST::get_current();
        let result = black_box(work());
        let after = SYST::get_current();
        let steps = (before.wrapping_sub(after) & WRAP).saturating_sub(self.nothing);
        (result, (steps * KNOWN + self.known / 2) / self.known)
    }
}

#[inline(always)]
fn steps<T>(work: impl FnOnce() -> T) -> u32 {
    let before = SYST::get_current();
    black_box(work());
    before.wrapping_sub(SYST::get_current()) & WRAP
}
