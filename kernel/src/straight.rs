//! One straight stretch from rest to rest, as the items of a program.
//!
//! Consumes start, end, feed and limits; produces a program that [`LiveControl`](crate::live::LiveControl)
//! drives like any other: a jog, or the move to a program's start.
//!
//! Background; one item at a time, no memory for the path.

use core::convert::Infallible;

use crate::law::{Law, LimitError, Limits, PlannedRamp, Pulse, SegmentError};
use crate::num::Root;
use crate::plan::{Block, BlockPlan, PlanError, plan};
use crate::program::{Allowed, Item, PathBlock};
use crate::units::Position;

/// Greatest length of a piece of path, in every number type.
const PIECE: Position = Position::from_bits(16 << 32);

/// Why there is no straight stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StraightError {
    /// The feed is not above 0, finite and at most the greatest one \[mm/s\].
    Feed {
        /// The feed.
        feed_mm_s: f64,
        /// The greatest feed under an override.
        most_mm_s: f64,
    },
    /// A limit is not a positive number.
    Limit(LimitError),
    /// It is longer than the kernel's range.
    Length {
        /// Its length \[mm\].
        length_mm: f64,
    },
    /// There is no plan from rest to rest over its length.
    Plan(PlanError),
    /// There is no motion of the law over its length.
    Segment(SegmentError),
}

impl core::fmt::Display for StraightError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Feed { feed_mm_s, most_mm_s } => {
                write!(f, "feed {feed_mm_s} mm/s: expected above 0, at most {most_mm_s}")
            }
            Self::Limit(error) => error.fmt(f),
            Self::Length { length_mm } => {
                write!(f, "a straight of {length_mm} mm: expected at most {} mm", Position::LIMIT_MM)
            }
            Self::Plan(error) => error.fmt(f),
            Self::Segment(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for StraightError {}

/// The items of a straight stretch; none if it has no length.
#[derive(Clone, Debug)]
pub struct Straight<const AXES: usize> {
    start: [Position; AXES],
    end: [Position; AXES],
    direction: [f64; AXES],
    length: Position,
    block: Option<PathBlock>,
    /// Path positions up to which pieces and feed have been returned.
    path: Position,
    feed: Position,
    ramps: [Option<PlannedRamp>; 3],
    is_ended: bool,
}

impl<const AXES: usize> Straight<AXES> {
    /// A stretch from rest at `start` to rest at `end` with ramps of `pulse`s within `limits`, at a feed of
    /// `feed_mm_s` above 0, at most `most_mm_s` under an override, for ticks of `tick_s`.
    ///
    /// # Errors
    /// It can't be driven. Once it is made, nothing else fails, in a number type that holds its limits.
    pub fn new(
        start: [Position; AXES],
        end: [Position; AXES],
        pulse: Pulse,
        limits: Limits<f64>,
        [feed_mm_s, most_mm_s]: [f64; 2],
        tick_s: f64,
    ) -> Result<Self, StraightError> {
        // Written so that NaN is refused.
        if !(feed_mm_s > 0.0 && feed_mm_s <= most_mm_s && most_mm_s.is_finite()) {
            return Err(StraightError::Feed { feed_mm_s, most_mm_s });
        }
        let mut offset_mm = [0.0; AXES];
        for ((offset_mm, &start), &end) in offset_mm.iter_mut().zip(&start).zip(&end) {
            *offset_mm = (end - start).to_mm();
        }
        // Along one axis the root is exact, so the length is, too.
        let length_mm = Root::sqrt(offset_mm.iter().map(|mm| mm * mm).sum::<f64>());
        let length = Position::from_mm(length_mm).ok_or(StraightError::Length { length_mm })?;
        let law = Law::new(pulse, limits).map_err(StraightError::Limit)?;
        let (mut direction, mut ramps, mut block) = ([0.0; AXES], [None; 3], None);
        if length > Position::ZERO {
            direction = offset_mm.map(|mm| mm / length_mm);
            let planned = Block { length_mm: length.to_mm(), cap_mm_s: feed_mm_s, junction_mm_s: 0.0, law };
            let mut plans = [BlockPlan::default()];
            // From rest to rest there is a plan for any length.
            plan(&[planned], 0.0, 0.0, &mut plans).map_err(StraightError::Plan)?;
            let [of_block] = plans;
            let made = crate::plan::ramps(&planned, &of_block, Position::ZERO, length, tick_s);
            ramps = made.map_err(StraightError::Segment)?;
            let allowed = |cap_mm_s| Allowed { cap_mm_s, limits };
            block = Some(PathBlock::new(length, feed_mm_s, allowed(feed_mm_s), allowed(most_mm_s), 0.0));
        }
        Ok(Self {
            start,
            end,
            direction,
            length,
            block,
            path: Position::ZERO,
            feed: Position::ZERO,
            ramps,
            is_ended: length == Position::ZERO,
        })
    }

    /// Where it ends.
    #[must_use]
    pub(crate) fn end(&self) -> [Position; AXES] {
        self.end
    }

    /// The position `path` after its start.
    fn after(&self, path: Position) -> [Position; AXES] {
        let (mut position, path_mm) = (self.start, path.to_mm());
        for (position, direction) in position.iter_mut().zip(&self.direction) {
            // In range, as a part of a length in range.
            *position = *position + Position::from_mm(direction * path_mm).unwrap_or(Position::ZERO);
        }
        position
    }
}

impl<const AXES: usize> Iterator for Straight<AXES> {
    type Item = Result<Item<AXES>, Infallible>;

    /// Returns path and feed in the order of where they start, so that both queues are always filled equally
    /// far.
    fn next(&mut self) -> Option<Self::Item> {
        if let Some(block) = self.block.take() {
            return Some(Ok(Item::Block(block)));
        }
        if self.path < self.length && self.path <= self.feed {
            let length = PIECE.min(self.length - self.path);
            let start = self.after(self.path);
            self.path = self.path + length;
            return Some(Ok(Item::Line { line: 0, start, direction: self.direction, length }));
        }
        if let Some(ramp) = self.ramps.iter_mut().find_map(Option::take) {
            self.feed = self.feed + ramp.length;
            return Some(Ok(Item::Feed(ramp)));
        }
        if core::mem::replace(&mut self.is_ended, true) {
            return None;
        }
        Some(Ok(Item::EndOfStretch(self.end)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "exact values are the point")]

    use std::format;

    use super::*;
    use crate::exec::Executor;
    use crate::fixture::{LIMITS, RULES};
    use crate::live::{Leads, LiveControl, State};
    use crate::queue::LiveStreams;
    use crate::random::Random;

    const TICK_S: f64 = 5e-4;

    fn at(mm: f64) -> Position {
        Position::from_mm(mm).expect("in range")
    }

    /// From anywhere to anywhere, from a step to metres: ends exactly, within its feed, in the time of its
    /// plan.
    #[test]
    fn any_way_is_driven_in_its_time() {
        let random = Random::new(1);
        for number in 0..200 {
            let axis = || at(2000.0 * random.unit() - 1000.0);
            let start = [axis(), axis(), axis()];
            let length_mm = random.log(1e-7, 3000.0);
            let lots = [(); 3].map(|()| if random.chance(0.3) { 0.0 } else { 2.0 * random.unit() - 1.0 });
            let size = lots.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-3);
            let mut end = start;
            for (end, part) in end.iter_mut().zip(lots) {
                *end = *end + at(part / size * length_mm);
            }
            let feed_mm_s = random.log(1.0, RULES.feed_mm_s);
            let straight = Straight::new(start, end, Pulse::Plateau, LIMITS, [feed_mm_s; 2], TICK_S)
                .expect("a straight");
            let ramps = straight.ramps.iter().flatten();
            let planned_s = ramps.map(|planned| planned.ramp.duration_s()).sum::<f64>();
            let mut streams = LiveStreams::<f64, 3, 64, 16>::new();
            let (mut feeder, mut intake) = streams.split(RULES, start);
            let mut executor = Executor::new(start);
            let mut control =
                LiveControl::<f64, 3, _, Infallible, 64>::new(straight, Pulse::Plateau, TICK_S, Leads::NONE);
            let (mut ticks, mut place) = (0_u32, start);
            loop {
                control.poll(&mut feeder).expect("accepted");
                if control.state(&feeder) == State::Done {
                    break;
                }
                let executed = executor.tick(&mut intake).expect("no fault");
                place = executed.setpoints.map(|setpoint| setpoint.position);
                let squares = executed.setpoints.map(|setpoint| setpoint.velocity_mm_s.powi(2));
                assert!(squares.iter().sum::<f64>().sqrt() <= feed_mm_s * (1.0 + 1e-9), "{number}");
                ticks += 1;
            }
            assert_eq!(place, end, "{number}");
            // It begins with a tick and ends in one.
            let planned_ticks = planned_s / TICK_S;
            let more = f64::from(ticks) - planned_ticks;
            assert!((0.0..=2.0).contains(&more), "{number}: {ticks} ticks, planned {planned_ticks}");
        }
    }

    #[test]
    fn what_is_no_straight_is_refused() {
        let items = |end_mm: f64, limits, feeds_mm_s| {
            let made = Straight::new([at(-6e5)], [at(end_mm)], Pulse::Plateau, limits, feeds_mm_s, TICK_S);
            made.map(|straight| straight.count()).map_err(|error| format!("{error}"))
        };
        assert_eq!(items(-6e5, LIMITS, [10.0; 2]), Ok(0));
        for feed_mm_s in [0.0, -1.0, 50.5, f64::NAN] {
            let expected = format!("feed {feed_mm_s} mm/s: expected above 0, at most 50");
            assert_eq!(items(0.0, LIMITS, [feed_mm_s, 50.0]), Err(expected));
        }
        let long = items(6e5, LIMITS, [10.0; 2]);
        assert_eq!(long, Err("a straight of 1200000 mm: expected at most 1000000 mm".into()));
        assert!(items(0.0, Limits { jerk_mm_s3: 0.0, ..LIMITS }, [10.0; 2]).is_err());
    }
}
