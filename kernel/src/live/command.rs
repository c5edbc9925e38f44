//! Commands: what takes over from the motion under way, and where.

use heapless::Vec;

use super::control::LiveControl;
use super::list::{Item, LIST_ITEMS, List};
use super::replan::Ramps;
use super::road::Splice;
use super::source::Source;
use crate::law::{Phase, Ticks};
use crate::num::Real;
use crate::program::SupplyError;
use crate::queue::{Change, LiveFeeder, Progress};
use crate::units::Position;

/// Where a command may take over, in the order of time.
pub(super) type Places = Vec<Place, { LIST_ITEMS + 2 }>;

/// Where a command may take over.
pub(super) struct Place {
    pub(super) change: Change,
    /// Where the list begins that takes over.
    pub(super) start: Splice,
    /// The item under way with another end, if it is inside one.
    head: Option<Item>,
}

impl Place {
    /// Where it takes over.
    pub(super) fn splice(&self, tick_s: f64) -> Splice {
        self.list(tick_s).end()
    }

    /// A list for it that holds nothing but the item under way.
    pub(super) fn list(&self, tick_s: f64) -> List {
        let mut list = List::new(self.start, tick_s);
        if let Some(head) = self.head {
            list.push(head);
        }
        list
    }

    /// The items of the list under way that are driven.
    fn driven(&self) -> usize {
        self.change.after as usize
    }
}

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, I, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// In the order of time: here or within the item under way, and behind each item that is to be driven.
    pub(super) fn places(&self, progress: &Progress) -> Places {
        let mut places = Vec::new();
        let list = &self.current.list;
        let done = progress.done as usize;
        let behind =
            |count: usize| Place { change: self.change_after(count), start: list.after(count), head: None };
        let first = match progress.inside {
            Some((phase, left)) => self.within(done, phase, left),
            None => Some(behind(done)),
        };
        if let Some(first) = first {
            let _ = places.push(first);
        }
        for count in done + 1..=list.leave {
            let _ = places.push(behind(count));
        }
        places
    }

    /// Within the item under way, given up as soon as possible.
    fn within(&self, done: usize, phase: Phase, left: Ticks) -> Option<Place> {
        let (start, item) = self.current.list.get(done)?;
        let duration = item.phase_duration(phase, self.tick_s)?;
        // Not where it begins: there is no beginning to repeat yet.
        let lead = if left >= duration { self.lead.max(Ticks::ONE) } else { self.lead };
        let elapsed = duration.minus(left)?.plus(lead);
        if elapsed > duration {
            return None;
        }
        let head = item.cut(phase, elapsed, self.tick_s)?;
        Some(Place {
            change: Change { within: true, ..self.change_after(done) },
            start: *start,
            head: Some(head),
        })
    }

    /// The places for another override: a ramp that would go beyond it is given up where it gets to the feed that is allowed,
    /// or else at once. So an override that keeps falling by little does not hold up an acceleration.
    fn places_for_override(&self, progress: &Progress) -> Places {
        let mut places = self.places(progress);
        if let Some(first) = places.first().filter(|first| first.change.within)
            && let Some((start, item)) = self.current.list.get(progress.done as usize)
        {
            let cut_mm_s = first.splice(self.tick_s).feed_mm_s;
            let cap_mm_s = self.least_cap_mm_s(start, item);
            if cut_mm_s < cap_mm_s
                && cap_mm_s < item.end(start, self.tick_s).feed_mm_s
                && let Some(head) = item.cut_to(cap_mm_s, self.tick_s)
            {
                let later = Place { head: Some(head), ..*first };
                let _ = places.insert(0, later);
            }
        }
        places
    }

    /// The least feed \[mm/s\] that is allowed anywhere on an item's path.
    fn least_cap_mm_s(&self, start: &Splice, item: &Item) -> f64 {
        let end = item.end(start, self.tick_s).at;
        let crossed = self.road.from(start).take_while(|block| block.start < end);
        let caps_mm_s = crossed.map(|block| block.allowed(self.feed_override).0);
        caps_mm_s.reduce(f64::min).unwrap_or(0.0)
    }

    /// Brakes to rest from the first place that allows it; if there is none, the list under way ends at rest.
    pub(super) fn stop(
        &mut self,
        progress: &Progress,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        for place in &self.places(progress) {
            let mut list = place.list(self.tick_s);
            let splice = list.end();
            if splice.feed_mm_s < place.start.feed_mm_s {
                // What brakes goes on braking.
                continue;
            }
            if splice.feed_mm_s <= 0.0 {
                // What follows in this list must not.
                if self.rests_before_more(place, progress) {
                    return self.rest_behind(place.driven(), false, feeder);
                }
                break;
            }
            let (path_end, _) = self.path_of(splice.stretch);
            let Some((ramp, length)) = self.road.brake(&splice, 0.0, path_end, self.driven_override) else {
                continue;
            };
            list.push(Item::Feed { ramp, length });
            if !self.keeps_up(&list, &place.change) {
                continue;
            }
            return self.rest_at_end_of(list, place, feeder);
        }
        let list = &mut self.current.list;
        if list.leave < list.len() {
            list.leave = list.len();
            let end = list.end();
            self.replan_from(end);
        }
        Ok(())
    }

    /// Hands over a list that ends at rest; what comes behind it is planned anew.
    pub(super) fn rest_at_end_of(
        &mut self,
        mut list: List,
        place: &Place,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        list.leave = list.len();
        let end = list.end();
        self.hand_over(list, place.change, self.driven_override, feeder)?;
        self.replan_through(end.stretch);
        self.take_back_from(place.driven());
        self.replan_from(end);
        Ok(())
    }

    /// Goes on under another override, or to the end of a block, from the first place that allows it; if there is none, from
    /// where the list under way is left.
    pub(super) fn respeed(
        &mut self,
        progress: &Progress,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        self.block_end = None;
        let is_found = self.is_single
            && self.respeed_to_block_end(&self.places(progress), progress, feeder)?
            || self.respeed_from(&self.places_for_override(progress), progress, false, feeder)?;
        if !is_found && self.ahead.at > Position::ZERO {
            self.replan_from(self.ahead);
        }
        Ok(())
    }

    /// Goes on under the override from the first of `places` that allows it; false if there is none. A ramp that
    /// accelerates is given up only where it is too fast for the override, or always.
    pub(super) fn respeed_from(
        &mut self,
        places: &Places,
        progress: &Progress,
        gives_up: bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<bool, SupplyError<E>> {
        for place in places {
            let list = place.list(self.tick_s);
            let heads = list.len();
            if heads == 0 && place.start.feed_mm_s <= 0.0 {
                // It goes on from here as from any stop.
                if self.rests_before_more(place, progress) {
                    return self.rest_behind(place.driven(), false, feeder).map(|()| true);
                }
                break;
            }
            let cut = list.end();
            let accelerates = cut.feed_mm_s >= place.start.feed_mm_s;
            if heads > 0 && !(gives_up && accelerates || self.is_worth_cutting(progress, place, &cut)) {
                continue;
            }
            // Whatever comes of it: what is ahead of this stretch is planned anew from here on.
            self.replan_through(place.start.stretch);
            for ramps in Ramps::IN_ORDER {
                let mut list = place.list(self.tick_s);
                if !self.gather_under_override(&mut list, false, ramps) {
                    break;
                }
                if self.end_in_a_stop(&mut list, self.feed_override)
                    && list.leave >= heads
                    && self.keeps_up(&list, &place.change)
                {
                    let ahead = list.after(list.leave);
                    self.hand_over(list, place.change, self.feed_override, feeder)?;
                    self.take_back_from(place.driven());
                    self.replan_from(ahead);
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether the machine is at rest at a place, perhaps in a dwell, and more of the list under way would follow.
    fn rests_before_more(&self, place: &Place, progress: &Progress) -> bool {
        let is_here = progress.inside.is_none() && place.driven() == progress.done as usize;
        is_here && place.driven() < self.current.list.len()
    }

    /// Whether the item under way does not change the feed, or takes it to where the override does not allow it.
    fn is_worth_cutting(&self, progress: &Progress, place: &Place, cut: &Splice) -> bool {
        let Some((start, item)) = self.current.list.get(progress.done as usize) else { return false };
        let whole_mm_s = item.end(start, self.tick_s).feed_mm_s;
        let cap_mm_s = self.least_cap_mm_s(start, item);
        cut.feed_mm_s == place.start.feed_mm_s || whole_mm_s > start.feed_mm_s && whole_mm_s > cap_mm_s
    }
}
