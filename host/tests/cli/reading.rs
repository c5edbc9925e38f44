//! `read`: the steps of a program, as JSON lines and as a table.

use serde_json::{Value, json};

use super::workspace::Workspace;

const PROGRAM: &str = "\
G20 G64 P0.1 S9
G0 X1 F10
G61 G2 X3 I1
G4 P0.5
G21 G18 G1 Z-5 F600
M0
G17 G5 X80 I1 J2 P3 Q4
G5.5 Y9
M2
";

fn lines(printed: &str) -> Vec<Value> {
    printed.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn every_step_has_an_object() {
    let workspace = Workspace::new("read");
    workspace.put("part.ngc", PROGRAM);
    let steps = lines(&workspace.stdout(&["read", "part.ngc", "--json"]));
    let kinds: Vec<_> = steps.iter().map(|step| (step["line"].clone(), step["kind"].clone())).collect();
    let expected = [
        (2, "line"),
        (3, "arc"),
        (4, "dwell"),
        (5, "line"),
        (6, "stop"),
        (7, "cubic"),
        (8, "through"),
        (9, "end"),
        (5, "notice"),
    ];
    assert_eq!(kinds, expected.map(|(line, kind)| (json!(line), json!(kind))));
    assert_eq!(
        steps[0],
        json!({
            "line": 2, "kind": "line", "from_mm": [0.0, 0.0, 0.0], "to_mm": [25.4, 0.0, 0.0], "feed_mm_min": null,
            "path": "blend", "tolerance_mm": 2.54, "merging_mm": null,
        })
    );
    assert_eq!(
        steps[1],
        json!({
            "line": 3, "kind": "arc", "from_mm": [25.4, 0.0, 0.0], "to_mm": [76.2, 0.0, 0.0], "feed_mm_min": 254.0,
            "path": "exact", "tolerance_mm": null, "merging_mm": null,
            "plane": "XY", "turn_deg": 0.0, "centre_mm": [50.8, 0.0], "sweep_rad": -std::f64::consts::PI,
        })
    );
    assert_eq!(steps[2]["dwell_s"], json!(0.5));
    assert_eq!((&steps[3]["to_mm"], &steps[3]["feed_mm_min"]), (&json!([76.2, 0.0, -5.0]), &json!(600.0)));
    assert_eq!(steps[5]["controls_mm"], json!([[1.0, 2.0], [3.0, 4.0]]));
    assert_eq!(steps[6]["begins"], json!(true));
    // Nothing turns, so S alone is no step; what a machine makes of it is not the reader's to say.
    assert!(steps[8]["text"].as_str().expect("a text").contains("F in a line that switches the units"));
}

#[test]
fn a_table_is_for_people() {
    let workspace = Workspace::new("read-table");
    workspace.put("part.ngc", PROGRAM);
    let table = workspace.stdout(&["read", "part.ngc"]);
    let row = |line: &str| {
        let found = table.lines().find(|row| row.split_whitespace().next() == Some(line)).expect("a row");
        found.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(row("2"), "2 rapid 25.4000 0.0000 0.0000 – G64 P2.54");
    assert_eq!(row("3"), "3 arc 76.2000 0.0000 0.0000 254.0 G61 XY, centre 50.8000 0.0000, -180.0000°");
    assert_eq!(row("4"), "4 dwell 0.5 s");
    assert!(table.contains("8 steps") && table.contains("note: line 5: F in a line"), "{table}");
}

#[test]
fn a_nurbs_has_its_curve() {
    let workspace = Workspace::new("read-nurbs");
    workspace.put("part.ngc", "G0 X1\nF600\nG5.2 P.5\nX2 Y2 P2\nX3 Y0 P1\nG5.3\nM2\n");
    let steps = lines(&workspace.stdout(&["read", "part.ngc", "--json"]));
    assert_eq!(
        steps[1],
        json!({
            "line": 6, "kind": "nurbs", "from_mm": [1.0, 0.0, 0.0], "to_mm": [3.0, 0.0, 0.0], "feed_mm_min": 600.0,
            "path": "machine", "tolerance_mm": null, "merging_mm": null,
            "degree": 2, "points_mm": [[1.0, 0.0, 0.0], [2.0, 2.0, 0.0], [3.0, 0.0, 0.0]],
            "weights": [0.5, 2.0, 1.0], "knots": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        })
    );
    let table = workspace.stdout(&["read", "part.ngc"]);
    assert!(table.contains("degree 2, 3 control points"), "{table}");
    assert!(
        workspace
            .stdout(&["read", "--help"])
            .contains("degree, points_mm (control points, X Y Z), weights, knots")
    );
}

#[test]
fn what_is_no_program_is_refused() {
    let workspace = Workspace::new("read-refused");
    workspace.put("part.ngc", "G0 X1\nG1 X2\n");
    assert!(workspace.refusal(&["read", "part.ngc"]).starts_with("part.ngc:2:1: found G1 without a feed"));
    assert!(workspace.refusal(&["read", "part.ngc", "--json"]).starts_with("part.ngc:2:1: "));
    assert!(workspace.refusal(&["read", "none.ngc"]).starts_with("none.ngc: found "));
}

#[test]
fn subroutines_lie_in_files_of_their_own() {
    let workspace = Workspace::new("read-subroutines");
    workspace.put("part.ngc", "o<pocket> call [5]\no<other> call\nM2\n");
    workspace.put("pocket.ngc", "o<pocket> sub\nG0 X#1\no<pocket> endsub\n");
    std::fs::create_dir(workspace.0.join("more")).expect("a folder");
    workspace.put("more/other.ngc", "o<other> sub\nG0 Y1\nG1 Y2\no<other> endsub\n");
    assert!(
        workspace.refusal(&["read", "part.ngc"]).starts_with("part.ngc:2:1: found a call of Oother"),
        "the folder is not given"
    );
    let refusal = workspace.refusal(&["read", "part.ngc", "--subroutines", "more"]);
    assert!(refusal.starts_with("more/other.ngc:3:1: found G1 without a feed"), "{refusal}");
    workspace.put("more/other.ngc", "o<other> sub\nG0 Y1 (MSG, over)\no<other> endsub\n");
    let steps = lines(&workspace.stdout(&["read", "part.ngc", "--json", "--subroutines", "more"]));
    // The lines are those of the program.
    assert_eq!((&steps[0]["line"], &steps[0]["to_mm"]), (&json!(1), &json!([5.0, 0.0, 0.0])));
    assert_eq!((&steps[1]["line"], &steps[1]["to_mm"]), (&json!(2), &json!([5.0, 1.0, 0.0])));
    let message = json!({"line": 2, "kind": "message", "within": "more/other.ngc:2", "text": "over"});
    assert!(steps.contains(&message), "{steps:?}");
    let table = workspace.stdout(&["read", "part.ngc", "--subroutines", "more"]);
    assert!(table.contains("note: line 2, more/other.ngc:2: message: over"), "{table}");
    let refusal = workspace.refusal(&["read", "part.ngc", "--subroutines", "mroe"]);
    assert!(
        refusal.starts_with("mroe: found ")
            && refusal.trim_end().ends_with("expected a folder that can be used"),
        "{refusal}"
    );
    workspace.put("pocket.ngc", "G0 X1\n");
    let refusal = workspace.refusal(&["read", "part.ngc", "--subroutines", "more"]);
    assert!(refusal.starts_with("part.ngc:1:1: found no Opocket in pocket.ngc"), "{refusal}");
}

/// The machine file names the subroutine that changes tools, and the radius of tools without a table.
#[test]
fn a_machine_changes_tools_its_own_way() {
    let workspace = Workspace::new("read-change");
    let file = workspace.stdout(&["machine"]);
    let own = file.replace("#[tool]", "[tool]").replace("#change_subroutine", "change_subroutine");
    workspace.put("own.toml", &own.replace("#radius_mm = 3", "radius_mm = 3"));
    workspace.put("part.ngc", "T4 M6\nF60 G41 G1 X10\nM2\n");
    std::fs::create_dir(workspace.0.join("subs")).expect("a folder");
    workspace.put("subs/change.ngc", "o<change> sub\nG53 G0 Z50\nM6\no<change> endsub\n");
    let read = ["read", "part.ngc", "--machine", "own.toml", "--json", "--subroutines", "subs"];
    let steps = lines(&workspace.stdout(&read));
    assert_eq!((&steps[0]["to_mm"], &steps[1]["tool"]), (&json!([0.0, 0.0, 50.0]), &json!(4)));
    assert_eq!(steps[2]["to_mm"], json!([10.0, 3.0, 50.0]));
    let refusal = workspace.refusal(&["read", "part.ngc"]);
    assert!(refusal.starts_with("part.ngc:2:5: found tool 4, whose radius is not known"), "{refusal}");
    let refusal = workspace.refusal(&["plan", "part.ngc", "--machine", "own.toml"]);
    assert!(refusal.starts_with("part.ngc:1:1: found a call of Ochange"), "{refusal}");
    workspace.stdout(&["run", "part.ngc", "--machine", "own.toml", "--subroutines", "subs"]);
}

#[test]
fn parameters_are_kept_after_a_whole_run_only() {
    let workspace = Workspace::new("run-parameters");
    let before = "5220\t1\n5221\t4\n";
    workspace.put("machine.var", before);
    workspace.put("part.ngc", "G10 L2 P1 X7\nG0 X1\nM0\nX0\nM2\n");
    let run = ["run", "part.ngc", "--parameters", "machine.var"];
    let kept = || workspace.read("machine.var");
    workspace.stdout(&["plan", "part.ngc", "--parameters", "machine.var"]);
    assert_eq!(kept(), before, "plan keeps nothing");
    workspace.stdout(&run);
    assert!(kept().contains("\n5221\t7.0\n"), "{}", kept());
    assert_eq!(kept().lines().filter(|line| line.starts_with("5220\t")).collect::<Vec<_>>(), ["5220\t1.0"]);
    workspace.put("machine.var", "5221\tx\n");
    assert!(workspace.refusal(&run).starts_with("machine.var:1:1: found x, expected"));
    workspace.put("tool.tbl", "T1 Z5\n");
    workspace.put("tools.ngc", "T1 M6 G43\nG0 Z1\nM2\n");
    let steps = lines(&workspace.stdout(&["read", "tools.ngc", "--json", "--tools", "tool.tbl"]));
    assert_eq!((&steps[0]["tool"], &steps[1]["to_mm"]), (&json!(1), &json!([0.0, 0.0, 6.0])));
}
