//! The feed plan from outside: random lists of blocks against what a plan promises, brute force against its
//! maximality, and the named cases.

#![allow(clippy::float_cmp, reason = "exact values are the point")]

mod cases;
mod cost;
mod executed;
mod feasible;
mod fixed;
mod maximal;
mod planner;
mod refusals;
mod segments;
mod spanning;

use motion_kernel::law::{Law, Limits, Pulse};
use motion_kernel::plan::{Block, BlockPlan, PlanError, plan};
use motion_tests::block_lists;
use motion_tests::random::Random;

/// S1's law and limits: named cases are of it.
fn reference() -> Law<f64> {
    block_lists::reference(Pulse::Sin2)
}

/// A block of that law that stops at neither end.
fn block(length_mm: f64, cap_mm_s: f64) -> Block<f64> {
    block_lists::block(Pulse::Sin2, length_mm, cap_mm_s)
}

/// The sin² law for acceleration, jerk and snap limits.
fn law(accel_mm_s2: f64, jerk_mm_s3: f64, snap_mm_s4: f64) -> Law<f64> {
    Law::new(Pulse::Sin2, Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 }).expect("positive")
}

/// S1's limits first, each with sin² pulses and with plateaus.
fn laws() -> [Law<f64>; 12] {
    let sets = [
        reference(),
        law(5e3, 1e5, 5e6),
        law(12_500.0, 1e6, 1e8),
        law(500.0, 1e5, 4e5),
        law(100.0, 100.0, 1e4),
        law(1.0, 1e4, 1e8),
    ];
    core::array::from_fn(|n| {
        let pulse = if n % 2 == 0 { Pulse::Sin2 } else { Pulse::Plateau };
        Law::new(pulse, sets[n / 2].limits()).expect("positive")
    })
}

/// The plan from rest to rest, or between the feeds.
fn planned(blocks: &[Block<f64>], start: f64, end: f64) -> Result<Vec<BlockPlan<f64>>, PlanError> {
    let mut plans = vec![BlockPlan::default(); blocks.len()];
    plan(blocks, start, end, &mut plans).map(|()| plans)
}

fn from_rest(blocks: &[Block<f64>]) -> Vec<BlockPlan<f64>> {
    planned(blocks, 0.0, 0.0).expect("a plan")
}

/// The duration of one planned block \[s\].
fn block_time_s(block: &Block<f64>, plan: &BlockPlan<f64>) -> f64 {
    if block.length_mm <= 0.0 {
        return 0.0;
    }
    let BlockPlan { enter_mm_s, peak_mm_s, exit_mm_s } = *plan;
    let ramps_mm =
        block.law.ramp_length_mm(enter_mm_s, peak_mm_s) + block.law.ramp_length_mm(peak_mm_s, exit_mm_s);
    block.law.ramp_time_s(peak_mm_s - enter_mm_s)
        + block.law.ramp_time_s(peak_mm_s - exit_mm_s)
        + (block.length_mm - ramps_mm).max(0.0) / peak_mm_s
}

fn time_s(blocks: &[Block<f64>], plans: &[BlockPlan<f64>]) -> f64 {
    blocks.iter().zip(plans).map(|(block, plan)| block_time_s(block, plan)).sum()
}

/// A list of 1 to `most` blocks: lengths from `shortest_mm` to 1 m, some 0, feeds from 10⁻² to 10³ mm/s, junctions
/// that stop, slow or do neither.
fn random_blocks(random: &mut Random, most: usize, shortest_mm: f64) -> Vec<Block<f64>> {
    let laws = laws();
    let same_law = random.once_in(2).then(|| *random.pick(&laws));
    let count = 1 + random.below(most);
    (0..count)
        .map(|_| Block {
            length_mm: if random.once_in(20) { 0.0 } else { random.log(shortest_mm, 1e3) },
            cap_mm_s: random.log(1e-2, 1e3),
            junction_mm_s: match random.below(10) {
                0 => 0.0,
                1..=3 => random.log(1e-2, 1e3),
                _ => f64::INFINITY,
            },
            law: same_law.unwrap_or_else(|| *random.pick(&laws)),
        })
        .collect()
}
