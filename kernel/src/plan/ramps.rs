//! The ramps of one planned block.
//!
//! Consumes a block's plan and its exact start and end on the path; produces up to three ramps and cruises
//! that fill it without a gap of even one position step: accelerate, cruise, brake.

use super::two_pass::{Block, BlockPlan};
use crate::law::{PlannedRamp, Ramp, SegmentError};
use crate::num::Root;
use crate::units::Position;

/// The ramps of one block from path position `start` to `end`, in order; `None` where the block
/// has no such part.
///
/// # Errors
/// The positions do not fit the block's length, or a figure is beyond the tick's range.
pub fn ramps<P: Root>(
    block: &Block<P>,
    plan: &BlockPlan<P>,
    start: Position,
    end: Position,
    tick_s: f64,
) -> Result<[Option<PlannedRamp>; 3], SegmentError> {
    let ramp = |from_mm_s: P, to_mm_s: P| {
        let ramp = Ramp::new(&block.law, from_mm_s, to_mm_s);
        let mm = ramp.length_mm().to_f64();
        let length = Position::from_mm(mm);
        length
            .map(|length| (ramp, length))
            .ok_or(SegmentError::OutOfRange { quantity: "ramp length [mm]", value: mm })
    };
    let &BlockPlan { enter_mm_s, mut peak_mm_s, exit_mm_s, .. } = plan;
    // A ramp shorter than a position step is dropped, and must leave no step of the feed in its place.
    let mut fall = ramp(peak_mm_s, exit_mm_s)?;
    if fall.1 == Position::ZERO && peak_mm_s != exit_mm_s {
        peak_mm_s = exit_mm_s;
        fall = ramp(exit_mm_s, exit_mm_s)?;
    }
    let mut rise = ramp(enter_mm_s, peak_mm_s)?;
    if rise.1 == Position::ZERO && peak_mm_s != enter_mm_s {
        peak_mm_s = enter_mm_s;
        (rise, fall) = (ramp(enter_mm_s, enter_mm_s)?, ramp(enter_mm_s, exit_mm_s)?);
    }
    let ((rise, rise_length), (fall, fall_length)) = (rise, fall);
    let (peak, brake) = (start + rise_length, end - fall_length);
    // With no room to cruise, the two ramps meet but for rounding: they are made to meet exactly.
    let rounding_mm = block.length_mm.spacing().to_f64();
    let meets = (brake - peak).to_mm() <= GAP_MM + 16.0 * rounding_mm;
    let (peak, brake) = match (meets, rise.duration_s() > P::ZERO, fall.duration_s() > P::ZERO) {
        (true, true, true) => (peak, peak),
        (true, true, false) => (end, end),
        (true, false, true) => (start, start),
        (false, _, _) | (true, false, false) => (peak, brake),
    };
    let feed_mm_s = peak_mm_s.to_f64();
    let made = |ramp: &Ramp<P>, length: Position| {
        if length == Position::ZERO { Ok(None) } else { PlannedRamp::new(ramp, length, tick_s).map(Some) }
    };
    let cruise =
        if brake > peak { Some(PlannedRamp::cruise(feed_mm_s, brake - peak, tick_s)?) } else { None };
    Ok([made(&rise, peak - start)?, cruise, made(&fall, end - brake)?])
}

/// A smaller gap between two ramps is rounding \[mm\].
const GAP_MM: f64 = 4.0e-9;

#[cfg(test)]
mod tests {
    use super::super::two_pass::plan;
    use super::*;
    use crate::law::{Law, Limits, Pulse};
    use crate::random::Random;

    /// Whatever the length, down to a position step: feeds meet to the bit, and lengths to the step. Blocks
    /// are driven from a feed to rest, as when a stop begins where hardly any path is left.
    #[test]
    fn nothing_is_lost_in_ramps_without_a_step() {
        let law = Law::new(Pulse::Plateau, Limits { accel_mm_s2: 2000.0, jerk_mm_s3: 5e4, snap_mm_s4: 4e6 })
            .expect("limits");
        let random = Random::new(7);
        let (mut made_up, mut short) = (0, 0);
        for number in 0..20_000 {
            let enter_mm_s = random.log(1e-6, 100.0);
            let stop = Ramp::new(&law, enter_mm_s, 0.0);
            // The way to rest, and up to a few steps more.
            let end = Position::from_mm(stop.length_mm()).expect("in range")
                + Position::from_bits(random.below(6).cast_signed());
            if end == Position::ZERO {
                continue;
            }
            let block = Block { length_mm: end.to_mm(), cap_mm_s: 200.0, junction_mm_s: 200.0, law };
            let mut plans = [BlockPlan::default()];
            if plan(&[block], enter_mm_s, 0.0, &mut plans).is_err() {
                continue;
            }
            let made = ramps(&block, &plans[0], Position::ZERO, end, 5e-4).expect("ramps");
            let (mut at, mut feed_mm_s) = (Position::ZERO, enter_mm_s);
            for PlannedRamp { ramp, length } in made.into_iter().flatten() {
                assert_eq!(ramp.from_mm_s, feed_mm_s, "block {number}: {plans:?}");
                (at, feed_mm_s) = (at + length, ramp.to_mm_s);
            }
            assert_eq!((at, feed_mm_s), (end, 0.0), "block {number}");
            made_up += 1;
            short += usize::from(plans[0].peak_mm_s > enter_mm_s && made[0].is_none());
        }
        assert!(made_up > 5000 && short > 100, "{made_up} {short}");
    }
}
