//! Watches whether ticks begin and end in time.
//!
//! Consumes readings of a free-running counter of any width at the beginning and end of each tick; produces a
//! fault for [`Kernel::trip`](crate::kernel::Kernel::trip). A few operations; cannot fail.
//!
//! The time between two beginnings, rounded to whole periods, tells how many ticks were missed; so a tick
//! that begins more than half a period late counts as a missed one. Ticks that begin late because an
//! interrupt was masked are no fault as long as they end before the next one is due.

use crate::fault::FaultKind;

/// Watches the ticks of one timer.
#[derive(Clone, Copy, Debug)]
pub struct TickMonitor {
    mask: u32,
    period: u32,
    began: Option<u32>,
}

/// The counter or period can't be used to watch ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TickMonitorError {
    /// Bits of the counter, expected 1 to 32.
    pub bits: u32,
    /// Counts in a period, expected at least 2 and at most a quarter of the counter's range.
    pub period: u32,
}

impl TickMonitor {
    /// A monitor for ticks every `period` counts of a counter of `bits` bits, 1 to 32.
    ///
    /// # Errors
    /// A period is less than 2 counts or more than a quarter of the counter's range.
    pub const fn new(bits: u32, period: u32) -> Result<Self, TickMonitorError> {
        if bits == 0 || bits > 32 {
            return Err(TickMonitorError { bits, period });
        }
        let mask = u32::MAX >> (32 - bits);
        if period < 2 || period > mask / 4 {
            return Err(TickMonitorError { bits, period });
        }
        Ok(Self { mask, period, began: None })
    }

    /// Begins a tick, with the counter at `now`; returns the fault of missed ticks, if any. Misses longer
    /// than the counter's range are not seen in full: the range should cover the longest time for which
    /// nothing else would stop the machine.
    pub fn began<R>(&mut self, now: u32) -> Option<FaultKind<R>> {
        let before = self.began.replace(now)?;
        let elapsed = now.wrapping_sub(before) & self.mask;
        let half = self.period / 2;
        if elapsed <= self.period + half {
            return None;
        }
        let periods = elapsed.saturating_add(half).checked_div(self.period).unwrap_or(1);
        Some(FaultKind::TickMissed { ticks: periods.saturating_sub(1).max(1) })
    }

    /// Ends the tick, with the counter at `now`; returns the fault of an overrun, if any.
    pub fn ended<R>(&self, now: u32) -> Option<FaultKind<R>> {
        let elapsed = now.wrapping_sub(self.began?) & self.mask;
        (elapsed >= self.period).then_some(FaultKind::TickOverrun)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    type Kind = FaultKind<f32>;

    /// Counters of every width, at every phase of their wrap: jitter is no fault, a missed tick is counted,
    /// an overrun is told. The oracle counts in 64 bits.
    #[test]
    fn ticks_are_told_late_missed_and_too_long_across_every_wrap() {
        let random = Random::new(0x5EED);
        for bits in [8, 12, 16, 24, 31, 32] {
            let range = 1_u64 << bits;
            let period = (range / 40).clamp(4, 90_000);
            let mut monitor = TickMonitor::new(bits, period as u32).expect("a period");
            let (mut due, mut before) = (random.below(range), None);
            let now = |counts: u64| (counts % range) as u32;
            for _ in 0..20_000 {
                let missed = if random.below(5) == 0 { random.below(20) } else { 0 };
                due += missed * period;
                let begins = due + random.below(period / 4);
                let found: Option<Kind> = monitor.began(now(begins));
                let told = before.map_or(0, |before| (begins - before + period / 2) / period - 1);
                assert_eq!(found, (told > 0).then_some(Kind::TickMissed { ticks: told as u32 }));
                assert!(before.is_none() || told == missed, "{bits} bits");
                let took = random.below(2 * period);
                let found: Option<Kind> = monitor.ended(now(begins + took));
                assert_eq!(found, (took >= period).then_some(Kind::TickOverrun), "{bits} bits");
                before = Some(begins);
                due += period;
            }
        }
    }

    #[test]
    fn what_can_not_be_told_is_refused() {
        for (bits, period) in [(0, 10), (33, 10), (16, 1), (16, 20_000), (8, 64)] {
            let refused = TickMonitor::new(bits, period).expect_err("refused");
            assert_eq!(refused, TickMonitorError { bits, period });
        }
        let mut monitor = TickMonitor::new(16, 16_383).expect("a quarter");
        assert_eq!(monitor.ended::<f32>(5), None, "no tick has begun");
        assert_eq!(monitor.began::<f32>(60_000), None, "the first one");
        assert_eq!(monitor.began::<f32>((60_000 + 16_383) & 0xFFFF), None);
    }
}
