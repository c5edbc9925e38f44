//! The page as a whole, on made-up runs.

use super::format::share;
use super::page::reading::Read;
use super::*;
use crate::gcode::Axis;
use crate::trace::{
    AxisTick, PathLimits, TraceRow, TracedAxis, TracedBlock, TracedCommand, TracedProgram, TracedStop,
};

/// Ramps and cruises of the sample: duration \[s\], feed at both ends \[mm/s\]. A ramp is a raised cosine in
/// acceleration.
const FEED: [(f64, f64, f64); 10] = [
    (0.365_148, 0.0, 83.3333),
    (0.224_945, 83.3333, 83.3333),
    (0.253_755, 83.3333, 43.0887),
    (0.121_516, 43.0887, 43.0887),
    (0.210_227, 43.0887, 70.7107),
    (0.031_909, 70.7107, 70.7107),
    (0.210_227, 70.7107, 43.0887),
    (0.121_516, 43.0887, 43.0887),
    (0.217_671, 43.0887, 72.7017),
    (0.341_061, 72.7017, 0.0),
];

/// Blocks of the sample: line, kind, length \[mm\], curvature \[1/mm\], ceiling \[mm/s\] and its reason, feed
/// at entry, peak and exit \[mm/s\], duration \[s\].
type SampleBlock = (u32, &'static str, f64, f64, f64, &'static str, [f64; 3], f64);
const BLOCKS: [SampleBlock; 5] = [
    (10, "line", 50.0, 0.0, 83.3333, "programmed", [0.0, 83.3333, 43.0887], 0.843_848),
    (20, "arc", 5.235_988, -0.25, 43.0887, "jerk", [43.0887, 43.0887, 43.0887], 0.121_516),
    (30, "arc", 26.179_939, 0.1, 70.7107, "acceleration", [43.0887, 70.7107, 43.0887], 0.452_363),
    (40, "arc", 5.235_988, -0.25, 43.0887, "jerk", [43.0887, 43.0887, 43.0887], 0.121_516),
    (50, "line", 25.0, 0.0, 83.3333, "programmed", [43.0887, 72.7017, 0.0], 0.558_732),
];

/// Feed and its derivatives at a time.
fn feed_at(mut time_s: f64) -> [f64; 4] {
    use std::f64::consts::TAU;
    for (length_s, from, to) in FEED {
        if time_s <= length_s {
            let (x, rise, turn) = (time_s / length_s, to - from, TAU / length_s);
            let (sine, cosine) = (TAU * x).sin_cos();
            let a = rise / length_s;
            return [
                from + rise * (x - sine / TAU),
                a * (1.0 - cosine),
                a * turn * sine,
                a * turn * turn * cosine,
            ];
        }
        time_s -= length_s;
    }
    [0.0; 4]
}

fn axis(letter: Axis, end_error_counts: i64) -> TracedAxis {
    TracedAxis { name: letter.to_string(), letter, following_error_limit_um: 1000.0, end_error_counts }
}

/// The five-block path in ticks of `tick_s`, Z dipping if `with_z`.
fn sample(tick_s: f64, with_z: bool) -> RunTrace {
    let mut trace = RunTrace {
        program: "flange.ngc".to_string(),
        machine: "reference machine".to_string(),
        tick_s,
        limits: PathLimits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 },
        axes: vec![axis(Axis::X, 0), axis(Axis::Y, -3), axis(Axis::Z, 1)],
        planned_time_s: FEED.iter().map(|ramp| ramp.0).sum(),
        ..RunTrace::default()
    };
    let mut start_mm = 0.0;
    for (line, kind, length_mm, _, cap_mm_s, cap_reason, [enter_mm_s, peak_mm_s, exit_mm_s], time_s) in BLOCKS
    {
        trace.blocks.push(TracedBlock {
            line,
            kind: kind.into(),
            start_mm,
            length_mm,
            cap_mm_s,
            cap_reason: cap_reason.into(),
            enter_mm_s,
            peak_mm_s,
            exit_mm_s,
            time_s,
            is_rapid: false,
        });
        start_mm += length_mm;
    }
    let ticks = (trace.planned_time_s / tick_s).ceil() as u64 + 1;
    let (mut s, mut heading, mut x, mut y) = (0.0f64, 0.0f64, 0.0, 0.0);
    let mut seed = 1u32;
    for tick in 0..ticks {
        let [v, a, j, snap] = feed_at(tick as f64 * tick_s);
        let index = trace.blocks.iter().rposition(|block| s >= block.start_mm).unwrap_or(0);
        let mut axes = [AxisTick::default(); 3];
        let z = if with_z { -4.0 * (s / start_mm * std::f64::consts::PI).sin() } else { 0.0 };
        for (axis, (set, along)) in axes.iter_mut().zip([(x, heading.cos()), (y, heading.sin()), (z, 0.0)]) {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(seed >> 8) / f64::from(1u32 << 24) - 0.5;
            axis.set_mm = set;
            axis.vel_mm_s = v * along;
            axis.err_um = 0.004 * a * along + 0.6 * noise;
            axis.act_mm = set - axis.err_um * 1e-3;
            axis.out_v = v * along / 10.0 + 0.01 * noise;
        }
        let state = if tick + 1 == ticks { "idle" } else { "moving" };
        trace.ticks.push(TraceRow {
            tick,
            s_mm: if tick + 1 == ticks { start_mm } else { s.min(start_mm) },
            v_mm_s: v,
            a_mm_s2: a,
            j_mm_s3: j,
            snap_mm_s4: snap,
            state,
            line: trace.blocks[index].line,
            contour_um: 0.5 * axes[1].err_um.abs(),
            axes,
        });
        let step = v * tick_s;
        heading += BLOCKS[index].3 * step;
        (x, y, s) = (x + heading.cos() * step, y + heading.sin() * step, s + step);
    }
    trace
}

fn written(trace: &RunTrace, against: Option<&PageRun>) -> String {
    let mut out = Vec::new();
    write_html(trace, against, None, &mut out).expect("writing to memory");
    let page = String::from_utf8(out).expect("UTF-8");
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    // It needs nothing from elsewhere. Data are long lines of any letters, and an icon of nothing asks for none.
    let shown: String = page.lines().filter(|line| line.len() < 5000).collect();
    let shown = shown.replacen("<link rel=\"icon\" href=\"data:,\">", "", 1);
    for forbidden in ["NaN", "http-equiv", "src=", "href=", "{{", "https:"] {
        assert!(!shown.contains(forbidden), "{forbidden}");
    }
    page
}

fn page(trace: &RunTrace) -> String {
    written(trace, None)
}

#[test]
fn a_whole_run_is_told() {
    let trace = sample(1e-3, true);
    let page = page(&trace);
    for part in ["Done without a fault", "5 blocks, 111.652 mm", "5000 mm/min", "<td>−3</td>"] {
        assert!(page.contains(part), "{part}");
    }
    let read = Read::of(&page, "run");
    assert_eq!(read.header["program"], "flange.ngc");
    assert_eq!(read.header["ticks"], trace.ticks.len());
    assert_eq!(read.header["ticks_per_sample"], 1);
    let views: Vec<_> =
        read.header["views"].as_array().expect("a list").iter().map(|view| &view[0]).collect();
    assert_eq!(views, ["3D", "XY", "XZ"]);
    // As near as the page says, tick by tick.
    for (name, of) in [
        ("feed", &(|row: &TraceRow| row.v_mm_s) as &dyn Fn(&TraceRow) -> f64),
        ("s", &|row| row.s_mm),
        ("snap", &|row| row.snap_mm_s4),
        ("position 2", &|row| row.axes[2].set_mm),
        ("error 1", &|row| row.axes[1].err_um),
        ("volts 0", &|row| row.axes[0].out_v),
    ] {
        let (values, step) = read.column(name);
        assert_eq!(values.len(), trace.ticks.len());
        for (value, row) in values.iter().zip(&trace.ticks) {
            assert!((value - of(row)).abs() <= 0.500_001 * step, "{name}: {value} {}", of(row));
        }
    }
    let lines: Vec<u32> = read.column("visit line").0.iter().map(|&line| line as u32).collect();
    assert_eq!(lines, BLOCKS.map(|block| block.0));
    let (starts_mm, _) = read.column("block start");
    assert_eq!(starts_mm.len(), trace.blocks.len() + 1);
    let reasons: Vec<_> = read.header["reasons"].as_array().expect("a list").iter().map(|r| &r[1]).collect();
    assert_eq!(reasons, ["ceiling-0", "ceiling-2", "ceiling-1"]);
}

/// The path that the page draws, from its own data, beside the true one.
#[test]
fn the_drawn_path_is_within_what_the_page_says() {
    let trace = sample(2.5e-4, true);
    let read = Read::of(&page(&trace), "run");
    let tolerance_mm = read.header["tolerance_mm"].as_f64().expect("a number");
    assert!(tolerance_mm <= 1e-4, "{tolerance_mm}");
    let ticks = read.column("vertex tick").0;
    let places = [0, 1, 2].map(|axis| read.column(&format!("vertex {axis}")).0);
    assert!(ticks.len() < trace.ticks.len() / 4, "{}", ticks.len());
    for vertex in 1..ticks.len() {
        let ends = [vertex - 1, vertex].map(|i| places.each_ref().map(|values| values[i]));
        for row in &trace.ticks[ticks[vertex - 1] as usize..=ticks[vertex] as usize] {
            let point = row.axes.map(|axis| axis.set_mm);
            let along: [f64; 3] = std::array::from_fn(|i| ends[1][i] - ends[0][i]);
            let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let to: [f64; 3] = std::array::from_fn(|i| point[i] - ends[0][i]);
            let part = (dot(&to, &along) / dot(&along, &along).max(1e-300)).clamp(0.0, 1.0);
            let away: [f64; 3] = std::array::from_fn(|i| to[i] - part * along[i]);
            assert!(dot(&away, &away).sqrt() <= tolerance_mm, "tick {}", row.tick);
        }
    }
}

#[test]
fn figures_name_their_limits() {
    let mut trace = sample(1e-3, true);
    let highest = Summary::of(&trace).accel_mm_s2.magnitude();
    assert!(page(&trace).contains(&format!(
        "{} mm/s²<small>{} of the limit</small>",
        figure(highest, 4),
        share(highest, 500.0).expect("a limit"),
    )));
    trace.limits = PathLimits::default();
    assert!(!page(&trace).contains("of the limit<"));
}

#[test]
fn rests_are_timed() {
    let mut trace = sample(1e-3, false);
    for tick in &mut trace.ticks[500..750] {
        tick.state = "dwell";
    }
    trace.ticks[900].state = "stopped";
    let page = page(&trace);
    assert!(page.contains("250 ms<small>1 dwell</small>"));
    let rests = &Read::of(&page, "run").header["rests"];
    assert_eq!((&rests[0]["state"], &rests[1]["state"]), (&"dwell".into(), &"stopped".into()));
    assert!((rests[0]["to_s"].as_f64().expect("a number") - 0.75).abs() < 1e-9);
}

#[test]
fn the_worst_places_are_named() {
    let mut trace = sample(1e-3, false);
    trace.ticks[300].contour_um = 12.5;
    trace.ticks[301].contour_um = 12.0;
    trace.ticks[1200].contour_um = 12.25;
    let page = page(&trace);
    assert!(page.contains("<dt>Highest contour error</dt><dd>12.5 µm</dd>"));
    let read = Read::of(&page, "run");
    let worst = read.header["worst"].as_array().expect("a list");
    let contour = worst.iter().find(|worst| worst["name"] == "contour error").expect("contour error");
    let places: Vec<_> = contour["places"].as_array().expect("a list").iter().collect();
    // A visit to a line has one place.
    assert_eq!((places.len(), &places[0]["tick"], &places[1]["tick"]), (5, &300.into(), &1200.into()));
    assert_eq!((&places[0]["value"], &places[0]["line"]), (&12.5.into(), &10.into()));
}

#[test]
fn views_follow_what_moved() {
    let planes = |trace: &RunTrace| {
        let views = views(&Summary::of(trace));
        views.iter().map(|view| (view.right, view.up)).collect::<Vec<_>>()
    };
    let mut trace = sample(1e-2, true);
    assert_eq!(planes(&trace), [(0, 1), (0, 2)]);
    (trace.ticks[50].axes[0].vel_mm_s, trace.ticks[50].axes[1].vel_mm_s) = (0.0, 30.0);
    trace.ticks[50].axes[2].vel_mm_s = 30.0;
    assert_eq!(planes(&trace), [(0, 1), (0, 2), (1, 2)]);
    trace.ticks.iter_mut().for_each(|tick| tick.axes[0].set_mm = 7.0);
    assert_eq!(planes(&trace), [(1, 2)]);
    trace.ticks.iter_mut().for_each(|tick| tick.axes[2].set_mm = 7.0);
    assert_eq!(planes(&trace), [(0, 1)]);
    let read = Read::of(&page(&trace), "run");
    let moved: Vec<_> =
        read.header["axes"].as_array().expect("a list").iter().map(|a| &a["is_moved"]).collect();
    assert_eq!(moved, [false, true, false]);
}

#[test]
fn empty_and_one_tick_records_make_a_page() {
    let empty = page(&RunTrace::default());
    assert!(empty.contains("Nothing was run"));
    assert_eq!(Read::of(&empty, "run").header["ticks"], 0);
    let mut one = sample(1e-3, false);
    one.ticks.truncate(1);
    assert!(page(&one).contains("Not finished"));
    one.blocks.clear();
    assert!(page(&one).contains("Without a fault"));
}

#[test]
fn text_from_the_program_cannot_become_markup() {
    let mut trace = sample(1e-2, false);
    let hostile = "</script><script>alert('x')</script>&\"{{data}}";
    trace.program = hostile.to_string();
    trace.machine = hostile.to_string();
    trace.notices = vec![hostile.to_string()];
    trace.source = Some(TracedProgram { text: hostile.to_string(), times: vec![("dwelling", 1.5)] });
    (trace.axes[0].name, trace.axes[1].name) = (hostile.to_string(), String::new());
    trace.faults.push(TracedFault {
        tick: 20,
        axis: Some(hostile.to_string()),
        fault: hostile.to_string(),
        detail: hostile.to_string(),
    });
    let mut out = Vec::new();
    write_html(&trace, None, None, &mut out).expect("writing to memory");
    let page = String::from_utf8(out).expect("UTF-8");
    assert!(!page.contains("<script>") && page.contains("&lt;script&gt;") && page.contains("axis 2"));
    let program = Read::text(&page, "program");
    let program: serde_json::Value = serde_json::from_slice(&program).expect("JSON");
    assert_eq!((&program["text"], &program["times"][0][1]), (&hostile.into(), &1.5.into()));
}

#[test]
fn faults_are_named_first() {
    let mut trace = sample(1e-3, false);
    trace.ticks.truncate(900);
    trace.faults.push(TracedFault {
        tick: 850,
        axis: Some("Y".to_string()),
        fault: "following-error".to_string(),
        detail: "512.3 µm, limit 500 µm".to_string(),
    });
    let page = page(&trace);
    assert!(
        page.contains("<strong>Ended in a fault:</strong> following-error on axis Y at 0.8500 s (512.3 µm")
    );
    let faults = &Read::of(&page, "run").header["faults"];
    assert_eq!((&faults[0]["tick"], &faults[0]["word"]), (&850.into(), &"following-error".into()));
}

#[test]
fn values_that_are_not_finite_are_reported_and_not_drawn() {
    let mut trace = sample(1e-3, false);
    trace.ticks[100].v_mm_s = f64::NAN;
    trace.ticks[200].axes[0].err_um = f64::INFINITY;
    trace.ticks[300].axes[1].set_mm = f64::NEG_INFINITY;
    trace.ticks[400].s_mm = f64::NAN;
    trace.blocks[2].cap_mm_s = f64::INFINITY;
    let told = page(&trace);
    assert!(told.contains("3 values in the trace not finite"));
    let read = Read::of(&told, "run");
    let gaps = |name: &str| read.column(name).0.iter().filter(|value| value.is_nan()).count();
    assert_eq!(["feed", "error 0", "position 1", "s", "block ceiling"].map(gaps), [1; 5]);
    for tick in &mut trace.ticks {
        tick.v_mm_s = f64::NAN;
        tick.axes =
            [AxisTick { set_mm: f64::NAN, err_um: f64::NAN, out_v: f64::NAN, ..AxisTick::default() }; 3];
    }
    page(&trace);
}

/// The sample cut into `number` blocks of one length, so that many share a column of the plot.
fn chopped(mut trace: RunTrace, number: u32) -> RunTrace {
    let length_mm = trace.blocks.iter().map(|block| block.length_mm).sum::<f64>() / f64::from(number);
    let pattern = std::mem::take(&mut trace.blocks);
    let block = |(line, block): (u32, &TracedBlock)| TracedBlock {
        line,
        start_mm: f64::from(line) * length_mm,
        length_mm,
        ..block.clone()
    };
    trace.blocks = (0..number).zip(pattern.iter().cycle()).map(block).collect();
    trace
}

/// Ten minutes and three quarters of an hour in which nothing is smooth, neither in time nor on the path.
#[test]
fn the_largest_runs_have_their_size_and_keep_their_peak() {
    for (tick_s, size_max) in [(0.6e-3, 3_000_000), (2.7e-3, 12_000_000)] {
        let mut trace = chopped(sample(2.05e-6, true), 20_000);
        assert!(trace.ticks.len() > 1_000_000);
        trace.tick_s = tick_s;
        let mut seed = 7u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1u32 << 24) - 0.5
        };
        for tick in &mut trace.ticks {
            tick.v_mm_s = 40.0 + 80.0 * noise();
            (tick.a_mm_s2, tick.j_mm_s3, tick.snap_mm_s4) = (500.0 * noise(), 5e3 * noise(), 4e5 * noise());
            for axis in &mut tick.axes {
                axis.set_mm = 100.0 * noise();
                axis.err_um = 10.0 * noise();
                axis.out_v = 20.0 * noise();
            }
        }
        trace.ticks[777_777].axes[0].err_um = 40.0;
        let page = page(&trace);
        assert!(page.len() < size_max, "{} bytes", page.len());
        assert!(page.len() > size_max / 3, "{} bytes", page.len());
        let read = Read::of(&page, "run");
        let per = read.header["ticks_per_sample"].as_u64().expect("a number") as usize;
        let (high, step) = read.column("error 0+");
        assert_eq!(high.len(), trace.ticks.len().div_ceil(per));
        for (index, &value) in high.iter().enumerate() {
            let is_peak = index == 777_777 / per;
            assert!(is_peak == (value > 5.0 + step), "{index}: {value}");
        }
        assert!((high[777_777 / per] - 40.0).abs() <= step);
    }
}

/// For looking at the page while working on it: `cargo test -p motion-host report -- --ignored`.
#[test]
#[ignore = "writes sample pages into the folder for temporary files"]
fn sample_pages() {
    let mut faulted = sample(2.5e-4, false);
    faulted.notices =
        vec!["N15: M3 S12000 accepted, not acted on".to_string(), "N5: G64 read as exact path".to_string()];
    faulted.ticks.truncate(5000);
    faulted.faults.push(TracedFault {
        tick: 4990,
        axis: Some("Y".to_string()),
        fault: "following-error".to_string(),
        detail: "512.3 µm, limit 500 µm".to_string(),
    });
    let dense = chopped(sample(1e-4, false), 3_000);
    for (name, trace) in
        [("report", sample(2.5e-4, true)), ("report-faulted", faulted), ("report-dense", dense)]
    {
        let path = std::env::temp_dir().join(name).with_extension("html");
        std::fs::write(path, page(&trace)).expect("temporary file");
    }
}

#[test]
fn commands_are_listed() {
    let mut trace = sample(1e-3, false);
    assert!(!page(&trace).contains("<h2>Commands"));
    let command = |tick, command: &str, feed_override, stop| TracedCommand {
        tick,
        command: command.to_string(),
        feed_override,
        s_mm: 12.5,
        stop,
    };
    let stop = TracedStop { tick: 700, time_s: 0.1234, length_mm: 3.25 };
    trace.commands = vec![
        command(300, "override=0.5", Some(0.5), None),
        command(577, "hold", None, Some(stop)),
        command(900, "resume", None, None),
        command(1000, "override=1.333", Some(1.333), None),
        command(1500, "<b>abort", None, None),
    ];
    let whole = page(&trace);
    for part in [
        "<h2>Commands</h2>",
        "override 50 %",
        "override 133.3 %",
        "<td>577</td><td>0.5770</td><td class=\"word\">hold</td><td>12.500</td><td>700</td><td>123.4</td><td>3.250</td>",
        "&lt;b&gt;abort",
        "Under an override above 100 %",
    ] {
        assert!(whole.contains(part), "{part}");
    }
    let marks = &Read::of(&whole, "run").header["commands"];
    assert_eq!((&marks[0]["word"], &marks[1]["tick"]), (&"override 50 %".into(), &577.into()));
}

#[test]
fn another_run_lies_beside_it() {
    let (trace, other) = (sample(1e-3, false), sample(2e-3, true));
    let other = RunTrace { program: "before.ngc".to_string(), ..other };
    let page = written(&trace, Some(&PageRun::of(&other).expect("memory")));
    let [own, beside] = ["run", "against-run"].map(|name| Read::of(&page, name));
    assert_eq!(
        (&own.header["program"], &beside.header["program"]),
        (&"flange.ngc".into(), &"before.ngc".into())
    );
    assert_eq!(beside.header["ticks"], other.ticks.len());
}
