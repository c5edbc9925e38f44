//! Probing on a machine whose file says what the probe touches.

use serde_json::{Value, json};

use super::workspace::{Workspace, assert_has, keys, number};

const PLATE: &str = include_str!("../../../tests/programs/probing/plate.ngc");

/// A workspace with the sample, and the reference machine with its commented box.
fn workspace(name: &str) -> Workspace {
    let workspace = Workspace::new(name);
    let file = workspace.stdout(&["machine"]);
    let (before, touch) = file.split_once("#[[probe.box]]").expect("a box");
    let (touch, after) = touch.split_once("\n\n").expect("its end");
    let touch = touch.replace("\n#low_mm", "\nlow_mm").replace("\n#high_mm", "\nhigh_mm");
    workspace.put("probing.toml", &[before, "[[probe.box]]", &touch, "\n\n", after].concat());
    workspace.put("plate.ngc", PLATE);
    workspace
}

fn line_of(text: &str) -> u32 {
    PLATE.lines().zip(1..).find(|(line, _)| line.contains(text)).expect(text).1
}

#[test]
fn steps_tell_where_the_probe_trips() {
    let workspace = workspace("probing-read");
    let printed = workspace.stdout(&["read", "plate.ngc", "--machine", "probing.toml", "--json"]);
    let steps = printed.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let probes: Vec<Value> = steps.filter(|step| step["kind"] == "probe").collect();
    assert_eq!(probes.len(), 8);
    assert_eq!(
        keys(&probes[0]),
        ["end_mm", "feed_mm_min", "from_mm", "kind", "leaves", "line", "to_mm", "trip_mm"]
    );
    assert_eq!(probes[0]["trip_mm"], json!([20.0, 30.0, -10.0]));
    assert_eq!(
        (&probes[0]["from_mm"], &probes[0]["end_mm"]),
        (&json!([20.0, 30.0, 5.0]), &json!([20.0, 30.0, -20.0]))
    );
    assert_eq!((&probes[6]["leaves"], &probes[7]["trip_mm"]), (&json!(true), &Value::Null));
    let table = workspace.stdout(&["read", "plate.ngc", "--machine", "probing.toml"]);
    for words in
        ["touches at X20.0000 Y30.0000 Z-10.0000", "leaves at X", "does not trip", "left edge at 0.000000 mm"]
    {
        assert!(table.contains(words), "{words} is not in\n{table}");
    }
}

#[test]
fn a_run_latches_where_the_probe_trips() {
    let workspace = workspace("probing-run");
    let arguments = ["run", "plate.ngc", "--machine", "probing.toml", "--record", "plate.mrec"];
    let run = workspace.json(&[&arguments[..], &["--json"]].concat());
    let probes = run["probes"].as_array().expect("a list");
    assert_eq!(probes.len(), 8);
    for probe in probes {
        assert_has(probe, &["line", "tick", "tripped", "position_mm", "program_mm"]);
    }
    // At 300 mm/min a tick is 2.5 µm.
    let top_mm = number(&probes[0]["position_mm"][2]);
    assert!((-10.005..=-10.0).contains(&top_mm), "{top_mm}");
    assert_eq!((&probes[7]["tripped"], &probes[7]["program_mm"]), (&json!(false), &Value::Null));
    assert_eq!(probes[7]["line"], json!(line_of("G38.3")));
    let printed = workspace.stdout(&arguments);
    assert!(
        printed.contains(&format!("line {}: the probe did not trip, in tick", line_of("G38.3"))),
        "{printed}"
    );
    let replayed = workspace.json(&["replay", "plate.mrec", "--json"]);
    assert_eq!(replayed["probes"], run["probes"]);
    assert!(workspace.stdout(&["plan", "plate.ngc", "--machine", "probing.toml"]).contains("blocks"));
}

/// The program's end is the surface itself: it reads a trip, and the axes stop short of it.
#[test]
fn a_run_that_disagrees_with_the_program_fails_and_keeps_no_parameters() {
    let workspace = workspace("probing-disagrees");
    let text = "G61 G0 X20 Y5\nG38.2 Z-10 F600\nG38.4 Z5\nG10 L20 P1 Z[#5063-1]\nG1 X25\nM2\n";
    workspace.put("face.ngc", text);
    workspace.put("kept.var", "5220\t1\n");
    let run = ["run", "face.ngc", "--machine", "probing.toml", "--parameters", "kept.var"];
    let (printed, _) = workspace.ending(1, &run);
    assert!(printed.contains("the probe did not trip, but the program reads that it tripped"), "{printed}");
    assert_eq!(workspace.read("kept.var"), "5220\t1\n");
}

#[test]
fn a_probe_that_is_not_there_is_refused() {
    let workspace = workspace("probing-refused");
    let line = line_of("G38.2 Z#2 F#3");
    let expected = format!(
        "plate.ngc:{line}:5: found G38.2, which needs a probe, expected [[probe.box]] in a machine file"
    );
    for command in ["read", "run", "plan"] {
        let refused = workspace.refusal(&[command, "plate.ngc"]);
        assert!(refused.starts_with(&expected), "{refused}");
    }
    let compile = ["compile", "plate.ngc", "--machine", "probing.toml", "--output", "plate.bin"];
    let refused = workspace.refusal(&compile);
    let expected = "expected none: a board has no probe input yet";
    assert!(refused.starts_with("plate.ngc:") && refused.ends_with(expected), "{refused}");
    assert!(!workspace.0.join("plate.bin").exists());
}
