//! Machines of two, four and nine axes, from G-code to recording and compiled program.

use std::path::Path;

use serde_json::Value;

use super::workspace::{Workspace, number};

const TESTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests");

/// Machine file, program, letters or names of the axes.
const MACHINES: [(&str, &str, &[&str]); 3] = [
    ("lathe", "lathe", &["Z", "X"]),
    ("mill_xyza", "rotary_table", &["X", "Y", "Z", "A"]),
    ("nine", "nine", &["X", "Y", "Z", "A", "B", "table", "quill", "V", "W"]),
];

/// A workspace with a machine's file, and its program. `of` is what is tried.
fn workspace(of: &str, machine: &str, program: &str) -> Workspace {
    let workspace = Workspace::new(&format!("{of}-{machine}"));
    for (from, to) in [
        (format!("{TESTS}/machines/{machine}.toml"), "machine.toml"),
        (format!("{TESTS}/programs/axes/{program}.ngc"), "program.ngc"),
    ] {
        std::fs::copy(Path::new(&from), workspace.0.join(to)).expect("a sample");
    }
    workspace
}

/// The columns of a CSV row, by their heads.
fn column<'a>(csv: &'a str, head: &str) -> impl Iterator<Item = f64> + 'a {
    let mut lines = csv.lines();
    let place = lines.next().expect("heads").split(',').position(|found| found == head);
    let place = place.unwrap_or_else(|| panic!("no column {head}"));
    lines.map(move |line| line.split(',').nth(place).expect("a cell").parse().expect("a number"))
}

#[test]
fn programs_of_two_four_and_nine_axes_run() {
    for (machine, program, names) in MACHINES {
        let workspace = workspace("machines", machine, program);
        let with = |command: &'static str| vec![command, "program.ngc", "--machine", "machine.toml"];
        let call = |command: &'static str, more: &[&'static str]| [&with(command)[..], more].concat();
        let run = workspace.json(&call(
            "run",
            &["--json", "--trace", "trace.csv", "--report", "report.html", "--record", "run.mrec"],
        ));
        assert_eq!(run["finished"], true, "{machine}");
        assert_eq!(run["faults"].as_array().map(Vec::len), Some(0), "{machine}");
        let found: Vec<&str> =
            run["axes"].as_array().expect("axes").iter().filter_map(|axis| axis["name"].as_str()).collect();
        assert_eq!(found, names, "{machine}");
        // The plan is what is driven.
        let plan = workspace.json(&call("plan", &["--json"]));
        assert!((number(&plan["time_s"]) - number(&run["time_s"])).abs() < 2e-3, "{machine}");
        // Each axis ends where the program leaves it, and of no other is anything told.
        let steps = workspace.stdout(&call("read", &["--json"]));
        let to: Vec<Value> = steps
            .lines()
            .map(|line| serde_json::from_str::<Value>(line).expect("JSON"))
            .filter_map(|step| step.get("to_mm").cloned())
            .collect();
        let end = to.last().expect("a move").as_array().expect("a point").clone();
        let trace = workspace.read("trace.csv");
        let head = trace.lines().next().expect("heads");
        assert_eq!(head.matches("_set_").count(), names.len(), "{head}");
        let letters = ["X", "Y", "Z", "A", "B", "table", "quill", "V", "W"];
        for name in names {
            let is_rotary = ["A", "B", "table"].contains(name);
            let set = column(&trace, &format!("{name}_set_{}", if is_rotary { "deg" } else { "mm" })).last();
            let place = letters.iter().position(|letter| letter == name).expect("an axis");
            assert!((set.expect("a tick") - number(&end[place])).abs() < 1e-9, "{machine} {name}");
        }
        let report = workspace.read("report.html");
        assert_eq!(report.contains("Rotary axes"), machine != "lathe", "{machine}");
        assert!(
            names.iter().all(|name| report.contains(&format!("<td>{name}</td>")) || report.contains(name))
        );
        let (said, _) = workspace.ending(0, &["replay", "run.mrec"]);
        assert!(said.contains("identical"), "{said}");
        // A program for a board has the axes of the machine.
        workspace.stdout(&call("compile", &["--output", "program.bin"]));
        let bytes = std::fs::read(workspace.0.join("program.bin")).expect("a program");
        assert_eq!((&bytes[..4], usize::from(bytes[5])), (&b"MOTN"[..], names.len()), "{machine}");
        let check = workspace.json(&call("check", &["--json"]));
        assert_eq!(check["accepted"], true);
        let extents = check["extent_mm"].as_array().expect("extents").len();
        assert_eq!(extents, if machine == "lathe" { 3 } else { names.len() });
    }
}

/// X moves at F and the table along with it; the table alone turns at F, in °/min.
#[test]
fn feeds_are_those_of_linear_axes_where_they_move() {
    let workspace = workspace("feeds", "mill_xyza", "rotary_table");
    workspace.put("groove.ngc", "G21 G90 G61 F400\nG1 X15 A30\nX-15 A-30\nG1 A30 F2000\nG1 X0 A0 F400\nM2\n");
    workspace.stdout(&["run", "groove.ngc", "--machine", "machine.toml", "--trace", "t.csv"]);
    let trace = workspace.read("t.csv");
    let of_line = |head: &'static str, line: f64| {
        let lines = column(&trace, "line");
        lines
            .zip(column(&trace, head))
            .filter(move |(of, _)| *of == line)
            .map(|(_, value)| value.abs())
            .fold(0.0, f64::max)
    };
    // In f32.
    assert!((of_line("X_vel_mm_s", 3.0) - 400.0 / 60.0).abs() < 1e-5);
    assert!((of_line("A_vel_deg_s", 3.0) - 2.0 * 400.0 / 60.0).abs() < 1e-5);
    assert!((of_line("A_vel_deg_s", 4.0) - 2000.0 / 60.0).abs() < 1e-5);
    assert!(of_line("X_vel_mm_s", 4.0) == 0.0);
}

#[test]
fn axes_of_the_machine_jog_and_home_by_their_names() {
    let workspace = workspace("jogs", "nine", "nine");
    let jogs = workspace.json(&["jog", "table+12.5", "quill-3", "--machine", "machine.toml", "--json"]);
    let [table, quill] = &jogs.as_array().expect("two jogs")[..] else { panic!("{jogs}") };
    assert_eq!((number(&table["to_deg"]), number(&quill["to_mm"])), (12.5, -3.0));
    // The limits of the path bind linear axes alone.
    let slow = workspace.read("machine.toml").replacen("feed_mm_s = 300", "feed_mm_s = 20", 1);
    workspace.put("slow.toml", &slow);
    let jogs = workspace.json(&["jog", "table+60@60", "X+60@60", "--machine", "slow.toml", "--json"]);
    let [table, x] = &jogs.as_array().expect("two jogs")[..] else { panic!("{jogs}") };
    assert!(number(&table["feed_deg_s"]) > 59.0 && number(&x["feed_mm_s"]) <= 20.0, "{jogs}");
    let error = workspace.refusal(&["jog", "U+1", "--machine", "machine.toml"]);
    assert!(error.contains("X, Y, Z, A, B, table, quill, V, W"), "{error}");
}

#[test]
fn what_is_for_three_axes_says_so() {
    let workspace = workspace("refused", "mill_xyza", "rotary_table");
    let error = workspace.refusal(&["drive", "step", "--machine", "machine.toml"]);
    assert!(error.contains("found 4 [[axis]] tables, expected at most 3 for this command"), "{error}");
    let lathe = self::workspace("refused", "lathe", "lathe");
    lathe.put("points.csv", "x_mm,y_mm,z_mm\n0,0,0\n10,2,1\n20,0,2\n");
    let expected =
        "found machine.toml with the axes Z, X, expected X, Y and Z, in this order, for this command";
    for command in [&["drive", "circle"][..], &["spline", "points.csv", "--feed", "600"]] {
        assert_eq!(lathe.refusal(&[command, &["--machine", "machine.toml"]].concat()), expected);
    }
    // An arc across a lathe's plane, turned back into it.
    lathe.put("turned.ngc", "G18 G10 L2 P1 R180\nG0 X-20\nG2 X-30 I-5 F100\nM2\n");
    lathe.stdout(&["plan", "turned.ngc", "--machine", "machine.toml"]);
    let error = workspace.refusal(&["plan", "program.ngc"]);
    assert_eq!(error, "program.ngc:3:14: found A0, expected an axis of the machine: X, Y, Z");
    workspace.put("far.ngc", "G0 A5\nG1 Z150 F900\nM2\n");
    let error = workspace.refusal(&["plan", "far.ngc", "--machine", "machine.toml"]);
    assert!(error.contains("expected its travel, -200 to 100 mm"), "{error}");
    let nine = self::workspace("refused", "nine", "nine");
    nine.put("far.ngc", "G0 B111\nM2\n");
    let error = nine.refusal(&["plan", "far.ngc", "--machine", "machine.toml"]);
    assert!(error.contains("expected its travel, -110 to 110 °"), "{error}");
}
