//! Every tick keeps the limits, and they are made use of.

use motion_host::machine::Machine;
use motion_host::toolpath::blend::Blend;
use motion_host::toolpath::{Element, Involute, Polynomial, Role};
use motion_kernel::num::{Fixed, Real};

use super::asked::{Asked, corners, line, program};
use super::compiled::{Compiled, compiled, distance};
use super::driven::{Worst, driven};
use super::tolerance::CHAINS;
use super::{assert_none, judged, norm, planned, rounded, seeds, without_path_mode};
use motion_tests::check::machine;
use motion_tests::random::Random;
use motion_tests::samples::SAMPLES;

/// Many moves one after the other, on machines whose axes differ: every tick within every limit, jerk without a
/// step, the tolerance kept over the whole path.
#[test]
fn every_tick_of_blended_programs_keeps_the_limits() {
    let mut failures = Vec::new();
    let (mut worst, mut worst_distance) = (Worst::default(), 0.0_f64);
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        machine.path.pulse = machine::pulse(&random);
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
        let tolerance = rounded(random.log(1e-3, 0.3));
        let text = program(&asked, tolerance, random.log(60.0, 12_000.0));
        match judged((&asked, tolerance, &text), &machine, 24) {
            Ok((found, ratio)) => (worst, worst_distance) = (worst.max(found), worst_distance.max(ratio)),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{worst:?}, worst distance {worst_distance} of the tolerance");
    assert_none(&failures);
}

/// A blend, a curve with random control points or an involute.
fn curved(random: &mut Random) -> Option<Element> {
    let size_mm = random.log(1e-3, 100.0);
    let unit = |turn: f64| [turn.cos(), turn.sin(), 0.0];
    match random.below(3) {
        0 => {
            let direction = unit(random.log(1e-3, 2.9));
            let room_mm = size_mm * random.log(0.05, 1.0);
            let before = Element::Line { from: [-size_mm, 0.0, 0.0], to: [0.0; 3] };
            let after = Element::Line { from: [0.0; 3], to: direction.map(|part| part * size_mm) };
            let limits = Machine::reference().limits().in_any_direction();
            let tolerance_mm = random.log(1e-5, 1.0);
            Blend::new(&before, &after, tolerance_mm, room_mm, &limits).map(|blend| blend.element)
        }
        1 => {
            let mut next =
                |index: usize| [index as f64, random.between(-2.0, 2.0), random.between(-2.0, 2.0)];
            let points = core::array::from_fn(|index| next(index).map(|mm| mm * size_mm));
            Some(Element::polynomial([0.0; 3], Polynomial::bezier(points), Role::Spline))
        }
        _ => {
            let angles = (random.log(1e-2, 10.0), random.log(1e-2, 10.0));
            let frame = (unit(1.0), unit(1.0 + core::f64::consts::FRAC_PI_2));
            Involute::new(frame, size_mm, angles).ok().map(|shape| Element::involute([0.0; 3], shape))
        }
    }
}

/// What ceilings are made from are the greatest derivatives of what is driven, and not far above: no point of a
/// curve's pieces is beyond them, whatever number type it is cut for, and one of them or of the curve is near.
#[test]
fn no_piece_bends_more_than_its_curve_is_said_to() {
    let (mut curves, mut worst, mut failures) = (0, [0.0_f64; 3], Vec::new());
    for seed in seeds(4000) {
        let mut random = Random::new(seed);
        let Some(element) = curved(&mut random) else { continue };
        let bend = element.greatest().bend;
        let said = [bend.curvature_per_mm, bend.third_root_per_mm.powi(2), bend.fourth_root_per_mm.powi(3)];
        for longest_mm in [f64::PIECE_MM_MAX, f32::PIECE_MM_MAX, Fixed::PIECE_MM_MAX] {
            // A cusp is refused.
            let Ok(septics) = element.septics(longest_mm) else { continue };
            let mut found = [0.0_f64; 3];
            for piece in septics.iter().map(Compiled::of) {
                for part in 0..=101 {
                    let [_, _, derivatives @ ..] = piece.at(f64::from(part) / 101.0);
                    for (found, derivative) in found.iter_mut().zip(derivatives) {
                        *found = found.max(norm(derivative));
                    }
                }
            }
            curves += 1;
            let ratios: [f64; 3] = core::array::from_fn(|order| found[order] / said[order]);
            worst = core::array::from_fn(|order| worst[order].max(ratios[order]));
            if ratios.iter().any(|&ratio| !(ratio <= 1.0 + 1e-9)) {
                failures.push(format!(
                    "MOTION_TEST_SEED={seed}: {ratios:?} of {}, pieces to {longest_mm} mm",
                    element.kind()
                ));
            }
        }
    }
    println!("{curves} curves, at most {worst:?} of what is said");
    assert!(curves > 2 || curves > 10_000, "{curves}");
    assert!(curves < 100 || worst.iter().all(|&ratio| ratio > 0.999), "{worst:?}");
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
    for mut machine in machine::references() {
        machine.path.accel_step_mm_s2 = 1e-3;
        samples_keep_the_limits(&machine);
    }
}

fn samples_keep_the_limits(machine: &Machine) {
    for (name, text) in SAMPLES {
        let text = without_path_mode(text);
        let exact = planned(&format!("G61\n{text}"), machine).expect("a plan");
        let blended = format!("G21 G64 P0.05\n{text}");
        let plan = planned(&blended, machine).expect("a plan");
        assert!(plan.blocks.iter().any(|block| ["blend", "curve"].contains(&&*block.kind)), "{name}");
        println!("{name}: {} s exact, {} s blended", exact.time_s, plan.time_s);
        for worst in
            [driven::<f64>(&plan, machine), driven::<f32>(&plan, machine), driven::<Fixed>(&plan, machine)]
        {
            let worst = worst.unwrap_or_else(|error| panic!("{name}: {error}"));
            // f32 and fixed point round jerk to some millionths of its limit.
            let all = worst.axis.into_iter().chain(worst.path).chain([worst.jerk_step]);
            assert!(all.fold(0.0, f64::max) < 1.0 + 1e-4, "{name}: {worst:?}");
        }
    }
}
