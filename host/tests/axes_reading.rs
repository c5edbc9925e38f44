//! Programs of machines with one to nine axes: what their words do, and what is refused.

use motion_host::gcode::{
    self, AXES_MAX, Axes, Axis, Feed, Point, Program, ReadOptions, StepKind, ToolTable,
};

fn axes(letters: &str) -> Axes {
    letters.bytes().map(|letter| Axis::of_letter(letter).expect("an axis")).collect()
}

fn try_read(letters: &str, text: &str) -> Result<Program, String> {
    let tools = ToolTable::parse("tool.tbl", b"T1 P1 Z50 A2 W-3\n").expect("a table");
    let options = ReadOptions { axes: axes(letters), tools: Some(tools), ..ReadOptions::default() };
    gcode::read_with("a.ngc", text.as_bytes(), &options).map_err(|error| error.to_string())
}

fn read(letters: &str, text: &str) -> Program {
    try_read(letters, text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// The coordinates of a point that are not 0, as words.
fn words(point: Point) -> String {
    let word = |axis: Axis| Some((axis, point[axis.index()].to_mm())).filter(|(_, value)| *value != 0.0);
    let words: Vec<String> =
        Axis::ALL.into_iter().filter_map(word).map(|(axis, value)| format!("{axis}{value}")).collect();
    words.join(" ")
}

/// Where every move ends, and its feed.
fn moves(program: &Program) -> Vec<(String, Option<f64>)> {
    let of = |feed: Feed| match feed {
        Feed::Rapid => None,
        Feed::MmPerMin(feed) => Some(feed),
    };
    let shown = program.steps.iter().filter_map(|step| match step.kind {
        StepKind::Through(point) => Some((words(point.to), of(point.feed))),
        StepKind::Line(line) => Some((words(line.to), of(line.feed))),
        StepKind::Arc(arc) => Some((words(arc.to), of(arc.feed))),
        _ => None,
    });
    shown.collect()
}

fn ends(letters: &str, text: &str) -> Vec<String> {
    moves(&read(letters, text)).into_iter().map(|(end, _)| end).collect()
}

#[test]
fn every_letter_moves_its_axis() {
    let all = "XYZABCUVW";
    assert_eq!(ends(all, "G0 X1 Y2 Z3 A4 B5 C6 U7 V8 W9"), ["X1 Y2 Z3 A4 B5 C6 U7 V8 W9"]);
    assert_eq!(ends(all, "G91 G0 A10\nA-2.5 w1\nG90 A0"), ["A10", "A7.5 W1", "W1"]);
    // Degrees are degrees in inches, too; U is a length.
    assert_eq!(ends(all, "G20 G0 X1 A90 U0.1"), ["X25.4 A90 U2.54"]);
    assert_eq!(ends("XZ", "G18 G0 X5\nG2 X0 Z-5 K-5 F60"), ["X5", "Z-5"]);
    assert_eq!(ends("XZ", "G10 L2 P1 R180\nG18 G0 X5\nG2 X0 Z-5 K-5 F60"), ["X-5", "Z-5"]);
}

/// LinuxCNC: over X, Y and Z where one of them moves, else over U, V and W, else over A, B and C.
#[test]
fn feeds_count_along_the_first_group_that_moves() {
    let feeds = |text: &str| -> Vec<f64> {
        moves(&read("XYZABCUVW", text)).into_iter().filter_map(|(_, feed)| feed).collect()
    };
    assert_eq!(feeds("G1 F600 X10 A90\nA0\nU5 A3"), [600.0, 600.0, 600.0]);
    assert_eq!(feeds("G20 G1 F10 X1 A90\nA0\nU1 A3"), [254.0, 10.0, 254.0]);
    // Four moves of a quarter of a minute.
    assert_eq!(feeds("G93 G1 F4 X3 Y4 A90\nF4 A0 B0\nF4 U6 V8 A1\nF4 A31 C40"), [20.0, 360.0, 40.0, 200.0]);
    assert_eq!(feeds("G95 S100 M3 G1 F0.5 X1\nA9\nG20 F0.5 A0 \nX0"), [50.0, 50.0, 50.0, 1270.0]);
    // Points of a spline, too.
    assert_eq!(feeds("G20 F100 G5.5 A30\nA60\nX1 A90"), [100.0, 100.0, 2540.0]);
    // And moves beside a compensated path that leave its plane alone.
    assert_eq!(feeds("G20 G41.1 D0.1 G1 F10 X1 Y1 A9\nA30\nX3"), [254.0, 10.0, 254.0, 254.0]);
    // A helix counts X, Y and Z; the turning table follows.
    assert_eq!(feeds("G93 G2 X10 Y0 I5 A90 F2"), [10.0 * std::f64::consts::PI]);
}

#[test]
fn offsets_are_of_all_axes() {
    let all = "XYZABCUVW";
    assert_eq!(ends(all, "G10 L2 P1 A30 W2 R90\nG0 X1 A10 W1"), ["Y1 A40 W3"]);
    assert_eq!(ends(all, "G0 A90\nG92 A0 U1\nG0 A10 U2"), ["A90", "A100 U1"]);
    assert_eq!(ends(all, "G52 B5 V1\nG0 B10 V1\nG53 G0 B1"), ["B15 V2", "B1 V2"]);
    assert_eq!(ends(all, "T1 M6 G43\nG0 Z0 A0 W0\nG49 G0 Z0 A0 W0"), ["Z50 A2 W-3", ""]);
    assert_eq!(ends(all, "G43.1 C7\nG0 C1"), ["C8"]);
    assert_eq!(ends(all, "G10 L20 P1 A-10 X5\nG0 A0 X5"), ["A10"]);
    assert_eq!(
        ends(all, "G0 X1 A9 U3\nG30.1\nG0 X5 A5 U5\nG30 A7\nG0 X2\nG30"),
        ["X1 A9 U3", "X5 A5 U5", "X5 A7 U5", "X5 A9 U5", "X2 A9 U5", "X1 A9 U3"]
    );
    let program = read(
        all,
        "G0 A9 W2\nG28.1\nG92 A1\nG10 L2 P2 C3 V1\nG20\n#1=#5164 #2=#5214 #3=[#<_a> + #<_abs_w>]\n(DEBUG,#1 #2 #3 #5422 #5423 #5428)",
    );
    let stored = [5164, 5169, 5214, 5246, 5248].map(|number| program.parameters.get(number));
    assert_eq!(stored, [9.0, 2.0, 8.0, 3.0, 1.0]);
    let w = 2.0 / 25.4;
    assert_eq!(
        program.messages[0].text,
        format!("{:.6} {:.6} {:.6} {:.6} {:.6} {:.6}", 9.0, 8.0, 1.0 + w, 0.0, 1.0, w)
    );
}

#[test]
fn axes_that_the_machine_does_not_have_are_refused_by_name() {
    for (letters, text, expected) in [
        ("XYZ", "G0 X1 A5", "a.ngc:1:7: found A5, expected an axis of the machine: X, Y, Z"),
        ("XZ", "G0 Y1", "a.ngc:1:4: found Y1, expected an axis of the machine: X, Z"),
        ("XYZA", "G92 B1", "a.ngc:1:5: found B1, expected an axis of the machine: X, Y, Z, A"),
        (
            "XZ",
            "G2 X4 I2 F60",
            "a.ngc:1:1: found G2 in the XY plane, expected a plane of the machine's axes: X, Z",
        ),
        ("XZ", "G5 X4 I1 J0 P0 Q0 F60", "a.ngc:1:1: found G5 in the XY plane"),
        (
            "XZ",
            "G10 L2 P1 R90\nG0 X1",
            "a.ngc:2:1: found a move of Y, expected moves of the machine's axes: X, Z",
        ),
        ("XZ", "G0 X1\n@5 ^90", "a.ngc:2:1: found a move of Y"),
        ("XYZA", "G81 X1 A3 Z-1 R1 F60", "a.ngc:1:8: found A3 in a line of G81, expected X, Y and Z only"),
        (
            "XYZA",
            "G5 X1 A3 I0 J1 P0 Q1 F60",
            "a.ngc:1:7: found A3 in a line of G5 or G5.1, expected X and Y only",
        ),
        ("XYZA", "F60 G5.2 X1 Y1 A3 P1", "a.ngc:1:16: found A3, expected no coordinate across the plane"),
        ("XZ", "G18 G10 L2 P1 R90\nG2 X10 I5 F100", "a.ngc:2:1: found G2 in the XY plane"),
        (
            "XZ",
            "T1 M6 G43",
            "a.ngc:1:7: found tool 1 with an offset along A, expected offsets along the machine's axes: X, Z",
        ),
        ("XYZA", "G0 X1 A2000000", "a.ngc:1:7: found A2000000, expected a value within ±1000000 °"),
    ] {
        let error = try_read(letters, text).expect_err(text);
        assert!(error.starts_with(expected), "{error}\n{expected}");
    }
}

/// What is stored for an axis that the machine does not have moves nothing.
#[test]
fn stored_places_move_the_axes_of_the_machine() {
    assert_eq!(ends("XYZ", "#5164=90 #5161=5\nG28"), ["X5"]);
    assert_eq!(ends("XYZA", "#5164=90 #5161=5\nG28"), ["X5 A90"]);
}

/// The point beside a path keeps what the path has across the plane.
#[test]
fn compensation_leaves_other_axes_alone() {
    let text = "G41.1 D2 G1 F60 X-9 Y0 A5\nX9 A90\nA80\nY-9 W4\nG40 X20 Y-20 A0";
    let found = ends("XYZAW", text);
    assert_eq!(found[0], "X-9 Y-1 A5");
    assert!(found.iter().any(|end| end.contains("A80")), "{found:?}");
    assert_eq!(found.last().expect("moves"), "X20 Y-20 W4");
}

/// Moves follow each other in every coordinate.
#[test]
fn moves_of_random_programs_follow_each_other() {
    let seed = 7;
    println!("seed {seed}");
    let mut random = motion_tests::random::Random::new(seed);
    for _ in 0..200 {
        let mut text = String::from("G1 F100\n");
        for _ in 0..20 {
            for axis in Axis::ALL {
                if random.below(3) == 0 {
                    let value = random.between(-50.0, 50.0);
                    text.push_str(&format!("{axis}{value:.3} "));
                }
            }
            text.push_str(
                ["\n", "\nG91\n", "\nG90\n", "\nG92 A1 U2\n", "\nG20\n", "\nG21\n"][random.below(6)],
            );
        }
        let Ok(program) = try_read("XYZABCUVW", &text) else { panic!("{text}") };
        let mut at = [gcode::Length::ZERO; AXES_MAX];
        for step in &program.steps {
            let Some([from, to]) = step.kind.ends() else { continue };
            assert_eq!(from, at, "{text}");
            at = to;
        }
    }
}
