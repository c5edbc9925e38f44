//! Whether the watchdog may be fed: only while tick and background are both alive.
//!
//! Consumes the background's count of its polls, each tick. The tick feeds the watchdog, so a tick that
//! has stopped ends in a reset within the watchdog's time. A
//! background that has stopped no longer counts, and the tick then stops feeding. Either alone would miss
//! half: a tick goes on regulating with nobody to stop it, a background would go on logging while an output
//! stays at its last voltage.

/// What the tick knows of the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Liveness {
    polls: u32,
    silent_ticks: u32,
    silent_ticks_max: u32,
}

impl Liveness {
    /// The background has just been seen, and may be silent for `silent_ticks_max`.
    #[must_use]
    pub const fn new(silent_ticks_max: u32) -> Self {
        Self { polls: 0, silent_ticks: 0, silent_ticks_max }
    }

    /// One tick, in which the background has counted `polls`: whether to feed the watchdog.
    pub fn may_feed(&mut self, polls: u32) -> bool {
        if polls == self.polls {
            self.silent_ticks = self.silent_ticks.saturating_add(1);
        } else {
            (self.polls, self.silent_ticks) = (polls, 0);
        }
        self.silent_ticks <= self.silent_ticks_max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feeds_only_while_the_background_counts() {
        let mut liveness = Liveness::new(200);
        for polls in 1..10_000 {
            assert!(liveness.may_feed(polls));
        }
        for _ in 0..200 {
            assert!(liveness.may_feed(9_999));
        }
        for _ in 0..10_000 {
            assert!(!liveness.may_feed(9_999));
        }
        // A counter that wraps is alive.
        assert!(liveness.may_feed(0));
    }
}
