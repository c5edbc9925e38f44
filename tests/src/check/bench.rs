//! Hand-made items of the streams, for machines of two axes.

use motion_kernel::law::{FeedSegment, Law, Limits, Pulse, Ramp};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::plan::{Block, BlockPlan, plan, ramps};
use motion_kernel::queue::PathRules;
use motion_kernel::units::Position;

pub const TICK_S: f64 = 0.0005;
pub const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
pub const RULES: PathRules =
    PathRules { limits: LIMITS, feed_mm_s: 300.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };

pub fn mm(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

pub fn point(at: [f64; 2]) -> [Position; 2] {
    at.map(mm)
}

/// A line; `length_mm` of it are exact position steps.
pub fn line<R: Real>(from: [f64; 2], direction: [f64; 2], length_mm: f64) -> Piece<R, 2> {
    Piece::line(7, point(from), direction, mm(length_mm)).expect("a piece")
}

pub fn law(limits: Limits<f64>) -> Law<f64> {
    Law::new(Pulse::Plateau, limits).expect("limits")
}

/// A ramp over its own length.
pub fn ramp<R: Real>(limits: Limits<f64>, from_mm_s: f64, to_mm_s: f64) -> FeedSegment<R> {
    let ramp = Ramp::new(&law(limits), from_mm_s, to_mm_s);
    FeedSegment::ramp(&ramp, mm(ramp.length_mm()), TICK_S).expect("a ramp")
}

pub fn cruise<R: Real>(feed_mm_s: f64, length_mm: f64) -> FeedSegment<R> {
    FeedSegment::cruise(feed_mm_s, mm(length_mm), TICK_S).expect("a cruise")
}

/// From rest to rest over `length`, with a ceiling.
pub fn rest_to_rest<R: Real>(length: Position, cap_mm_s: f64) -> Vec<FeedSegment<R>> {
    let block = Block { length_mm: length.to_mm(), cap_mm_s, junction_mm_s: f64::INFINITY, law: law(LIMITS) };
    let mut plans = [BlockPlan::default()];
    plan(&[block], 0.0, 0.0, &mut plans).expect("a plan");
    let made = ramps(&block, &plans[0], Position::ZERO, length, TICK_S).expect("ramps");
    made.into_iter().flatten().map(|ramp| ramp.segment(TICK_S).expect("a segment")).collect()
}
