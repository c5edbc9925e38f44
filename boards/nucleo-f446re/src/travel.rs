//! A straight move from rest to rest, planned on the board by the kernel's own planner.
//!
//! Consumes two positions and a feed; produces pieces and feed segments, and offers them to the streams as
//! they have room. Background, double precision. [`Travel::fill`] never waits: it takes as long as the room
//! in the streams allows, at most their capacity in items.

use motion_kernel::law::{FeedSegment, Law, LimitError, Limits, SegmentError};
use motion_kernel::num::{Real, Root};
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::plan::{Block, BlockPlan, PlanError, plan, segments};
use motion_kernel::queue::{Feeder, Refused, Rejection};
use motion_kernel::units::Position;

use crate::design_parameters::TICK_S;
use crate::machine::AXES;

/// Why a move can't be planned or is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_arch = "arm", derive(defmt::Format))]
pub enum TravelError {
    /// A limit is not positive and finite.
    Limit(LimitError),
    /// The move is longer than the kernel's range \[mm\].
    Length(f64),
    /// The plan.
    Plan(PlanError),
    /// A ramp or cruise.
    Segment(SegmentError),
    /// A piece of path.
    Piece(PieceError),
    /// The streams refuse it.
    Rejected(Rejection),
}

/// It belongs to no line of a program.
const NO_LINE: u32 = 0;

/// A straight move and how much of it is in the streams.
#[derive(Clone, Copy, Debug)]
pub struct Travel {
    start: [Position; AXES],
    end: [Position; AXES],
    direction: [f64; AXES],
    length: Position,
    segments: [Option<FeedSegment<f32>>; 3],
    next_segment: usize,
    pieces: u32,
    next_piece: u32,
    ended: bool,
}

impl Travel {
    /// From `start` to `end` at `feed_mm_s` along the path, within `limits`. A move of no length is done at once.
    ///
    /// # Errors
    /// [`TravelError`]; nothing has entered the streams.
    pub fn new(
        limits: Limits<f64>,
        start: [Position; AXES],
        end: [Position; AXES],
        feed_mm_s: f64,
    ) -> Result<Self, TravelError> {
        let mut way_mm = [0.0; AXES];
        for ((way_mm, &start), &end) in way_mm.iter_mut().zip(&start).zip(&end) {
            *way_mm = (end - start).to_mm();
        }
        let length_mm = Root::sqrt(way_mm.iter().map(|mm| mm * mm).sum::<f64>());
        let length = Position::from_mm(length_mm).ok_or(TravelError::Length(length_mm))?;
        let mut travel = Self {
            start,
            end,
            direction: [0.0; AXES],
            length,
            segments: [None; 3],
            next_segment: 0,
            pieces: 0,
            next_piece: 0,
            ended: length == Position::ZERO,
        };
        if travel.ended {
            return Ok(travel);
        }
        travel.direction = way_mm.map(|mm| mm / length_mm);
        // Cut evenly into pieces whose offsets f32 resolves; a part below, for rounding.
        travel.pieces = (length_mm / (f32::PIECE_MM_MAX * (1.0 - 1.0e-9))) as u32 + 1;
        let block = Block {
            length_mm,
            cap_mm_s: feed_mm_s,
            joint_mm_s: f64::INFINITY,
            law: Law::new(limits).map_err(TravelError::Limit)?,
        };
        let mut plans = [BlockPlan::default()];
        plan(&[block], 0.0, 0.0, &mut plans).map_err(TravelError::Plan)?;
        let [planned] = plans;
        travel.segments =
            segments(&block, &planned, Position::ZERO, length, TICK_S).map_err(TravelError::Segment)?;
        Ok(travel)
    }

    /// Offers what is left to the streams until they are full; whether all of it has entered.
    ///
    /// # Errors
    /// The streams refuse an item, which means that the plan is wrong.
    pub fn fill(&mut self, feeder: &mut Feeder<'_, f32, AXES>) -> Result<bool, TravelError> {
        if self.ended {
            return Ok(true);
        }
        // Neither stream waits for the other to be complete: each may be full before the other has begun, and
        // only what is in both can move.
        while self.next_piece < self.pieces && entered(feeder.piece(self.piece()?))? {
            self.next_piece += 1;
        }
        while let Some(segment) = self.segments.get(self.next_segment) {
            if let Some(segment) = segment
                && !entered(feeder.segment(*segment))?
            {
                break;
            }
            self.next_segment += 1;
        }
        if self.next_piece < self.pieces || self.next_segment < self.segments.len() {
            return Ok(false);
        }
        self.ended = entered(feeder.end_stretch(self.end))?;
        Ok(self.ended)
    }

    /// The next piece.
    fn piece(&self) -> Result<Piece<f32, AXES>, TravelError> {
        let from = self.on_path(self.next_piece);
        let offset_mm = from.to_mm();
        let mut start = self.start;
        for (start, direction) in start.iter_mut().zip(&self.direction) {
            let mm = direction * offset_mm;
            *start = *start + Position::from_mm(mm).ok_or(TravelError::Length(mm))?;
        }
        let length = self.on_path(self.next_piece + 1) - from;
        Piece::line(NO_LINE, start, self.direction, length).map_err(TravelError::Piece)
    }

    /// The path position at which piece number `piece` begins; the last one ends exactly at the length.
    fn on_path(&self, piece: u32) -> Position {
        let bits = i128::from(self.length.to_bits()) * i128::from(piece) / i128::from(self.pieces.max(1));
        Position::from_bits(bits as i64)
    }
}

/// Whether the queue had room.
fn entered<T>(answer: Result<(), Refused<T>>) -> Result<bool, TravelError> {
    match answer {
        Ok(()) => Ok(true),
        Err(Refused::Full(_)) => Ok(false),
        Err(Refused::Invalid(rejection)) => Err(TravelError::Rejected(rejection)),
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::{ExecState, Executor};
    use motion_kernel::queue::{PathRules, Streams};

    use super::*;
    use crate::machine::{Machine, PROGRAM};

    fn rules() -> PathRules {
        Machine::new(PROGRAM).expect("suits").header().rules
    }

    fn at(mm: [f64; AXES]) -> [Position; AXES] {
        mm.map(|mm| Position::from_mm(mm).expect("in range"))
    }

    /// Runs the moves one after the other as the board does: one fill, one tick. The ticks that it takes.
    fn run(from: [f64; AXES], to: &[[f64; AXES]], feed_mm_s: f64) -> u32 {
        let mut streams = Streams::<f32, AXES, 64, 64>::new();
        let (mut feeder, mut intake) = streams.split(rules(), at(from));
        let mut executor = Executor::new(at(from));
        let mut here = at(from);
        let mut ticks = 0;
        for &to in to {
            let mut travel = Travel::new(rules().limits, here, at(to), feed_mm_s).expect("plannable");
            loop {
                let filled = travel.fill(&mut feeder).expect("accepted");
                let executed = executor.tick(&mut intake).expect("no fault");
                let length = |v: [f32; AXES]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
                let feed = length(executed.setpoints.map(|setpoint| setpoint.velocity_mm_s));
                assert!(f64::from(feed) <= feed_mm_s * (1.0 + 1e-6));
                ticks += 1;
                assert!(ticks < 1_000_000, "it never arrives");
                if filled && executed.state == ExecState::Idle {
                    assert_eq!(executed.setpoints.map(|setpoint| setpoint.position), at(to));
                    break;
                }
            }
            here = at(to);
        }
        ticks
    }

    #[test]
    fn out_and_back_takes_the_time_of_its_plan() {
        let ticks = run([0.0; AXES], &[[20.0, 0.0, 0.0], [0.0; AXES]], 50.0);
        // Each way: 20 mm at 50 mm/s and a ramp's time on top, t_p = 2·√(2·50/5000) s.
        let each_s = 20.0 / 50.0 + 2.0 * (2.0 * 50.0 / 5.0e3_f64).sqrt();
        let expected = (2.0 * each_s / TICK_S).ceil() as u32;
        assert!(ticks.abs_diff(expected) <= 4, "{ticks} {expected}");
    }

    #[test]
    fn any_distance_and_direction() {
        // From one encoder count to the whole machine, longer than the streams hold.
        for mm in [1e-4, 2e-4, 1e-3, 0.01, 1.0, 15.999, 16.0, 16.001, 100.0, 3000.0] {
            for direction in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.48, -0.64, 0.6]] {
                let start = [123.456, -78.9, 1000.0];
                let end = core::array::from_fn(|axis| start[axis] + mm * direction[axis]);
                run(start, &[end], rules().feed_mm_s);
            }
        }
    }

    #[test]
    fn no_distance_is_done_at_once() {
        let mut streams = Streams::<f32, AXES, 64, 64>::new();
        let (mut feeder, _intake) = streams.split(rules(), at([1.0; AXES]));
        let mut travel =
            Travel::new(rules().limits, at([1.0; AXES]), at([1.0; AXES]), 50.0).expect("plannable");
        assert_eq!(travel.fill(&mut feeder), Ok(true));
    }
}
