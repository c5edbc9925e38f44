//! The playground of `motion page`: what its module computes is what `motion` computes, to the bit.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use motion_host::machine::REFERENCE_TOML;
use motion_host::playground::Task;
use motion_tests::random::Random;
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::report::{DESK, PHONE, assert_near, first_number};
use crate::workspace::{STRINGER, Workspace, number, profile};

/// Programs whose digests are compared.
const PROGRAMS: usize = 50;
/// The greatest size of the page \[bytes\].
const PAGE_BYTES_MAX: u64 = 2 << 20;

fn script() -> Command {
    let mut command = Command::new("bash");
    command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/wasm/build"));
    command
}

/// Why the module can't be built, if it can't.
pub(crate) fn missing() -> Option<String> {
    let checked = script().arg("--check").output().expect("bash starts");
    (!checked.status.success()).then(|| String::from_utf8_lossy(&checked.stdout).trim().to_owned())
}

/// The module, built: nothing is done where it is.
fn module() -> PathBuf {
    static BUILT: OnceLock<()> = OnceLock::new();
    BUILT.get_or_init(|| {
        let built = script().output().expect("bash starts");
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    });
    concat!(env!("CARGO_MANIFEST_DIR"), "/../target/page/motion.wasm").into()
}

/// The playground in a browser.
struct Playground {
    workspace: Workspace,
    browser: Browser,
}

impl Playground {
    fn new(name: &str, size: [u32; 2]) -> Self {
        module();
        let workspace = Workspace::new(&format!("playground-{name}"));
        workspace.put("part.ngc", STRINGER);
        workspace.put("mine.toml", REFERENCE_TOML);
        workspace.stdout(&["page", "part.ngc", "--machine", "mine.toml", "--output", "page.html"]);
        let browser = Browser::open(&workspace.0.join("page.html"), size);
        Self { workspace, browser }
    }

    /// Does something on the page, and waits for the next answer.
    fn after(&self, script: &str) {
        let shown = self.browser.number("playground.shown");
        self.browser.run(script);
        self.browser.wait_for(&format!("return playground.shown > {shown} ? true : null"));
    }

    /// The kinds of the figures that are drawn.
    fn drawn(&self) -> Vec<String> {
        let kinds = self.browser.run(
            "return playground.figures.map((of) => (of.graphs ? 'stack' : of.curves ? 'polar' : 'plane'))",
        );
        let kinds = kinds.as_array().expect("a list").iter();
        kinds.map(|kind| kind.as_str().expect("text").to_owned()).collect()
    }

    /// A figure of the page, by its name.
    fn figure(&self, name: &str) -> f64 {
        let of = format!("[...document.querySelectorAll('dt')].find((e) => e.textContent === '{name}')");
        first_number(&self.browser.text(&format!("{of}.nextElementSibling.textContent")))
    }

    /// The page shows what `motion run` says of a program on a machine.
    fn assert_shows(&self, program: &str, machine: &str) {
        self.workspace.put("shown.ngc", program);
        self.workspace.put("shown.toml", machine);
        let run = self.workspace.json(&["run", "shown.ngc", "--machine", "shown.toml", "--json"]);
        let max = |key: &str| number(&run["max"][key]);
        for (name, value, digits) in [
            ("Path length", number(&run["path_length_mm"]), 6),
            ("Executed time", number(&run["ticks"]) * number(&run["tick_s"]), 4),
            ("Highest feed", max("feed_mm_s"), 4),
            ("Highest acceleration", max("accel_mm_s2"), 4),
            ("Highest jerk", max("jerk_mm_s3"), 4),
            ("Highest snap", max("snap_mm_s4"), 4),
            ("Highest contour error", number(&run["contour_error_um_max"]), 3),
        ] {
            assert_near(self.figure(name), value, digits, name);
        }
        let ticks = self.browser.number("playground.page.run.ticks");
        assert!((ticks - number(&run["ticks"])).abs() < 0.5, "{ticks}");
    }

    fn machine(&self) -> String {
        self.browser.text("document.getElementById('machine-text').value")
    }

    fn status(&self) -> String {
        self.browser.text("document.querySelector('#status output').textContent")
    }
}

/// A program of some lines, arcs, dwells, stops and blends in space.
fn random_program(random: &mut Random) -> String {
    let mut text = format!("G21 G90 F{:.0}\n", random.log(300.0, 12_000.0));
    // Cannot fail.
    let _ = match random.below(3) {
        0 => writeln!(text, "G61"),
        1 => writeln!(text, "G64 P{:.3}", random.log(0.005, 0.5)),
        _ => Ok(()),
    };
    let mut place = [0.0; 3];
    for _ in 0..3 + random.below(12) {
        let step = random.log(0.05, 20.0);
        let to = place.map(|from: f64| from + step * random.between(-1.0, 1.0));
        let [x, y, z] = to;
        let _ = match random.below(8) {
            0 => writeln!(text, "G4 P{:.3}", random.between(0.0, 0.05)),
            1 => writeln!(text, "G0 X{x:.4} Y{y:.4} Z{z:.4}"),
            2 => writeln!(text, "G{} X{x:.4} Y{y:.4} R{:.4}", 2 + random.below(2), 20.0 * step),
            _ => writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4}"),
        };
        place = to;
    }
    text + "M2\n"
}

/// Requests of the demonstration and of generated programs, some of them on machines with other numbers.
fn requests() -> Vec<Value> {
    let mut random = Random::of_stream(53);
    let of = |program: &str, edits: Value| {
        json!({
            "do": "run", "name": "part.ngc", "program": program,
            "machine_name": "m.toml", "machine": REFERENCE_TOML, "edits": edits,
        })
    };
    let mut requests = vec![of(STRINGER, json!([]))];
    for _ in 0..PROGRAMS {
        let edits = json!([
            {"table": "path", "key": "jerk_mm_s3", "value": random.log(1e3, 1e5)},
            {"table": "axis.regulator", "key": "kp_per_s", "axis": 1, "value": random.between(50.0, 250.0)},
            {"table": "axis.drive", "key": "coulomb_friction_mm_s2", "value": random.between(0.0, 300.0)},
        ]);
        let edits = if random.once_in(2) { edits } else { json!([]) };
        requests.push(of(&random_program(&mut random), edits));
    }
    requests
}

/// The digest of an answer, or what was refused.
fn told(answer: &Value) -> String {
    let [digest, error] = ["digest", "error"].map(|key| answer[key].as_str());
    digest.or(error).unwrap_or_else(|| panic!("{answer} is no answer")).to_owned()
}

fn natively(request: &Value) -> String {
    let mut task = Task::new(request.to_string().as_bytes());
    while task.advance() {}
    let (length, rest) = task.answer().split_first_chunk().expect("a length");
    told(&serde_json::from_slice(&rest[..u32::from_le_bytes(*length) as usize]).expect("JSON"))
}

/// Compares the answers of a module with those of this machine's own code.
fn assert_same_bits(requests: &[Value], answers: &Value) {
    let answers = answers.as_array().expect("a list");
    assert_eq!(answers.len(), requests.len());
    for (request, answer) in requests.iter().zip(answers) {
        assert_eq!(told(answer), natively(request), "{} {}", request["edits"], request["program"]);
    }
    let digests = answers.iter().filter(|answer| answer["digest"].is_string()).count();
    assert!(10 * digests >= 9 * requests.len(), "{digests} of {} programs were run", requests.len());
}

/// The browser, and the module within the page.
pub(crate) fn the_browser_has_the_same_bits() {
    let page = Playground::new("bits", DESK);
    let requests = requests();
    let answers = page.browser.module(&format!(
        "const answers = []; for (const request of {}) answers.push((await playground.engine.ask(request)).header); done(answers)",
        json!(requests)
    ));
    assert_same_bits(&requests, &answers);
    page.browser.close();
}

/// Node, where it is installed, and nothing else: the module imports nothing.
pub(crate) fn node_has_the_same_bits() {
    let requests = requests();
    let mut node = Command::new("node")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/page/module.mjs"))
        .arg(module())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("node starts");
    let mut input = node.stdin.take().expect("its input");
    input.write_all(json!(requests).to_string().as_bytes()).expect("node reads");
    drop(input);
    let output = node.wait_with_output().expect("node ends");
    assert!(output.status.success());
    let told: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(told["imports"], json!([]));
    assert_same_bits(&requests, &told["answers"]);
}

/// Why node can't be asked, if it can't.
pub(crate) fn node_missing() -> Option<String> {
    let tried = Command::new("node").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    (!tried.is_ok_and(|status| status.success())).then(|| "node is not installed".to_owned())
}

pub(crate) fn it_runs_what_it_is_given() {
    let page = Playground::new("given", DESK);
    let size = std::fs::metadata(page.workspace.0.join("page.html")).expect("a page").len();
    assert!(size <= PAGE_BYTES_MAX, "the page has {size} bytes");
    page.assert_shows(STRINGER, REFERENCE_TOML);
    assert_eq!(page.machine(), REFERENCE_TOML);
    assert_eq!(page.browser.text("document.getElementById('program-text').value"), STRINGER);
    assert_eq!(page.browser.text("document.querySelector('h1').textContent"), "part.ngc");
    page.browser.close();
}

pub(crate) fn sliders_change_the_machine() {
    let page = Playground::new("sliders", DESK);
    let browser = &page.browser;
    // What the reader chose of the plots stays.
    browser.run("playground.page.state.show(0.5, 0.9); playground.page.state.place(1500)");
    let slide = |key: &str, part: f64| {
        page.after(&format!(
            "const slider = document.querySelector('input[data-key={key}]'); slider.value = {}; \
             slider.dispatchEvent(new Event('input', {{bubbles: true}}))",
            1000.0 * part
        ));
    };
    slide("accel_mm_s2", 0.3);
    let machine = page.machine();
    // 10 · 1000^0.3, to three digits; of the path and of every axis.
    assert_eq!(machine.matches("\naccel_mm_s2 = 79.4\n").count(), 4, "{machine}");
    page.assert_shows(STRINGER, &machine);
    let [from, to] = ["from", "to"].map(|end| browser.number(&format!("playground.page.state.{end}")));
    assert!((from - 0.5).abs() < 1e-9 && (to - 0.9).abs() < 1e-9, "{from} {to}");
    assert!((browser.number("playground.page.state.cursor") - 1500.0).abs() < 0.5);
    // Of the path alone.
    browser.run("document.querySelector('#sliders input[type=checkbox]').click()");
    slide("jerk_mm_s3", 0.25);
    assert_eq!(page.machine().matches("\njerk_mm_s3 = 1000").count(), 1);
    // Of one axis.
    browser.press("Regulator");
    browser.run(
        "const axis = document.querySelector('#sliders select'); axis.value = '1'; \
         axis.dispatchEvent(new Event('change'))",
    );
    slide("kp_per_s", 0.25);
    let machine = page.machine();
    assert_eq!(machine.matches("\nkp_per_s = 150").count(), 1, "{machine}");
    page.assert_shows(STRINGER, &machine);
    page.browser.close();
}

/// Drops a file on the page.
fn drop_of(name: &str, text: &str) -> String {
    format!(
        "const files = new DataTransfer(); files.items.add(new File([{}], {})); \
         document.body.dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: files}}))",
        json!(text),
        json!(name)
    )
}

pub(crate) fn files_are_dropped() {
    const PROGRAM: &str = "G21 G90 F6000 G64 P0.1\nG1 X60\nG1 Y40 Z3\nG2 X30 Y10 R50\nM2\n";
    let page = Playground::new("drop", DESK);
    page.after(&drop_of("other.ngc", PROGRAM));
    page.assert_shows(PROGRAM, REFERENCE_TOML);
    assert_eq!(page.browser.text("document.querySelector('h1').textContent"), "other.ngc");
    assert_eq!(page.browser.text("document.getElementById('program-text').value"), PROGRAM);
    let machine = REFERENCE_TOML.replace("\njerk_mm_s3 = 5000.0", "\njerk_mm_s3 = 9000.0");
    page.after(&drop_of("other.toml", &machine));
    page.assert_shows(PROGRAM, &machine);
    // Pasted beside the editor.
    page.after(&format!(
        "const data = new DataTransfer(); data.setData('text', {}); \
         document.body.dispatchEvent(new ClipboardEvent('paste', {{bubbles: true, clipboardData: data}}))",
        json!(STRINGER)
    ));
    page.assert_shows(STRINGER, &machine);
    page.browser.close();
}

/// Types a program.
fn typed(program: &str) -> String {
    format!(
        "const text = document.getElementById('program-text'); text.value = {}; \
         text.dispatchEvent(new Event('input', {{bubbles: true}}))",
        json!(program)
    )
}

pub(crate) fn refusals_are_shown() {
    let page = Playground::new("refusals", DESK);
    page.after(&typed("G1 X1 F100\nG1 XA\n"));
    page.workspace.put("part.ngc", "G1 X1 F100\nG1 XA\n");
    assert_eq!(page.status(), page.workspace.refusal(&["run", "part.ngc"]));
    let selected = "(({value, selectionStart, selectionEnd}) => value.slice(selectionStart, selectionEnd))(document.getElementById('program-text'))";
    assert_eq!(page.browser.text(selected), "G1 XA");
    page.after(&drop_of("slow.toml", &REFERENCE_TOML.replacen("tick_s = 0.0005", "tick_s = 0.0", 1)));
    assert!(page.status().contains("found tick_s = 0.0, expected a number from 0.00002 to 0.02"));
    // And back.
    page.after(&drop_of("mine.toml", REFERENCE_TOML));
    page.after(&typed(STRINGER));
    assert_eq!(page.status(), "");
    page.assert_shows(STRINGER, REFERENCE_TOML);
    page.browser.close();
}

pub(crate) fn a_long_run_is_cancelled() {
    let page = Playground::new("cancel", DESK);
    // Two million ticks.
    page.browser.run(&typed("G21 G90 F60\nG1 X500\nG1 X0\nM2\n"));
    page.browser.wait_for("return document.getElementById('cancel').hidden ? null : true");
    let progress = page.status();
    assert!(progress.ends_with(" %"), "{progress}");
    assert!(page.browser.number("document.querySelector('progress').value") < 0.9);
    page.browser.press("Cancel");
    assert_eq!(page.status(), "Cancelled. What is shown is the result before.");
    page.after(&typed(STRINGER));
    page.assert_shows(STRINGER, REFERENCE_TOML);
    page.browser.close();
}

pub(crate) fn a_ramp_is_that_of_profile() {
    let page = Playground::new("ramp", DESK);
    page.after("document.querySelector('button[data-sheet=ramp]').click()");
    for law in ["plateau", "sin2"] {
        page.after(&format!(
            "const ramp = document.getElementById('ramp'); ramp.elements.law.value = '{law}'; \
             ramp.elements.to_mm_s.value = '150'; ramp.dispatchEvent(new Event('input'))"
        ));
        let of_profile = page.workspace.json(&profile("0", "150", &["--law", law, "--json"]));
        for (name, key) in
            [("Duration t_p", "tp_s"), ("Length", "length_mm"), ("Peak jerk", "peak_jerk_mm_s3")]
        {
            assert_near(page.figure(name), number(&of_profile[key]), 6, name);
        }
        let last = "(({run}) => run.quantity('feed').range(run.samples - 1, run.samples) && run.quantity('feed').high)(playground.page)";
        assert_near(page.browser.number(last), 150.0, 4, "the last feed");
    }
    page.browser.close();
}

/// What the page tells of an experiment, by title of the table and place in it.
struct Told(Value);

impl Told {
    fn of(page: &Playground, experiment: &str, axis: usize) -> Self {
        page.after(&format!(
            "const form = document.getElementById('drive'); form.elements.experiment.value = '{experiment}'; \
             form.elements.axis.value = '{axis}'; form.querySelector('button').click()"
        ));
        assert_eq!(page.status(), "");
        let tables = "return [...document.querySelectorAll('#headline section')].map((section) => ({\
             title: section.querySelector('h2').textContent, \
             rows: [...section.querySelectorAll('tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))}))";
        Self(page.browser.run(tables))
    }

    fn text(&self, table: usize, row: usize, column: usize) -> &str {
        let text = self.0[table]["rows"][row][column].as_str();
        text.unwrap_or_else(|| panic!("{table} {row} {column} of {}", self.0))
    }

    /// The page shows a figure in a cell.
    fn assert_at(&self, [table, row, column]: [usize; 3], value: &Value) {
        let shown = first_number(self.text(table, row, column));
        if number(value).abs() > 1e-9 {
            assert_near(shown, number(value), 5, &format!("{table} {row} {column}"));
        } else {
            assert!(shown.abs() <= 1e-9, "{shown}");
        }
    }
}

pub(crate) fn drives_are_measured() {
    let page = Playground::new("drives", DESK);
    page.browser.press("Drive");
    let machine =
        |of: &[&str]| page.workspace.json(&[&["drive"], of, &["--machine", "mine.toml", "--json"]].concat());
    let told = Told::of(&page, "step", 1);
    let step = machine(&["step", "--axis", "Y"]);
    let keys = [
        "delay_ms",
        "time_constant_ms",
        "overshoot_percent",
        "settling_ms",
        "peak_accel_m_s2",
        "peak_jerk_m_s3",
    ];
    for (row, key) in keys.into_iter().enumerate() {
        told.assert_at([0, row, 1], &step[key]);
    }
    assert_eq!(page.drawn(), ["stack", "stack"]);
    let told = Told::of(&page, "harmonic", 0);
    let harmonic = machine(&["harmonic"]);
    for row in 0..10 {
        let point = &harmonic["axes"][0]["points"][row];
        for (column, key) in
            ["frequency_hz", "swing_ratio", "fundamental_ratio", "phase_deg"].into_iter().enumerate()
        {
            told.assert_at([0, row, column], &point[key]);
        }
    }
    assert_eq!(page.drawn(), ["stack"]);
    let swing = page.browser.number("playground.figures[0].graphs[0].curves[0].y[3]");
    let ratio = number(&harmonic["axes"][0]["points"][3]["swing_ratio"]);
    assert!((swing - 20.0 * ratio.log10()).abs() < 1e-9, "{swing} {ratio}");
    let told = Told::of(&page, "circle", 0);
    assert_eq!(page.drawn(), ["stack", "polar", "stack", "polar", "stack"]);
    let circles = machine(&["circle", "--from", "4", "--to", "4", "--feedforward", "v,va,as-is"]);
    for table in 0..3 {
        let circle = &circles["feedforward"][table]["circles"][0];
        let keys = [
            "radius_mm",
            "contour_error_um",
            "form_deviation_um",
            "following_error_x_um",
            "following_error_y_um",
        ];
        for (column, key) in keys.into_iter().enumerate() {
            told.assert_at([table, 2, 1 + column], &circle[key]);
        }
    }
    let told = Told::of(&page, "inertia", 0);
    let loads = machine(&["inertia"]);
    for row in 0..4 {
        told.assert_at([0, row, 5], &loads["loads"][row]["peak_accel_m_s2"]);
        told.assert_at([0, row, 6], &loads["loads"][row]["plateau_accel_m_s2"]);
        let acts = loads["loads"][row]["is_limited"] == true;
        assert_eq!(told.text(0, row, 7) == "acts", acts);
    }
    page.browser.close();
}

pub(crate) fn axes_are_tuned() {
    let page = Playground::new("tuning", DESK);
    page.browser.press("Drive");
    let told = Told::of(&page, "tune", 0);
    let tuned =
        page.workspace.json(&["drive", "tune", "--machine", "mine.toml", "--output", "tuned.toml", "--json"]);
    for axis in 0..3 {
        let changes = tuned["axes"][axis]["changes"].as_array().expect("a list");
        assert!(changes.len() > 5);
        for (row, change) in changes.iter().enumerate() {
            assert_eq!(told.text(axis, row, 0), change["key"].as_str().expect("a key"));
            assert_eq!(told.text(axis, row, 4), change["reason"].as_str().expect("a reason"));
        }
    }
    let circles = tuned["verification"]["circles"].as_array().expect("a list");
    assert_eq!(circles.len(), 12);
    assert_eq!(page.drawn().iter().filter(|kind| *kind == "polar").count(), 12);
    assert_eq!(page.drawn().len(), 2 * 3 + 2 * 12);
    for (index, circle) in circles.iter().enumerate() {
        let (table, row) = (3 + index / 6, index % 6);
        told.assert_at([table, row, 1], &circle["feed_mm_min"]);
        told.assert_at([table, row, 2], &circle["before"]["contour_error_um"]);
        told.assert_at([table, row, 3], &circle["after"]["contour_error_um"]);
    }
    // What the page takes is the file that the command writes.
    page.after("document.querySelector('.take').click()");
    assert_eq!(page.machine(), page.workspace.read("tuned.toml"));
    page.assert_shows(STRINGER, &page.machine());
    page.browser.close();
}

pub(crate) fn a_phone_shows_the_playground() {
    let page = Playground::new("phone", PHONE);
    page.assert_shows(STRINGER, REFERENCE_TOML);
    let browser = &page.browser;
    assert!(browser.holds("document.documentElement.scrollWidth <= innerWidth"));
    assert!(browser.number("document.getElementById('program-text').clientWidth") > 300.0);
    page.browser.close();
}
