//! `limit_active_share` of `motion run` against a calculation of its own, from the trace of the run:
//! velocity, acceleration, jerk and snap by differences, each of what it is the rate of, under both laws.

use std::fs;
use std::path::Path;
use std::process::Command;

use motion_host::machine::{Machine, REFERENCE_TOML};
use serde_json::Value;

/// At this part of itself a limit counts as reached, as the summary has it.
const REACHED: f64 = 0.98;

fn motion(folder: &Path, arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_motion"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("motion starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Columns of the trace by name.
fn columns(text: &str, names: &[&str]) -> Vec<Vec<f64>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let indices: Vec<usize> =
        names.iter().map(|name| header.iter().position(|column| column == name).expect("a column")).collect();
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        for (column, &index) in columns.iter_mut().zip(&indices) {
            column.push(cells[index].parse().expect("a number"));
        }
    }
    columns
}

/// On which part of the length the feed is at its block's ceiling, or a limit of the path or of an axis is
/// reached; and the parts where the ceiling alone, or one of the other limits, is the reason.
fn share(trace: &str, plan: &Value, machine: &Machine) -> [f64; 3] {
    let of_axes = |figure: &str| {
        let names = ["X", "Y", "Z"].map(|axis| format!("{axis}_{figure}"));
        columns(trace, &names.each_ref().map(String::as_str))
    };
    let of_path = columns(trace, &["s_mm", "j_mm_s3"]);
    let (s, jerk) = (&of_path[0], &of_path[1]);
    let (positions, velocities, accels) = (of_axes("set_mm"), of_axes("vel_mm_s"), of_axes("acc_mm_s2"));
    let blocks: Vec<[f64; 2]> = plan["blocks"]
        .as_array()
        .expect("blocks")
        .iter()
        .map(|block| {
            let number = |key: &str| block[key].as_f64().expect("a number");
            [number("start_mm") + number("length_mm"), number("cap_mm_s")]
        })
        .collect();
    let tick = machine.tick_s;
    let norm = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let (mut limited, mut at_ceiling, mut at_limit, mut all) = (0.0, 0.0, 0.0, 0.0);
    for k in 2..s.len() - 2 {
        let rate = |x: &Vec<f64>| (x[k + 1] - x[k - 1]) / (2.0 * tick);
        // Snap is at its limit for a few ticks in the middle of an edge only, and a difference over two ticks
        // is too small there: by (π·tick/e)²/6 with e the edge's length, which moves the ticks that reach the
        // limit. Over four ticks it is too small by (π·tick/e)⁴/30.
        let (near, far) = (jerk[k + 1] - jerk[k - 1], jerk[k + 2] - jerk[k - 2]);
        let (feed, snap) = (rate(s), (8.0 * near - far) / (12.0 * tick));
        let rates = |of: &[Vec<f64>]| [0, 1, 2].map(|axis: usize| rate(&of[axis]));
        let (v, a, j) = (rates(&positions), rates(&velocities), rates(&accels));
        let block = blocks.partition_point(|block| block[0] < s[k] - 1e-9);
        let ceiling = blocks.get(block).is_some_and(|block| feed >= REACHED * block[1]);
        let path = &machine.path;
        let mut limit = norm(a) >= REACHED * path.accel_mm_s2
            || norm(j) >= REACHED * path.jerk_mm_s3
            || snap.abs() >= REACHED * path.snap_mm_s4;
        for (axis, limits) in machine.axes.iter().enumerate() {
            limit |= v[axis].abs() >= REACHED * limits.feed_mm_s
                || a[axis].abs() >= REACHED * limits.accel_mm_s2
                || j[axis].abs() >= REACHED * limits.jerk_mm_s3;
        }
        let step = 0.5 * (s[k + 1] - s[k - 1]);
        all += step;
        limited += if ceiling || limit { step } else { 0.0 };
        at_ceiling += if ceiling { step } else { 0.0 };
        at_limit += if limit { step } else { 0.0 };
    }
    [limited / all, at_ceiling / all, at_limit / all]
}

/// Long lines at their feed, short ones that only ramp, arcs at their ceiling, blends; under both laws.
#[test]
fn the_share_of_limits_is_that_of_the_trace() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("limit-share");
    fs::create_dir_all(&folder).expect("a folder");
    let sample = |name: &str| {
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)).expect("a sample")
    };
    let programs = [
        ("stairs", sample("tests/programs/stairs_incremental.ngc")),
        ("stringer", sample("host/src/cli/stringer.ngc")),
        ("nameplate", sample("tests/programs/nameplate_inch.ngc")),
        ("long", "G1 X200 F1200\nY5\nG64 P0.1 X0 F6000\nY0 M2\n".to_owned()),
        ("fast", "G61 G0 X300\nX0 Y40\nM2\n".to_owned()),
        ("short", "G61 F6000 G1 X1\nY1\nX0\nY0\nM2\n".to_owned()),
    ];
    for law in ["sin2", "plateau"] {
        let file = REFERENCE_TOML.replace("law = \"plateau\"", &format!("law = \"{law}\""));
        let machine = Machine::from_toml("machine.toml", &file).expect("valid");
        assert_eq!(machine.path.pulse.name(), law);
        fs::write(folder.join("machine.toml"), file).expect("a file");
        let (mut shares, mut limits) = (Vec::new(), Vec::new());
        for (name, text) in &programs {
            fs::write(folder.join("part.ngc"), text).expect("a file");
            let ask = ["part.ngc", "--machine", "machine.toml", "--json"];
            let run = motion(&folder, &[&["run"][..], &ask, &["--trace", "trace.csv"]].concat());
            let plan = motion(&folder, &[&["plan"][..], &ask].concat());
            let found = run["limit_active_share"].as_f64().expect("a share");
            let trace = fs::read_to_string(folder.join("trace.csv")).expect("a trace");
            let [expected, ceiling, limit] = share(&trace, &plan, &machine);
            println!(
                "{law}, {name}: {found:.5}, by differences {expected:.5}: ceiling {ceiling:.5}, limits {limit:.5}"
            );
            assert!((found - expected).abs() < 1e-3, "{law}, {name}: {found}, by differences {expected}");
            shares.push(found);
            limits.push(limit);
        }
        // The cases differ, and both kinds of reason matter in some.
        let spread = |all: &[f64]| {
            all.iter().fold(0.0_f64, |a, &b| a.max(b)) - all.iter().fold(1.0_f64, |a, &b| a.min(b))
        };
        assert!(spread(&shares) > 0.5 && spread(&limits) > 0.1, "{law}: {shares:?} {limits:?}");
    }
}
