//! The command line as users and scripts rely on it: exit statuses, keys, headers, errors.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use hal_sim::closed_loop::InMemory;
use motion_host::machine::Machine;
use motion_kernel::flight::{FlightRecorder, frame_max};
use motion_kernel::kernel::Kernel;
use motion_kernel::num::Fixed;
use motion_kernel::program::{Item, Reader, check};
use motion_kernel::queue::Streams;
use motion_kernel::units::{Counts, DacCode, Position};
use serde_json::Value;

/// A directory of a test's own, removed afterwards.
struct Workspace(PathBuf);

impl Workspace {
    fn new(name: &str) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{name}"));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).expect("a directory");
        Self(path)
    }

    fn put(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).expect("a file");
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).expect("a file")
    }

    /// Runs `motion` in this directory.
    fn motion(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motion"));
        command.args(arguments).current_dir(&self.0).output().expect("motion starts")
    }

    /// Runs `motion`, which must succeed and say nothing on standard error.
    fn stdout(&self, arguments: &[&str]) -> String {
        let output = self.motion(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), error.as_ref()), (Some(0), ""), "{arguments:?}");
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.stdout(arguments)).expect("JSON")
    }

    /// Runs `motion`, which must refuse its input in one line; that line without `motion: `.
    fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.motion(arguments);
        let error = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        error.trim_end().strip_prefix("motion: ").expect("its name first").to_owned()
    }
}

impl Drop for Workspace {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().expect("an object").keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

fn assert_has(value: &Value, expected: &[&str]) {
    let found = keys(value);
    for key in expected {
        assert!(found.contains(key), "{key} is not among {found:?}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

const LIMITS: [&str; 6] = ["--accel", "500", "--jerk", "5000", "--snap", "400000"];
const STRINGER: &str = include_str!("../src/cli/stringer.ngc");

fn profile<'a>(from: &'a str, to: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["profile", "--from", from, "--to", to][..], &LIMITS, more].concat()
}

#[test]
fn profile_json() {
    let workspace = Workspace::new("profile-json");
    let ramp = workspace.json(&profile("0", "200", &["--json"]));
    assert_has(&ramp, &["peak_jerk_mm_s3", "t1_s", "t2_s", "tp_s", "length_mm", "limited_by", "at"]);
    assert_eq!(ramp["limited_by"], "acceleration");
    assert!((number(&ramp["tp_s"]) - 0.6).abs() < 1e-12);
    assert!((number(&ramp["length_mm"]) - 60.0).abs() < 1e-9);
    let at = ramp["at"].as_array().expect("a list");
    assert_eq!(at.len(), 4);
    for row in at {
        assert_eq!(keys(row), ["a_mm_s2", "j_mm_s3", "s_mm", "snap_mm_s4", "t_s", "v_mm_s"]);
    }
    assert!((number(&at[0]["snap_mm_s4"]) - 78_539.816).abs() < 1e-2);
    assert!((number(&at[0]["t_s"]) - 0.05).abs() < 1e-12);
    assert_eq!(workspace.json(&profile("19", "100", &["--json"]))["limited_by"], "jerk");
    assert_eq!(workspace.json(&profile("18", "20", &["--json"]))["limited_by"], "snap");
    let none = workspace.json(&profile("50", "50", &["--json"]));
    assert!(number(&none["tp_s"]).abs() <= 0.0 && number(&none["length_mm"]).abs() <= 0.0);
}

#[test]
fn profile_csv_and_table() {
    let workspace = Workspace::new("profile-csv");
    let csv = workspace.stdout(&profile("0", "200", &["--csv", "--tick", "0.001"]));
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "t_s,s_mm,v_mm_s,a_mm_s2,j_mm_s3,snap_mm_s4");
    assert_eq!(lines.len(), 602);
    assert!(lines[1].starts_with("0.0,0.0,0.0,"), "{}", lines[1]);
    assert!(lines[601].starts_with("0.6"), "{}", lines[601]);
    let table = workspace.stdout(&profile("0", "200", &[]));
    for word in ["t1/4", "tp", "mm/s³", "acceleration", "12000.0 mm/min", "78539.82", "22.826727"] {
        assert!(table.contains(word), "{word} is not in\n{table}");
    }
}

#[test]
fn profile_names_a_wrong_argument() {
    let workspace = Workspace::new("profile-wrong");
    for (name, value) in [
        ("--from", "-1"),
        ("--from", "nan"),
        ("--to", "inf"),
        ("--accel", "0"),
        ("--jerk", "-5"),
        ("--snap", "x"),
        ("--tick", "0"),
    ] {
        let mut arguments = profile("0", "200", &["--tick", "0.001"]);
        let place = arguments.iter().position(|argument| *argument == name).expect("an argument") + 1;
        arguments[place] = value;
        let output = workspace.motion(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{name} {value}");
        assert!(error.contains(name) && error.contains(&format!("found {value}, expected")), "{error}");
    }
    assert_eq!(workspace.motion(&["profile", "--from", "0"]).status.code(), Some(2));
    assert_eq!(workspace.motion(&profile("0", "1", &["--json", "--csv"])).status.code(), Some(2));
    assert_eq!(workspace.motion(&["dance"]).status.code(), Some(2));
    assert_eq!(workspace.motion(&["--help"]).status.code(), Some(0));
    let refusal = workspace.refusal(&profile("0", "200", &["--csv", "--tick", "1e-12"]));
    assert!(refusal.contains("expected at most 1e8 ticks"), "{refusal}");
    let refusal = workspace.refusal(&[
        "profile", "--from", "0", "--to", "1e300", "--accel", "1e-300", "--jerk", "1", "--snap", "1",
    ]);
    assert!(refusal.contains("found ") && refusal.contains(", expected "), "{refusal}");
}

#[test]
fn machine_prints_its_file() {
    let workspace = Workspace::new("machine");
    let file = workspace.stdout(&["machine"]);
    assert_eq!(file, include_str!("../src/machine/reference.toml"));
    workspace.put("mine.toml", &file);
    workspace.put("part.ngc", STRINGER);
    let with = workspace.stdout(&["plan", "part.ngc", "--machine", "mine.toml", "--json"]);
    assert_eq!(with, workspace.stdout(&["plan", "part.ngc", "--json"]));
}

#[test]
fn machine_explains_its_keys() {
    let workspace = Workspace::new("explain");
    let text = workspace.stdout(&["machine", "--explain"]);
    for words in [
        "[axis.regulator.inverse.bed]",
        "kp_per_s [1/s]: a number from 0 to 1e9; required",
        "timer_bits: 16 or 32; default 32",
        "mm_s [mm/s]: 9 times a number from -100000 to 100000; required",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let keys = workspace.json(&["machine", "--explain", "--json"]);
    let keys = keys.as_array().expect("a list");
    assert_has(
        &keys[0],
        &["table", "table_is_optional", "key", "unit", "values", "range", "default", "meaning"],
    );
    let lead = keys.iter().find(|key| key["key"] == "feedforward_lead_s").expect("the lead");
    assert_eq!((&lead["table"], &lead["default"]), (&Value::from("axis.regulator"), &Value::from("0")));
    assert_eq!(workspace.motion(&["machine", "--json"]).status.code(), Some(2));
}

#[test]
fn drive_compares_regulators() {
    let workspace = Workspace::new("compare");
    let arguments = ["drive", "compare", "--from", "5", "--to", "5", "--resolutions-um", "1"];
    let text = workspace.stdout(&[&arguments[..], &["--report", "compare.html"]].concat());
    assert!(text.contains("stringer.ngc") && text.contains("P + inverse with preview"), "{text}");
    let page = workspace.read("compare.html");
    assert!(page.contains("<svg") && !page.contains("NaN") && page.trim_end().ends_with("</html>"));
    let json = workspace.json(&[&arguments[..], &["--json"]].concat());
    assert_has(&json["fitted"][2], &["axis", "ff1", "ff2_s", "ff3_s2"]);
    let rows = json["regulators"].as_array().expect("a list");
    assert_eq!((rows.len(), rows[1]["set_resolution_um"].as_f64()), (16, Some(1.0)));
    let keys = ["following_error_um", "contour_error_um", "output_noise_mv", "current_noise_percent"];
    assert_has(&rows[1]["motions"][2], &keys);
    assert_has(&json["sweeps"][6]["circles"][0], &keys);
    for wrong in ["0", "-1", "nan", "1001"] {
        let refusal = workspace.refusal(&["drive", "compare", &format!("--resolutions-um={wrong}")]);
        assert!(refusal.contains("found set-point resolutions [") && refusal.contains("expected 1 to 10"));
    }
}

#[test]
fn plan_of_the_stringer() {
    let workspace = Workspace::new("plan");
    workspace.put("part.ngc", STRINGER);
    let plan = workspace.json(&["plan", "part.ngc", "--json"]);
    assert_has(&plan, &["time_s", "blocks", "feed"]);
    let blocks = plan["blocks"].as_array().expect("a list");
    for block in blocks {
        assert_has(
            block,
            &[
                "line",
                "kind",
                "length_mm",
                "cap_mm_s",
                "cap_reason",
                "enter_mm_s",
                "peak_mm_s",
                "exit_mm_s",
                "time_s",
            ],
        );
    }
    let of = |key: &str| blocks.iter().map(|block| block[key].clone()).collect::<Vec<Value>>();
    assert_eq!(of("line"), [4, 5, 6, 7, 8]);
    assert_eq!(of("kind"), ["line", "arc", "arc", "arc", "line"]);
    // S3's result. The paper does not say what limits N1.
    assert_eq!(of("cap_reason")[1..], ["jerk", "acceleration", "jerk", "braking"]);
    let feed = plan["feed"].as_array().expect("a list");
    let (mut start_mm, mut time_s) = (0.0, 0.0);
    for part in feed {
        assert_has(
            part,
            &["start_mm", "length_mm", "from_mm_s", "to_mm_s", "peak_jerk_mm_s3", "t1_s", "t2_s", "time_s"],
        );
        assert!((number(&part["start_mm"]) - start_mm).abs() < 1e-6);
        start_mm += number(&part["length_mm"]);
        time_s += number(&part["time_s"]);
    }
    assert!((time_s - number(&plan["time_s"])).abs() < 1e-9);
    let table = workspace.stdout(&["plan", "part.ngc", "--per-block"]);
    for word in ["limited by", "mm/min", "acceleration", "5 blocks"] {
        assert!(table.contains(word), "{word} is not in\n{table}");
    }
}

const BLOCKS: &str = r#"{
  "limits": {"accel_mm_s2": 500, "jerk_mm_s3": 5000, "snap_mm_s4": 400000},
  "start_feed_mm_s": 0,
  "end_feed_mm_s": 0,
  "blocks": [
    {"length_mm": 50, "feed_mm_s": 80},
    {"length_mm": 25, "feed_mm_s": 40}
  ]
}"#;

#[test]
fn plan_of_a_block_list() {
    let workspace = Workspace::new("blocks");
    workspace.put("list.json", BLOCKS);
    for more in [&["--per-block"][..], &[]] {
        let plan = workspace.json(&[&["plan", "list.json", "--json"], more].concat());
        let blocks = plan["blocks"].as_array().expect("a list");
        assert_eq!(blocks.len(), 2);
        assert!(blocks.iter().all(|block| block["line"] == 0));
        assert!(number(&blocks[1]["exit_mm_s"]).abs() <= 0.0);
    }
    workspace.put("extra.json", &BLOCKS.replace("\"feed_mm_s\": 40", "\"speed_mm_s\": 40"));
    let refusal = workspace.refusal(&["plan", "extra.json"]);
    assert!(refusal.starts_with("extra.json:7") && refusal.contains("speed_mm_s"), "{refusal}");
    workspace.put("negative.json", &BLOCKS.replace("\"length_mm\": 25", "\"length_mm\": -25"));
    let refusal = workspace.refusal(&["plan", "negative.json"]);
    assert!(refusal.starts_with("negative.json:7") && refusal.contains("found -25, expected"), "{refusal}");
    workspace.put("torn.json", &BLOCKS[..100]);
    assert!(workspace.refusal(&["plan", "torn.json"]).starts_with("torn.json:"));
}

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
    assert!(workspace.read("part.html").contains("<svg"));

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
    let run = |at: &str| {
        let found = workspace.json(&["run", "line.ngc", "--at", at, "--trace", "line.csv", "--json"]);
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
    let (plain, _, feeds, _) = run("1000000:hold");
    let ticks = |found: &Value| number(&found["ticks"]);
    let fastest = |feeds: &[f64]| feeds.iter().copied().fold(0.0, f64::max);
    assert!((fastest(&feeds) - 40.0).abs() < 1e-6);

    let (held, states, _, end_mm) = run("1000:hold,3000:resume");
    let at_rest = states.iter().filter(|state| *state == "held").count();
    assert!(at_rest > 1000 && at_rest < 2000, "{at_rest}");
    assert!(ticks(&held) > ticks(&plain) + at_rest as f64 && (end_mm - 60.0).abs() < 1e-9);

    let (slow, _, feeds, end_mm) = run("0:override=0.5");
    assert!((fastest(&feeds) - 20.0).abs() < 1e-6 && (end_mm - 60.0).abs() < 1e-9);
    // 60 mm at 20 mm/s, and a ramp up and one down.
    assert!((ticks(&slow) * 0.0005 - 3.0).abs() < 0.3, "{slow}");

    let (_, states, feeds, end_mm) = run("1000:abort");
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
    workspace.put("line.ngc", "G1 X20 F2400\nX60\nM2\n");
    let (_, states, _, end_mm) = run("0:single");
    assert!(states.last().is_some_and(|state| state == "held") && (end_mm - 20.0).abs() < 1e-9, "{end_mm}");
    let (_, states, _, end_mm) = run("0:single,6000:resume");
    let at_rest = states.iter().filter(|state| *state == "held").count();
    assert!(at_rest > 1000 && (end_mm - 60.0).abs() < 1e-9, "{at_rest} {end_mm}");
}

/// The machine file's homing in use: the reference is the index behind the switch; what is not found is named.
#[test]
fn home_finds_the_reference() {
    let workspace = Workspace::new("home");
    let file = workspace.stdout(&["machine"]);
    workspace.put("none.toml", &file);
    assert_eq!(
        workspace.refusal(&["home", "--machine", "none.toml"]),
        "none.toml: found no [axis.homing], expected one for each axis that is to be homed"
    );
    let (before, homing) = file.split_once("#[axis.homing]").expect("homing");
    let (homing, after) = homing.split_once("\n\n").expect("its end");
    let homing = format!("[axis.homing]{homing}").replace("\n#", "\n").replace("\n ", "\n# ");
    let with = |homing: &str| [before, homing, "\n\n", after].concat();
    workspace.put("home.toml", &with(&homing));
    let axes = workspace.json(&["home", "--machine", "home.toml", "--trace", "home.csv", "--json"]);
    let [axis] = &axes.as_array().expect("a list")[..] else { panic!("{axes}") };
    assert_has(axis, &["axis", "counts", "index_counts", "time_s", "position_mm", "true_mm"]);
    // The index at 4.2 − 19·10 mm is the first behind -180 mm.
    assert_eq!((axis["axis"].as_str(), number(&axis["counts"])), (Some("X"), -1_858_000.0));
    assert!((number(&axis["true_mm"]) - (250.0 - 185.8)).abs() < 2e-3, "{axis}");
    assert_eq!(number(&axis["position_mm"]), 0.0);
    let ticks = workspace.read("home.csv").lines().count() - 1;
    assert!((ticks as f64 * 0.0005 - number(&axis["time_s"])).abs() < 1e-9, "{ticks} {axis}");
    assert!(workspace.stdout(&["home", "--machine", "home.toml"]).contains("-1858000"));

    workspace.put("short.toml", &with(&homing.replace("travel_mm = 600.0", "travel_mm = 100.0")));
    let output = workspace.motion(&["home", "--machine", "short.toml"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    let expected = "short.toml: axis X: no home switch within 100 mm: expected it to close there";
    assert!(error.contains(expected), "{error}");
}

/// Keys pressed one after the other: by a distance, to the soft limit, released on the way; and what is refused.
#[test]
fn jog_goes_as_far_as_its_key_says() {
    let workspace = Workspace::new("jog");
    let file = workspace.stdout(&["machine"]);
    let bounded = file.replace("#[axis.travel]", "[axis.travel]");
    let bounded = bounded.replace("#low_mm = -400", "low_mm = -40").replace("#high_mm = 400", "high_mm = 30");
    workspace.put("machine.toml", &bounded);
    let keys = ["X+20", "Y-2.5", "X+", "X-@400", "X+1@5000"];
    let rest = ["--machine", "machine.toml", "--feed", "50", "--trace", "jog.csv", "--json"];
    let presses = workspace.json(&[&["jog"][..], &keys, &rest].concat());
    let presses = presses.as_array().expect("a list");
    let ended: Vec<_> = presses.iter().map(|press| press["ended"].as_str().expect("a text")).collect();
    assert_eq!(ended, ["distance", "distance", "soft limit", "released", "distance"]);
    let [first, second, third, fourth, fifth] = &presses[..] else { panic!("{presses:?}") };
    let has = ["press", "from_mm", "to_mm", "time_s", "feed_mm_s", "ended", "stop_s", "stop_mm"];
    for (press, key) in presses.iter().zip(keys) {
        assert_has(press, &has);
        assert_eq!(press["press"].as_str(), Some(key));
        assert!(number(&press["feed_mm_s"]) <= 50.0, "{press}");
    }
    assert_eq!((number(&first["from_mm"]), number(&first["to_mm"])), (0.0, 20.0));
    assert!((number(&first["feed_mm_s"]) - 50.0).abs() < 1e-3, "{first}");
    assert_eq!((number(&second["from_mm"]), number(&second["to_mm"])), (0.0, -2.5));
    assert_eq!((number(&third["from_mm"]), number(&third["to_mm"])), (20.0, 30.0));
    // Released after 0.2 s, in the ramp's second half, which jerk limits: it and braking from 50 mm/s take all of their times.
    let (stop_s, stop_mm) = (number(&fourth["stop_s"]), number(&fourth["stop_mm"]));
    assert!((number(&fourth["time_s"]) - stop_s - 0.2).abs() < 1e-9, "{fourth}");
    let ramp_s = 2.0 * (2.0 * 50.0 / 5000.0_f64).sqrt();
    assert!((stop_s - (2.0 * ramp_s - 0.2)).abs() < 0.0011, "{fourth}");
    let gone_mm = number(&fourth["from_mm"]) - number(&fourth["to_mm"]);
    assert!((gone_mm - 50.0 * ramp_s).abs() < 1e-3 && stop_mm < gone_mm, "{fourth}");
    // Where the key is released behind the end, the end is the distance's.
    let gone_mm = number(&fifth["to_mm"]) - number(&fifth["from_mm"]);
    assert!((gone_mm - 1.0).abs() < 1e-9 && fifth["stop_s"].is_null(), "{fifth}");
    let ticks = workspace.read("jog.csv").lines().count() - 1;
    let time_s: f64 = presses.iter().map(|press| number(&press["time_s"])).sum();
    assert!((ticks as f64 * 0.0005 - time_s).abs() < 1e-9, "{ticks} {time_s}");

    // What came before is printed, though the last key asks for more than there is room for.
    let output = workspace.motion(&["jog", "X-", "X-1", "--machine", "machine.toml"]);
    let (shown, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(shown.contains("-40.0000") && shown.contains("soft limit"), "{shown}");
    assert!(error.contains("X-1: at -40 mm outwards: expected inwards only"), "{error}");
    for (arguments, expected) in [
        (
            &["jog", "X+"][..],
            "X+: found no [axis.travel] for its axis, expected one to go on to, or a distance",
        ),
        (&["jog", "X+1", "Q+1"], "Q+1: found no such axis, expected one of X, Y, Z"),
        (&["jog", "X+1", "--feed", "301"], "X+1: found a feed of 301 mm/s, expected above 0, at most 300"),
        (&["jog", "X+1", "--feed", "nan"], "X+1: found a feed of NaN mm/s, expected above 0, at most 300"),
    ] {
        assert_eq!(workspace.refusal(arguments), expected);
    }
    let output = workspace.motion(&["jog", "X+0"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && error.contains("found a distance of 0 mm"), "{error}");
    // What is refused replaces no file.
    workspace.put("kept.csv", "kept");
    for arguments in [
        &["jog", "X+1", "Q+1"][..],
        &["jog", "X+1", "--feed", "0"],
        &["jog", "X+1", "X+"],
        &["home", "--machine", "machine.toml"],
    ] {
        workspace.refusal(&[arguments, &["--trace", "kept.csv"]].concat());
        assert_eq!(workspace.read("kept.csv"), "kept");
    }

    // An axis that does not follow ends the jog in a fault; what came before is printed.
    workspace.put(
        "loose.toml",
        &file.replace("following_error_limit_mm = 1.0", "following_error_limit_mm = 0.002"),
    );
    let output = workspace.motion(&["jog", "X+0.01", "X+20", "--machine", "loose.toml"]);
    let (shown, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(shown.contains("X+0.01") && error.contains("X+20: fault in tick "), "{shown} {error}");
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
        assert!(workspace.read("run.html") == workspace.read("replay.html"), "the reports differ");
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
    for row in recorder.rows() {
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

const TICKS: &str = "expected at most 1073741.824 s (2147483648 ticks)";
const KILOMETRE: &str = "expected at most 1000000 mm between two full stops";

/// Every refusal of a plan, to the letter: the line of the block concerned, what was found, what was expected.
#[test]
fn what_planning_refuses() {
    let workspace = Workspace::new("planning");
    for (program, refusal) in [
        (
            "G1 X1 F600\nG1 X1.001 F0.0000000001\nG1 X2 F600\nM2\n",
            format!("2: found t2 − t1 = 599999958.6492777 s, {TICKS}"),
        ),
        ("G1 X1 F600\nG4 P1073742\nM2\n", format!("2: found a dwell of 1073742 s, {TICKS}")),
        (
            "G2 X0 Y0 I200000 F18000\nM2\n",
            format!("1: found 1256637.0614359172 mm of path without a full stop, {KILOMETRE}"),
        ),
        (
            "G0 X-1000000\nG0 X0\nG0 X1000000\nM2\n",
            format!("3: found 2000000 mm of path without a full stop, {KILOMETRE}"),
        ),
        (
            "G0 X999999\nG2 I2 F1000\nM2\n",
            "2: found a path through X = 1000001 mm, expected coordinates within ±1000000 mm".to_owned(),
        ),
        (
            "G1 X1 F600\nG1 X1.0000000001\nM2\n",
            "2: found a piece of 1.00e-10 mm, expected at least 5e-10 mm: a short line is one piece, an \
             arc has one every 45°"
                .to_owned(),
        ),
    ] {
        workspace.put("part.ngc", program);
        for mode in [&[][..], &["--per-block"]] {
            let found = workspace.refusal(&[&["plan", "part.ngc"], mode].concat());
            assert_eq!(found, format!("part.ngc:{refusal}"), "{program}");
        }
    }
}

/// The same for a block list: line and column where it is not JSON of the right layout, else the line.
#[test]
fn what_a_block_list_refuses() {
    const LIMITS: &str = r#""limits": {"accel_mm_s2": 500, "jerk_mm_s3": 5000, "snap_mm_s4": 400000},"#;
    const SECOND: &str = r#"{"length_mm": 25, "feed_mm_s": 40}"#;
    let workspace = Workspace::new("lists");
    let refusal = |text: &str| {
        workspace.put("list.json", text);
        let refusal = workspace.refusal(&["plan", "list.json"]);
        refusal.strip_prefix("list.json:").expect("its name").to_owned()
    };
    for (found, to, expected) in [
        (LIMITS, "", "9:1: found no key `limits`, expected it in this object"),
        (": 400000", ": 0", "2:69: found 0, expected a number above 0"),
        (": 25", ": -25", "7:21: found -25, expected a number not below 0"),
        (": 25", ": \"25\"", "7:22: found string \"25\", expected a number"),
        (": 25,", ": 25;", "7:21: found ';', expected `,` or `}`"),
        ("\"blocks\"", "blocks", "5:3: found 'b', expected a key in double quotes"),
        (
            "_mm_s\": 40",
            "_mm\": 40",
            "7:31: found unknown key `feed_mm`, expected `length_mm` or `feed_mm_s`",
        ),
        ("feed_mm_s\": 40", "length_mm\": 40", "7:33: found a second key `length_mm`, expected one"),
        (
            "end_feed_mm_s\": 0",
            "end_feed_mm_s\": 41",
            "4: found end feed 41 mm/s, expected from 0 to 40 mm/s",
        ),
        (": 40}", ": 1e-9}", &format!("7: found t2 − t1 = 2.5e10 s, {TICKS}")),
        (": 25,", ": 999990,", &format!("7: found 1000040 mm of path without a full stop, {KILOMETRE}")),
    ] {
        assert!(BLOCKS.contains(found), "{found}");
        assert_eq!(refusal(&BLOCKS.replacen(found, to, 1)), expected, "{to}");
    }
    let torn = BLOCKS.split(SECOND).next().expect("a beginning");
    assert_eq!(refusal(torn), "7:4: found the end of the file, expected the rest of a value");

    let short = BLOCKS.replace(": 50,", ": 0.5,").replace(": 25,", ": 0.5,");
    let found = refusal(&short.replace("start_feed_mm_s\": 0", "start_feed_mm_s\": 80"));
    assert!(found.starts_with("3: found start feed 80 mm/s, expected at most 9.83124"), "{found}");
    assert!(found.ends_with(" mm/s: the path is too short to brake from more"), "{found}");
    let found = refusal(&short.replace("end_feed_mm_s\": 0", "end_feed_mm_s\": 40"));
    assert!(found.starts_with("4: found end feed 40 mm/s, expected at most 9.83124"), "{found}");
    assert!(found.ends_with(" mm/s: the path is too short to reach more"), "{found}");
}

#[test]
fn alone_it_demonstrates() {
    let workspace = Workspace::new("demonstration");
    let said = workspace.stdout(&[]);
    for word in ["stringer.html", "N3 G2", "limited by", "jerk", "acceleration", "braking", "following error"]
    {
        assert!(said.contains(word), "{word} is not in\n{said}");
    }
    assert!(workspace.read("stringer.html").contains("<svg"));
}

#[test]
fn drive_prints_its_keys() {
    let workspace = Workspace::new("drive");
    let step = workspace.json(&["drive", "step", "--json", "--report", "step.html"]);
    assert_has(
        &step,
        &[
            "axis",
            "feed_mm_min",
            "delay_ms",
            "time_constant_ms",
            "overshoot_percent",
            "settling_ms",
            "peak_accel_m_s2",
            "peak_jerk_m_s3",
            "bandwidth_hz",
            "reference",
        ],
    );
    assert!((number(&step["delay_ms"]) - 2.013).abs() < 0.1);
    let figures = step["reference"].as_array().expect("figures");
    assert_eq!(figures.len(), 7);
    assert_has(&figures[0], &["quantity", "unit", "measured", "expected", "tolerance", "published", "holds"]);

    let harmonic = workspace.json(&["drive", "harmonic", "--from", "8", "--to", "9", "--by", "1", "--json"]);
    let axis = &harmonic["axes"][1];
    assert_has(axis, &["name", "bandwidth_swing_hz", "bandwidth_fundamental_hz", "current_limited_hz"]);
    let point = &axis["points"][0];
    assert_has(
        point,
        &["frequency_hz", "radius_mm", "swing_ratio", "fundamental_ratio", "phase_deg", "delay_ms"],
    );

    let inertia = workspace.json(&["drive", "inertia", "--loads", "2", "--json", "--report", "inertia.html"]);
    assert_has(&inertia["loads"][0], &["load_inertia_ratio", "plateau_accel_m_s2", "is_limited"]);

    // Not the published feed: nothing to compare with.
    let two =
        ["drive", "circle", "--from", "4", "--to", "5", "--feed-mm-min", "2000", "--feedforward", "v,as-is"];
    let circle = workspace.json(&[&two[..], &["--json", "--report", "circle.html"]].concat());
    assert_eq!(circle["reference"].as_array().map(Vec::len), Some(0));
    let names: Vec<&Value> =
        circle["feedforward"].as_array().expect("two").iter().map(|f| &f["name"]).collect();
    assert_eq!(names, ["V", "as is"]);
    let figures = &circle["feedforward"][0]["circles"][0];
    assert_has(
        figures,
        &[
            "radius_mm",
            "contour_error_um",
            "contour_error_um_max",
            "contour_error_um_min",
            "form_deviation_um",
            "following_error_x_um",
            "following_error_y_um",
        ],
    );

    let bode =
        workspace.json(&["drive", "bode", "--points", "3", "--axis", "z", "--json", "--report", "bode.html"]);
    assert_has(&bode["points"][2], &["step_ratio", "swing_ratio", "harmonic_phase_deg", "linear_phase_deg"]);
    for report in ["step.html", "inertia.html", "circle.html", "bode.html"] {
        let page = workspace.read(report);
        assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"), "{report}");
        assert!(page.contains("<svg") && !page.contains("NaN"), "{report}");
    }
}

#[test]
fn drive_refuses_what_cannot_be_done() {
    let workspace = Workspace::new("drive-refusals");
    for (arguments, words) in [
        (&["step", "--axis", "W"][..], "found axis W, expected"),
        (
            &["step", "--feed-mm-min", "20001"],
            "found a feed of 20001 mm/min, expected at most 20000.0 mm/min",
        ),
        (&["step", "--duration-s", "0"], "found duration [s] 0, expected"),
        (&["circle", "--from", "0"], "found frequencies from 0 to 16 by 1 Hz, expected"),
        (&["circle", "--feed-mm-min", "30000"], "what the ±10 V of axis X reach"),
        (&["circle", "--limit-um", "0"], "found contour limit [µm] 0, expected"),
        (&["harmonic", "--feed-mm-min", "-3"], "found feed [mm/min] -3, expected"),
        (
            &["harmonic", "--to", "300", "--by", "148"],
            "found frequency [Hz] 300, expected a number from 0.05 to 200",
        ),
        (&["inertia", "--frequency", "0"], "found frequency [Hz] 0, expected"),
        (&["bode", "--points", "1"], "found 1 frequencies from 1 to 100 Hz, expected"),
        (&["step", "--machine", "none.toml"], "none.toml: found"),
    ] {
        let refusal = workspace.refusal(&[&["drive"], arguments].concat());
        assert!(refusal.contains(words), "{arguments:?}: {refusal}");
    }
    // What the parser of arguments refuses has the same status.
    assert_eq!(workspace.motion(&["drive", "circle", "--feedforward", "q"]).status.code(), Some(2));
    assert_eq!(workspace.motion(&["drive", "harmonic", "--feedforward", "v"]).status.code(), Some(2));
}

/// A machine is tuned, the file is what was verified, and what would be worse is not written.
#[test]
fn drive_tune_writes_what_it_has_verified() {
    let workspace = Workspace::new("tune");
    let json = workspace.json(&["drive", "tune", "--axis", "x,Y", "--output", "tuned.toml", "--json"]);
    assert_has(&json, &["axes", "learning", "output", "verification"]);
    assert!(json["learning"].is_null());
    assert_eq!(json["output"], "tuned.toml");
    let axes = json["axes"].as_array().expect("a list");
    assert_eq!(axes.len(), 2);
    for axis in axes {
        assert_has(axis, &["changes", "found", "margins", "name", "remarks"]);
        assert_has(&axis["margins"], &["crossover_hz", "gain", "phase_deg", "sensitivity"]);
        assert!((number(&axis["found"]["velocity_gain_per_s"]["value"]) - 440.0).abs() < 4.4);
        for change in axis["changes"].as_array().expect("a list") {
            assert_has(change, &["after", "before", "key", "reason", "unit"]);
        }
    }
    assert!(axes[0]["found"]["bed"].is_null() && axes[1]["found"]["bed"].is_object());
    for circle in json["verification"]["circles"].as_array().expect("a list") {
        let contour_um = |when: &str| number(&circle[when]["contour_error_um"]);
        assert!(contour_um("after") < 1.0 && contour_um("before") > 5.0, "{circle}");
    }
    let tuned = Machine::from_toml("tuned.toml", &workspace.read("tuned.toml")).expect("a machine file");
    let [x, _, z] = &tuned.axes;
    assert!((x.feedforward.lead_s - 1.67e-3).abs() < 1e-5 && x.feedforward.drive.is_some());
    assert_eq!(z, &Machine::reference().axes[2]);

    let arguments = [
        "drive",
        "tune",
        "--axis",
        "X,Y",
        "--method",
        "series",
        "--learn",
        "2",
        "--learn-output",
        "learnt.csv",
        "--json",
    ];
    // The series is worse at 28 Hz than what was published; learning goes on all the same.
    let output = workspace.motion(&arguments);
    assert_eq!(output.status.code(), Some(1));
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let learning = &json["learning"];
    let robustness = learning["robustness"].as_array().expect("a list");
    assert_eq!(robustness.len(), 2);
    for axis in robustness {
        assert_has(axis, &["axis", "contraction", "contraction_hz", "filter_corner_hz"]);
        assert!(number(&axis["contraction"]) < 1.0 && number(&axis["filter_corner_hz"]) > 50.0, "{axis}");
    }
    let csv = workspace.read("learnt.csv");
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("time_s,X_mm_s,Y_mm_s,Z_mm_s"));
    let row: Vec<f64> =
        lines.nth(500).expect("a knot").split(',').map(|cell| cell.parse().expect("a number")).collect();
    assert!(
        (row[0] - 1.0).abs() < 1e-9 && row[1].abs() + row[2].abs() > 0.0 && row[3].abs() <= 0.0,
        "{row:?}"
    );
    let contours: Vec<f64> = learning["repeats"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|repeat| number(&repeat["contour_error_um"]))
        .collect();
    assert!(contours.len() == 3 && contours[0] > 10.0 && contours[2] < 2.5, "{contours:?}");

    let worse = ["drive", "tune", "--machine", "tuned.toml", "--method", "series", "--output", "worse.toml"];
    let output = workspace.motion(&worse);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("a circle got worse: nothing is written"), "{said}");
    // All axes were tuned, and all of them moved.
    assert!(said.contains("Circles of X and Y at") && said.contains("Circles of Z and X at"), "{said}");
    assert!(!workspace.0.join("worse.toml").exists());

    // Before the work, and so before a file is made.
    for (arguments, words) in [
        (&["--learn", "0"][..], "found repeats 0, expected a number from 1 to 1000"),
        (&["--learn", "2", "--learn-hz", "0"], "found frequency [Hz] 0, expected"),
    ] {
        let arguments = [&["drive", "tune", "--report", "early.html"], arguments].concat();
        let refusal = workspace.refusal(&arguments);
        assert!(refusal.contains(words), "{refusal}");
        assert!(!workspace.0.join("early.html").exists());
    }
    let refusal = workspace.refusal(&["drive", "tune", "--axis", "W"]);
    assert!(refusal.contains("found axis W, expected the name of an axis of the machine"), "{refusal}");
    let refusal = workspace.refusal(&["drive", "tune", "--machine", "missing.toml"]);
    assert!(refusal.contains("missing.toml"), "{refusal}");
}

/// One axis alone is judged by its own error, in a plane that it moves in: beside an untuned one the contour gets worse,
/// because axes that lag alike leave none.
#[test]
fn drive_tune_judges_one_axis_by_itself() {
    let workspace = Workspace::new("tune-one");
    let mut text = motion_host::machine::REFERENCE_TOML.to_owned();
    // A machine whose axes are matched.
    text = text.replace("coulomb_friction_mm_s2 = 260.0", "coulomb_friction_mm_s2 = 85.0");
    let bed = text.find("[axis.drive.bed]").expect("Y's bed");
    let end =
        bed + text[bed..].find("mass_ratio = 0.06\n").expect("its last key") + "mass_ratio = 0.06\n".len();
    text.replace_range(bed..end, "");
    workspace.put("pair.toml", &text);
    for (name, plane, moved) in [("X", ["X", "Y"], "first"), ("Z", ["Z", "X"], "first")] {
        let file = format!("{name}.toml");
        let json = workspace.json(&[
            "drive",
            "tune",
            "--machine",
            "pair.toml",
            "--axis",
            name,
            "--output",
            &file,
            "--json",
        ]);
        assert_eq!(json["output"], file.as_str());
        let circles = json["verification"]["circles"].as_array().expect("a list");
        let um = |circle: &Value, when: &str, of: &str| number(&circle[when][of]);
        for circle in circles {
            assert_eq!(circle["axes"].as_array().expect("a list"), &plane);
            let following = format!("following_error_{moved}_um");
            assert!(um(circle, "after", &following) < um(circle, "before", &following), "{circle}");
        }
        let is_worse = |circle: &Value| {
            um(circle, "after", "contour_error_um") > um(circle, "before", "contour_error_um") + 0.2
        };
        assert!(circles.iter().any(is_worse), "matched axes");
    }
}

/// What a board gets is a program to it; what is wrong with the input is said with file and line, and nothing is written.
#[test]
fn compile_writes_a_program_or_says_why_not() {
    let workspace = Workspace::new("compile");
    workspace.put("part.ngc", "G1 X10 Y5 F3000\nG2 X20 Y15 I5 J5 F1000\nG4 P0.1\nG0 Z3\nM2\n");
    for number in ["f32", "fixed"] {
        let said = workspace.stdout(&["compile", "part.ngc", "--number", number, "--output", "part.bin"]);
        let bytes = fs::read(workspace.0.join("part.bin")).expect("a file");
        assert!(said.contains(&format!(" {} bytes", bytes.len())), "{said}");
        let program = Reader::<3>::new(&bytes).expect("a program");
        assert_eq!(*program.header(), Machine::reference().header());
        assert_eq!(check::<f32, 3, _>(program.header(), program.items()), Ok(()));
        assert_eq!(check::<Fixed, 3, _>(program.header(), program.items()), Ok(()));
        assert!(said.contains(&format!(" {} items", program.items().count())), "{said}");
        let blocks = |program: &Reader<'_, 3>| {
            program.items().filter(|item| matches!(item, Ok(Item::Block(_)))).count()
        };
        assert_eq!(blocks(&program), 0);
        let compile = ["compile", "part.ngc", "--live", "--number", number, "--output", "part.bin"];
        let (said, bytes) =
            (workspace.stdout(&compile), fs::read(workspace.0.join("part.bin")).expect("a file"));
        let program = Reader::<3>::new(&bytes).expect("a program");
        // Two stretches.
        assert!(blocks(&program) >= 2);
        assert!(
            said.contains(&format!(" {} items, {} bytes", program.items().count(), bytes.len())),
            "{said}"
        );
        fs::remove_file(workspace.0.join("part.bin")).expect("it is there");
    }
    workspace.put("wrong.ngc", "G1 X10 F3000\nG1 X2O\nM2\n");
    let refusal = workspace.refusal(&["compile", "wrong.ngc", "--output", "part.bin"]);
    assert!(refusal.starts_with("wrong.ngc:2:") && refusal.contains(", expected"), "{refusal}");
    workspace.put("dense.ngc", "G1 X1 F600\nG1 X1.0000000001\nM2\n");
    let refusal = workspace.refusal(&["compile", "dense.ngc", "--output", "part.bin"]);
    assert!(refusal.starts_with("dense.ngc:2: found "), "{refusal}");
    assert!(!workspace.0.join("part.bin").exists());
    let refusal = workspace.refusal(&["compile", "part.ngc", "--output", "no/such/place"]);
    assert!(refusal.starts_with("no/such/place: found ") && refusal.contains(", expected"), "{refusal}");
    // A machine that f32 holds and fixed point does not.
    let wide = motion_host::machine::REFERENCE_TOML.replacen(
        "feedforward_accel_s = 0.001675",
        "feedforward_accel_s = 1.0",
        1,
    );
    workspace.put("wide.toml", &wide);
    let compile = |number| {
        ["compile", "part.ngc", "--machine", "wide.toml", "--number", number, "--output", "wide.bin"]
    };
    let refusal = workspace.refusal(&compile("fixed"));
    assert!(
        refusal.contains("axis X: feedforward gains") && refusal.contains("expected numbers within"),
        "{refusal}"
    );
    assert!(!workspace.0.join("wide.bin").exists());
    workspace.stdout(&compile("f32"));
}

/// Points of two turns of a curve in space, `count` of them.
fn points(count: u32) -> String {
    let row = |index: u32| {
        let t = f64::from(index) / f64::from(count - 1) * 4.0 * core::f64::consts::PI;
        format!("{:.6},{:.6},{:.6}\n", 20.0 * t.cos() - 20.0, 12.0 * t.sin(), 0.5 * t)
    };
    std::iter::once("x_mm,y_mm,z_mm\n".to_owned()).chain((0..count).map(row)).collect()
}

#[test]
fn spline_runs_points() {
    let workspace = Workspace::new("spline-points");
    workspace.put("points.csv", &points(200));
    let run = workspace.json(&["spline", "points.csv", "--feed", "1500", "--json"]);
    assert_has(&run, &["ticks", "planned_time_s", "path_length_mm", "max", "axes", "faults", "spline"]);
    let spline = &run["spline"];
    assert_eq!(
        keys(spline),
        [
            "degree",
            "deviation_mm",
            "feed_error",
            "jerk_step_mm_s3",
            "length_mm",
            "pieces",
            "points",
            "position_error_mm",
            "spans"
        ]
    );
    assert_eq!((&spline["degree"], &spline["points"]), (&Value::from(5), &Value::from(200)));
    assert!(number(&spline["deviation_mm"]) < 1e-9 && number(&spline["jerk_step_mm_s3"]) < 1e-3);
    assert!(number(&spline["position_error_mm"]) <= 1.25e-6 && number(&spline["feed_error"]) <= 1.25e-6);
    assert!((number(&run["path_length_mm"]) - number(&spline["length_mm"])).abs() < 1e-6);
    assert!((number(&run["max"]["feed_mm_s"]) - 25.0).abs() < 1e-3);
    // Fewer knots within a tolerance, and a jerk that steps with degree 3.
    let near = ["spline", "points.csv", "--tolerance", "0.01", "--degree", "3", "--json"];
    let spline = &workspace.json(&near)["spline"];
    assert!(number(&spline["spans"]) < 100.0 && number(&spline["deviation_mm"]) <= 0.01, "{spline}");
    assert!(number(&spline["jerk_step_mm_s3"]) > 1.0, "{spline}");
    let text = workspace.stdout(&["spline", "points.csv", "--report", "run.html", "--trace", "run.csv"]);
    for words in ["spline of degree 5", "pieces of degree 7", "report written to run.html"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let page = workspace.read("run.html");
    assert!(
        page.contains("<svg") && page.contains("spline of degree 5") && page.trim_end().ends_with("</html>")
    );
    assert!(workspace.read("run.csv").starts_with("tick,t_s,s_mm,"));
}

#[test]
fn spline_alone_is_the_experiment() {
    let workspace = Workspace::new("spline-experiment");
    let found = workspace.json(&["spline", "--json"]);
    assert_eq!(keys(&found), ["evaluators", "feed_mm_s", "paths", "tick_s"]);
    let paths = found["paths"].as_array().expect("a list");
    let names: Vec<&Value> = paths.iter().map(|path| &path["name"]).collect();
    assert_eq!(names, ["arcs", "cubic spline", "quintic spline"]);
    assert_has(&paths[0], &["length_mm", "time_s", "ticks", "deviation_mm", "junctions", "by_tick"]);
    assert_eq!(paths[1]["junctions"].as_array().map(Vec::len), Some(8));
    assert!((number(&paths[1]["junctions"][5]["jerk_step_mm_s3"]) - 6268.0).abs() < 0.5);
    assert_eq!(paths[2]["junctions"][0]["published_s"], 0.055);
    let text = workspace.stdout(&["spline", "--report", "page.html", "--trace", "axes.csv"]);
    for words in ["0.278017 s", "-319.225 to -399.031 mm/s²", "78444.3", "up to 3.8 ms", "septic pieces"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let page = workspace.read("page.html");
    assert!(
        page.matches("<svg").count() >= 3 && !page.contains("NaN") && page.trim_end().ends_with("</html>")
    );
    let trace = workspace.read("axes.csv");
    let lines: Vec<&str> = trace.lines().collect();
    assert!(
        lines[0].starts_with("tick,t_s,arcs_x_vel_mm_s,arcs_x_acc_mm_s2,arcs_x_jerk_mm_s3,arcs_y_vel_mm_s,")
    );
    assert_eq!(lines.len(), 502);
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == columns));
    assert_eq!(workspace.motion(&["spline", "--degree", "3"]).status.code(), Some(2));
}

#[test]
fn spline_names_what_is_wrong_with_its_points() {
    let workspace = Workspace::new("spline-wrong");
    let heading = "x_mm,y_mm,z_mm,u\n";
    let line = "0,0,0,0\n1,1,0,1\n2,0,0,2\n3,1,0,3\n4,0,0,4\n";
    for (text, more, refusal) in [
        (format!("{heading}{line}5,x,0,5\n"), "", "p.csv:7:3: found x, expected a finite number"),
        (
            format!("{heading}{line}5,0,0\n"),
            "",
            "p.csv:7:6: found 3 columns, expected 4 columns, as in the heading",
        ),
        (format!("{heading}{line}"), "", "p.csv: found 5 points, expected at least 6"),
        (
            format!("{heading}{line}4,0,0,5\n"),
            "",
            "p.csv:7: found the point before once more, expected points that differ",
        ),
        (
            format!("{heading}{line}5,0,0,4\n"),
            "",
            "p.csv:7: found u = 4 after 4, expected a finite number above",
        ),
        (
            format!("{heading}{line}5,0,0,5\n"),
            "--feed=-1",
            "found --feed -1, expected a finite feed above 0 mm/min",
        ),
        (
            format!("{heading}{line}5,0,0,5\n"),
            "--tolerance=nan",
            "found --tolerance NaN, expected a finite number of mm that is not below 0",
        ),
        (
            format!("{heading}-1,1,0,-1\n-0.125,0.25,0,-0.5\n0.125,0.25,0,0.5\n1,1,0,1\n"),
            "--degree=3",
            "p.csv:5: found a curve that stands still at 0.5 of its parameter, expected one that moves on everywhere, \
             without a cusp",
        ),
        (format!("{heading}{line}1e7,0,0,5\n"), "", "p.csv:7: found a curve of "),
    ] {
        workspace.put("p.csv", &text);
        let arguments =
            [&["spline", "p.csv"][..], if more.is_empty() { &[] } else { std::slice::from_ref(&more) }];
        let found = workspace.refusal(&arguments.concat());
        assert!(found.starts_with(refusal), "{found}");
    }
    let found = workspace.refusal(&["spline", "missing.csv"]);
    assert!(found.starts_with("missing.csv: found ") && found.contains(", expected"), "{found}");
    let found = workspace.refusal(&["spline", "--report", "no/such/place"]);
    assert!(found.starts_with("no/such/place: found "), "{found}");
}
