//! Reports of `motion run`.

use serde_json::Value;

use crate::browser::Browser;
use crate::workspace::{STRINGER, Workspace, number};

pub(crate) const DESK: [u32; 2] = [1400, 1000];
pub(crate) const PHONE: [u32; 2] = [390, 844];

/// Keys by their names.
const RIGHT: char = '\u{E014}';
const HOME: char = '\u{E011}';
const END: char = '\u{E010}';

/// The demonstration's program, run: its figures, its trace, and its page.
struct Demonstration {
    _workspace: Workspace,
    json: Value,
    trace: Vec<Vec<String>>,
    browser: Browser,
}

impl Demonstration {
    fn new(name: &str, size: [u32; 2]) -> Self {
        let workspace = Workspace::new(&format!("page-{name}"));
        workspace.put("part.ngc", STRINGER);
        let run = ["run", "part.ngc", "--report", "part.html", "--trace", "part.csv", "--json"];
        let json = workspace.json(&run);
        let rows = workspace.read("part.csv");
        let trace = rows.lines().map(|row| row.split(',').map(str::to_owned).collect()).collect();
        let browser = Browser::open(&workspace.0.join("part.html"), size);
        Self { _workspace: workspace, json, trace, browser }
    }

    /// A column of the trace in a tick.
    fn at(&self, tick: usize, column: &str) -> f64 {
        let place = self.trace[0].iter().position(|name| name == column).expect("a column");
        self.trace[tick + 1][place].parse().expect("a number")
    }

    fn ticks(&self) -> usize {
        self.trace.len() - 1
    }
}

/// The first number in a text of the page.
pub(crate) fn first_number(text: &str) -> f64 {
    let plain = text.replace('\u{202f}', "").replace('−', "-");
    let end = plain.find(|c: char| !(c.is_ascii_digit() || ".-".contains(c))).unwrap_or(plain.len());
    plain[..end].parse().unwrap_or_else(|_| panic!("{text} begins with no number"))
}

/// As near as so many significant digits tell.
pub(crate) fn assert_near(shown: f64, true_value: f64, digits: i32, what: &str) {
    let half = 0.5 * 10f64.powi(true_value.abs().log10().floor() as i32 + 1 - digits);
    assert!((shown - true_value).abs() <= half * 1.000_001, "{what}: {shown} is shown, {true_value} it is");
}

pub(crate) fn figures_are_those_of_the_run() {
    let page = Demonstration::new("figures", DESK);
    let (browser, json) = (&page.browser, &page.json);
    let figure = |name: &str| {
        let of = format!("[...document.querySelectorAll('dt')].find((e) => e.textContent === '{name}')");
        first_number(&browser.text(&format!("{of}.nextElementSibling.textContent")))
    };
    let max = |key: &str| number(&json["max"][key]);
    for (name, value, digits) in [
        ("Path length", number(&json["path_length_mm"]), 6),
        ("Executed time", number(&json["ticks"]) * number(&json["tick_s"]), 4),
        ("Highest feed", max("feed_mm_s"), 4),
        ("Highest acceleration", max("accel_mm_s2"), 4),
        ("Highest jerk", max("jerk_mm_s3"), 4),
        ("Highest snap", max("snap_mm_s4"), 4),
        ("Highest contour error", number(&json["contour_error_um_max"]), 3),
    ] {
        assert_near(figure(name), value, digits, name);
    }
    // Worst places are exact; plots are to half a step.
    let quantities = [
        ("feed", "feed", max("feed_mm_s")),
        ("acceleration", "acceleration", max("accel_mm_s2")),
        ("jerk", "jerk", max("jerk_mm_s3")),
        ("snap", "snap", max("snap_mm_s4")),
        ("contour error", "contour", number(&json["contour_error_um_max"])),
        ("following error of X", "error 0", number(&json["axes"][0]["following_error_um_max"])),
        ("output of Y", "volts 1", number(&json["axes"][1]["output_v_max"])),
    ];
    for (name, column, value) in quantities {
        let worst = browser.number(&format!(
            "Math.abs(motion.run.header.worst.find((w) => w.name === '{name}').places[0].value)"
        ));
        assert!((worst - value).abs() <= 1e-9 * value, "{name}: {worst} {value}");
        let quantity = format!("motion.run.quantity('{column}')");
        let highest = browser.number(&format!(
            "({quantity}.range(0, motion.run.samples), Math.max({quantity}.high, -{quantity}.low))"
        ));
        let step = browser.number(&format!("{quantity}.step"));
        assert!((highest - value).abs() <= 0.500_001 * step, "{name}: {highest} {value} {step}");
    }
    // What the cursor tells, beside rows of the trace.
    assert_eq!(browser.number("motion.run.ticks"), page.ticks() as f64);
    for tick in [0, 1, 777, 1500, 2222, page.ticks() - 1] {
        browser.run(&format!("motion.state.place({tick})"));
        let told = browser.after_frame(
            "Object.fromEntries([...document.querySelectorAll('#readout b')].map((b) => [b.dataset.of, b.textContent]))",
        );
        let of = |name: &str| first_number(told[name].as_str().expect("text"));
        assert!((of("Time") - page.at(tick, "t_s")).abs() <= 5.1e-5, "{tick}: {told}");
        assert!((of("Path") - page.at(tick, "s_mm")).abs() <= 6e-4, "{tick}: {told}");
        // At the end there is no line.
        match page.at(tick, "line") {
            0.0 => assert_eq!(told["Line"], "", "{tick}"),
            line => assert_eq!(of("Line"), line, "{tick}: {told}"),
        }
        let feed = page.at(tick, "v_mm_s");
        assert!((of("Feed") - feed).abs() <= 5e-4 * feed + 2e-3, "{tick}: {told}, {feed}");
    }
    page.browser.close();
}

/// Dragging the cursor draws no column anew: only its line and the values move.
pub(crate) fn the_cursor_is_dragged() {
    let page = Demonstration::new("drag", DESK);
    let browser = &page.browser;
    let [x, y] = browser.middle(".plot .area");
    let from = browser.text("document.querySelector('#readout b').textContent");
    browser.after_frame("0");
    let before = [browser.number("motion.work.columns"), browser.number("motion.work.samples")];
    let frames = browser.number("motion.work.frames");
    let places: Vec<[f64; 2]> = (0..=20).map(|step| [x - 200.0 + 20.0 * f64::from(step), y]).collect();
    browser.drag(&places);
    let columns = browser.after_frame("motion.work.columns");
    assert_eq!(columns, before[0], "columns were drawn");
    let frames = browser.number("motion.work.frames") - frames;
    let samples = browser.number("motion.work.samples") - before[1];
    let curves = browser.number("motion.plots.plots.reduce((n, plot) => n + plot.curves.length, 0)");
    // One sample for each curve's value; its path positions, and the readout's.
    assert!(samples <= (frames + 21.0) * 4.0 * (curves + 40.0), "{samples} samples in {frames} frames");
    assert!(samples > curves, "{samples}");
    // The cursor is where the pointer was let go, in the path's plot too.
    let at = "motion.plots.plots[0]";
    let px = browser.number(&format!(
        "{at}.px(motion.state.xOf(motion.run, motion.state.cursor)) + {at}.area.getBoundingClientRect().left"
    ));
    assert!((px - (x + 200.0)).abs() <= 1.0, "{px} {x}");
    assert_ne!(browser.text("document.querySelector('#readout b').textContent"), from);
    let tick = browser.number("motion.state.cursor") as usize;
    let dot = browser.run(
        "const [x, y] = motion.path.project(motion.run.placeAt(motion.state.cursor)); return [x, y, motion.path.dot.style.transform]",
    );
    let shown = dot[2].as_str().expect("text");
    assert!(shown.starts_with("translate(") && shown.contains("px"), "{dot}");
    let place = browser.run("return motion.run.placeAt(motion.state.cursor)");
    for (axis, name) in ["X_set_mm", "Y_set_mm"].into_iter().enumerate() {
        let found = number(&place[axis]);
        assert!((found - page.at(tick, name)).abs() < 2e-3, "{found} {}", page.at(tick, name));
    }
    // A pointer that only passes over takes the cursor along, and gives it back.
    browser.point([x, y]);
    browser.after_frame("0");
    assert_ne!(browser.number("motion.state.cursor") as usize, tick);
    browser.point([2.0, 2.0]);
    browser.after_frame("0");
    assert_eq!(browser.number("motion.state.cursor") as usize, tick);
    page.browser.close();
}

pub(crate) fn the_wheel_zooms() {
    let page = Demonstration::new("wheel", DESK);
    let browser = &page.browser;
    let place = browser.middle(".plot .area");
    let width = "motion.state.to - motion.state.from";
    let at = format!(
        "motion.plots.plots[0].xAt({} - motion.plots.plots[0].area.getBoundingClientRect().left)",
        place[0]
    );
    let (whole, under) = (browser.number(width), browser.number(&at));
    browser.after_frame("0");
    let (columns, frames) = (browser.number("motion.work.columns"), browser.number("motion.work.frames"));
    browser.wheel(place, -400);
    browser.after_frame("0");
    let zoomed = browser.number(width);
    assert!((whole / zoomed - 2f64.powf(1.4)).abs() < 1e-6, "{whole} {zoomed}");
    assert!((browser.number(&at) - under).abs() < 1e-6 * whole, "what is under the pointer stays there");
    // No more than the columns that are seen, and a tick at either side.
    let frames = browser.number("motion.work.frames") - frames;
    let drawn = browser.number("motion.work.columns") - columns;
    let most = browser.number(
        "motion.plots.plots.reduce((n, plot) => n + plot.curves.length, 0) * (motion.plots.plots[0].width + 3)",
    );
    assert!(drawn > 0.0 && drawn <= frames * most, "{drawn} columns in {frames} frames of {most}");
    // As near as ten samples, and no nearer.
    for _ in 0..20 {
        browser.wheel(place, -400);
    }
    browser.after_frame("0");
    let ten = 10.0 * browser.number("motion.run.tickS");
    assert!((browser.number(width) - ten).abs() < 1e-9, "{} {ten}", browser.number(width));
    browser.press("All");
    browser.after_frame("0");
    assert!(browser.holds("motion.state.isWhole()"));
    // Over the path, with the same ticks.
    browser.press("Over path [mm]");
    browser.after_frame("0");
    let length = number(&page.json["path_length_mm"]);
    assert!((browser.number("motion.state.to") - length).abs() < 1e-3);
    // The path zooms as far as its data go.
    let stage = browser.middle(".stage");
    let pixel = "motion.path.camera.scale * motion.run.outline.toleranceMm";
    for _ in 0..40 {
        browser.wheel(stage, -1000);
    }
    browser.after_frame("0");
    assert!((browser.number(pixel) - 0.5).abs() < 1e-9, "{}", browser.number(pixel));
    page.browser.close();
}

pub(crate) fn keys_move_cursor_and_window() {
    let page = Demonstration::new("keys", DESK);
    let browser = &page.browser;
    browser.run("document.getElementById('plots').focus()");
    let cursor = || browser.after_frame("motion.state.cursor").as_f64().expect("a tick") as usize;
    browser.keys(&String::from_iter([HOME, RIGHT, RIGHT, RIGHT]));
    assert_eq!(cursor(), 3);
    browser.keys("]");
    let second = cursor();
    let lines = || [second - 1, second].map(|tick| page.at(tick, "line"));
    assert_ne!(lines()[0], lines()[1], "a line begins here");
    assert_eq!(
        browser.text("document.querySelector('.row[aria-selected=true]').dataset.line"),
        page.trace[second + 1][page.trace[0].iter().position(|name| name == "line").expect("a column")],
    );
    browser.keys("+");
    browser.after_frame("0");
    assert!(!browser.holds("motion.state.isWhole()"));
    browser.keys(&END.to_string());
    assert_eq!(cursor(), page.ticks() - 1);
    // The window follows.
    assert!(browser.holds("motion.run.timeS(motion.state.cursor) <= motion.state.to + 1e-9"));
    browser.keys("0");
    browser.after_frame("0");
    assert!(browser.holds("motion.state.isWhole()"));
    page.browser.close();
}

pub(crate) fn colours_are_switched() {
    let page = Demonstration::new("colours", DESK);
    let browser = &page.browser;
    let picture = || browser.after_frame("motion.path.sheet.canvas.toDataURL()").to_string();
    let legend = || browser.text("document.querySelector('#path .legend').textContent");
    let mut pictures = Vec::new();
    for (colour, word) in
        [("Feed", "mm/s"), ("Limit", "jerk"), ("Following error", "µm"), ("Contour error", "µm")]
    {
        browser.press(colour);
        let seen = picture();
        assert!(legend().contains(word), "{colour}: {}", legend());
        assert!(!pictures.contains(&seen), "{colour} looks like another one");
        pictures.push(seen);
    }
    // The scale ends at the run's greatest error.
    let greatest = number(&page.json["contour_error_um_max"]);
    assert_near(first_number(legend().strip_prefix('0').expect("its start")), greatest, 3, "the scale");
    // The actual path lies beside the set one.
    browser.run(
        "const s = document.querySelector('#path select'); s.value = '1000'; s.dispatchEvent(new Event('change'))",
    );
    assert!(!pictures.contains(&picture()) && legend().contains("error × 1000"));
    page.browser.close();
}

pub(crate) fn the_path_is_turned_and_pointed_at() {
    let workspace = Workspace::new("page-space");
    workspace
        .put("part.ngc", "G21 G90 G94 G61\nG0 Z8\nG1 X20 Y10 Z5 F3000\nX40 Y0 Z-5\nX40 Y25 Z-5\nG0 X0\nM2\n");
    workspace.stdout(&["run", "part.ngc", "--report", "part.html"]);
    let browser = Browser::open(&workspace.0.join("part.html"), DESK);
    let stage = browser.middle(".stage");
    let picture = || browser.after_frame("motion.path.sheet.canvas.toDataURL()");
    let first = picture();
    // Rapids are apart.
    assert!(browser.text("document.querySelector('#path .legend').textContent").contains("rapid"));
    let rapids = browser.run("return [...motion.run.blocks.isRapid]");
    assert_eq!(rapids, serde_json::json!([1, 0, 0, 0, 1]));
    // The scale ends at the feed of cutting moves.
    assert!(browser.text("document.querySelector('#path .legend').textContent").starts_with("050 mm/s"));
    let yaw = browser.number("motion.path.camera.yaw");
    browser.drag(&[stage, [stage[0] + 40.0, stage[1]], [stage[0] + 90.0, stage[1] + 30.0]]);
    assert_ne!(picture(), first);
    assert!((browser.number("motion.path.camera.yaw") - yaw - 90.0 / 150.0).abs() < 1e-9);
    // In space and in a plane the pointer finds the place of a tick, and the cursor goes there.
    for (view, tick) in [("", 600), ("XZ", 1_000)] {
        if !view.is_empty() {
            browser.press(view);
            browser.after_frame("0");
        }
        let place = browser.run(&format!(
            "const box = motion.path.stage.getBoundingClientRect(); \
             const [x, y] = motion.path.project(motion.run.placeAt({tick})); return [box.x + x, box.y + y]"
        ));
        let place = [0, 1].map(|i| number(&place[i]).round());
        browser.drag(&[place, place]);
        browser.after_frame("0");
        let away_px = browser.number(&format!(
            "(() => {{ const [a, b] = [motion.state.placed, {tick}].map((t) => motion.path.project(motion.run.placeAt(t))); \
             return Math.hypot(a[0] - b[0], a[1] - b[1]); }})()"
        ));
        assert!(browser.number("motion.state.placed") > 0.0 && away_px <= 1.5, "{view}: {away_px} px");
        // What is under the pointer stays there.
        let under = format!(
            "(() => {{ const [x, y] = motion.path.project(motion.run.placeAt({tick})); \
             const box = motion.path.stage.getBoundingClientRect(); return Math.hypot(box.x + x - {}, box.y + y - {}); }})()",
            place[0], place[1]
        );
        browser.wheel(place, -300);
        browser.after_frame("0");
        // It was half a pixel off at most, and is twice as much.
        assert!(browser.number(&under) <= 2.0, "{}", browser.number(&under));
    }
    browser.close();
}

pub(crate) fn worst_places_are_visited() {
    let page = Demonstration::new("worst", DESK);
    let browser = &page.browser;
    for (name, column) in [("jerk", "j_mm_s3"), ("following error of Y", "Y_err_um")] {
        browser.press(name);
        browser.run("document.querySelector('#worst .go').click()");
        let tick = browser.number("motion.state.cursor") as usize;
        let greatest = (0..page.ticks()).map(|tick| page.at(tick, column).abs()).fold(0.0, f64::max);
        assert!((page.at(tick, column).abs() - greatest).abs() <= 1e-6 * greatest, "{name}");
        let text = browser.text("document.querySelector('#worst .go').textContent");
        assert_near(first_number(&text).abs(), greatest, 6, name);
    }
    // No visit of a line comes twice.
    let lines = browser.run(
        "return [...document.querySelectorAll('#worst tbody tr')].map((r) => r.children[1].textContent)",
    );
    assert!(lines.as_array().expect("a list").len() >= 4, "{lines}");
    page.browser.close();
}

pub(crate) fn two_runs_lie_beside_each_other() {
    let workspace = Workspace::new("page-against");
    workspace.put("part.ngc", STRINGER);
    workspace.put("slow.ngc", &STRINGER.replace("F5000", "F2000"));
    let record = ["run", "slow.ngc", "--record", "slow.mrec", "--json"];
    let [part, slow] = [workspace.json(&["run", "part.ngc", "--json"]), workspace.json(&record)];
    assert!(number(&slow["time_s"]) > 1.2 * number(&part["time_s"]));
    for against in ["slow.ngc", "slow.mrec"] {
        workspace.stdout(&["run", "part.ngc", "--report", "part.html", "--against", against]);
        let browser = Browser::open(&workspace.0.join("part.html"), DESK);
        assert_eq!(browser.number("motion.state.runs.length"), 2.0);
        for (run, json) in [(0, &part), (1, &slow)] {
            let ticks = browser.number(&format!("motion.state.runs[{run}].ticks"));
            assert_eq!(ticks, number(&json["ticks"]), "{against}");
            let shown = browser.text(&format!(
                "document.querySelector('#tables tbody tr').children[{}].textContent",
                run + 1
            ));
            assert_near(first_number(&shown), ticks * number(&json["tick_s"]), 6, "time");
        }
        // Both are drawn in every plot, and the window holds the longer one.
        let drawn = browser.run(
            "return motion.plots.plots.slice(0, 3).map((plot) => plot.values.querySelector('output').textContent)",
        );
        assert!(drawn.to_string().contains(" | "), "{drawn}");
        let end_s = (number(&slow["ticks"]) - 1.0) * number(&slow["tick_s"]);
        assert!((browser.number("motion.state.to") - end_s).abs() < 1e-9);
        browser.close();
    }
    let refusal = workspace.refusal(&["run", "part.ngc", "--report", "part.html", "--against", "none.ngc"]);
    assert!(refusal.starts_with("none.ngc: found "), "{refusal}");
}

pub(crate) fn faults_and_commands_are_marked() {
    let workspace = Workspace::new("page-faults");
    workspace.put("part.ngc", STRINGER);
    let run = [
        "run",
        "part.ngc",
        "--report",
        "part.html",
        "--json",
        "--at",
        "600:override=0.6",
        "--inject",
        "2500:encoder-lost=Y",
    ];
    let json: Value = serde_json::from_str(&workspace.ending(1, &run).0).expect("JSON");
    let browser = Browser::open(&workspace.0.join("part.html"), DESK);
    assert!(browser.text("document.querySelector('.result').textContent").starts_with("Ended in a fault"));
    let tick = number(&json["faults"][0]["tick"]);
    assert_eq!(browser.number("motion.run.header.faults[0].tick"), tick);
    // In every plot there is a line in the ink of each mark where it belongs, and not beside it. All are looked at in one go:
    // the browser complains of canvases that are read more than once.
    let places = browser.run(&format!(
        "const ink = (name) => {{ \
           const hex = getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim().slice(1); \
           return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16)); }}; \
         return motion.plots.plots.slice(0, 4).map((plot) => {{ \
           const {{ canvas, context }} = plot.sheet; \
           const {{ data, width }} = context.getImageData(0, 0, canvas.width, canvas.height); \
           const pixels = (x, wanted) => {{ \
             let n = 0; \
             for (let i = 4 * x; i < data.length; i += 4 * width) \
               if (wanted.every((c, k) => Math.abs(c - data[i + k]) < 40) && data[i + 3] > 60) n += 1; \
             return n; }}; \
           return [['fault', {tick}], ['command', 600]].map(([name, tick]) => {{ \
             const at = Math.round(plot.px(motion.state.xOf(motion.run, tick))); \
             return [Math.max(pixels(at - 1, ink(name)), pixels(at, ink(name))), pixels(at - 60, ink(name))]; }}); }})"
    ));
    for mark in places.as_array().expect("a list").iter().flat_map(|plot| plot.as_array().expect("two")) {
        assert!(number(&mark[0]) > 40.0 && 4.0 * number(&mark[1]) < number(&mark[0]), "{places}");
    }
    browser.close();
}

pub(crate) fn a_phone_shows_all_of_it() {
    let page = Demonstration::new("phone", PHONE);
    let browser = &page.browser;
    assert_eq!(browser.number("innerWidth"), f64::from(PHONE[0]));
    assert!(browser.number("document.documentElement.scrollWidth") <= f64::from(PHONE[0]));
    for part in
        [".stage canvas", ".plot canvas", "#code .row", "#worst table", "#blocks table", "#overview canvas"]
    {
        let [x, _] = browser.middle(part);
        assert!(x > 0.0, "{part}");
        let height = format!("document.querySelector('{part}').getBoundingClientRect().height");
        assert!(browser.number(&height) >= 20.0, "{part}");
    }
    // The figures are there without a script, too.
    assert!(browser.holds("document.querySelectorAll('#headline dt').length >= 8"));
    page.browser.close();
}
