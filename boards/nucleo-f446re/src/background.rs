//! The idle loop: a poll of the background after a tick, over and over.
//!
//! Of a board on its own (`alone`), or of one that a PC drives over the link (`linked`). Each says what idle and tick own of
//! it.

#[cfg(not(feature = "link"))]
mod alone;
#[cfg(feature = "link")]
mod linked;

use core::sync::atomic::{AtomicU32, Ordering};

#[cfg(not(feature = "link"))]
pub(crate) use alone::{Background, OfTick, Places};
#[cfg(feature = "link")]
pub(crate) use linked::{Background, OfTick, Places};

use crate::board;

/// Number of ticks since the start; counted by the tick.
pub(crate) static TICKS: AtomicU32 = AtomicU32::new(0);
/// Number of steps of the background: polls, and steps of plans in them. The tick feeds the watchdog only while it
/// increases.
pub(crate) static STEPS: AtomicU32 = AtomicU32::new(0);

/// The background is alive.
fn count_step() {
    STEPS.store(STEPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// Returns when a tick has just ended.
fn wait_for_tick() {
    let before = TICKS.load(Ordering::Relaxed);
    while TICKS.load(Ordering::Relaxed) == before {
        board::pause();
    }
}
