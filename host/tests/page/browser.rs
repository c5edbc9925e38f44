//! A headless Chromium that does what a reader does: it opens a page, points, drags, turns the wheel, presses keys.
//!
//! Speaks WebDriver to `chromedriver`: JSON over HTTP.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

/// Programs that have to be installed.
const PROGRAMS: [&str; 2] = ["chromedriver", "chromium"];

/// A browser with one page.
pub(crate) struct Browser {
    driver: Child,
    session: String,
}

/// Why there is no browser, if there is none.
pub(crate) fn missing() -> Option<String> {
    let has = |program: &str| {
        let tried =
            Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        tried.is_ok_and(|status| status.success())
    };
    PROGRAMS.into_iter().find(|program| !has(program)).map(|program| format!("{program} is not installed"))
}

impl Browser {
    /// Opens a page in a window of this size [px], and waits until its script has made it.
    pub(crate) fn open(page: &Path, size: [u32; 2]) -> Self {
        Self::open_address(&format!("file://{}", page.display()), size)
    }

    /// The same of an address.
    pub(crate) fn open_address(address: &str, [width, height]: [u32; 2]) -> Self {
        let mut driver = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver starts");
        let out = BufReader::new(driver.stdout.take().expect("its output"));
        let port = out.lines().find_map(|line| {
            let line = line.expect("text");
            let (_, port) = line.split_once("started successfully on port ")?;
            Some(port.trim_end_matches('.').to_owned())
        });
        let root = format!("http://127.0.0.1:{}/session", port.expect("a port"));
        let arguments = [
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--force-device-scale-factor=1",
            "--hide-scrollbars",
            &format!("--window-size={width},{height}"),
        ];
        let wanted = json!({"capabilities": {"alwaysMatch": {
            "goog:chromeOptions": {"args": arguments},
            "goog:loggingPrefs": {"browser": "ALL"},
        }}});
        let made = post(&root, &wanted);
        let session = format!("{root}/{}", made["sessionId"].as_str().expect("a session"));
        let browser = Self { driver, session };
        // A phone's width is below a window's least.
        let metrics =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500});
        browser.call(
            "goog/cdp/execute",
            json!({"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics}),
        );
        browser.call("timeouts", json!({"script": 300_000}));
        browser.call("url", json!({"url": address}));
        let state = browser.wait_for("return document.documentElement.dataset.state || null");
        assert_eq!(state, "ready", "{:?}", browser.complaints());
        browser
    }

    fn call(&self, command: &str, body: Value) -> Value {
        post(&format!("{}/{command}", self.session), &body)
    }

    /// What a script returns.
    pub(crate) fn run(&self, script: &str) -> Value {
        self.call("execute/sync", json!({"script": script, "args": []}))
    }

    /// What an expression has after the frame that is due.
    pub(crate) fn after_frame(&self, expression: &str) -> Value {
        let script = format!(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done({expression})))"
        );
        self.call("execute/async", json!({"script": script, "args": []}))
    }

    /// What a module's code passes to `done`.
    pub(crate) fn module(&self, script: &str) -> Value {
        let script = format!(
            "const done = arguments[0]; (async () => {{ {script} }})().catch((e) => done(String(e)))"
        );
        self.call("execute/async", json!({"script": script, "args": []}))
    }

    /// The first thing other than null that a script returns. The driver's time limit ends the waiting.
    pub(crate) fn wait_for(&self, script: &str) -> Value {
        let script = format!(
            "const done = arguments[0]; const look = () => {{ const found = (() => {{ {script} }})(); \
             if (found === null) setTimeout(look, 20); else done(found); }}; look()"
        );
        self.call("execute/async", json!({"script": script, "args": []}))
    }

    /// Middle of the first element that a selector finds, scrolled into view.
    pub(crate) fn middle(&self, selector: &str) -> [f64; 2] {
        let script = format!(
            "const e = document.querySelector({}); e.scrollIntoView({{block: 'center', behavior: 'instant'}}); \
             const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]",
            json!(selector)
        );
        let found = self.run(&script);
        // Pointers are at whole pixels.
        [0, 1].map(|i| found[i].as_f64().expect("a place").floor())
    }

    /// Moves the pointer along places with the button pressed.
    pub(crate) fn drag(&self, places: &[[f64; 2]]) {
        let mut actions = vec![to(places[0]), json!({"type": "pointerDown", "button": 0})];
        actions.extend(places[1..].iter().map(|&place| to(place)));
        actions.push(json!({"type": "pointerUp", "button": 0}));
        self.act(json!({"type": "pointer", "id": "mouse", "actions": actions}));
    }

    /// Moves the pointer.
    pub(crate) fn point(&self, place: [f64; 2]) {
        self.act(json!({"type": "pointer", "id": "mouse", "actions": [to(place)]}));
    }

    /// Turns the wheel.
    pub(crate) fn wheel(&self, [x, y]: [f64; 2], delta: i32) {
        let scroll = json!({
            "type": "scroll", "x": x as i64, "y": y as i64, "deltaX": 0, "deltaY": delta, "origin": "viewport"
        });
        self.act(json!({"type": "wheel", "id": "wheel", "actions": [scroll]}));
    }

    /// Presses keys, one after the other.
    pub(crate) fn keys(&self, keys: &str) {
        let press =
            |key: char| ["keyDown", "keyUp"].map(|action| json!({"type": action, "value": key.to_string()}));
        let actions: Vec<Value> = keys.chars().flat_map(press).collect();
        self.act(json!({"type": "key", "id": "keys", "actions": actions}));
    }

    /// Presses a key, and keeps it down.
    pub(crate) fn key_down(&self, key: char) {
        let actions = [json!({"type": "keyDown", "value": key.to_string()})];
        self.act(json!({"type": "key", "id": "keys", "actions": actions}));
    }

    /// Releases it.
    pub(crate) fn key_up(&self, key: char) {
        let actions = [json!({"type": "keyUp", "value": key.to_string()})];
        self.act(json!({"type": "key", "id": "keys", "actions": actions}));
    }

    fn act(&self, input: Value) {
        self.call("actions", json!({"actions": [input]}));
    }

    /// Presses the button with this text.
    pub(crate) fn press(&self, text: &str) {
        let found = self.run(&format!(
            "const b = [...document.querySelectorAll('button')].find((b) => b.textContent === {}); b?.click(); return !!b",
            json!(text)
        ));
        assert_eq!(found, true, "no button {text}");
    }

    /// Whether an expression holds.
    pub(crate) fn holds(&self, expression: &str) -> bool {
        self.run(&format!("return {expression}")) == true
    }

    /// The value of an expression.
    pub(crate) fn number(&self, expression: &str) -> f64 {
        let found = self.run(&format!("return {expression}"));
        found.as_f64().unwrap_or_else(|| panic!("{expression} is {found}"))
    }

    /// The value of an expression.
    pub(crate) fn text(&self, expression: &str) -> String {
        let found = self.run(&format!("return {expression}"));
        found.as_str().unwrap_or_else(|| panic!("{expression} is {found}")).to_owned()
    }

    /// What the browser had to complain of.
    fn complaints(&self) -> Vec<String> {
        let log = self.call("se/log", json!({"type": "browser"}));
        let entries = log.as_array().expect("a list").iter();
        entries.map(|entry| entry["message"].to_string()).collect()
    }

    /// Ends a test: nothing went wrong unseen.
    pub(crate) fn close(self) {
        assert_eq!(self.complaints(), [""; 0]);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = ureq::delete(&self.session).call();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

fn to([x, y]: [f64; 2]) -> Value {
    json!({"type": "pointerMove", "x": x as i64, "y": y as i64, "duration": 0, "origin": "viewport"})
}

/// The value of an answer.
fn post(address: &str, body: &Value) -> Value {
    let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
    let mut answer = agent.post(address).send_json(body).expect("an answer");
    let mut answer: Value = answer.body_mut().read_json().expect("JSON");
    let value = answer["value"].take();
    assert!(value.get("error").is_none(), "{address}: {value}");
    value
}
