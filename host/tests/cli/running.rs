//! `run`, `replay`, `flight` and the demonstration.

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use hal_sim::closed_loop::InMemory;
use motion_host::machine::Machine;
use motion_kernel::flight::{FlightRecorder, frame_max};
use motion_kernel::kernel::Kernel;
use motion_kernel::queue::Streams;
use motion_kernel::units::{Counts, DacCode, Position};
use serde_json::Value;

use super::workspace::{STRINGER, Workspace, assert_has, keys, number, profile};

#[test]
fn run_of_the_stringer() {
    let workspace = Workspace::new("run");
    workspace.put("part.ngc", STRINGER);
    let run = workspace.json(&["run", "part.ngc", "--json", "--trace", "part.csv", "--report", "part.html"]);
    assert_has(
        &run,
        &[
            "ticks",
            "tick_s",
            "planned_time_s",
            "time_s",
            "path_length_mm",
            "max",
            "axes",
            "contour_error_um_max",
            "limit_active_share",
            "faults",
        ],
    );
    assert_eq!(keys(&run["max"]), ["accel_mm_s2", "feed_mm_s", "jerk_mm_s3", "snap_mm_s4"]);
    for axis in run["axes"].as_array().expect("a list") {
        assert_has(
            axis,
            &["name", "following_error_um_max", "following_error_um_rms", "end_error_counts", "output_v_max"],
        );
    }
    // The two small arcs and the cruise on the first line, at least; the ramps in between not.
    assert!((0.2..0.9).contains(&number(&run["limit_active_share"])));
    assert_eq!(run["faults"], Value::Array(Vec::new()));
    assert!((number(&run["time_s"]) - number(&run["planned_time_s"])).abs() < 2.0 * number(&run["tick_s"]));

    let trace = workspace.read("part.csv");
    let mut rows = trace.lines();
    let mut header = "tick,t_s,s_mm,v_mm_s,a_mm_s2,j_mm_s3,state,line".to_owned();
    for name in ["X", "Y", "Z"] {
        for column in ["set_mm", "vel_mm_s", "acc_mm_s2", "jerk_mm_s3", "act_mm", "err_um", "out_v"] {
            header += &format!(",{name}_{column}");
        }
    }
    assert_eq!(rows.next(), Some(header.as_str()));
    assert_eq!(rows.clone().count() as u64, run["ticks"].as_u64().expect("a count"));
    for row in rows {
        let fields: Vec<&str> = row.split(',').collect();
        assert_eq!(fields.len(), 29);
        for position in [fields[2], fields[8], fields[12], fields[15], fields[19]] {
            let (_, decimals) = position.split_once('.').expect("decimals");
            assert!(decimals.len() >= 9, "{position}");
        }
    }
    assert!(workspace.read("part.html").contains("Done without a fault"));

    let summary = workspace.stdout(&["run", "part.ngc"]);
    for word in ["following error", "contour error", "planned", "mm/min"] {
        assert!(summary.contains(word), "{word} is not in\n{summary}");
    }
}

/// Held and let go, driven at half the feed, given up: as the trace shows it.
#[test]
fn run_under_live_control() {
    let workspace = Workspace::new("live");
    workspace.put("line.ngc", "G1 X60 F2400\nM2\n");
    let run = |status: i32, at: &str| {
        let arguments = ["run", "line.ngc", "--at", at, "--trace", "line.csv", "--json"];
        let (said, _) = workspace.ending(status, &arguments);
        let found: Value = serde_json::from_str(&said).expect("JSON");
        let trace = workspace.read("line.csv");
        let column = |name: &str| -> Vec<String> {
            let index = trace.lines().next().expect("a header").split(',').position(|n| n == name);
            let index = index.expect(name);
            trace.lines().skip(1).map(|row| row.split(',').nth(index).expect(name).to_owned()).collect()
        };
        let numbers = |name: &str| -> Vec<f64> {
            column(name).iter().map(|value| value.parse().expect("a number")).collect()
        };
        let (states, feeds) = (column("state"), numbers("v_mm_s"));
        let last_mm = *numbers("X_set_mm").last().expect("a tick");
        (found, states, feeds, last_mm)
    };
    let (plain, _, feeds, _) = run(5, "1000000:hold");
    let ticks = |found: &Value| number(&found["ticks"]);
    let fastest = |feeds: &[f64]| feeds.iter().copied().fold(0.0, f64::max);
    assert!((fastest(&feeds) - 40.0).abs() < 1e-6);

    let (held, states, _, end_mm) = run(0, "1000:hold,3000:resume");
    let at_rest = states.iter().filter(|state| *state == "held").count();
    assert!(at_rest > 1000 && at_rest < 2000, "{at_rest}");
    assert!(ticks(&held) > ticks(&plain) + at_rest as f64 && (end_mm - 60.0).abs() < 1e-9);

    let (slow, _, feeds, end_mm) = run(0, "0:override=0.5");
    assert!((fastest(&feeds) - 20.0).abs() < 1e-6 && (end_mm - 60.0).abs() < 1e-9);
    // 60 mm at 20 mm/s, and a ramp up and one down.
    assert!((ticks(&slow) * 0.0005 - 3.0).abs() < 0.3, "{slow}");

    let (_, states, feeds, end_mm) = run(4, "1000:abort");
    assert!(
        end_mm < 50.0 && feeds.last() == Some(&0.0) && states.last().is_some_and(|s| s == "held"),
        "{end_mm}"
    );

    let output = workspace.motion(&["run", "line.ngc", "--at", "10:stop"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(
        error.contains(
            "found the command `stop`, expected hold, resume, abort, override=SHARE, single or continuous"
        ),
        "{error}"
    );

    // At rest at the end of the first line, and after the resume to the end.
    workspace.put("line.ngc", "G61 G1 X20 F2400\nX60\nM2\n");
    let (_, states, _, end_mm) = run(3, "0:single");
    assert!(states.last().is_some_and(|state| state == "held") && (end_mm - 20.0).abs() < 1e-9, "{end_mm}");
    let (_, states, _, end_mm) = run(0, "0:single,6000:resume");
    let at_rest = states.iter().filter(|state| *state == "held").count();
    assert!(at_rest > 1000 && (end_mm - 60.0).abs() < 1e-9, "{at_rest} {end_mm}");
}

/// As an exact path a kink of 0.004 rad is passed at 50 mm/s: velocity steps by 0.2 mm/s, which is 400 mm/s² over a tick, and the
/// trace says so once. Within a tolerance nothing steps.
#[test]
fn the_trace_has_the_acceleration_of_a_kink() {
    let workspace = Workspace::new("kink");
    let greatest_mm_s2 = |mode: &str| {
        workspace.put("kink.ngc", &format!("G21 {mode}\nG1 X20 F3000\nG1 X40 Y0.08\nM2\n"));
        workspace.json(&[
            "run",
            "kink.ngc",
            "--json",
            "--trace",
            "kink.csv",
            "--columns",
            "v_mm_s,Y_vel_mm_s,Y_acc_mm_s2",
        ]);
        let trace = workspace.read("kink.csv");
        let rows: Vec<Vec<f64>> = trace
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|number| number.parse().expect("a number")).collect())
            .collect();
        let steps = rows.iter().filter(|row| row[2] > 100.0).count();
        let greatest = rows.iter().max_by(|a, b| a[2].total_cmp(&b[2])).expect("ticks").clone();
        // What velocity changes by is what acceleration says, in every tick.
        for pair in rows.windows(2) {
            let changed = (pair[1][1] - pair[0][1]) / 0.0005;
            let most = 1e-3 * greatest[2] + 5e3 * 0.0005 + 1e-3;
            assert!((changed - pair[1][2]).abs() < most, "{mode}: {changed} mm/s², said {}", pair[1][2]);
        }
        (greatest[0], greatest[2], steps)
    };
    let (feed_mm_s, accel_mm_s2, steps) = greatest_mm_s2("G61");
    assert!((feed_mm_s - 50.0).abs() < 1e-6 && steps == 1);
    assert!((accel_mm_s2 - 50.0 * 0.004 / 0.0005).abs() < 0.01, "{accel_mm_s2}");
    let (_, accel_mm_s2, steps) = greatest_mm_s2("G64 P0.01");
    assert!(steps == 0 && accel_mm_s2 < 20.0, "{accel_mm_s2}");
}

/// A run with commands, and one that ends in a fault: recorded, and once more from the recording alone.
#[test]
fn replay_of_a_recorded_run() {
    let workspace = Workspace::new("replay");
    workspace.put("part.ngc", STRINGER);
    let file = workspace.stdout(&["machine"]);
    let strict = file.replace("following_error_limit_mm = 1.0", "following_error_limit_mm = 0.003");
    workspace.put("machine.toml", &file);
    workspace.put("strict.toml", &strict);
    for (machine, status) in [("machine.toml", 0), ("strict.toml", 1)] {
        let run = |arguments: &[&str]| {
            let output = workspace.motion(arguments);
            (output.status.code(), String::from_utf8(output.stdout).expect("UTF-8"))
        };
        let at = "100:override=0.7,900:hold,1500:resume";
        let recorded = run(&[
            "run",
            "part.ngc",
            "--machine",
            machine,
            "--at",
            at,
            "--record",
            "part.mrec",
            "--trace",
            "run.csv",
            "--report",
            "run.html",
            "--json",
        ]);
        assert_eq!(recorded.0, Some(status));
        // Whatever the machine and the program are by now.
        workspace.put("part.ngc", "M2\n");
        let replayed =
            run(&["replay", "part.mrec", "--trace", "replay.csv", "--report", "replay.html", "--json"]);
        assert_eq!(replayed.0, Some(0));
        assert!(workspace.read("run.csv") == workspace.read("replay.csv"), "the traces differ");
        // A recording holds no text of the program.
        let run_page = workspace.read("run.html");
        let (before, rest) =
            run_page.split_once("<script type=\"text/plain\" id=\"program\">").expect("the program");
        let (_, after) = rest.split_once("</script>\n").expect("its end");
        assert!([before, after].concat() == workspace.read("replay.html"), "the reports differ");
        let json = |text: &str| serde_json::from_str::<Value>(text).expect("JSON");
        let (recorded, mut replayed) = (json(&recorded.1), json(&replayed.1));
        let replay = replayed.as_object_mut().expect("an object").remove("replay").expect("a replay");
        assert_eq!(replayed, recorded);
        assert_eq!((&replay["identical"], &replay["difference"]), (&Value::Bool(true), &Value::Null));
        assert!(number(&replay["ticks"]) > number(&recorded["ticks"]));
        assert_eq!(recorded["faults"].as_array().expect("a list").len(), status as usize);
        assert!(run(&["replay", "part.mrec"]).1.contains("\n  identical over "));
        workspace.put("part.ngc", STRINGER);
    }

    let mut bytes = fs::read(workspace.0.join("part.mrec")).expect("a recording");
    let half = bytes.len() / 2;
    bytes[half] ^= 4;
    fs::write(workspace.0.join("damaged.mrec"), &bytes).expect("a file");
    let refusal = workspace.refusal(&["replay", "damaged.mrec", "--trace", "none.csv"]);
    assert!(refusal.starts_with("damaged.mrec: found checksum "), "{refusal}");
    assert!(!workspace.0.join("none.csv").exists());
    let refusal = workspace.refusal(&["replay", "part.ngc"]);
    assert!(refusal.ends_with("at its start, expected a recording, which begins with MREC"), "{refusal}");
}

/// The ticks around a fault, as a board's log has them.
#[test]
fn flight_of_a_boards_log() {
    let workspace = Workspace::new("flight");
    let mut log = String::from("0 INFO ready: press the blue button to start\n");
    let mut recorder = FlightRecorder::<f32, 3, 16, 4>::new();
    let machine = Machine::reference();
    let config = machine.axes_config().expect("axes");
    let start = [Position::ZERO; 3];
    let mut kernel = Kernel::<f32, 3>::new(&config, start, [Counts(0); 3]);
    let mut streams = Streams::<f32, 3, 4, 4>::new();
    let (_, mut intake) = streams.split(machine.rules(), start);
    kernel.enable(0);
    for tick in 0..60 {
        // The encoder of Y jumps by 2 mm.
        let counts = [0, if tick < 40 { 0 } else { 20_000 }, 0].map(Counts);
        let mut board = InMemory { counts, codes: [DacCode::ZERO; 3], enabled: None };
        recorder.add(kernel.tick(&mut intake, &mut board));
    }
    assert!(recorder.is_frozen());
    for row in (0..).map_while(|index| recorder.row(index)) {
        let mut buffer = [0; frame_max(3)];
        let bytes: Vec<_> =
            row.to_frame(&mut buffer).expect("room").iter().map(|b| format!("{b:02x}")).collect();
        log += &format!("{} INFO  flight [{}]\n", row.tick, bytes.join(", "));
    }
    workspace.put("board.log", &log);
    let said = workspace.stdout(&["flight", "board.log", "--trace", "flight.csv", "--report", "flight.html"]);
    for part in
        ["ticks 29 to 44, 16 rows", "fault latched in tick 40", "of axis Y at most -2.0000 mm, limit 1 mm"]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
    let trace = workspace.read("flight.csv");
    assert_eq!(trace.lines().count(), 17);
    assert!(trace.lines().last().expect("a row").starts_with("44,0.022000000,"), "{trace}");
    assert!(workspace.read("flight.html").contains("fault latched"));
    workspace.put("short.log", log.lines().next().expect("a line"));
    assert_eq!(
        workspace.refusal(&["flight", "short.log"]),
        "short.log: found no frame, expected lines with `flight […]`"
    );
}

#[test]
fn a_program_from_standard_input() {
    let workspace = Workspace::new("stdin");
    let mut child = Command::new(env!("CARGO_BIN_EXE_motion"))
        .args(["run", "-", "--json"])
        .current_dir(&workspace.0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("motion starts");
    child.stdin.take().expect("a pipe").write_all(b"G1 X5 F600\nM2\n").expect("written");
    let output = child.wait_with_output().expect("motion ends");
    assert_eq!(output.status.code(), Some(0));
    let run: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!((number(&run["path_length_mm"]) - 5.0).abs() < 1e-9);
}

/// `motion … | head`: no complaint about a reader that has seen enough.
#[test]
fn a_closed_pipe_is_not_an_error() {
    let workspace = Workspace::new("pipe");
    let mut child = Command::new(env!("CARGO_BIN_EXE_motion"))
        .args(profile("0", "200", &["--csv", "--tick", "1e-6"]))
        .current_dir(&workspace.0)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("motion starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("motion ends");
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

/// An axis that may follow with an error of 0.1 µm only can't.
#[test]
fn a_fault_is_status_1() {
    let workspace = Workspace::new("fault");
    workspace.put("part.ngc", STRINGER);
    let file = workspace.stdout(&["machine"]);
    workspace.put(
        "strict.toml",
        &file.replace("following_error_limit_mm = 1.0", "following_error_limit_mm = 0.0001"),
    );
    let output = workspace.motion(&["run", "part.ngc", "--machine", "strict.toml", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let run: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let faults = run["faults"].as_array().expect("a list");
    assert_eq!(keys(&faults[0]), ["axis", "detail", "fault", "tick"]);
    assert_eq!(faults[0]["axis"], "X");
    let output = workspace.motion(&["run", "part.ngc", "--machine", "strict.toml"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("FAULT in tick"));
}

#[test]
fn wrong_input_is_status_2_and_named() {
    let workspace = Workspace::new("wrong");
    workspace.put("part.ngc", STRINGER);
    workspace.put("unknown.ngc", "G21\nG1 X10 F100\n G33 Z1\n");
    workspace.put("fast.toml", &workspace.stdout(&["machine"]).replace("tick_s = 0.0005", "tick_s = 5"));
    workspace.put("note.toml", "not a machine\n");
    for command in ["run", "plan"] {
        let refusal = workspace.refusal(&[command, "missing.ngc"]);
        assert!(refusal.starts_with("missing.ngc: found ") && refusal.contains(", expected"), "{refusal}");
        let refusal = workspace.refusal(&[command, "unknown.ngc"]);
        assert!(
            refusal.starts_with("unknown.ngc:3:2: found G33") && refusal.contains(", expected"),
            "{refusal}"
        );
        let refusal = workspace.refusal(&[command, "part.ngc", "--machine", "missing.toml"]);
        assert!(refusal.starts_with("missing.toml: found "), "{refusal}");
        let refusal = workspace.refusal(&[command, "part.ngc", "--machine", "fast.toml"]);
        assert!(
            refusal.starts_with("fast.toml:14:10: found tick_s = 5, expected a number from"),
            "{refusal}"
        );
        let refusal = workspace.refusal(&[command, "part.ngc", "--machine", "note.toml"]);
        assert!(refusal.starts_with("note.toml:1:") && refusal.contains("expected"), "{refusal}");
    }
    for option in ["--trace", "--report"] {
        let refusal = workspace.refusal(&["run", "part.ngc", option, "no/such/place"]);
        assert!(refusal.starts_with("no/such/place: found "), "{refusal}");
    }
}

#[test]
fn alone_it_demonstrates() {
    let workspace = Workspace::new("demonstration");
    let said = workspace.stdout(&[]);
    for word in ["stringer.html", "N3 G2", "limited by", "jerk", "acceleration", "braking", "following error"]
    {
        assert!(said.contains(word), "{word} is not in\n{said}");
    }
    assert!(workspace.read("stringer.html").contains("Done without a fault"));
}
