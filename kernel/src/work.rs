//! Work of the planner, counted where a test holds it to an amount: tests read no clock.
//!
//! Counts evaluations of the law and ceilings that are visited, for each thread by itself, and what the host
//! adds where it makes curves and blends. Without the feature `count-work` nothing is counted.

#[cfg(feature = "count-work")]
extern crate std;

#[cfg(feature = "count-work")]
std::thread_local! {
    static DONE: core::cell::Cell<u64> = const { core::cell::Cell::new(0) };
}

/// Adds some steps of work.
#[inline(always)]
pub fn add(_steps: usize) {
    #[cfg(feature = "count-work")]
    DONE.set(DONE.get() + _steps as u64);
}

/// The steps of work that this thread has done; 0 where nothing is counted.
#[must_use]
pub fn work_done() -> u64 {
    #[cfg(feature = "count-work")]
    return DONE.get();
    #[cfg(not(feature = "count-work"))]
    0
}
