//! Braking over the blocks ahead.
//!
//! Consumes a splice and the [`Lookahead`]; produces a ramp under the ceilings, junctions and limits of all
//! the blocks that it crosses. Background.

use super::list::Item;
use super::lookahead::{AheadBlock, FEED_ROUNDING, Lookahead};
use super::splice::{SLIVER, Splice};
use crate::law::passing::Passing;
use crate::law::{Law, Limits, Phase, PlannedRamp, Ramp, Ticks};
use crate::units::Position;

/// Tolerated rounding of a length \[mm\].
pub(super) const LENGTH_ROUNDING_MM: f64 = 4.0e-9;
/// How often a ramp is made anew because it crosses blocks with lower limits.
const LIMITS_STEPS: usize = 8;

/// Number of places where braking may begin: here, and the ends of the first blocks ahead.
const STARTS_TRIED: usize = 4;

/// How motion comes to rest from a splice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Braking {
    /// The path on which the feed is kept first.
    pub(super) kept: Position,
    pub(super) ramp: PlannedRamp,
}

impl Braking {
    /// The path up to the rest.
    pub(super) fn length(&self) -> Position {
        self.kept + self.ramp.length
    }

    /// How long it takes \[s\].
    pub(super) fn time_s(&self) -> f64 {
        let Ramp { from_mm_s, .. } = self.ramp.ramp;
        let kept_s = if from_mm_s > 0.0 { self.kept.to_mm() / from_mm_s } else { 0.0 };
        kept_s + self.ramp.ramp.duration_s()
    }
}

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
        self.brake_by(from, from.at, end, feed_override, |limits| {
            Some(Ramp::new(&Law::new(self.pulse(), *limits).ok()?, from.feed_mm_s, to_mm_s))
        })
    }

    /// The braking ramp under way since `from`, driven on to rest from `since` in it. `None` if it can only be
    /// driven to its own end.
    pub(super) fn brake_on(
        &self,
        from: &Splice,
        ramp: &Item,
        since: (Phase, Ticks),
        end: Position,
        feed_override: f64,
        tick_s: f64,
    ) -> Option<PlannedRamp> {
        // Up to its own end it is nowhere faster than the ramp under way, whatever the override was then.
        let known = ramp.end(from, tick_s).at;
        self.brake_by(from, known, end, feed_override, |limits| {
            ramp.driven_to_rest(since, self.pulse(), limits, tick_s)
        })
    }

    /// The braking ramp from a splice that `make` makes within the limits of all blocks it crosses, and below
    /// the ceilings of those that begin after `known`.
    fn brake_by(
        &self,
        from: &Splice,
        known: Position,
        end: Position,
        feed_override: f64,
        make: impl Fn(&Limits<f64>) -> Option<Ramp<f64>>,
    ) -> Option<PlannedRamp> {
        let mut limits = self.from(from).next()?.limits_at(from.feed_mm_s);
        for _ in 0..LIMITS_STEPS {
            let ramp = make(&limits)?;
            let length_mm = ramp.length_mm();
            let mut length = Position::from_mm(length_mm)?;
            let left = end - (from.at + length);
            if left <= SLIVER && -left <= SLIVER {
                length = end - from.at;
            } else if left < Position::ZERO {
                return None;
            }
            let crossed = |block: &AheadBlock| block.start() < from.at + length;
            let least = self
                .from(from)
                .take_while(crossed)
                .fold(limits, |least, block| least.least(&block.limits_at(from.feed_mm_s)));
            if least == limits {
                return self
                    .is_below_ceilings(from, known, &ramp, feed_override)
                    .then_some(PlannedRamp { ramp, length });
            }
            limits = least;
        }
        None
    }

    /// The nearest rest from a splice: braking at once, or at the end of one of the blocks ahead. A blend leaves
    /// little of the limits at its feed, so motion may be nearer at rest if it drives through it first. It is
    /// sooner at rest then, too: with the feed F, on d and then in a ramp of the time T', d + F·T'/2 < F·T/2
    /// means T' < T and d/F + T' < (T + T')/2.
    pub(super) fn nearest_rest(&self, from: &Splice, end: Position, feed_override: f64) -> Option<Braking> {
        let mut best = None::<Braking>;
        let mut begin = *from;
        for block in self.from(from).take(STARTS_TRIED) {
            let kept = begin.at - from.at;
            let is_nearer = |length: Position| best.is_none_or(|best| length < best.length());
            if !is_nearer(kept) {
                break;
            }
            if let Some(ramp) = self.brake(&begin, 0.0, end, feed_override)
                && is_nearer(kept + ramp.length)
            {
                best = Some(Braking { kept, ramp });
            }
            // The junction at the block's end and the ceiling behind it count, too.
            if !self.may_keep(from, block.end() + SLIVER, feed_override) {
                break;
            }
            begin.at = block.end();
        }
        best
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

    /// Whether a braking ramp is below every ceiling and junction behind `known` on its way. It only falls, so
    /// block starts are enough.
    fn is_below_ceilings(
        &self,
        from: &Splice,
        known: Position,
        ramp: &Ramp<f64>,
        feed_override: f64,
    ) -> bool {
        let rising = ramp.reversed();
        let passing = Passing::new(&rising);
        let length_mm = ramp.length_mm();
        let mut junction_mm_s = f64::INFINITY;
        for block in self.from(from) {
            let at_mm = (block.start() - from.at).to_mm();
            // At the ramp's start the feed is given and can't be lowered.
            let cap_mm_s = if at_mm > 0.0 { block.allowed(feed_override).0 } else { f64::INFINITY };
            let most_mm_s = f64::min(cap_mm_s, junction_mm_s) * (1.0 + FEED_ROUNDING);
            if at_mm > length_mm {
                break;
            }
            // Where it has come down to that feed, from the start of its mirror image. Most often bounds tell.
            let is_here = |passed_mm: f64| length_mm - passed_mm <= at_mm + LENGTH_ROUNDING_MM;
            let (least_mm, most_mm) = passing.length_to_feed_mm(most_mm_s);
            let is_slow =
                is_here(least_mm) || is_here(most_mm) && is_here(rising.length_to_feed_mm(most_mm_s));
            if !is_slow && block.start() > known {
                return false;
            }
            junction_mm_s = block.junction_mm_s();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Pulse;
    use crate::program::{Allowed, PathBlock};

    const FEED_MM_S: f64 = 48.0;
    const HARD: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
    const SOFT: Limits<f64> = Limits { accel_mm_s2: 70.0, jerk_mm_s3: 40.0, snap_mm_s4: 4e5 };

    fn at(mm: f64) -> Position {
        Position::from_mm(mm).expect("in range")
    }

    /// Blocks of these lengths, limits and ceilings; the junctions between them ask for nothing.
    fn ahead(blocks: &[(f64, Limits<f64>, f64)]) -> Lookahead<8> {
        let mut ahead = Lookahead::new(Pulse::Plateau);
        for &(length_mm, limits, cap_mm_s) in blocks {
            let allowed = Allowed { cap_mm_s, limits };
            ahead.push(0, PathBlock::new(at(length_mm), cap_mm_s, allowed, allowed, 1e3)).expect("room");
        }
        ahead
    }

    fn rest(ahead: &Lookahead<8>, end_mm: f64) -> Option<Braking> {
        let from = Splice { stretch: 0, at: at(1.0), feed_mm_s: FEED_MM_S };
        ahead.nearest_rest(&from, at(end_mm), 1.0)
    }

    /// A blend of 1.5 mm takes 31 ms to drive through, and 2 s to brake in.
    #[test]
    fn a_blend_is_driven_through_before_braking() {
        let law = Law::new(Pulse::Plateau, HARD).expect("limits");
        let hard = Ramp::new(&law, FEED_MM_S, 0.0);
        let blocks = [(3.0, HARD, FEED_MM_S), (1.5, SOFT, FEED_MM_S), (100.0, HARD, FEED_MM_S)];
        let found = rest(&ahead(&blocks), 100.0).expect("a rest");
        assert_eq!(found.kept, at(3.5));
        assert_eq!((found.ramp.ramp.t1_s, found.ramp.ramp.t2_s), (hard.t1_s, hard.t2_s));
        assert!(libm::fabs(found.time_s() - 3.5 / FEED_MM_S - hard.duration_s()) < 1e-12);
        // Inside the blend, too; and not where it is behind.
        let found = rest(&ahead(&[blocks[1], blocks[2]]), 100.0).expect("a rest");
        assert_eq!(found.kept, at(0.5));
        assert_eq!(rest(&ahead(&[blocks[2]]), 100.0).expect("a rest").kept, Position::ZERO);
    }

    /// A soft block is not driven through where that is sooner at rest, but farther away.
    #[test]
    fn the_nearest_rest_is_taken() {
        let soft = Limits { accel_mm_s2: 100.0, jerk_mm_s3: 1e3, ..HARD };
        let blocks = [(17.0, soft, FEED_MM_S), (100.0, HARD, FEED_MM_S)];
        let found = rest(&ahead(&blocks), 100.0).expect("a rest");
        assert_eq!(found.kept, Position::ZERO);
        let hard = Ramp::new(&Law::new(Pulse::Plateau, HARD).expect("limits"), FEED_MM_S, 0.0);
        assert!(found.length() < at(16.0) && 16.0 / FEED_MM_S + hard.duration_s() < found.time_s());
    }

    /// Not where its feed is too high behind the blend, or at the junction, or where the known path ends before
    /// the rest: then it brakes in the blend.
    #[test]
    fn a_feed_is_kept_only_where_that_is_allowed() {
        let (blend, line) = ((1.5, SOFT, FEED_MM_S), (100.0, HARD, FEED_MM_S));
        let soft = rest(&ahead(&[(100.0, SOFT, FEED_MM_S)]), 100.0).expect("a rest");
        assert!(soft.kept == Position::ZERO && soft.time_s() > 2.0);
        let slow = ahead(&[blend, (100.0, HARD, 0.9 * FEED_MM_S)]);
        assert_eq!(rest(&slow, 100.0), None, "neither kept nor braked within the half millimetre");
        assert_eq!(rest(&ahead(&[blend, line]), 5.0), None, "no room");
        let mut ahead = Lookahead::<8>::new(Pulse::Plateau);
        for (junction_mm_s, (length_mm, limits, cap_mm_s)) in [(0.9 * FEED_MM_S, blend), (1e3, line)] {
            let allowed = Allowed { cap_mm_s, limits };
            let block = PathBlock::new(at(length_mm), cap_mm_s, allowed, allowed, junction_mm_s);
            ahead.push(0, block).expect("room");
        }
        assert_eq!(rest(&ahead, 100.0), None, "the junction");
    }

    /// Ceilings just before and behind the place where a stop comes down to them: what bounds in f32 leave open is
    /// decided exactly.
    #[test]
    fn a_ceiling_is_kept_to_the_last_places() {
        let ramp = Ramp::new(&Law::new(Pulse::Plateau, HARD).expect("limits"), FEED_MM_S, 0.0);
        let (mut kept, mut refused) = (0, 0);
        for part in 1..100 {
            let cap_mm_s = FEED_MM_S * f64::from(part) / 100.0;
            let there_mm = ramp.length_mm() - ramp.reversed().length_to_feed_mm(cap_mm_s);
            for off_mm in [1e-2, 1e-4, 1e-6] {
                for (begin_mm, is_kept) in [(there_mm + off_mm, true), (there_mm - off_mm, false)] {
                    // The ramp begins at 1 mm.
                    let blocks = [(1.0 + begin_mm, HARD, FEED_MM_S), (100.0, HARD, cap_mm_s)];
                    let from = Splice { stretch: 0, at: at(1.0), feed_mm_s: FEED_MM_S };
                    let found = ahead(&blocks).brake(&from, 0.0, at(100.0), 1.0);
                    assert_eq!(found.is_some(), is_kept, "{cap_mm_s} mm/s, {off_mm} mm");
                    if is_kept { kept += 1 } else { refused += 1 }
                }
            }
        }
        assert_eq!((kept, refused), (297, 297));
    }
}
