//! `profile`, `machine`, `plan`, `compile`: figures, plans and what planning refuses.

use std::fs;

use motion_host::machine::Machine;
use motion_kernel::num::Fixed;
use motion_kernel::program::{Item, Reader, check};
use serde_json::Value;

use crate::workspace::{STRINGER, Workspace, assert_has, keys, number, profile};

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

const TICKS: &str = "expected at most 1073741.824 s (2147483648 ticks)";

const KILOMETRE: &str = "expected at most 1000000 mm between two full stops";

/// Every refusal of a plan, to the letter: the line of the block concerned, what was found, what was
/// expected.
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
    // One ramp over both blocks: v·√(2v/J) = 1 mm for v = 50^(2/3) mm/s.
    let found = refusal(&short.replace("start_feed_mm_s\": 0", "start_feed_mm_s\": 80"));
    assert!(found.starts_with("3: found start feed 80 mm/s, expected at most 13.57208"), "{found}");
    assert!(found.ends_with(" mm/s: the path is too short to brake from more"), "{found}");
    let found = refusal(&short.replace("end_feed_mm_s\": 0", "end_feed_mm_s\": 40"));
    assert!(found.starts_with("4: found end feed 40 mm/s, expected at most 13.57208"), "{found}");
    assert!(found.ends_with(" mm/s: the path is too short to reach more"), "{found}");
}

/// What a board gets is a program to it; what is wrong with the input is said with file and line, and nothing
/// is written.
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
