//! What planning takes: memory from sizes, work as the planner counts it, in evaluations of the law and visits to a ceiling.

use motion_kernel::internals::work_done;
use motion_kernel::law::{Law, Limits, Pulse};
use motion_kernel::plan::{Block, Node, nodes_for};

use super::spanning::spans;
use motion_tests::PULSES;
use motion_tests::block_lists::{block, lists, reference};
use motion_tests::random::Random;

/// What the caller provides for a list of blocks, a block \[bytes\].
const MEMORY_MAX: usize = 300;

#[test]
fn memory_of_a_million_blocks() {
    let blocks = 1_000_000;
    let bytes = blocks * size_of::<Block<f64>>() + nodes_for(blocks) * size_of::<Node>();
    println!("{} bytes a block", bytes as f64 / blocks as f64);
    assert!(bytes <= MEMORY_MAX * blocks);
}

/// Steps of work to plan a list, a block.
fn steps(blocks: &[Block<f64>]) -> f64 {
    let before = work_done();
    spans(blocks);
    (work_done() - before) as f64 / blocks.len() as f64
}

#[test]
fn a_block_costs_a_bounded_number_of_steps_however_long_the_list() {
    for (pulse, most) in PULSES.into_iter().zip(STEPS_MAX) {
        for ((name, short), (_, long)) in lists(pulse, 5_000).iter().zip(&lists(pulse, 20_000)) {
            let costs = [short, long].map(|blocks| steps(blocks));
            let name = format!("{name}, {}", pulse.name());
            println!("{name}: {costs:.1?} steps a block");
            assert!(costs.iter().all(|&steps| steps > 0.0 && steps < most), "{name}: {costs:?}");
        }
    }
}

/// With sin² pulses and with plateaus. What the dearest list takes, one of mixed laws, is about nine tenths of it.
const STEPS_MAX: [f64; 2] = [140.0, 105.0];

/// Every block has a law of its own, in intervals of thousands of blocks: looking up what a ramp may use does not make them
/// dearer than one law for all.
#[test]
fn many_laws_in_an_interval_cost_little_more() {
    for pulse in PULSES {
        let costs = [false, true].map(|is_mixed| steps(&interval(pulse, is_mixed)));
        println!("{}: {costs:?} steps a block", pulse.name());
        assert!(costs[1] < LAWS_MAX * costs[0], "{}: {costs:?}", pulse.name());
    }
}

fn interval(pulse: Pulse, is_mixed: bool) -> Vec<Block<f64>> {
    let count = 40_000;
    let mut random = Random::of_stream(53);
    let of = |n: u32| {
        let accel_mm_s2 = 500.0 + random.unit() * f64::from(u8::from(is_mixed));
        let law = Law::new(pulse, Limits { accel_mm_s2, ..reference(pulse).limits() }).expect("positive");
        Block { law, ..block(pulse, 0.002, 5.0 + 60.0 * (f64::from(n % 20_000) / 1e4 - 1.0).abs()) }
    };
    (0..count).map(of).collect()
}

/// 1.13 with either law.
const LAWS_MAX: f64 = 1.25;
