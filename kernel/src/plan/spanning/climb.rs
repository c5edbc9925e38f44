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
/// Steps of the search for the best acceleration of a ramp below stairs.
const GENTLER_STEPS: usize = 10;

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
}

impl Stairs {
    /// Level ground.
    pub const NONE: Self = Self { stairs: [Stair { end_mm: 0.0, feed_mm_s: 0.0 }; STAIRS_MAX], count: 0 };

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
        let end_mm = self.stairs.get(at + 1).map_or(0.0, |high| high.end_mm);
        if let Some(low) = self.stairs.get_mut(at) {
            low.end_mm = end_mm;
        }
        self.stairs.copy_within((at + 2).min(STAIRS_MAX).., (at + 1).min(STAIRS_MAX - 1));
        self.count -= 1;
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

/// A chain of ramps, in order.
#[derive(Clone, Copy, Debug)]
pub struct Climb {
    legs: [Option<Leg>; LEGS_MAX],
    /// Where the feed is reached \[mm\].
    pub length_mm: f64,
    /// When \[s\].
    pub time_s: f64,
}

impl Climb {
    /// Its ramps, in order.
    pub fn legs(&self) -> impl DoubleEndedIterator<Item = &Leg> {
        self.legs.iter().flatten()
    }
}

/// What is known of the best chain to one feed.
#[derive(Clone, Copy, Debug)]
struct Reached {
    feed_mm_s: f64,
    /// No ramp may leave it before.
    ready_mm: f64,
    length_mm: f64,
    time_s: f64,
    /// Time less what the length takes at this feed: less is better.
    lag_s: f64,
    from: usize,
    leg: Option<Leg>,
}

/// The best chain of ramps from `from_mm_s` to `to_mm_s` that keeps below `stairs`. `limits` says what may be used
/// between two positions. `None` if there is none within `room_mm`.
pub fn climb(
    stairs: &Stairs,
    from_mm_s: f64,
    to_mm_s: f64,
    room_mm: f64,
    limits: impl Fn(f64, f64) -> Limits<f64>,
) -> Option<Climb> {
    let mut reached = [Reached {
        feed_mm_s: from_mm_s,
        ready_mm: 0.0,
        length_mm: 0.0,
        time_s: 0.0,
        lag_s: 0.0,
        from: 0,
        leg: None,
    }; LEGS_MAX + 1];
    // The feeds to rest at: what is not above the start only delays it.
    let mut last = 0;
    for stair in stairs.as_slice() {
        if stair.feed_mm_s <= from_mm_s {
            if let Some(start) = reached.first_mut() {
                start.ready_mm = start.ready_mm.max(stair.end_mm);
            }
        } else if stair.feed_mm_s < to_mm_s {
            last += 1;
            if let Some(next) = reached.get_mut(last) {
                (next.feed_mm_s, next.ready_mm, next.lag_s) = (stair.feed_mm_s, stair.end_mm, f64::INFINITY);
            }
        }
    }
    if to_mm_s > from_mm_s {
        last += 1;
        if let Some(next) = reached.get_mut(last) {
            (next.feed_mm_s, next.ready_mm, next.lag_s) = (to_mm_s, 0.0, f64::INFINITY);
        }
    }
    let mut is_best = false;
    for from in 0..last {
        let mut step = 1;
        // All the way first: if nothing is in its way there is nothing better.
        let mut to = last;
        loop {
            let (below, above) = reached.split_at_mut(from + 1);
            let (Some(start), Some(target)) = (below.last(), above.get(to - from - 1)) else { break };
            let mut is_free = false;
            if start.lag_s < f64::INFINITY {
                let between = above.get(..to - from - 1).unwrap_or(&[]);
                let start_mm = start.length_mm.max(start.ready_mm);
                if let Some((leg, is_hindered)) = fit(start, start_mm, target.feed_mm_s, room_mm, between, &limits) {
                    is_free = !is_hindered;
                    let waited_mm = leg.start_mm - start.length_mm;
                    let waited_s = if waited_mm > 0.0 { waited_mm / start.feed_mm_s } else { 0.0 };
                    let time_s = start.time_s + waited_s + leg.ramp.duration_s();
                    let length_mm = leg.start_mm + leg.ramp.length_mm();
                    let lag_s = time_s - length_mm / target.feed_mm_s;
                    if lag_s < target.lag_s
                        && length_mm <= room_mm
                        && let Some(target) = above.get_mut(to - from - 1)
                    {
                        *target = Reached { length_mm, time_s, lag_s, from, leg: Some(leg), ..*target };
                    }
                }
            }
            if to == last && is_free && from == 0 {
                is_best = true;
                break;
            }
            to = from + step;
            step = if step < 4 { step + 1 } else { step + step / 2 };
            if to >= last {
                break;
            }
        }
        if is_best {
            break;
        }
    }
    let top = reached.get(last)?;
    if !(top.lag_s < f64::INFINITY) {
        return None;
    }
    let mut climb = Climb { legs: [None; LEGS_MAX], length_mm: top.length_mm, time_s: top.time_s };
    let mut at = last;
    while at > 0 {
        let here = reached.get(at)?;
        *climb.legs.get_mut(at - 1)? = here.leg;
        at = here.from;
    }
    Some(climb)
}

/// The ramp from `start`, where it may leave from `start_mm` on, to `to_mm_s`, passing the stairs `between`; and
/// whether they hinder it.
fn fit(
    start: &Reached,
    start_mm: f64,
    to_mm_s: f64,
    room_mm: f64,
    between: &[Reached],
    limits: &impl Fn(f64, f64) -> Limits<f64>,
) -> Option<(Leg, bool)> {
    let from_mm_s = start.feed_mm_s;
    // With at most this acceleration.
    let made = |accel_mm_s2: f64| -> Option<Leg> {
        let mut within = limits(start_mm, start_mm);
        // What is passed later may allow less; the ramp gets longer by it.
        for _ in 0..8 {
            let softened = Limits { accel_mm_s2: within.accel_mm_s2.min(accel_mm_s2), ..within };
            let ramp = Ramp::new(&Law::new(softened).ok()?, from_mm_s, to_mm_s);
            let mut at_mm = start_mm;
            for stair in between {
                at_mm = at_mm.max(stair.ready_mm - ramp.length_to_feed_mm(stair.feed_mm_s));
            }
            let passed = limits(at_mm, at_mm + ramp.length_mm());
            let least = Limits {
                accel_mm_s2: within.accel_mm_s2.min(passed.accel_mm_s2),
                jerk_mm_s3: within.jerk_mm_s3.min(passed.jerk_mm_s3),
                snap_mm_s4: within.snap_mm_s4.min(passed.snap_mm_s4),
            };
            if least == within {
                return Some(Leg { start_mm: at_mm, ramp });
            }
            within = least;
        }
        None
    };
    let lost = |leg: &Leg| {
        if leg.start_mm + leg.ramp.length_mm() > room_mm {
            return f64::INFINITY;
        }
        let waited_mm = leg.start_mm - start_mm;
        let waited_s = match (waited_mm > 0.0, from_mm_s > 0.0) {
            (false, _) => 0.0,
            (true, true) => waited_mm * (1.0 / from_mm_s - 1.0 / to_mm_s),
            (true, false) => f64::INFINITY,
        };
        waited_s + leg.ramp.duration_s() - leg.ramp.length_mm() / to_mm_s
    };
    let accel = limits(start_mm, start_mm).accel_mm_s2;
    let leg = made(accel)?;
    if leg.start_mm <= start_mm {
        return Some((leg, false));
    }
    // Golden section over the acceleration.
    let ratio = 0.618_033_988_749_895;
    let (mut low, mut high) = (accel / 32.0, accel);
    let mut best = (lost(&leg), leg);
    let mut inner = [high - ratio * (high - low), low + ratio * (high - low)].map(|a| {
        let leg = made(a)?;
        Some((a, lost(&leg), leg))
    });
    for _ in 0..GENTLER_STEPS {
        let [Some((a, lost_a, leg_a)), Some((b, lost_b, leg_b))] = inner else { break };
        for (lost, leg) in [(lost_a, leg_a), (lost_b, leg_b)] {
            if lost < best.0 {
                best = (lost, leg);
            }
        }
        // At rest nothing can be waited for: what waits is too fast.
        let is_lower = lost_a < lost_b || (lost_a.is_infinite() && lost_b.is_infinite());
        let next;
        if is_lower {
            high = b;
            next = high - ratio * (high - low);
            inner = [made(next).map(|leg| (next, lost(&leg), leg)), Some((a, lost_a, leg_a))];
        } else {
            low = a;
            next = low + ratio * (high - low);
            inner = [Some((b, lost_b, leg_b)), made(next).map(|leg| (next, lost(&leg), leg))];
        }
    }
    (best.0 < f64::INFINITY).then_some((best.1, true))
}
