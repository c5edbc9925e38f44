//! The operator's panel in a browser: of the simulated machine, at the pace of the clock.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use crate::browser::Browser;

/// WebDriver's name for the key.
const RIGHT: char = '\u{e014}';

/// Three sides of a square, with a stop in between.
const PROGRAM: &str = "G21 G90 G61\nG1 X10 F3000\nY10\n(MSG, turn the part)\nM0\nX0\nM2\n";

/// A panel, until it is dropped.
struct Panel {
    child: Child,
    address: String,
}

impl Panel {
    fn start(listen: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_motion"))
            .args(["panel", "--listen", listen])
            .stdout(Stdio::piped())
            .spawn()
            .expect("motion starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("text");
        let (_, address) = line.trim().rsplit_once(' ').expect(&line);
        Self { child, address: address.to_owned() }
    }
}

impl Drop for Panel {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn open(panel: &Panel, size: [u32; 2]) -> Browser {
    let browser = Browser::open_address(&panel.address, size);
    wait(&browser, "document.querySelector('.state b').textContent === 'drives off'");
    browser
}

fn wait(browser: &Browser, expression: &str) {
    browser.wait_for(&format!("return ({expression}) ? true : null"));
}

fn state(words: &str) -> String {
    format!("document.querySelector('.state b').textContent === '{words}'")
}

fn messages(browser: &Browser) -> String {
    browser.text("[...document.querySelectorAll('.events li')].map((item) => item.textContent).join('; ')")
}

/// Drops a file on the page.
fn drop_file(browser: &Browser, name: &str, text: &str) {
    let (name, text) = (serde_json::json!(name), serde_json::json!(text));
    browser.run(&format!(
        "const files = new DataTransfer(); files.items.add(new File([{text}], {name})); \
         document.body.dispatchEvent(new DragEvent('drop', {{ dataTransfer: files, bubbles: true, cancelable: true }}))"
    ));
}

pub(crate) fn a_program_is_driven_from_the_panel() {
    let panel = Panel::start("127.0.0.1:0");
    let browser = open(&panel, [1400, 1000]);
    browser.press("Drives on");
    wait(&browser, &state("ready"));
    drop_file(&browser, "wrong.ngc", "G21 G90\nG1 X5 Q\n");
    wait(&browser, "document.querySelector('.events .failure')");
    assert!(messages(&browser).starts_with("wrong.ngc:2:"), "{}", messages(&browser));
    drop_file(&browser, "part.ngc", PROGRAM);
    // The picture of it, too.
    wait(&browser, "window.panel.pictures.page?.run.header.program === 'part.ngc'");
    assert!(browser.number("window.panel.pictures.page.run.header.length_mm") == 30.0);
    // A tenth as fast, by the keys that LinuxCNC's operators know: a browser that is late holds it on its way, too. A file that
    // was chosen has the focus no more.
    browser.run("document.querySelector('input[type=file]').focus(); document.activeElement.dispatchEvent(new Event('change'))");
    browser.keys("1");
    wait(&browser, "document.querySelector('[data-of=override]').textContent === '10 %'");
    browser.keys("r");
    wait(&browser, "parseFloat(document.querySelector('.positions td').textContent) > 1");
    browser.keys("p");
    wait(&browser, &state("held"));
    let x_mm = browser.number("parseFloat(document.querySelector('.positions td').textContent)");
    assert!(x_mm > 1.0 && x_mm < 10.0, "{x_mm}");
    // The cursor stands where the machine does.
    let cursor_mm =
        browser.number("window.panel.pictures.page.run.placeAt(window.panel.pictures.page.state.cursor)[0]");
    assert!((cursor_mm - x_mm).abs() < 0.05, "{cursor_mm} {x_mm}");
    browser.keys("s");
    wait(&browser, &state("program stop"));
    assert!(messages(&browser).contains("turn the part"), "{}", messages(&browser));
    browser.press("Resume");
    wait(&browser, &state("idle"));
    wait(&browser, "document.querySelector('.events').textContent.includes('the program is done')");
    // A machine that faults says so; here it is switched off.
    browser.press("Drives off");
    wait(&browser, &state("drives off"));
    browser.close();
}

pub(crate) fn a_key_jogs_while_it_is_down() {
    let panel = Panel::start("127.0.0.1:0");
    let browser = open(&panel, [390, 844]);
    browser.press("Drives on");
    wait(&browser, &state("ready"));
    browser.run("document.querySelector('[data-of=distance]').value = '1'");
    let place = browser.middle("[data-key='Y+']");
    browser.drag(&[place, place]);
    wait(&browser, "document.querySelectorAll('.positions td')[2].textContent === '1.000 mm'");
    // Positions are shown to a micrometre: 1.000 is there before the jog has ended, and a key is refused until then.
    wait(
        &browser,
        &format!("{} && document.querySelector('[data-of=detail]').textContent === ''", state("idle")),
    );
    browser.run("document.querySelector('[data-of=distance]').value = ''; document.activeElement.blur()");
    browser.key_down(RIGHT);
    wait(&browser, "parseFloat(document.querySelector('.positions td').textContent) > 0");
    browser.key_up(RIGHT);
    wait(&browser, &state("ready"));
    let x_mm = browser.number("parseFloat(document.querySelector('.positions td').textContent)");
    assert!(x_mm > 0.0 && x_mm < 900.0, "{x_mm}");
    // The page is no wider than a phone.
    assert!(browser.holds("document.documentElement.scrollWidth <= 390"));
    // Ticks around the next motion.
    browser.run(
        "window.panel.controls.field('trigger').value = 'v_mm_s>5'; window.panel.controls.field('before').value = 100",
    );
    browser.press("Capture");
    wait(&browser, "window.panel.controls.state.is_capturing");
    browser.run("document.querySelector('[data-of=distance]').value = '10'");
    let place = browser.middle("[data-key='Y+']");
    browser.drag(&[place, place]);
    wait(&browser, "window.panel.pictures.shown === 'capture'");
    let ticks = browser.number("window.panel.pictures.page.run.ticks");
    assert!(ticks > 2100.0, "{ticks}");
    // 100 before the first one that is faster.
    let at = "(() => { const { run } = window.panel.pictures.page; const feed = run.quantity('feed'); \
              for (let i = 0; i < run.samples; i += 1) if (feed.range(i, i + 1) && feed.high > 5) return i; return -1; })()";
    assert_eq!(browser.number(at), 100.0);
    browser.close();
}

pub(crate) fn tabs_share_a_machine_and_come_back_to_it() {
    let panel = Panel::start("127.0.0.1:0");
    let first = open(&panel, [1000, 800]);
    let second = open(&panel, [1000, 800]);
    first.press("Drives on");
    wait(&second, &state("ready"));
    wait(&second, "document.querySelector('[data-of=commander]').textContent === 'Another tab commands.'");
    second.run("window.panel.controls.say('override', { permille: 500 })");
    wait(&second, "document.querySelector('.events .refused')");
    // Any may stop it.
    drop_file(&first, "part.ngc", "G21 G90 G61\nG1 X400 F3000\nM2\n");
    wait(&first, "window.panel.controls.state.program === 'part.ngc'");
    first.press("Start");
    wait(&second, &state("moving"));
    second.press("Hold");
    wait(&first, &state("held"));
    first.close();
    second.close();
    // The panel is started anew.
    let listen = panel.address.trim_start_matches("http://").trim_end_matches('/').to_owned();
    // Its tab is not closed: it complains of a server that is not there.
    let browser = Browser::open_address(&panel.address, [1000, 800]);
    wait(&browser, &state("held"));
    drop(panel);
    wait(&browser, &state("no server"));
    let _again = Panel::start(&listen);
    wait(&browser, &state("drives off"));
    browser.press("Drives on");
    wait(&browser, &state("ready"));
}
