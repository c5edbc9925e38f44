//! Planned blocks as feed segments: they fill the path without a gap.

use super::{block, from_rest, random_blocks};
use motion_kernel::num::Real;
use motion_kernel::plan::{Block, BlockPlan, ramps};
use motion_kernel::units::Position;
use motion_tests::random::Random;

const TICK_S: f64 = 5e-4;

/// What the segments of a stretch come to.
#[derive(Debug, Default)]
struct Total {
    segments: usize,
    time_s: f64,
}

/// Makes the segments of all blocks, junctions at the rounded sums of the lengths, and checks how they join.
fn fill<R: Real>(blocks: &[Block<f64>], plans: &[BlockPlan<f64>]) -> Total {
    let mut total = Total::default();
    let (mut end_mm, mut start, mut feed) = (0.0, Position::ZERO, 0.0);
    for (index, (block, plan)) in blocks.iter().zip(plans).enumerate() {
        end_mm += block.length_mm;
        let end = Position::from_mm(end_mm).expect("in range");
        let made = ramps(block, plan, start, end, TICK_S)
            .unwrap_or_else(|error| panic!("block {index}: {error}: {block:?} {plan:?}"));
        let mut reached = start;
        for planned in made.into_iter().flatten() {
            let segment = planned.segment::<R>(TICK_S).expect("a segment");
            assert!(segment.length() > Position::ZERO, "block {index}: {segment:?}");
            assert_eq!(
                segment.from_mm_s().to_f64(),
                R::from_f64(feed).to_f64(),
                "the feed steps in block {index}"
            );
            feed = if segment.to_mm_s() == R::from_f64(plan.peak_mm_s) {
                plan.peak_mm_s
            } else {
                plan.exit_mm_s
            };
            assert_eq!(
                segment.to_mm_s().to_f64(),
                R::from_f64(feed).to_f64(),
                "block {index}: {plan:?} {segment:?}"
            );
            reached = reached + segment.length();
            total.segments += 1;
            total.time_s += segment.duration().to_f64() * TICK_S;
        }
        assert_eq!(reached.to_bits(), end.to_bits(), "a gap in block {index}: {plan:?}");
        // A ramp too short to have a length of its own may be left out; its change of feed is as small.
        assert!(
            (feed - plan.exit_mm_s).abs() <= 1e-6 * (1.0 + feed),
            "block {index} ends at {feed}: {plan:?}"
        );
        feed = plan.exit_mm_s;
        start = end;
    }
    total
}

fn random_stretches<R: Real>(stream: u64, shortest_mm: f64) {
    let mut random = Random::of_stream(stream);
    let mut count = 0;
    for _ in 0..5000 {
        let blocks = random_blocks(&mut random, 30, shortest_mm);
        let plans = from_rest(&blocks);
        let total = fill::<R>(&blocks, &plans);
        count += total.segments;
        let time_s = super::time_s(&blocks, &plans);
        assert!(
            (total.time_s - time_s).abs() <= 1e-6 * time_s + 1e-6,
            "{} s, planned {time_s} s",
            total.time_s
        );
    }
    println!("{count} segments");
}

#[test]
fn segments_join_f64() {
    random_stretches::<f64>(80, 1e-2);
}

#[test]
fn segments_join_f32() {
    random_stretches::<f32>(81, 1e-2);
}

/// Down to a nanometre: lengths below the resolution of a ramp at speed.
#[test]
fn segments_of_tiny_blocks_join() {
    random_stretches::<f64>(82, 1e-6);
}

/// The least of what fails without it: 1 µm at 83 mm/s, between ceilings that differ, so that it is not merged.
/// One ulp of feed there is 0.1 µm of ramp.
#[test]
fn a_micrometre_at_speed() {
    for step in 1..=1000 {
        let length_mm = 1e-3 * f64::from(step) / 100.0;
        let blocks = [block(100.0, 83.3), block(length_mm, 90.0), block(100.0, 91.0)];
        fill::<f64>(&blocks, &from_rest(&blocks));
    }
}
