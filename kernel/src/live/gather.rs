//! What goes into the next list: the program's own feed, or a plan made anew, and a stop behind it.

use heapless::Vec;

use super::control::LiveControl;
use super::list::{Item, LIST_ITEMS, List};
use super::replan::{Ramps, replan};
use super::road::Splice;
use super::source::Source;
use crate::law::Ramp;
use crate::num::Real;
use crate::units::Position;

/// How many blocks ahead are looked at for a feed to go on with under a lower override.
const BLOCKS_AHEAD: usize = 8;

/// Of the path that is queued beyond a stop, how much a cruise takes at once: limits further on may be lower.
const CRUISE_SHARE: f64 = 0.75;

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, I, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// The program's own feed, as far as a list and the path reach. False if there is none.
    pub(super) fn gather(&mut self, list: &mut List) -> bool {
        let (path_end, _) = self.path_of(self.ahead.stretch);
        // A place is left for the stop.
        while list.len() + 1 < LIST_ITEMS {
            let Some(&item) = self.course.front() else { break };
            // One stretch a list.
            if list.contains(&Item::End) && (item.is_feed() || item == Item::End) {
                break;
            }
            if item.is_feed() && item.end(&list.end(), self.tick_s).at > path_end {
                self.gather_cruise(list, path_end);
                break;
            }
            list.push(item);
            self.course.pop_front();
        }
        list.len() > 0
    }

    /// Of a cruise that is longer than the path that is queued, what leaves room to stop.
    fn gather_cruise(&mut self, list: &mut List, path_end: Position) {
        let start = list.end();
        let Some(Item::Feed { ramp, length }) = self.course.front_mut() else { return };
        if !ramp.is_cruise() {
            return;
        }
        let feed_mm_s = ramp.from_mm_s;
        let Some((_, stop)) = self.road.brake(&Splice { feed_mm_s, ..start }, 0.0, path_end, 1.0) else {
            return;
        };
        let room_mm = CRUISE_SHARE * (path_end - start.at - stop).to_mm();
        let Some(part) = Position::from_mm(room_mm).filter(|part| *part > Position::ZERO && part < length)
        else {
            return;
        };
        let cruise = |length: Position| Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s);
        *length = *length - part;
        *ramp = cruise(*length);
        list.push(Item::Feed { ramp: cruise(part), length: part });
    }

    /// The rests that come first, and a plan from where the list ends; to the end of its stretch, and what comes behind it,
    /// if that is wanted and there is room. False if there is neither.
    fn gather_replanned(&mut self, list: &mut List, to_its_end: bool, ramps: Ramps) -> bool {
        let (from, heads) = (list.end(), list.len());
        // What takes over from a list under way is not at the front of the course, even where it has hardly begun.
        if to_its_end && from.at == Position::ZERO {
            self.gather_rests(list);
            self.drop_feed();
        }
        let rests = list.len() > heads;
        let (path_end, is_whole) = self.path_of(from.stretch);
        let is_all = if path_end > from.at {
            replan(&self.road, &from, self.feed_override, path_end, ramps, self.tick_s, list)
        } else {
            // The end of the stretch, or of what is known of it.
            (is_whole && from.feed_mm_s <= 0.0).then_some(true)
        };
        // They need no path behind them.
        let Some(is_all) = is_all else { return rests };
        if to_its_end && is_all && is_whole && !list.is_full() && self.course.front() == Some(&Item::End) {
            self.course.pop_front();
            list.push(Item::End);
            if !self.is_single {
                self.gather_rests(list);
            }
        }
        list.len() > 0
    }

    /// The dwells and stops that come first in the course; one of them in single block.
    pub(super) fn gather_rests(&mut self, list: &mut List) {
        while let Some(&item) = self.course.front().filter(|item| item.is_rest())
            && !list.is_full()
        {
            self.course.pop_front();
            list.push(item);
            if self.is_single {
                break;
            }
        }
    }

    /// A plan from where the list ends; where that is too fast for the override, behind a ramp down to it.
    pub(super) fn gather_under_override(&mut self, list: &mut List, to_its_end: bool, ramps: Ramps) -> bool {
        if self.gather_replanned(list, to_its_end, ramps) {
            return true;
        }
        let (heads, from) = (list.len(), list.end());
        let (path_end, _) = self.path_of(from.stretch);
        let mut caps_mm_s: Vec<f64, BLOCKS_AHEAD> = Vec::new();
        for block in self.road.from(&from).take(BLOCKS_AHEAD) {
            let _ = caps_mm_s.push(block.allowed(self.feed_override).0);
        }
        let mut least_mm_s = from.feed_mm_s;
        for cap_mm_s in caps_mm_s {
            if cap_mm_s >= least_mm_s {
                continue;
            }
            least_mm_s = cap_mm_s;
            let Some((ramp, length)) = self.road.brake(&from, cap_mm_s, path_end, self.driven_override)
            else {
                continue;
            };
            list.push(Item::Feed { ramp, length });
            if self.gather_replanned(list, to_its_end, ramps) {
                return true;
            }
            list.truncate(heads);
        }
        false
    }

    /// Ends a list at rest: with its stretch, or else in a stop behind as many of its items as possible, which is driven
    /// only if nothing follows in time; what was gathered behind that is ahead again. False if there is no such place.
    pub(super) fn end_in_a_stop(&mut self, list: &mut List, feed_override: f64) -> bool {
        if list.contains(&Item::End) {
            list.leave = list.len();
            list.ends_block = true;
            return true;
        }
        if self.is_block_end(&list.end()) {
            list.leave = list.len();
            list.ends_block = true;
            return true;
        }
        let (path_end, _) = self.path_of(list.start.stretch);
        for leave in (1..=list.len().min(LIST_ITEMS - 1)).rev() {
            let place = list.after(leave);
            let is_at_rest = place.feed_mm_s <= 0.0;
            let waits = list.get(leave - 1).is_some_and(|(_, item)| item.is_rest());
            if is_at_rest && !waits {
                // A stop where the known path ends: there will be more of it.
                continue;
            }
            let stop = if is_at_rest { None } else { self.road.brake(&place, 0.0, path_end, feed_override) };
            if is_at_rest || stop.is_some() {
                self.put_back(list, 0, leave);
                list.truncate(leave);
                list.leave = leave;
                list.ends_block = waits;
                if let Some((ramp, length)) = stop {
                    list.push(Item::Feed { ramp, length });
                }
                return true;
            }
        }
        // If nothing else will do.
        list.leave = list.len();
        list.len() > 0 && list.end().feed_mm_s <= 0.0
    }
}
