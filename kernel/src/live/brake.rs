//! Braking over the blocks ahead.
//!
//! Consumes a splice and the [`Lookahead`]; produces a ramp under the ceilings, junctions and limits of all
//! the blocks that it crosses. Background.

use super::lookahead::{AheadBlock, FEED_ROUNDING, Lookahead};
use super::splice::{SLIVER, Splice};
use crate::law::{Law, PlannedRamp, Ramp};
use crate::units::Position;

/// Tolerated rounding of a length \[mm\].
pub(super) const LENGTH_ROUNDING_MM: f64 = 4.0e-9;
/// How often a ramp is made anew because it crosses blocks with lower limits.
const LIMITS_STEPS: usize = 8;

impl<const PLACES: usize> Lookahead<PLACES> {
    /// The fastest braking ramp from a splice to `to_mm_s`: under `feed_override`, ending no
    /// later than `end`, and within the ceilings, junctions and limits of all blocks it crosses. `None` if
    /// there is none.
    pub(super) fn brake(
        &self,
        from: &Splice,
        to_mm_s: f64,
        end: Position,
        feed_override: f64,
    ) -> Option<PlannedRamp> {
        let mut limits = self.from(from).next()?.limits_at(from.feed_mm_s);
        for _ in 0..LIMITS_STEPS {
            let ramp = Ramp::new(&Law::new(self.pulse(), limits).ok()?, from.feed_mm_s, to_mm_s);
            let length_mm = ramp.length_mm();
            let mut length = Position::from_mm(length_mm)?;
            let left = end - (from.at + length);
            if left <= SLIVER && -left <= SLIVER {
                length = end - from.at;
            } else if left < Position::ZERO {
                return None;
            }
            let crossed = |block: &AheadBlock| (block.start() - from.at).to_mm() < length_mm;
            let least = self
                .from(from)
                .take_while(crossed)
                .fold(limits, |least, block| least.least(&block.limits_at(from.feed_mm_s)));
            if least == limits {
                return self
                    .is_below_ceilings(from, &ramp, feed_override)
                    .then_some(PlannedRamp { ramp, length });
            }
            limits = least;
        }
        None
    }

    /// Whether the feed of a splice may be kept up to `end` under `feed_override`.
    pub(super) fn may_keep(&self, from: &Splice, end: Position, feed_override: f64) -> bool {
        let mut junction_mm_s = f64::INFINITY;
        self.from(from).take_while(|block| block.start() < end).all(|block| {
            let most_mm_s = f64::min(block.allowed(feed_override).0, junction_mm_s);
            junction_mm_s = block.junction_mm_s();
            from.feed_mm_s <= most_mm_s * (1.0 + FEED_ROUNDING)
        })
    }

    /// Whether a braking ramp is below every ceiling and junction on its way. It only falls, so block starts
    /// are enough.
    fn is_below_ceilings(&self, from: &Splice, ramp: &Ramp<f64>, feed_override: f64) -> bool {
        let rising = ramp.reversed();
        let length_mm = ramp.length_mm();
        let mut junction_mm_s = f64::INFINITY;
        for block in self.from(from) {
            let at_mm = (block.start() - from.at).to_mm();
            // At the ramp's start the feed is given and can't be lowered.
            let cap_mm_s = if at_mm > 0.0 { block.allowed(feed_override).0 } else { f64::INFINITY };
            let most_mm_s = f64::min(cap_mm_s, junction_mm_s) * (1.0 + FEED_ROUNDING);
            let is_slow = ramp.from_mm_s <= most_mm_s
                || length_mm - rising.length_to_feed_mm(most_mm_s) <= at_mm + LENGTH_ROUNDING_MM;
            if at_mm > length_mm {
                break;
            }
            if !is_slow {
                return false;
            }
            junction_mm_s = block.junction_mm_s();
        }
        true
    }
}
