//! Whether the watchdog may be fed: only while tick and background are both alive.
//!
//! Consumes the background's count of its polls, each tick. The tick feeds the watchdog, so if the tick
//! stops, the watchdog resets the board. If the background stops, it no longer counts, and the tick stops
//! feeding. One check alone would not do: a tick could continue to regulate with nobody to stop it, or a
//! background could continue to log while an output stays at its last voltage.

/// The tick's view of the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Liveness {
    polls: u32,
    silent_ticks: u32,
    silent_ticks_max: u32,
}

impl Liveness {
    /// Begins with the background just seen; it may be silent for `silent_ticks_max`.
    #[must_use]
    pub const fn new(silent_ticks_max: u32) -> Self {
        Self { polls: 0, silent_ticks: 0, silent_ticks_max }
    }

    /// One tick, with the background's count `polls`: returns whether to feed the watchdog.
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
