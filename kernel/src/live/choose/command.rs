//! Commands: the list that takes over from the motion under way, and where.

use super::{Choice, Chooser};
use crate::law::PlannedRamp;
use crate::live::brake::Braking;
use crate::live::list::{Item, List};
use crate::live::mode::Request;
use crate::live::places::{Place, Places, Takeover};
use crate::live::replan::Ramps;
use crate::live::splice::Splice;
use crate::queue::Progress;
use crate::units::Position;

/// Which accelerating ramps are cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// Those that would exceed the override's feed.
    TooFast,
    /// All of them.
    All,
}

/// How motion comes to rest if the list under way is left at a place.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stopping {
    /// The item under way, a ramp that brakes, is driven on.
    DrivenOn(PlannedRamp),
    /// After the item under way, perhaps cut.
    After(Braking),
}

impl Stopping {
    /// Restarts `list` with the stop from `place`.
    fn begin(&self, place: &Place, list: &mut List) {
        match self {
            Self::DrivenOn(ramp) => {
                list.restart(*place.start());
                list.push(Item::Feed(*ramp));
            }
            Self::After(braking) => {
                place.begin(list);
                list.push_braking(braking);
            }
        }
    }

    /// Where it ends.
    pub(super) fn rest(&self, place: &Place, tick_s: f64) -> Position {
        match self {
            Self::DrivenOn(ramp) => place.start().at + ramp.length,
            Self::After(braking) => place.splice(tick_s).at + braking.length(),
        }
    }
}

impl<const PLACES: usize> Chooser<'_, PLACES> {
    /// Makes a list that obeys `request`, with motion at `progress`.
    pub(in crate::live) fn obey(&mut self, request: Request, progress: &Progress, list: &mut List) -> Choice {
        let places = self.timeline.places(request, progress);
        match request {
            Request::Stop => self.stop(places, progress, list),
            Request::Override => self.change_override(places, progress, list),
        }
    }

    /// Comes to rest from the first place that allows it; if there is none, the list under way ends at rest.
    pub(super) fn stop(&self, places: Places<'_>, progress: &Progress, list: &mut List) -> Choice {
        for place in places {
            if place.since().is_none() && place.start().is_at_rest() {
                // The rest of this list must not be driven.
                if let Some(rest) = self.rest_before_more(&place, progress) {
                    return rest;
                }
                break;
            }
            let Some(stop) = self.stop_from(&place) else { continue };
            stop.begin(&place, list);
            if self.timeline.keeps_up(list, place.takeover()) {
                return self.rest_at_end_of(list, &place);
            }
        }
        Choice::DriveToEnd
    }

    /// How motion comes to rest if the list under way is left at `place`.
    pub(super) fn stop_from(&self, place: &Place) -> Option<Stopping> {
        let (start, splice) = (*place.start(), place.splice(self.tick_s));
        let driven_override = self.timeline.driven_override();
        let path_end = self.extent_of(splice.stretch).end();
        let nearest_rest = |from: &Splice| self.lookahead.nearest_rest(from, path_end, driven_override);
        if splice.feed_mm_s >= start.feed_mm_s {
            return nearest_rest(&splice).map(Stopping::After);
        }
        // A ramp that brakes can't be ended early, but may be driven on, unless it is so gentle that another one
        // after it is sooner at rest.
        let (_, item) = self.timeline.list().get(place.takeover().driven())?;
        let (since, tick_s) = (place.since()?, self.tick_s);
        let on = self.lookahead.brake_on(&start, item, since, path_end, driven_override, tick_s)?;
        let Item::Feed(PlannedRamp { ramp, .. }) = item else { return None };
        let is_sooner = |braking: Braking| on.ramp.duration_s() <= ramp.duration_s() + braking.time_s();
        nearest_rest(&item.end(&start, tick_s)).is_none_or(is_sooner).then_some(Stopping::DrivenOn(on))
    }

    /// Lets a list that ends at rest take over.
    pub(super) fn rest_at_end_of(&self, list: &mut List, place: &Place) -> Choice {
        list.set_exit_to_end();
        Choice::TakeOver { takeover: place.takeover(), feed_override: self.timeline.driven_override() }
    }

    /// Continues under another override, or to the end of a block, from the first place that allows it; if
    /// there is none, from the exit of the list under way.
    fn change_override(&mut self, places: Places<'_>, progress: &Progress, list: &mut List) -> Choice {
        self.block_end = None;
        if self.mode.is_single_block() {
            let choice = self.change_to_block_end(&places, progress, list);
            if choice != Choice::Nothing {
                return choice;
            }
        }
        let choice = self.change_from(self.places_for_override(places), progress, Cut::TooFast, list);
        match choice {
            Choice::Nothing if self.timeline.splice().at > Position::ZERO => Choice::Replan,
            choice => choice,
        }
    }

    /// Continues under the override from the first of `places` that allows it.
    pub(super) fn change_from(
        &mut self,
        places: Places<'_>,
        progress: &Progress,
        cut: Cut,
        list: &mut List,
    ) -> Choice {
        let inside = places.inside().map(|(start, item, _)| (*start, *item));
        for place in places {
            if self.attention.is_wanted() {
                break;
            }
            let (start, splice) = (*place.start(), place.splice(self.tick_s));
            if let Takeover::After(_) = place.takeover() {
                if start.is_at_rest() {
                    // The next list continues from here as from any stop.
                    return self.rest_before_more(&place, progress).unwrap_or(Choice::Nothing);
                }
            } else {
                let is_cut = cut == Cut::All && splice.feed_mm_s >= start.feed_mm_s
                    || inside.is_some_and(|(start, item)| self.is_worth_cutting(&start, &item, &splice));
                if !is_cut {
                    continue;
                }
            }
            // Even if no list comes of it, the rest of this stretch is planned anew.
            self.feed.replan_through(start.stretch);
            for ramps in Ramps::IN_ORDER {
                place.begin(list);
                let heads = list.len();
                if !self.gather_under_override(list, false, ramps) {
                    break;
                }
                let feed_override = self.mode.feed_override();
                if self.end_in_a_stop(list, feed_override)
                    && list.exit() >= heads
                    && self.timeline.keeps_up(list, place.takeover())
                {
                    return Choice::TakeOver { takeover: place.takeover(), feed_override };
                }
            }
        }
        Choice::Nothing
    }

    /// The places for another override. A ramp that would exceed it is cut where it reaches the allowed feed,
    /// or else at once. So an override that keeps falling slightly does not hold up an acceleration.
    fn places_for_override<'a>(&self, places: Places<'a>) -> Places<'a> {
        let Some((start, item, place)) = places.inside() else { return places };
        let cut_mm_s = place.splice(self.tick_s).feed_mm_s;
        let cap_mm_s = self.least_cap_mm_s(start, item);
        let whole_mm_s = item.end(start, self.tick_s).feed_mm_s;
        let is_between = cut_mm_s < cap_mm_s && cap_mm_s < whole_mm_s;
        match is_between.then(|| item.cut_to(cap_mm_s, self.tick_s)).flatten() {
            Some(head) => places.with_head(head),
            None => places,
        }
    }

    /// The least feed \[mm/s\] that is allowed anywhere on an item's path.
    fn least_cap_mm_s(&self, start: &Splice, item: &Item) -> f64 {
        let end = item.end(start, self.tick_s).at;
        let crossed = self.lookahead.from(start).take_while(|block| block.start() < end);
        let caps_mm_s = crossed.map(|block| block.allowed(self.mode.feed_override()).0);
        caps_mm_s.reduce(f64::min).unwrap_or(0.0)
    }

    /// Returns a rest at `place` if the machine rests there now, perhaps in a dwell, and the list under way
    /// has more items.
    fn rest_before_more(&self, place: &Place, progress: &Progress) -> Option<Choice> {
        let after = place.takeover().driven();
        let is_here = progress.inside.is_none() && after == progress.done as usize;
        (is_here && after < self.timeline.list().len()).then_some(Choice::Rest { after, ends_block: false })
    }

    /// Whether cutting an item helps: the cut leaves the feed unchanged, or the whole item would accelerate
    /// above the override.
    fn is_worth_cutting(&self, start: &Splice, item: &Item, cut: &Splice) -> bool {
        let whole_mm_s = item.end(start, self.tick_s).feed_mm_s;
        let cap_mm_s = self.least_cap_mm_s(start, item);
        cut.feed_mm_s == start.feed_mm_s || whole_mm_s > start.feed_mm_s && whole_mm_s > cap_mm_s
    }
}
