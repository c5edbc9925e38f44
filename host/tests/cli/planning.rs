//! `profile`, `machine`, `plan`, `compile`: figures, plans and what planning refuses.

use std::f64::consts::PI;
use std::fs;

use motion_host::machine::Machine;
use motion_kernel::hal::{OutputState, Spindle};
use motion_kernel::num::Fixed;
use motion_kernel::program::{Item, Reader, check};
use serde_json::Value;

use super::workspace::{STRINGER, Workspace, assert_has, keys, number, profile};

const RAMP_KEYS: [&str; 10] = [
    "law",
    "peak_jerk_mm_s3",
    "edge_s",
    "plateau_s",
    "t1_s",
    "t2_s",
    "tp_s",
    "length_mm",
    "limited_by",
    "at",
];

/// The worked example with a plateau: the edge is π·J/(2·DJ), and all other figures follow from it.
#[test]
fn profile_with_a_plateau() {
    let workspace = Workspace::new("profile-plateau");
    let ramp = workspace.json(&profile("0", "200", &["--law", "plateau", "--json"]));
    assert_has(&ramp, &RAMP_KEYS);
    assert_eq!((&ramp["law"], &ramp["limited_by"]), (&Value::from("plateau"), &Value::from("acceleration")));
    let edge_s = PI * 5e3 / (2.0 * 4e5);
    for (key, expected) in [
        ("peak_jerk_mm_s3", 5e3),
        ("edge_s", edge_s),
        ("plateau_s", 0.1 - edge_s),
        ("t1_s", 0.1 + edge_s),
        ("t2_s", 0.4),
        ("tp_s", 0.5 + edge_s),
        ("length_mm", 100.0 * (0.5 + edge_s)),
    ] {
        let found = number(&ramp[key]);
        assert!((found - expected).abs() <= 1e-12 * expected, "{key}: {found}, expected {expected}");
    }
    // In the middle of the edge: half of the jerk, all of the snap.
    let at = ramp["at"].as_array().expect("a list");
    assert!((number(&at[0]["t_s"]) - edge_s / 2.0).abs() < 1e-12);
    assert!((number(&at[0]["j_mm_s3"]) - 2500.0).abs() < 1e-6);
    assert!((number(&at[0]["snap_mm_s4"]) - 4e5).abs() < 1e-4);
    assert!((number(&at[1]["a_mm_s2"]) - 500.0).abs() < 1e-9);
    let table = workspace.stdout(&profile("0", "200", &["--law", "plateau"]));
    for word in ["e = 0.019635 s, p = 0.080365 s", "tp = 0.519635 s", "S = 51.963495 mm", "e/2", "400000.00"]
    {
        assert!(table.contains(word), "{word} is not in\n{table}");
    }
    assert!(!table.contains("t1/4"), "{table}");
    let csv = workspace.stdout(&profile("0", "200", &["--law", "plateau", "--csv", "--tick", "0.001"]));
    assert_eq!(csv.lines().count(), 522);
    assert!(csv.lines().last().expect("a row").starts_with("0.51963"), "{csv}");
    // Small changes of feed have no plateau under either law.
    let ramps =
        ["sin2", "plateau"].map(|law| workspace.json(&profile("18", "20", &["--law", law, "--json"])));
    assert!(number(&ramps[1]["plateau_s"]).abs() <= 0.0, "{}", ramps[1]);
    assert_eq!(ramps[0]["at"], ramps[1]["at"]);
    let refused = workspace.motion(&profile("0", "200", &["--law", "sine"]));
    let error = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && error.contains("sin2, plateau"), "{error}");
}

#[test]
fn profile_json() {
    let workspace = Workspace::new("profile-json");
    let ramp = workspace.json(&profile("0", "200", &["--json"]));
    assert_has(&ramp, &RAMP_KEYS);
    assert_eq!(ramp["law"], "sin2");
    assert_eq!(ramp, workspace.json(&profile("0", "200", &["--json", "--law", "sin2"])));
    assert!((number(&ramp["edge_s"]) - 0.1).abs() < 1e-12 && number(&ramp["plateau_s"]).abs() <= 0.0);
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
    assert_eq!(file, include_str!("../../src/machine/reference.toml"));
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
        "law: \"sin2\" or \"plateau\"; default \"plateau\"",
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
fn plan_of_the_stringer() {
    let workspace = Workspace::new("plan");
    workspace.put("part.ngc", STRINGER);
    let file = workspace.stdout(&["machine"]);
    workspace.put("sin2.toml", &file.replace("law = \"plateau\"", "law = \"sin2\""));
    let [per_block, sin2, plateau] = [&["--per-block"][..], &["--machine", "sin2.toml"], &[]].map(|more| {
        let plan = workspace.json(&[&["plan", "part.ngc", "--json"], more].concat());
        check_stringer(&plan, if more.is_empty() { plateau_pulse } else { arch });
        plan
    });
    let time_s = |plan: &Value| number(&plan["time_s"]);
    let reasons = |plan: &Value| {
        let blocks = plan["blocks"].as_array().expect("a list");
        blocks.iter().map(|block| block["cap_reason"].clone()).collect::<Vec<Value>>()
    };
    // S3's result. The paper does not say what limits N1.
    for plan in [&per_block, &sin2] {
        assert_eq!(reasons(plan)[1..], ["jerk", "acceleration", "jerk", "braking"]);
    }
    assert!(time_s(&sin2) <= time_s(&per_block) + 1e-9);
    // With a plateau the last line is long enough for its feed, and every block reaches its ceiling: the time
    // is that of the ceilings, and of each ramp half of its duration times the feed it lacks.
    assert_eq!(reasons(&plateau)[1..], ["jerk", "acceleration", "jerk", "programmed"]);
    let blocks = plateau["blocks"].as_array().expect("a list");
    let of = |key: &str| blocks.iter().map(|block| number(&block[key])).collect::<Vec<f64>>();
    let (lengths_mm, caps_mm_s) = (of("length_mm"), of("cap_mm_s"));
    let lost_s = |ramp_s: f64, cap_mm_s: f64, to_mm_s: f64| ramp_s * (cap_mm_s - to_mm_s) / (2.0 * cap_mm_s);
    let on_a_line_s = |cap_mm_s: f64, to_mm_s: f64| {
        let (pulse_s, hold_s) = plateau_pulse(cap_mm_s - to_mm_s);
        lost_s(pulse_s + hold_s, cap_mm_s, to_mm_s)
    };
    let [n1, n2, n3, _, n5] = caps_mm_s[..] else { panic!("{caps_mm_s:?}") };
    let feed = plateau["feed"].as_array().expect("a list");
    let on_the_arc =
        |part: &&Value| (number(&part["to_mm_s"]) - n3).abs() < 1e-6 && number(&part["t1_s"]) > 0.0;
    let on_the_arc_s = number(&feed.iter().find(on_the_arc).expect("a ramp")["time_s"]);
    let expected_s = lengths_mm.iter().zip(&caps_mm_s).map(|(length, cap)| length / cap).sum::<f64>()
        + on_a_line_s(n1, 0.0)
        + on_a_line_s(n1, n2)
        + 2.0 * lost_s(on_the_arc_s, n3, n2)
        + on_a_line_s(n5, n2)
        + on_a_line_s(n5, 0.0);
    let found_s = time_s(&plateau);
    assert!((found_s - expected_s).abs() < 1e-6, "{found_s}, by formula {expected_s}");
    assert!(found_s < 0.94 * time_s(&sin2), "{found_s}, {}", time_s(&sin2));
    let table = workspace.stdout(&["plan", "part.ngc", "--per-block"]);
    for word in ["limited by", "mm/min", "acceleration", "5 blocks"] {
        assert!(table.contains(word), "{word} is not in\n{table}");
    }
}

/// P and t₂ of a sin² ramp: S1 (22), (23).
fn arch(change_mm_s: f64) -> (f64, f64) {
    let snap_s = (2.0 * PI * change_mm_s / 4e5).cbrt();
    let jerk_s = (2.0 * change_mm_s / 5e3).sqrt();
    if jerk_s <= PI * 5e3 / 4e5 {
        return (snap_s, snap_s);
    }
    let pulse_s = jerk_s.min(2.0 * 500.0 / 5e3);
    (pulse_s, pulse_s.max(change_mm_s / 500.0))
}

/// The same with a plateau: A = J·(P − e), and without a hold x = J·P·(P − e).
fn plateau_pulse(change_mm_s: f64) -> (f64, f64) {
    let edge_s = PI * 5e3 / (2.0 * 4e5);
    let jerk_s = edge_s / 2.0 + (edge_s / 2.0).hypot((change_mm_s / 5e3).sqrt());
    if jerk_s <= 2.0 * edge_s {
        return arch(change_mm_s);
    }
    let pulse_s = jerk_s.min(500.0 / 5e3 + edge_s);
    (pulse_s, pulse_s.max(change_mm_s / 500.0))
}

/// What is so under every law, with the times of its ramps by `pulse`.
fn check_stringer(plan: &Value, pulse: fn(f64) -> (f64, f64)) {
    assert_has(plan, &["time_s", "blocks", "feed"]);
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
    let feed = plan["feed"].as_array().expect("a list");
    let is_on_a_line = |at_mm: f64| {
        let block = blocks.iter().rfind(|block| number(&block["start_mm"]) < at_mm + 1e-6).expect("a block");
        block["kind"] == "line"
    };
    let mut lines_ramps = 0;
    let (mut start_mm, mut time_s) = (0.0, 0.0);
    for part in feed {
        assert_has(
            part,
            &[
                "start_mm",
                "length_mm",
                "from_mm_s",
                "to_mm_s",
                "law",
                "peak_jerk_mm_s3",
                "edge_s",
                "plateau_s",
                "t1_s",
                "t2_s",
                "time_s",
            ],
        );
        let of = |key: &str| number(&part[key]);
        let change_mm_s = (of("to_mm_s") - of("from_mm_s")).abs();
        if change_mm_s > 0.0 {
            let [edge_s, t1_s, t2_s] = ["edge_s", "t1_s", "t2_s"].map(of);
            assert!((2.0 * edge_s + of("plateau_s") - t1_s).abs() < 1e-12, "{part}");
            let gained_mm_s = of("peak_jerk_mm_s3") * (t1_s - edge_s) * t2_s;
            assert!((gained_mm_s - change_mm_s).abs() < 1e-9 * change_mm_s, "{part}: {gained_mm_s} mm/s");
            assert!((of("time_s") - t1_s - t2_s).abs() < 1e-9, "{part}");
            // On the arcs the path leaves less than the machine's limits.
            if is_on_a_line(of("start_mm")) {
                let (pulse_s, hold_s) = pulse(change_mm_s);
                assert!((t1_s - pulse_s).abs() < 1e-9 * pulse_s, "{part}, by formula {pulse_s} s");
                assert!((t2_s - hold_s).abs() < 1e-9 * hold_s, "{part}, by formula {hold_s} s");
                lines_ramps += 1;
            }
        }
        let is_arch = pulse(50.0) == arch(50.0);
        assert_eq!(part["law"], if is_arch { "sin2" } else { "plateau" });
        assert!(!is_arch || of("plateau_s").abs() <= 0.0, "{part}");
        assert!((number(&part["start_mm"]) - start_mm).abs() < 1e-6);
        start_mm += number(&part["length_mm"]);
        time_s += number(&part["time_s"]);
    }
    assert!((time_s - number(&plan["time_s"])).abs() < 1e-9);
    assert_eq!(lines_ramps, 4);
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

const TICKS: &str = "expected at most 1073741.824 s (2147483648 ticks)";

const KILOMETRE: &str = "expected at most 1000000 mm between two full stops";

/// Every refusal of a plan, to the letter: the line of the block concerned, what was found, what was
/// expected.
#[test]
fn what_planning_refuses() {
    let workspace = Workspace::new("planning");
    for (program, refusal) in [
        (
            "G61 G1 X1 F600\nG1 X1.001 F0.0000000001\nG1 X2 F600\nM2\n",
            format!("2: found the time without jerk = 599999958.6492777 s, {TICKS}"),
        ),
        ("G1 X1 F600\nG4 P1073742\nM2\n", format!("2: found a dwell of 1073742 s, {TICKS}")),
        (
            "G2 X0 Y0 I200000 F18000\nM2\n",
            format!("1: found 1256637.0614359172 mm of path without a full stop, {KILOMETRE}"),
        ),
        (
            "G61 G0 X-1000000\nG0 X0\nG0 X1000000\nM2\n",
            format!("3: found 2000000 mm of path without a full stop, {KILOMETRE}"),
        ),
        (
            "G61 G0 X999999\nG2 I2 F1000\nM2\n",
            "2: found a path through X = 1000000.2346331353 mm, expected coordinates within ±1000000 mm"
                .to_owned(),
        ),
        (
            "G61 G1 X1 F600\nG1 X1.0000000001\nM2\n",
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
        (": 40}", ": 1e-9}", &format!("7: found the time without jerk = 2.5e10 s, {TICKS}")),
        (": 25,", ": 999990,", &format!("7: found 1000040 mm of path without a full stop, {KILOMETRE}")),
    ] {
        assert!(BLOCKS.contains(found), "{found}");
        assert_eq!(refusal(&BLOCKS.replacen(found, to, 1)), expected, "{to}");
    }
    let torn = BLOCKS.split(SECOND).next().expect("a beginning");
    assert_eq!(refusal(torn), "7:4: found the end of the file, expected the rest of a value");

    for wrong in ["-1", "null", "\"other\"", "\"Plateau\"", "\"at line 3\"", "[\"sin2\"]"] {
        let found = refusal(&BLOCKS.replacen('{', &format!("{{ \"law\": {wrong},"), 1));
        let expected = format!(": found {wrong}, expected \"sin2\" or \"plateau\"");
        assert!(found.starts_with("1:") && found.ends_with(&expected), "{found}");
    }

    // One ramp over both blocks, v·P = 1 mm. An arch has v = J·P²/2, so that v = 50^(2/3) mm/s; a pulse with
    // a plateau has v = J·P·(P − e), so that J·P²·(P − e) = 1 mm.
    let (jerk, edge_s) = (5e3, PI * 5e3 / (2.0 * 4e5));
    let pulse_s = (0..100).fold((edge_s, 1.0), |(low, high), _| {
        let middle = 0.5 * (low + high);
        if jerk * middle * middle * (middle - edge_s) < 1.0 { (middle, high) } else { (low, middle) }
    });
    let short = BLOCKS.replace(": 50,", ": 0.5,").replace(": 25,", ": 0.5,");
    for (law, most_mm_s) in
        [("", 1.0 / pulse_s.0), ("plateau", 1.0 / pulse_s.0), ("sin2", 50_f64.powf(2.0 / 3.0))]
    {
        let short = match law {
            "" => short.clone(),
            law => short.replacen('{', &format!("{{ \"law\": \"{law}\","), 1),
        };
        for (key, feed_mm_s, before, after) in [
            ("start_feed_mm_s", 80, "3: found start feed 80 mm/s, expected at most ", "brake from more"),
            ("end_feed_mm_s", 40, "4: found end feed 40 mm/s, expected at most ", "reach more"),
        ] {
            let found = refusal(&short.replace(&format!("{key}\": 0"), &format!("{key}\": {feed_mm_s}")));
            let rest = found.strip_prefix(before).unwrap_or_else(|| panic!("{found}"));
            let (figure, rest) = rest.split_once(" mm/s: the path is too short to ").expect("a figure");
            let figure: f64 = figure.parse().expect("a number");
            assert!((figure - most_mm_s).abs() < 1e-9 * most_mm_s, "{law}: {found}, by formula {most_mm_s}");
            assert_eq!(rest, after);
        }
    }
}

/// What a board gets is a program to it; what is wrong with the input is said with file and line, and nothing
/// is written.
#[test]
fn compile_writes_a_program_or_says_why_not() {
    let workspace = Workspace::new("compile");
    workspace.put("part.ngc", "G61 G1 X10 Y5 F3000\nG2 X20 Y15 I5 J5 F1000\nG4 P0.1\nG0 Z3\nM2\n");
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
    workspace.put("dense.ngc", "G61 G1 X1 F600\nG1 X1.0000000001\nM2\n");
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

/// What the machine has no output for is refused by `compile`, with line and word, unless told otherwise.
#[test]
fn compile_refuses_words_without_an_output() {
    let workspace = Workspace::new("outputs");
    workspace.put("part.ngc", "G21 G90 G61\nM5 M9 S900\nM3\nM8\nG1 X1 F600\nM30\n");
    workspace.put("coolant.ngc", "G21 G90 G61\nM7\nG1 X1 F600\nM30\n");
    workspace.put("none.ngc", "G21 G90 G61\nS900\nG1 X1 F600\nM5 M9\nM30\n");
    let compile =
        |part, more: &[&'static str]| [&["compile", part, "--live", "--output", "part.bin"], more].concat();
    let refusal = workspace.refusal(&compile("part.ngc", &[]));
    assert!(
        refusal.starts_with("part.ngc:3: found M3, and the machine file has no [spindle], expected"),
        "{refusal}"
    );
    assert!(refusal.ends_with("or --no-spindle to leave the word out"), "{refusal}");
    assert!(workspace.refusal(&compile("coolant.ngc", &[])).starts_with("coolant.ngc:2: found M7, and the"));
    assert!(!workspace.0.join("part.bin").exists());
    // Nothing is ever on.
    workspace.stdout(&compile("none.ngc", &[]));
    let said = workspace.stdout(&compile("part.ngc", &["--no-spindle"]));
    assert!(
        said.contains("note: line 2: M3, M4, M5 are not acted on: there is no spindle (2 lines)"),
        "{said}"
    );
    let without = fs::read(workspace.0.join("part.bin")).expect("a file");

    let tables = "\n[spindle]\nspeed_max_rpm = 24000\nstart_s = 0.5\n\n[coolant]\n\n[[axis]]\n";
    let machine = workspace.stdout(&["machine"]).replacen("\n[[axis]]\n", tables, 1);
    workspace.put("mill.toml", &machine);
    workspace.put("spindle.toml", &machine.replacen("\n[coolant]\n", "\n", 1));
    let refusal = workspace.refusal(&compile("part.ngc", &["--machine", "spindle.toml"]));
    assert!(refusal.starts_with("part.ngc:4: found M8, and the machine file has no [coolant]"), "{refusal}");
    let said = workspace.stdout(&compile("part.ngc", &["--machine", "mill.toml"]));
    assert!(!said.contains("note: "), "{said}");
    let bytes = fs::read(workspace.0.join("part.bin")).expect("a file");
    let switches = |bytes: &[u8]| {
        let items = Reader::<3>::new(bytes).expect("a program").items();
        let switch = |item| match item {
            Ok(Item::Switch(to)) => Some(to),
            _ => None,
        };
        items.filter_map(switch).collect::<Vec<OutputState>>()
    };
    let on = OutputState { spindle: Spindle::Clockwise, speed_rpm: 900.0, ..OutputState::OFF };
    let all = [
        on,
        OutputState { flood: true, ..on },
        OutputState { flood: true, ..OutputState::OFF },
        OutputState::OFF,
    ];
    assert_eq!((switches(&without), switches(&bytes)), (vec![], all.to_vec()));

    // The same in a run, with the ticks.
    let run = workspace.json(&["run", "part.ngc", "--machine", "mill.toml", "--json"]);
    let outputs = run["outputs"].as_array().expect("a list");
    assert_eq!(outputs.len(), 4);
    assert_eq!(keys(&outputs[1]), ["flood", "line", "mist", "speed_rpm", "spindle", "tick"]);
    assert_eq!(outputs[1]["spindle"], "clockwise");
    assert_eq!((number(&outputs[1]["line"]), number(&outputs[1]["speed_rpm"])), (4.0, 900.0));
    let [on, off] = [0, 3].map(|index: usize| number(&outputs[index]["tick"]));
    let said = workspace.stdout(&["run", "part.ngc", "--machine", "mill.toml"]);
    let line =
        format!("spindle and coolant: 4 switches, the first before tick {on}, all off before tick {off}");
    assert!(said.contains(&line), "{said}");
    assert_eq!(workspace.json(&["run", "part.ngc", "--json"])["outputs"], Value::Array(Vec::new()));
    // And read, a step each.
    let read = workspace.stdout(&["read", "part.ngc", "--json"]);
    let step = r#"{"line":4,"kind":"switch","spindle":"clockwise","speed":900.0,"surface":false,"flood":true,"mist":false}"#;
    assert!(read.lines().any(|line| line == step), "{read}");
    assert!(workspace.stdout(&["read", "part.ngc"]).contains("spindle clockwise 900 rev/min, flood"));
}
