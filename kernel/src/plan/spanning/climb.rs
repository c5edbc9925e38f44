//! From one feed up to another below a rising staircase of ceilings.
//!
//! Consumes the staircase of one side of a hump, lowest stair first, and the feed to be reached; produces a chain of
//! ramps, each resting (a = 0) on a stair or passing some with acceleration. A ramp that would pass a stair's feed
//! before the stair ends starts later or accelerates less, whichever loses less time. The other side of a hump is
//! the same, looked at from its end.

use crate::law::{Law, Limits, Ramp};

/// Stairs that are looked at one by one; of more, those are joined that lose the least by it.
pub const STAIRS_MAX: usize = 48;
/// A chain's ramps, and where each one starts.
pub const LEGS_MAX: usize = STAIRS_MAX + 1;
/// A ramp below stairs is made softer by this factor, so often at most.
const SOFTER: f64 = 3.0;
const SOFTER_STEPS: usize = 9;
/// Steps of the search for its best acceleration.
const GOLDEN_STEPS: usize = 5;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// How often a ramp may get longer because of what it passes.
const LIMITS_STEPS: usize = 8;

/// A ceiling that holds up to a position, counted from where the climb begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stair {
    /// Where it ends \[mm\].
    pub end_mm: f64,
    /// Its feed \[mm/s\].
    pub feed_mm_s: f64,
}

/// A rising staircase.
#[derive(Clone, Copy, Debug)]
pub struct Stairs {
    stairs: [Stair; STAIRS_MAX],
    count: usize,
    /// The time lost by joining some, at most \[s\].
    pub lost_s: f64,
}

impl Stairs {
    /// Level ground.
    pub const NONE: Self =
        Self { stairs: [Stair { end_mm: 0.0, feed_mm_s: 0.0 }; STAIRS_MAX], count: 0, lost_s: 0.0 };

    /// Adds the next higher stair.
    pub fn push(&mut self, stair: Stair) {
        if self.count == STAIRS_MAX {
            self.join();
        }
        if let Some(place) = self.stairs.get_mut(self.count) {
            *place = stair;
            self.count += 1;
        }
    }

    /// Makes one of the two neighbours that lose the least time by being one: the lower feed up to the later end.
    fn join(&mut self) {
        let mut least = (f64::INFINITY, 0);
        for (index, pair) in self.stairs.windows(2).enumerate() {
            let [low, high] = pair else { break };
            let lost = (high.end_mm - low.end_mm) * (1.0 / low.feed_mm_s - 1.0 / high.feed_mm_s);
            if lost < least.0 {
                least = (lost, index);
            }
        }
        let at = least.1;
        self.lost_s += least.0;
        let end_mm = self.stairs.get(at + 1).map_or(0.0, |high| high.end_mm);
        if let Some(low) = self.stairs.get_mut(at) {
            low.end_mm = end_mm;
        }
        self.stairs.copy_within((at + 2).min(STAIRS_MAX).., (at + 1).min(STAIRS_MAX - 1));
        self.count -= 1;
    }

    /// The lowest and the highest feed \[mm/s\].
    pub fn range_mm_s(&self) -> (f64, f64) {
        let feed = |stair: Option<&Stair>| stair.map_or(0.0, |stair| stair.feed_mm_s);
        (feed(self.as_slice().first()), feed(self.as_slice().last()))
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn as_slice(&self) -> &[Stair] {
        self.stairs.get(..self.count).unwrap_or(&[])
    }
}

/// A ramp of a chain.
#[derive(Clone, Copy, Debug)]
pub struct Leg {
    /// Where it starts, from where the climb begins \[mm\].
    pub start_mm: f64,
    /// The ramp.
    pub ramp: Ramp<f64>,
}

/// What is known of the best chain to one feed.
#[derive(Clone, Copy, Debug)]
struct Reached {
    feed_mm_s: f64,
    /// No ramp may leave it before.
    ready_mm: f64,
    /// Where and when it is reached.
    length_mm: f64,
    time_s: f64,
    /// That time less what the length takes at this feed: less is better.
    lag_s: f64,
    /// The feed before, and the ramp from there.
    from: usize,
    leg: Option<Leg>,
}

impl Reached {
    const NOT: Self = Self {
        feed_mm_s: 0.0,
        ready_mm: 0.0,
        length_mm: 0.0,
        time_s: 0.0,
        lag_s: f64::INFINITY,
        from: 0,
        leg: None,
    };
}

/// The best chain of ramps up one side. Working memory, used again and again.
#[derive(Clone, Copy, Debug)]
pub struct Climb {
    reached: [Reached; LEGS_MAX + 1],
    last: usize,
    legs: [u8; LEGS_MAX],
}

impl Climb {
    /// None yet.
    pub const NONE: Self = Self { reached: [Reached::NOT; LEGS_MAX + 1], last: 0, legs: [0; LEGS_MAX] };

    /// Finds the chain from `from_mm_s` to `to_mm_s` that keeps below `stairs`, within `room_mm`; returns its length
    /// \[mm\]. `limits` says what may be used between two positions. `None` if there is no chain.
    pub fn find(
        &mut self,
        stairs: &Stairs,
        from_mm_s: f64,
        to_mm_s: f64,
        room_mm: f64,
        limits: impl Fn(f64, f64) -> Limits<f64>,
    ) -> Option<f64> {
        self.feeds(stairs, from_mm_s, to_mm_s);
        // All the way first: if nothing is in its way there is nothing better.
        if self.extend(0, self.last, room_mm, &limits) != Some(Way::Free) {
            for to in 1..=self.last {
                // From the stairs just below first: it takes a good chain to see early that others are worse.
                let (mut step, mut more) = (1, 1);
                while step <= to {
                    self.extend(to - step, to, room_mm, &limits);
                    more += usize::from(step >= 4) * (more / 2).max(1);
                    step += more;
                }
            }
        }
        let top = self.reached.get(self.last)?;
        (top.lag_s < f64::INFINITY).then_some(top.length_mm)
    }

    /// The feeds to rest at. What is not above the start only delays it.
    fn feeds(&mut self, stairs: &Stairs, from_mm_s: f64, to_mm_s: f64) {
        let mut start = Reached { feed_mm_s: from_mm_s, lag_s: 0.0, ..Reached::NOT };
        self.last = 0;
        let mut put = |feed_mm_s, ready_mm| {
            self.last += 1;
            if let Some(next) = self.reached.get_mut(self.last) {
                *next = Reached { feed_mm_s, ready_mm, ..Reached::NOT };
            }
        };
        for stair in stairs.as_slice() {
            if stair.feed_mm_s <= from_mm_s {
                start.ready_mm = start.ready_mm.max(stair.end_mm);
            } else if stair.feed_mm_s < to_mm_s {
                put(stair.feed_mm_s, stair.end_mm);
            }
        }
        if to_mm_s > from_mm_s {
            put(to_mm_s, 0.0);
        }
        if let Some(first) = self.reached.first_mut() {
            *first = start;
        }
    }

    /// Takes the chain to feed `from` and a ramp from there to feed `to`, if it is better than what is known.
    fn extend(
        &mut self,
        from: usize,
        to: usize,
        room_mm: f64,
        limits: &impl Fn(f64, f64) -> Limits<f64>,
    ) -> Option<Way> {
        let (start, target) = (self.reached.get(from)?, self.reached.get(to)?);
        let between = self.reached.get(from + 1..to)?;
        if !(start.lag_s < f64::INFINITY) {
            return None;
        }
        let start_mm = start.length_mm.max(start.ready_mm);
        let rested_s = |from_mm: f64, to_mm: f64| {
            if to_mm > from_mm { (to_mm - from_mm) / start.feed_mm_s } else { 0.0 }
        };
        let waited_s = rested_s(start.length_mm, start_mm);
        // What is lost before the ramp, as seen from the target.
        let before_s = start.time_s + waited_s - start_mm / target.feed_mm_s;
        let jump = Jump {
            start_mm,
            from_mm_s: start.feed_mm_s,
            to_mm_s: target.feed_mm_s,
            room_mm,
            between,
            start_limits: limits(start_mm, start_mm),
            limits,
        };
        let (leg, way) = jump.best(target.lag_s - before_s)?;
        let held_s = rested_s(start_mm, leg.start_mm);
        let time_s = start.time_s + waited_s + held_s + leg.ramp.duration_s();
        let length_mm = leg.start_mm + leg.ramp.length_mm();
        let lag_s = time_s - length_mm / target.feed_mm_s;
        let target = self.reached.get_mut(to)?;
        if lag_s < target.lag_s {
            *target = Reached { length_mm, time_s, lag_s, from, leg: Some(leg), ..*target };
        }
        Some(way)
    }

    /// The chain's ramps, in order.
    pub fn legs(&mut self) -> impl DoubleEndedIterator<Item = &Leg> {
        let (mut at, mut count) = (self.last, 0);
        while at > 0 {
            if let Some(place) = self.legs.get_mut(count) {
                *place = at as u8;
            }
            count += 1;
            at = self.reached.get(at).map_or(0, |here| here.from);
        }
        let legs = self.legs.get(..count).unwrap_or(&[]);
        legs.iter().rev().filter_map(|&at| self.reached.get(usize::from(at))?.leg.as_ref())
    }
}

/// Whether a ramp could be as it likes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Free,
    Hindered,
}

/// One ramp to be found.
struct Jump<'a, L> {
    /// It may start here.
    start_mm: f64,
    from_mm_s: f64,
    to_mm_s: f64,
    /// It must end here.
    room_mm: f64,
    /// The stairs it passes.
    between: &'a [Reached],
    /// What may be used where it may start.
    start_limits: Limits<f64>,
    limits: &'a L,
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
    fn best(&self, most_s: f64) -> Option<(Leg, Way)> {
        let mut most_s = most_s;
        // As hard as allowed.
        let mut best = None;
        match self.with(self.start_limits.accel_mm_s2, most_s) {
            Tried::Lost(_, leg) if leg.start_mm <= self.start_mm => return Some((leg, Way::Free)),
            Tried::Lost(lost_s, leg) => {
                most_s = lost_s;
                best = Some((leg, Way::Hindered));
            }
            Tried::TooSoft => return None,
            Tried::TooHard => {}
        }
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
        let law = Law::new(self.start_limits).ok()?;
        let hardest = Ramp::new(&law, self.from_mm_s, self.to_mm_s).peak_accel_mm_s2();
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
        let mut within = self.start_limits;
        // What is passed later may allow less; the ramp gets longer by it.
        for _ in 0..LIMITS_STEPS {
            let softened = Limits { accel_mm_s2: within.accel_mm_s2.min(accel_mm_s2), ..within };
            let Ok(law) = Law::new(softened) else { return Tried::TooSoft };
            let ramp = Ramp::new(&law, self.from_mm_s, self.to_mm_s);
            let length_mm = ramp.length_mm();
            let own_s = ramp.duration_s() - length_mm / self.to_mm_s;
            if !(own_s < most_s) || self.start_mm + length_mm > self.room_mm {
                return Tried::TooSoft;
            }
            // At rest nothing can be waited for.
            let wait_s_mm = 1.0 / self.from_mm_s - 1.0 / self.to_mm_s;
            let wait_most_mm = if wait_s_mm < f64::INFINITY { (most_s - own_s) / wait_s_mm } else { 0.0 };
            let latest_mm = (self.start_mm + wait_most_mm).min(self.room_mm - length_mm);
            let mut at_mm = self.start_mm;
            for stair in self.between {
                at_mm = at_mm.max(stair.ready_mm - ramp.length_to_feed_mm(stair.feed_mm_s));
                if at_mm > latest_mm {
                    return Tried::TooHard;
                }
            }
            let passed = (self.limits)(at_mm, at_mm + length_mm);
            let least = passed.least(&within);
            if least == within {
                let waited_s = if at_mm > self.start_mm { (at_mm - self.start_mm) * wait_s_mm } else { 0.0 };
                return Tried::Lost(own_s + waited_s, Leg { start_mm: at_mm, ramp });
            }
            within = least;
        }
        Tried::TooSoft
    }
}
