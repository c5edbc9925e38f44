//! Reports of experiments and of tuning: figures that are drawn from their data.

use serde_json::Value;

use crate::browser::Browser;
use crate::report::{DESK, PHONE, assert_near, first_number};
use crate::workspace::{Workspace, number};

const RIGHT: char = '\u{E014}';
const END: char = '\u{E010}';

/// A report of `motion` in a browser, and what it printed.
fn report(name: &str, arguments: &[&str], size: [u32; 2]) -> (Workspace, Value, Browser) {
    let workspace = Workspace::new(&format!("findings-{name}"));
    let json = workspace.json(&[arguments, &["--json", "--report", "page.html"]].concat());
    let browser = Browser::open(&workspace.0.join("page.html"), size);
    (workspace, json, browser)
}

/// The text of the value of a curve, by the graph's and the curve's number.
fn value(browser: &Browser, graph: usize, curve: usize) -> f64 {
    let of = format!("figures[0].graphs[{graph}].curves[{curve}].output.textContent");
    first_number(&browser.text(&of))
}

/// The cursor stands on what was measured, over a logarithmic axis.
pub(crate) fn the_cursor_reads_what_was_measured() {
    let bode = ["drive", "bode", "--points", "9", "--from", "1", "--to", "100"];
    let (_workspace, json, browser) = report("bode", &bode, DESK);
    // Decades are as wide as each other.
    let px = |hz: f64| browser.number(&format!("figures[0].graphs[0].axes.px(Math.log10({hz}))"));
    browser.after_frame("0");
    assert!((px(10.0) - px(1.0) - (px(100.0) - px(10.0))).abs() < 1e-6 && px(10.0) > px(1.0) + 100.0);
    let [left, top] = [0, 1].map(|way| {
        let of = "((b) => [b.x, b.y + b.height / 2])(figures[0].graphs[0].axes.area.getBoundingClientRect())";
        browser.number(&format!("{of}[{way}]"))
    });
    for (place, point) in json["points"].as_array().expect("points").iter().enumerate() {
        let hz = number(&point["frequency_hz"]);
        browser.point([left + px(hz), top]);
        browser.after_frame("0");
        assert_eq!(browser.number("figures[0].cursor"), place as f64);
        let told = browser.text("document.querySelector('.figure .place').textContent");
        assert_near(first_number(told.trim_start_matches("Frequency ")), hz, 5, &told);
        let db = |key: &str| 20.0 * number(&point[key]).log10();
        for (curve, key) in
            ["step_ratio", "swing_ratio", "fundamental_ratio", "linear_ratio"].into_iter().enumerate()
        {
            assert_near(value(&browser, 0, curve), db(key), 5, key);
        }
        for (curve, key) in
            ["step_phase_deg", "harmonic_phase_deg", "linear_phase_deg"].into_iter().enumerate()
        {
            assert_near(value(&browser, 1, curve), number(&point[key]), 5, key);
        }
    }
    // A wheel above the axes zooms around the pointer, keys move the cursor, 0 shows all.
    let width = || browser.number("figures[0].span.to - figures[0].span.from");
    assert!((width() - 2.0).abs() < 1e-9);
    let at = [left + px(10.0), top];
    browser.wheel(at, -200);
    browser.after_frame("0");
    assert!(width() < 1.3, "{}", width());
    assert!((left + px(10.0) - at[0]).abs() < 1.0, "the place under the pointer stays");
    browser.drag(&[at]);
    browser.keys(&RIGHT.to_string());
    assert_eq!(browser.number("figures[0].cursor"), 5.0);
    browser.keys(&END.to_string());
    assert_eq!(browser.number("figures[0].cursor"), 8.0);
    assert!(browser.number("figures[0].span.to") >= 2.0 - 1e-9, "the window follows the cursor");
    browser.keys("0");
    assert!((width() - 2.0).abs() < 1e-9);
    // Between two points, of which none is seen, the lines still are.
    browser.run("figures[0].span.show(0.3, 0.31)");
    browser.after_frame("0");
    let is_seen = "figures[0].graphs[0].curves.filter((curve) => !curve.isDots).every((curve) => \
                   ((axes, y) => y > axes.low && y < axes.high)(figures[0].graphs[0].axes, curve.at(0.305)))";
    assert!(browser.holds(is_seen));
    browser.close();
}

/// Errors around circles: the angle is picked, the deviation told, the picture zoomed and shown whole again.
pub(crate) fn circles_are_looked_into() {
    let circle = ["drive", "circle", "--from", "4", "--to", "5", "--show", "4", "--feedforward", "v,vaj"];
    let (_workspace, json, browser) = report("circle", &circle, DESK);
    browser.middle("[data-figure='1'] .area");
    browser.after_frame("0");
    let spot = |degrees: f64| {
        let of = format!(
            "((f, b) => [b.x + f.axes.px(f.at({degrees}, 0)[0]), b.y + f.axes.py(f.at({degrees}, 0)[1])])\
             (figures[1], figures[1].axes.area.getBoundingClientRect())"
        );
        [0, 1].map(|way| browser.number(&format!("{of}[{way}]")))
    };
    for degrees in [0.0, 90.0, -135.0] {
        browser.point(spot(degrees));
        let told = browser.text("figures[1].place.textContent");
        assert!((first_number(told.trim_start_matches("Angle ")) - degrees).abs() < 2.0, "{told}");
    }
    // The deviations that are drawn are within those that are told.
    for (index, sweep) in json["feedforward"].as_array().expect("two").iter().enumerate() {
        let most = browser
            .number(&format!("Math.max(...figures[1].figure.series[{index}].points.map(([, um]) => um))"));
        let told = number(&sweep["circles"][0]["contour_error_um_max"]);
        assert!(most <= told + 1e-9 && most > 0.8 * told, "{most} {told}");
    }
    let width = || browser.number("figures[1].view.to - figures[1].view.from");
    let whole = width();
    let at = spot(90.0);
    browser.wheel(at, -300);
    browser.after_frame("0");
    assert!(width() < 0.7 * whole);
    let now = spot(90.0);
    assert!((now[0] - at[0]).abs() < 1.5 && (now[1] - at[1]).abs() < 1.5, "{now:?} {at:?}");
    browser.drag(&[at]);
    // The cursor's dot is nowhere else than in the picture, and keys bring it there.
    browser.run("figures[1].shift(figures[1].home * 10, 0)");
    browser.after_frame("0");
    assert!(browser.holds("figures[1].axes.line.hidden"));
    browser.keys(&RIGHT.to_string());
    browser.after_frame("0");
    assert!(!browser.holds("figures[1].axes.line.hidden"));
    browser.keys("0");
    browser.after_frame("0");
    assert!((width() - whole).abs() < 1e-9);
    browser.close();
}

/// A refused tuning says so in red, on a phone and on paper, too, and nothing is wider than either.
pub(crate) fn a_refusal_is_red() {
    let workspace = Workspace::new("findings-refused");
    workspace.put("gentle.ngc", "G21 G90 F300\nG4 P0.3\nG1 Y2\nG4 P0.3\nG1 Y0\nG4 P0.3\nM2\n");
    workspace.stdout(&["run", "gentle.ngc", "--record", "gentle.mrec"]);
    let tune = ["drive", "tune", "--axis", "Y", "--from", "gentle.mrec", "--report", "page.html", "--json"];
    let (json, _) = workspace.ending(1, &tune);
    let json: Value = serde_json::from_str(&json).expect("JSON");
    let browser = Browser::open(&workspace.0.join("page.html"), PHONE);
    let said = browser.text("document.querySelector('.result').textContent");
    assert!(
        said.starts_with("Not tuned: ") && said.contains(json["reason"].as_str().expect("words")),
        "{said}"
    );
    let border = "getComputedStyle(document.querySelector('.result')).borderLeftColor";
    let red = "(() => { const e = document.body.appendChild(document.createElement('i')); e.style.color = 'var(--bad)'; \
               const c = getComputedStyle(e).color; e.remove(); return c; })()";
    assert_eq!(browser.text(border), browser.text(red));
    assert!(browser.holds("document.documentElement.scrollWidth <= innerWidth"));
    browser.run("dispatchEvent(new Event('beforeprint'))");
    assert_eq!(browser.text("document.documentElement.dataset.theme"), "light");
    // Drawn whole, on light paper, though it may not have been seen.
    browser.after_frame("0");
    assert!(browser.holds("figures.every((figure) => !figure.isOld)"));
    browser.run("dispatchEvent(new Event('afterprint'))");
    browser.close();
}

/// The points of a spline, on a phone.
pub(crate) fn points_are_drawn_beside_their_spline() {
    let workspace = Workspace::new("findings-spline");
    let row = |i: u32| {
        let t = f64::from(i) * 0.1;
        format!("{:.6},{:.6},0\n", 20.0 * t.cos() - 20.0, 12.0 * t.sin() + 0.02 * (2.4 * f64::from(i)).sin())
    };
    let rows: String = (0..60).map(row).collect();
    workspace.put("points.csv", &format!("x_mm,y_mm,z_mm\n{rows}"));
    let spline = ["spline", "points.csv", "--tolerance", "0.02", "--json", "--report", "page.html"];
    let json = workspace.json(&spline);
    let browser = Browser::open(&workspace.0.join("page.html"), PHONE);
    assert!(browser.holds("document.documentElement.scrollWidth <= innerWidth"));
    assert_eq!(browser.number("figures.length"), 2.0);
    browser.middle("[data-figure='0'] .area");
    browser.after_frame("0");
    let deviations = browser
        .run("return figures[0].figure.told.find(({quantity}) => quantity.name === 'Deviation').values");
    let deviations: Vec<f64> = deviations.as_array().expect("a list").iter().map(number).collect();
    let most = deviations.iter().copied().fold(0.0, f64::max);
    assert!((most / (1e3 * number(&json["spline"]["deviation_mm"])) - 1.0).abs() < 1e-9, "{most}");
    for place in [7, 33] {
        browser.run(&format!("figures[0].moveTo({place}, true)"));
        let told = browser.text("document.querySelector('.told output[data-of=Deviation]').textContent");
        assert_near(first_number(&told), deviations[place], 6, "a point's deviation");
        let told = browser.text("document.querySelector('.told output[data-of=Line]').textContent");
        assert_eq!(first_number(&told), place as f64 + 2.0);
    }
    browser.close();
}
