//! S2's experiment, reproduced: what is printed there, and what follows from its arcs and its points.

use motion_host::smoothness::{self, FEED_MM_S, Figures, SECOND_CENTRE_Y_MM, TABLE_1, TABLE_2_S, TICK_S};
use motion_host::toolpath::spline::Degree;

fn figures() -> [Figures; 3] {
    smoothness::courses().expect("splines").map(|course| Figures::of(&course, FEED_MM_S))
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} ± {tolerance}");
}

/// Table 1 is points of the arcs, (6), rounded to a micrometre, at angles of π·u.
#[test]
fn the_points_are_those_of_the_arcs() {
    for (u, x, y) in TABLE_1 {
        let angle = core::f64::consts::PI * u;
        let (radius, centre) = if u <= 0.5 { (10.0, 0.0) } else { (8.0, SECOND_CENTRE_Y_MM) };
        assert_near(x, -radius * angle.cos(), 0.000_54);
        assert_near(y, radius * angle.sin() + centre, 0.000_54);
    }
}

#[test]
fn the_arcs_step_in_acceleration() {
    let [arcs, ..] = figures();
    assert_near(arcs.length_mm, 9.0 * core::f64::consts::PI, 1e-13);
    assert_near(arcs.length_mm, 28.274_33, 5e-6);
    assert_near(arcs.time_s, 0.500_431, 5e-7);
    assert_eq!(arcs.ticks, 500);
    let [junction] = &arcs.junctions[..] else { panic!("{} junctions", arcs.junctions.len()) };
    assert_near(junction.time_s, 0.278_017, 5e-7);
    // A_Y = −F²/R.
    let before = -FEED_MM_S * FEED_MM_S / 10.0;
    assert_near(before, -319.225, 1e-9);
    assert_near(before + junction.accel_mm_s2[1], -399.031, 5e-4);
    assert_near(junction.accel_mm_s2[0], 0.0, 1e-9);
    // Its difference over ticks is no property of the path: it grows as 1/τ.
    let ticks = smoothness::arcs().ticks(FEED_MM_S, TICK_S);
    let jerk_y = ticks.jerk_mm_s3.iter().map(|jerk| jerk[1]).fold(0.0, f64::min);
    assert_near(jerk_y, -78_444.0, 0.5);
    for by_tick in &arcs.by_tick {
        let product = by_tick.jerk_max_mm_s3 * by_tick.tick_s;
        assert!((0.5..=1.01).contains(&(product / 79.806_25)), "{by_tick:?}");
    }
    let grown = arcs.by_tick[2].jerk_max_mm_s3 / arcs.by_tick[0].jerk_max_mm_s3;
    assert!(grown > 5.0, "{grown}");
}

#[test]
fn splines_deviate_from_the_arcs() {
    let [_, cubic, quintic] = figures();
    assert_near(cubic.deviation_mm, 0.0193, 5e-5);
    assert_near(quintic.deviation_mm, 0.0211, 5e-5);
    for figures in [cubic, quintic] {
        // Times at the inner points, and table 2.
        let ours = [0.0556, 0.1112, 0.1668, 0.2224, 0.2780, 0.3337, 0.3892, 0.4449];
        assert_eq!(figures.junctions.len(), ours.len());
        for ((junction, ours_s), printed_s) in figures.junctions.iter().zip(ours).zip(TABLE_2_S) {
            assert_near(junction.time_s, ours_s, 5.1e-5);
            assert_near(junction.time_s, printed_s, 4e-3);
        }
        let farthest =
            figures.junctions.iter().zip(TABLE_2_S).map(|(j, t)| (j.time_s - t).abs()).fold(0.0, f64::max);
        assert!(farthest > 3.5e-3, "{farthest}: table 2 has nothing to be quoted with");
    }
}

#[test]
fn the_cubics_jerk_steps_and_the_quintics_does_not() {
    let [_, cubic, quintic] = figures();
    let printed = [432.0, 1115.0, 1119.0, 4015.0, 144.0, 6268.0, 3919.0, 78.0];
    for (junction, printed) in cubic.junctions.iter().zip(printed) {
        assert_near(junction.jerk_step_mm_s3(), printed, 0.5);
    }
    for figures in [&cubic, &quintic] {
        for junction in &figures.junctions {
            assert!(junction.accel_mm_s2.iter().all(|step| step.abs() < 1e-9), "{junction:?}");
        }
    }
    assert!(quintic.junctions.iter().all(|junction| junction.jerk_step_mm_s3() < 0.05));
    // From tick to tick: the cubic's step stays, the quintic's goes with the tick.
    let steps = |figures: &Figures| {
        let [first, _, last] = figures.by_tick;
        assert_near(first.tick_s, 1e-3, 1e-12);
        assert_near(last.tick_s, 1e-4, 1e-12);
        [first.jerk_step_max_mm_s3, last.jerk_step_max_mm_s3]
    };
    let [coarse, fine] = steps(&cubic);
    assert_near(coarse, 4395.0, 0.5);
    assert_near(fine, 3465.0, 0.5);
    let [coarse, fine] = steps(&quintic);
    assert_near(coarse, 537.0, 0.5);
    assert_near(fine, 53.8, 0.05);
}

/// The jerk of a quintic between two knots, differenced, is the derivative of the path: what is called a step
/// is none of the differencing.
#[test]
fn differences_converge_to_the_derivatives() {
    let course = smoothness::course(&smoothness::spline(Degree::Quintic).expect("a spline"));
    let (tick_s, cube) = (1e-4, FEED_MM_S.powi(3));
    let ticks = course.ticks(FEED_MM_S, tick_s);
    for (index, jerk) in ticks.jerk_mm_s3.iter().enumerate() {
        // Differences of ticks i … i + 2 are centred on i + 1.
        let there = course.at(FEED_MM_S * tick_s * (index + 1) as f64).expect("on the path");
        for (found, third) in jerk.iter().zip(there.third) {
            assert_near(*found, third * cube, 1.0);
        }
    }
}

/// Every better way is better, and septic pieces are within their tolerance; figures of the quintic at 1 ms.
#[test]
fn septic_pieces_keep_the_feed_best() {
    let [well, badly] = smoothness::well_and_badly_parametrised().expect("splines").map(|course| {
        smoothness::evaluators(&course, FEED_MM_S, TICK_S).map(|evaluator| evaluator.feed_error)
    });
    println!("{well:?} {badly:?}");
    for [first, second, _, newton, septic] in [well, badly] {
        assert!(first > 10.0 * second && second > newton && newton > septic, "{well:?} {badly:?}");
        assert!(septic <= 1.25e-6);
    }
    assert!((2e-3..4e-3).contains(&well[0]) && (3e-5..5e-5).contains(&well[1]), "{well:?}");
    // The error of the first order goes with the tick, that of the second with its square.
    let course = smoothness::course(&smoothness::spline(Degree::Quintic).expect("a spline"));
    let finer = smoothness::evaluators(&course, FEED_MM_S, 0.1 * TICK_S);
    for (index, expected) in [(0, 10.0), (1, 100.0)] {
        let ratio = well[index] / finer[index].feed_error;
        assert!((0.8..1.25).contains(&(ratio / expected)), "{index}: {ratio}");
    }
}
