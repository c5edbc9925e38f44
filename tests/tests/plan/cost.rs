//! What planning takes: memory from sizes, work as it is counted: evaluations of the law, visits to a ceiling, points of
//! blends and curves that are looked at, spans and samples of a step of a curve's solver.

use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_program};
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

/// Work of planning a program, a line.
fn work_a_line(program: &str) -> f64 {
    let parsed = motion_host::gcode::read("rate.ngc", program.as_bytes()).expect("a program");
    let machine = Machine::reference();
    let before = work_done();
    plan_program("rate.ngc", &parsed, &machine, Mode::Spanning).expect("a plan");
    (work_done() - before) as f64 / program.lines().count() as f64
}

/// `count` lines under G64, each from the one before: the point that `point` makes of its number.
fn program(count: u32, point: impl Fn(u32) -> String) -> String {
    let lines: Vec<String> = (0..count).map(point).collect();
    format!("G21 G90 G17 G64 P0.05 F3000\nG0 X0 Y0\nG1\n{}\nM2\n", lines.join("\n"))
}

/// A line or an arc that goes on as the one before, but for its ends of three decimals: two lines of 2 mm, and two arcs of 30°
/// between them, to the left and to the right.
fn rounded(index: u32) -> String {
    let (radius_mm, line_mm, turn_rad) = (3.0, 2.0, 30.0_f64.to_radians());
    let (mut at, mut heading_rad) = ([0.0, 0.0], 0.0_f64);
    // Four make a period.
    let period_mm = {
        let (sine, cosine) = libm::sincos(turn_rad);
        [line_mm * (1.0 + cosine) + 2.0 * radius_mm * sine, line_mm * sine + 2.0 * radius_mm * (1.0 - cosine)]
    };
    let periods = f64::from(index / 4);
    at = [at[0] + periods * period_mm[0], at[1] + periods * period_mm[1]];
    let mut words = String::new();
    for part in 0..=index % 4 {
        let (sine, cosine) = libm::sincos(heading_rad);
        if part % 2 == 0 {
            at = [at[0] + line_mm * cosine, at[1] + line_mm * sine];
            words = format!("G1 X{:.3} Y{:.3}", at[0], at[1]);
        } else {
            let side = if part == 1 { 1.0 } else { -1.0 };
            let spoke = [-side * radius_mm * sine, side * radius_mm * cosine];
            let centre = [at[0] + spoke[0], at[1] + spoke[1]];
            heading_rad += side * turn_rad;
            let (sine, cosine) = libm::sincos(heading_rad);
            at = [centre[0] + side * radius_mm * sine, centre[1] - side * radius_mm * cosine];
            let turn = if part == 1 { "G3" } else { "G2" };
            words = format!("{turn} X{:.3} Y{:.3} I{:.3} J{:.3}", at[0], at[1], spoke[0], spoke[1]);
        }
    }
    words
}

/// Dense lines, which become curves; long lines with corners; arcs that meet at angles; lines and arcs that meet at kinks.
#[test]
fn blends_and_curves_cost_bounded_work_a_line_however_long_the_program() {
    let dense = |index: u32| {
        let x = 0.05 * f64::from(index + 1);
        format!("X{x:.4} Y{:.4}", libm::sin(x) + 0.004 * f64::from(index % 2))
    };
    let corners = |index: u32| format!("X{} Y{}", 5 * (index / 2), 4 * (index.div_ceil(2) % 2));
    let arcs = |index: u32| {
        let (x, y) = (f64::from(index + 1), 0.2 * f64::from((index + 1) % 2));
        let rise = if index.is_multiple_of(2) { 0.2 } else { -0.2 };
        // From the middle between both ends to the right or to the left.
        let (turn, side) = if index.is_multiple_of(3) { ("G3", 0.7) } else { ("G2", -0.7) };
        format!("{turn} X{x} Y{y:.4} I{:.4} J{:.4}", 0.5 - side * rise, 0.5 * rise + side)
    };
    let kinds: [(&str, &dyn Fn(u32) -> String); 4] =
        [("dense", &dense), ("corners", &corners), ("arcs", &arcs), ("kinks", &rounded)];
    for ((name, point), most) in kinds.into_iter().zip(WORK_MAX) {
        let [short, long] = [1000, 4000].map(|count| work_a_line(&program(count, point)));
        println!("{name}: {short:.0} and {long:.0} steps of work a line");
        assert!(short > 0.0 && long < 1.25 * short && long.max(short) < most, "{name}: {short} {long}");
    }
}

/// Each kind takes about nineteen twentieths of it.
const WORK_MAX: [f64; 4] = [165.0, 2600.0, 5400.0, 12_600.0];
