//! Single block: motion comes to rest at the end of every program block and is held there.
//!
//! The end that is stopped at is the end of the known path as far as plans go: a list that ends there is a complete motion
//! as any other, under all the ceilings on the way. A hold at a block's end is the hold that [`LiveControl::resume`] ends.

use super::block_ends::BlockEnd;
use super::command::Places;
use super::control::LiveControl;
use super::list::{Item, LIST_ITEMS, List};
use super::replan::Ramps;
use super::road::{SLIVER, Splice};
use super::source::Source;
use crate::law::Ramp;
use crate::num::Real;
use crate::program::SupplyError;
use crate::queue::{LiveFeeder, Progress};
use crate::units::Position;

/// How many block ends in reach are tried: nearly always the first one can be stopped at. Where none can, motion brakes to
/// rest before them and goes on from there.
const ENDS_TRIED: usize = 2;
/// How often a braking ramp is moved on to end where it should: limits may be others further on.
const MOVES: usize = 4;

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, I, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// Single block: comes to rest exactly at the end of the program block under way (what has the same program line; a
    /// dwell or a stop is one too), or of the next one that it can still stop at, and is held there until
    /// [`LiveControl::resume`], which lets it run one block more. At rest, it is the next block that is run. Switched off, a
    /// hold that has come about remains one until the resume.
    pub fn set_single_block(&mut self, is_single: bool) {
        if is_single != self.is_single {
            self.is_single = is_single;
            self.go_on_anew();
        }
    }

    /// Whether a list ends where single block is to come to rest.
    pub(super) fn is_block_end(&self, place: &Splice) -> bool {
        self.is_single && place.feed_mm_s <= 0.0 && self.block_end == Some(BlockEnd::from(*place))
    }

    /// Whether the list under way ends with a block that is to be waited behind. At rest there motion is held, if there is
    /// more to come.
    pub(super) fn waits_behind_block(&mut self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        if !(self.is_single && (self.current.list.ends_block || self.has_come_to_block_end())) {
            return false;
        }
        if self.rests(feeder) {
            self.is_held = !self.is_read();
            self.has_waited();
        }
        true
    }

    /// At rest in a hold, or without single block, there is nothing more to wait for: it is the next block that is run.
    pub(super) fn note_rest(&mut self, feeder: &LiveFeeder<'_, R, AXES>) {
        if (self.is_held || !self.is_single) && self.rests(feeder) {
            self.has_waited();
        }
    }

    /// The end of the list under way has been waited at.
    fn has_waited(&mut self) {
        self.held_at = Some(self.current.list.end());
        self.current.list.ends_block = false;
    }

    /// The path position of the nearest rest from a splice, and how to brake to it.
    fn nearest_rest(&self, from: &Splice) -> Option<(Position, Option<Item>)> {
        if from.feed_mm_s <= 0.0 {
            return Some((from.at, None));
        }
        let (path_end, _) = self.path_of(from.stretch);
        let (ramp, length) = self.road.brake(from, 0.0, path_end, self.driven_override)?;
        Some((from.at + length, Some(Item::Feed { ramp, length })))
    }

    /// The first block ends of `stretch` from `nearest` on.
    fn block_ends(&self, stretch: u32, nearest: Position) -> [Option<BlockEnd>; ENDS_TRIED] {
        let mut first = [None; ENDS_TRIED];
        let ends = self.ends.of(stretch).filter(|end| end.at >= nearest);
        for (place, end) in first.iter_mut().zip(ends) {
            *place = Some(end);
        }
        first
    }

    /// Whether motion rests at the end of a block that has not been waited at.
    fn has_come_to_block_end(&self) -> bool {
        let ahead = &self.ahead;
        let was_held = self.held_at.is_some_and(|held| BlockEnd::from(held).is_at(ahead));
        ahead.feed_mm_s <= 0.0 && !was_held && self.ends.of(ahead.stretch).any(|end| end.is_at(ahead))
    }

    /// Keeps the feed at the list's end as long as possible and brakes, to rest at the block end; false where that is not
    /// legal. A ramp crosses blocks that a plan has no ramps for.
    fn brake_at_block_end(&self, list: &mut List) -> bool {
        let from = list.end();
        if from.feed_mm_s <= 0.0 {
            return false;
        }
        let (end, _) = self.path_of(from.stretch);
        let mut begin = from;
        for _ in 0..MOVES {
            let Some((ramp, length)) = self.road.brake(&begin, 0.0, end, self.driven_override) else {
                return false;
            };
            let left = end - (begin.at + length);
            if left == Position::ZERO {
                let kept = begin.at - from.at;
                if !self.road.may_keep(&from, begin.at, self.driven_override) || list.len() + 2 > LIST_ITEMS {
                    return false;
                }
                if kept > Position::ZERO {
                    let cruise = Ramp::cruise(from.feed_mm_s, kept.to_mm() / from.feed_mm_s);
                    list.push(Item::Feed { ramp: cruise, length: kept });
                }
                list.push(Item::Feed { ramp, length });
                return true;
            }
            begin.at = begin.at + left;
        }
        false
    }

    /// A plan from `ahead` to the first block end that can be stopped at, or else to the end of the stretch or of what is
    /// known of it.
    pub(super) fn gather_block(&mut self, list: &mut List, ramps: Ramps) -> bool {
        let ahead = self.ahead;
        if let Some((nearest, brake)) = self.nearest_rest(&ahead) {
            // At rest, not what it rests at.
            let nearest = if brake.is_none() { nearest + SLIVER + SLIVER } else { nearest };
            let ends = self.block_ends(ahead.stretch, nearest);
            for end in ends.into_iter().flatten() {
                self.block_end = Some(end);
                if self.gather_under_override(list, true, ramps) {
                    return true;
                }
                list.truncate(0);
                if self.brake_at_block_end(list) {
                    return true;
                }
            }
            if let ([Some(_), ..], Some(brake)) = (ends, brake) {
                list.push(brake);
                return true;
            }
        }
        self.block_end = None;
        self.gather_under_override(list, true, ramps)
    }

    /// Goes on to the first block end that can be stopped at from within the list under way; false if there is none.
    pub(super) fn respeed_to_block_end(
        &mut self,
        places: &Places,
        progress: &Progress,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<bool, SupplyError<E>> {
        let done = progress.done as usize;
        if progress.waits {
            return self.end_block_behind(done, feeder).map(|()| true);
        }
        let stretch = self.current.list.after(done).stretch;
        let rests = places.iter().filter_map(|place| {
            let splice = place.splice(self.tick_s);
            let (rest, _) = self.nearest_rest(&splice)?;
            (splice.stretch == stretch).then_some(rest)
        });
        if let Some(nearest) = rests.min() {
            let ends = self.block_ends(stretch, nearest);
            for end in ends.into_iter().flatten() {
                self.block_end = Some(end);
                for gives_up in [false, true] {
                    if self.respeed_from(places, progress, gives_up, feeder)? {
                        return Ok(true);
                    }
                }
                if self.brake_from(places, feeder)? {
                    return Ok(true);
                }
            }
            self.block_end = None;
            if ends.iter().any(Option::is_some) {
                return self.stop(progress, feeder).map(|()| true);
            }
        }
        // The end of the stretch, or of what is waited for between two: behind it, if that is to come in this list.
        let list = &self.current.list;
        let behind =
            (done..list.leave).find(|&index| list.get(index).is_some_and(|(_, item)| !item.is_feed()));
        match behind {
            Some(last) => self.end_block_behind(last + 1, feeder).map(|()| true),
            None => Ok(false),
        }
    }

    /// Brakes to the block end from the first place that allows it; false if there is none.
    fn brake_from(
        &mut self,
        places: &Places,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<bool, SupplyError<E>> {
        for place in places {
            let mut list = place.list(self.tick_s);
            let splice = list.end();
            if splice.feed_mm_s < place.start.feed_mm_s
                || !self.brake_at_block_end(&mut list)
                || !self.keeps_up(&list, &place.change)
            {
                continue;
            }
            list.ends_block = true;
            return self.rest_at_end_of(list, place, feeder).map(|()| true);
        }
        Ok(false)
    }

    /// Ends the list under way behind so many of its items, which end a block there.
    fn end_block_behind(
        &mut self,
        count: usize,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        if count < self.current.list.len() {
            self.rest_behind(count, true, feeder)
        } else {
            self.current.list.ends_block = true;
            Ok(())
        }
    }
}
