//! Refusals of a machine file, and their places in it.

use std::ops::Range;

use motion_kernel::axis::ScaleError;
use thiserror::Error;

/// A machine file that was refused, and why. Displays as `file:line:column: found …, expected …`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{source_name}:{line}:{column}: {problem}")]
pub struct MachineError {
    /// Name of the file as the caller gave it.
    pub source_name: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The value that was found and what was expected.
    pub problem: String,
}

/// An axis that the kernel can't run.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("axis {axis}: {source}")]
pub struct AxisError {
    /// The axis's name.
    pub axis: String,
    /// The problem.
    pub source: ScaleError,
}

impl MachineError {
    /// A problem at a byte range of `text`.
    pub(super) fn new(source_name: &str, text: &str, at: &Range<usize>, problem: String) -> Self {
        let before = text.get(..at.start).unwrap_or(text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        Self { source_name: source_name.to_owned(), line, column, problem }
    }

    /// The TOML reader's refusal in the words of the project.
    pub(super) fn from_reader(source_name: &str, text: &str, error: &toml::de::Error) -> Self {
        // Without a span something is missing from the file as a whole.
        let at = error.span().unwrap_or(0..0);
        Self::new(source_name, text, &at, problem(error.message(), text, &at))
    }
}

/// `key = value` as it stands in the text: from the last separator before the value to its end.
pub(super) fn quote<'text>(text: &'text str, at: &Range<usize>) -> &'text str {
    let start = text.get(..at.start).and_then(|before| before.rfind(['\n', '{', ','])).map_or(0, |i| i + 1);
    text.get(start..at.end).unwrap_or("").trim()
}

/// `found …, expected …` from what serde and the TOML grammar say.
fn problem(message: &str, text: &str, at: &Range<usize>) -> String {
    let message = message.trim().replace('\n', ", ");
    if let Some(wrong) = message.strip_prefix("invalid type: ").or(message.strip_prefix("invalid value: ")) {
        let expected = wrong.rsplit_once(", expected ").map_or("a valid value", |(_, expected)| expected);
        return format!("found {}, expected {expected}", quote(text, at));
    }
    if let Some(missing) = message.strip_prefix("missing field ") {
        return format!("found no key {missing}, expected it in this table");
    }
    if let Some(unknown) = message.strip_prefix("unknown field ") {
        return format!("found unknown key {unknown}");
    }
    match message.contains("expected") {
        true => format!("found {message}"),
        false => format!("found {message}, expected a TOML file as `motion machine` prints it"),
    }
}
