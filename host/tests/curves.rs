//! G5 and G5.5 against what they mean: de Casteljau's construction, the programmed points, exact stops at
//! corners.

use motion_host::compare::ticks::ratios;
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Item as PlanItem, Mode, Plan, plan_program};
use motion_kernel::program::Item;

type Vector = [f64; 3];

/// How far the pieces may be from their curve [mm]: what they state.
const DEVIATION_MM: f64 = 1.25e-6;

fn planned(text: &str) -> Result<Plan, String> {
    let program = gcode::read("curves.ngc", text.as_bytes()).map_err(|error| error.to_string())?;
    plan_program("curves.ngc", &program, &Machine::reference(), Mode::Spanning)
        .map_err(|error| error.to_string())
}

fn stretches(plan: &Plan) -> usize {
    plan.items.iter().filter(|item| matches!(item, PlanItem::Stretch(_))).count()
}

fn distance(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Points of the curved pieces as the kernel gets them.
fn driven(plan: &Plan, samples: usize) -> Vec<Vector> {
    let mut points = Vec::new();
    for item in Executable::new::<f64>(plan).expect("planned").items {
        let Item::Septic { start, coefficients, length, .. } = item else { continue };
        for sample in 0..=samples {
            let u = sample as f64 / samples as f64;
            let offset =
                coefficients.map(|c| c.iter().rev().fold(0.0, |sum, c| (sum + c) * u) * length.to_mm());
            points.push([0, 1, 2].map(|axis: usize| start[axis].to_mm() + offset[axis]));
        }
    }
    points
}

fn casteljau(mut points: Vec<Vector>, u: f64) -> Vector {
    while points.len() > 1 {
        points = points
            .windows(2)
            .map(|pair| [0, 1, 2].map(|i: usize| pair[0][i] + u * (pair[1][i] - pair[0][i])))
            .collect();
    }
    points[0]
}

/// The distance of a point from a curve over 0 … 1, by sampling and golden sections about the nearest sample.
fn from_curve(point: Vector, curve: &dyn Fn(f64) -> Vector) -> f64 {
    let off = |u: f64| distance(point, curve(u.clamp(0.0, 1.0)));
    let best = (0..=400)
        .min_by(|&a, &b| off(f64::from(a) / 400.0).total_cmp(&off(f64::from(b) / 400.0)))
        .expect("some");
    let (mut low, mut high) = (f64::from(best - 1) / 400.0, f64::from(best + 1) / 400.0);
    for _ in 0..80 {
        let (a, b) = (high - 0.618_034 * (high - low), low + 0.618_034 * (high - low));
        if off(a) < off(b) { high = b } else { low = a }
    }
    off(0.5 * (low + high))
}

/// The curved pieces are Bézier curves with these control points, and nothing of the curves is left out.
fn assert_drives(plan: &Plan, curves: &[Vec<Vector>]) {
    let points = driven(plan, 50);
    assert!(points.len() > 200);
    let mut worst = 0.0_f64;
    for &point in &points {
        let off = |points: &Vec<Vector>| from_curve(point, &|u| casteljau(points.clone(), u));
        worst = worst.max(curves.iter().map(off).fold(f64::INFINITY, f64::min));
    }
    for curve in curves {
        for sample in 0..=100 {
            let at = casteljau(curve.clone(), f64::from(sample) / 100.0);
            let gap = points.iter().map(|&point| distance(at, point)).fold(f64::INFINITY, f64::min);
            assert!(gap < 0.2, "{at:?}: {gap} mm from what is driven");
        }
    }
    println!("worst {worst:e} mm");
    assert!(worst < DEVIATION_MM, "{worst:e} mm");
}

/// LinuxCNC's own example of G5, and one that it is continued by; in inches the same.
#[test]
fn a_g5_is_the_bezier_curve_of_its_control_points() {
    let text = "G1 X1 Y2 F600\nG5 I0 J3 P0 Q-3 X11 Y12\nP1 Q5 X21 Y2\nM2\n";
    let plan = planned(text).expect("a plan");
    let curves = [
        vec![[1.0, 2.0, 0.0], [1.0, 5.0, 0.0], [11.0, 9.0, 0.0], [11.0, 12.0, 0.0]],
        vec![[11.0, 12.0, 0.0], [11.0, 15.0, 0.0], [22.0, 7.0, 0.0], [21.0, 2.0, 0.0]],
    ];
    assert_drives(&plan, &curves);
    assert_eq!(
        plan.blocks.iter().map(|block| &*block.kind).collect::<Vec<_>>(),
        ["line", "spline", "spline"]
    );
    // A corner at the start; the continuation is tangent.
    assert_eq!(stretches(&plan), 2);
    let inches = "G20 G1 X0.1 Y0.2 F60\nG5 I0 J0.3 P0 Q-0.3 X1.1 Y1.2\nM2\n";
    let mm = "G1 X2.54 Y5.08 F1524\nG5 I0 J7.62 P0 Q-7.62 X27.94 Y30.48\nM2\n";
    assert_eq!(planned(inches).expect("a plan").time_s, planned(mm).expect("a plan").time_s);
}

/// Control points are taken as they are, whatever the distance mode, in a turned system too.
#[test]
fn a_g51_is_the_quadratic_curve_of_its_control_point() {
    let text = "G1 X1 Y2 F600\nG5.1 I4 J6 X11 Y5\nI3 J-9 X20 Y2\nM2\n";
    let curves = [
        vec![[1.0, 2.0, 0.0], [5.0, 8.0, 0.0], [11.0, 5.0, 0.0]],
        vec![[11.0, 5.0, 0.0], [14.0, -4.0, 0.0], [20.0, 2.0, 0.0]],
    ];
    let plan = planned(text).expect("a plan");
    assert_drives(&plan, &curves);
    let incremental = text.replace("G1 X1 Y2 F600\n", "G1 X1 Y2 F600\nG91 ").replace("X11 Y5", "X10 Y3");
    let incremental = incremental.replace("X20 Y2", "X9 Y-3");
    assert_eq!(planned(&incremental).expect("a plan").time_s, plan.time_s);
    let turned = text.replace("G1 X1", "G10 L2 P1 R90\nG1 X1");
    let turned_curves = curves.map(|curve| curve.iter().map(|[x, y, z]| [-y, *x, *z]).collect::<Vec<_>>());
    assert_drives(&planned(&turned).expect("a plan"), &turned_curves);
}

/// Through every point, in one motion, whose jerk does not step.
#[test]
fn a_g55_goes_through_its_points() {
    let points: Vec<Vector> = (1..=12)
        .map(|index| {
            let angle = 0.4 * f64::from(index);
            [20.0 * angle.sin(), 20.0 - 20.0 * angle.cos(), 0.5 * f64::from(index % 3)]
                .map(|mm| (mm * 1e6).round() / 1e6)
        })
        .collect();
    let lines: Vec<String> = points.iter().map(|[x, y, z]| format!("X{x:.6} Y{y:.6} Z{z:.6}\n")).collect();
    let text = format!("F1800 G5.5 {}M2\n", lines.concat());
    let plan = planned(&text).expect("a plan");
    assert!(plan.blocks.iter().all(|block| block.kind == "spline"));
    assert_eq!(stretches(&plan), 1);
    let driven = driven(&plan, 4000);
    for &point in &points {
        let nearest = driven.iter().map(|&at| distance(at, point)).fold(f64::INFINITY, f64::min);
        // Half the way between two samples.
        assert!(nearest < 2e-3, "{nearest} mm from {point:?}");
    }
    let ratios = ratios(&plan, &Machine::reference()).expect("ticks");
    assert!(
        ratios.accel_step < 1e-6 && ratios.jerk <= 1.0 + 1e-6 && ratios.accel <= 1.0 + 1e-6,
        "{ratios:?}"
    );
    // The word once more begins another spline, which is not tangent to the first one.
    let again = text.replace(&lines[5], &format!("G5.5 {}", lines[5]));
    let again = planned(&again).expect("a plan");
    assert_eq!(stretches(&again), 2);
    // The slowest feed of its points holds on a span.
    let slow = planned(&text.replace(&lines[6], &format!("F60 {}", lines[6]))).expect("a plan");
    let caps: Vec<f64> = slow.blocks.iter().map(|block| block.cap_mm_s).collect();
    assert!(caps[0] > 5.0 && caps.last() == Some(&1.0), "{caps:?}");
}

/// Beside a spline nothing is blended: what is tangent is passed, what is not is an exact stop.
#[test]
fn splines_and_lines_meet_exactly() {
    // Its first three control points lie on the line: neither direction nor curvature steps.
    let tangent = "G1 X10\nG5 X20 Y10 I4 J0 P-4 Q-10\n";
    let corner = "G1 X10\nG5 X20 Y10 I0 J4 P-4 Q-10\n";
    let bent = "G1 X10\nG5 X20 Y10 I4 J0 P0 Q-4\n";
    for mode in ["G61", "G64 P0.5"] {
        let plan = |moves: &str| planned(&format!("{mode} F600\n{moves}M2\n")).expect("a plan");
        for (moves, expected) in [(tangent, 1), (corner, 2), (bent, 1)] {
            let plan = plan(moves);
            assert_eq!(stretches(&plan), expected, "{mode} {moves}");
            assert!(plan.blocks.iter().all(|block| block.kind != "blend"));
            let ratios = ratios(&plan, &Machine::reference()).expect("ticks");
            assert!(
                ratios.accel <= 1.0 + 1e-6 && ratios.jerk <= 1.0 + 1e-6 && ratios.accel_step <= 1.0,
                "{ratios:?}"
            );
            let steps = ratios.accel_step > 1e-3;
            assert_eq!(steps, moves == bent, "{mode} {moves}: {ratios:?}");
        }
        // The passed junction is passed at speed.
        let plan = plan(tangent);
        assert!(plan.blocks[1].enter_mm_s > 5.0, "{}", plan.blocks[1].enter_mm_s);
    }
}

#[test]
fn what_has_no_curve_is_refused_with_its_line() {
    for (text, start, message) in [
        ("F600\nG5.5 X1\nX2 Y1\nX3\nM2\n", "curves.ngc:2: found 4 points", "expected at least 6"),
        ("F600\nG1 X1\nG5 X5 I1 J0 P-1 Q0\nG5 X9 I-8 J0 P8 Q0\n", "curves.ngc:4: found", "expected"),
        ("F600\nG5 X5 I0 J0 P0 Q0\n", "curves.ngc:2: found", "expected"),
        ("F600\nG5.1 X5 I2\n", "curves.ngc:2:9: found I2 alone", "expected I and J"),
        ("F600\nG5.1 X5\n", "curves.ngc:2:1: found G5.1 without I and J", "expected"),
        ("F600\nG18 G5.1 X5 I1 J1\n", "curves.ngc:2:5: found G5.1 in the ZX plane", "expected"),
        ("F600\nG5.1 X5 I1 J1 Z2\n", "curves.ngc:2:15: found Z2", "expected X and Y only"),
        ("F600\nG5.1 X5 I1 J1 P2\n", "curves.ngc:2:15: found P2", "expected no such word"),
        ("F600\nG5.1 X5 I1 J1\nG5 X9 P-1 Q0\n", "curves.ngc:3:1: found a first G5", "expected"),
    ] {
        let error = planned(text).expect_err(text);
        println!("{error}");
        assert!(error.starts_with(start) && error.contains(message), "{error}");
    }
}

/// A spline through points on a straight line goes on in a move along it, but under G61.1.
#[test]
fn an_exact_stop_holds_behind_a_spline() {
    let text = "F600\nG5.5 X10\nX20\nX30\nX40\nX50\nG1 X60\nM2\n";
    assert_eq!(stretches(&planned(&format!("G61\n{text}")).expect("a plan")), 1);
    assert_eq!(stretches(&planned(&format!("G61.1\n{text}")).expect("a plan")), 2);
}
