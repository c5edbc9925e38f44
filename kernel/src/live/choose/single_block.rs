//! Single block: motion comes to rest at the end of every program block and is held there.
//!
//! Plans take that block end for the end of the known path, so a list that ends there is a complete motion
//! like any other, under all ceilings. The hold at a block end is an ordinary hold: a resume ends it.

use super::command::Cut;
use super::{Choice, Chooser};
use crate::live::brake::Braking;
use crate::live::list::{Item, LIST_ITEMS, List};
use crate::live::places::Places;
use crate::live::replan::Ramps;
use crate::live::splice::{BlockEnd, SLIVER, Splice};
use crate::queue::Progress;
use crate::units::Position;

/// Number of block ends tried: nearly always motion can stop at the first. Where it can stop at none, it
/// brakes to rest before them and continues from there.
const ENDS_TRIED: usize = 2;
/// How often a braking ramp is moved to end where it should: limits may differ further ahead.
const MOVES: usize = 4;

impl<const PLACES: usize> Chooser<'_, PLACES> {
    /// Whether a list ends where single block is to come to rest.
    pub(super) fn is_block_end(&self, place: &Splice) -> bool {
        self.mode.is_single_block() && place.is_at_rest() && self.block_end == Some(BlockEnd::from(*place))
    }

    /// The path position of the nearest rest from a splice, and how to come to it.
    fn nearest_rest(&self, from: &Splice) -> Option<(Position, Option<Braking>)> {
        if from.is_at_rest() {
            return Some((from.at, None));
        }
        let path_end = self.extent_of(from.stretch).end();
        let braking = self.lookahead.nearest_rest(from, path_end, self.timeline.driven_override())?;
        Some((from.at + braking.length(), Some(braking)))
    }

    /// The first block ends of `stretch` at or after `nearest`.
    fn block_ends(&self, stretch: u32, nearest: Position) -> [Option<BlockEnd>; ENDS_TRIED] {
        let mut first = [None; ENDS_TRIED];
        let ends = self.lookahead.block_ends(stretch).filter(|end| end.at >= nearest);
        for (place, end) in first.iter_mut().zip(ends) {
            *place = Some(end);
        }
        first
    }

    /// Keeps the feed at the list's end as long as possible, then brakes to rest at the block end; false
    /// where that is not legal. Such a ramp may cross several blocks, where a plan per block finds none.
    fn brake_at_block_end(&self, list: &mut List) -> bool {
        let from = list.end();
        if from.is_at_rest() {
            return false;
        }
        let end = self.extent_of(from.stretch).end();
        let driven_override = self.timeline.driven_override();
        let mut begin = from;
        for _ in 0..MOVES {
            let Some(ramp) = self.lookahead.brake(&begin, 0.0, end, driven_override) else {
                return false;
            };
            let left = end - (begin.at + ramp.length);
            if left == Position::ZERO {
                let kept = begin.at - from.at;
                if !self.lookahead.may_keep(&from, begin.at, driven_override) || list.len() + 2 > LIST_ITEMS {
                    return false;
                }
                if kept > Position::ZERO {
                    list.push_cruise(from.feed_mm_s, kept);
                }
                list.push(Item::Feed(ramp));
                return true;
            }
            begin.at = begin.at + left;
        }
        false
    }

    /// Gathers a plan from the next list's start to the first block end that motion can stop at, or else to
    /// the end of the stretch, as far as it is known.
    pub(super) fn gather_block(&mut self, list: &mut List, ramps: Ramps) -> bool {
        let splice = *self.timeline.splice();
        if let Some((nearest, braking)) = self.nearest_rest(&splice) {
            // At rest, the block end it rests at doesn't count.
            let nearest = if braking.is_none() { nearest + SLIVER + SLIVER } else { nearest };
            let ends = self.block_ends(splice.stretch, nearest);
            for end in ends.into_iter().flatten() {
                self.block_end = Some(end);
                if self.gather_under_override(list, true, ramps) {
                    return true;
                }
                if self.attention.is_wanted() {
                    return false;
                }
                list.truncate(0);
                if self.brake_at_block_end(list) {
                    return true;
                }
            }
            if let ([Some(_), ..], Some(braking)) = (ends, braking) {
                list.push_braking(&braking);
                return true;
            }
        }
        self.block_end = None;
        self.gather_under_override(list, true, ramps)
    }

    /// Continues, from within the list under way, to the first block end that motion can stop at.
    pub(super) fn change_to_block_end(
        &mut self,
        places: &Places<'_>,
        progress: &Progress,
        list: &mut List,
    ) -> Choice {
        let (under_way, done) = (places.list(), progress.done as usize);
        if progress.waits {
            return self.end_block_after(done);
        }
        let stretch = under_way.after(done).stretch;
        let rests = places.clone().filter_map(|place| {
            if self.attention.is_wanted() {
                return None;
            }
            let splice = place.splice(self.tick_s);
            let rest = if splice.is_at_rest() {
                splice.at
            } else {
                self.stop_from(&place)?.rest(&place, self.tick_s)
            };
            (splice.stretch == stretch).then_some(rest)
        });
        if let Some(nearest) = rests.min() {
            let ends = self.block_ends(stretch, nearest);
            for end in ends.into_iter().flatten() {
                self.block_end = Some(end);
                for cut in [Cut::TooFast, Cut::All] {
                    let choice = self.change_from(places.clone(), progress, cut, list);
                    if choice != Choice::Nothing {
                        return choice;
                    }
                }
                if self.attention.is_wanted() {
                    return Choice::Nothing;
                }
                let choice = self.brake_from(places.clone(), list);
                if choice != Choice::Nothing {
                    return choice;
                }
            }
            self.block_end = None;
            if self.attention.is_wanted() {
                return Choice::Nothing;
            }
            if ends.iter().any(Option::is_some) {
                return self.stop(places.clone(), progress, list);
            }
        }
        // The first end of a stretch or rest that is still to come in this list ends a block.
        let is_no_feed = |&index: &usize| under_way.get(index).is_some_and(|(_, item)| !item.is_feed());
        match (done..under_way.exit()).find(is_no_feed) {
            Some(last) => self.end_block_after(last + 1),
            None => Choice::Nothing,
        }
    }

    /// Brakes to the block end from the first place that allows it.
    fn brake_from(&self, places: Places<'_>, list: &mut List) -> Choice {
        for place in places {
            if self.attention.is_wanted() {
                break;
            }
            place.begin(list);
            if list.end().feed_mm_s >= place.start().feed_mm_s
                && self.brake_at_block_end(list)
                && self.timeline.keeps_up(list, place.takeover())
            {
                list.set_ends_block(true);
                return self.rest_at_end_of(list, &place);
            }
        }
        Choice::Nothing
    }

    /// Ends the list under way after this many items, at the end of a block.
    fn end_block_after(&self, after: usize) -> Choice {
        if after < self.timeline.list().len() {
            Choice::Rest { after, ends_block: true }
        } else {
            Choice::EndBlock
        }
    }
}
