//! One ramp of a chain, past the steps between its feeds.
//!
//! Consumes the place where it may start and the steps it passes; produces the ramp that loses the least
//! time: as hard as allowed if nothing is in its way, else later or softer.

use super::ascent::{AscentRamp, Reached};
use crate::law::passing::Passing;
use crate::law::{Law, Limits, Pulse, Ramp};
use crate::plan::Attention;

/// Factor by which a ramp below steps is made softer at a time, and how often at most.
const SOFTER: f64 = 3.0;
const SOFTER_STEPS: usize = 9;
/// Steps of the search for its best acceleration.
const GOLDEN_STEPS: usize = 5;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// How often a ramp may get longer because of the blocks it passes.
const LIMITS_STEPS: usize = 8;

/// How a ramp fits below the steps that it passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// As hard as allowed, from where it may start.
    Free,
    /// Later or softer than that.
    Hindered,
}

/// One ramp to be found.
pub(super) struct RampFit<'a, L> {
    /// No ramp is found while something more urgent waits.
    pub(super) attention: Option<&'a Attention<'a>>,
    /// The place where it may start \[mm\].
    pub(super) start_mm: f64,
    pub(super) from_mm_s: f64,
    pub(super) to_mm_s: f64,
    /// The place by which it must end \[mm\].
    pub(super) room_mm: f64,
    /// Time lost per millimetre of waiting \[s/mm\]; infinite at rest, where waiting covers no path.
    pub(super) wait_s_mm: f64,
    /// The steps it passes.
    pub(super) between: &'a [Reached],
    pub(super) pulse: Pulse,
    /// The limits it is made with: those where it may start, later also those of the blocks that the last one
    /// passed.
    pub(super) within: Limits<f64>,
    /// The limits between two positions.
    pub(super) limits: &'a L,
    /// The step that hindered the last ramp: most often it hinders the next one, too.
    pub(super) hinders: usize,
}

/// The result of a ramp with one acceleration.
enum Tried {
    Lost(f64, AscentRamp),
    /// It loses too much before anything is in its way.
    TooSoft,
    /// It would have to wait too long.
    TooHard,
}

impl<L: Fn(f64, f64) -> Limits<f64>> RampFit<'_, L> {
    /// The ramp that loses the least time, if that is less than `most_s`.
    pub(super) fn best(&mut self, most_s: f64) -> Option<(AscentRamp, Fit)> {
        if self.is_given_up() {
            return None;
        }
        let mut most_s = most_s;
        // As hard as allowed.
        let hard = self.hardest(self.within);
        let mut best = None;
        match self.below_steps(hard, self.within, most_s) {
            Tried::Lost(_, ramp) if ramp.start_mm <= self.start_mm => return Some((ramp, Fit::Free)),
            Tried::Lost(lost_s, ramp) => {
                most_s = lost_s;
                best = Some((ramp, Fit::Hindered));
            }
            Tried::TooSoft => return None,
            Tried::TooHard => {}
        }
        if self.is_given_up() {
            return None;
        }
        // The softest ramp that might lose little enough: a ramp alone loses its time × change/(2·to), and
        // takes no less than change/acceleration. If the hardest one must wait for a step, that step shows
        // how much softer ones lose.
        let change = self.to_mm_s - self.from_mm_s;
        let known = best.map_or(hard, |(ramp, _): (AscentRamp, Fit)| ramp.ramp);
        if self.is_hopeless(&known, change * change / (2.0 * self.to_mm_s * most_s), most_s) {
            return best;
        }
        let all_s = most_s;
        // Softer by factors, from the acceleration that the ramp would reach, as long as it helps.
        let hardest = hard.peak_accel_mm_s2();
        let mut try_at = |fit: &mut Self, accel: f64| {
            let tried = fit.with(accel, most_s);
            if let Tried::Lost(lost_s, ramp) = tried {
                if lost_s < most_s {
                    most_s = lost_s;
                    best = Some((ramp, Fit::Hindered));
                }
                return (lost_s, false);
            }
            (f64::INFINITY, matches!(tried, Tried::TooHard))
        };
        let (mut good, mut good_s) = (hardest, f64::INFINITY);
        let mut next = hardest;
        for _ in 0..SOFTER_STEPS {
            next /= SOFTER;
            let (lost_s, is_too_hard) = try_at(self, next);
            if lost_s < good_s {
                (good, good_s) = (next, lost_s);
            } else if !is_too_hard {
                break;
            }
        }
        if good_s == f64::INFINITY && self.is_hopeless(&known, hardest / SOFTER, all_s) {
            return best;
        }
        // Golden-section search around the best of them.
        let (mut low, mut high) = (good / SOFTER, (good * SOFTER).min(hardest));
        let at = |low: f64, high: f64| (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (mut softer, mut harder) = (try_at(self, at(low, high).0), try_at(self, at(low, high).1));
        for _ in 0..GOLDEN_STEPS {
            if harder.1 || softer.0 < harder.0 {
                high = at(low, high).1;
                (softer, harder) = (try_at(self, at(low, high).0), softer);
            } else {
                low = at(low, high).0;
                (softer, harder) = (harder, try_at(self, at(low, high).1));
            }
        }
        best
    }

    /// The ramp with at most this acceleration, if it loses at most `most_s`.
    fn with(&mut self, accel_mm_s2: f64, most_s: f64) -> Tried {
        if self.is_given_up() {
            return Tried::TooSoft;
        }
        let limits = self.softened(accel_mm_s2);
        self.below_steps(self.hardest(limits), limits, most_s)
    }

    /// The fastest ramp within `limits`.
    fn hardest(&self, limits: Limits<f64>) -> Ramp<f64> {
        Ramp::new(&Law::within(self.pulse, limits), self.from_mm_s, self.to_mm_s)
    }

    /// The limits where it may start, with no more than this acceleration.
    fn softened(&self, accel_mm_s2: f64) -> Limits<f64> {
        Limits { accel_mm_s2: accel_mm_s2.min(self.within.accel_mm_s2), ..self.within }
    }

    /// Places `ramp`, the fastest within `limits`, after the steps that it may not pass earlier, and softens
    /// it by the limits of the blocks it passes.
    fn below_steps(&mut self, ramp: Ramp<f64>, limits: Limits<f64>, most_s: f64) -> Tried {
        let (mut ramp, mut limits) = (ramp, limits);
        // Blocks passed later may allow less, which makes the ramp longer.
        for _ in 0..LIMITS_STEPS {
            if self.is_given_up() {
                return Tried::TooSoft;
            }
            let length_mm = ramp.length_mm();
            let own_s = ramp.duration_s() - length_mm / self.to_mm_s;
            if !(own_s < most_s) || self.start_mm + length_mm > self.room_mm {
                return Tried::TooSoft;
            }
            let wait_most_mm = (most_s - own_s) / self.wait_s_mm;
            let wait_most_mm = if self.wait_s_mm < f64::INFINITY { wait_most_mm } else { 0.0 };
            let latest_mm = (self.start_mm + wait_most_mm).min(self.room_mm - length_mm);
            let Some(at_mm) = self.earliest_mm(&ramp, latest_mm) else { return Tried::TooHard };
            let least = (self.limits)(at_mm, at_mm + length_mm).least(&limits);
            if least == limits {
                let waited_s =
                    if at_mm > self.start_mm { (at_mm - self.start_mm) * self.wait_s_mm } else { 0.0 };
                let Limits { jerk_mm_s3, snap_mm_s4, .. } = limits;
                self.within = Limits { jerk_mm_s3, snap_mm_s4, ..self.within };
                return Tried::Lost(own_s + waited_s, AscentRamp { start_mm: at_mm, ramp });
            }
            limits = least;
            ramp = self.hardest(limits);
        }
        Tried::TooSoft
    }

    /// Whether no ramp between `hard` and the one with `accel_mm_s2` loses less than `most_s`, as far as one
    /// step can tell. The time that a ramp loses by itself and the place where it passes the step both grow
    /// with its duration, nearly in proportion; so if two ramps lose too much because of the same step, all
    /// ramps between them do. The estimate is continued where the step no longer hinders; the real loss is
    /// never less.
    fn is_hopeless(&self, hard: &Ramp<f64>, accel_mm_s2: f64, most_s: f64) -> bool {
        if !(accel_mm_s2 > 0.0) {
            return false;
        }
        let soft = self.hardest(self.softened(accel_mm_s2));
        let ends = [hard, &soft].map(|ramp| {
            let own_s = ramp.duration_s() - ramp.length_mm() / self.to_mm_s;
            (Passing::new(ramp), self.start_mm + (most_s - own_s) / self.wait_s_mm)
        });
        let is_late = |step: &Reached| {
            ends.iter().all(|(passing, latest_mm)| {
                step.ready_mm - passing.length_to_feed_mm(step.feed_mm_s).0 >= *latest_mm
            })
        };
        self.between.get(self.hinders).is_some_and(is_late) || self.between.iter().any(is_late)
    }

    fn is_given_up(&self) -> bool {
        self.attention.is_some_and(Attention::is_wanted)
    }

    /// The first start from which the ramp passes no step's feed before the step ends, if it is not after
    /// `latest_mm`.
    fn earliest_mm(&mut self, ramp: &Ramp<f64>, latest_mm: f64) -> Option<f64> {
        if self.between.is_empty() {
            return (self.start_mm <= latest_mm).then_some(self.start_mm);
        }
        // Finding exactly where a feed is passed is expensive: done only for steps that matter.
        let passing = Passing::new(ramp);
        let about_mm = |step: &Reached| {
            let (low_mm, high_mm) = passing.length_to_feed_mm(step.feed_mm_s);
            (step.ready_mm - high_mm, step.ready_mm - low_mm)
        };
        let exact_mm = |step: &Reached| step.ready_mm - ramp.length_to_feed_mm(step.feed_mm_s);
        if self.between.get(self.hinders).is_some_and(|step| about_mm(step).0 > latest_mm) {
            return None;
        }
        // The longest wait that is certain, and the longest that other steps might cause.
        let (mut first_mm, mut last_mm, mut longest) = (self.start_mm, self.start_mm, None);
        let mut others_mm = self.start_mm;
        for (index, step) in self.between.iter().enumerate() {
            let (low_mm, high_mm) = about_mm(step);
            if low_mm > latest_mm {
                self.hinders = index;
                return None;
            }
            if low_mm > first_mm {
                others_mm = others_mm.max(last_mm);
                (first_mm, last_mm, longest) = (low_mm, high_mm, Some(step));
                self.hinders = index;
            } else {
                others_mm = others_mm.max(high_mm);
            }
        }
        let mut at_mm = longest.map_or(self.start_mm, exact_mm).max(self.start_mm);
        if others_mm > at_mm {
            for step in self.between {
                if about_mm(step).1 > at_mm {
                    if self.is_given_up() {
                        return None;
                    }
                    at_mm = at_mm.max(exact_mm(step));
                }
            }
        }
        (at_mm <= latest_mm).then_some(at_mm)
    }
}
