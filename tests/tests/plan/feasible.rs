//! Whatever the blocks are, the plan keeps every ceiling and every ramp has its length.

use super::{from_rest, planned, random_blocks, reference, time_s};
use motion_kernel::internals::merge_equal;
use motion_kernel::plan::{Block, BlockPlan, PlanError};
use motion_tests::random::Random;

/// How much longer than its block a block's ramps may be, relative: rounding.
const ROUNDING: f64 = 1e-9;

/// The worst relative overrun of the blocks' lengths. Everything else that a plan promises is asserted.
fn check(blocks: &[Block<f64>], start: f64, end: f64, plans: &[BlockPlan<f64>]) -> f64 {
    let mut worst = 0.0_f64;
    let mut feed = start;
    for (index, (block, plan)) in blocks.iter().zip(plans).enumerate() {
        let BlockPlan { enter_mm_s, peak_mm_s, exit_mm_s } = *plan;
        assert_eq!(enter_mm_s, feed, "the feed steps before block {index}: {plan:?}");
        feed = exit_mm_s;
        assert!(enter_mm_s >= 0.0 && exit_mm_s >= 0.0, "block {index}: {plan:?}");
        assert!(
            peak_mm_s >= enter_mm_s.max(exit_mm_s) && peak_mm_s <= block.cap_mm_s,
            "{index}: {plan:?} {block:?}"
        );
        assert!(
            index + 1 == blocks.len() || exit_mm_s <= block.junction_mm_s,
            "junction {index}: {plan:?} {block:?}"
        );
        assert!(block.length_mm <= 0.0 || peak_mm_s > 0.0, "block {index} is never left: {plan:?}");
        let ramps_mm =
            block.law.ramp_length_mm(enter_mm_s, peak_mm_s) + block.law.ramp_length_mm(peak_mm_s, exit_mm_s);
        if ramps_mm > block.length_mm {
            let over = ramps_mm / block.length_mm - 1.0;
            assert!(over <= ROUNDING, "block {index} is {over:e} too short: {plan:?} {block:?}");
            worst = worst.max(over);
        }
    }
    assert_eq!(feed, end, "the end feed");
    worst
}

#[test]
fn random_lists() {
    let mut random = Random::of_stream(50);
    let (mut lists, mut count, mut refused, mut worst) = (0, 0, 0, 0.0_f64);
    while lists < 100_000 {
        let blocks = random_blocks(&mut random, 60, 1e-6);
        let (first, last) = (blocks[0].cap_mm_s, blocks[blocks.len() - 1].cap_mm_s);
        let (start, end) = match random.below(4) {
            0 => (first * random.unit(), last * random.unit()),
            1 => (random.log(1e-3, 1.0) * first, 0.0),
            _ => (0.0, 0.0),
        };
        match planned(&blocks, start, end) {
            Ok(plans) => {
                worst = worst.max(check(&blocks, start, end, &plans));
                lists += 1;
                count += blocks.len();
            }
            Err(PlanError::TooShortToBrake { start_mm_s, greatest_mm_s }) => {
                assert!(start_mm_s == start && greatest_mm_s < start);
                refused += 1;
            }
            Err(PlanError::TooShortToAccelerate { end_mm_s, greatest_mm_s }) => {
                assert!(end_mm_s == end && greatest_mm_s < end);
                refused += 1;
            }
            Err(other) => panic!("{other}: {blocks:?} {start} {end}"),
        }
    }
    println!(
        "{lists} plans of {count} blocks, {refused} too short; ramps overrun their block by {worst:.1e} at most"
    );
}

/// A stretch is refused only if it really is too short: the greatest feed that the refusal names is planned. Feeds a
/// few roundings above it are planned exactly as they were given, or refused.
#[test]
fn refusals_name_the_greatest_feed() {
    let mut random = Random::of_stream(51);
    let (mut named, mut above) = (0, 0);
    for _ in 0..20_000 {
        let blocks = random_blocks(&mut random, 6, 1e-2);
        let (first, last) = (blocks[0].cap_mm_s, blocks[blocks.len() - 1].cap_mm_s);
        let greatest = match planned(&blocks, first, 0.0) {
            Err(PlanError::TooShortToBrake { greatest_mm_s, .. }) => (greatest_mm_s, 0.0),
            _ => match planned(&blocks, 0.0, last) {
                Err(PlanError::TooShortToAccelerate { greatest_mm_s, .. }) => (0.0, greatest_mm_s),
                _ => continue,
            },
        };
        named += 1;
        for ulps in 0..32 {
            let factor = 1.0 + f64::from(ulps) * f64::EPSILON;
            let (start, end) = (greatest.0 * factor, greatest.1 * factor);
            match planned(&blocks, start, end) {
                Ok(plans) => {
                    let (enter, exit) = (plans[0].enter_mm_s, plans[plans.len() - 1].exit_mm_s);
                    assert_eq!((enter, exit), (start, end), "{ulps}: {blocks:?}");
                    above += usize::from(start + end > greatest.0 + greatest.1);
                }
                Err(PlanError::TooShortToBrake { .. } | PlanError::TooShortToAccelerate { .. })
                    if ulps > 0 => {}
                Err(error) => panic!("{error}: {greatest:?} {blocks:?}"),
            }
        }
    }
    println!("{named} refused, {above} planned from just above");
    assert!(named > 1000);
}

#[test]
fn same_input_same_bits() {
    let mut random = Random::of_stream(52);
    for _ in 0..2000 {
        let blocks = random_blocks(&mut random, 60, 1e-6);
        let (first, second) = (planned(&blocks, 0.0, 0.0), planned(&blocks, 0.0, 0.0));
        let bits = |plans: Result<Vec<BlockPlan<f64>>, PlanError>| {
            let plans = plans.expect("a plan");
            plans
                .iter()
                .flat_map(|plan| [plan.enter_mm_s, plan.peak_mm_s, plan.exit_mm_s].map(f64::to_bits))
                .collect::<Vec<u64>>()
        };
        assert_eq!(bits(first), bits(second));
    }
}

/// Merging keeps the length, and merging again changes nothing. The plan is hardly ever slower for it: merged blocks
/// reach a higher feed, and where a short block that accelerates follows, a higher entry is a lower exit (a ramp's
/// length is not monotone in its lower feed). Measured: one list in 20 000, by 8·10⁻⁵.
#[test]
fn merging_is_hardly_ever_slower() {
    let mut random = Random::of_stream(53);
    let (mut slower, mut slowest, mut fastest) = (0, 0.0_f64, 1.0_f64);
    for _ in 0..20_000 {
        // Runs of alike blocks.
        let mut blocks = Vec::new();
        for seed in random_blocks(&mut random, 12, 1e-3) {
            for _ in 0..=random.below(8) {
                let junction_mm_s = if random.once_in(10) { seed.junction_mm_s } else { f64::INFINITY };
                blocks.push(Block {
                    junction_mm_s,
                    length_mm: seed.length_mm * random.log(0.01, 1.0),
                    ..seed
                });
            }
        }
        let mut merged = blocks.clone();
        let count = merge_equal(&mut merged);
        merged.truncate(count);
        let mut again = merged.clone();
        assert!(merge_equal(&mut again) == merged.len() && again == merged);
        let length = |blocks: &[Block<f64>]| blocks.iter().map(|block| block.length_mm).sum::<f64>();
        assert!((length(&merged) - length(&blocks)).abs() <= 1e-14 * length(&blocks));
        let (apart, together) = (from_rest(&blocks), from_rest(&merged));
        check(&merged, 0.0, 0.0, &together);
        let (slow, fast) = (time_s(&blocks, &apart), time_s(&merged, &together));
        if slow > 0.0 {
            slower += usize::from(fast > slow * (1.0 + 1e-9));
            slowest = slowest.max(fast / slow - 1.0);
            fastest = fastest.min(fast / slow);
        }
    }
    println!(
        "merged plans take {fastest:.4} of the time at best; {slower} are slower, by {slowest:.1e} at most"
    );
    assert!(slower < 20 && slowest < 0.03, "{slower} {slowest:e}");
}

/// Linear work: a million blocks are planned, and so is a million of them that brake.
#[test]
fn a_million_blocks() {
    let mut random = Random::of_stream(54);
    let blocks: Vec<Block<f64>> = (0..1_000_000)
        .map(|_| Block {
            length_mm: random.log(1e-3, 1.0),
            cap_mm_s: random.log(1.0, 200.0),
            junction_mm_s: f64::INFINITY,
            law: reference(),
        })
        .collect();
    check(&blocks, 0.0, 0.0, &from_rest(&blocks));
}
