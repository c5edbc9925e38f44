//! Probing moves: where they trip, where the machine comes to rest, and what the encoders of a run say of it.

use motion_host::gcode::{self, Point, ProbeMove, Program, ReadOptions, StepKind, xyz_mm};
use motion_host::machine::Machine;
use motion_host::planning::{Item, Mode, Stretch, plan_program};
use motion_host::simulate::{self, Probed};
use motion_host::touch::{Surface, TouchBox};
use motion_tests::random::Random;

/// The plate of the commented machine file.
const PLATE: TouchBox = TouchBox { low_mm: [0.0, 0.0, -30.0], high_mm: [100.0, 60.0, -10.0] };

fn machine() -> Machine {
    Machine { probe: Some(Surface { boxes: vec![PLATE] }), ..Machine::reference() }
}

fn read_on(machine: &Machine, text: &str) -> Program {
    gcode::read_with("a.ngc", text.as_bytes(), &machine.read_options())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn read(text: &str) -> Program {
    read_on(&machine(), text)
}

fn refusal(text: &str) -> String {
    gcode::read_with("a.ngc", text.as_bytes(), &machine().read_options()).expect_err(text).to_string()
}

fn probes(program: &Program) -> Vec<ProbeMove> {
    let probe = |kind: &StepKind| match kind {
        StepKind::Probe(probe) => Some(*probe),
        _ => None,
    };
    program.steps.iter().filter_map(|step| probe(&step.kind)).collect()
}

fn mm(point: Point) -> [f64; 3] {
    xyz_mm(point)
}

/// #5061 to #5063 and #5070.
fn read_back(program: &Program) -> [f64; 4] {
    [5061, 5062, 5063, 5070].map(|number| program.parameters.get(number))
}

#[track_caller]
fn assert_near<const N: usize>(found: [f64; N], expected: [f64; N], by: f64) {
    let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= by);
    assert!(is_near, "{found:?}, expected {expected:?}");
}

fn stretches(program: &Program, machine: &Machine) -> Vec<Stretch> {
    let plan =
        plan_program("a.ngc", program, machine, Mode::Spanning).unwrap_or_else(|error| panic!("{error}"));
    let stretch = |item| match item {
        Item::Stretch(stretch) => Some(stretch),
        _ => None,
    };
    plan.items.into_iter().filter_map(stretch).collect()
}

#[test]
fn a_probe_trips_on_the_surface_and_the_machine_rests_behind_it() {
    let program =
        read("G38.2 X10 Y10 Z-40 F600 (PROBEOPEN a.txt)\nG1 X20\n(DEBUG, #5063 #5070)\n(PROBECLOSE)\n");
    let [notice, _] = &program.notices[..] else { panic!("{:?}", program.notices) };
    assert_eq!((notice.kind, notice.count), (gcode::NoticeKind::File, 2));
    let [probe] = probes(&program)[..] else { panic!("one") };
    // A quarter of the way.
    assert_near(mm(probe.trip.unwrap()), [2.5, 2.5, -10.0], 1e-9);
    assert_eq!((mm(probe.from), mm(probe.end)), ([0.0; 3], [10.0, 10.0, -40.0]));
    assert_eq!(read_back(&program), [2.5, 2.5, -10.0, 1.0]);
    // Everything after it begins where it rests.
    let StepKind::Line(line) = program.steps[1].kind else { panic!("a line") };
    assert_eq!(line.from, probe.to);
    assert_near(mm(line.to), [20.0, mm(probe.to)[1], mm(probe.to)[2]], 0.0);
    assert!(mm(probe.to)[2] < -10.0 && mm(probe.to)[2] > -11.0, "{:?}", mm(probe.to));
    assert_eq!(program.messages.last().unwrap().text, "-10.000000 1.000000");
}

/// The plan drives it from a full stop to a full stop, and passes the surface at the programmed feed.
#[test]
fn contact_is_at_the_programmed_feed() {
    let mut machine = machine();
    machine.axes[2].accel_mm_s2 = 100.0;
    machine.axes[0].jerk_mm_s3 = 900.0;
    for (feed_mm_min, to) in [(60, "Z-20"), (1800, "Z-29"), (3000, "X30 Y20 Z-29"), (90_000, "Y3 Z-99")] {
        let text = format!("G64 P1 G0 X1 Y1 Z30\nG38.2 {to} F{feed_mm_min}\nG91 G1 X5\nX5 Y5\n");
        let program = read_on(&machine, &text);
        let [probe] = probes(&program)[..] else { panic!("one") };
        let stretches = stretches(&program, &machine);
        let stretch = &stretches[1];
        assert_eq!(stretch.blocks.len(), 1, "{text}");
        let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        let to_trip_mm = distance(mm(probe.from), mm(probe.trip.unwrap()));
        assert!((stretch.length_mm() - distance(mm(probe.from), mm(probe.to))).abs() < 1e-6);
        let (feed_mm_s, _) = stretch.profile.at(to_trip_mm);
        let peak_mm_s =
            stretch.profile.ramps().iter().map(|placed| placed.planned.ramp.to_mm_s).fold(0.0, f64::max);
        // As fast as it gets anywhere; as programmed, but for the last, which is too fast for the way.
        assert!((feed_mm_s - peak_mm_s).abs() < 1e-5 * peak_mm_s, "{text}: {feed_mm_s} {peak_mm_s}");
        let programmed_mm_s = f64::from(feed_mm_min) / 60.0;
        if feed_mm_min < 90_000 {
            assert!((feed_mm_s - programmed_mm_s).abs() < 1e-5 * programmed_mm_s, "{text}: {feed_mm_s}");
        } else {
            assert!(feed_mm_s < 0.5 * programmed_mm_s, "{text}: {feed_mm_s}");
            // It brakes as it sped up.
            assert!((stretch.length_mm() - 2.0 * to_trip_mm).abs() < 1e-5, "{text}: {to_trip_mm}");
        }
    }
}

#[test]
fn the_programmed_end_is_the_latest_rest() {
    let program = read("G38.2 X5 Y5 Z-10.001 F3000\n");
    let [probe] = probes(&program)[..] else { panic!("one") };
    assert_eq!((probe.to, mm(probe.end)), (probe.end, [5.0, 5.0, -10.001]));
    assert_eq!(mm(probe.trip.unwrap())[2], -10.0);
}

#[test]
fn positions_count_as_the_program_does() {
    // Offset, turned by 90°, shifted, with a tool's length, in inches.
    let text = "G10 L2 P2 X20 Y10 Z5 R90\nG55\nG92 X[#5420-1] Y[#5421-2] Z[#5422-3]\nG43.1 Z7\n\
                G53 G0 X50 Y30 Z0\nG20\nG38.2 Z-10 F10\n";
    let program = read(text);
    // −10 = z + 3 + 5 + 7; x and y of the machine are 30 and 20 from the origin, turned back by 90°.
    let expected = [20.0 - 1.0, -30.0 - 2.0, -25.0].map(|mm: f64| mm / 25.4);
    assert_near(read_back(&program), [expected[0], expected[1], expected[2], 1.0], 1e-9);
    // An offset that is set by it is that of the surface.
    let program = read("G0 X50 Y30\nG38.2 Z-20 F60\nG10 L20 P1 Z[#5422-#5063]\n");
    assert_near([program.parameters.get(5223)], [-10.0], 1e-9);
}

#[test]
fn a_probe_leaves_the_surface_too() {
    let program = read("G0 X50 Y30 Z-12\nG38.4 Z20 F60\n");
    let [probe] = probes(&program)[..] else { panic!("one") };
    assert!(probe.leaves);
    assert_eq!(read_back(&program), [50.0, 30.0, -10.0, 1.0]);
    assert!(mm(probe.to)[2] > -10.0 && mm(probe.to)[2] < -9.0);
    // The mode goes on: the next line's axis words probe again, the same way.
    let program = read("G0 X50 Y30\nG38.3 Z-9 F60\nX60\nZ-11\n");
    assert_eq!(
        probes(&program).iter().map(|probe| probe.trip.is_some()).collect::<Vec<_>>(),
        [false, false, true]
    );
    assert_eq!(program.parameters.get(5070), 1.0);
}

#[test]
fn misses_are_told_or_refused() {
    let program = read("G0 X5 Y5\nG38.2 Z-20 F60\nG0 Z9\nG38.3 Z-9 X7\nG1 X8\n");
    assert_eq!(read_back(&program), [7.0, 5.0, -9.0, 0.0]);
    assert_eq!(probes(&program)[1].to, probes(&program)[1].end);
    for (text, place, message) in [
        (
            "F60 G38.2 Z-9",
            "1:5:",
            "found G38.2 up to X0.0000 Y0.0000 Z-9.0000 of the machine, where the probe does not touch as",
        ),
        ("G0 Z-12\nF60 G38.4 Z-11", "2:5:", "where the probe touches as before"),
        (
            "G0 Z-12\nF60 G38.2 Z-20",
            "2:5:",
            "found G38.2 where the probe touches, at X0.0000 Y0.0000 Z-12.0000",
        ),
        ("F60 G38.4 Z-20", "1:5:", "found G38.4 where the probe does not touch, at"),
        ("F60 G38.2 Z0", "1:5:", "found G38.2 to where the machine is"),
        ("F60\nG38.2", "2:1:", "found G38.2, expected axis words"),
        ("G38.2 Z-20", "1:1:", "found G38.2 without a feed"),
        ("G93 G38.2 Z-20 F1", "1:5:", "found G38.2 after G93 or G95, expected G94"),
        ("S9 G95 G38.3 Z-20 F1", "1:8:", "found G38.3 after G93 or G95"),
        ("F60 G53 G38.2 Z-20", "1:15:", "with G53, expected G0 or G1"),
        ("F60 G41.1 D3\nG38.2 Z-20", "2:1:", "found G38.2 with G41 or G42 in force"),
        ("F60 G38.6 Z-20", "1:5:", "found G38.6, expected one of"),
        ("F60 G38.2 Z-20 P1", "1:16:", "found P1"),
    ] {
        let shown = refusal(text);
        assert!(shown.starts_with(&format!("a.ngc:{place}")) && shown.contains(message), "{text}: {shown}");
    }
    let without =
        gcode::read_with("a.ngc", b"F60 G38.2 Z-20", &ReadOptions::default()).unwrap_err().to_string();
    assert!(
        without.contains("found G38.2, which needs a probe, expected [[probe.box]] in a machine file"),
        "{without}"
    );
}

#[test]
fn what_trips_where_it_stands_does_not_move() {
    let program = read("G0 Z-12\nG38.3 Z-20 F60\nG0 Z0\nG38.5 Z9\nG38.3 Z0\nM2\n");
    let probes = probes(&program);
    assert_eq!(probes.iter().map(|probe| mm(probe.to)[2]).collect::<Vec<_>>(), [-12.0, 0.0, 0.0]);
    assert_eq!(probes.iter().map(|probe| probe.trip.is_some()).collect::<Vec<_>>(), [true, true, false]);
    let probed = run(&machine(), "G0 Z-12\nG38.3 Z-20 F60\nG0 Z0\nG38.5 Z9\nG38.3 Z0\nM2\n");
    assert_eq!(probed.iter().map(|probed| probed.tripped).collect::<Vec<_>>(), [true, true, false]);
    assert_near(probed[0].position_mm, [0.0, 0.0, -12.0], 0.05);
}

#[test]
fn an_end_beyond_the_travel_is_refused_wherever_the_probe_trips() {
    let mut machine = machine();
    machine.axes[2].travel_mm = Some([-20.0, 5.0]);
    let planned =
        |text: &str| plan_program("a.ngc", &read_on(&machine, text), &machine, Mode::Spanning).map(|_| ());
    assert_eq!(planned("G38.2 Z-20 F60"), Ok(()));
    let refused = planned("G0 Z1\nG38.2 Z-20.5 F60").expect_err("beyond").to_string();
    assert_eq!(refused, "a.ngc:2: found Z at -20.5000 mm, expected its travel, -20 to 5 mm");
}

fn run(machine: &Machine, text: &str) -> Vec<Probed> {
    let program = read_on(machine, text);
    let plan =
        plan_program("a.ngc", &program, machine, Mode::Spanning).unwrap_or_else(|error| panic!("{error}"));
    let summary = simulate::run(&plan, machine, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"));
    assert!(summary.faults.is_empty(), "{:?}", summary.faults);
    let said = summary.notices.iter().any(|notice| notice.contains("the program reads"));
    assert!(!said, "{:?}", summary.notices);
    summary.probes
}

/// The encoders latch what the program reads: along the way not before the surface and at most a tick behind it, across it
/// within the following error.
#[test]
fn the_encoders_latch_what_the_program_reads() {
    let machine = machine();
    let text = "G0 X50 Y20\nG38.2 Z-20 F600\nG1 Z-8 F300\nG38.3 Z-9.5\nG0 X-20 Y70\nZ-15\nG1 X-5 Y55\n\
                G38.2 X15 Y35 F3000\nG38.4 X-9 F30\nG0 X150\nM2\n";
    let program = read_on(&machine, text);
    let plan = plan_program("a.ngc", &program, &machine, Mode::Spanning).unwrap();
    let mut errors_mm = [0.0_f64; 3];
    let observe = &mut |row: &motion_host::trace::TraceRow| {
        for (most, axis) in errors_mm.iter_mut().zip(&row.axes) {
            *most = most.max(axis.err_um.abs() / 1e3);
        }
    };
    let summary = simulate::run(&plan, &machine, observe).unwrap();
    let probed = &summary.probes;
    let lines: Vec<_> = probed.iter().map(|probed| (probed.line, probed.tripped)).collect();
    assert_eq!(lines, [(2, true), (4, false), (8, true), (9, true)]);
    for (probed, probe) in probed.iter().zip(probes(&program)) {
        let Some(trip) = probe.trip.map(mm) else {
            assert_eq!(probed.program_mm, None);
            assert_near(probed.position_mm, mm(probe.end), 0.01);
            continue;
        };
        assert_eq!(probed.program_mm, Some(trip));
        let gcode::Feed::MmPerMin(feed_mm_min) = probe.feed else { panic!("a feed") };
        let tick_mm = feed_mm_min / 60.0 * machine.tick_s;
        for axis in 0..3 {
            let apart_mm = (probed.position_mm[axis] - trip[axis]).abs();
            assert!(apart_mm <= errors_mm[axis] + tick_mm, "{probed:?}");
        }
        // On the face that is met or left, the encoder itself decides: not before it, and at most a tick behind.
        let face = (0..3).find(|&axis| trip[axis] == PLATE.low_mm[axis] || trip[axis] == PLATE.high_mm[axis]);
        let axis = face.expect("a face");
        let way = mm(probe.end)[axis] - mm(probe.from)[axis];
        let behind_mm = (probed.position_mm[axis] - trip[axis]) * way.signum();
        assert!((0.0..=1.5 * tick_mm + 1e-3).contains(&behind_mm), "{behind_mm}: {probed:?}");
    }
}

/// Its stops are no corners that a path mode would round.
#[test]
fn stops_at_a_probe_are_no_corners() {
    let corners = |text: &str| {
        let plan = plan_program("a.ngc", &read_on(&machine(), text), &machine(), Mode::Spanning).unwrap();
        motion_host::check::Times::of(&plan).corner_stops
    };
    assert_eq!(corners("G61 G0 X5 Y5\nG38.2 Z-20 F60\nG0 Z5\nG38.3 Z3\nG38.3 Z3\nG0 X9"), 0);
    assert_eq!(corners("G61 G0 X5 Y5\nZ-5\nG38.2 Z-20 F60\nG0 Z5\nX9"), 2);
}

/// The sample finds the plate of the machine file.
#[test]
fn the_sample_finds_the_plate() {
    let text = include_str!("../../tests/programs/probing/plate.ngc");
    let program = read(text);
    let found = [5221, 5222, 5223].map(|number| program.parameters.get(number));
    assert_near(found, [0.0, 0.0, -10.0], 1e-9);
    let tripped: Vec<bool> = run(&machine(), text).iter().map(|probed| probed.tripped).collect();
    assert_eq!(tripped, [true, true, true, true, true, true, true, false]);
}

/// Surfaces against a walk in small steps, which knows nothing of faces.
#[test]
fn a_walk_meets_surfaces_at_the_same_place() {
    const STEPS: u32 = 20_000;
    let mut random = Random::of_stream(18);
    let mut met = [0; 2];
    for case in 0..400 {
        let mut point = || [(); 3].map(|()| (random.between(-10.0, 10.0) * 100.0).round() / 100.0);
        let boxes = [(); 4].map(|()| {
            let (low_mm, size_mm): ([f64; 3], [f64; 3]) = (point(), point());
            TouchBox { low_mm, high_mm: std::array::from_fn(|axis| low_mm[axis] + size_mm[axis].abs()) }
        });
        let (surface, to): (_, [f64; 3]) = (Surface { boxes: boxes.to_vec() }, point());
        // Half of the cases begin within a box.
        let middle = |axis: usize| (boxes[0].low_mm[axis] + boxes[0].high_mm[axis]) / 2.0;
        let from = if case % 2 == 0 { std::array::from_fn(middle) } else { point() };
        let at = |share: f64| std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis]));
        let touches = surface.is_touched(from);
        let walked = (0..=STEPS).map(|step| at(f64::from(step) / f64::from(STEPS)));
        let walked = walked.into_iter().find(|&at| surface.is_touched(at) != touches);
        let found = if touches { surface.left_at_mm(from, to) } else { surface.touched_at_mm(from, to) };
        met[usize::from(touches)] += u32::from(found.is_some());
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 0.003);
        match (walked, found) {
            (Some(walked), Some(found)) if near(walked, found) => {}
            (None, None) => {}
            // Between two steps an edge may be cut or a gap passed.
            (_, Some(found)) => {
                let axis =
                    (0..3).max_by(|&a, &b| (to[a] - from[a]).abs().total_cmp(&(to[b] - from[b]).abs()));
                let axis = axis.unwrap();
                let share = (found[axis] - from[axis]) / (to[axis] - from[axis]);
                let [before, after] = [-1e-9, 1e-9].map(|more| surface.is_touched(at(share + more)));
                assert!(before == touches && after != touches, "{case}: {walked:?} {found:?}");
            }
            (Some(walked), None) => panic!("{case}: {walked:?}"),
        }
    }
    assert!(met.iter().all(|&met| met > 20), "{met:?}");
}
