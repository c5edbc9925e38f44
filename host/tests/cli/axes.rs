//! `home` and `jog`.

use std::f64::consts::PI;

use serde_json::Value;

use super::workspace::{Workspace, assert_has, number};

/// The machine file's homing in use: the reference is the index behind the switch; what is not found is
/// named.
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

/// On a board the same references, with their keys; what the board or the command refuses.
#[test]
fn home_on_a_board() {
    let workspace = Workspace::new("home-on-a-board");
    workspace.put("homed.toml", &workspace.near_homing());
    let home = ["home", "--machine", "homed.toml", "--json"];
    let there = workspace.json(&[&home[..], &["--axis", "X", "--port", "simulator", "--enable"]].concat());
    let here = workspace.json(&home);
    for key in ["axis", "counts", "index_counts"] {
        assert_eq!(there[0][key], here[0][key], "{there} {here}");
    }
    assert!(there[0]["true_mm"].is_null() && number(&there[0]["position_mm"]).abs() < 0.01, "{there}");
    assert_eq!(
        workspace.refusal(&["home", "--machine", "homed.toml", "--axis", "Y"]),
        "homed.toml: found axis Y, expected one with [axis.homing]: X"
    );
    // The same board has had no fault.
    let empty = workspace.motion(&["flight", "--port", "simulator"]);
    let error = String::from_utf8_lossy(&empty.stderr);
    assert!(empty.status.code() == Some(1) && error.contains("found an empty flight recorder"), "{error}");
    for (more, expected) in
        [(&[][..], "expected --enable"), (&["--dead-man", "0.1"], "expected from 0.15 to 60 s")]
    {
        let refusal =
            workspace.refusal(&[&["home", "--machine", "homed.toml", "--port", "simulator"], more].concat());
        assert!(refusal.contains(expected), "{refusal}");
    }
}

/// Keys pressed one after the other: by a distance, to the soft limit, released on the way; and what is
/// refused.
#[test]
fn jog_goes_as_far_as_its_key_says() {
    let workspace = Workspace::new("jog");
    let file = workspace.stdout(&["machine"]);
    let bounded = file.replace("#[axis.travel]", "[axis.travel]");
    let bounded = bounded.replace("#low_mm = -400", "low_mm = -40").replace("#high_mm = 400", "high_mm = 30");
    workspace.put("machine.toml", &bounded);
    let keys = ["X+20", "Y-2.5", "X+", "X-@400", "X+1@5000"];
    let rest = ["--machine", "machine.toml", "--feed", "3000", "--trace", "jog.csv", "--json"];
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
    // Released after 0.2 s, in the ramp's second half, which jerk limits: it and braking from 50 mm/s take
    // all of their times.
    let released_in_the_ramp = |press: &Value, pulse_s: f64| {
        let (stop_s, stop_mm) = (number(&press["stop_s"]), number(&press["stop_mm"]));
        assert!((number(&press["time_s"]) - stop_s - 0.2).abs() < 1e-9, "{press}");
        let ramp_s = 2.0 * pulse_s;
        assert!((stop_s - (2.0 * ramp_s - 0.2)).abs() < 0.0011, "{press}");
        let gone_mm = number(&press["from_mm"]) - number(&press["to_mm"]);
        assert!((gone_mm - 50.0 * ramp_s).abs() < 1e-3 && stop_mm < gone_mm, "{press}");
    };
    let half_edge_s = PI * 5000.0 / (4.0 * 400_000.0);
    released_in_the_ramp(fourth, half_edge_s + half_edge_s.hypot((50.0 / 5000.0_f64).sqrt()));
    workspace.put("sin2.toml", &bounded.replace("law = \"plateau\"", "law = \"sin2\""));
    let arch = workspace.json(&["jog", "X-@400", "--machine", "sin2.toml", "--feed", "3000", "--json"]);
    released_in_the_ramp(&arch[0], (2.0 * 50.0 / 5000.0_f64).sqrt());
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
        (
            &["jog", "X+1", "--feed", "301mm/s"],
            "X+1: found a feed of 301 mm/s, expected above 0, at most 300",
        ),
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
