//! A feed list as the background sees it: its items, and the splice at which each begins.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::brake::Braking;
use super::splice::Splice;
use crate::law::{
    CutRamp, FeedSegment, Limits, Phase, PlannedRamp, Pulse, Ramp, SegmentError, Ticks, segment,
};
use crate::num::Real;
use crate::queue::FeedItem;
pub(super) use crate::queue::LIST_ITEMS;
use crate::units::Position;

/// Rounding between feeds that are calculated differently: of 1 mm/s, plus relative to the feed.
const FEED_ROUNDING_MM_S: f64 = 1.0e-12;

/// Tolerated rounding of a limit, relative.
const LIMIT_ROUNDING: f64 = 1.0e-12;

/// Bisection steps that find where a ramp is cut: to a millionth of a millionth.
const CUT_STEPS: usize = 40;

/// An item of a feed list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Item {
    /// A ramp or a cruise.
    Feed(PlannedRamp),
    /// A ramp cut in its rise, `at` after its start.
    Cut { ramp: Ramp<f64>, at: Ticks, length: Position },
    /// The end of the stretch.
    End,
    /// Rest for a time.
    Dwell(Ticks),
    /// Rest until told to resume.
    Stop,
}

impl Item {
    /// Whether it is part of a stretch's feed.
    pub(super) fn is_feed(&self) -> bool {
        matches!(self, Self::Feed(_) | Self::Cut { .. })
    }

    /// As the tick has it.
    ///
    /// # Errors
    /// The number type does not hold it.
    pub(crate) fn ready<R: Real>(&self, tick_s: f64) -> Result<FeedItem<R>, SegmentError> {
        Ok(match *self {
            Self::Feed(PlannedRamp { ramp, length }) => {
                FeedItem::Segment(FeedSegment::ramp(&ramp, length, tick_s)?)
            }
            Self::Cut { ramp, at, length } => FeedItem::Segment(FeedSegment::cut(&ramp, at, length, tick_s)?),
            Self::End => FeedItem::EndOfStretch,
            Self::Dwell(duration) => FeedItem::Dwell(duration),
            Self::Stop => FeedItem::ProgramStop,
        })
    }

    /// Whether it is a rest between stretches.
    pub(super) fn is_rest(&self) -> bool {
        matches!(self, Self::Dwell(_) | Self::Stop)
    }

    /// The splice at its end, if it begins at `start`.
    pub(super) fn end(&self, start: &Splice, tick_s: f64) -> Splice {
        match *self {
            Self::Feed(PlannedRamp { ramp, length }) => {
                Splice { at: start.at + length, feed_mm_s: ramp.to_mm_s, ..*start }
            }
            Self::Cut { ramp, at, length } => {
                let cut = CutRamp { ramp, cut_s: at.to_f64() * tick_s };
                Splice { at: start.at + length, feed_mm_s: cut.to_mm_s(), ..*start }
            }
            Self::End => {
                Splice { stretch: start.stretch.wrapping_add(1), at: Position::ZERO, feed_mm_s: 0.0 }
            }
            Self::Dwell(_) | Self::Stop => *start,
        }
    }

    /// How long it takes; `None` for an item that has no duration of its own.
    pub(super) fn duration(&self, tick_s: f64) -> Option<Ticks> {
        match *self {
            Self::Feed(PlannedRamp { ramp, .. }) => Ticks::from_seconds(ramp.duration_s(), tick_s),
            Self::Cut { ramp, at, .. } => {
                let cut = CutRamp { ramp, cut_s: at.to_f64() * tick_s };
                Ticks::from_seconds(cut.duration_s(), tick_s)
            }
            Self::Dwell(duration) => Some(duration),
            Self::End | Self::Stop => None,
        }
    }

    /// The same item cut `elapsed` after the start of `phase`: the shortest item with that beginning that
    /// ends at a constant feed. `None` if it can only be driven to its end.
    pub(super) fn cut(&self, phase: Phase, elapsed: Ticks, tick_s: f64) -> Option<Self> {
        let length = |mm: f64| Position::from_mm(mm);
        let elapsed_s = elapsed.to_f64() * tick_s;
        let ramp = match self {
            // The ramp as its segment has it.
            Self::Feed(PlannedRamp { ramp, .. }) => segment::to_f64(ramp),
            &Self::Cut { ramp, .. } if phase == Phase::Rise => {
                let cut = CutRamp { ramp, cut_s: elapsed_s };
                return Some(Self::Cut { ramp, at: elapsed, length: length(cut.length_mm())? });
            }
            _ => return None,
        };
        match phase {
            Phase::Hold if ramp.is_cruise() => {
                let ramp = Ramp::cruise(ramp.from_mm_s, elapsed_s);
                Some(Self::Feed(PlannedRamp { ramp, length: length(ramp.length_mm())? }))
            }
            // The rise is over before it could be cut.
            Phase::Rise if ramp.t1_s <= tick_s => None,
            // Back the way its jerk came.
            Phase::Rise if elapsed_s <= ramp.edge_s => {
                let cut = CutRamp { ramp, cut_s: elapsed_s };
                Some(Self::Cut { ramp, at: elapsed, length: length(cut.length_mm())? })
            }
            // A plateau is followed by the closing edge at once; in the closing edge, that is driven out.
            Phase::Rise | Phase::Hold => {
                let (t1_s, t2_s) = match phase {
                    Phase::Hold => (ramp.t1_s, ramp.t1_s + elapsed_s),
                    _ => {
                        let t1_s = (elapsed_s + ramp.edge_s).min(ramp.t1_s);
                        (t1_s, t1_s)
                    }
                };
                let share = (t1_s - ramp.edge_s) / (ramp.t1_s - ramp.edge_s) * (t2_s / ramp.t2_s);
                let change_mm_s = (ramp.to_mm_s - ramp.from_mm_s) * share;
                let ramp = Ramp { to_mm_s: changed(ramp.from_mm_s, change_mm_s), t1_s, t2_s, ..ramp };
                Some(Self::Feed(PlannedRamp { ramp, length: length(ramp.length_mm())? }))
            }
            Phase::Fall => None,
        }
    }

    /// The same accelerating item, cut so that it ends at `feed_mm_s`, which lies between the feeds of its
    /// ends: the later the cut, the higher the final feed.
    pub(super) fn cut_to(&self, feed_mm_s: f64, tick_s: f64) -> Option<Self> {
        // Times are rounded to their steps; one step less never exceeds that feed.
        let step = Ticks::from_bits(1);
        let before = |s: f64| Ticks::from_seconds(s, tick_s).map(|at| at.minus(step).unwrap_or(Ticks::ZERO));
        let (ramp, most_s) = match *self {
            Self::Feed(PlannedRamp { ramp, .. }) => {
                let ramp = segment::to_f64(&ramp);
                let share = (feed_mm_s - ramp.from_mm_s) / (ramp.to_mm_s - ramp.from_mm_s);
                let held_s = ramp.t2_s * share - ramp.t1_s;
                if held_s >= 0.0 {
                    return self.cut(Phase::Hold, before(held_s)?, tick_s);
                }
                let change_mm_s = libm::fabs(feed_mm_s - ramp.from_mm_s);
                let opening_s = ramp.rise_for_s(change_mm_s) - ramp.edge_s;
                if opening_s > ramp.edge_s {
                    return self.cut(Phase::Rise, before(opening_s)?, tick_s);
                }
                (ramp, ramp.edge_s)
            }
            Self::Cut { ramp, at, .. } => (ramp, at.to_f64() * tick_s),
            _ => return None,
        };
        let (mut low_s, mut high_s) = (0.0, most_s);
        for _ in 0..CUT_STEPS {
            let cut = CutRamp { ramp, cut_s: 0.5 * (low_s + high_s) };
            let end_s = if cut.to_mm_s() > feed_mm_s { &mut high_s } else { &mut low_s };
            *end_s = cut.cut_s;
        }
        self.cut(Phase::Rise, before(low_s)?, tick_s)
    }

    /// The same braking ramp driven on to rest within `limits`, from `elapsed` after the start of `phase`.
    /// Before its closing edge a pulse with a plateau gets longer, up to the limit of acceleration; later, and
    /// with sin² pulses, only the hold does. `None` in the fall, and where the ramp is beyond the limits.
    pub(super) fn driven_to_rest(
        &self,
        (phase, elapsed): (Phase, Ticks),
        pulse: Pulse,
        limits: &Limits<f64>,
        tick_s: f64,
    ) -> Option<Ramp<f64>> {
        let Self::Feed(PlannedRamp { ramp, .. }) = self else { return None };
        let ramp = segment::to_f64(ramp);
        let (change_mm_s, jerk) = (ramp.from_mm_s, ramp.peak_jerk_mm_s3);
        let goes_on = ramp.to_mm_s > 0.0 && ramp.to_mm_s < change_mm_s;
        if phase == Phase::Fall || !goes_on || ramp.t1_s <= tick_s {
            return None;
        }
        // One step less: the closing edge must not have begun.
        let before_closing = Ticks::from_seconds(ramp.t1_s - ramp.edge_s, tick_s)?.minus(Ticks::from_bits(1));
        let is_open = phase == Phase::Rise && before_closing.is_some_and(|closing| elapsed <= closing);
        let t1_s = if is_open && pulse == Pulse::Plateau {
            let longest_s = limits.accel_mm_s2 / jerk + ramp.edge_s;
            ramp.t1_s.max(ramp.rise_for_s(change_mm_s).min(longest_s))
        } else {
            ramp.t1_s
        };
        // Rounded up: the jerk that follows from the times must not be above that of the ramp.
        let t2_s = t1_s.max(change_mm_s / (jerk * (t1_s - ramp.edge_s))) * (1.0 + 4.0 * f64::EPSILON);
        let on = Ramp { to_mm_s: 0.0, t1_s, t2_s, ..ramp };
        let is_within = |value: f64, limit: f64| value <= limit * (1.0 + LIMIT_ROUNDING);
        let keeps_limits = is_within(on.peak_accel_mm_s2(), limits.accel_mm_s2)
            && is_within(on.peak_jerk_mm_s3, limits.jerk_mm_s3)
            && is_within(on.peak_snap_mm_s4(), limits.snap_mm_s4);
        keeps_limits.then_some(on)
    }

    /// The duration of a phase of its [`FeedSegment`], if the item can be cut there.
    pub(super) fn phase_duration(&self, phase: Phase, tick_s: f64) -> Option<Ticks> {
        let ramp = match self {
            Self::Feed(PlannedRamp { ramp, .. }) => ramp,
            Self::Cut { at, .. } if phase == Phase::Rise => return Some(*at),
            _ => return None,
        };
        let seconds = match phase {
            Phase::Rise | Phase::Fall => ramp.t1_s,
            Phase::Hold => ramp.t2_s - ramp.t1_s,
        };
        Ticks::from_seconds(seconds, tick_s)
    }
}

/// Changes a feed by no more than `change_mm_s`, rounding included: at high feeds with small changes,
/// rounding up would ask for an acceleration beyond the limit.
fn changed(from_mm_s: f64, change_mm_s: f64) -> f64 {
    let to_mm_s = from_mm_s + change_mm_s;
    match to_mm_s - from_mm_s {
        rounded if rounded > change_mm_s && change_mm_s > 0.0 => to_mm_s.next_down(),
        rounded if rounded < change_mm_s && change_mm_s < 0.0 => to_mm_s.next_up(),
        _ => to_mm_s,
    }
}

/// Items with the splice at which each begins.
#[derive(Clone, Debug)]
pub(super) struct List {
    start: Splice,
    /// Where its last item ends.
    end: Splice,
    tick_s: f64,
    items: Vec<(Splice, Item), LIST_ITEMS>,
    /// An item was appended for which there was no place.
    is_overfull: bool,
    exit: usize,
    ends_block: bool,
}

impl List {
    pub(super) fn new(start: Splice, tick_s: f64) -> Self {
        Self { start, end: start, tick_s, items: Vec::new(), is_overfull: false, exit: 0, ends_block: false }
    }

    /// Becomes equal to `other`. Copies its items alone, not all places.
    pub(super) fn assign(&mut self, other: &Self) {
        self.items.clear();
        let is_whole = self.items.extend_from_slice(&other.items).is_ok();
        debug_assert!(is_whole, "there is as much room");
        (self.start, self.end) = (other.start, other.end);
        (self.tick_s, self.is_overfull) = (other.tick_s, other.is_overfull);
        (self.exit, self.ends_block) = (other.exit, other.ends_block);
    }

    /// Empties the list and lets it begin at `start`.
    pub(super) fn restart(&mut self, start: Splice) {
        self.truncate(0);
        (self.start, self.end, self.exit, self.ends_block) = (start, start, 0, false);
    }

    /// The control tick that it is for \[s\].
    pub(super) fn tick_s(&self) -> f64 {
        self.tick_s
    }

    /// Where it begins.
    pub(super) fn start(&self) -> &Splice {
        &self.start
    }

    /// The successor takes over after this many items; the rest is a fallback stop.
    pub(super) fn exit(&self) -> usize {
        self.exit
    }

    /// The splice at which the successor takes over.
    pub(super) fn exit_splice(&self) -> Splice {
        self.after(self.exit)
    }

    /// The successor takes over at the list's end: there is no fallback stop, or it is driven.
    pub(super) fn set_exit_to_end(&mut self) {
        self.exit = self.len();
    }

    /// Whether it ends with a program block: in single block motion is held there.
    pub(super) fn ends_block(&self) -> bool {
        self.ends_block
    }

    pub(super) fn set_ends_block(&mut self, ends_block: bool) {
        self.ends_block = ends_block;
    }

    pub(super) fn is_full(&self) -> bool {
        self.items.is_full()
    }

    /// Whether an item had no place. Such a list is never handed over.
    pub(super) fn is_overfull(&self) -> bool {
        self.is_overfull
    }

    pub(super) fn len(&self) -> usize {
        self.items.len()
    }

    /// Appends an item; the caller has left a place for it. Removes the rounding between its feed and the
    /// list's; returns the item as appended.
    pub(super) fn push(&mut self, mut item: Item) -> Item {
        let end = self.end;
        if let Item::Feed(PlannedRamp { ramp, .. }) = &mut item
            && libm::fabs(ramp.from_mm_s - end.feed_mm_s) <= FEED_ROUNDING_MM_S * (1.0 + end.feed_mm_s)
        {
            if ramp.is_cruise() {
                ramp.to_mm_s = end.feed_mm_s;
            }
            ramp.from_mm_s = end.feed_mm_s;
        }
        if self.items.push((end, item)).is_ok() {
            self.end = item.end(&end, self.tick_s);
        } else {
            self.is_overfull = true;
        }
        debug_assert!(!self.is_overfull, "an item without a place");
        item
    }

    /// Appends what comes to rest, up to two items.
    pub(super) fn push_braking(&mut self, braking: &Braking) {
        if braking.kept > Position::ZERO {
            self.push_cruise(braking.ramp.ramp.from_mm_s, braking.kept);
        }
        self.push(Item::Feed(braking.ramp));
    }

    /// Appends a cruise at `feed_mm_s` > 0 over `length`.
    pub(super) fn push_cruise(&mut self, feed_mm_s: f64, length: Position) {
        let ramp = Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s);
        self.push(Item::Feed(PlannedRamp { ramp, length }));
    }

    pub(super) fn contains(&self, item: &Item) -> bool {
        self.items().any(|other| other == item)
    }

    pub(super) fn truncate(&mut self, len: usize) {
        self.end = self.after(len);
        self.items.truncate(len);
        self.is_overfull = false;
    }

    pub(super) fn items(&self) -> impl Iterator<Item = &Item> {
        self.placed().map(|(_, item)| item)
    }

    /// The items, each with the splice where it starts.
    pub(super) fn placed(&self) -> impl Iterator<Item = &(Splice, Item)> {
        self.items.iter()
    }

    pub(super) fn get(&self, index: usize) -> Option<&(Splice, Item)> {
        self.items.get(index)
    }

    /// Where its last item ends.
    pub(super) fn end(&self) -> Splice {
        let of_the_last =
            || self.items.last().map_or(self.start, |(start, item)| item.end(start, self.tick_s));
        // By its bits: an item that will be refused when it is handed over may have a feed that is NaN.
        let bits = |end: Splice| (end.stretch, end.at, end.feed_mm_s.to_bits());
        debug_assert_eq!(bits(self.end), bits(of_the_last()));
        self.end
    }

    /// The splice after this many items.
    pub(super) fn after(&self, count: usize) -> Splice {
        match self.items.get(count) {
            Some((start, _)) => *start,
            None => self.end(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Law, LimitedBy};
    use crate::random::Random;

    /// In every field, whatever it was before.
    #[test]
    fn what_is_assigned_is_the_same_list() {
        let at =
            |mm, feed_mm_s| Splice { stretch: 1, at: Position::from_mm(mm).expect("in range"), feed_mm_s };
        let mut other = List::new(at(2.0, 10.0), 5e-4);
        other.push_cruise(10.0, Position::from_mm(3.0).expect("in range"));
        other.set_exit_to_end();
        other.push(Item::Stop);
        other.set_ends_block(true);
        let mut list = List::new(at(1.0, 5.0), 1e-3);
        for items in 0..3 {
            list.assign(&other);
            assert_eq!(std::format!("{list:?}"), std::format!("{other:?}"), "over {items} items");
            list.restart(at(9.0, 1.0));
            (0..=items).for_each(|_| list.push_cruise(1.0, Position::from_mm(0.5).expect("in range")));
        }
    }

    /// Wherever a ramp is to end, it can be cut so that it does, whole or cut already, and never beyond.
    #[test]
    fn a_ramp_is_given_up_where_it_gets_to_a_feed() {
        let random = Random::new(2);
        let tick_s = 5e-4;
        let mut cuts = 0;
        for number in 0..10_000 {
            let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
            let (from_mm_s, change_mm_s) = (200.0 * random.unit(), random.log(0.1, 200.0));
            let pulse = [Pulse::Sin2, Pulse::Plateau][number % 2];
            let ramp = Ramp::new(&Law::within(pulse, limits), from_mm_s, from_mm_s + change_mm_s);
            let length = Position::from_mm(ramp.length_mm()).expect("in range");
            let start = Splice { stretch: 0, at: Position::ZERO, feed_mm_s: from_mm_s };
            let mut item = Item::Feed(PlannedRamp { ramp, length });
            // Once, and then once more.
            for _ in 0..2 {
                let whole_mm_s = item.end(&start, tick_s).feed_mm_s;
                let feed_mm_s = from_mm_s + (whole_mm_s - from_mm_s) * (0.05 + 0.9 * random.unit());
                let cut = item.cut_to(feed_mm_s, tick_s).expect("a ramp that lasts");
                let found_mm_s = cut.end(&start, tick_s).feed_mm_s;
                let is_close = found_mm_s <= feed_mm_s && found_mm_s >= feed_mm_s - 1e-5;
                assert!(is_close, "{number}: {found_mm_s}, expected {feed_mm_s}, {ramp:?}");
                cuts += usize::from(matches!(cut, Item::Cut { .. }));
                item = cut;
            }
        }
        assert!(cuts > 5_000, "{cuts}");
    }

    /// In its rise or hold a braking ramp may go on to rest: it is the same up to there, brakes no harder than
    /// allowed, and is sooner at rest than the whole ramp and another one after it.
    #[test]
    fn a_ramp_that_brakes_goes_on_to_rest() {
        let random = Random::new(3);
        let tick_s = 5e-4;
        let mut grown = 0;
        for number in 0..20_000 {
            let pulse = [Pulse::Sin2, Pulse::Plateau][number % 2];
            let limits = Limits {
                accel_mm_s2: random.log(50.0, 5e3),
                jerk_mm_s3: 5e3,
                snap_mm_s4: random.log(1e5, 1e7),
            };
            let law = Law::within(pulse, limits);
            let from_mm_s = random.log(5.0, 500.0);
            let ramp = Ramp::new(&law, from_mm_s, from_mm_s * (0.02 + 0.9 * random.unit()));
            let length = Position::from_mm(ramp.length_mm()).expect("in range");
            let item = Item::Feed(PlannedRamp { ramp, length });
            let phases = [(Phase::Rise, ramp.t1_s), (Phase::Hold, ramp.t2_s - ramp.t1_s)];
            for (phase, lasts_s) in phases {
                let elapsed_s = lasts_s * random.unit();
                let since = (phase, Ticks::from_seconds(elapsed_s, tick_s).expect("in range"));
                let Some(on) = item.driven_to_rest(since, pulse, &limits, tick_s) else {
                    panic!("{number}: {phase:?} {elapsed_s} of {ramp:?}");
                };
                let until_s = if phase == Phase::Hold { ramp.t1_s + elapsed_s } else { elapsed_s };
                for part in [0.25, 0.5, 1.0] {
                    let (was, is) = (ramp.at(part * until_s), on.at(part * until_s));
                    let size = 1e-9 * from_mm_s;
                    let is_same = libm::fabs(was.v_mm_s - is.v_mm_s) <= size
                        && libm::fabs(was.a_mm_s2 - is.a_mm_s2) <= 1e-9 * limits.accel_mm_s2
                        && libm::fabs(was.j_mm_s3 - is.j_mm_s3) <= 1e-7 * limits.jerk_mm_s3;
                    assert!(is_same, "{number}: {was:?} {is:?}, {phase:?} {elapsed_s} of {ramp:?}, {on:?}");
                }
                let end = on.at(on.duration_s());
                assert!(on.to_mm_s <= 0.0 && libm::fabs(end.v_mm_s) <= 1e-9 * from_mm_s, "{end:?}");
                let changed = on.peak_accel_mm_s2() * on.t2_s;
                assert!(libm::fabs(changed - from_mm_s) <= 1e-9 * from_mm_s, "{changed} of {from_mm_s}");
                assert!(on.peak_accel_mm_s2() <= limits.accel_mm_s2 * (1.0 + 1e-9), "{on:?}");
                grown += usize::from(on.peak_accel_mm_s2() > 1.01 * ramp.peak_accel_mm_s2());
                // Ramps of the law that limits fix alike may go on as the law would have it.
                if ramp.limited_by == LimitedBy::Acceleration {
                    let waits_s = ramp.duration_s() + Ramp::new(&law, ramp.to_mm_s, 0.0).duration_s();
                    assert!(on.duration_s() < waits_s, "{number}: {on:?}, {waits_s} s");
                }
            }
            let falling = (Phase::Fall, Ticks::ONE);
            assert_eq!(item.driven_to_rest(falling, pulse, &limits, tick_s), None);
            let softer = Limits { accel_mm_s2: 0.99 * ramp.peak_accel_mm_s2(), ..limits };
            assert_eq!(item.driven_to_rest((Phase::Rise, Ticks::ONE), pulse, &softer, tick_s), None);
        }
        assert!(grown > 1000, "{grown}");
    }

    /// However great the feeds are compared with their change.
    #[test]
    fn a_ramp_that_is_given_up_asks_for_no_more_than_the_whole() {
        let random = Random::new(1);
        let tick_s = 5e-4;
        let mut cuts = 0;
        for seed in 0..10_000 {
            let limits =
                Limits { accel_mm_s2: 50.0 + 500.0 * random.unit(), jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
            let from_mm_s = 1000.0 * random.unit();
            let to_mm_s = libm::fabs(from_mm_s + 100.0 * (random.unit() - 0.5));
            let pulse = [Pulse::Sin2, Pulse::Plateau][seed % 2];
            let ramp = Ramp::new(&Law::within(pulse, limits), from_mm_s, to_mm_s);
            let item = Item::Feed(PlannedRamp {
                ramp,
                length: Position::from_mm(ramp.length_mm()).expect("in range"),
            });
            let held_s = ramp.t2_s - ramp.t1_s;
            let elapsed = Ticks::from_seconds(held_s * random.unit(), tick_s).expect("in range");
            let plateau_s = ramp.edge_s + ramp.plateau_s() * random.unit();
            for (phase, elapsed) in [
                (Phase::Rise, Ticks::from_seconds(plateau_s, tick_s)),
                (Phase::Rise, Ticks::from_seconds(ramp.t1_s, tick_s)),
                (Phase::Hold, Some(elapsed)),
            ] {
                let Some(Item::Feed(PlannedRamp { ramp: cut, .. })) =
                    item.cut(phase, elapsed.expect("in range"), tick_s)
                else {
                    continue;
                };
                cuts += 1;
                let accel_mm_s2 = segment::to_f64(&cut).peak_accel_mm_s2();
                let most_mm_s2 = limits.accel_mm_s2 * (1.0 + 8.0 * f64::EPSILON);
                assert!(
                    accel_mm_s2 <= most_mm_s2,
                    "seed {seed}: {accel_mm_s2} of {most_mm_s2}, {ramp:?} {cut:?}"
                );
            }
        }
        assert!(cuts > 10_000, "{cuts}");
    }
}
