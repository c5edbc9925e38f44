//! The tolerance is kept, both ways, and nothing steps.

use motion_host::machine::Machine;

use super::asked::{Asked, corners, program};
use super::compiled::{compiled, continuous, distance};
use super::{assert_none, minus, norm, planned, rounded, seeds};
use motion_tests::random::Random;

/// Programs of two moves.
const PAIRS: u64 = 4000;
/// Programs of many.
pub(super) const CHAINS: u64 = 60;

/// So slow that every blend pays: corners are rounded with an acceleration that hardly matters.
const FEED_MM_MIN: f64 = 6.0;

/// A machine that stops where it does not blend, with next to no limit of jerk and snap.
fn unhurried() -> Machine {
    let mut machine = Machine::reference();
    let path = &mut machine.path;
    (path.jerk_mm_s3, path.snap_mm_s4, path.accel_step_mm_s2) = (1e9, 1e12, 1e-3);
    for axis in &mut machine.axes {
        (axis.jerk_mm_s3, axis.snap_mm_s4) = (1e9, 1e12);
    }
    machine
}

/// Any two moves, corners from 1° to 165°, lengths from 1 µm to 100 mm, tolerances from 1 µm to 1 mm.
#[test]
fn a_blend_keeps_its_tolerance_and_steps_nowhere() {
    let machine = unhurried();
    let mut failures = Vec::new();
    let (mut worst, mut close, mut blends) = (0.0_f64, 0, 0);
    for seed in seeds(PAIRS) {
        let mut random = Random::new(seed);
        let radians = |degrees: f64| degrees.to_radians();
        let asked = corners(&mut random, 2, (1e-3, 100.0), (radians(1.0), radians(165.0)));
        let tolerance = rounded(random.log(1e-3, 1.0));
        let text = program(&asked, tolerance, FEED_MM_MIN);
        let done = || -> Result<f64, String> {
            let plan = planned(&text, &machine)?;
            let stretches = compiled(&plan);
            continuous(&stretches, 3)?;
            let ratio = distance(&asked, &stretches, tolerance, 60);
            blends += usize::from(plan.blocks.iter().any(|block| ["blend", "curve"].contains(&&*block.kind)));
            if ratio > 1.0 + 1e-6 {
                return Err(format!("{ratio} times the tolerance"));
            }
            if stretches.len() != 1 && !is_straight_on(&asked) {
                return Err("a stop".to_owned());
            }
            Ok(ratio)
        }();
        match done {
            Ok(ratio) => {
                worst = worst.max(ratio);
                close += u32::from(ratio > 0.99);
            }
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{blends} of {PAIRS} rounded, worst {worst} of the tolerance, {close} above 0.99");
    assert_none(&failures);
    if motion_tests::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(blends > 3000 && close > 600, "{blends} rounded, {close} that use their tolerance");
    }
}

/// Two lines in one direction have nothing to blend.
fn is_straight_on(asked: &[Asked]) -> bool {
    asked.iter().all(|step| matches!(step, Asked::Line { .. }))
        && norm(minus(asked[0].heading(), asked[1].heading())) < 1e-6
}

/// Curves and corners in short chords that lie off them by a part of the tolerance, as a scanner or a rounding
/// postprocessor leaves them.
fn chords(random: &mut Random, tolerance: f64) -> Vec<Asked> {
    let (mut on_curve, mut heading) = ([0.0, 0.0], random.between(0.0, core::f64::consts::TAU));
    let (mut at, mut asked) = ([0.0; 3], Vec::new());
    let beside = tolerance * random.between(0.0, 0.5);
    for _ in 0..4 {
        heading += random.between(-1.2, 1.2);
        let length = tolerance * random.log(0.5, 20.0);
        let turn = random.between(-0.05, 0.05);
        for _ in 0..10 + random.below(40) {
            heading += turn;
            on_curve = [on_curve[0] + length * heading.cos(), on_curve[1] + length * heading.sin()];
            let to = [0, 1].map(|axis| rounded(on_curve[axis] + beside * random.between(-1.0, 1.0)));
            let to = [to[0], to[1], 0.0];
            asked.push(Asked::Line { from: at, to });
            at = to;
        }
    }
    asked
}

/// What merging and blending leave of the tolerance together.
#[test]
fn merged_chords_keep_the_tolerance() {
    let machine = unhurried();
    let mut failures = Vec::new();
    let (mut worst, mut merged, mut all) = (0.0_f64, 0, 0);
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let tolerance = rounded(random.log(3e-3, 0.3));
        let asked = chords(&mut random, tolerance);
        let text = program(&asked, tolerance, FEED_MM_MIN);
        let done = || -> Result<f64, String> {
            let plan = planned(&text, &machine)?;
            all += asked.len();
            merged += plan.blocks.iter().filter(|block| block.kind != "blend").count();
            let stretches = compiled(&plan);
            continuous(&stretches, 3)?;
            let ratio = distance(&asked, &stretches, tolerance, 24);
            if ratio > 1.0 + 1e-6 { Err(format!("{ratio} times the tolerance")) } else { Ok(ratio) }
        }();
        match done {
            Ok(ratio) => worst = worst.max(ratio),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{all} chords became {merged} lines and arcs, worst {worst} of the tolerance");
    assert_none(&failures);
    if motion_tests::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(2 * merged < all && worst > 0.9, "{merged} of {all}, worst {worst}");
    }
}

/// With Q, the path may be off the lines by P and Q together; with Q0 by P alone.
#[test]
fn lines_have_both_tolerances() {
    let machine = unhurried();
    let mut failures = Vec::new();
    let (mut worst, mut beyond, mut counts) = (0.0_f64, 0, [0; 3]);
    for seed in seeds(CHAINS / 5) {
        let mut random = Random::new(seed);
        let tolerance = rounded(random.log(3e-3, 0.1));
        let asked = chords(&mut random, tolerance);
        let text = program(&asked, tolerance, FEED_MM_MIN);
        let done = || -> Result<(), String> {
            for (count, part) in counts.iter_mut().zip([0.0, 1.0, 3.0]) {
                let merging = rounded(part * tolerance);
                let mode = format!("G64 P{tolerance:.10}");
                let plan = planned(&text.replace(&mode, &format!("{mode} Q{merging:.10}")), &machine)?;
                let moves = plan.blocks.iter().filter(|block| block.kind != "blend").count();
                *count += moves;
                let stretches = compiled(&plan);
                continuous(&stretches, 3)?;
                let distance = tolerance * distance(&asked, &stretches, tolerance, 24);
                worst = worst.max(distance / (tolerance + merging));
                beyond += u32::from(distance > 1.01 * tolerance);
                if distance > (tolerance + merging) * (1.0 + 1e-6) {
                    return Err(format!("{distance} mm, Q{merging}"));
                }
            }
            Ok(())
        }();
        if let Err(error) = done {
            failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}"));
        }
    }
    // What is no line stays what it is, between lines that are merged.
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let asked = corners(&mut random, 12, (0.1, 20.0), (1e-3, 2.8));
        let (tolerance, merging) = (0.01, 0.03);
        let text = program(&asked, tolerance, FEED_MM_MIN).replace(" F6", " Q0.03 F6");
        let plan = planned(&text, &machine).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let distance = tolerance * distance(&asked, &compiled(&plan), tolerance, 24);
        if distance > (tolerance + merging) * (1.0 + 1e-6) {
            failures.push(format!("MOTION_TEST_SEED={seed}: {distance} mm\n{text}"));
        }
    }
    println!("{counts:?} moves, worst {worst} of both tolerances, {beyond} times beyond P alone");
    assert_none(&failures);
    if motion_tests::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(counts[0] > counts[1] && counts[1] > counts[2] && beyond > 5, "{counts:?}, {beyond}");
    }
}
