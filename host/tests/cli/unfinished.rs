//! What did not finish says so: in its first line, in JSON, in the report, in its exit status.

use serde_json::Value;

use super::workspace::{Workspace, number};

/// 60 mm along X, on two lines.
const PROGRAM: &str = "G61 G1 X20 F2400\nX60\nM2\n";

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// Held, held by single block, by an override of 0, aborted: each with its words, its status and how far it
/// came.
#[test]
fn a_run_says_how_far_it_came() {
    let workspace = Workspace::new("unfinished");
    workspace.put("part.ngc", PROGRAM);
    for (at, status, stopped_by, words, line) in [
        ("1500:hold", 3, "hold", "held at ", 2),
        ("0:single", 3, "single block", "held by single block at 20.0000 of 60.0000 mm, line 1", 1),
        ("1500:override=0", 3, "override", "held by an override of 0 at ", 2),
        ("1500:abort", 4, "abort", "aborted at ", 2),
        ("1500:hold,1501:override=0", 3, "hold", "held at ", 2),
    ] {
        let run = ["run", "part.ngc", "--at", at, "--report", "part.html", "--trace", "part.csv"];
        let (said, error) = workspace.ending(status, &run);
        assert_eq!(error, "", "{at}");
        let first = said.lines().next().expect("a line");
        assert!(first.trim_start().starts_with(words), "{at}: {said}");
        let found = json(&workspace.ending(status, &[&run[..], &["--json"]].concat()).0);
        assert_eq!(
            (&found["finished"], found["stopped_by"].as_str()),
            (&Value::Bool(false), Some(stopped_by))
        );
        assert_eq!(found["reached_line"], line, "{at}");
        // Where the trace ends.
        let trace = workspace.read("part.csv");
        let last: Vec<&str> = trace.lines().last().expect("a row").split(',').collect();
        let reached_mm: f64 = last[2].parse().expect("a number");
        assert!(reached_mm > 0.0 && reached_mm < 60.0, "{at}: {reached_mm}");
        assert!((number(&found["reached_mm"]) - reached_mm).abs() < 1e-9, "{at}: {found}");
        assert!(first.contains(&format!(" at {reached_mm:.4} of 60.0000 mm, line {line}")), "{at}: {first}");
        let page = workspace.read("part.html");
        let words = words.split(" at ").next().expect("words");
        assert!(page.contains(&format!("<strong>Not finished:</strong> {words} at ")), "{at}");
        assert!(page.contains(&format!(" of 60 mm along the path, line {line}, after ")), "{at}");
    }
    let found = json(&workspace.ending(0, &["run", "part.ngc", "--json"]).0);
    assert_eq!((&found["finished"], &found["stopped_by"]), (&Value::Bool(true), &Value::Null));
    assert!((number(&found["reached_mm"]) - 60.0).abs() < 1e-9);
    let (said, _) = workspace.ending(0, &["run", "part.ngc"]);
    assert!(said.starts_with("  60.0000 mm in "), "{said}");
}

#[test]
fn a_fault_says_how_far_it_came() {
    let workspace = Workspace::new("faulted");
    workspace.put("part.ngc", PROGRAM);
    let run = [
        "run",
        "part.ngc",
        "--inject",
        "1500:emergency-stop",
        "--report",
        "part.html",
        "--record",
        "part.mrec",
    ];
    let (said, _) = workspace.ending(1, &run);
    assert!(said.starts_with("  faulted at ") && said.contains(" of 60.0000 mm, line 2\n"), "{said}");
    assert!(workspace.read("part.html").contains(" of 60 mm along the path, line 2."));
    let found = json(&workspace.ending(1, &[&run[..], &["--json"]].concat()).0);
    assert_eq!((&found["finished"], found["stopped_by"].as_str()), (&Value::Bool(false), Some("fault")));
    // A replay judges whether it is identical, and says how the run ended.
    let (said, _) = workspace.ending(0, &["replay", "part.mrec"]);
    assert!(said.starts_with("  faulted at ") && said.contains("identical over"), "{said}");
    let found = json(&workspace.ending(0, &["replay", "part.mrec", "--json"]).0);
    assert_eq!(
        (&found["finished"], &found["replay"]["identical"]),
        (&Value::Bool(false), &Value::Bool(true))
    );
}

/// Commands after the end of the run: named, and an error, after the results.
#[test]
fn a_command_that_is_not_reached_is_an_error() {
    let workspace = Workspace::new("unreached");
    workspace.put("part.ngc", PROGRAM);
    let run = ["run", "part.ngc", "--at", "10:override=0.9,800000:hold,900000:resume"];
    let (said, error) = workspace.ending(5, &run);
    assert!(said.starts_with("  60.0000 mm in "), "{said}");
    let expected = "motion: --at 800000:hold,900000:resume: found the end of the run in tick ";
    assert!(error.starts_with(expected) && error.lines().count() == 1, "{error}");
    let found = json(&workspace.ending(5, &[&run[..], &["--json"]].concat()).0);
    assert_eq!(found["finished"], true);
    assert_eq!(found["commands_not_reached"], Value::from(vec!["800000:hold", "900000:resume"]));
    let last = number(&found["ticks"]) - 1.0;
    assert!(error.contains(&format!("in tick {last}, expected")), "{error}");
    // An abort has its own status, and the command is named all the same.
    let (said, error) = workspace.ending(4, &["run", "part.ngc", "--at", "1500:abort,800000:resume"]);
    assert!(said.starts_with("  aborted at ") && error.contains("--at 800000:resume: found"), "{error}");
}

/// A file and a summary that can't be written hide neither each other nor a command that was not reached.
#[test]
fn every_failed_write_and_an_unreached_command_are_said() {
    let workspace = Workspace::new("all-said");
    workspace.put("part.ngc", PROGRAM);
    if !std::path::Path::new("/dev/full").exists() {
        return;
    }
    for (trace, stdout, expected) in [
        ("/dev/full", "said.txt", &["/dev/full: found "][..]),
        ("part.csv", "/dev/full", &["standard output: found "]),
        ("/dev/full", "/dev/full", &["standard output: found ", "/dev/full: found "]),
    ] {
        let printed = std::fs::File::create(workspace.0.join(stdout)).expect("opened");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_motion"));
        command.args(["run", "part.ngc", "--at", "800000:hold", "--trace", trace]);
        let ended = command.current_dir(&workspace.0).stdout(printed).output().expect("started");
        let error = String::from_utf8(ended.stderr).expect("UTF-8");
        assert_eq!(ended.status.code(), Some(6), "{error}");
        let expected = [expected, &["--at 800000:hold: found "]].concat();
        assert_eq!(error.lines().count(), expected.len(), "{error}");
        for (line, begin) in error.lines().zip(expected) {
            assert!(line.starts_with(&format!("motion: {begin}")), "{error}");
        }
    }
    assert!(workspace.read("said.txt").starts_with("  60.0000 mm in "));
}

/// Whoever reads summary and errors may leave: the run ends as it would have, and its files are whole.
#[test]
fn a_reader_that_left_hides_no_ending() {
    let workspace = Workspace::new("left");
    workspace.put("part.ngc", PROGRAM);
    let dead_pipe = || {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        writer
    };
    for (at, status) in [("1500:hold", 3), ("1500:abort", 4), ("800000:resume", 5)] {
        for json in [&[][..], &["--json"]] {
            let trace = format!("{status}.csv");
            let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_motion"));
            command.args(["run", "part.ngc", "--at", at, "--trace", &trace]).args(json);
            command.current_dir(&workspace.0).stdout(dead_pipe()).stderr(dead_pipe());
            assert_eq!(command.status().expect("started").code(), Some(status), "{at}");
            let rows = workspace.read(&trace).lines().count();
            assert!(rows > 1000 && workspace.read(&trace).ends_with('\n'), "{rows}");
        }
    }
}

/// A jog that a fault ends says where. With half of the feedforward an axis follows v/(2·kp) late: by 0.1 mm
/// from 46 mm/s on, which the short jog does not reach and the long one passes before its middle.
#[test]
fn a_jog_says_where_its_fault_was() {
    let workspace = Workspace::new("jog-fault");
    let file = workspace.stdout(&["machine"]);
    let loose = file.replace("following_error_limit_mm = 1.0", "following_error_limit_mm = 0.1");
    workspace.put("loose.toml", &loose.replace("feedforward_velocity = 1.0", "feedforward_velocity = 0.5"));
    let (_, error) = workspace.ending(1, &["jog", "X+0.01", "X+20", "--machine", "loose.toml"]);
    let (_, place) = error.split_once(", at X ").expect("a place");
    let (x_mm, _) = place.split_once(" mm").expect("a unit");
    let x_mm: f64 = x_mm.parse().expect("a number");
    assert!(x_mm > 0.01 && x_mm < 10.01, "{error}");
    assert!(error.starts_with("motion: X+20: fault in tick "), "{error}");
}
