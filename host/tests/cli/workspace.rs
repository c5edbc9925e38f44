//! What the suites share: a folder with `motion` in it, and looks at its JSON.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::read::ZlibDecoder;
use serde_json::Value;

/// A directory of a test's own, removed afterwards.
pub(crate) struct Workspace(pub(crate) PathBuf);

impl Workspace {
    pub(crate) fn new(name: &str) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{name}"));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).expect("a directory");
        Self(path)
    }

    pub(crate) fn put(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).expect("a file");
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).expect("a file")
    }

    /// The machine file that `motion machine` prints, with the homing of X that it has commented out; near, as on a board time
    /// passes.
    pub(crate) fn near_homing(&self) -> String {
        let file = self.stdout(&["machine"]);
        let (before, homing) = file.split_once("#[axis.homing]").expect("homing");
        let (homing, after) = homing.split_once("\n\n").expect("its end");
        let homing = format!("[axis.homing]{homing}")
            .replace("\n#", "\n")
            .replace("\n ", "\n# ")
            .replace("closes_mm = -180.0", "closes_mm = -20.0")
            .replace("approach_mm_s = 2.0", "approach_mm_s = 20.0")
            .replace("position_mm = -250.0", "position_mm = -27.5");
        [before, &homing, "\n\n", after].concat()
    }

    /// The figures of a page, as its script reads them.
    pub(crate) fn figures(&self, page: &str) -> Vec<Value> {
        let page = self.read(page);
        let (_, rest) = page.split_once("id=\"figures\">").expect("figures");
        let text = rest.split_once("</script>").expect("their end").0;
        let mut json = Vec::new();
        ZlibDecoder::new(&BASE64.decode(text).expect("base64")[..]).read_to_end(&mut json).expect("a stream");
        serde_json::from_slice(&json).expect("a list of figures")
    }

    /// `motion` in this directory, to be started.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motion"));
        // Journals stay in here, too.
        command.args(arguments).current_dir(&self.0).env("XDG_STATE_HOME", &self.0);
        command
    }

    /// Runs `motion` in this directory.
    pub(crate) fn motion(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("motion starts")
    }

    /// Runs `motion`, which must end with `status` and say something on standard output.
    pub(crate) fn ending(&self, status: i32, arguments: &[&str]) -> (String, String) {
        let output = self.motion(arguments);
        let [said, error] =
            [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {error}");
        assert!(!said.is_empty(), "{arguments:?}");
        (said, error)
    }

    /// Runs `motion`, which must succeed and say nothing on standard error.
    pub(crate) fn stdout(&self, arguments: &[&str]) -> String {
        let output = self.motion(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), error.as_ref()), (Some(0), ""), "{arguments:?}");
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    pub(crate) fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.stdout(arguments)).expect("JSON")
    }

    /// Runs `motion`, which must refuse its input in one line; that line without `motion: `.
    pub(crate) fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.motion(arguments);
        let error = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        error.trim_end().strip_prefix("motion: ").expect("its name first").to_owned()
    }
}

impl Drop for Workspace {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub(crate) const STRINGER: &str = include_str!("../../src/cli/stringer.ngc");

const LIMITS: [&str; 6] = ["--accel", "500", "--jerk", "5000", "--snap", "400000"];

pub(crate) fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().expect("an object").keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

pub(crate) fn assert_has(value: &Value, expected: &[&str]) {
    let found = keys(value);
    for key in expected {
        assert!(found.contains(key), "{key} is not among {found:?}");
    }
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// The points of a series of a figure: its `graph`, if it has some, and the name of the series.
pub(crate) fn points(figure: &Value, graph: usize, name: &str) -> Vec<(f64, f64)> {
    let of = if figure["graphs"].is_array() { &figure["graphs"][graph] } else { figure };
    let series = of["series"].as_array().expect("series").iter().find(|series| series["name"] == name);
    let points = series.unwrap_or_else(|| panic!("no {name} in {of}"))["points"].as_array().expect("points");
    points.iter().map(|point| (number(&point[0]), number(&point[1]))).collect()
}

/// A series has these values, to what the text of a number tells.
pub(crate) fn assert_points(found: &[(f64, f64)], expected: impl Iterator<Item = (f64, f64)>) {
    let expected: Vec<(f64, f64)> = expected.collect();
    assert_eq!(found.len(), expected.len());
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
    for (a, b) in found.iter().zip(&expected) {
        assert!(is_near(a.0, b.0) && is_near(a.1, b.1), "{a:?} is drawn, {b:?} it is");
    }
}

pub(crate) fn profile<'a>(from: &'a str, to: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["profile", "--from", from, "--to", to][..], &LIMITS, more].concat()
}
