//! Chooses the next list: one that follows the list under way, or takes over from it.
//!
//! Consumes the lookahead, the mode and the timeline; produces a list and a [`Choice`] that says what to do
//! with it. Touches neither queue nor tick; it changes nothing but the program's feed and its cursor.
//!
//! - here: the list that follows, made of the program's own feed or of a new plan, with a fallback stop at
//!   its end;
//! - `command`: the list that takes over from the motion under way, and where;
//! - `single_block`: a rest at the end of every program block.

mod command;
mod single_block;
#[cfg(test)]
mod tests;

use super::list::{Item, LIST_ITEMS, List};
use super::lookahead::Lookahead;
use super::mode::Mode;
use super::places::Takeover;
use super::program_feed::ProgramFeed;
use super::reader::QueuedPath;
use super::replan::{Ramps, Reach, replan};
use super::splice::{BlockEnd, Extent, Splice};
use super::timeline::Timeline;
use crate::law::PlannedRamp;
use crate::plan::Attention;
use crate::units::Position;

/// Number of blocks ahead that are tried for a feed to continue with under a lower override.
const BLOCKS_AHEAD: usize = 8;

/// Share of the path queued beyond a stop that a cruise takes at once: limits further ahead may be lower.
const CRUISE_SHARE: f64 = 0.75;

/// What to do with the list that was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Choice {
    /// Nothing now.
    Nothing,
    /// It follows the list under way.
    Follow {
        /// The override of its motion.
        feed_override: f64,
    },
    /// It takes over; what comes after it is planned anew.
    TakeOver {
        /// Where.
        takeover: Takeover,
        /// The override of its motion.
        feed_override: f64,
    },
    /// The list under way ends early, after this many items.
    Rest {
        /// Number of items; the machine is at rest after them.
        after: usize,
        /// Whether a program block ends there.
        ends_block: bool,
    },
    /// The list under way is driven to its end, with its fallback stop.
    DriveToEnd,
    /// The list under way ends a block.
    EndBlock,
    /// The rest of the stretch after the list under way is planned anew.
    Replan,
}

/// What a choice depends on.
pub(super) struct Chooser<'a, const PLACES: usize> {
    /// Where something more urgent waits, nothing is planned anew; what is chosen then is to be chosen again.
    pub(super) attention: &'a Attention<'a>,
    pub(super) lookahead: &'a Lookahead<PLACES>,
    pub(super) feed: &'a mut ProgramFeed<PLACES>,
    /// The queued path.
    pub(super) path: QueuedPath,
    /// There is no room to read more of the program.
    pub(super) is_full: bool,
    pub(super) mode: Mode,
    pub(super) timeline: &'a Timeline,
    /// Where single block is to come to rest within a stretch; no plan goes beyond it.
    pub(super) block_end: Option<BlockEnd>,
    pub(super) tick_s: f64,
}

impl<const PLACES: usize> Chooser<'_, PLACES> {
    /// Makes the list that follows the one under way.
    pub(super) fn next(&mut self, list: &mut List) -> Choice {
        self.block_end = None;
        let splice = *self.timeline.splice();
        let begins = splice.at == Position::ZERO && !self.feed.is_empty();
        if begins && (self.mode.is_single_block() || self.mode.feed_override() != 1.0) {
            self.feed.replan_from(splice.stretch);
        }
        if self.feed.replans(splice.stretch) {
            return self.next_replanned(begins, list);
        }
        if self.gather(list) && self.is_complete(list, 1.0) {
            return Choice::Follow { feed_override: 1.0 };
        }
        self.feed.roll_back();
        // At rest with no room for more path: the program's own feed needs more path to stop than there will
        // be. What was given up tells nothing.
        if self.is_full && splice.is_at_rest() && !self.attention.is_wanted() {
            self.feed.replan_from(splice.stretch);
        }
        Choice::Nothing
    }

    /// Makes the list that follows, planned anew.
    fn next_replanned(&mut self, begins: bool, list: &mut List) -> Choice {
        let feed_override = self.mode.feed_override();
        for ramps in Ramps::IN_ORDER {
            self.block_end = None;
            list.restart(*self.timeline.splice());
            let is_found = if !self.mode.is_single_block() {
                self.gather_under_override(list, true, ramps)
            } else if begins && self.feed.peek().is_some_and(Item::is_rest) {
                // Alone, because it is a block.
                self.gather_rests(list);
                true
            } else {
                self.gather_block(list, ramps)
            };
            if is_found && self.is_complete(list, feed_override) {
                return Choice::Follow { feed_override };
            }
            self.feed.roll_back();
            if !is_found {
                break;
            }
        }
        Choice::Nothing
    }

    /// Ends a following list at rest; returns whether it can be handed over.
    fn is_complete(&mut self, list: &mut List, feed_override: f64) -> bool {
        let takeover = Takeover::After(self.timeline.list().exit());
        // From rest there is no other place to begin: a list that is too dense is refused when it is handed
        // over.
        self.end_in_a_stop(list, feed_override)
            && (self.timeline.splice().is_at_rest() || self.timeline.keeps_up(list, takeover))
    }

    /// How far the path of a stretch is known, at most to the block end to rest at.
    fn extent_of(&self, stretch: u32) -> Extent {
        self.path.extent_of(stretch, self.block_end, self.lookahead)
    }

    /// Gathers the program's own feed, as far as the list has room and path is queued. False if there is
    /// none.
    fn gather(&mut self, list: &mut List) -> bool {
        let path_end = self.extent_of(list.start().stretch).end();
        // Leaves a place for the stop.
        while list.len() + 1 < LIST_ITEMS {
            let Some(&item) = self.feed.peek() else { break };
            // A list has one stretch.
            if list.contains(&Item::End) && (item.is_feed() || item == Item::End) {
                break;
            }
            if item.is_feed() && item.end(&list.end(), self.tick_s).at > path_end {
                self.gather_cruise(list, path_end);
                break;
            }
            let item = list.push(item);
            self.feed.advance(item);
        }
        list.len() > 0
    }

    /// Gathers the part of a cruise that leaves room to stop, where the cruise is longer than the queued
    /// path.
    fn gather_cruise(&mut self, list: &mut List, path_end: Position) {
        let start = list.end();
        let Some(&Item::Feed(PlannedRamp { ramp, length })) = self.feed.peek() else { return };
        if !ramp.is_cruise() {
            return;
        }
        let feed_mm_s = ramp.from_mm_s;
        let Some(PlannedRamp { length: stop, .. }) =
            self.lookahead.brake(&Splice { feed_mm_s, ..start }, 0.0, path_end, 1.0)
        else {
            return;
        };
        let room_mm = CRUISE_SHARE * (path_end - start.at - stop).to_mm();
        let Some(part) = Position::from_mm(room_mm).filter(|part| *part > Position::ZERO && *part < length)
        else {
            return;
        };
        if let Some(part) = self.feed.split_cruise(part) {
            let part = list.push(part);
            self.feed.advance(part);
        }
    }

    /// Gathers the rests that come first and a plan from the list's end. With `to_its_end`, and if there is
    /// room, also the end of the stretch and the rests after it. False if there is neither rest nor plan.
    fn gather_replanned(&mut self, list: &mut List, to_its_end: bool, ramps: Ramps) -> bool {
        let (from, heads) = (list.end(), list.len());
        // A list that takes over from the one under way does not begin at the cursor, even at the start of a
        // stretch.
        if to_its_end && from.at == Position::ZERO {
            self.gather_rests(list);
            self.feed.drop_feed();
        }
        let rests = list.len() > heads;
        let extent = self.extent_of(from.stretch);
        let reach = if extent.end() > from.at {
            let feed_override = self.mode.feed_override();
            replan(self.attention, self.lookahead, &from, feed_override, extent.end(), ramps, list)
        } else {
            // The end of the stretch, or of what is known of it.
            (extent.is_whole() && from.is_at_rest()).then_some(Reach::Whole)
        };
        // Rests need no path after them.
        let Some(reach) = reach else { return rests };
        if to_its_end
            && reach == Reach::Whole
            && extent.is_whole()
            && !list.is_full()
            && self.feed.peek() == Some(&Item::End)
        {
            let end = list.push(Item::End);
            self.feed.advance(end);
            if !self.mode.is_single_block() {
                self.gather_rests(list);
            }
        }
        list.len() > 0
    }

    /// Gathers the dwells and stops that come first in the program's feed; only one of them in single block.
    fn gather_rests(&mut self, list: &mut List) {
        while let Some(&item) = self.feed.peek().filter(|item| item.is_rest())
            && !list.is_full()
        {
            let item = list.push(item);
            self.feed.advance(item);
            if self.mode.is_single_block() {
                break;
            }
        }
    }

    /// Gathers a plan from the list's end. Where the feed is too high for the override, a ramp down comes
    /// first.
    fn gather_under_override(&mut self, list: &mut List, to_its_end: bool, ramps: Ramps) -> bool {
        if self.gather_replanned(list, to_its_end, ramps) {
            return true;
        }
        let (heads, from) = (list.len(), list.end());
        let path_end = self.extent_of(from.stretch).end();
        let (lookahead, driven_override) = (self.lookahead, self.timeline.driven_override());
        let mut least_mm_s = from.feed_mm_s;
        for block in lookahead.from(&from).take(BLOCKS_AHEAD) {
            let (cap_mm_s, _) = block.allowed(self.mode.feed_override());
            if self.attention.is_wanted() {
                break;
            }
            if cap_mm_s >= least_mm_s {
                continue;
            }
            least_mm_s = cap_mm_s;
            let Some(ramp) = lookahead.brake(&from, cap_mm_s, path_end, driven_override) else {
                continue;
            };
            list.push(Item::Feed(ramp));
            if self.gather_replanned(list, to_its_end, ramps) {
                return true;
            }
            list.truncate(heads);
        }
        false
    }

    /// Ends a list at rest: with its stretch, or else in a fallback stop after as many items as possible,
    /// driven only if nothing follows in time. The program's feed gathered beyond the stop is ahead again.
    /// False if there is no place to stop.
    fn end_in_a_stop(&mut self, list: &mut List, feed_override: f64) -> bool {
        if list.contains(&Item::End) || self.is_block_end(&list.end()) {
            list.set_exit_to_end();
            list.set_ends_block(true);
            return true;
        }
        let path_end = self.extent_of(list.start().stretch).end();
        for exit in (1..=list.len().min(LIST_ITEMS - 1)).rev() {
            if self.attention.is_wanted() {
                return false;
            }
            let place = list.after(exit);
            let waits = list.get(exit - 1).is_some_and(|(_, item)| item.is_rest());
            let stop = if !place.is_at_rest() {
                let Some(ramp) = self.lookahead.brake(&place, 0.0, path_end, feed_override) else {
                    continue;
                };
                Some(Item::Feed(ramp))
            } else if waits {
                None
            } else {
                // A stop where the known path ends: there will be more of it.
                continue;
            };
            self.feed.take_back(list, exit, list.len());
            list.truncate(exit);
            list.set_exit_to_end();
            list.set_ends_block(waits);
            if let Some(stop) = stop {
                list.push(stop);
            }
            return true;
        }
        // If nothing else will do.
        list.set_exit_to_end();
        list.len() > 0 && list.end().is_at_rest()
    }
}
