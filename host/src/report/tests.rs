//! The page as a whole, on made-up runs.

use super::*;
use crate::gcode::Axis;
use crate::trace::{AxisTick, PathLimits, TraceRow, TracedAxis, TracedBlock, TracedCommand, TracedStop};

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

fn page(trace: &RunTrace) -> String {
    let mut out = Vec::new();
    write_html(trace, &mut out).expect("writing to memory");
    let page = String::from_utf8(out).expect("UTF-8");
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    for forbidden in ["NaN", "inf\"", ",inf", "<script", "http-equiv", "src=", "href="] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    assert_eq!(page.matches("<svg").count(), page.matches("</svg>").count());
    page
}

#[test]
fn a_whole_run_makes_every_section() {
    let page = page(&sample(1e-3, true));
    for part in
        ["Done without a fault", "5 blocks, 111.652 mm", "5000 mm/min", "Path, X and Y", "Path, X and Z"]
    {
        assert!(page.contains(part), "{part}");
    }
    for part in [
        "ceiling: jerk",
        ">30</th>",
        "lines of the program",
        "Snap [mm/s⁴]",
        "Following error [µm]",
        "id=\"axis2-wide-t\"",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("left out"));
    // The program's own block numbers may differ from its line numbers.
    assert!(!page.contains("N30"));
}

#[test]
fn limits_are_drawn_where_they_fit_and_named_where_not() {
    let mut trace = sample(1e-3, true);
    let summary = Summary::of(&trace);
    let whole = page(&trace);
    assert!(whole.contains(&format!(
        "{} mm/s²<small>{} of the limit</small>",
        figure(summary.accel_mm_s2.magnitude(), 4),
        share(summary.accel_mm_s2.magnitude(), 500.0).expect("a limit"),
    )));
    assert!(whole.contains("Acceleration [mm/s²], limit ±500") && whole.contains("<td>−3</td>"));
    let limit_line = format!("stroke=\"{}\"", palette::LIMIT.hex());
    let lines = |page: &str| {
        let in_style = palette::style_sheet().matches(&limit_line).count();
        page.matches(&limit_line).count() - in_style
    };
    // Both directions of three curves on two sheets, and the legend.
    assert_eq!(lines(&whole), 2 * 3 * 2 + 1);
    assert!(whole.contains("of its limit, 1000 µm, which is not drawn"));
    trace.limits.snap_mm_s4 = 4e7;
    let flat = page(&trace);
    assert_eq!(lines(&flat), 2 * 2 * 2 + 1);
    assert!(flat.contains("The snap stays within"));
    trace.limits = PathLimits::default();
    let unlimited = page(&trace);
    assert!(lines(&unlimited) == 0 && !unlimited.contains("of the limit<"));
}

#[test]
fn rests_are_shaded_and_timed() {
    let mut trace = sample(1e-3, false);
    assert!(!page(&trace).contains("Shaded"));
    for tick in &mut trace.ticks[500..750] {
        tick.state = "dwell";
    }
    let dwelt = page(&trace);
    assert!(dwelt.contains("Shaded: dwells.") && dwelt.contains("250 ms<small>1 dwell</small>"));
    // Four panels along the path, two for each of two axes, on two sheets.
    let shade = format!("fill=\"{}\"", palette::REST.hex());
    let in_style = palette::style_sheet().matches(&shade).count();
    assert_eq!(dwelt.matches(&shade).count() - in_style, 2 * (4 + 2 + 2));
    trace.ticks[900].state = "stopped";
    assert!(page(&trace).contains("Shaded: dwells and program stops."));
}

#[test]
fn contour_error_is_drawn_and_its_peak_named() {
    let mut trace = sample(1e-3, false);
    trace.ticks[300].contour_um = 12.5;
    let page = page(&trace);
    assert!(page.contains("<dt>Highest contour error</dt><dd>12.5 µm</dd>"));
    assert!(page.contains("id=\"contour-narrow-t\"") && page.contains("Contour error along the path"));
}

#[test]
fn views_and_axis_plots_follow_what_moved() {
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
    // Without a motion there is nothing to plot, unless the axis failed.
    assert!(page(&trace).contains("X was not moved") && !page(&trace).contains("id=\"axis0-wide-t\""));
    trace.faults.push(TracedFault {
        tick: 20,
        axis: Some("X".to_string()),
        fault: "following error".to_string(),
        detail: String::new(),
    });
    assert!(page(&trace).contains("id=\"axis0-wide-t\""));
}

#[test]
fn empty_and_one_tick_records_make_a_page() {
    assert!(page(&RunTrace::default()).contains("Nothing was run"));
    let mut one = sample(1e-3, false);
    one.ticks.truncate(1);
    assert!(page(&one).contains("Not finished"));
    one.blocks.clear();
    assert!(page(&one).contains("Done without a fault"));
}

#[test]
fn text_from_the_program_cannot_become_markup() {
    let mut trace = sample(1e-2, false);
    let hostile = "<script>alert('x')</script>&\"";
    trace.program = hostile.to_string();
    trace.machine = hostile.to_string();
    trace.notices = vec![hostile.to_string()];
    (trace.axes[0].name, trace.axes[1].name) = (hostile.to_string(), String::new());
    trace.faults.push(TracedFault {
        tick: 20,
        axis: Some(hostile.to_string()),
        fault: hostile.to_string(),
        detail: hostile.to_string(),
    });
    let page = page(&trace);
    assert!(page.contains("&lt;script&gt;") && page.contains("axis 2"));
}

#[test]
fn faults_are_named_first_and_marked_in_the_plots() {
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
    assert!(page.contains("limit 500 µm") && page.contains("fault latched"));
    let mark = format!("stroke=\"{}\"", palette::FAULT.hex());
    assert!(page.matches(&mark).count() > 2 * (1 + 4 + 2));
}

#[test]
fn values_that_are_not_finite_are_reported_and_not_drawn() {
    let mut trace = sample(1e-3, false);
    trace.ticks[100].v_mm_s = f64::NAN;
    trace.ticks[200].axes[0].err_um = f64::INFINITY;
    trace.ticks[300].axes[1].set_mm = f64::NEG_INFINITY;
    trace.ticks[400].s_mm = f64::NAN;
    trace.blocks[2].cap_mm_s = f64::INFINITY;
    assert!(page(&trace).contains("3 values in the trace not finite"));
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

#[test]
fn the_largest_run_stays_small_and_keeps_its_peak() {
    let mut trace = chopped(sample(2.05e-6, true), 20_000);
    assert!(trace.ticks.len() > 1_000_000);
    // The worst case for the size: nothing is smooth, neither in time nor on the path.
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
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
    assert!(page.contains("19\u{202f}800 of 20\u{202f}000 rows left out"));
    // The lone peak is the highest point of its curve and lies just below the top of its axes.
    let plot = page.split("id=\"axis0-wide-t\"").nth(1).and_then(|rest| rest.split("</svg>").next());
    let stroke = format!("stroke=\"{}\"", palette::ERROR.hex());
    let curve = plot.and_then(|plot| plot.split("<polyline").find(|line| line.contains(&stroke)));
    let points =
        curve.and_then(|curve| curve.split("points=\"").nth(1)).and_then(|rest| rest.split('"').next());
    let heights = points.unwrap_or("").split_whitespace().filter_map(|point| point.split_once(','));
    let mut heights: Vec<i32> = heights.filter_map(|(_, y)| y.parse().ok()).collect();
    heights.sort_unstable();
    assert!(heights.len() > 1000 && heights[0] < 150 && heights[1] > 300, "{:?}", &heights[..2]);
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
fn commands_are_marked_and_listed() {
    let mut trace = sample(1e-3, false);
    assert!(!page(&trace).contains("Feed override") && !page(&trace).contains("<h2>Commands"));
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
    trace.ticks[750].state = "held";
    let whole = page(&trace);
    for part in [
        "<h2>Commands</h2>",
        "Feed override [%]",
        "override 50 %",
        "override 133.3 %",
        "<td>577</td><td>0.5770</td><td class=\"word\">hold</td><td>12.500</td><td>700</td><td>123.4</td><td>3.250</td>",
        "feed override</li>",
        "command</li>",
        "rests by command",
        "Under an override above 100 %",
        "&lt;b&gt;abort",
    ] {
        assert!(whole.contains(part), "{part}");
    }
    // On the feed plot and on the override's, each for two widths.
    assert_eq!(whole.matches("\nhold\n").count(), 4);
    assert_eq!(whole.matches("\nfault\n").count(), 0);
    trace.faults =
        vec![TracedFault { tick: 1600, axis: None, fault: "output".to_string(), detail: String::new() }];
    // And on the path's, which says so with its own mark.
    assert_eq!(page(&trace).matches("\nfault\n").count(), 4 + 2);

    // Ten thousand of them are counted, and do not hide the curve.
    trace.commands = (0..10_000).map(|tick| command(tick / 6, "override=0.9", Some(0.9), None)).collect();
    let crowd = page(&trace);
    assert!(crowd.contains("command, the first 60 of 10"));
    assert!(crowd.len() < 3 * whole.len(), "{} {}", crowd.len(), whole.len());
}
