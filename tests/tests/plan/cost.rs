//! What planning takes: memory from sizes, time beside a loop of the law's own work in the same run.

use std::hint::black_box;
use std::time::Instant;

use motion_kernel::law::{Law, Limits, Ramp};
use motion_kernel::plan::{Block, Node, nodes_for, plan_spanning};

use crate::lists::{block, lists, reference};
use crate::support::Random;

/// What the caller provides for a list of blocks, a block \[bytes\].
const MEMORY_MAX: usize = 300;

#[test]
fn memory_of_a_million_blocks() {
    let blocks = 1_000_000;
    let bytes = blocks * size_of::<Block<f64>>() + nodes_for(blocks) * size_of::<Node>();
    println!("{} bytes a block", bytes as f64 / blocks as f64);
    assert!(bytes <= MEMORY_MAX * blocks);
}

/// Time of a call \[s\].
fn time_s(call: impl FnOnce()) -> f64 {
    let start = Instant::now();
    call();
    start.elapsed().as_secs_f64()
}

/// The time of planning a list, in ramps of the law over random changes of feed: both take turns and about as long, so that
/// a machine that slows down slows both. The median of some rounds.
fn ramps(blocks: &[Block<f64>]) -> f64 {
    let mut random = Random::new(51);
    let law = reference();
    let feeds: Vec<[f64; 2]> =
        (0..10_000).map(|_| [random.log(1.0, 100.0), random.log(1.0, 100.0)]).collect();
    let mut places = vec![Node::EMPTY; nodes_for(blocks.len())];
    let mut planned_s = || {
        time_s(|| {
            let planned = plan_spanning(black_box(blocks), 0.0, 0.0, &mut places, &mut |_, ramp| {
                black_box(ramp);
            });
            assert!(planned.is_ok_and(|time_s| time_s.is_some()));
        })
    };
    let pass = || {
        for &[from, to] in &feeds {
            black_box(Ramp::new(&law, black_box(from), black_box(to)));
        }
    };
    let passes = 1 + (planned_s() / time_s(pass)) as usize;
    let mut rounds: Vec<f64> = (0..7)
        .map(|_| planned_s() / time_s(|| (0..passes).for_each(|_| pass())) * (passes * feeds.len()) as f64)
        .collect();
    rounds.sort_by(f64::total_cmp);
    rounds[3]
}

#[test]
fn a_block_costs_some_ramps() {
    let costs: Vec<(&str, f64)> =
        lists(10_000).iter().map(|(name, blocks)| (*name, ramps(blocks) / blocks.len() as f64)).collect();
    for (name, ramps) in &costs {
        println!("{name}: {ramps:.1} ramps a block");
    }
    let (name, worst) =
        costs.into_iter().fold(("", 0.0_f64), |worst, cost| if cost.1 > worst.1 { cost } else { worst });
    assert!(worst < RAMPS_MAX, "{name}: {worst}");
}

/// What the dearest list takes, one of mixed laws, is about two thirds of it: room for other compilers and machines.
const RAMPS_MAX: f64 = 800.0;

/// Every block with a law of its own, in humps of thousands of blocks: looking up what a ramp may use does not make them
/// dearer than one law for all.
#[test]
fn many_laws_in_a_hump_cost_little_more() {
    let count = 40_000;
    let hump = |is_mixed: bool| -> Vec<Block<f64>> {
        let mut random = Random::new(53);
        (0..count)
            .map(|n| {
                let accel_mm_s2 = 500.0 + random.unit() * f64::from(u8::from(is_mixed));
                let law = Law::new(Limits { accel_mm_s2, ..reference().limits() }).expect("positive");
                Block { law, ..block(0.002, 5.0 + 60.0 * (f64::from(n % 20_000) / 1e4 - 1.0).abs()) }
            })
            .collect()
    };
    let costs = [false, true].map(|is_mixed| ramps(&hump(is_mixed)) / f64::from(count));
    println!("{costs:?} ramps a block");
    assert!(costs[1] < LAWS_MAX * costs[0], "{costs:?}");
}
const LAWS_MAX: f64 = 1.5;
