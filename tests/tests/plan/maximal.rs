//! No feasible plan has every junction feed at least as high and one of them higher: brute force over a grid.
//!
//! The plan is *not* claimed to be the fastest, and a single junction's feed can be a local bottleneck that a lower
//! feed elsewhere would widen (a ramp's length is not monotone in its lower feed); that is no contradiction.

use super::{from_rest, planned, random_blocks};
use motion_kernel::plan::{Block, BlockPlan};
use motion_tests::random::Random;

/// The smallest raise looked at, relative. The kernel's own rounding is far below it.
const RAISE: f64 = 1e-6;
/// A block may be this much too short for a ramp and still count as feasible.
const ROUNDING: f64 = 1e-10;

/// Whether a ramp fits a block, the peak aside: a plan's peak is never below its junctions.
fn fits(block: &Block<f64>, enter: f64, exit: f64) -> bool {
    block.law.ramp_length_mm(enter, exit) <= block.length_mm * (1.0 + ROUNDING)
}

/// What the junction after block `index` allows.
fn allowed(blocks: &[Block<f64>], index: usize) -> f64 {
    blocks[index].cap_mm_s.min(blocks[index].junction_mm_s).min(blocks[index + 1].cap_mm_s)
}

/// Feeds from the planned one up to what is allowed: slightly raised, in equal and in growing steps.
fn levels(random: &mut Random, planned: f64, allowed: f64, count: usize) -> Vec<f64> {
    let mut levels = vec![planned];
    let raised = planned.max(1e-6) * (1.0 + RAISE);
    if raised <= allowed {
        levels.extend([raised, allowed]);
        for step in 1..count {
            levels.push(raised + (allowed - raised) * step as f64 / count as f64);
            levels.push(random.log(raised, allowed.max(raised * (1.0 + 1e-12))));
        }
    }
    levels
}

/// Whether some way through the grid keeps every length and is raised somewhere. All combinations are looked at:
/// of the ways to a level it only matters whether one of them is raised.
fn dominated(blocks: &[Block<f64>], start: f64, end: f64, grid: &[Vec<f64>]) -> bool {
    // (feed, reachable as planned, reachable with a raise)
    let mut before = vec![(start, true, false)];
    for (index, block) in blocks.iter().enumerate() {
        let last = vec![end];
        let feeds = grid.get(index).unwrap_or(&last);
        before = feeds
            .iter()
            .enumerate()
            .map(|(level, &feed)| {
                let mut ways = before.iter().filter(|(enter, _, _)| fits(block, *enter, feed));
                let (mut plain, mut raised) = (false, false);
                for &(_, was_plain, was_raised) in &mut ways {
                    if level == 0 {
                        plain |= was_plain;
                        raised |= was_raised;
                    } else {
                        raised |= was_plain || was_raised;
                    }
                }
                (feed, plain, raised)
            })
            .collect();
    }
    assert!(before[0].1, "the plan itself must be feasible");
    before[0].2
}

fn check(
    random: &mut Random,
    blocks: &[Block<f64>],
    start: f64,
    end: f64,
    plans: &[BlockPlan<f64>],
    count: usize,
) -> bool {
    let junctions = plans.len() - 1;
    let grid: Vec<Vec<f64>> = (0..junctions)
        .map(|index| levels(random, plans[index].exit_mm_s, allowed(blocks, index), count))
        .collect();
    assert!(!dominated(blocks, start, end, &grid), "a better plan than {plans:?} for {blocks:?}");
    grid.iter().any(|levels| levels.len() > 1)
}

#[test]
fn no_plan_of_the_grid_is_better_at_every_junction() {
    let mut random = Random::of_stream(60);
    let mut could_be_raised = 0;
    for _ in 0..6000 {
        let mut blocks = random_blocks(&mut random, 3, 1e-1);
        blocks.extend(random_blocks(&mut random, 2, 1e-1));
        let plans = from_rest(&blocks);
        could_be_raised += usize::from(check(&mut random, &blocks, 0.0, 0.0, &plans, 30));
    }
    assert!(could_be_raised > 1000, "{could_be_raised}");
}

/// Longer lists, coarser grids, between feeds.
#[test]
fn nor_for_longer_lists() {
    let mut random = Random::of_stream(61);
    let mut could_be_raised = 0;
    for _ in 0..2000 {
        let blocks = random_blocks(&mut random, 40, 1e-2);
        let (start, end) =
            (blocks[0].cap_mm_s * random.unit(), blocks[blocks.len() - 1].cap_mm_s * random.unit());
        if let Ok(plans) = planned(&blocks, start, end) {
            could_be_raised += usize::from(check(&mut random, &blocks, start, end, &plans, 6));
        }
    }
    assert!(could_be_raised > 500, "{could_be_raised}");
}

/// One junction, or several at random, raised by a little or by much: some block is too short.
#[test]
fn nothing_can_be_raised() {
    let mut random = Random::of_stream(62);
    let mut tried = 0_u32;
    for _ in 0..5000 {
        let blocks = random_blocks(&mut random, 20, 1e-2);
        let plans = from_rest(&blocks);
        let junctions = blocks.len() - 1;
        for attempt in 0..junctions * 4 {
            let mut feeds: Vec<f64> = plans.iter().map(|plan| plan.exit_mm_s).collect();
            let mut raised = false;
            for (junction, feed) in feeds.iter_mut().enumerate().take(junctions) {
                let chosen = if attempt < junctions { junction == attempt } else { random.once_in(3) };
                let higher = *feed * (1.0 + random.log(RAISE, 1.0));
                if chosen && higher > *feed && higher <= allowed(&blocks, junction) {
                    (*feed, raised) = (higher, true);
                }
            }
            if !raised {
                continue;
            }
            tried += 1;
            let mut enter = 0.0;
            let feasible = blocks
                .iter()
                .zip(&feeds)
                .all(|(block, &exit)| fits(block, std::mem::replace(&mut enter, exit), exit));
            assert!(!feasible, "{feeds:?} is feasible, better than {plans:?}, for {blocks:?}");
        }
    }
    assert!(tried > 10_000, "{tried}");
}

/// Every block's peak is the highest there is room for: at its ceiling, or it fills its length.
#[test]
fn peaks_use_the_length() {
    let mut random = Random::of_stream(63);
    for _ in 0..5000 {
        let blocks = random_blocks(&mut random, 20, 1e-2);
        for (block, plan) in blocks.iter().zip(from_rest(&blocks)).filter(|(block, _)| block.length_mm > 0.0)
        {
            let higher = plan.peak_mm_s * (1.0 + RAISE);
            let ramps_mm = block.law.ramp_length_mm(plan.enter_mm_s, higher)
                + block.law.ramp_length_mm(higher, plan.exit_mm_s);
            assert!(higher > block.cap_mm_s || ramps_mm > block.length_mm, "{plan:?} {block:?}");
        }
    }
}
