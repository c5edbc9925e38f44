//! The kernel timed beside its nearest peers, in one process: rsruckig 3 (Rust) and ruckig 0.19 (the
//! C++ original, through its own crate).
//!
//! ```text
//! cargo bench --manifest-path tests/peers/Cargo.toml
//! ```
//!
//! needs a C++20 compiler, for ruckig. That is why this is a package outside the root's workspace:
//! everything the root builds or tests needs a Rust toolchain and nothing else.
//!
//! What is compared:
//!
//! - **evaluation**: feed, acceleration, jerk, snap and length of one axis at one instant, beside
//!   `at_time` of one degree of freedom (position, velocity, acceleration; with rsruckig jerk too).
//!   Both evaluate the same random blocks, from rest or from a feed to another over a length, at
//!   the same parts of their duration: at random, and in time order every 0.5 ms. The peers search
//!   for the section of the trajectory in every call; the executor keeps it, so the row *tick* has
//!   everything: clock, streams, law, path and the axis' set-point.
//! - **solving**: [`reach`], [`peak`] and [`Ramp::new`], and all that a block takes (peak feed and two
//!   ramps), beside one `calculate` of the same blocks. The peers solve for time-optimal constant
//!   jerk from any state to any other, which is more than a block needs; the law here bounds snap
//!   as well.
//! - **planning**: the two-stage look-ahead over 10 000 blocks. No peer plans many blocks.
//!
//! Conditions: all inputs are drawn beforehand from one seed; nothing is allocated in a timed part
//! except inside ruckig's crate, which returns vectors: `at_time` makes six in a call, timed
//! in a row of their own. Criterion gives each figure by itself. The table after it is what counts:
//! the contenders take turns in many short rounds, and a ratio is the median over the rounds of the
//! ratio within a round, so that a machine that slows down slows both sides. The process
//! fails if a requirement is missed. Names on the command line select among criterion's figures;
//! as a test (`--test`, or without `--bench`) everything runs once, and no times are compared.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::Criterion;
use motion_kernel::exec::Executor;
use motion_kernel::internals::{Phase, merge_equal, peak};
use motion_kernel::law::{FeedSegment, Law, Limits, Pulse, Ramp, Ticks, reach};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::plan::{Block, BlockPlan, Node, nodes_for, plan, plan_spanning, ramps};
use motion_kernel::queue::{Feeder, PathRules, Streams};
use motion_kernel::units::Position;
use rsruckig::prelude::{DataArrayOrVec, InputParameter, ThrowErrorHandler, Trajectory};

/// Calls in one timed part.
const CALLS: usize = 4096;
/// Rounds of the table, after those that warm up.
const ROUNDS: usize = 301;
const ROUNDS_WARM_UP: usize = 20;
/// Different blocks evaluated; their segments and the peers' trajectories fit in the second-level
/// cache, as a machine's queue does.
const BLOCKS: usize = 64;
/// Blocks planned at once.
const BLOCKS_PLANNED: usize = 10_000;
/// The control tick.
const TICK_S: f64 = 0.0005;

/// One side of a comparison: times one part of `calls` calls.
struct Contender {
    name: &'static str,
    calls: usize,
    run: Box<dyn FnMut() -> Duration>,
}

/// A row of the table: two contenders by name.
struct Row {
    ours: &'static str,
    peer: &'static str,
    required: Requirement,
}

enum Requirement {
    None,
    RatioMax(f64),
}

fn main() {
    // As criterion tells it.
    let has = |option: &str| std::env::args().any(|word| word == option);
    let is_test = has("--test") || !has("--bench");
    let mut contenders = contenders();
    let mut criterion = Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600))
        .configure_from_args();
    for contender in &mut contenders {
        criterion.bench_function(contender.name, |bencher| {
            bencher.iter_custom(|parts| {
                let total: Duration = (0..parts).map(|_| (contender.run)()).sum();
                total.div_f64(contender.calls as f64)
            });
        });
    }
    criterion.final_summary();
    if is_test {
        let is_known = |name: &str| contenders.iter().any(|contender| contender.name == name);
        assert!(rows().iter().all(|row| is_known(row.ours) && is_known(row.peer)), "a row of no contender");
    } else if !table(&rows(), &times_ns(&mut contenders)) {
        std::process::exit(1);
    }
}

fn rows() -> Vec<Row> {
    use Requirement::{None as Free, RatioMax};
    let row = |ours, peer, required| Row { ours, peer, required };
    vec![
        row("evaluation f32, random", "rsruckig at_time, random", RatioMax(1.0)),
        row("evaluation f64, random", "rsruckig at_time, random", Free),
        row("evaluation f32, ramps only", "rsruckig at_time, random", Free),
        row("evaluation f32, in order", "rsruckig at_time, in order", RatioMax(1.0)),
        row("evaluation f64, in order", "rsruckig at_time, in order", Free),
        row("tick f32, one axis", "rsruckig at_time, in order", Free),
        row("tick f64, one axis", "rsruckig at_time, in order", Free),
        row("evaluation f32, random", "ruckig at_time, random", Free),
        row("evaluation f32, random", "six vectors of ruckig's", Free),
        row("reach", "rsruckig calculate", RatioMax(1.0 / 3.0)),
        row("peak", "rsruckig calculate", Free),
        row("ramp", "rsruckig calculate", Free),
        row("block: peak and two ramps", "rsruckig calculate", Free),
        row("block: peak and two ramps", "ruckig calculate", Free),
        // With room: from one machine to another the ratio goes from 0.65 to 0.93.
        row("plan, a block", "rsruckig calculate", RatioMax(1.5)),
        row("merge and plan, a block", "rsruckig calculate", RatioMax(0.5)),
    ]
}

/// The times of all contenders in all rounds, taking turns \[ns per call\].
fn times_ns(contenders: &mut [Contender]) -> Vec<(&'static str, Vec<f64>)> {
    let mut times: Vec<_> = contenders.iter().map(|c| (c.name, Vec::with_capacity(ROUNDS))).collect();
    for round in 0..ROUNDS_WARM_UP + ROUNDS {
        for (contender, (_, times)) in contenders.iter_mut().zip(&mut times) {
            let ns = (contender.run)().as_secs_f64() * 1e9 / contender.calls as f64;
            if round >= ROUNDS_WARM_UP {
                times.push(ns);
            }
        }
    }
    times
}

/// Prints the table; false if a requirement is missed.
fn table(rows: &[Row], times: &[(&'static str, Vec<f64>)]) -> bool {
    let of = |name| {
        let found = times.iter().find(|(contender, _)| *contender == name);
        &found.expect("a row names contenders that exist").1
    };
    println!("\nmedians of {ROUNDS} rounds; a ratio is the median of the ratios within the rounds\n");
    println!("| ours | ns | peer | ns | ratio | required |");
    println!("|---|---|---|---|---|---|");
    let mut kept = true;
    for row in rows {
        let ours = of(row.ours);
        let ours_ns = median(ours.iter().copied());
        let peer = of(row.peer);
        let peer_ns = median(peer.iter().copied());
        let ratio = median(ours.iter().zip(peer).map(|(ours, peer)| ours / peer));
        let (required, good) = match row.required {
            Requirement::RatioMax(most) => (format!("ratio ≤ {most:.2}"), ratio <= most),
            Requirement::None => (String::from("–"), true),
        };
        kept &= good;
        let verdict = if good { "" } else { ", missed" };
        println!(
            "| {:<26} | {ours_ns:6.1} | {:<26} | {peer_ns:6.1} | {ratio:5.2} | {required}{verdict} |",
            row.ours, row.peer
        );
    }
    kept
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// One timed part: `call` on every input, its result kept from the optimiser.
fn timed<I: Copy, O>(inputs: &[I], mut call: impl FnMut(I) -> O) -> Duration {
    let start = Instant::now();
    for &input in black_box(inputs) {
        black_box(call(input));
    }
    start.elapsed()
}

fn contenders() -> Vec<Contender> {
    let mut all = Vec::new();
    let mut random = Random(1);
    let blocks: Vec<Motion> = (0..BLOCKS).map(|_| Motion::random(&mut random)).collect();
    let at_random: Vec<(usize, f64)> = (0..CALLS).map(|_| (random.below(BLOCKS), random.unit())).collect();
    evaluations(&mut all, &blocks, &at_random);
    ticks::<f32>(&mut all, "tick f32, one axis");
    ticks::<f64>(&mut all, "tick f64, one axis");
    peers_evaluations(&mut all, &blocks, &at_random);
    solves(&mut all, &mut random);
    plans(&mut all, &mut random);
    all
}

/// A block by itself: a state-to-state motion of one axis.
#[derive(Clone, Copy)]
struct Motion {
    block: Block<f64>,
    plan: BlockPlan<f64>,
}

impl Motion {
    /// Feasible for the law, hence for the peers' constant jerk.
    fn random(random: &mut Random) -> Self {
        loop {
            let law = law(random);
            let (length_mm, cap_mm_s) = (random.log(0.1, 500.0), random.log(10.0, 500.0));
            let mut feed = || if random.unit() < 0.25 { 0.0 } else { cap_mm_s * random.unit() };
            let (enter_mm_s, exit_mm_s) = (feed(), feed());
            if law.ramp_length_mm(enter_mm_s, exit_mm_s) < length_mm {
                let peak_mm_s = peak(&law, enter_mm_s, exit_mm_s, length_mm).min(cap_mm_s);
                return Self {
                    block: Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law },
                    plan: BlockPlan { enter_mm_s, peak_mm_s, exit_mm_s },
                };
            }
        }
    }

    fn segments<R: Real>(&self) -> Vec<FeedSegment<R>> {
        let end = Position::from_mm(self.block.length_mm).expect("in range");
        let made = ramps(&self.block, &self.plan, Position::ZERO, end, TICK_S).expect("in range");
        made.into_iter().flatten().map(|ramp| ramp.segment(TICK_S).expect("in range")).collect()
    }

    fn rsruckig(&self) -> InputParameter<1> {
        let mut input = InputParameter::new(None);
        let limits = self.block.law.limits();
        input.current_velocity[0] = self.plan.enter_mm_s;
        input.target_position[0] = self.block.length_mm;
        input.target_velocity[0] = self.plan.exit_mm_s;
        input.max_velocity[0] = self.block.cap_mm_s;
        input.max_acceleration[0] = limits.accel_mm_s2;
        input.max_jerk[0] = limits.jerk_mm_s3;
        input
    }

    fn ruckig(&self) -> ruckig::InputParameter {
        let mut input = ruckig::InputParameter::new(1);
        let limits = self.block.law.limits();
        input.current_velocity[0] = self.plan.enter_mm_s;
        input.target_position[0] = self.block.length_mm;
        input.target_velocity[0] = self.plan.exit_mm_s;
        input.max_velocity[0] = self.block.cap_mm_s;
        input.max_acceleration[0] = limits.accel_mm_s2;
        input.max_jerk[0] = limits.jerk_mm_s3;
        input
    }
}

/// Which block, and the time from its start, every tick, block after block; `CALLS` of them.
fn in_order(durations_s: &[f64]) -> Vec<(usize, f64)> {
    let of_block = |(block, &duration_s): (usize, &f64)| {
        let ticks = (duration_s / TICK_S) as u32;
        (0..ticks).map(move |tick| (block, f64::from(tick) * TICK_S / duration_s))
    };
    durations_s.iter().enumerate().flat_map(of_block).take(CALLS).collect()
}

/// A segment, the phase in it, and the normalised time of the phase.
type Instance = (usize, Phase, u64);

fn evaluations(all: &mut Vec<Contender>, blocks: &[Motion], at_random: &[(usize, f64)]) {
    evaluate::<f32>(all, blocks, at_random, ["evaluation f32, random", "evaluation f32, in order"]);
    evaluate::<f64>(all, blocks, at_random, ["evaluation f64, random", "evaluation f64, in order"]);

    let mut segments: Vec<FeedSegment<f32>> = blocks.iter().flat_map(Motion::segments).collect();
    segments.retain(|segment| segment.phase_duration(Phase::Rise) > Ticks::ZERO);
    let mut random = Random(2);
    let instances: Vec<Instance> = (0..CALLS)
        .map(|_| {
            let phase = if random.unit() < 0.5 { Phase::Rise } else { Phase::Fall };
            (random.below(segments.len()), phase, random.bits())
        })
        .collect();
    all.push(Contender {
        name: "evaluation f32, ramps only",
        calls: CALLS,
        run: Box::new(move || timed(&instances, |(segment, phase, at)| segments[segment].at(phase, at))),
    });
}

fn evaluate<R: Real>(
    all: &mut Vec<Contender>,
    blocks: &[Motion],
    at_random: &[(usize, f64)],
    names: [&'static str; 2],
) {
    let mut segments: Vec<FeedSegment<R>> = Vec::new();
    let mut first = Vec::new();
    for block in blocks {
        first.push(segments.len());
        segments.extend(block.segments::<R>());
    }
    first.push(segments.len());
    let durations: Vec<f64> = first
        .windows(2)
        .map(|range| segments[range[0]..range[1]].iter().map(|s| s.duration().to_f64() * TICK_S).sum())
        .collect();
    let instance = |&(block, part): &(usize, f64)| -> Instance {
        let mut left = part * durations[block] / TICK_S;
        for (index, segment) in segments.iter().enumerate().take(first[block + 1]).skip(first[block]) {
            for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
                let ticks = segment.phase_duration(phase).to_f64();
                if left < ticks {
                    return (index, phase, (left / ticks * 18_446_744_073_709_551_616.0) as u64);
                }
                left -= ticks;
            }
        }
        (first[block + 1] - 1, Phase::Hold, u64::MAX)
    };
    let orders = [at_random.to_vec(), in_order(&durations)];
    for (name, order) in names.into_iter().zip(orders) {
        let instances: Vec<Instance> = order.iter().map(instance).collect();
        let segments = segments.clone();
        all.push(Contender {
            name,
            calls: instances.len(),
            run: Box::new(move || timed(&instances, |(segment, phase, at)| segments[segment].at(phase, at))),
        });
    }
}

const QUEUE: usize = 256;

/// The whole executor over stretches of random blocks along one axis.
fn ticks<R: Real>(all: &mut Vec<Contender>, name: &'static str) {
    let limits = Limits { accel_mm_s2: 2000.0, jerk_mm_s3: 5e4, snap_mm_s4: 4e6 };
    let law = Law::new(Pulse::Plateau, limits).expect("positive");
    let mut random = Random(3);
    let blocks: Vec<Block<f64>> = (0..40)
        .map(|_| Block {
            length_mm: random.log(1.0, 30.0),
            cap_mm_s: random.log(50.0, 300.0),
            junction_mm_s: f64::INFINITY,
            law,
        })
        .collect();
    let mut plans = vec![BlockPlan::default(); blocks.len()];
    plan(&blocks, 0.0, 0.0, &mut plans).expect("from rest to rest");
    // Feeds in the tick's number type: each a rounding above its f64.
    let rules = PathRules {
        limits: Limits { accel_mm_s2: 2001.0, jerk_mm_s3: 5.001e4, snap_mm_s4: 4.001e6 },
        feed_mm_s: 301.0,
        junction_angle_rad: 1e-3,
        junction_gap_mm: 1e-4,
    };
    let mut streams: Box<Streams<R, 1, QUEUE, QUEUE>> = Box::default();
    let rest = [Position::ZERO];
    let fill = move |feeder: &mut Feeder<'_, R, 1>| {
        let mut at = Position::ZERO;
        for (block, plan) in blocks.iter().zip(&plans) {
            let end = at + Position::from_mm(block.length_mm).expect("in range");
            for ramp in ramps(block, plan, at, end, TICK_S).expect("in range").into_iter().flatten() {
                feeder.segment(ramp.segment(TICK_S).expect("in range")).expect("continues");
            }
            // f32 holds pieces of up to 16 mm.
            let middle = Position::from_bits((at.to_bits() + end.to_bits()) / 2);
            for (from, to) in [(at, middle), (middle, end)] {
                let piece = Piece::line(1, [from], [1.0], to - from).expect("short");
                feeder.piece(piece).expect("continues");
            }
            at = end;
        }
        feeder.end_stretch([at]).expect("both streams end here");
    };
    let mut run = move || {
        *streams = Streams::new();
        let (mut feeder, mut intake) = streams.split(rules, rest);
        fill(&mut feeder);
        let mut executor = Executor::new(rest);
        let mut ticks = 0;
        let start = Instant::now();
        loop {
            let executed = black_box(executor.tick(&mut intake)).expect("fed");
            if executed.stretches > 0 {
                break;
            }
            ticks += 1;
        }
        (start.elapsed(), ticks)
    };
    let calls = run().1;
    all.push(Contender { name, calls, run: Box::new(move || run().0) });
}

fn peers_evaluations(all: &mut Vec<Contender>, blocks: &[Motion], at_random: &[(usize, f64)]) {
    let mut solver = rsruckig::prelude::Ruckig::<1, ThrowErrorHandler>::new(None, TICK_S);
    let trajectories: Vec<Trajectory<1>> = blocks
        .iter()
        .map(|block| {
            let mut trajectory = Trajectory::new(None);
            solver.calculate(&block.rsruckig(), &mut trajectory).expect("feasible");
            trajectory
        })
        .collect();
    let durations: Vec<f64> = trajectories.iter().map(Trajectory::get_duration).collect();
    let names = ["rsruckig at_time, random", "rsruckig at_time, in order"];
    for (name, order) in names.into_iter().zip([at_random.to_vec(), in_order(&durations)]) {
        let times: Vec<(usize, f64)> =
            order.iter().map(|&(block, part)| (block, part * durations[block])).collect();
        let trajectories = trajectories.clone();
        let zero = || DataArrayOrVec::<f64, 1>::new(None, 0.0);
        let (mut position, mut velocity, mut accel, mut jerk) = (zero(), zero(), zero(), zero());
        all.push(Contender {
            name,
            calls: times.len(),
            run: Box::new(move || {
                timed(&times, |(block, time_s)| {
                    trajectories[block].at_time(
                        time_s,
                        &mut Some(&mut position),
                        &mut Some(&mut velocity),
                        &mut Some(&mut accel),
                        &mut Some(&mut jerk),
                        &mut None,
                    );
                    (position[0], velocity[0], accel[0], jerk[0])
                })
            }),
        });
    }

    let mut solver = ruckig::Ruckig::new_direct_and_offline(1);
    let trajectories: Vec<ruckig::Trajectory> = blocks
        .iter()
        .map(|block| {
            let mut trajectory = ruckig::Trajectory::new_direct(1);
            let result = solver.calculate(&mut block.ruckig(), &mut trajectory);
            assert_eq!(result, ruckig::Result::Working);
            trajectory
        })
        .collect();
    let times: Vec<(usize, f64)> =
        at_random.iter().map(|&(block, part)| (block, part * trajectories[block].get_duration())).collect();
    all.push(Contender {
        name: "ruckig at_time, random",
        calls: CALLS,
        run: Box::new(move || timed(&times, |(block, time_s)| trajectories[block].at_time(time_s))),
    });
    let six = || -> [Vec<f64>; 6] { std::array::from_fn(|_| black_box(vec![0.0; black_box(1)])) };
    all.push(Contender {
        name: "six vectors of ruckig's",
        calls: CALLS,
        run: Box::new(move || timed(&[(); CALLS], |()| six())),
    });
}

fn solves(all: &mut Vec<Contender>, random: &mut Random) {
    // Over all regimes of the law: from 1 µm to 2 m, from rest or from 0.01 to 1000 mm/s.
    let inputs: Vec<(Law<f64>, f64, f64)> = (0..CALLS)
        .map(|_| {
            let lower_mm_s = if random.unit() < 0.1 { 0.0 } else { random.log(1e-2, 1e3) };
            (law(random), lower_mm_s, random.log(1e-3, 2e3))
        })
        .collect();
    all.push(Contender {
        name: "reach",
        calls: CALLS,
        run: Box::new(move || {
            timed_by_reference(&inputs, |(law, lower, length)| reach(law, *lower, *length))
        }),
    });

    let motions: Vec<Motion> = (0..CALLS).map(|_| Motion::random(random)).collect();
    let ours = motions.clone();
    all.push(Contender {
        name: "peak",
        calls: CALLS,
        run: Box::new(move || {
            timed_by_reference(&ours, |Motion { block, plan }| {
                peak(&block.law, plan.enter_mm_s, plan.exit_mm_s, block.length_mm)
            })
        }),
    });
    let ours = motions.clone();
    all.push(Contender {
        name: "ramp",
        calls: CALLS,
        run: Box::new(move || {
            timed_by_reference(&ours, |Motion { block, plan }| {
                Ramp::new(&block.law, plan.enter_mm_s, plan.exit_mm_s)
            })
        }),
    });
    let ours = motions.clone();
    all.push(Contender {
        name: "block: peak and two ramps",
        calls: CALLS,
        run: Box::new(move || {
            timed_by_reference(&ours, |Motion { block, plan }| {
                let highest = peak(&block.law, plan.enter_mm_s, plan.exit_mm_s, block.length_mm);
                let feed = highest.min(block.cap_mm_s);
                let rise = Ramp::new(&block.law, plan.enter_mm_s, feed);
                let fall = Ramp::new(&block.law, feed, plan.exit_mm_s);
                (rise, (block.length_mm - rise.length_mm() - fall.length_mm()) / feed, fall)
            })
        }),
    });

    let inputs: Vec<InputParameter<1>> = motions.iter().map(Motion::rsruckig).collect();
    let mut solver = rsruckig::prelude::Ruckig::<1, ThrowErrorHandler>::new(None, TICK_S);
    let mut trajectory = Trajectory::new(None);
    all.push(Contender {
        name: "rsruckig calculate",
        calls: CALLS,
        run: Box::new(move || {
            timed_by_reference(&inputs, |input| {
                solver.calculate(input, &mut trajectory).expect("feasible");
                black_box(&trajectory);
            })
        }),
    });
    let mut inputs: Vec<ruckig::InputParameter> = motions.iter().map(Motion::ruckig).collect();
    let mut solver = ruckig::Ruckig::new_direct_and_offline(1);
    let mut trajectory = ruckig::Trajectory::new_direct(1);
    all.push(Contender {
        name: "ruckig calculate",
        calls: CALLS,
        run: Box::new(move || {
            let start = Instant::now();
            for input in black_box(&mut inputs) {
                black_box(solver.calculate(input, &mut trajectory));
            }
            start.elapsed()
        }),
    });
}

/// As [`timed`], for inputs that a caller has in place.
fn timed_by_reference<I, O>(inputs: &[I], mut call: impl FnMut(&I) -> O) -> Duration {
    let start = Instant::now();
    for input in black_box(inputs) {
        black_box(call(input));
    }
    start.elapsed()
}

fn plans(all: &mut Vec<Contender>, random: &mut Random) {
    let law = law(random);
    let mut block = |cap_mm_s| Block {
        length_mm: random.log(0.05, 20.0),
        cap_mm_s,
        junction_mm_s: if random.unit() < 0.3 { random.log(5.0, 500.0) } else { f64::INFINITY },
        law,
    };
    let mut caps = Random(4);
    let blocks: Vec<Block<f64>> = (0..BLOCKS_PLANNED).map(|_| block(caps.log(20.0, 500.0))).collect();
    let mut plans = vec![BlockPlan::default(); BLOCKS_PLANNED];
    all.push(Contender {
        name: "plan, a block",
        calls: BLOCKS_PLANNED,
        run: Box::new(move || {
            let start = Instant::now();
            plan(black_box(&blocks), 0.0, 0.0, &mut plans).expect("from rest to rest");
            black_box(&plans);
            start.elapsed()
        }),
    });

    // Tessellated code: runs of blocks under one ceiling.
    let mut cap_mm_s = 100.0;
    let tessellated: Vec<Block<f64>> = (0..BLOCKS_PLANNED)
        .map(|_| {
            if caps.unit() < 0.1 {
                cap_mm_s = caps.log(20.0, 500.0);
            }
            block(cap_mm_s)
        })
        .collect();
    for (name, blocks) in [
        ("spanning ramps, a block, tessellated", tessellated.clone()),
        ("spanning ramps, a block, saw-tooth", (0..BLOCKS_PLANNED).map(|n| saw_tooth(n % 40)).collect()),
    ] {
        let mut places = vec![Node::EMPTY; nodes_for(BLOCKS_PLANNED)];
        all.push(Contender {
            name,
            calls: BLOCKS_PLANNED,
            run: Box::new(move || {
                let start = Instant::now();
                let time_s =
                    plan_spanning(black_box(&blocks), 0.0, 0.0, &mut places, &mut |start_mm, ramp| {
                        black_box((start_mm, ramp));
                    });
                assert!(time_s.is_ok_and(|time_s| time_s.is_some()), "from rest to rest");
                start.elapsed()
            }),
        });
    }
    let mut blocks = tessellated.clone();
    let mut plans = vec![BlockPlan::default(); BLOCKS_PLANNED];
    all.push(Contender {
        name: "merge and plan, a block",
        calls: BLOCKS_PLANNED,
        run: Box::new(move || {
            blocks.copy_from_slice(&tessellated);
            let start = Instant::now();
            let merged = merge_equal(black_box(&mut blocks));
            plan(&blocks[..merged], 0.0, 0.0, &mut plans[..merged]).expect("from rest to rest");
            black_box(&plans);
            start.elapsed()
        }),
    });
}

/// A tooth of forty blocks of 0.3 mm whose ceilings rise from 20 to 98 mm/s.
fn saw_tooth(step: usize) -> Block<f64> {
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
    let law = Law::new(Pulse::Plateau, limits).expect("positive");
    Block { length_mm: 0.3, cap_mm_s: 20.0 + 2.0 * step as f64, junction_mm_s: f64::INFINITY, law }
}

/// One of four machines: the paper's, a middling, a fast one, and one whose jerk limit never binds.
fn law(random: &mut Random) -> Law<f64> {
    let limits = [(500.0, 5e3, 4e5), (5e3, 1e5, 5e6), (12_500.0, 1e6, 1e8), (500.0, 1e5, 4e5)];
    let (accel_mm_s2, jerk_mm_s3, snap_mm_s4) = limits[random.below(limits.len())];
    Law::new(Pulse::Plateau, Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 }).expect("positive")
}

/// Reproducible random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn below(&mut self, bound: usize) -> usize {
        (self.unit() * bound as f64) as usize
    }
    fn log(&mut self, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.unit())
    }
}
