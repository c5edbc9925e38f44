//! From one feed up to another below a rising staircase of ceilings.
//!
//! Consumes the staircase of one side of a hump, lowest stair first, and the feed to be reached; produces a chain of
//! ramps, each resting (a = 0) on a stair or passing some with acceleration. A ramp that would pass a stair's feed
//! before the stair ends starts later or accelerates less, whichever loses less time. The other side of a hump is
//! the same, looked at from its end.
//!
//! - `jump`: one ramp of a chain.

mod jump;

use self::jump::{Jump, Way};
use crate::law::{Limits, Ramp};

/// Stairs that are looked at one by one; of more, those are joined that lose the least by it.
pub const STAIRS_MAX: usize = 48;
/// A chain's ramps, and where each one starts.
pub const LEGS_MAX: usize = STAIRS_MAX + 1;
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
    /// What a ramp from it may use where it starts, if one was asked for.
    within: Option<Limits<f64>>,
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
        within: None,
        from: 0,
        leg: None,
    };
}

/// The best chains of ramps up one side. Working memory, used again and again.
///
/// A chain to a stair is the same whatever feed is to be reached in the end, so it is looked for once.
#[derive(Clone, Copy, Debug)]
pub struct Climb {
    /// The start, then every stair above it.
    reached: [Reached; STAIRS_MAX + 1],
    stairs: usize,
    /// Stairs whose chain is known, from the lowest on.
    known: usize,
    /// What was asked for last.
    top: Reached,
    room_mm: f64,
    legs: [u8; LEGS_MAX],
}

impl Climb {
    /// None yet.
    pub const NONE: Self = Self {
        reached: [Reached::NOT; STAIRS_MAX + 1],
        stairs: 0,
        known: 0,
        top: Reached::NOT,
        room_mm: 0.0,
        legs: [0; LEGS_MAX],
    };

    /// Stands before `stairs` at `from_mm_s`, with `room_mm` to climb. What is not above the start only delays it.
    pub fn start(&mut self, stairs: &Stairs, from_mm_s: f64, room_mm: f64) {
        let mut start = Reached { feed_mm_s: from_mm_s, lag_s: 0.0, ..Reached::NOT };
        let mut count = 0;
        for stair in stairs.as_slice() {
            if stair.feed_mm_s <= from_mm_s {
                start.ready_mm = start.ready_mm.max(stair.end_mm);
            } else if let Some(next) = self.reached.get_mut(count + 1) {
                *next = Reached { feed_mm_s: stair.feed_mm_s, ready_mm: stair.end_mm, ..Reached::NOT };
                count += 1;
            }
        }
        if let Some(first) = self.reached.first_mut() {
            *first = start;
        }
        (self.stairs, self.known, self.top, self.room_mm) = (count, 0, start, room_mm);
    }

    /// Finds the chain to `to_mm_s` that keeps below the stairs, within the room; returns its length \[mm\]. `limits` says
    /// what may be used between two positions, always the same for one start. `None` if there is no chain.
    pub fn find(&mut self, to_mm_s: f64, limits: impl Fn(f64, f64) -> Limits<f64>) -> Option<f64> {
        let start = *self.reached.first()?;
        if !(to_mm_s > start.feed_mm_s) {
            self.top = start;
            return Some(0.0);
        }
        let stairs = self.reached.get(1..=self.stairs)?;
        let below = stairs.partition_point(|stair| stair.feed_mm_s < to_mm_s);
        let mut top = Reached { feed_mm_s: to_mm_s, ..Reached::NOT };
        // All the way first: if nothing is in its way there is nothing better.
        if self.extend(&mut top, 0, below, &limits) != Some(Way::Free) {
            while self.known < below {
                let mut next = *self.reached.get(self.known + 1)?;
                self.climb(&mut next, self.known, &limits);
                self.known += 1;
                *self.reached.get_mut(self.known)? = next;
            }
            self.climb(&mut top, below, &limits);
        }
        self.top = top;
        (top.lag_s < f64::INFINITY).then_some(top.length_mm)
    }

    /// Finds the best chain to `target`, which is above so many stairs.
    fn climb(&mut self, target: &mut Reached, below: usize, limits: &impl Fn(f64, f64) -> Limits<f64>) {
        // From the stairs just below first: it takes a good chain to see early that others are worse.
        let (mut step, mut more) = (0, 1);
        while step <= below {
            self.extend(target, below - step, below, limits);
            more += usize::from(step >= 3) * (more / 2).max(1);
            step += more;
        }
    }

    /// Takes the chain to stair `from` and a ramp from there to `target`, if it is better than what is known.
    fn extend(
        &mut self,
        target: &mut Reached,
        from: usize,
        below: usize,
        limits: &impl Fn(f64, f64) -> Limits<f64>,
    ) -> Option<Way> {
        let start = self.reached.get_mut(from)?;
        if !(start.lag_s < f64::INFINITY) {
            return None;
        }
        let start_mm = start.length_mm.max(start.ready_mm);
        let within = *start.within.get_or_insert_with(|| limits(start_mm, start_mm));
        let start = self.reached.get(from)?;
        let rested_s = |from_mm: f64, to_mm: f64| {
            if to_mm > from_mm { (to_mm - from_mm) / start.feed_mm_s } else { 0.0 }
        };
        let waited_s = rested_s(start.length_mm, start_mm);
        // What is lost before the ramp, as seen from the target.
        let before_s = start.time_s + waited_s - start_mm / target.feed_mm_s;
        let mut jump = Jump {
            start_mm,
            from_mm_s: start.feed_mm_s,
            to_mm_s: target.feed_mm_s,
            room_mm: self.room_mm,
            wait_s_mm: 1.0 / start.feed_mm_s - 1.0 / target.feed_mm_s,
            between: self.reached.get(from + 1..=below)?,
            within,
            limits,
            hinders: 0,
        };
        let (leg, way) = jump.best(target.lag_s - before_s)?;
        let held_s = rested_s(start_mm, leg.start_mm);
        let time_s = start.time_s + waited_s + held_s + leg.ramp.duration_s();
        let length_mm = leg.start_mm + leg.ramp.length_mm();
        let lag_s = time_s - length_mm / target.feed_mm_s;
        if lag_s < target.lag_s {
            *target = Reached { length_mm, time_s, lag_s, from, leg: Some(leg), ..*target };
        }
        Some(way)
    }

    /// The time that the chain takes that was found last \[s\].
    pub fn time_s(&self) -> f64 {
        self.top.time_s
    }

    /// The last ramp of the chain that was found last.
    pub fn last_leg(&self) -> Option<&Leg> {
        self.top.leg.as_ref()
    }

    /// The ramps of the chain that was found last, in order.
    pub fn legs(&mut self) -> impl DoubleEndedIterator<Item = &Leg> {
        let (mut at, mut count) = (self.top.from, 0);
        while at > 0 {
            if let Some(place) = self.legs.get_mut(count) {
                *place = at as u8;
            }
            count += 1;
            at = self.reached.get(at).map_or(0, |here| here.from);
        }
        let legs = self.legs.get(..count).unwrap_or(&[]);
        let stairs = legs.iter().rev().filter_map(|&at| self.reached.get(usize::from(at))?.leg.as_ref());
        stairs.chain(self.top.leg.as_ref())
    }
}
