//! Lists of blocks by which the cost of planning is measured: from those that cost nothing to those where every ceiling is in the way.

use motion_kernel::law::{Law, Limits, Pulse};
use motion_kernel::plan::Block;

use crate::random::Random;

/// S1's limits, and pulses of this shape.
pub fn reference(pulse: Pulse) -> Law<f64> {
    law(pulse, Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 })
}

fn law(pulse: Pulse, limits: Limits<f64>) -> Law<f64> {
    Law::new(pulse, limits).expect("positive")
}

/// A block of the reference law that stops at neither end.
pub fn block(pulse: Pulse, length_mm: f64, cap_mm_s: f64) -> Block<f64> {
    Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law: reference(pulse) }
}

/// The lists, of `count` blocks each with pulses of this shape, with their names.
pub fn lists(pulse: Pulse, count: usize) -> Vec<(&'static str, Vec<Block<f64>>)> {
    let block = |length_mm, cap_mm_s| block(pulse, length_mm, cap_mm_s);
    let mut random = Random::of_stream(52);
    let mut walk = |length_mm: f64| {
        let mut feed: f64 = 50.0;
        let mut list = Vec::with_capacity(count);
        for _ in 0..count {
            feed = (feed * random.log(0.8, 1.25)).clamp(5.0, 90.0);
            list.push(block(length_mm, feed));
        }
        list
    };
    let [walk_short, walk_middle, walk_long] = [0.1, 1.0, 10.0].map(&mut walk);
    let mut feeds = |length_mm: f64| -> Vec<Block<f64>> {
        (0..count).map(|_| block(length_mm, 20.0 + 60.0 * random.log(0.01, 1.0))).collect()
    };
    let [feeds_shortest, feeds_short, feeds_middle, feeds_long] = [0.1, 1.0, 3.0, 10.0].map(&mut feeds);
    let saw: Vec<_> = (0..count).map(|n| block(5.0, 5.0 + 8.0 * (n % 10) as f64)).collect();
    // Every block with limits of its own.
    let mut mixed = |blocks: &[Block<f64>]| -> Vec<Block<f64>> {
        let mut limit = |least: f64| least * (1.0 + random.unit());
        let mut any = || {
            law(pulse, Limits { accel_mm_s2: limit(500.0), jerk_mm_s3: limit(5e3), snap_mm_s4: limit(4e5) })
        };
        blocks.iter().map(|block| Block { law: any(), ..*block }).collect()
    };
    let [mixed_feeds, mixed_walk, mixed_saw] = [&feeds_short, &walk_middle, &saw].map(|list| mixed(list));
    vec![
        ("equal", vec![block(0.1, 80.0); count]),
        ("alternating 0.1 mm", (0..count).map(|n| block(0.1, [80.0, 40.0][n % 2])).collect()),
        ("saw-tooth 0.5 mm", (0..count).map(|n| block(0.5, 5.0 + 8.0 * (n % 10) as f64)).collect()),
        ("saw-tooth 5 mm", saw),
        ("steps", (0..count).map(|n| block(1.0, 20.0 + 0.36 * (n % 500) as f64)).collect()),
        ("steps up", (0..count).map(|n| block(1.0, 1.0 + 79.0 * n as f64 / count as f64)).collect()),
        ("random feeds 0.1 mm", feeds_shortest),
        ("random feeds 1 mm", feeds_short),
        ("random feeds 3 mm", feeds_middle),
        ("random feeds 10 mm", feeds_long),
        ("random walk 0.1 mm", walk_short),
        ("random walk 1 mm", walk_middle),
        ("random walk 10 mm", walk_long),
        ("random feeds 1 mm, mixed laws", mixed_feeds),
        ("random walk 1 mm, mixed laws", mixed_walk),
        ("saw-tooth 5 mm, mixed laws", mixed_saw),
    ]
}
