//! Set positions against the exact law on the exact path, in counts of 0.1 µm, in f32.
//!
//! The law is written out here from S1 (1)–(6), in f64 with what cancels rearranged, for an edge; a plateau
//! is a cubic, and a closing edge the opening one run backwards from the pulse's end. Time is a whole number
//! of ticks, so its only error is its last place. Path lengths are exact to 2⁻³² mm.

use std::f64::consts::PI;
use std::fmt::Write;

use motion_host::machine::Machine;
use motion_host::planning::{Executable, PlacedRamp};
use motion_kernel::exec::{ExecState, Executed, Executor};
use motion_kernel::program::{Item, Supply};
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;
use motion_tests::check::geometry::{self, Arc, Element, Move, UNITS_PER_MM, dot, minus, norm};
use motion_tests::check::{bounds, machine, planned};

/// Promised: a quarter of a count.
const COUNTS_MAX: f64 = 0.25;
const MM_PER_COUNT: f64 = 1e-4;
/// Velocity, acceleration and jerk of the axes in f32 against the chain rule with the exact law, as parts
/// of the greatest values of the ramps: ten roundings.
const DERIVED_SHARE: f64 = 1.2e-6;

/// Greatest errors of a run: position [counts], then velocity, acceleration, jerk as parts.
type Worst = [f64; 4];

/// Length, feed, acceleration and jerk at `t` in a ramp or cruise.
fn law(placed: &PlacedRamp, t: f64) -> [f64; 4] {
    let (record, whole) = (&placed.planned.ramp, placed.time_s());
    let (t1, t2) = (record.t1_s, record.t2_s);
    let jerk =
        if record.to_mm_s < record.from_mm_s { -record.peak_jerk_mm_s3 } else { record.peak_jerk_mm_s3 };
    if t1 <= 0.0 {
        return [record.from_mm_s * t, record.from_mm_s, 0.0, 0.0];
    }
    let edge = record.edge_s;
    let opening = |t: f64| {
        let w = PI * t / edge;
        let k = edge / PI;
        [
            0.5 * jerk * (t * t * t / 6.0 - k * k * (t - k * w.sin())),
            0.5 * jerk * (t * t / 2.0 - 2.0 * k * k * (0.5 * w).sin().powi(2)),
            0.5 * jerk * (t - k * w.sin()),
            jerk * (0.5 * w).sin().powi(2),
        ]
    };
    let plateau = |t: f64| {
        let [s, v, a, _] = opening(edge);
        let u = t - edge;
        [s + u * (v + u * (a / 2.0 + u * jerk / 6.0)), v + u * (a + u * jerk / 2.0), a + u * jerk, jerk]
    };
    // From the plateau's end with the acceleration that an edge still adds, less what it does not.
    let closing = |t: f64| {
        let [s, v, a, _] = plateau(t1 - edge);
        let [edge_s, edge_v, edge_a, _] = opening(edge);
        let (u, [rest_s, rest_v, rest_a, j]) = (t - t1 + edge, opening(t1 - t));
        [
            s + u * (v + u * (a + edge_a) / 2.0) - (rest_s - edge_s + u * edge_v),
            v + u * (a + edge_a) - (edge_v - rest_v),
            a + edge_a - rest_a,
            j,
        ]
    };
    let rise = |from: f64, t: f64| {
        let [s, v, a, j] = if t <= edge {
            opening(t)
        } else if t < t1 - edge {
            plateau(t)
        } else {
            closing(t)
        };
        [from * t + s, from + v, a, j]
    };
    if t <= t1 {
        return rise(record.from_mm_s, t);
    }
    if t < t2 {
        let [s, v, a, _] = rise(record.from_mm_s, t1);
        let held = t - t1;
        return [s + held * (v + 0.5 * a * held), v + a * held, a, 0.0];
    }
    // From the end: feed F − …, run backwards.
    let left = (whole - t).max(0.0);
    let [s, v, a, j] = rise(0.0, left);
    let length = 0.5 * (record.from_mm_s + record.to_mm_s) * whole;
    [length - record.to_mm_s * left + s, record.to_mm_s - v, a, -j]
}

/// Executes the last stretch of `text`, a single move, in f32 on the reference machine; compares every tick.
fn compare(text: &str, element: &Element, from: [i64; 3], machine: &Machine) -> Worst {
    let plan = planned(text, machine).expect("a plan");
    let start_mm = plan.blocks.last().expect("a block").start_mm;
    let records: Vec<_> = plan.feed.iter().filter(|record| record.start_mm >= start_mm - 1e-6).collect();
    let mut executable = Executable::new::<f32>(&plan).expect("executable");
    let ends = executable.items.iter().rposition(|item| !matches!(item, Item::EndOfStretch(_)));
    let before = &executable.items[..ends.expect("a move")];
    let last = before.iter().rposition(|item| matches!(item, Item::EndOfStretch(_))).map_or(0, |end| end + 1);
    executable.items.drain(..last);
    let start = from.map(|units| Position::from_bits(geometry::position_bits(units)));
    let mut streams = Streams::<f32, 3, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut executor = Executor::<f32, 3>::new(start);
    let mut worst = Worst::default();
    let mut compared = 0_u64;
    for tick in 1_u64.. {
        supply.fill(&mut feeder).expect("accepted");
        let executed = executor.tick(&mut intake).expect("no fault");
        let (mut t, mut at_mm) = (tick as f64 * machine.tick_s, 0.0);
        for record in &records {
            if t <= record.time_s() {
                let [s, v, a, j] = law(record, t);
                add(&mut worst, &executed, element, [at_mm + s, v, a, j], &peaks(&records));
                compared += 1;
                break;
            }
            t -= record.time_s();
            at_mm += record.length_mm();
        }
        if executed.state == ExecState::Idle {
            assert!(compared + 1 >= tick, "{compared} of {tick} ticks lie in the plan");
            break;
        }
    }
    worst
}

/// Greatest feed, acceleration and jerk of the plan.
fn peaks(records: &[&PlacedRamp]) -> [f64; 3] {
    records.iter().map(|record| &record.planned.ramp).fold([0.0; 3], |peaks, record| {
        let values = [record.to_mm_s, record.peak_accel_mm_s2(), record.peak_jerk_mm_s3];
        core::array::from_fn(|k| f64::max(peaks[k], values[k]))
    })
}

fn add(
    worst: &mut Worst,
    executed: &Executed<f32, 3>,
    element: &Element,
    [s, v, a, j]: [f64; 4],
    peaks: &[f64; 3],
) {
    let point = element.at(s);
    let set = &executed.setpoints;
    let position = set.map(|axis| axis.position.to_mm());
    let derived = [
        set.map(|axis| f64::from(axis.velocity_mm_s)),
        set.map(|axis| f64::from(axis.accel_mm_s2)),
        set.map(|axis| f64::from(axis.jerk_mm_s3)),
    ];
    let (t, n, o) = (point.tangent, point.second, point.third);
    let exact = [
        t.map(|t| t * v),
        core::array::from_fn(|i| n[i] * v * v + t[i] * a),
        core::array::from_fn(|i| o[i] * v * v * v + 3.0 * n[i] * v * a + t[i] * j),
    ];
    let (bend, twist) = (norm(n), norm(o));
    let sizes = [peaks[0], peaks[1] + bend * peaks[0].powi(2), peaks[2] + twist * peaks[0].powi(3)];
    let found = [
        norm(minus(position, point.at)) / MM_PER_COUNT,
        norm(minus(derived[0], exact[0])) / sizes[0],
        norm(minus(derived[1], exact[1])) / sizes[1],
        norm(minus(derived[2], exact[2])) / sizes[2],
    ];
    for (worst, found) in worst.iter_mut().zip(found) {
        *worst = worst.max(found);
    }
}

fn units(mm: [f64; 3]) -> [i64; 3] {
    mm.map(|mm| (mm * UNITS_PER_MM).round() as i64)
}

fn line(from: [f64; 3], to: [f64; 3]) -> Element {
    Element::new(&Move { from: units(from), to: units(to), arc: None, feed_mm_min: 0.0 })
}

fn check_line(name: &str, from: [f64; 3], to: [f64; 3], feed_mm_min: f64) {
    let [[fx, fy, fz], [x, y, z]] = [from, to];
    let approach = if from == [0.0; 3] { String::new() } else { format!("G0 X{fx} Y{fy} Z{fz}\nG4 P0\n") };
    let text = format!("{approach}G1 X{x} Y{y} Z{z} F{feed_mm_min}\nM2\n");
    for machine in machine::references() {
        let worst = compare(&text, &line(from, to), units(from), &machine);
        let pulse = machine.path.pulse.name();
        println!(
            "{name}, {feed_mm_min} mm/min, {pulse}: {:.4} counts; V {:.1e} A {:.1e} J {:.1e}",
            worst[0], worst[1], worst[2], worst[3]
        );
        assert!(worst[0] <= COUNTS_MAX, "{name} {feed_mm_min}, {pulse}: {worst:?}");
        let is_close = worst[1..].iter().all(|&share| share <= DERIVED_SHARE);
        assert!(is_close, "{name} {feed_mm_min}, {pulse}: {worst:?}");
    }
}

#[test]
fn eight_metres_straight() {
    for feed_mm_min in [1000.0, 5000.0, 18000.0] {
        check_line("8 m along X", [0.0; 3], [8000.0, 0.0, 0.0], feed_mm_min);
        check_line("8 m diagonally", [0.0; 3], [5000.0, -4000.0, 4_795.831_523_3], feed_mm_min);
    }
}

#[test]
fn far_from_the_origin() {
    for feed_mm_min in [1000.0, 5000.0, 18000.0] {
        check_line("from X7000 to X15000", [7000.0, 0.0, 0.0], [15_000.0, 0.0, 0.0], feed_mm_min);
        check_line("1 m from X7000", [7000.0, -7000.0, 3.0], [7600.0, -6200.0, 3.0], feed_mm_min);
    }
}

/// Full circles and quarters, at the origin and far from it.
#[test]
fn arcs_from_a_millimetre_to_five_metres() {
    for radius_mm in [1.0, 4.0, 10.0, 57.3, 200.0, 1000.0, 5000.0] {
        for (far_mm, is_clockwise) in [(0.0, true), (7000.0, false)] {
            let offset = [-0.6 * radius_mm, 0.8 * radius_mm];
            let arc = Arc {
                axes: [0, 1, 2],
                offset: offset.map(|mm| (mm * UNITS_PER_MM).round() as i64),
                is_clockwise,
            };
            let from = units([far_mm, 0.0, 0.0]);
            let element = Element::new(&Move { from, to: from, arc: Some(arc), feed_mm_min: 0.0 });
            let word = if is_clockwise { "G2" } else { "G3" };
            let approach = if far_mm > 0.0 { format!("G0 X{far_mm}\nG4 P0\n") } else { String::new() };
            let text =
                format!("{approach}{word} X{far_mm} Y0 I{:.10} J{:.10} F18000\nM2\n", offset[0], offset[1]);
            for machine in machine::references() {
                check_arc(&format!("R {radius_mm} at X{far_mm}"), &text, &element, from, &machine);
            }
        }
    }
}

fn check_arc(name: &str, text: &str, element: &Element, from: [i64; 3], machine: &Machine) {
    let worst = compare(text, element, from, machine);
    let pulse = machine.path.pulse.name();
    println!(
        "{name}, {pulse}: {:.4} counts; V {:.1e} A {:.1e} J {:.1e}",
        worst[0], worst[1], worst[2], worst[3]
    );
    assert!(worst[0] <= COUNTS_MAX, "{name}, {pulse}: {worst:?}");
    for (share, bound) in worst[1..].iter().zip(bounds::AXIS_SHARES) {
        assert!(*share <= bound, "{name}, {pulse}: {worst:?}");
    }
}

/// A hundred thousand equal increments that no binary fraction holds end where their sum says.
#[test]
fn increments_do_not_drift() {
    increments(100_000);
}

#[test]
#[ignore = "takes much memory: a million lines"]
fn a_million_increments_do_not_drift() {
    increments(1_000_000);
}

fn increments(count: i64) {
    let mut text = "G61 G91 G1 F18000\n".to_owned();
    for _ in 0..count {
        let _ = writeln!(text, "X0.0033333333 Y-0.0011111111");
    }
    // Slow enough for lines of 3.5 µm.
    let mut machine = Machine::reference();
    machine.path.feed_mm_s = 80.0;
    let plan = planned(&text, &machine).expect("a plan");
    let executable = Executable::new::<f32>(&plan).expect("executable");
    let start = [Position::ZERO; 3];
    let mut streams = Streams::<f32, 3, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut executor = Executor::<f32, 3>::new(start);
    let direction = [0.003_333_333_3, -0.001_111_111_1, 0.0];
    let size = norm(direction);
    let mut worst = 0.0_f64;
    loop {
        supply.fill(&mut feeder).expect("accepted");
        let executed = executor.tick(&mut intake).expect("no fault");
        let position = executed.setpoints.map(|axis| axis.position.to_mm());
        let along = dot(position, direction) / size;
        let aside = minus(position, direction.map(|c| c / size * along));
        worst = worst.max(norm(aside) / MM_PER_COUNT);
        if executed.state == ExecState::Moving {
            worst = worst.max((along - executed.motion.s.to_mm()).abs() / MM_PER_COUNT);
        }
        if executed.state == ExecState::Idle && supply.is_empty() {
            let exact = [33_333_333 * count, -11_111_111 * count].map(geometry::position_bits);
            let end = executed.setpoints.map(|axis| axis.position.to_bits());
            println!("{count} increments: {worst:.4} counts");
            assert!((end[0] - exact[0]).abs() <= 1 && (end[1] - exact[1]).abs() <= 1, "{end:?} {exact:?}");
            assert!(worst <= COUNTS_MAX, "{worst} counts");
            return;
        }
    }
}
