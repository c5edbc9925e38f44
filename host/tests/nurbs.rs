//! NURBS of G5.2 and G6.2 against what they mean: basis functions, an exact circle, the same curve in other
//! coordinates, the length by numeric integration.

use motion_host::gcode::{self, Nurbs, Program, StepKind};
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Item as PlanItem, Mode, Plan, plan_program};
use motion_host::toolpath::Element;
use motion_host::toolpath::curve::Curve;
use motion_host::toolpath::rational::spans;
use motion_kernel::program::Item;

type Vector = [f64; 3];

/// How far the pieces may be from their curve [mm]: twice what one fit states, as they are fitted twice.
const DEVIATION_MM: f64 = 2.5e-6;

/// LinuxCNC's example of G5.2.
const EXAMPLE: &str = "F600\nG5.2 P1 L3\nX0 Y10 P1\nX20 Y20 P1\nX20 Y0 P1\nX0 Y0 P2\nG5.3\nM2\n";

/// A guitar's first curves, of degree 4.
const KNOTTED: &str = "G1 X59.171 Y23.693 F290\nG6.2 X59.171 Y23.693 R46.583 K0 P5 Q3\nX59.144 Y23.725 R59.167 K0\n\
    X59.12 Y23.838 R76.5 K0\nX59.514 Y33.682 R6 K0\nX51.214 Y35.69 R1 K0\nX47.8 Y34.15 R1 K1\nX43.985 Y22.57 R.75 K2\n\
    G6.2 K3\nG6.2 K3\nG6.2 K3\nG6.2 K3\nG6.2 K3\nM2\n";

fn read(text: &str) -> Program {
    gcode::read("nurbs.ngc", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn curve(text: &str) -> Nurbs {
    read(text).nurbs.first().expect("a curve").clone()
}

fn planned(text: &str) -> Result<Plan, String> {
    plan_program("nurbs.ngc", &read(text), &Machine::reference(), Mode::Spanning)
        .map_err(|error| error.to_string())
}

fn stretches(plan: &Plan) -> usize {
    plan.items.iter().filter(|item| matches!(item, PlanItem::Stretch(_))).count()
}

fn distance(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Cox and de Boor's basis functions, by their definition.
fn basis(knots: &[f64], index: usize, degree: usize, u: f64) -> f64 {
    if degree == 0 {
        return f64::from(u8::from(knots[index] <= u && u < knots[index + 1]));
    }
    let part = |over: f64, under: f64, basis: f64| if under > 0.0 { over / under * basis } else { 0.0 };
    part(u - knots[index], knots[index + degree] - knots[index], basis(knots, index, degree - 1, u))
        + part(
            knots[index + degree + 1] - u,
            knots[index + degree + 1] - knots[index + 1],
            basis(knots, index + 1, degree - 1, u),
        )
}

/// A point of the curve, below its last knot, by the sums of its definition.
fn defined(curve: &Nurbs, u: f64) -> Vector {
    let mut sum = [0.0; 4];
    for (index, (point, weight)) in curve.points_mm.iter().zip(&curve.weights).enumerate() {
        let part = weight * basis(&curve.knots, index, curve.degree, u);
        sum[3] += part;
        (0..3).for_each(|axis| sum[axis] += part * point[axis]);
    }
    [0, 1, 2].map(|axis| sum[axis] / sum[3])
}

/// Start and end of every span.
fn parameters(curve: &Nurbs) -> Vec<(f64, f64)> {
    curve.knots.windows(2).map(|pair| (pair[0], pair[1])).filter(|(low, high)| low < high).collect()
}

/// Points of the curved pieces as the kernel gets them.
fn driven(plan: &Plan) -> Vec<Vector> {
    let mut points = Vec::new();
    for item in Executable::new::<f64>(plan).expect("planned").items {
        let Item::Septic { start, coefficients, length, .. } = item else { continue };
        for sample in 0..=20 {
            let u = f64::from(sample) / 20.0;
            let offset =
                coefficients.map(|c| c.iter().rev().fold(0.0, |sum, c| (sum + c) * u) * length.to_mm());
            points.push([0, 1, 2].map(|axis: usize| start[axis].to_mm() + offset[axis]));
        }
    }
    points
}

/// A point's distance from the curve, by sampling and golden sections about the nearest sample.
fn from_curve(point: Vector, curve: &Nurbs) -> f64 {
    let (low, high) = (curve.knots[0], curve.knots[curve.knots.len() - 1] - 1e-12);
    let off = |u: f64| distance(point, defined(curve, u.clamp(low, high)));
    let at = |sample: f64| low + (high - low) * sample / 1000.0;
    let best = (0..=1000).map(f64::from).min_by(|&a, &b| off(at(a)).total_cmp(&off(at(b)))).expect("some");
    let (mut from, mut to) = (at(best - 1.0), at(best + 1.0));
    for _ in 0..80 {
        let (a, b) = (to - 0.618_034 * (to - from), from + 0.618_034 * (to - from));
        if off(a) < off(b) { to = b } else { from = a }
    }
    off(0.5 * (from + to))
}

#[test]
fn spans_are_the_sums_of_basis_functions() {
    let rough = "F9 G5.2 P.5 L5\nX1 Y4 P2\nX5 Y-3 P.1\nX6 Y1 P7\nX9 Y2 P1\nX8 Y8 P3\nX2 Y6 P1\nG5.3\n";
    for text in [EXAMPLE, KNOTTED, rough] {
        let curve = curve(text);
        let spans = spans(&curve).expect("spans");
        assert_eq!(spans.len(), parameters(&curve).len());
        for (span, (low, high)) in spans.iter().zip(parameters(&curve)) {
            for part in 0..20 {
                let share = f64::from(part) / 20.0;
                let (start, offset) = (span.start_mm(), span.offset(0.0, share));
                let found = [0, 1, 2].map(|axis: usize| start[axis] + offset[axis]);
                let off = distance(found, defined(&curve, low + (high - low) * share));
                assert!(off < 1e-12, "{off:e} mm at {share} of {low}");
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_the_points() {
    for span in spans(&curve(KNOTTED)).expect("spans") {
        for u in [0.1, 0.5, 0.93] {
            let h = 1e-5;
            let chord = span.offset(u - h, u + h);
            let (before, after) = (span.derivatives(u - h), span.derivatives(u + h));
            let [d1, d2, d3] = span.derivatives(u);
            let found = [
                chord.map(|part| part / (2.0 * h)),
                [0, 1, 2].map(|axis: usize| (after[0][axis] - before[0][axis]) / (2.0 * h)),
                [0, 1, 2].map(|axis: usize| (after[1][axis] - before[1][axis]) / (2.0 * h)),
            ];
            for (exact, found) in [d1, d2, d3].into_iter().zip(found) {
                let off = distance(exact, found);
                assert!(off < 1e-6 * (1.0 + distance(exact, [0.0; 3])), "{exact:?} {found:?}");
            }
        }
    }
}

/// A quarter of a circle of 10 mm, rational and quadratic.
const CIRCLE: &str = "G1 X10 F600\nG5.2 X10 Y10 P.70710678118654752440\nX0 Y10 P1\nG5.3\nM2\n";

#[test]
fn a_rational_quadratic_is_a_circle() {
    // The middle weight as near as f64 has it, which ten decimals are not.
    let mut circle = curve(CIRCLE);
    circle.weights[1] = 0.5_f64.sqrt();
    let [span] = &spans(&circle).expect("spans")[..] else { panic!("one span") };
    for part in 0..=100 {
        let offset = span.offset(0.0, f64::from(part) / 100.0);
        let radius = (10.0 + offset[0]).hypot(offset[1]);
        assert!((radius - 10.0).abs() < 1e-12, "{radius}");
    }
    assert!((span.length(0.0, 1.0) - 5.0 * std::f64::consts::PI).abs() < 1e-12);
    let plan = planned(CIRCLE).expect("a plan");
    for point in driven(&plan) {
        assert!((point[0].hypot(point[1]) - 10.0).abs() < DEVIATION_MM, "{point:?}");
    }
    let length_mm = plan.length_mm - 10.0;
    assert!((length_mm - 5.0 * std::f64::consts::PI).abs() < 1e-6, "{length_mm}");
}

/// A weight that pulls most of the curve into a small part of its parameter.
#[test]
fn lengths_are_good_where_weights_differ() {
    let curve = curve("F9 G5.2 X10 Y20 P3000\nX20 Y0 P1\nG5.3\n");
    let [span] = &spans(&curve).expect("spans")[..] else { panic!("one span") };
    let parts = 1 << 14;
    let at = |part: i32| f64::from(part) / f64::from(parts);
    let sum: f64 = (0..parts).map(|part| span.length(at(part), at(part + 1))).sum();
    let whole = span.length(0.0, 1.0);
    assert!((whole - sum).abs() < 1e-9, "{whole} {sum}");
}

#[test]
fn a_plan_follows_the_curve_and_its_length() {
    for text in [EXAMPLE, KNOTTED] {
        let (plan, curve) = (planned(text).expect("a plan"), curve(text));
        let points = driven(&plan);
        assert!(points.len() > 100);
        let worst = points.iter().map(|&point| from_curve(point, &curve)).fold(0.0, f64::max);
        assert!(worst < DEVIATION_MM, "{worst:e} mm");
        let mut length_mm = 0.0;
        for (low, high) in parameters(&curve) {
            let parts = 40_000;
            let at = |part: u32| {
                let u = low + (high - low) * f64::from(part) / f64::from(parts);
                defined(&curve, u.min(high - 1e-12))
            };
            length_mm += (0..parts).map(|part| distance(at(part), at(part + 1))).sum::<f64>();
        }
        let planned_mm: f64 =
            plan.blocks.iter().filter(|block| block.kind == "spline").map(|block| block.length_mm).sum();
        assert!((planned_mm - length_mm).abs() < 1e-5, "{planned_mm} {length_mm}");
        println!("worst {worst:e} mm, {planned_mm} mm planned, {length_mm} mm by chords");
    }
}

/// Degree 3 and more is driven in one motion, degree 1 stops at its corners.
#[test]
fn joints_are_those_of_the_degree() {
    let cubic = "F600\nG5.2 L4 X10 Y0 P1\nX20 Y10 P1\nX20 Y20 P2\nX10 Y30 P1\nX0 Y20 P1\nG5.3\nM2\n";
    let plan = planned(cubic).expect("a plan");
    assert_eq!(stretches(&plan), 1);
    // Tangent to it goes on without a stop, but under G61.1.
    let on = cubic.replace("M2", "G1 X-10 Y10\nM2");
    assert_eq!(stretches(&planned(&on).expect("a plan")), 1);
    assert_eq!(stretches(&planned(&format!("G61.1 {on}")).expect("a plan")), 2);
    let corners = "F600\nG6.2 X0 Y0 R1 K0 P2 Q1\nX10 Y0 R1 K0\nX10 Y10 R1 K1\nG6.2 K2\nG6.2 K2\nM2\n";
    let plan = planned(corners).expect("a plan");
    assert_eq!((stretches(&plan), plan.length_mm), (2, 20.0));
    assert!(plan.blocks.iter().all(|block| block.kind == "line"));
}

/// LinuxCNC's samples begin with the point where they stand, twice.
#[test]
fn a_start_in_two_control_points_is_driven() {
    let text = "G0 X10\nF600\nG5.2 P1 L4\nX10 Y0 P1\nX20 Y20 P1\nX12 Y8 P1\nX10 Y20 P1\nX8 Y8 P1\nX0 Y20 P1\n\
        X10 Y0 P1\nG5.3\nM2\n";
    let (plan, curve) = (planned(text).expect("a plan"), curve(text));
    let worst = driven(&plan).iter().map(|&point| from_curve(point, &curve)).fold(0.0, f64::max);
    assert!(worst < DEVIATION_MM, "{worst:e} mm");
    // The chord that it starts with, too.
    let spans = spans(&curve).expect("spans");
    for span in [&spans[0], &spans[spans.len() - 1]] {
        let elements = span.elements().expect("elements");
        let is_line = |element: &&Element| matches!(element, Element::Line { .. });
        for (from, to) in elements.iter().filter(is_line).map(Element::ends_mm) {
            for share in [0.25, 0.5, 0.75] {
                let off = from_curve([0, 1, 2].map(|i: usize| from[i] + share * (to[i] - from[i])), &curve);
                assert!(off < 1e-6, "{off:e} mm");
            }
        }
    }
    let first = spans[0].elements().expect("elements");
    assert!(matches!(first.first(), Some(Element::Line { .. })));
}

#[test]
fn the_same_curve_in_other_coordinates() {
    let same = |text: &str, points_mm: &[Vector]| {
        let curve = curve(text);
        assert_eq!(curve.points_mm.len(), points_mm.len());
        for (found, expected) in curve.points_mm.iter().zip(points_mm) {
            assert!(distance(*found, *expected) < 1e-9, "{text}: {found:?} {expected:?}");
        }
        assert_eq!(curve.weights, [1.0, 2.0, 1.0, 3.0]);
        assert_eq!(curve.knots, [0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0]);
        let program = read(text);
        let last = program.steps.iter().rev().find_map(|step| match step.kind {
            StepKind::Nurbs(curve) => Some(gcode::xyz_mm(curve.to)),
            _ => None,
        });
        assert_eq!(last, points_mm.last().copied());
    };
    let points = [[2.54, 5.08, 0.0], [12.7, 25.4, 0.0], [25.4, -25.4, 0.0], [50.8, 0.0, 0.0]];
    same("G0 X2.54 Y5.08 F9\nG5.2 X12.7 Y25.4 P2\nX25.4 Y-25.4 P1\nX50.8 Y0 P3\nG5.3\n", &points);
    same("G20 G0 X.1 Y.2 F9\nG5.2 X.5 Y1 P2\nX1 Y-1 P1\nX2 Y0 P3\nG5.3\n", &points);
    // G91 counts from the start, not from the control point before.
    same("G20 G0 X.1 Y.2 F9\nG91 G5.2 X.4 Y.8 P2\nX.9 Y-1.2 P1\nX1.9 Y-.2 P3\nG5.3\n", &points);
    // Turned by a right angle: X is −Y there.
    let turned =
        "G10 L2 P1 X1 Y2 R90\nG54 G20 G0 X.2 Y-.1 F9\nG5.2 X1 Y-.5 P2\nX-1 Y-1 P1\nX0 Y-2 P3\nG5.3\n";
    let moved = points.map(|[x, y, z]| [x + 1.0, y + 2.0, z]);
    same(turned, &moved);
    // In the other planes, at the height where the machine is.
    let turned = |[x, y, z]: [f64; 3]| [y, z + 3.0, x];
    let text = "G0 X5.08 Y3 Z2.54\nG18 F9\nG5.2 Z12.7 X25.4 P2\nZ25.4 X-25.4 P1\nZ50.8 X0 P3\nG5.3\n";
    same(text, &points.map(turned));
    let turned = |[x, y, z]: [f64; 3]| [z + 3.0, x, y];
    let text = "G0 X3 Y2.54 Z5.08\nG19 F9\nG5.2 Y12.7 Z25.4 P2\nY25.4 Z-25.4 P1\nY50.8 Z0 P3\nG5.3\n";
    same(text, &points.map(turned));
    let at_60 = "G10 L2 P1 R60\nG54 G0 X1 F9\nG5.2 X2 Y2 P1\nX3 Y0 P1\nG5.3\nG1 X9 Y0\n";
    let (sin, cos) = 60.0_f64.to_radians().sin_cos();
    for (found, [x, y]) in curve(at_60).points_mm.iter().zip([[1.0, 0.0], [2.0, 2.0], [3.0, 0.0]]) {
        assert!(distance(*found, [x * cos - y * sin, x * sin + y * cos, 0.0]) < 1e-9, "{found:?}");
    }
}

#[test]
fn the_knots_of_g62_end_it() {
    let program = read(KNOTTED);
    let curve = &program.nurbs[0];
    assert_eq!((curve.degree, curve.points_mm.len(), curve.weights.len()), (4, 7, 7));
    assert_eq!(curve.knots, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]);
    assert_eq!(program.steps.len(), 3);
    // A line leads to it, and in other planes the first axis of the plane comes first in no way.
    let text = "G19 F9\nG6.2 Y1 Z2 R1 K0 P2 Q1\nY5 Z6 R1 K0\nG6.2 K1\nG6.2 K1\nG6.3\nM2\n";
    let program = read(text);
    assert_eq!(program.nurbs[0].points_mm, [[0.0, 1.0, 2.0], [0.0, 5.0, 6.0]]);
    assert!(matches!(program.steps[0].kind, StepKind::Line(_)) && program.steps.len() == 3);
}

#[test]
fn what_is_no_nurbs_is_refused_at_its_place() {
    for (text, place, message) in [
        ("G18 F9\nG5.2 X1 Y1 P1\n", "2:9:", "found Y1, expected no coordinate across"),
        ("G5.2 P1\n", "1:1:", "found G5.2 without a feed"),
        ("G93 F9 G5.2 P1\n", "1:8:", "found G5.2 after G93"),
        ("F9\nG5.2 P1 L4\nX1 Y1 P1\nX2 Y2 P1\nG5.3\n", "5:1:", "found 3 control points, expected 4"),
        ("F9\nG5.2 P1\nX1 Y1\n", "3:1:", "without P, expected its weight"),
        ("F9\nG5.2 P1\nX1 Y1 P0\n", "3:7:", "found P0, expected a positive weight"),
        ("F9\nG5.2 X1 Y1 P-1\n", "2:12:", "found P-1, expected a positive weight"),
        ("F9\nG5.2 P1\nX1 P1\n", "3:1:", "found X1, expected both coordinates"),
        ("F9\nG5.2 P1\nX1 Y1 Z1 P1\n", "3:7:", "found Z1, expected no coordinate across"),
        ("F9\nG5.2 P1\nP2\n", "3:1:", "found P2, expected a control point"),
        ("F9\nG5.2 P1 L2\n", "2:9:", "found L2, expected an order"),
        ("F9\nG5.2 P1 L4\nX1 Y1 P1 L5\n", "3:10:", "found L5, expected one order"),
        ("F9\nG5.2 P1\nG1 X5\n", "3:1:", "found G1, expected X, Y, Z, P, L or F"),
        ("F9\nG5.2 P1\nG20\n", "3:1:", "found G20, expected"),
        ("F9\nG5.2 P1\nX1 Y1 P1 M3\n", "3:10:", "found M3, expected"),
        ("F9\nG5.2 P1\nX1 Y1 P1\nX2 Y1 P1\nG5.3 X5\n", "5:6:", "found X5, expected no other word"),
        ("F9\nG5.2 P1\nX1 Y1 P1\nM2\n", "4:1:", "found M2, expected"),
        ("F9\nG5.2 P1\nX1 Y1 P1\n%\n", "4:1:", "found the end of the program within a NURBS"),
        ("F9\nG5.2 P1\nX1 Y1 P1\n", "3:1:", "found the end of the program within a NURBS"),
        ("F9\nG5.3\n", "2:1:", "found G5.3, expected G5.2 before it"),
        ("F9\nG6.2 X1 Y1 R1 K0 Q1\n", "2:1:", "without P, expected an order"),
        ("F9\nG6.2 X1 Y1 R1 K0 P3\n", "2:1:", "without Q, expected"),
        ("F9\nG6.2 X1 Y1 R1 K0 P3 Q4\n", "2:21:", "found Q4, expected 1, 2 or 3"),
        ("F9\nG6.2 X1 Y1 R1 P3 Q1\n", "2:1:", "without K, expected its knot"),
        ("F9\nG6.2 X1 Y1 K0 P3 Q1\n", "2:1:", "without R, expected its weight"),
        ("F9\nG6.2 X1 Y1 R0 K0 P3 Q1\n", "2:12:", "found R0, expected a positive weight"),
        ("F9\nG6.2 X1 Y1 R1 K0 P2 Q1\nX1 Y2 R1 K1\n", "3:10:", "found K1, expected the first K"),
        ("F9\nG6.2 X1 Y1 R1 K2 P2 Q1\nX1 Y2 R1 K1\n", "3:10:", "found K1, expected a knot that is not below"),
        ("F9\nG6.2 X1 Y1 R1 K.5 P2 Q1\n", "2:15:", "found K.5, expected a knot"),
        ("F9\nG6.2 X1 Y1 R1 K0 P2 Q1\nG6.3\n", "3:1:", "found G6.3, expected the last K"),
        ("F9\nG6.2 X1 Y1 R1 K0 P2 Q1\nG6.2 K0\nG6.2 K0\n", "4:1:", "found 1 control points, expected 2"),
        ("F9\nG6.2 X1 Y1 R1 K0 P2 Q1\nG6.2 K0\nG6.2 K1\nG6.2 K1\n", "5:1:", "as many lines of knots alone"),
    ] {
        let error = gcode::read("a", text.as_bytes()).expect_err(text).to_string();
        assert!(error.starts_with(&format!("a:{place}")) && error.contains(message), "{text}: {error}");
    }
    // It is over: the position is known, the mode is not.
    assert!(gcode::read("a", EXAMPLE.replace("M2", "X5").as_bytes()).is_err());
}
