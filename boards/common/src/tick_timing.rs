//! The tick's figures about itself: cycles, latency, overruns.
//!
//! Consumes three figures per tick, in the tick, with a few operations; the background takes the summary once
//! per second.

/// Figures of the ticks since they were last taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTiming {
    /// Number of ticks.
    pub ticks: u32,
    /// Core cycles of the shortest tick.
    pub min_cycles: u32,
    /// Core cycles of the longest tick.
    pub max_cycles: u32,
    /// Core cycles of the last tick.
    pub last_cycles: u32,
    /// Longest time from the timer's event to the tick's first instruction \[core cycles\]. Its excess over
    /// the least latency is the jitter of the sampling.
    pub max_latency_cycles: u32,
    /// Shortest such time \[core cycles\].
    pub min_latency_cycles: u32,
    /// Number of ticks that were not done when the next one was due.
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

    /// Returns the figures so far and begins anew.
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
