//! What planning a million blocks takes with ramps that span them, a block.
//!
//! ```text
//! cargo bench -p motion-tests --bench plan
//! ```
//!
//! Every list of `tests/plan`'s cost is planned some times with either law, in turns with a loop that makes ramps with
//! sin² pulses between random feeds. The table gives the least processor time a block, and the median over the rounds of that time in ramps,
//! which tells planners apart on machines that are not equally fast or have other work to do. Processor time is read
//! from the scheduler's own count where there is one (Linux, to some 4 ms), else it is the time on the clock. A name, or a
//! part of one, selects lists.

use std::hint::black_box;
use std::time::Instant;

use motion_kernel::law::{Pulse, Ramp};
use motion_kernel::plan::{Block, Node, nodes_for, plan_spanning};

use motion_tests::PULSES;
use motion_tests::bench;
use motion_tests::block_lists::{lists, reference};
use motion_tests::random::Random;

const BLOCKS: usize = 1_000_000;
const ROUNDS: usize = 5;
/// Some 0.2 s.
const RAMPS: usize = 4_000_000;

fn main() {
    let Some(asked) = bench::asked() else { return };
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|part| name.contains(part.as_str()));
    let mut places = vec![Node::EMPTY; nodes_for(BLOCKS)];
    let feeds = feeds();
    println!("| {BLOCKS} blocks | µs a block | ramps a block |");
    println!("|---|---:|---:|");
    let mut ramp_s = f64::INFINITY;
    for pulse in PULSES {
        let law = pulse.name();
        // Lists of a million blocks: one law's are gone before the other's are made.
        for (name, blocks) in lists(pulse, BLOCKS).into_iter().filter(|list| is_asked(list.0)) {
            let rounds =
                [(); ROUNDS].map(|()| (planned_s(&blocks, &mut places), ramps_s(&feeds) / RAMPS as f64));
            let least_s = rounds.iter().map(|round| round.0).fold(f64::INFINITY, f64::min);
            ramp_s = rounds.iter().map(|round| round.1).fold(ramp_s, f64::min);
            let mut ratios = rounds.map(|(planned_s, ramp_s)| planned_s / ramp_s / BLOCKS as f64);
            ratios.sort_by(f64::total_cmp);
            println!("| {name}, {law} | {:.2} | {:.1} |", least_s * 1e6 / BLOCKS as f64, ratios[ROUNDS / 2]);
        }
    }
    println!("\nA ramp with sin² pulses takes {:.1} ns.", ramp_s * 1e9);
}

/// The time of planning a list \[s\].
fn planned_s(blocks: &[Block<f64>], places: &mut [Node]) -> f64 {
    time_s(|| {
        let planned = plan_spanning(black_box(blocks), 0.0, 0.0, places, &mut |start_mm, ramp| {
            black_box((start_mm, ramp));
        });
        assert!(planned.is_ok_and(|time_s| time_s.is_some()), "no plan");
    })
}

fn feeds() -> Vec<[f64; 2]> {
    let mut random = Random::of_stream(51);
    (0..10_000).map(|_| [random.log(1.0, 100.0), random.log(1.0, 100.0)]).collect()
}

/// The time of the yardstick \[s\].
fn ramps_s(feeds: &[[f64; 2]]) -> f64 {
    let law = reference(Pulse::Sin2);
    time_s(|| {
        for &[from, to] in feeds.iter().cycle().take(RAMPS) {
            black_box(Ramp::new(&law, black_box(from), black_box(to)));
        }
    })
}

/// Processor time of a call \[s\].
fn time_s(call: impl FnOnce()) -> f64 {
    let processor_s = || {
        let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(counted.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
    };
    let (before, start) = (processor_s(), Instant::now());
    call();
    let clock_s = start.elapsed().as_secs_f64();
    before.and_then(|before| Some(processor_s()? - before)).unwrap_or(clock_s)
}
