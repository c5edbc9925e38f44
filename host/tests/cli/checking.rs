//! `check`: all refusals at once, or what a program needs and where its time goes. And the path mode that is assumed.

use serde_json::{Value, json};

use super::workspace::{Workspace, number};

#[test]
fn all_refusals_are_listed_at_once() {
    let workspace = Workspace::new("check-refused");
    let text = "G21 G90 F600\nG1 X1 A5\nX2 A6 B1\nG33 Z-1 K1\nM199\nG1 X3 A7\nM2\n";
    workspace.put("part.ngc", text);
    let (table, error) = workspace.ending(2, &["check", "part.ngc"]);
    assert_eq!(error, "motion: part.ngc: found 4 refusals in 6 lines, expected none\n");
    let rows: Vec<&str> = table.lines().skip(1).collect();
    for (row, (lines, place, found)) in rows.iter().zip([
        ("3", "part.ngc:2:7", "found A5"),
        ("1", "part.ngc:3:7", "found B1"),
        ("1", "part.ngc:4:1", "found G33"),
        ("1", "part.ngc:5:1", "found M199"),
    ]) {
        let words: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(words[..2], [lines, place], "{table}");
        assert!(row.contains(found) && row.contains(", expected "), "{table}");
    }
    assert_eq!(rows.len(), 4, "{table}");
    let (found, _) = workspace.ending(2, &["check", "part.ngc", "--json"]);
    let found: Value = serde_json::from_str(&found).expect("JSON");
    assert_eq!((&found["accepted"], &found["time_s"]), (&json!(false), &Value::Null));
    let refusals = found["refusals"].as_array().expect("a list");
    assert_eq!(refusals.len(), 4);
    let first = ["source", "line", "column", "lines"].map(|key| refusals[0][key].clone());
    assert_eq!(first, [json!("part.ngc"), json!(2), json!(7), json!(3)]);
    // The first of them is what other commands refuse.
    let refusal = workspace.refusal(&["plan", "part.ngc"]);
    assert!(
        refusal.starts_with(&format!("part.ngc:2:7: {}", refusals[0]["problem"].as_str().expect("a text")))
    );
}

/// A subroutine's end that is refused leads back to its caller.
#[test]
fn refusals_behind_a_refused_subroutine_are_listed() {
    let workspace = Workspace::new("check-subroutine");
    std::fs::create_dir(workspace.0.join("sub")).expect("a folder");
    workspace.put("sub/f.ngc", "o<f> sub\nG54\nM73\nG55\nG41.1 D1\nG0 X9\no<f> endsub\n");
    workspace.put("part.ngc", "G17\no<f> call\nG1 A5 F10\nG1 B5\nM199\nM2\n");
    let (table, _) = workspace.ending(2, &["check", "part.ngc", "--subroutines", "sub"]);
    for place in ["sub/f.ngc:7:", "part.ngc:3:4", "part.ngc:4:4", "part.ngc:5:1"] {
        assert!(table.contains(place), "{place} is not in\n{table}");
    }
}

/// What only planning refuses is a refusal, too.
#[test]
fn what_planning_refuses_is_listed() {
    let workspace = Workspace::new("check-planning");
    workspace.put("dense.ngc", "G61 G1 X1 F600\nG1 X1.0000000001\nM2\n");
    let (found, error) = workspace.ending(2, &["check", "dense.ngc", "--json"]);
    let found: Value = serde_json::from_str(&found).expect("JSON");
    assert_eq!((&found["accepted"], &found["refusals"][0]["line"]), (&json!(false), &json!(2)));
    assert_eq!(found["refusals"][0]["column"], Value::Null);
    let problem = found["refusals"][0]["problem"].as_str().expect("a text");
    assert_eq!(workspace.refusal(&["plan", "dense.ngc"]), format!("dense.ngc:2: {problem}"));
    assert_eq!(error, "motion: dense.ngc: found 1 refusal, expected none\n");
    workspace.put("still.ngc", "M2\n");
    assert_eq!(workspace.json(&["check", "still.ngc", "--json"])["advice"], json!([]));
}

#[test]
fn what_an_accepted_program_needs_is_told() {
    let workspace = Workspace::new("check-accepted");
    let zigzag: String = (1..30).map(|line| format!("G1 X{line} Y0.{}\n", line % 2)).collect();
    let text = format!("G61 G55 F6000\nT3 M6\nM3 S8000\nG0 Z2\nG4 P0.5\n{zigzag}M5\nM2\n");
    workspace.put("part.ngc", &text);
    let found = workspace.json(&["check", "part.ngc", "--json"]);
    assert_eq!((&found["accepted"], &found["refusals"]), (&json!(true), &json!([])));
    assert_eq!((&found["corner_stops"], &found["operator_stops"]), (&json!(28), &json!(1)));
    assert_eq!(found["needs"]["tools"], json!([3]));
    assert_eq!(found["needs"]["systems"], json!(["G55"]));
    assert_eq!(found["extent_mm"], json!([[0.0, 29.0], [0.0, 0.1], [0.0, 2.0]]));
    let by_reason = found["time_by_reason"].as_object().expect("times");
    let total_s: f64 = by_reason.values().map(number).sum();
    assert!((total_s - number(&found["time_s"])).abs() < 1e-9, "{found}");
    assert_eq!(number(&by_reason["dwell"]), 0.5);
    let planned = workspace.json(&["plan", "part.ngc", "--json"]);
    assert_eq!(found["time_s"], planned["time_s"]);
    // The time that is promised is the one that the changed program takes.
    let advice = found["advice"][0].as_str().expect("a sentence");
    workspace.put("blended.ngc", &text.replace("G61", "G64 P0.01"));
    let blended_s = number(&workspace.json(&["plan", "blended.ngc", "--json"])["time_s"]);
    let expected =
        format!("28 full stops at corners: with G64 P0.01 it would take {blended_s:.1} s instead of ");
    assert!(advice.starts_with(&expected), "{advice}, expected {expected}");
    let table = workspace.stdout(&["check", "part.ngc"]);
    for words in [
        "part.ngc is accepted: ",
        ", 28 full stops at corners, 1 stop for the operator\n",
        "coordinate systems: G55",
        "tools: T3",
        "spindle (M3, M4)",
        "stopping at corners, and on blends",
        advice,
    ] {
        assert!(table.contains(words), "{words} is not in\n{table}");
    }
}

/// A program that says neither G61 nor G64 is driven as the machine file says, and that is told.
#[test]
fn the_assumed_path_mode_is_the_machines() {
    let workspace = Workspace::new("path-mode");
    // Gentle corners, where blends save time.
    let moves: String = (1..9).map(|line| format!("G1 X{} Y0.{} F3000\n", 10 * line, line % 2)).collect();
    workspace.put("plain.ngc", &moves);
    workspace.put("exact.ngc", &format!("G61 {moves}"));
    workspace.put("blend.ngc", &format!("G64 {moves}"));
    let machine = workspace.stdout(&["machine"]);
    assert!(machine.contains("\nmode = \"blend\"\n"));
    workspace.put("exact.toml", &machine.replace("mode = \"blend\"", "mode = \"exact\""));
    workspace.put("silent.toml", &machine.replace("mode = \"blend\"\n", ""));
    workspace.put("coarse.toml", &machine.replace("blend_tolerance_mm = 0.01", "blend_tolerance_mm = 0.1"));
    let plan = |program: &str, machine: &str| {
        let plan = workspace.json(&["plan", program, "--machine", machine, "--json"]);
        (number(&plan["time_s"]), plan["notices"].to_string())
    };
    let (blended_s, note) = plan("plain.ngc", "silent.toml");
    assert_eq!(blended_s, plan("blend.ngc", "silent.toml").0);
    assert!(note.contains("line 1: G64 P0.01 is assumed until G61 or G64"), "{note}");
    let (exact_s, note) = plan("plain.ngc", "exact.toml");
    assert_eq!(exact_s, plan("exact.ngc", "silent.toml").0);
    assert!(note.contains("line 1: exact path (G61) is assumed"), "{note}");
    assert!(blended_s < exact_s);
    let (coarse_s, note) = plan("plain.ngc", "coarse.toml");
    assert!(coarse_s < blended_s && note.contains("G64 P0.1 is assumed"), "{note}");
    for program in ["exact.ngc", "blend.ngc"] {
        assert!(!plan(program, "exact.toml").1.contains("assumed"));
    }
    // Only moves in that mode count.
    workspace.put("late.ngc", "G4 P0.1\nG61\nG1 X5 F600\nM2\n");
    assert!(!plan("late.ngc", "silent.toml").1.contains("assumed"));
    let steps = workspace.stdout(&["read", "plain.ngc", "--json"]);
    assert!(steps.lines().next().expect("a step").contains("\"path\":\"machine\""), "{steps}");
}
