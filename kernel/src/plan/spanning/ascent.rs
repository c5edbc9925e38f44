//! The ascent from one feed to another, below rising steps of the ceiling.
//!
//! Consumes the steps of one side of an interval, lowest first, and the feed to be reached; produces a chain
//! of ramps, each resting (a = 0) on a step or passing some with acceleration. A ramp that would pass a
//! step's feed before the step ends starts later or accelerates less, whichever loses less time. The other
//! side of an interval is the same, seen from its end.

use super::ramp_fit::{Fit, RampFit};
use crate::law::{Limits, Pulse, Ramp};
use crate::plan::Attention;

/// Number of steps considered one by one; if there are more, those that lose least by it are joined.
const STEPS_MAX: usize = 48;
/// Greatest number of ramps in a chain.
const RAMPS_MAX: usize = STEPS_MAX + 1;

/// A ceiling that holds up to a position, counted from the start of the ascent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Step {
    /// Where it ends \[mm\].
    pub(super) end_mm: f64,
    /// Its feed \[mm/s\].
    pub(super) feed_mm_s: f64,
}

/// Rising steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    steps: [Step; STEPS_MAX],
    count: usize,
    /// Greatest time lost by joining steps \[s\].
    pub(super) lost_s: f64,
}

impl Steps {
    /// No steps.
    pub(super) const NONE: Self =
        Self { steps: [Step { end_mm: 0.0, feed_mm_s: 0.0 }; STEPS_MAX], count: 0, lost_s: 0.0 };

    /// Adds the next higher step.
    pub(super) fn push(&mut self, step: Step) {
        if self.count == STEPS_MAX {
            self.join();
        }
        if let Some(place) = self.steps.get_mut(self.count) {
            *place = step;
            self.count += 1;
        }
    }

    /// Joins the two neighbours that lose the least time by it: the lower feed up to the later end.
    fn join(&mut self) {
        let mut least = (f64::INFINITY, 0);
        for (index, pair) in self.steps.windows(2).enumerate() {
            let [low, high] = pair else { break };
            let lost = (high.end_mm - low.end_mm) * (1.0 / low.feed_mm_s - 1.0 / high.feed_mm_s);
            if lost < least.0 {
                least = (lost, index);
            }
        }
        let at = least.1;
        self.lost_s += least.0;
        let end_mm = self.steps.get(at + 1).map_or(0.0, |high| high.end_mm);
        if let Some(low) = self.steps.get_mut(at) {
            low.end_mm = end_mm;
        }
        self.steps.copy_within((at + 2).min(STEPS_MAX).., (at + 1).min(STEPS_MAX - 1));
        self.count -= 1;
    }

    /// The lowest and the highest feed \[mm/s\].
    pub(super) fn range_mm_s(&self) -> (f64, f64) {
        let feed = |step: Option<&Step>| step.map_or(0.0, |step| step.feed_mm_s);
        (feed(self.as_slice().first()), feed(self.as_slice().last()))
    }

    fn as_slice(&self) -> &[Step] {
        self.steps.get(..self.count).unwrap_or(&[])
    }
}

/// A ramp of a chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct AscentRamp {
    /// Where it starts, from the start of the ascent \[mm\].
    pub(super) start_mm: f64,
    /// The ramp.
    pub(super) ramp: Ramp<f64>,
}

/// The best chain known to one feed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reached {
    pub(super) feed_mm_s: f64,
    /// No ramp may leave it before this place \[mm\].
    pub(super) ready_mm: f64,
    /// Where and when it is reached.
    length_mm: f64,
    time_s: f64,
    /// That time minus the time that the length takes at this feed; less is better.
    lag_s: f64,
    /// The limits of a ramp from its start, if they were asked for.
    within: Option<Limits<f64>>,
    /// The feed before, and the ramp from there.
    from: usize,
    ramp: Option<AscentRamp>,
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
        ramp: None,
    };
}

/// The best chains of ramps up one side. Working memory, reused.
///
/// A chain to a step is the same whatever feed is to be reached in the end, so it is searched once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ascent<'a> {
    attention: Option<&'a Attention<'a>>,
    /// The start, then every step above it.
    reached: [Reached; STEPS_MAX + 1],
    steps: usize,
    /// Number of steps whose chain is known, from the lowest.
    known: usize,
    /// The chain asked for last.
    peak: Reached,
    room_mm: f64,
    pulse: Pulse,
    /// The ramps of that chain, as indices.
    chain: [u8; RAMPS_MAX],
}

impl<'a> Ascent<'a> {
    /// No chains yet. A constant, so that it is made in its place: it is several kilobytes, and a copy would be as much of
    /// the stack.
    pub(super) const NONE: Self = Self {
        attention: None,
        reached: [Reached::NOT; STEPS_MAX + 1],
        steps: 0,
        known: 0,
        peak: Reached::NOT,
        room_mm: 0.0,
        pulse: Pulse::Sin2,
        chain: [0; RAMPS_MAX],
    };

    /// While something more urgent waits, no chains are found.
    pub(super) fn attend(&mut self, attention: &'a Attention<'a>) {
        self.attention = Some(attention);
    }

    /// Begins before `steps` at `from_mm_s`, with `room_mm` for the ascent and ramps of `pulse`s. Steps not
    /// above the start only delay it.
    pub(super) fn start(&mut self, steps: &Steps, from_mm_s: f64, room_mm: f64, pulse: Pulse) {
        let mut start = Reached { feed_mm_s: from_mm_s, lag_s: 0.0, ..Reached::NOT };
        let mut count = 0;
        for step in steps.as_slice() {
            if step.feed_mm_s <= from_mm_s {
                start.ready_mm = start.ready_mm.max(step.end_mm);
            } else if let Some(next) = self.reached.get_mut(count + 1) {
                *next = Reached { feed_mm_s: step.feed_mm_s, ready_mm: step.end_mm, ..Reached::NOT };
                count += 1;
            }
        }
        if let Some(first) = self.reached.first_mut() {
            *first = start;
        }
        (self.steps, self.known, self.peak) = (count, 0, start);
        (self.room_mm, self.pulse) = (room_mm, pulse);
    }

    /// Finds the chain to `to_mm_s` that keeps below the steps, within the room; returns its length \[mm\].
    /// `limits` gives the limits between two positions, always the same for one start. `None` if there is no
    /// chain.
    pub(super) fn find(&mut self, to_mm_s: f64, limits: impl Fn(f64, f64) -> Limits<f64>) -> Option<f64> {
        let start = *self.reached.first()?;
        if !(to_mm_s > start.feed_mm_s) {
            self.peak = start;
            return Some(0.0);
        }
        let steps = self.reached.get(1..=self.steps)?;
        let below = steps.partition_point(|step| step.feed_mm_s < to_mm_s);
        let mut peak = Reached { feed_mm_s: to_mm_s, ..Reached::NOT };
        // First a single ramp: if nothing is in its way, there is nothing better.
        if self.extend(&mut peak, 0, below, &limits) != Some(Fit::Free) {
            while self.known < below {
                let mut next = *self.reached.get(self.known + 1)?;
                self.best(&mut next, self.known, &limits);
                self.known += 1;
                *self.reached.get_mut(self.known)? = next;
            }
            self.best(&mut peak, below, &limits);
        }
        self.peak = peak;
        (peak.lag_s < f64::INFINITY).then_some(peak.length_mm)
    }

    /// Finds the best chain to `target`, which is above the first `below` steps.
    fn best(&mut self, target: &mut Reached, below: usize, limits: &impl Fn(f64, f64) -> Limits<f64>) {
        // The steps just below come first: a good chain shows early that others are worse.
        let (mut back, mut more) = (0, 1);
        while back <= below {
            self.extend(target, below - back, below, limits);
            more += usize::from(back >= 3) * (more / 2).max(1);
            back += more;
        }
    }

    /// Takes the chain to step `from` plus a ramp from there to `target`, if it is better than the best
    /// known.
    fn extend(
        &mut self,
        target: &mut Reached,
        from: usize,
        below: usize,
        limits: &impl Fn(f64, f64) -> Limits<f64>,
    ) -> Option<Fit> {
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
        // The time lost before the ramp, as seen from the target.
        let before_s = start.time_s + waited_s - start_mm / target.feed_mm_s;
        let mut wanted = RampFit {
            attention: self.attention,
            start_mm,
            from_mm_s: start.feed_mm_s,
            to_mm_s: target.feed_mm_s,
            room_mm: self.room_mm,
            wait_s_mm: 1.0 / start.feed_mm_s - 1.0 / target.feed_mm_s,
            between: self.reached.get(from + 1..=below)?,
            pulse: self.pulse,
            within,
            limits,
            hinders: 0,
        };
        let (ascent_ramp, fit) = wanted.best(target.lag_s - before_s)?;
        let AscentRamp { start_mm: ramp_mm, ramp } = ascent_ramp;
        let held_s = rested_s(start_mm, ramp_mm);
        let time_s = start.time_s + waited_s + held_s + ramp.duration_s();
        let length_mm = ramp_mm + ramp.length_mm();
        let lag_s = time_s - length_mm / target.feed_mm_s;
        if lag_s < target.lag_s {
            *target = Reached { length_mm, time_s, lag_s, from, ramp: Some(ascent_ramp), ..*target };
        }
        Some(fit)
    }

    /// The time of the chain found last \[s\].
    pub(super) fn time_s(&self) -> f64 {
        self.peak.time_s
    }

    /// The last ramp of the chain found last.
    pub(super) fn last_ramp(&self) -> Option<&AscentRamp> {
        self.peak.ramp.as_ref()
    }

    /// The ramps of the chain found last, in order.
    pub(super) fn ramps(&mut self) -> impl DoubleEndedIterator<Item = &AscentRamp> {
        let (mut at, mut count) = (self.peak.from, 0);
        while at > 0 {
            if let Some(place) = self.chain.get_mut(count) {
                *place = at as u8;
            }
            count += 1;
            at = self.reached.get(at).map_or(0, |here| here.from);
        }
        let chain = self.chain.get(..count).unwrap_or(&[]);
        let ramps = chain.iter().rev().filter_map(|&at| self.reached.get(usize::from(at))?.ramp.as_ref());
        ramps.chain(self.peak.ramp.as_ref())
    }
}
