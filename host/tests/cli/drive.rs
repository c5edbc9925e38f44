//! `drive`: experiments and tuning.

use motion_host::machine::Machine;
use serde_json::Value;

use super::workspace::{Workspace, assert_has, assert_points, number, points};

#[test]
fn drive_compares_regulators() {
    let workspace = Workspace::new("compare");
    let arguments = ["drive", "compare", "--from", "5", "--to", "5", "--resolutions-um", "1"];
    let text = workspace.stdout(&[&arguments[..], &["--report", "compare.html"]].concat());
    assert!(text.contains("stringer.ngc") && text.contains("P + inverse with preview"), "{text}");
    let figures = workspace.figures("compare.html");
    let json = workspace.json(&[&arguments[..], &["--json"]].concat());
    assert_has(&json["fitted"][2], &["axis", "ff1", "ff2_s", "ff3_s2"]);
    let rows = json["regulators"].as_array().expect("a list");
    assert_eq!((rows.len(), rows[1]["set_resolution_um"].as_f64()), (16, Some(1.0)));
    let keys = ["following_error_um", "contour_error_um", "output_noise_mv", "current_noise_percent"];
    assert_has(&rows[1]["motions"][2], &keys);
    assert_has(&json["sweeps"][6]["circles"][0], &keys);
    for (graph, key) in ["contour_error_um", "following_error_um"].into_iter().enumerate() {
        for sweep in json["sweeps"].as_array().expect("a list") {
            let drawn = points(&figures[0], graph, sweep["name"].as_str().expect("a name"));
            assert_points(&drawn, [(5.0, number(&sweep["circles"][0][key]))].into_iter());
        }
    }
    for wrong in ["0", "-1", "nan", "1001"] {
        let refusal = workspace.refusal(&["drive", "compare", &format!("--resolutions-um={wrong}")]);
        assert!(refusal.contains("found set-point resolutions [") && refusal.contains("expected 1 to 10"));
    }
}

#[test]
fn drive_finds_a_screw() {
    let workspace = Workspace::new("screw");
    let words = said(
        &workspace,
        &["drive", "screw", "--axis", "Y", "--from-mm", "0", "--to-mm", "40", "--program", "y.ngc"],
    );
    assert!(words.contains("program written to y.ngc"), "{words}");
    let program = workspace.read("y.ngc");
    assert_eq!(program.lines().filter(|line| line.starts_with("G53 G1 Y")).count(), 1 + 2 * (2 * 64 + 2));
    // It is a program that the machine can run.
    said(&workspace, &["check", "y.ngc"]);

    // The machine file's axis has no errors: there is nothing to write.
    let nothing =
        ["drive", "screw", "--from-mm", "0", "--to-mm", "20", "--places", "20", "--output", "n.toml"];
    let words = said(&workspace, &nothing);
    assert!(
        words.contains("no machine file is written: there is nothing that could be compensated"),
        "{words}"
    );
    assert!(!workspace.0.join("n.toml").exists());

    // 30 µm of play, and an error of ±8 µm a turn, as an instrument shows them.
    let mut rows = String::from("commanded_mm,measured_mm\n# by hand\n");
    for round in 0..2 {
        let places = || (0..40).map(|place| 2.0 * f64::from(place) + 0.31 * f64::from(place % 7));
        let mut put = |mm: f64, play_mm: f64| {
            let noise_mm = 2e-4 * (97.0 * mm + f64::from(round)).sin();
            let error_mm = 0.008 * (core::f64::consts::TAU * mm / 5.0).sin() + play_mm + noise_mm;
            rows += &format!("{mm},{:.4}\n", mm + error_mm);
        };
        put(-2.0, if round == 0 { 0.0 } else { 0.03 });
        places().for_each(|mm| put(mm, 0.0));
        put(82.0, 0.0);
        places().rev().for_each(|mm| put(mm, 0.03));
    }
    workspace.put("x.csv", &rows);
    let typed = rows.replacen("\n82,82.", "\n82,82.4", 1);
    workspace.put("typed.csv", &typed);
    let words = said(&workspace, &["drive", "screw", "--from", "typed.csv", "--pitch-mm", "5"]);
    assert!(words.contains("note: the reading at 82.") && words.contains("is its row right?"), "{words}");
    let from = ["drive", "screw", "--from", "x.csv", "--pitch-mm", "5"];
    let written = [&from[..], &["--output", "m.toml", "--report", "x.html", "--json"]].concat();
    let json = workspace.json(&written);
    let keys =
        ["axis", "source", "readings", "backlash_mm", "take_up_s", "pitch_error", "before_um", "left_rms_um"];
    assert_has(&json, &[&keys[..], &["left_most_um", "outlier", "output", "reason"]].concat());
    assert!((number(&json["backlash_mm"]["value"]) - 0.03).abs() < 2e-4, "{json}");
    let error = &json["pitch_error"];
    assert_eq!((&error["repeats"], &json["reason"]), (&Value::Bool(true), &Value::Null));
    assert!(number(&json["left_rms_um"]) < 0.3 && number(&json["before_um"]) > 20.0, "{json}");
    let machine = Machine::from_toml("m.toml", &workspace.read("m.toml")).expect("a machine");
    let compensation = machine.axes[0].compensation.expect("compensation");
    assert_eq!(
        compensation.backlash.map(|it| it.play_mm),
        Some(number(&json["backlash_mm"]["value"])).map(|mm| (mm * 1e5).round() / 1e5)
    );
    assert!(compensation.pitch_error.is_some_and(|table| table.repeats));
    // The page draws what was read.
    let figures = workspace.figures("x.html");
    let drawn = points(&figures[0], 0, "after motion in negative direction");
    assert_eq!(
        drawn.len() + points(&figures[0], 0, "after motion in positive direction").len(),
        number(&json["readings"]) as usize
    );

    // More than the axis can follow: told, drawn in red, not written.
    workspace.put(
        "steep.toml",
        &workspace.stdout(&["machine"]).replace("accel_limit_mm_s2 = 12300.0", "accel_limit_mm_s2 = 501.0"),
    );
    let steep = [&from[..], &["--machine", "steep.toml", "--output", "steep.toml", "--report", "steep.html"]]
        .concat();
    let before = workspace.read("steep.toml");
    let (words, _) = workspace.ending(1, &steep);
    assert!(words.contains("no machine file is written: what was found can't be compensated"), "{words}");
    assert!(
        workspace.read("steep.html").contains("class=\"result faulted\"")
            && workspace.read("steep.toml") == before
    );
    // Measured again, and found straight: what the file had goes.
    let straight =
        ["drive", "screw", "--machine", "m.toml", "--output", "m.toml", "--from-mm", "0", "--to-mm", "20"];
    let words = said(&workspace, &[&straight[..], &["--places", "20"]].concat());
    assert!(
        words.contains("simulated machine") && words.contains("machine file written to m.toml"),
        "{words}"
    );
    let machine = Machine::from_toml("m.toml", &workspace.read("m.toml")).expect("a machine");
    assert_eq!(machine.axes[0].compensation, None);

    // A hurried user.
    workspace.put("twice.csv", &rows.replacen("\n82,", "\n79.24,", 1));
    let refusal = workspace.refusal(&["drive", "screw", "--from", "twice.csv"]);
    assert!(refusal.contains("mm, as in the row before, expected a row for each rest"), "{refusal}");
    let refusal = workspace.refusal(&["drive", "screw"]);
    assert!(
        refusal.contains("found axis X without travel in the machine file, expected --from-mm and --to-mm"),
        "{refusal}"
    );
    let refusal = workspace.refusal(&[&from[..4], &["--pitch-mm", "0"]].concat());
    assert!(refusal.contains("found --pitch-mm 0, expected the travel of a turn"), "{refusal}");
    workspace.put("wrong.csv", &rows.replace("\n0,", "\n0;"));
    let refusal = workspace.refusal(&["drive", "screw", "--from", "wrong.csv"]);
    assert!(refusal.contains("wrong.csv:4: found '0;"), "{refusal}");
    let refusal = workspace.refusal(&["drive", "screw", "--from", "x.csv", "--output", "x.csv"]);
    assert!(refusal.contains("x.csv"), "{refusal}");
    assert_eq!(workspace.read("x.csv"), rows);
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
        assert!(page.contains("class=\"result done\""), "{report}");
    }
    // What is drawn is what is told.
    let drawn = &workspace.figures("circle.html")[0];
    for sweep in circle["feedforward"].as_array().expect("a list") {
        let name = sweep["name"].as_str().expect("a name");
        let over = |key: &str| -> Vec<(f64, f64)> {
            let circles = sweep["circles"].as_array().expect("a list").iter();
            circles.map(|circle| (number(&circle["frequency_hz"]), number(&circle[key]))).collect()
        };
        let contour = [("greatest", "contour_error_um_max"), ("least", "contour_error_um_min")];
        for (end, key) in contour {
            assert_points(&points(drawn, 0, &format!("{name}, {end}")), over(key).into_iter());
        }
        assert_points(&points(drawn, 1, name), over("form_deviation_um").into_iter());
        assert_points(&points(drawn, 2, name), over("following_error_x_um").into_iter());
    }
    let drawn = &workspace.figures("bode.html")[0];
    assert_eq!(drawn["is_logarithmic"], true);
    let of = |value: &dyn Fn(&Value) -> f64| -> Vec<(f64, f64)> {
        let points = bode["points"].as_array().expect("a list").iter();
        points.map(|point| (number(&point["frequency_hz"]), value(point))).collect()
    };
    for (name, ratio, phase) in [
        ("spectrum of the step", "step_ratio", "step_phase_deg"),
        ("harmonics, fundamental", "fundamental_ratio", "harmonic_phase_deg"),
        ("linear model", "linear_ratio", "linear_phase_deg"),
    ] {
        let db = of(&|point| 20.0 * number(&point[ratio]).log10());
        let near = |(a, b): ((f64, f64), (f64, f64))| (a.1 - b.1).abs() < 1e-9;
        assert!(points(drawn, 0, name).into_iter().zip(db).all(near), "{name}");
        assert_points(&points(drawn, 1, name), of(&|point| number(&point[phase])).into_iter());
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
    let tune = ["drive", "tune", "--axis", "x,Y", "--output", "tuned.toml", "--report", "t.html", "--json"];
    let json = workspace.json(&tune);
    assert_tuning_is_drawn(&workspace, &json);
    assert_has(&json, &["axes", "learning", "output", "reason", "verification"]);
    assert!(json["learning"].is_null() && json["reason"].is_null());
    assert!(json["verification"]["not_driven"].as_array().expect("a list").is_empty(), "{json}");
    assert_eq!(json["output"], "tuned.toml");
    let axes = json["axes"].as_array().expect("a list");
    assert_eq!(axes.len(), 2);
    for axis in axes {
        assert_has(axis, &["changes", "found", "margins", "name", "remarks"]);
        let margins = &axis["margins"];
        assert_has(margins, &["crossover_hz", "gain", "half_widths_95", "phase_deg", "sensitivity"]);
        for key in ["phase_deg", "gain"] {
            let part = number(&margins["half_widths_95"][key]) / number(&margins[key]);
            assert!((1e-6..0.02).contains(&part), "{key}: {margins}");
        }
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
    assert!(learning["reason"].is_null(), "{learning}");
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
    assert!(contours.len() == 3 && contours[0] > 8.0 && contours[2] < 1.0, "{contours:?}");

    let worse = ["drive", "tune", "--machine", "tuned.toml", "--method", "series", "--output", "worse.toml"];
    let worse = [&worse[..], &["--report", "worse.html"]].concat();
    let output = workspace.motion(&worse);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("no machine file is written: the circle at "), "{said}");
    // All axes were tuned, and all of them moved.
    assert!(
        said.contains("Circles of X and Y, before") && said.contains("Circles of Z and X, before"),
        "{said}"
    );
    assert!(!workspace.0.join("worse.toml").exists());
    let page = workspace.read("worse.html");
    let red = "class=\"result faulted\"><strong>Not better:</strong> the circle at ";
    assert!(page.contains(red) && page.contains("<td class=\"word long\">worse</td>"), "{page}");
    assert!(page.contains("No machine file is written."), "{page}");

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

/// The page shows what was found, proposed and verified.
fn assert_tuning_is_drawn(workspace: &Workspace, json: &Value) {
    let page = workspace.read("t.html");
    assert!(page.contains("class=\"result done\"><strong>Tuned:</strong>"), "{page}");
    assert!(page.contains("The machine file is written to tuned.toml."), "{page}");
    let shown = |words: &str| {
        let escaped = words.replace('\'', "&#39;");
        assert!(page.contains(&escaped), "{words}");
    };
    for axis in json["axes"].as_array().expect("a list") {
        for change in axis["changes"].as_array().expect("a list") {
            shown(change["reason"].as_str().expect("words"));
        }
        for margin in ["phase margin", "gain margin", "delay margin", "crossover"] {
            shown(margin);
        }
    }
    shown("not determined");
    let figures = workspace.figures("t.html");
    let titles: Vec<&str> = figures.iter().map(|figure| figure["title"].as_str().expect("a title")).collect();
    // Of each axis two, and of each circle two.
    let circles = json["verification"]["circles"].as_array().expect("a list");
    assert_eq!(figures.len(), 2 * 2 + 2 * circles.len(), "{titles:?}");
    assert_eq!(titles[..2], ["Drive of X", "Position loop of X, opened"]);
    let [model, measured] = ["model", "measured"].map(|name| points(&figures[0], 0, name));
    assert!(model.len() > 100 && measured.len() > 5);
    for (hz, db) in measured {
        let (_, of_model) =
            model.iter().min_by(|a, b| (a.0 - hz).abs().total_cmp(&(b.0 - hz).abs())).expect("one");
        assert!((db - of_model).abs() < 0.5, "{hz} Hz: {db} dB is measured, {of_model} dB has the model");
    }
    // The position loop has its margins there.
    let crossover_hz = number(&json["axes"][0]["margins"]["crossover_hz"]);
    let amplitude = points(&figures[1], 0, "after");
    let below = amplitude.iter().find(|(_, db)| *db < 0.0).expect("a crossover").0;
    assert!((below / crossover_hz - 1.0).abs() < 0.03, "{below} {crossover_hz}");
    let polars: Vec<&Value> = figures.iter().filter(|figure| figure["kind"] == "polar").collect();
    assert_eq!(polars.len(), circles.len());
    for (polar, circle) in polars.into_iter().zip(circles) {
        assert_eq!(polar["axes"], circle["axes"]);
        for name in ["before", "after"] {
            let most = points(polar, 0, name).into_iter().map(|(_, um)| um.abs()).fold(0.0, f64::max);
            let told = number(&circle[name]["contour_error_um"]);
            // One revolution of those of a second.
            assert!(most <= told + 1e-9 && most > 0.5 * told, "{most} {told} {circle}");
        }
    }
}

/// A recording that tells too little is refused in words, in red, with what it did tell.
#[test]
fn drive_tune_reports_its_refusal() {
    let workspace = Workspace::new("tune-refused");
    workspace.put("gentle.ngc", "G21 G90 F300\nG4 P0.3\nG1 Y2\nG4 P0.3\nG1 Y0\nG4 P0.3\nM2\n");
    workspace.stdout(&["run", "gentle.ngc", "--record", "gentle.mrec"]);
    let tune = ["drive", "tune", "--axis", "Y", "--from", "gentle.mrec", "--output", "t.toml"];
    let (json, error) = workspace.ending(1, &[&tune[..], &["--report", "r.html", "--json"]].concat());
    let json: Value = serde_json::from_str(&json).expect("JSON");
    let reason = json["reason"].as_str().expect("words");
    assert!(reason.contains("tuning of axis Y: found ") && error.contains(reason), "{reason} {error}");
    assert!(json["axes"].as_array().expect("a list").is_empty() && !workspace.0.join("t.toml").exists());
    let page = workspace.read("r.html");
    let red = "class=\"result faulted\"><strong>Not tuned:</strong> tuning of axis Y: found ";
    assert!(page.contains(red) && page.contains("velocity gain Kv"), "{page}");
    assert_eq!(workspace.figures("r.html").len(), 1, "the drive as it was found");
    // Where nothing was found, the page says why; what is no recording leaves the page that was there.
    let still: String = (0..100).map(|tick| format!("{},{},7\n", f64::from(tick) * 5e-4, tick % 2)).collect();
    workspace.put("still.csv", &format!("time_s,command_v,counts\n{still}"));
    let tune = ["drive", "tune", "--axis", "Y", "--report", "r.html", "--from"];
    let (said, _) = workspace.ending(1, &[&tune[..], &["still.csv"]].concat());
    assert!(said.contains("report written to r.html"), "{said}");
    let page = workspace.read("r.html");
    assert!(
        page.contains("<strong>Not tuned:</strong>") && page.contains("the encoder connected?<"),
        "{page}"
    );
    workspace.put("bad.csv", "time_s,command_v,counts\n0,0,0\n0.0005,0,what\n");
    workspace.refusal(&[&tune[..], &["bad.csv"]].concat());
    assert_eq!(workspace.read("r.html"), page);
}

/// Whatever was not done has its reason in the JSON.
#[test]
fn drive_tune_says_why_something_was_not_done() {
    let workspace = Workspace::new("tune-not-done");
    workspace.put("weak.toml", &as_strong(0.2));
    workspace.put("slow.toml", &as_strong(0.1));
    let tune = ["drive", "tune", "--axis", "X", "--json"];
    let parsed = |json: &str| serde_json::from_str::<Value>(json).expect("JSON");
    let learning_keys = ["best_repeat", "ended", "reason", "repeats", "robustness"];

    // Its outputs do not reach the feed at which circles are learnt; what is verified is slower, and written.
    let slow = ["--machine", "slow.toml", "--output", "t.toml", "--learn", "1"];
    let more = ["--learn-output", "learnt.csv", "--report", "t.html"];
    let (json, error) = workspace.ending(1, &[&tune[..], &slow, &more].concat());
    let json = parsed(&json);
    assert!(json["reason"].is_null() && json["output"] == "t.toml" && error.is_empty(), "{json} {error}");
    assert_has(&json["learning"], &learning_keys);
    let why = "no correction is learnt: found a feed of 2150 mm/min, expected at most ";
    let reason = json["learning"]["reason"].as_str().expect("words");
    assert!(reason.starts_with(why), "{reason}");
    assert!(json["learning"]["repeats"].as_array().expect("a list").is_empty(), "{json}");
    assert!(workspace.0.join("t.toml").exists() && !workspace.0.join("learnt.csv").exists());
    assert!(workspace.read("t.html").contains(why));
    let (said, _) =
        workspace.ending(1, &["drive", "tune", "--axis", "X", "--machine", "slow.toml", "--learn", "1"]);
    assert!(said.contains(why), "{said}");

    // Beyond the current limit a correction makes it worse.
    let weak = ["--machine", "weak.toml", "--learn", "1", "--learn-hz", "60"];
    let json = workspace.json(&[&tune[..], &weak].concat());
    assert_eq!(json["reason"], "--output was not given");
    let learning = &json["learning"];
    assert_has(learning, &learning_keys);
    assert_eq!(learning["best_repeat"], 0, "{learning}");
    assert_eq!(learning["reason"], "no correction was better than none; ended: all repeats made");

    if std::path::Path::new("/dev/full").exists() {
        let (json, error) = workspace.ending(6, &[&tune[..], &["--output", "/dev/full"]].concat());
        let json = parsed(&json);
        let reason = json["reason"].as_str().expect("words");
        assert!(reason.starts_with("/dev/full: found ") && error.contains(reason), "{reason} {error}");
        assert!(json["output"].is_null(), "{json}");
    }
}

/// One axis alone is judged by its own error, in a plane that it moves in: beside an untuned one the contour
/// gets worse, because axes that lag alike leave none.
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

/// The reference machine with the drives of all axes made `by` times as strong: what they reach and how hard they push.
/// Nobody plans faster than the drives are.
fn as_strong(by: f64) -> String {
    let mut text = String::new();
    for line in motion_host::machine::REFERENCE_TOML.lines() {
        let value = line.split_once(" = ").and_then(|(key, value)| Some((key, value.parse::<f64>().ok()?)));
        let stronger = match value {
            Some((key @ ("mm_min_at_10_v" | "accel_limit_mm_s2"), value)) => Some((key, value * by)),
            Some((key @ ("feed_mm_s" | "accel_mm_s2"), value)) => Some((key, value * by.min(1.0))),
            _ => None,
        };
        match stronger {
            Some((key, value)) => text.push_str(&format!("{key} = {value:.1}\n")),
            None => text.push_str(&format!("{line}\n")),
        }
    }
    text
}

/// Every experiment runs with its defaults on machines five times weaker and five times stronger than the reference;
/// what they can't do is named.
#[test]
fn drive_runs_on_weak_and_on_strong_machines() {
    for (name, by) in [("weak", 0.2), ("strong", 5.0)] {
        let workspace = Workspace::new(&format!("drive-{name}"));
        workspace.put("m.toml", &as_strong(by));
        for experiment in [
            &["step"][..],
            &["harmonic", "--from", "8", "--to", "16", "--by", "8"],
            &["inertia", "--loads", "0,1"],
            &["circle", "--from", "4", "--to", "8", "--by", "4"],
            &["compare", "--from", "4", "--to", "4"],
            &["bode", "--points", "3"],
            &["identify", "--axis", "Y"],
        ] {
            let json = workspace.json(&[&["drive"], experiment, &["--machine", "m.toml", "--json"]].concat());
            assert!(json.is_object(), "{name} {experiment:?}");
        }
        let arguments =
            ["drive", "tune", "--axis", "X,Y", "--machine", "m.toml", "--output", "t.toml", "--json"];
        let json = workspace.json(&arguments);
        assert!(json["reason"].is_null() && json["output"] == "t.toml", "{name}: {}", json["reason"]);
        let circles = json["verification"]["circles"].as_array().expect("a list");
        assert_eq!(circles.len(), 6, "{name}: {}", json["verification"]);
        let slower = json["verification"]["not_driven"].as_array().expect("a list");
        assert_eq!(slower.is_empty(), by > 1.0, "{name}: {slower:?}");
        let better = |circle: &Value| {
            number(&circle["after"]["contour_error_um"]) < number(&circle["before"]["contour_error_um"])
        };
        assert!(circles.iter().all(better), "{name}: {circles:?}");
    }
}

/// What a command that succeeds prints.
fn said(workspace: &Workspace, arguments: &[&str]) -> String {
    let output = workspace.motion(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A simulated run of the program that `excitation` writes tells the drive; so does CSV, and what neither shows is said.
#[test]
fn drive_identifies_an_axis_from_what_was_recorded() {
    let workspace = Workspace::new("identify");
    let words = said(&workspace, &["drive", "excitation", "--axis", "Y", "--output", "y.ngc"]);
    assert!(words.contains("program written to y.ngc"), "{words}");
    said(&workspace, &["run", "y.ngc", "--record", "y.mrec"]);
    let json = workspace.json(&["drive", "identify", "--axis", "Y", "--from", "y.mrec", "--json"]);
    assert_has(&json, &["axis", "encoder_step_mm", "found", "lacks", "misfit_per_reading"]);
    let found = &json["found"];
    let value = |key: &str| number(&found[key]["value"]);
    assert!((value("velocity_gain_per_s") / 440.0 - 1.0).abs() < 0.02, "{found}");
    assert!((value("integral_time_s") / 0.0275 - 1.0).abs() < 0.02, "{found}");
    assert!((value("coulomb_friction_mm_s2") / 260.0 - 1.0).abs() < 0.02, "{found}");
    assert!((value("total_delay_s") / 0.002_04 - 1.0).abs() < 0.02, "{found}");
    assert!(found["load_inertia_ratio"]["half_width_95"].is_null(), "{found}");
    let lacks = json["lacks"].to_string();
    assert!(lacks.contains("the load inertia"), "{lacks}");

    let tune = ["drive", "tune", "--axis", "Y", "--from", "y.mrec", "--output", "t.toml", "--json"];
    let json = workspace.json(&tune);
    assert_eq!(json["output"], "t.toml", "{}", json["reason"]);
    let refusal = workspace.refusal(&["drive", "tune", "--axis", "X,Y", "--from", "y.mrec"]);
    assert!(refusal.contains("--axis with the one axis that was recorded"), "{refusal}");

    workspace.put("bad.csv", "time_s,command_v,counts\n0,0,0\n0.0005,0,what\n");
    let refusal = workspace.refusal(&["drive", "identify", "--from", "bad.csv"]);
    assert!(refusal.contains("bad.csv:3: found '0.0005,0,what', expected three finite numbers"), "{refusal}");
    let still: String = (0..100).map(|tick| format!("{},{},7\n", f64::from(tick) * 5e-4, tick % 2)).collect();
    workspace.put("still.csv", &format!("time_s,command_v,counts\n{still}"));
    let output = workspace.motion(&["drive", "identify", "--from", "still.csv"]);
    assert_eq!(output.status.code(), Some(1));
    let refusal = String::from_utf8_lossy(&output.stderr);
    assert!(refusal.contains("is the drive enabled, the encoder connected?"), "{refusal}");
}
