//! Extension of 16- and 32-bit timer counts to 64 bits.
//!
//! Consumes the raw value of a timer in encoder mode, once a tick; produces [`Counts`]. The motion
//! between two readings must stay below half the timer's range: at 0.5 ms a tick, 16 bits and
//! 0.1 µm a count that is 6.5 m/s.

use crate::units::Counts;

/// A timer's counter register as it is read.
pub trait TimerWidth: Copy {
    /// The shortest signed distance from `earlier` to `self`, modulo the register's range.
    fn distance_from(self, earlier: Self) -> i64;
}

impl TimerWidth for u16 {
    fn distance_from(self, earlier: Self) -> i64 {
        i64::from(self.wrapping_sub(earlier).cast_signed())
    }
}

impl TimerWidth for u32 {
    fn distance_from(self, earlier: Self) -> i64 {
        i64::from(self.wrapping_sub(earlier).cast_signed())
    }
}

/// Keeps the 64-bit count of one encoder.
///
/// ```
/// use motion_kernel::hal::CountExtender;
/// use motion_kernel::units::Counts;
///
/// let mut extender = CountExtender::new(65_530_u16);
/// assert_eq!(extender.extend(4), Counts(10));      // across the top
/// assert_eq!(extender.extend(65_530), Counts(0));  // and back
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CountExtender<W> {
    last: W,
    counts: i64,
}

impl<W: TimerWidth> CountExtender<W> {
    /// Starts at count 0 with the timer at `raw`.
    pub fn new(raw: W) -> Self {
        Self { last: raw, counts: 0 }
    }

    /// The extended count for the register value `raw`.
    pub fn extend(&mut self, raw: W) -> Counts {
        self.counts = self.counts.wrapping_add(raw.distance_from(self.last));
        self.last = raw;
        Counts(self.counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn follows_any_motion_below_half_the_range() {
        let random = Random::new(1);
        let (mut narrow, mut wide) = (CountExtender::new(0_u16), CountExtender::new(0_u32));
        let mut position = 0_i64;
        for _ in 0..100_000 {
            position += random.below(32_767).cast_signed() - 16_383;
            assert_eq!(narrow.extend(position as u16), Counts(position));
            assert_eq!(wide.extend(position as u32), Counts(position));
        }
    }
}
