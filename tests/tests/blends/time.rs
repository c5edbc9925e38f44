//! Blends cost no time: none is where the exact path is faster.

use motion_host::machine::Machine;

use super::asked::{Asked, corners, line, program};
use super::driven::driven;
use super::{assert_none, planned, rounded, seeds, without_path_mode};
use motion_tests::check::machine;
use motion_tests::random::Random;
use motion_tests::samples::SAMPLES;

/// Programs of many moves.
const PROGRAMS: u64 = 150;
/// Time of a blended program over that of the same program without blends, at most.
const RATIO_MAX: f64 = 1.005;

/// Moves at feeds of their own, slow ones next to fast ones.
fn of_many_feeds(random: &mut Random, asked: &[Asked]) -> String {
    let moves: Vec<String> =
        asked.iter().map(|step| format!("F{:.3} {}", random.log(20.0, 12_000.0), step.text())).collect();
    format!("{}M2\n", moves.concat())
}

/// Corners and tangent junctions, long moves and short ones, one feed and many: in no program are the blends slower than
/// the stops and steps of acceleration that they stand for.
#[test]
fn no_program_is_slower_with_blends_than_without() {
    let mut failures = Vec::new();
    let (mut worst, mut sum, mut blends) = (0.0_f64, 0.0, 0);
    for seed in seeds(PROGRAMS) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        machine.path.pulse = machine::pulse(&random);
        machine.path.accel_step_mm_s2 = random.log(1.0, 500.0);
        let lengths = if random.chance(0.5) { (0.1, 30.0) } else { (0.005, 0.5) };
        let moves = 3 + random.below(20);
        let asked = corners(&mut random, moves, lengths, (1e-3, 3.1));
        let tolerance = rounded(random.log(1e-3, 0.5));
        let moves = if random.chance(0.5) {
            of_many_feeds(&mut random, &asked)
        } else {
            program(&asked, tolerance, random.log(60.0, 12_000.0))
        };
        let moves = moves.replace(&format!("G64 P{tolerance:.10}"), "");
        let time = |mode: &str| planned(&format!("{mode}\n{moves}"), &machine);
        match (time("G61"), time(&format!("G64 P{tolerance:.10}"))) {
            (Ok(exact), Ok(blended)) => {
                let ratio = blended.time_s / exact.time_s;
                (worst, sum) = (worst.max(ratio), sum + ratio);
                blends += blended.blocks.iter().filter(|block| block.kind == "blend").count();
                if ratio > RATIO_MAX {
                    failures.push(format!("MOTION_TEST_SEED={seed}: {ratio} times as long\n{moves}"));
                }
            }
            (exact, blended) => failures.push(format!(
                "MOTION_TEST_SEED={seed}: {:?} {:?}\n{moves}",
                exact.err(),
                blended.err()
            )),
        }
    }
    println!("worst {worst}, on average {}, {blends} blends", sum / PROGRAMS as f64);
    assert_none(&failures);
    if motion_tests::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(blends > 400 && sum < 0.93 * PROGRAMS as f64, "{blends} blends, {sum}");
    }
}

#[test]
fn no_sample_is_slower_with_blends_than_without() {
    machine::references().iter().for_each(no_sample_is_slower);
}

fn no_sample_is_slower(machine: &Machine) {
    for (name, text) in SAMPLES {
        let text = without_path_mode(text);
        let exact = planned(&format!("G61\n{text}"), machine).expect("a plan").time_s;
        for tolerance in [0.001, 0.01, 0.05, 0.2] {
            let blended = planned(&format!("G21 G64 P{tolerance}\n{text}"), machine).expect("a plan").time_s;
            println!("{name}, P{tolerance}: {blended} s, exact {exact} s");
            assert!(blended <= RATIO_MAX * exact, "{name}, P{tolerance}: {blended} s, exact {exact} s");
        }
    }
}

/// Gentle corners are passed in less time than stopping takes, however short the lines next to them.
#[test]
fn gentle_corners_cost_less_than_stops() {
    let machine = Machine::reference();
    for degrees in [2.0_f64, 5.0, 15.0] {
        for length in [0.2, 1.0, 10.0] {
            let first = line([0.0; 3], [1.0, 0.0, 0.0], length);
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let text = program(&[first, line(first.to(), [cosine, sine, 0.0], length)], 0.05, 6000.0);
            let blended = planned(&text, &machine).expect("a plan").time_s;
            let exact = planned(&text.replace("G64 P0.0500000000", "G61"), &machine).expect("a plan").time_s;
            assert!(blended < 0.9 * exact, "{degrees}°, {length} mm: {blended} s, with a stop {exact} s");
        }
    }
}

/// A line that becomes an arc goes straight on. The acceleration-step limit says whether it may do so at once, which is
/// faster, or has to be led over.
#[test]
fn the_acceleration_step_limit_decides_about_tangent_junctions() {
    // Long enough that no curve takes the place of the arc.
    let text = "G21 G64 P0.05\nG1 X40 F6000\nG3 X60 Y20 J20\nG1 Y60\n";
    let mut machine = Machine::reference();
    let step = |machine: &Machine| {
        let plan = planned(text, machine).expect("a plan");
        let worst = driven::<f64>(&plan, machine).expect("a run");
        (plan.blocks.iter().filter(|block| block.kind == "blend").count(), worst.accel_step_mm_s2)
    };
    // What jerk changes in a tick comes on top.
    let by_jerk = machine.path.jerk_mm_s3 * machine.tick_s;
    let (blends, accel_step) = step(&machine);
    assert!(blends == 0 && accel_step > 100.0, "{blends} blends, {accel_step} mm/s²");
    assert!(accel_step < machine.path.accel_step_mm_s2 + by_jerk, "{accel_step} mm/s²");
    machine.path.accel_step_mm_s2 = 1.0;
    let (blends, accel_step) = step(&machine);
    assert!(blends == 2 && accel_step < by_jerk * (1.0 + 1e-9), "{blends} blends, {accel_step} mm/s²");
}
