//! Every tick keeps the limits, and they are made use of.

use motion_host::machine::Machine;
use motion_kernel::num::Fixed;

use super::asked::{Asked, corners, line, program};
use super::check::random::Random;
use super::compiled::{compiled, continuous, distance};
use super::driven::{Worst, driven};
use super::tolerance::CHAINS;
use super::{SAMPLES, assert_none, planned, rounded, seeds, without_path_mode};

/// Many moves one after the other, on machines whose axes differ: every tick within every limit, jerk without a
/// step, the tolerance kept over the whole path.
#[test]
fn every_tick_of_blended_programs_keeps_the_limits() {
    let mut failures = Vec::new();
    let (mut worst, mut worst_distance) = (Worst::default(), 0.0_f64);
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        // No step that jerk would not be within its limit for.
        machine.path.accel_step_mm_s2 = 1e-3;
        for axis in &mut machine.axes {
            let softer = random.between(0.3, 1.0);
            axis.accel_mm_s2 *= softer;
            axis.jerk_mm_s3 *= softer;
            axis.snap_mm_s4 *= softer;
            axis.feed_mm_s *= random.between(0.1, 1.0);
        }
        let lengths = if random.chance(0.5) { (0.1, 20.0) } else { (0.005, 0.5) };
        let moves = 3 + random.below(20);
        let asked = corners(&mut random, moves, lengths, (1e-3, 2.8));
        let tolerance = rounded(random.log_between(1e-3, 0.3));
        let text = program(&asked, tolerance, random.log_between(60.0, 12_000.0));
        let done = || -> Result<Worst, String> {
            let plan = planned(&text, &machine)?;
            let stretches = compiled(&plan);
            continuous(&stretches)?;
            let ratio = distance(&asked, &stretches, tolerance, 24);
            worst_distance = worst_distance.max(ratio);
            if ratio > 1.0 + 1e-6 {
                return Err(format!("{ratio} times the tolerance"));
            }
            let found = driven::<f64>(&plan, &machine)?;
            found.check().map(|()| found)
        }();
        match done {
            Ok(found) => worst = worst.max(found),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{worst:?}, worst distance {worst_distance} of the tolerance");
    assert_none(&failures);
}

/// The feeds of septic blends that the literature of the method quotes, for 30°, 60°, 90° and 120° within 0.05 mm
/// at 500 mm/s² and 5000 mm/s³; snap does not limit them there. The lines are not
/// much faster: from a high feed stopping would be.
#[test]
fn corners_are_passed_as_fast_as_septic_blends_can_be() {
    let mut machine = Machine::reference();
    machine.path.snap_mm_s4 = 1e9;
    for axis in &mut machine.axes {
        axis.snap_mm_s4 = 1e9;
    }
    for (degrees, feed_mm_s) in [(30.0_f64, 13.4), (60.0, 6.31), (90.0, 3.69), (120.0, 2.13)] {
        let first = line([0.0; 3], [1.0, 0.0, 0.0], 20.0);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let asked = [first, line(first.to(), [cosine, sine, 0.0], 20.0)];
        let plan = planned(&program(&asked, 0.05, 1.2 * 60.0 * feed_mm_s), &machine).expect("a plan");
        let blend = plan.blocks.iter().find(|block| block.kind == "blend").expect("a blend");
        println!("{degrees}°: {} mm/s", blend.peak_mm_s);
        assert!(blend.peak_mm_s >= feed_mm_s, "{degrees}°: {} mm/s, expected {feed_mm_s}", blend.peak_mm_s);
        assert!(blend.enter_mm_s >= feed_mm_s && blend.exit_mm_s >= feed_mm_s);
        let worst = driven::<f64>(&plan, &machine).expect("a run");
        assert!(worst.check().is_ok(), "{worst:?}");
    }
}

/// A circle of 10 mm radius in chords of a tenth of a millimetre is driven almost like a circle.
#[test]
fn a_tessellated_circle_runs_smoothly() {
    let machine = Machine::reference();
    let points = (1..=628).map(|index| {
        let (sine, cosine) = (core::f64::consts::TAU * f64::from(index) / 628.0).sin_cos();
        [10.0 * cosine - 10.0, 10.0 * sine, 0.0].map(|mm| (mm * 1e4).round() / 1e4)
    });
    let mut at = [0.0; 3];
    let asked: Vec<Asked> = points
        .map(|to| {
            let from = at;
            at = to;
            Asked::Line { from, to }
        })
        .collect();
    for tolerance in [0.005, 0.05] {
        let plan = planned(&program(&asked, tolerance, 6000.0), &machine).expect("a plan");
        let worst = driven::<f64>(&plan, &machine).expect("a run");
        assert!(worst.check().is_ok(), "{worst:?}");
        let stretches = compiled(&plan);
        assert_eq!(stretches.len(), 1);
        assert!(distance(&asked, &stretches, tolerance, 24) <= 1.0 + 1e-6);
        let feed = plan.length_mm / plan.time_s;
        println!("P{tolerance}: {feed} mm/s on average");
        // A true circle from rest to rest: 36 mm/s.
        assert!(feed > 30.0, "P{tolerance}: {feed} mm/s");
    }
}

/// The programs of the tests, blended, in every number type.
#[test]
fn whole_programs_keep_the_limits_in_every_number_type() {
    let mut machine = Machine::reference();
    machine.path.accel_step_mm_s2 = 1e-3;
    for (name, text) in SAMPLES {
        let text = without_path_mode(text);
        let exact = planned(&text, &machine).expect("a plan");
        let blended = format!("G21 G64 P0.05\n{text}");
        let plan = planned(&blended, &machine).expect("a plan");
        assert!(plan.blocks.iter().any(|block| block.kind == "blend"), "{name}");
        println!("{name}: {} s exact, {} s blended", exact.time_s, plan.time_s);
        for worst in
            [driven::<f64>(&plan, &machine), driven::<f32>(&plan, &machine), driven::<Fixed>(&plan, &machine)]
        {
            let worst = worst.unwrap_or_else(|error| panic!("{name}: {error}"));
            // f32 and fixed point round jerk to some millionths of its limit.
            let all = worst.axis.into_iter().chain(worst.path).chain([worst.jerk_step]);
            assert!(all.fold(0.0, f64::max) < 1.0 + 1e-4, "{name}: {worst:?}");
        }
    }
}
