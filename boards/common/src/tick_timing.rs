//! What the tick keeps about itself: cycles, latency, overruns.
//!
//! Consumes three figures a tick, in the tick, a few operations; the background takes the sum of them once
//! a second.

/// Figures of the ticks since they were last taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTiming {
    /// Ticks.
    pub ticks: u32,
    /// Core cycles of the shortest tick.
    pub min_cycles: u32,
    /// Of the longest.
    pub max_cycles: u32,
    /// Of the last.
    pub last_cycles: u32,
    /// Longest time from the timer's event to the tick's first instruction \[core cycles\]. What of it is more
    /// than the least is the jitter of the sampling.
    pub max_latency_cycles: u32,
    /// The least.
    pub min_latency_cycles: u32,
    /// Ticks that were not done when the next was due.
    pub overruns: u32,
}

impl TickTiming {
    /// No ticks yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            ticks: 0,
            min_cycles: u32::MAX,
            max_cycles: 0,
            last_cycles: 0,
            max_latency_cycles: 0,
            min_latency_cycles: u32::MAX,
            overruns: 0,
        }
    }

    /// Adds a tick.
    pub fn add(&mut self, cycles: u32, latency_cycles: u32, overrun: bool) {
        self.ticks = self.ticks.saturating_add(1);
        self.min_cycles = self.min_cycles.min(cycles);
        self.max_cycles = self.max_cycles.max(cycles);
        self.last_cycles = cycles;
        self.min_latency_cycles = self.min_latency_cycles.min(latency_cycles);
        self.max_latency_cycles = self.max_latency_cycles.max(latency_cycles);
        self.overruns = self.overruns.saturating_add(u32::from(overrun));
    }

    /// The figures so far; begins anew.
    pub fn take(&mut self) -> Self {
        core::mem::take(self)
    }
}

impl Default for TickTiming {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_extremes_and_begins_anew() {
        let mut timing = TickTiming::new();
        timing.add(500, 30, false);
        timing.add(900, 24, true);
        timing.add(700, 26, false);
        let taken = timing.take();
        let expected = TickTiming {
            ticks: 3,
            min_cycles: 500,
            max_cycles: 900,
            last_cycles: 700,
            max_latency_cycles: 30,
            min_latency_cycles: 24,
            overruns: 1,
        };
        assert_eq!(taken, expected);
        assert_eq!(timing, TickTiming::new());
    }
}
