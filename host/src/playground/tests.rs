use serde_json::{Value, json};

use super::*;
use crate::gcode;
use crate::machine::{Machine, REFERENCE_TOML};
use crate::planning::{Mode, plan_program};
use crate::report::reading::Read;
use crate::simulate;

fn answered(request: &Value) -> (Value, Vec<u8>) {
    let mut task = Task::new(request.to_string().as_bytes());
    while task.advance() {
        assert!(task.answer().is_empty());
        assert!((0.0..=1.0).contains(&task.progress().part));
    }
    let (length, rest) = task.answer().split_first_chunk().expect("a length");
    let (header, data) = rest.split_at(u32::from_le_bytes(*length) as usize);
    (serde_json::from_slice(header).expect("JSON"), data.to_vec())
}

fn run_of(program: &str, edits: &Value) -> Value {
    json!({
        "do": "run", "name": "part.ngc", "program": program, "machine_name": "m.toml",
        "machine": REFERENCE_TOML, "edits": edits,
    })
}

const PROGRAM: &str = "G21 G90 F3000\nG1 X40\nG4 P0.1\nG64 P0.05\nG1 Y30 Z2\nG3 X20 Y50 I-20\nG1 X0 Y0\nM2\n";

/// Its bits are those of a run that is made at once.
#[test]
fn a_run_in_steps_is_the_run() {
    let (header, data) = answered(&run_of(PROGRAM, &json!([])));
    let machine = Machine::reference();
    let program = gcode::read("part.ngc", PROGRAM.as_bytes()).expect("G-code");
    let plan = plan_program("part.ngc", &program, &machine, Mode::Spanning).expect("a plan");
    let mut digest = digest::Digest::new();
    digest.number(plan.time_s);
    digest.number(plan.length_mm);
    let mut ticks = Vec::new();
    let summary = simulate::run(&plan, &machine, &mut |row| {
        digest.row(row);
        ticks.push(*row);
    });
    let summary = summary.expect("a run");
    assert_eq!(header["digest"], digest.words());
    let job = simulate::Job::new(&simulate::RunOptions::default(), &plan, &machine).expect("a job");
    let (headline, page) = crate::report::page_parts(&job.trace(&summary, ticks)).expect("memory");
    assert_eq!(header["headline"], headline);
    assert_eq!(data, page.data());
    assert_eq!(header["machine"], REFERENCE_TOML);
    assert_eq!(header["axes"], json!(["X", "Y", "Z"]));
}

#[test]
fn a_slider_changes_the_machine() {
    let (reference, _) = answered(&run_of(PROGRAM, &json!([])));
    let edit = json!([{"table": "path", "key": "accel_mm_s2", "value": 200.0}]);
    let (slower, _) = answered(&run_of(PROGRAM, &edit));
    assert_ne!(reference["digest"], slower["digest"]);
    let machine = slower["machine"].as_str().expect("text");
    assert!(
        (Machine::from_toml("m.toml", machine).expect("a machine").path.accel_mm_s2 - 200.0).abs() < 1e-12
    );
    let of = |answer: &Value| {
        let sliders = answer["sliders"].as_array().expect("a list").clone();
        let found =
            sliders.into_iter().find(|slider| slider["table"] == "path" && slider["key"] == "accel_mm_s2");
        found.expect("a slider")["values"].clone()
    };
    assert_eq!((of(&reference), of(&slower)), (json!([500.0]), json!([200.0])));
}

#[test]
fn refusals_name_file_line_and_what_was_found() {
    let error = |request: &Value| answered(request).0["error"].as_str().expect("an error").to_owned();
    let of_program = error(&run_of("G1 X1 F100\nG1 XA\n", &json!([])));
    assert!(of_program.starts_with("part.ngc:2:4: found "), "{of_program}");
    let too_fast = error(&run_of(PROGRAM, &json!([{"table": "path", "key": "accel_mm_s2", "value": -1.0}])));
    assert!(too_fast.starts_with("m.toml:") && too_fast.contains("expected a number from"), "{too_fast}");
    let no_table = error(&run_of(PROGRAM, &json!([{"table": "paths", "key": "x", "value": 1.0}])));
    assert_eq!(no_table, "m.toml:1:1: found no table [paths], expected it for x");
    let far = error(&run_of("G21 G90 F1\nG1 X10000 F1\nG1 X0\nM2\n", &json!([])));
    assert!(far.starts_with("part.ngc: found 1200") && far.contains("no memory for more ticks"), "{far}");
    // An hour of motion is too long, also where it is not absurd.
    let hour = error(&run_of("G21 G90\nG1 X6000 F100\nM2\n", &json!([])));
    assert!(hour.starts_with("part.ngc: found 3600 s of motion, expected 19"), "{hour}");
    // The sliders' machine comes with a program that is refused.
    let edit = json!([{"table": "path", "key": "jerk_mm_s3", "value": 9000.0}]);
    for text in ["G1 Q\n", "G21 G90\nG1 X6000 F100\nM2\n"] {
        let (refused, _) = answered(&run_of(text, &edit));
        let machine = refused["machine"].as_str().expect("a file");
        assert!(refused["error"].is_string() && machine.contains("jerk_mm_s3 = 9000"), "{machine}");
        assert_eq!(refused["axes"], json!(["X", "Y", "Z"]));
        assert!(refused["sliders"].as_array().is_some_and(|sliders| sliders.len() > 10));
    }
    let unknown = error(&json!({"do": "sing"}));
    assert!(unknown.starts_with("request: found unknown variant"), "{unknown}");
}

#[test]
fn experiments_need_x_y_and_z() {
    let request = |machine: &str, axis: usize| json!({"do": "drive", "experiment": "step", "axis": axis, "machine_name": "m.toml", "machine": machine});
    let (header, data) = answered(&request(REFERENCE_TOML, 2));
    assert_eq!((&header["is_good"], data.len()), (&json!(true), 0));
    assert_eq!(header["tables"][0]["title"], "Step of Z to 7200 mm/min, open loop");
    let error = |request| answered(&request).0["error"].as_str().expect("an error").to_owned();
    assert_eq!(error(request(REFERENCE_TOML, 3)), "found axis 3, expected one from 0 to 2");
    let turned = REFERENCE_TOML.replacen("name = \"Z\"", "name = \"A\"\nletter = \"A\"", 1);
    assert_eq!(
        error(request(&turned, 0)),
        "found m.toml with the axes X, Y, A, expected X, Y and Z, in this order, for experiments"
    );
}

#[test]
fn a_ramp_is_that_of_the_paper() {
    let request = |law: &str, from: f64| {
        json!({
            "do": "ramp", "law": law, "from_mm_s": from, "to_mm_s": 200.0,
            "accel_mm_s2": 500.0, "jerk_mm_s3": 5000.0, "snap_mm_s4": 400_000.0,
        })
    };
    let (header, data) = answered(&request("sin2", 0.0));
    let near = |value: &Value, expected: f64| (value.as_f64().expect("a number") - expected).abs() < 1e-9;
    assert!(near(&header["figures"]["tp_s"], 0.6) && near(&header["figures"]["length_mm"], 60.0));
    let course = Read::of_data(&data);
    let (feed, step) = course.column("feed");
    assert!((feed[1000] - 200.0).abs() <= step && (feed[500] - 100.0).abs() <= step, "{feed:?}");
    assert!(near(&course.header["tick_s"], 6e-4));
    // Equal feeds take no time, and show nothing.
    let (header, data) = answered(&request("sin2", 200.0));
    assert!(near(&header["figures"]["tp_s"], 0.0));
    assert_eq!(Read::of_data(&data).header["ticks"], 0);
    let error = |request| answered(&request).0["error"].as_str().expect("an error").to_owned();
    assert_eq!(error(request("line", 0.0)), "found law line, expected \"sin2\" or \"plateau\"");
    assert_eq!(error(request("sin2", -1.0)), "found from = -1, expected a number not below 0");
}
