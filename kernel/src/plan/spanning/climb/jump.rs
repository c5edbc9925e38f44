//! One ramp of a chain, past the stairs between its feeds.
//!
//! Consumes where it may start and the stairs that it passes; produces the ramp that loses the least time: as hard as
//! allowed if nothing is in its way, else later or softer.

use super::{Leg, Reached};
use crate::law::{Law, Limits, Ramp};

/// A ramp below stairs is made softer by this factor, so often at most.
const SOFTER: f64 = 3.0;
const SOFTER_STEPS: usize = 9;
/// Steps of the search for its best acceleration.
const GOLDEN_STEPS: usize = 5;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// How often a ramp may get longer because of what it passes.
const LIMITS_STEPS: usize = 8;

/// Whether a ramp could be as it likes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Free,
    Hindered,
}

/// One ramp to be found.
pub(super) struct Jump<'a, L> {
    /// It may start here.
    pub(super) start_mm: f64,
    pub(super) from_mm_s: f64,
    pub(super) to_mm_s: f64,
    /// It must end here.
    pub(super) room_mm: f64,
    /// What is lost by a millimetre of waiting \[s/mm\]: infinite at rest, where nothing can be waited for.
    pub(super) wait_s_mm: f64,
    /// The stairs it passes.
    pub(super) between: &'a [Reached],
    /// The law where it may start.
    pub(super) law: Law<f64>,
    /// What may be used between two positions.
    pub(super) limits: &'a L,
}

/// What a ramp with one acceleration loses.
enum Tried {
    Lost(f64, Leg),
    /// It loses too much before anything is in its way.
    TooSoft,
    /// It would have to wait too long.
    TooHard,
}

impl<L: Fn(f64, f64) -> Limits<f64>> Jump<'_, L> {
    /// The ramp that loses the least, if it is less than `most_s`.
    pub(super) fn best(&self, most_s: f64) -> Option<(Leg, Way)> {
        let mut most_s = most_s;
        // As hard as allowed.
        let mut best = None;
        match self.with(self.law.limits().accel_mm_s2, most_s) {
            Tried::Lost(_, leg) if leg.start_mm <= self.start_mm => return Some((leg, Way::Free)),
            Tried::Lost(lost_s, leg) => {
                most_s = lost_s;
                best = Some((leg, Way::Hindered));
            }
            Tried::TooSoft => return None,
            Tried::TooHard => {}
        }
        // The softest that might lose little enough: by itself a ramp loses its time × change/(2·to), and it takes no less
        // than change/acceleration.
        let change = self.to_mm_s - self.from_mm_s;
        if best.is_none() && self.is_hopeless(change * change / (2.0 * self.to_mm_s * most_s), most_s) {
            return None;
        }
        let all_s = most_s;
        let mut try_at = |accel: f64| {
            let tried = self.with(accel, most_s);
            if let Tried::Lost(lost_s, leg) = tried {
                if lost_s < most_s {
                    most_s = lost_s;
                    best = Some((leg, Way::Hindered));
                }
                return (lost_s, false);
            }
            (f64::INFINITY, matches!(tried, Tried::TooHard))
        };
        // Softer by steps, from what the ramp would reach, as long as it helps.
        let hardest = Ramp::new(&self.law, self.from_mm_s, self.to_mm_s).peak_accel_mm_s2();
        let (mut good, mut good_s) = (hardest, f64::INFINITY);
        let mut next = hardest;
        for _ in 0..SOFTER_STEPS {
            next /= SOFTER;
            let (lost_s, is_too_hard) = try_at(next);
            if lost_s < good_s {
                (good, good_s) = (next, lost_s);
            } else if !is_too_hard {
                break;
            }
        }
        if good_s == f64::INFINITY && self.is_hopeless(hardest / SOFTER, all_s) {
            return best;
        }
        // Golden section around the best of them.
        let (mut low, mut high) = (good / SOFTER, (good * SOFTER).min(hardest));
        let at = |low: f64, high: f64| (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (mut softer, mut harder) = (try_at(at(low, high).0), try_at(at(low, high).1));
        for _ in 0..GOLDEN_STEPS {
            if harder.1 || softer.0 < harder.0 {
                high = at(low, high).1;
                (softer, harder) = (try_at(at(low, high).0), softer);
            } else {
                low = at(low, high).0;
                (softer, harder) = (harder, try_at(at(low, high).1));
            }
        }
        best
    }

    /// The ramp with at most this acceleration, if it loses at most `most_s`.
    fn with(&self, accel_mm_s2: f64, most_s: f64) -> Tried {
        let mut within = self.law;
        // What is passed later may allow less; the ramp gets longer by it.
        for _ in 0..LIMITS_STEPS {
            let Ok(law) = within.softened(accel_mm_s2) else { return Tried::TooSoft };
            let ramp = Ramp::new(&law, self.from_mm_s, self.to_mm_s);
            let length_mm = ramp.length_mm();
            let own_s = ramp.duration_s() - length_mm / self.to_mm_s;
            if !(own_s < most_s) || self.start_mm + length_mm > self.room_mm {
                return Tried::TooSoft;
            }
            let wait_most_mm = (most_s - own_s) / self.wait_s_mm;
            let wait_most_mm = if self.wait_s_mm < f64::INFINITY { wait_most_mm } else { 0.0 };
            let latest_mm = (self.start_mm + wait_most_mm).min(self.room_mm - length_mm);
            let Some(at_mm) = self.earliest_mm(&ramp, latest_mm) else { return Tried::TooHard };
            let passed = (self.limits)(at_mm, at_mm + length_mm);
            let least = passed.least(&within.limits());
            if least == within.limits() {
                let waited_s =
                    if at_mm > self.start_mm { (at_mm - self.start_mm) * self.wait_s_mm } else { 0.0 };
                return Tried::Lost(own_s + waited_s, Leg { start_mm: at_mm, ramp });
            }
            let Ok(law) = Law::new(least) else { return Tried::TooSoft };
            within = law;
        }
        Tried::TooSoft
    }

    /// Whether no ramp with so much acceleration or more loses less than `most_s`, as far as one stair can tell: what a ramp
    /// loses by itself and where it passes the stair both grow with its time, nearly in proportion, so that between two
    /// that lose too much because of the same stair there is none that does not.
    fn is_hopeless(&self, accel_mm_s2: f64, most_s: f64) -> bool {
        let Ok(softer) = self.law.softened(accel_mm_s2) else { return false };
        let ends = [&self.law, &softer].map(|law| {
            let ramp = Ramp::new(law, self.from_mm_s, self.to_mm_s);
            let own_s = ramp.duration_s() - ramp.length_mm() / self.to_mm_s;
            let wait_most_mm = if own_s < most_s { (most_s - own_s) / self.wait_s_mm } else { 0.0 };
            (ramp, self.start_mm + wait_most_mm)
        });
        let is_late = |stair: &Reached, (ramp, latest_mm): &(Ramp<f64>, f64)| {
            stair.ready_mm - ramp.about_length_to_feed_mm(stair.feed_mm_s).1 >= *latest_mm
        };
        self.between.iter().any(|stair| ends.iter().all(|end| is_late(stair, end)))
    }

    /// The first place from where the ramp passes no stair's feed before the stair ends, if it is not after `latest_mm`.
    fn earliest_mm(&self, ramp: &Ramp<f64>, latest_mm: f64) -> Option<f64> {
        // Where exactly a feed is passed is dear to find out: only for stairs that come into question.
        let about_mm = |stair: &Reached| {
            let (low_mm, high_mm) = ramp.about_length_to_feed_mm(stair.feed_mm_s);
            (stair.ready_mm - high_mm, stair.ready_mm - low_mm)
        };
        let exact_mm = |stair: &Reached| stair.ready_mm - ramp.length_to_feed_mm(stair.feed_mm_s);
        // The stair that surely makes it wait longest, and what others might.
        let (mut first_mm, mut last_mm, mut longest) = (self.start_mm, self.start_mm, None);
        let mut others_mm = self.start_mm;
        for stair in self.between {
            let (low_mm, high_mm) = about_mm(stair);
            if low_mm > latest_mm {
                return None;
            }
            if low_mm > first_mm {
                others_mm = others_mm.max(last_mm);
                (first_mm, last_mm, longest) = (low_mm, high_mm, Some(stair));
            } else {
                others_mm = others_mm.max(high_mm);
            }
        }
        let mut at_mm = longest.map_or(self.start_mm, exact_mm).max(self.start_mm);
        if others_mm > at_mm {
            for stair in self.between {
                if about_mm(stair).1 > at_mm {
                    at_mm = at_mm.max(exact_mm(stair));
                }
            }
        }
        (at_mm <= latest_mm).then_some(at_mm)
    }
}
