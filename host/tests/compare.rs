//! `motion compare` against an independent least time, found by stepping along the path, and against the
//! plans themselves.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use motion_host::compare::bound::least_time_s;
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Item, Mode, Plan, Stretch, plan_program};
use serde_json::Value;

use crate::cli::workspace::Workspace;

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/programs")
}

fn compared(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_motion"));
    command.arg("compare").args(arguments).current_dir(samples()).output().expect("motion starts")
}

fn json(arguments: &[&str]) -> Value {
    let output = compared(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// The fastest motion without limits of jerk and snap, by small steps of path: forward as far as acceleration
/// goes, backward as far as braking goes, and the time between neighbours from their mean feed.
fn stepped_s(stretch: &Stretch, steps: usize) -> f64 {
    let (mut lengths, mut accels, mut caps) = (Vec::new(), Vec::new(), Vec::new());
    for block in &stretch.blocks {
        let length = block.element.length_mm() / steps as f64;
        for step in 0..steps {
            lengths.push(length);
            accels.push(block.ceiling.law.limits().accel_mm_s2);
            let last = step + 1 == steps;
            caps.push((block.ceiling.feed_mm_s, if last { block.junction_mm_s } else { f64::INFINITY }));
        }
    }
    let mut feeds = vec![0.0_f64; lengths.len() + 1];
    for index in 0..lengths.len() {
        let gained = (feeds[index].powi(2) + 2.0 * accels[index] * lengths[index]).sqrt();
        let next = caps.get(index + 1).map_or(0.0, |next| next.0);
        feeds[index + 1] = gained.min(caps[index].0).min(caps[index].1).min(next);
    }
    for index in (0..lengths.len()).rev() {
        let braked = (feeds[index + 1].powi(2) + 2.0 * accels[index] * lengths[index]).sqrt();
        feeds[index] = feeds[index].min(braked);
    }
    lengths.iter().zip(feeds.windows(2)).map(|(length, pair)| 2.0 * length / (pair[0] + pair[1])).sum()
}

fn plan(text: &str, mode: Mode) -> Plan {
    let program = gcode::read("sample.ngc", text.as_bytes()).expect("a program");
    plan_program("sample.ngc", &program, &Machine::reference(), mode).expect("a plan")
}

/// Each figure is what planning the program by itself gives, and their order is what it has to be: no plan is
/// faster than acceleration allows, and the default none slower than one pair of ramps per block.
#[test]
fn the_times_of_the_samples_are_in_order() {
    let found = json(&[".", "--tolerance", "0.02", "--tolerance", "0.2", "--json"]);
    let rows = found["rows"].as_array().expect("rows");
    assert!(rows.len() >= 5 * 3 && found["refused"].as_array().expect("a list").is_empty());
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"));
        let (time, per_block, least) = (number("time_s"), number("per_block_s"), number("least_s"));
        assert!(number("acceleration_s") <= 1.001 * least, "{row}");
        assert!(least < time && time <= per_block * (1.0 + 1e-12), "{row}");
        for ratio in ["feed_ratio", "accel_ratio", "jerk_ratio", "accel_step_ratio", "tolerance_share"] {
            assert!((0.0..=1.0 + 1e-6).contains(&number(ratio)), "{ratio}: {row}");
        }
        // Ramps use what there is of jerk.
        assert!(number("jerk_ratio") > 0.99, "{row}");
        let blends = number("blends");
        assert_eq!(blends > 0.0, number("tolerance_share") > 0.0, "{row}");
        assert!(row["path"] != "G61" || blends == 0.0, "{row}");
        if row["path"] == "as written" || row["path"] == "G61" {
            let path = samples().join(row["program"].as_str().expect("a name"));
            let mut text = std::fs::read_to_string(path).expect("a sample");
            if row["path"] == "G61" {
                // The G61 of the start stays, whatever follows.
                for word in ["G64", "g64", "p0.0005", "q0.0002", " P0.02", "%"] {
                    text = text.replace(word, "");
                }
                text.insert_str(0, "G61\n");
            }
            // JSON is read to the last place but one.
            let is_same = |found: f64, planned: f64| (found - planned).abs() <= 1e-15 * planned;
            assert!(is_same(time, plan(&text, Mode::Spanning).time_s), "{row}");
            assert!(is_same(per_block, plan(&text, Mode::PerBlock).time_s), "{row}");
        }
    }
}

/// In closed form and by ten thousand steps a block; dwells are part of both.
#[test]
fn the_least_time_is_that_of_small_steps() {
    // Setting out and stopping over many lines, at feeds of their own.
    let lines: Vec<String> = (0..60)
        .map(|line| format!("F{} G1 X{}\n", 3000 + 700 * (line % 5), 0.5 * f64::from(line + 1)))
        .collect();
    let lines = format!("{}M2\n", lines.concat());
    for (name, mode) in [
        ("pockets.ngc", "G61"),
        ("pockets.ngc", "G64 P0.2"),
        ("thread_mill_helix.ngc", "G61"),
        ("stairs_incremental.ngc", "G64 P0.05"),
        ("lines", "G61"),
    ] {
        let text = match name {
            "lines" => lines.clone(),
            _ => std::fs::read_to_string(samples().join(name)).expect("a sample"),
        };
        let text = text.replace("G61", mode).replace('%', "");
        let plan = plan(&format!("{mode}\n{text}"), Mode::Spanning);
        let stepped: f64 = plan
            .items
            .iter()
            .map(|item| match item {
                Item::Stretch(stretch) => stepped_s(stretch, 10_000),
                Item::Dwell { seconds, .. } => *seconds,
                Item::Switch { .. } | Item::Stop { .. } => 0.0,
            })
            .sum();
        let least = least_time_s(&plan);
        println!("{name}, {mode}: {least} s, by steps {stepped} s, planned {} s", plan.time_s);
        // The peak of a triangle lies within a step.
        assert!((least - stepped).abs() < 1e-6 * stepped, "{name}, {mode}: {least} s, by steps {stepped} s");
    }
}

/// A kink that is passed steps velocity by the angle; a path without one does not.
#[test]
fn a_kink_that_is_passed_is_told() {
    let workspace = Workspace::new("compare-kink");
    let of = |second: &str| {
        let text = format!("G61 G21 G90 F3000\nG1 X20\n{second}\nM2\n");
        workspace.put("kink.ngc", &text);
        let found = workspace.json(&["compare", "kink.ngc", "--json"]);
        found["rows"][0]["velocity_step_mm_s"].as_f64().expect("a number")
    };
    let (kinked, straight) = (of("X40 Y0.08"), of("X40"));
    let step_mm_s = 50.0 * 0.004;
    println!("{kinked} mm/s, expected {step_mm_s}; without a kink {straight}");
    // The mean of two accelerations misses snap times the tick cubed over 12.
    let missed_mm_s = 4.0e5 * 0.0005_f64.powi(3) / 12.0;
    assert!((kinked - step_mm_s).abs() < 1e-3 * step_mm_s && straight <= 1.001 * missed_mm_s);
}

#[test]
fn the_forms_say_the_same() {
    let asked = ["pockets.ngc", "--tolerance", "0.1"];
    let with = |form| compared(&[&asked[..], &[form]].concat());
    let rows = json(&[&asked[..], &["--json"]].concat());
    let csv = String::from_utf8(with("--csv").stdout).expect("UTF-8");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "program,path,blocks,blends,length_mm,time_s,per_block_s,least_s,tolerance_share,feed_ratio,accel_ratio,jerk_ratio,\
         accel_step_ratio,acceleration_s,velocity_step_mm_s"
    );
    assert_eq!(lines.len(), 3);
    let table = String::from_utf8(compared(&asked).stdout).expect("UTF-8");
    for (index, path) in ["G61", "G64 P0.1"].into_iter().enumerate() {
        let row = &rows["rows"][index];
        assert_eq!(row["path"], path);
        let cells: Vec<&str> = lines[index + 1].split(',').collect();
        assert_eq!(cells[5].parse::<f64>().ok(), row["time_s"].as_f64());
        let time = format!("{:.4}", row["time_s"].as_f64().expect("a time"));
        // A line for each value, a column for each path.
        let cell = |name: &str| {
            let line = table.lines().find_map(|line| line.trim_start().strip_prefix(name)).expect(name);
            line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).nth(index).map(str::to_owned)
        };
        assert_eq!((cell("path"), cell("time [s]")), (Some(path.to_owned()), Some(time)), "{table}");
    }
}

/// One program that is refused does not cost the others their figures.
#[test]
fn refused_programs_are_named_after_the_others() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compare-refused");
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, text) in [("a.ngc", "G1 X1 F60\nG53\n"), ("b.ngc", "G1 X1 F60\nM2\n"), ("c.ngc", "X1\n")] {
        std::fs::write(folder.join(name), text).expect("a file");
    }
    let output = compared(&[folder.to_str().expect("UTF-8"), "--csv"]);
    assert_eq!(output.status.code(), Some(2));
    let (out, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(out.lines().filter(|line| line.contains("b.ngc")).count(), 2, "{out}");
    let lines: Vec<&str> = error.lines().collect();
    assert!(lines.len() == 2 && lines[0].contains("a.ngc:2:1: found G53"), "{error}");
    assert!(lines[1].starts_with("motion: ") && lines[1].contains("c.ngc:1:1: found X1"), "{error}");
    let empty = compared(&[Path::new(env!("CARGO_MANIFEST_DIR")).to_str().expect("UTF-8")]);
    assert_eq!(empty.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&empty.stderr).contains("expected a folder of programs"));
}
