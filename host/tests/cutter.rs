//! Cutter radius compensation: named corners, what is refused, and random paths against plane geometry. LinuxCNC's
//! interpreter makes the same moves (`tests/peers/linuxcnc/programs/cutter*.ngc`).

use std::fmt::Write as _;

use motion_host::gcode::{self, Feed, Point, Program, ReadOptions, StepKind, ToolTable, xyz_mm};
use motion_tests::random::Random;
use std::f64::consts::PI;

const RADIUS_MM: f64 = 2.0;

fn options() -> ReadOptions {
    let text = b"T1 D4\nT2 D-4\nT3 D2 Q3\n";
    ReadOptions { tools: Some(ToolTable::parse("tool.tbl", text).unwrap()), ..ReadOptions::default() }
}

fn try_read(text: &str) -> Result<Program, String> {
    gcode::read_with("a.ngc", text.as_bytes(), &options()).map_err(|error| error.to_string())
}

fn mm(point: Point) -> [f64; 3] {
    xyz_mm(point)
}

/// The steps, to a thousandth of a millimetre and degree.
fn steps(text: &str) -> Vec<String> {
    let short = |value: f64| (value * 1e3).round() / 1e3 + 0.0;
    let point = |at: Point| {
        let [x, y, z] = mm(at).map(short);
        format!("{x} {y} {z}")
    };
    let program = try_read(text).unwrap_or_else(|error| panic!("{error}"));
    let shown = program.steps.iter().map(|step| match &step.kind {
        StepKind::Line(line) if line.feed == Feed::Rapid => format!("r {}", point(line.to)),
        StepKind::Line(line) => format!("l {}", point(line.to)),
        StepKind::Arc(arc) => format!("a {} by {}", point(arc.to), short(arc.sweep_rad.to_degrees())),
        StepKind::Dwell { .. } => "dwell".to_owned(),
        StepKind::ToolChange { tool } => format!("T{tool}"),
        StepKind::Stop => "stop".to_owned(),
        other => format!("{other:?}"),
    });
    shown.collect()
}

#[test]
fn outer_corners_are_rounded_and_inner_ones_cut_short() {
    // Round a square from outside, and inside of it.
    assert_eq!(
        steps("F9 G42 D1\nG1 X10 Y0\nX20\nY10\nX10\nG40 G1 X0 Y0"),
        ["l 10 -2 0", "l 20 -2 0", "a 22 0 0 by 90", "l 22 10 0", "a 20 12 0 by 90", "l 10 12 0", "l 0 0 0"]
    );
    assert_eq!(
        steps("F9 G41 D1\nG1 X10 Y0\nX20\nY10\nX10\nG40 G1 X0 Y0"),
        ["l 10 2 0", "l 18 2 0", "l 18 8 0", "l 10 8 0", "l 0 0 0"]
    );
    // At G0 no arc; what stands at a corner happens there, also what moves across the plane.
    assert_eq!(
        steps("F9 G42 D1\nG1 X10 Y0\nG0 Y10\nG4 P1\nG1 Z5\nM0\nX20\nG40"),
        ["l 10 -2 0", "r 12 0 0", "r 12 8 0", "dwell", "l 12 8 5", "stop", "l 20 8 5"]
    );
}

#[test]
fn arcs_keep_their_centres() {
    // Inside, outside, an inner corner between line and arc, and a whole turn.
    assert_eq!(steps("F9 G41 D1\nG1 X10 Y0\nG3 X10 Y20 I0 J10\nG40"), ["l 10 2 0", "a 10 18 0 by 180"]);
    assert_eq!(steps("F9 G42 D1\nG1 X10 Y0\nG3 X10 Y20 J10\nG40"), ["l 10 -2 0", "a 10 22 0 by 180"]);
    assert_eq!(steps("F9 G41 D1\nG1 X10 Y0\nG3 X10 Y0 J10\nG40"), ["l 10 2 0", "a 10 2 0 by 360"]);
    assert_eq!(
        steps("F9 G41 D1\nG1 X10 Y0\nG2 X20 Y10 I10\nG40"),
        // (20 − 12 cos φ, 12 sin φ) at the height 2 of the line beside.
        ["l 8.168 2 0", "a 20 12 0 by -80.406"]
    );
    // Back along a line from the outside of an arc, and back from a line onto one: the tool stays on its side.
    assert_eq!(
        steps("F9 G42 D1\nG1 X10 Y0\nG3 X10 Y20 J10\nG1 X30\nG40"),
        ["l 10 -2 0", "a 18.944 18 0 by 131.81", "l 30 18 0"]
    );
    assert_eq!(
        steps("F9 G42 D1\nG1 X3 Y0\nX10\nG3 X10 Y0 J-5\nG40"),
        ["l 3 -2 0", "l 3.675 -2 0", "a 10 2 0 by 295.377"]
    );
    // The entry along an arc ends tangent to the path: its centre, (-2.25, 10), is level with its end.
    assert_eq!(steps("F9 G41 D1\nG3 X10 Y10 J10\nG40"), ["a 8 10 0 by 77.32"]);
}

#[test]
fn the_radius_has_a_source() {
    let line = ["l 10 2 0"];
    for text in [
        "F9 G41 D1 G1 X10",
        "T1 M6\nF9 G41 G1 X10",
        "T1 M6\nF9 G41 D0 G1 X10",
        "F9 G41.1 D4 G1 X10",
        "F9 G42.1 D-4 G1 X10",
        "F9 G42 D2 G1 X10",
        "G10 L1 P1 R2\nF9 G41 D1 G1 X10",
        "#1=[#<_ccomp>]\nF9 G41 D1 G1 X[#1/40]",
    ] {
        assert_eq!(steps(text).last().map(String::as_str), line.last().copied(), "{text}");
    }
    // Without a table it is known from the program alone; radius 0 keeps the path.
    let read = |text: &str| gcode::read("a.ngc", text.as_bytes());
    let error = read("T5 M6\nF9 G41 G1 X10").unwrap_err().to_string();
    assert!(error.starts_with("a.ngc:2:4: found tool 5, whose radius is not known"), "{error}");
    assert!(read("T5 M6\nG10 L1 P5 R2\nF9 G41 G1 X10").is_ok());
    // A radius of the machine's holds for every tool, as long as there is no table.
    let of_machine = ReadOptions { tool_radius_mm: 2.0, ..ReadOptions::default() };
    let read = |text: &str| gcode::read_with("a.ngc", text.as_bytes(), &of_machine).unwrap();
    for text in ["T5 M6\nF9 G41 G1 X10", "F9 G41 D7 G1 X10", "G10 L1 P5 Z9\nF9 G41 D5 G1 X[#5410*2.5]"] {
        let program = read(text);
        let Some(StepKind::Line(last)) = program.steps.last().map(|step| &step.kind) else {
            panic!("a line")
        };
        assert_eq!(mm(last.to), [10.0, 2.0, 0.0], "{text}");
    }
    let notes = read("T5 M6\nM2").notes(|_| false);
    assert!(notes[0].starts_with("length 0 and radius 2 mm are assumed"), "{notes:?}");
    let notes = read("F9 G41 D7 G1 X10").notes(|_| false);
    assert!(notes.iter().any(|note| note.ends_with("there is no tool table: tools 7")), "{notes:?}");
    let with_table = ReadOptions { tool_radius_mm: 2.0, ..options() };
    let error = gcode::read_with("a.ngc", b"F9 G41 D77 G1 X10", &with_table).unwrap_err().to_string();
    assert!(error.contains("found tool 77, whose radius is not known"), "{error}");
    assert_eq!(steps("F9 G41.1 D0 G1 X1\nG2 X3 I1\nG40\nG3 X1 I-1").len(), 3);
}

#[test]
fn a_lathes_tool_is_led_by_its_nose() {
    // Orientation 3: the controlled point is the nose's greatest X and least Z.
    assert_eq!(
        steps("G18 F9\nG0 X20 Z10\nG42 D3\nG1 X10 Z5\nZ-5\nG40"),
        ["r 20 0 10", "l 12 0 3.382", "l 12 0 -6"]
    );
}

#[test]
fn what_does_not_go_is_refused() {
    for (text, expected) in [
        ("F9 G41 D7 G1 X9", "1:8: found tool 7, whose radius is not known"),
        ("F9 G41 G1 X9", "1:4: found tool 0, whose radius is not known"),
        ("G41.1", "1:1: found G41.1, expected the tool's diameter"),
        ("G41 D1\nG42 D1", "2:1: found G42 with G41 or G42 in force"),
        ("G41 D1 G19", "1:1: found G41, expected the XY plane"),
        ("G41 D1\nG18", "2:1: found G18 with G41"),
        ("G41 D3", "1:1: found G41, expected the ZX plane (G18)"),
        ("G41 D1.5", "1:5: found D1.5, expected a whole tool number"),
        ("G41.1 D1 L2", "1:1: found G41.1, expected the ZX plane (G18)"),
        ("G18 G41.1 D1 L10", "1:14: found L10, expected a whole orientation"),
        ("F9 G41 D1\nG1 X2", "2:1: found a first move of 2.000000 mm after G41 or G42"),
        ("F9 G41 D1\nG3 X1 I.5", "2:1: found an arc that is too tight"),
        ("F9 G41 D1\nG1 X9\nG3 Y2 J1", "3:1: found an arc that is too tight"),
        ("F9 G41 D1\nG1 X9\nY2\nX0", "4:1: found a corner up to here"),
        ("F9 G41 D1\nG1 X9\nX10\nY3\nX0\nG40", "4:1: found a corner up to here"),
        ("F9 G41 D1\nG1 X9\nX20\nX10 Y1\nM2", "4:1: found a corner up to here"),
        ("F9 G41 D1\nG1 X9\nG3 X9 Y10 J5\nG1 X20 Y-10\nX0", "4:1: found a corner up to here"),
        ("F9 G42 D1\nG1 X10 Y12\nY0\nG3 X9.487 Y-.0905 J-1.5\nG40", "5:1: found a corner up to here"),
        ("F9 G41 D1\nG1 X9\nX20\nX10 Y1", "4:1: found a corner up to here"),
        ("F9 G41 D1\nG1 X9\nG40 G2 X3 I-3", "3:5: found G2 right after G40"),
        ("F9 G41 D1\nG1 X9\nG40\nG5 X3 Y2 I1 J1 P1 Q1", "4:1: found G5 right after G40"),
        ("F9 G41 D1\nG1 X9\nG53 G0 X1", "3:1: found G53 with G41"),
        ("F9 G41 D1\nG1 X9\nG81 X1 R2 Z-1", "3:1: found G81 with G41"),
        ("F9 G41 D1\nG5.2 X1 Y1 P1 L3", "2:1: found G5.2 with G41"),
        ("G41 D1\nG28", "2:1: found G28 with G41"),
        ("G41 D1\nG92 X1", "2:1: found G92 with G41"),
        ("G41 D1\nG92.1", "2:1: found G92.1 with G41"),
        ("G41 D1\nG55", "2:1: found G55 with G41"),
        ("G41 D1\nG49", "2:1: found G49 with G41"),
        ("G41 D1\nG10 L2 P1 X1", "2:1: found G10 with G41"),
        ("G41 D1\nT1 M6", "2:4: found M6 with G41"),
        ("M70\nG43.1 Z1\nG41 D1\nM72", "4:1: found another plane or offset restored with G41"),
    ] {
        let Err(error) = try_read(text) else { panic!("accepted:\n{text}") };
        assert!(error.starts_with(&format!("a.ngc:{expected}")), "{text}\n{error}");
    }
}

#[test]
fn the_position_is_known_behind() {
    // The next move starts beside the path; a tool change reads the position anew; what ends at a corner may vanish.
    assert_eq!(steps("F9 G41 D1\nG1 X9\nG40\nG53 G1 X9 Y0"), ["l 9 2 0", "l 9 0 0"]);
    assert_eq!(steps("F9 G41 D1\nG1 X9\nG40\nG81 X9 Y0 R0 Z-1").first().unwrap(), "l 9 2 0");
    assert_eq!(steps("F9 G41 D1\nG1 X9\nG40\nT1 M6\nG1 Z1"), ["l 9 2 0", "T1", "l 9 2 1"]);
    assert_eq!(
        steps("F9 G41 D1\nG1 X9\nX20\nY4\n(MSG, here)\nX9\nG40"),
        ["l 9 2 0", "l 18 2 0", "l 9 2 0"],
        "a slot of the tool's width"
    );
}

/// A programmed move, for the distance of points from it.
#[derive(Clone, Copy)]
enum Piece {
    Line([f64; 2], [f64; 2]),
    Arc { centre: [f64; 2], start: [f64; 2], sweep_rad: f64 },
}

impl Piece {
    fn distance_mm(self, [x, y]: [f64; 2]) -> f64 {
        match self {
            Self::Line([ax, ay], [bx, by]) => {
                let (dx, dy) = (bx - ax, by - ay);
                let share = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy);
                let share = share.clamp(0.0, 1.0);
                (x - ax - share * dx).hypot(y - ay - share * dy)
            }
            Self::Arc { centre: [cx, cy], start: [ax, ay], sweep_rad } => {
                let to_start_rad = (ay - cy).atan2(ax - cx);
                let along_rad = ((y - cy).atan2(x - cx) - to_start_rad) * sweep_rad.signum();
                let radius_mm = (ax - cx).hypot(ay - cy);
                if along_rad.rem_euclid(2.0 * PI) <= sweep_rad.abs() {
                    return ((x - cx).hypot(y - cy) - radius_mm).abs();
                }
                let (sin, cos) = (to_start_rad + sweep_rad).sin_cos();
                let to_end = (x - cx - radius_mm * cos).hypot(y - cy - radius_mm * sin);
                to_end.min((x - ax).hypot(y - ay))
            }
        }
    }
}

/// A random path of moderate corners, as text and pieces.
fn random_path(random: &mut Random) -> (String, Vec<Piece>) {
    let side = if random.chance(0.5) { "G41" } else { "G42" };
    let mut text = format!("F600 {side} D1\n");
    let mut pieces = Vec::new();
    let (mut at, mut heading) = ([0.0, 0.0], random.between(-3.0, 3.0));
    for index in 0..2 + random.below(6) {
        if index > 0 {
            // Less than 0.05 rad are no corner.
            heading += if random.chance(0.2) { 0.0 } else { random.sign() * random.between(0.06, 1.7) };
        }
        if index == 0 || random.chance(0.5) {
            let length = random.between(4.0, 20.0);
            let to = [at[0] + length * heading.cos(), at[1] + length * heading.sin()];
            let _ = writeln!(text, "G1 X{:.9} Y{:.9}", to[0], to[1]);
            pieces.push(Piece::Line(at, to));
            at = to;
        } else {
            let (radius, left) = (random.between(1.0, 20.0), random.sign());
            let sweep_rad = left * random.between(0.3, 1.0);
            let out = [-left * radius * heading.sin(), left * radius * heading.cos()];
            let centre = [at[0] + out[0], at[1] + out[1]];
            let (sin, cos) = sweep_rad.sin_cos();
            let to = [centre[0] - cos * out[0] + sin * out[1], centre[1] - sin * out[0] - cos * out[1]];
            let word = if left > 0.0 { "G3" } else { "G2" };
            let _ = writeln!(text, "{word} X{:.9} Y{:.9} I{:.9} J{:.9}", to[0], to[1], out[0], out[1]);
            pieces.push(Piece::Arc { centre, start: at, sweep_rad });
            at = to;
            heading += sweep_rad;
        }
    }
    text.push_str("G40\nM2\n");
    (text, pieces)
}

/// Points of a step, its ends included.
fn points(kind: &StepKind) -> Vec<[f64; 2]> {
    const COUNT: u32 = 50;
    let shares = (0..=COUNT).map(|part| f64::from(part) / f64::from(COUNT));
    match kind {
        StepKind::Line(line) => {
            let ([ax, ay, _], [bx, by, _]) = (mm(line.from), mm(line.to));
            shares.map(|share| [ax + (bx - ax) * share, ay + (by - ay) * share]).collect()
        }
        StepKind::Arc(arc) => {
            let ([x, y, _], [cx, cy]) = (mm(arc.from), arc.centre_mm);
            let growth = arc.end_radius_mm / arc.start_radius_mm - 1.0;
            let turned = |share: f64| {
                let (sin, cos) = (arc.sweep_rad * share).sin_cos();
                let (dx, dy) = ((x - cx) * (1.0 + growth * share), (y - cy) * (1.0 + growth * share));
                [cx + cos * dx - sin * dy, cy + sin * dx + cos * dy]
            };
            shares.map(turned).collect()
        }
        _ => Vec::new(),
    }
}

#[test]
fn the_tool_touches_its_move_and_cuts_into_neither_neighbour() {
    // Nine decimals, and what they leave of tangents: sqrt(2 · 2 · 10⁻⁹).
    const TOLERANCE_MM: f64 = 1e-4;
    let seed = 20_261_124;
    println!("seed {seed}");
    let mut random = Random::new(seed);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..3000 {
        let (text, pieces) = random_path(&mut random);
        let program = match try_read(&text) {
            Ok(program) => program,
            Err(error) => {
                assert!(
                    error.contains("corner up to here") || error.contains("too tight"),
                    "{error}\n{text}"
                );
                refused += 1;
                continue;
            }
        };
        read += 1;
        let mut at: Option<[f64; 2]> = None;
        // The first line is that of the modes.
        for step in &program.steps {
            let Some(index) = (step.line as usize).checked_sub(2) else { continue };
            let points = points(&step.kind);
            let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
            if let Some(at) = at {
                assert!((at[0] - first[0]).hypot(at[1] - first[1]) < 1e-6, "a gap\n{text}");
            }
            at = Some(*last);
            if index == 0 {
                continue;
            }
            for point in points {
                let beside = pieces[index].distance_mm(point);
                assert!(
                    (beside - RADIUS_MM).abs() < TOLERANCE_MM,
                    "{beside} mm beside {}\n{text}",
                    step.line
                );
                let before = pieces[index - 1].distance_mm(point);
                assert!(before > RADIUS_MM - TOLERANCE_MM, "{before} mm from before {}\n{text}", step.line);
                if let Some(next) = pieces.get(index + 1) {
                    let next = next.distance_mm(point);
                    assert!(next > RADIUS_MM - TOLERANCE_MM, "{next} mm from behind {}\n{text}", step.line);
                }
            }
        }
    }
    println!("{read} read, {refused} refused");
    assert!(read > 1000 && refused > 100, "{read} read, {refused} refused");
}
