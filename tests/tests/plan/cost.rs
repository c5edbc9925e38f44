//! What planning takes: memory from sizes, time beside a loop of the law's own work in the same run.

use std::hint::black_box;
use std::time::Instant;

use motion_kernel::law::{Law, Limits, Ramp};
use motion_kernel::plan::{Block, Node, nodes_for, plan_spanning};

use crate::support::Random;
use crate::{block, reference};

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
            let planned = plan_spanning(black_box(blocks), 0.0, 0.0, &mut places, &mut |span| {
                black_box(span);
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
    let mut random = Random::new(52);
    let count = 10_000;
    let mut walk = |length_mm: f64| {
        let mut feed: f64 = 50.0;
        let mut list = Vec::new();
        for _ in 0..count {
            feed = (feed * random.log(0.8, 1.25)).clamp(5.0, 90.0);
            list.push(block(length_mm, feed));
        }
        list
    };
    let walks = [0.1, 1.0, 10.0].map(&mut walk);
    let [walk_short, walk_middle, walk_long] = walks;
    let mut feeds = |length_mm: f64| -> Vec<Block<f64>> {
        (0..count).map(|_| block(length_mm, 20.0 + 60.0 * random.log(0.01, 1.0))).collect()
    };
    let [feeds_short, feeds_middle, feeds_long] = [0.1, 1.0, 3.0].map(&mut feeds);
    let saw: Vec<_> = (0..count).map(|n| block(5.0, 5.0 + 8.0 * (n % 10) as f64)).collect();
    // Every block with limits of its own.
    let mut mixed = |blocks: &[Block<f64>]| -> Vec<Block<f64>> {
        let mut limit = |least: f64| least * (1.0 + random.unit());
        let mut law = || Limits { accel_mm_s2: limit(500.0), jerk_mm_s3: limit(5e3), snap_mm_s4: limit(4e5) };
        blocks.iter().map(|block| Block { law: Law::new(law()).expect("positive"), ..*block }).collect()
    };
    let [mixed_feeds, mixed_walk, mixed_saw] = [&feeds_middle, &walk_middle, &saw].map(|list| mixed(list));
    let lists = [
        ("equal", vec![block(0.1, 80.0); count]),
        ("alternating", (0..count).map(|n| block(0.1, [80.0, 40.0][n % 2])).collect()),
        ("saw-tooth 0.5 mm", (0..count).map(|n| block(0.5, 5.0 + 8.0 * (n % 10) as f64)).collect()),
        ("saw-tooth 5 mm", saw),
        ("stairs", (0..count).map(|n| block(1.0, 20.0 + 0.36 * (n % 500) as f64)).collect()),
        ("stairs up", (0..count).map(|n| block(1.0, 1.0 + 79.0 * n as f64 / count as f64)).collect()),
        ("random feeds 0.1 mm", feeds_short),
        ("random feeds 1 mm", feeds_middle),
        ("random feeds 3 mm", feeds_long),
        ("random walk 0.1 mm", walk_short),
        ("random walk 1 mm", walk_middle),
        ("random walk 10 mm", walk_long),
        ("random feeds 1 mm, mixed laws", mixed_feeds),
        ("random walk 1 mm, mixed laws", mixed_walk),
        ("saw-tooth 5 mm, mixed laws", mixed_saw),
    ];
    let costs = lists.map(|(name, blocks)| (name, ramps(&blocks) / blocks.len() as f64));
    for (name, ramps) in costs {
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
