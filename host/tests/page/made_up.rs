//! Runs that are made up: one of ten minutes, of which the page has samples of several ticks; a log with gaps.

use motion_host::gcode::Axis;
use motion_host::report;
use motion_host::trace::{AxisTick, RunTrace, TraceRow, TracedAxis, TracedBlock};
use serde_json::json;

use crate::browser::Browser;
use crate::workspace::Workspace;

const TICK_S: f64 = 0.5e-3;
const TICKS: u64 = 1_200_000;
const FEED_MM_S: f64 = 40.0;
/// Ticks of a line of the program, and its length.
const LINE_TICKS: u64 = 5_000;
const LINE_MM: f64 = FEED_MM_S * TICK_S * LINE_TICKS as f64;
/// Ticks with errors that stand out, and the errors \[µm\].
const PEAKS: [(u64, f64); 2] = [(123_457, 60.0), (765_432, -45.0)];

/// To and fro in X, a step further in Y each time, with errors that are noise and two peaks.
fn trace() -> RunTrace {
    let axis = |letter: Axis| TracedAxis {
        name: letter.to_string(),
        letter,
        following_error_limit_um: 1000.0,
        end_error_counts: 0,
    };
    let mut random = motion_tests::random::Random::of_stream(24);
    let rows = (0..TICKS).map(|tick| {
        let (line, along) = (tick / LINE_TICKS, (tick % LINE_TICKS) as f64 / LINE_TICKS as f64);
        let is_back = line % 2 == 1;
        let x = LINE_MM * if is_back { 1.0 - along } else { along };
        let mut axes = [AxisTick::default(); 3];
        (axes[0].set_mm, axes[1].set_mm, axes[2].set_mm) = (x, 0.5 * line as f64, -1.0);
        for axis in &mut axes {
            axis.err_um = random.between(-8.0, 8.0);
            axis.out_v = random.between(-4.0, 4.0);
        }
        if let Some((_, error)) = PEAKS.iter().find(|(peak, _)| *peak == tick) {
            axes[0].err_um = *error;
        }
        TraceRow {
            tick,
            s_mm: FEED_MM_S * TICK_S * tick as f64,
            v_mm_s: FEED_MM_S,
            a_mm_s2: random.between(-100.0, 100.0),
            j_mm_s3: random.between(-1e3, 1e3),
            snap_mm_s4: random.between(-1e5, 1e5),
            state: "moving",
            line: line as u32 + 1,
            contour_um: axes[1].err_um.abs(),
            axes,
        }
    });
    let block = |line: u64| TracedBlock {
        line: line as u32 + 1,
        kind: "line".into(),
        start_mm: LINE_MM * line as f64,
        length_mm: LINE_MM,
        cap_mm_s: FEED_MM_S,
        cap_reason: "programmed".into(),
        enter_mm_s: FEED_MM_S,
        peak_mm_s: FEED_MM_S,
        exit_mm_s: FEED_MM_S,
        time_s: LINE_TICKS as f64 * TICK_S,
        is_rapid: line % 10 == 9,
    };
    RunTrace {
        program: "long.ngc".to_owned(),
        tick_s: TICK_S,
        axes: vec![axis(Axis::X), axis(Axis::Y), axis(Axis::Z)],
        blocks: (0..TICKS / LINE_TICKS).map(block).collect(),
        ticks: rows.collect(),
        ..RunTrace::default()
    }
}

pub(crate) fn a_long_run_is_told_in_samples() {
    let workspace = Workspace::new("page-long");
    let mut page = Vec::new();
    report::write_html(&trace(), None, None, &mut page).expect("memory");
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    workspace.put("long.html", &String::from_utf8(page).expect("UTF-8"));
    let browser = Browser::open(&workspace.0.join("long.html"), [1400, 1000]);
    let per = browser.number("motion.run.ticksPerSample");
    assert!(per > 1.0 && per <= 64.0, "{per}");
    let said = browser.text("document.getElementById('resolution').textContent");
    assert!(said.contains(&format!("1 sample = {per} ticks")), "{said}");
    // The peaks are the worst places, and in every window that holds them.
    let places = "motion.run.header.worst.find((w) => w.name === 'following error of X').places";
    for (rank, (tick, error)) in PEAKS.into_iter().enumerate() {
        assert_eq!(browser.number(&format!("{places}[{rank}].tick")), tick as f64);
        assert_eq!(browser.number(&format!("{places}[{rank}].value")), error);
        browser.run(&format!("motion.state.showAll(); motion.state.visit({tick})"));
        let plot = "motion.plots.plots.find((p) => p.title === 'Following error')";
        for _ in 0..20 {
            let found = browser.after_frame(&format!(
                "(() => {{ const p = {plot}; const all = p.shapes(motion.plots.columns()); \
                 const x = all.find((s) => s.curve.column === 'error 0').points; \
                 return [Math.min(...x.map((q) => q[1])), Math.max(...x.map((q) => q[2]))]; }})()"
            ));
            let shown = found[usize::from(error > 0.0)].as_f64().expect("a number");
            assert!((shown - error).abs() < 0.01, "{error}: {found}");
            browser.run("motion.state.zoom(motion.state.xOf(motion.run, motion.state.cursor), 0.5)");
        }
        let value = browser.text(&format!("{plot}.values.querySelector('output').textContent"));
        let peak = format!("{}", error.abs());
        assert!(value.contains(" … ") && value.contains(&peak), "{value}");
    }
    browser.run("motion.state.showAll()");
    browser.after_frame("0");
    // Whatever the length of the run: a frame has as many columns as the plots.
    let (columns, samples) = (browser.number("motion.work.columns"), browser.number("motion.work.samples"));
    browser.run("motion.state.zoom(100, 0.7)");
    browser.after_frame("0");
    let drawn = browser.number("motion.work.columns") - columns;
    let looked = browser.number("motion.work.samples") - samples;
    assert!(drawn > 1000.0 && drawn < 30_000.0, "{drawn} columns");
    assert!(looked < 60.0 * drawn, "{looked} samples for {drawn} columns");
    // The path's corners are there in the coarsest picture.
    let corners = browser.run(
        "const run = motion.run; const all = [...run.outline.within(1)]; \
         return [all.length, Math.min(...all.map((i) => run.outline.places[0][i])), Math.max(...all.map((i) => run.outline.places[0][i]))]",
    );
    assert!(corners[0].as_f64().expect("a number") < 4_000.0, "{corners}");
    assert!(corners[1].as_f64().expect("a number").abs() < 0.05, "{corners}");
    assert!((corners[2].as_f64().expect("a number") - LINE_MM).abs() < 0.05, "{corners}");
    browser.close();
}

/// Beside the extremes of every number, looked at one by one.
pub(crate) fn pyramids_neither_lose_nor_invent_peaks() {
    let workspace = Workspace::new("page-pyramids");
    let mut page = Vec::new();
    let small = RunTrace { ticks: trace().ticks[..2000].to_vec(), ..trace() };
    report::write_html(&small, None, None, &mut page).expect("memory");
    workspace.put("small.html", &String::from_utf8(page).expect("UTF-8"));
    let browser = Browser::open(&workspace.0.join("small.html"), [1000, 800]);
    let mut random = motion_tests::random::Random::of_stream(25);
    for count in [1, 2, 4, 5, 17, 64, 1000, 4097] {
        let numbers: Vec<i32> = (0..count).map(|_| random.below(2_000_000) as i32 - 1_000_000).collect();
        let widths: Vec<i32> =
            (0..count).map(|_| if random.once_in(9) { -1 } else { random.below(1000) as i32 }).collect();
        let ranges: Vec<[usize; 2]> = (0..200)
            .map(|_| {
                let from = random.below(count);
                [from, from + 1 + random.below(count - from)]
            })
            .collect();
        let wrong = browser.module(&format!(
            "const {{ Pyramid }} = await import('page/pyramid.js'); \
             const numbers = {}, widths = {}, ranges = {}; \
             const low = Int32Array.from(numbers, (n, i) => widths[i] < 0 ? 0x7fffffff : n); \
             const high = Int32Array.from(numbers, (n, i) => widths[i] < 0 ? -0x80000000 : n + widths[i]); \
             const pyramid = new Pyramid(low, high); \
             const wrong = ranges.filter(([from, to]) => {{ \
               let [a, b, first] = [0x7fffffff, -0x80000000, from]; \
               for (let i = from; i < to; i += 1) {{ if (low[i] < a) {{ a = low[i]; first = i; }} b = Math.max(b, high[i]); }} \
               const found = pyramid.range(from, to); \
               const isRight = pyramid.low === a && pyramid.high === b && found === a <= b; \
               return !isRight || pyramid.lowest(from, to) !== first; }}); \
             done(wrong)",
            json!(numbers),
            json!(widths),
            json!(ranges)
        ));
        assert_eq!(wrong, json!([]), "{count} numbers");
    }
    browser.close();
}

/// As a board's log has it: it begins late, ticks are missing, no block is known; and an axis that turns.
pub(crate) fn late_logs_with_gaps_and_rotary_axes_are_shown() {
    let workspace = Workspace::new("page-log");
    let mut log = trace();
    log.blocks.clear();
    log.axes.truncate(2);
    log.axes[1] = TracedAxis { name: "A".to_owned(), letter: Axis::A, ..log.axes[1].clone() };
    let of_log = |row: &TraceRow| (4_700..6_000).contains(&row.tick) && !(5_200..5_300).contains(&row.tick);
    log.ticks.retain(of_log);
    let mut page = Vec::new();
    report::write_html(&log, None, None, &mut page).expect("memory");
    workspace.put("log.html", &String::from_utf8(page).expect("UTF-8"));
    let browser = Browser::open(&workspace.0.join("log.html"), [1400, 1000]);
    assert_eq!(browser.number("motion.run.ticks"), 1_300.0);
    // Over time it begins where the log does.
    assert!((browser.number("motion.state.from") - 4_700.0 * TICK_S).abs() < 1e-9);
    for (tick, line) in [(4_700, "1"), (4_999, "1"), (5_000, "2"), (5_999, "2")] {
        browser.run(&format!("motion.state.place({tick} - motion.run.firstTick)"));
        let told = browser.after_frame("document.getElementById('readout').textContent");
        let told = told.as_str().expect("text");
        assert!(told.contains(&format!("{:.4} s", f64::from(tick) * TICK_S)), "{tick}: {told}");
        assert!(told.contains(&format!("Line{line}")), "{tick}: {told}");
    }
    // Nothing is told of what is missing.
    browser.run("motion.state.place(550)");
    let value = browser.after_frame("motion.plots.plots[0].values.querySelector('output').textContent");
    assert_eq!(value, "–");
    let gap = browser.after_frame(
        "(() => { const plot = motion.plots.plots[0]; const { points, starts } = plot.shapes(motion.plots.columns())[0]; \
         return [points.every(([x, low, high]) => Number.isFinite(low + high)), starts.length, \
           ...[starts[1] - 1, starts[1]].map((i) => motion.run.tickAtTime(plot.xAt(points[i][0])))]; })()",
    );
    assert_eq!((&gap[0], &gap[1]), (&json!(true), &json!(2)), "{gap}");
    for (at, tick) in [(2, 500.0), (3, 600.0)] {
        assert!((gap[at].as_f64().expect("a tick") - tick).abs() <= 3.0, "{gap}");
    }
    // Axes of two units have plots of their own; errors of the rotary one are in thousandths of a degree.
    let plots =
        browser.run("return motion.plots.plots.map((plot) => plot.title + ' ' + plot.unit)").to_string();
    for plot in ["Following error µm", "Following error m°", "Position °", "Velocity °/s", "Output V"] {
        assert!(plots.contains(plot), "{plot}: {plots}");
    }
    browser.run("motion.state.layOver('path')");
    browser.after_frame("0");
    browser.close();
}
