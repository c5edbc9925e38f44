//! Reports of the drive experiments: the curves from which their figures are read.
//!
//! Consumes recordings and figures of [`drive`](crate::drive); produces one self-contained page each, like
//! the report of a run. Fails only if the output cannot be written.

mod circle;
mod compare;
mod harmonic;
mod step;

use std::io::{self, Write};

pub use self::circle::{Shown, write_circle};
pub use self::compare::{Outputs, picture_of_errors, picture_of_outputs, write_compare};
pub use self::harmonic::{write_bode, write_harmonic, write_inertia};
pub use self::step::write_step;

use super::format::{escape, fixed};
use super::head;
use super::palette::{self, Ink};
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// Opens the page: title, machine, the outcome in a sentence.
fn open(
    title: &str,
    machine: &Machine,
    sentence: &str,
    comparisons: &[Comparison],
    out: &mut impl Write,
) -> io::Result<()> {
    head(title, out)?;
    writeln!(out, "<header><h1>{}</h1>", escape(title))?;
    writeln!(out, "<p class=\"machine\">Machine: {}</p>", escape(&machine.name))?;
    let missed = comparisons.iter().filter(|comparison| !comparison.holds()).count();
    let (class, verdict) = match (comparisons.len(), missed) {
        (0, _) => ("done", String::new()),
        (all, 0) => ("done", format!(" All {all} figures of the reference machine hold.")),
        (all, missed) => {
            ("faulted", format!(" {missed} of {all} figures of the reference machine are missed."))
        }
    };
    writeln!(out, "<p class=\"result {class}\">{sentence}{verdict}</p></header>")?;
    comparison_table(comparisons, out)
}

pub(super) fn close(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "</main></body></html>")
}

/// A table of figures with the expected and the published ones; nothing if there are none.
fn comparison_table(comparisons: &[Comparison], out: &mut impl Write) -> io::Result<()> {
    if comparisons.is_empty() {
        return Ok(());
    }
    let rows = comparisons.iter().map(|comparison| {
        let figure = &comparison.figure;
        vec![
            format!("{} [{}]", figure.quantity, figure.unit),
            fixed(comparison.measured, 2),
            fixed(figure.expected, 2),
            figure.tolerance.to_string(),
            figure.paper.to_string().replace('-', "−"),
            if comparison.holds() { "holds" } else { "missed" }.to_owned(),
        ]
    });
    writeln!(out, "<h2>The reference machine’s figures</h2>")?;
    table(&["figure", "measured", "expected", "±", "published", ""], rows, out)
}

/// A table whose first column names the row.
pub(super) fn table(
    headings: &[&str],
    rows: impl Iterator<Item = Vec<String>>,
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr>")?;
    for (index, heading) in headings.iter().enumerate() {
        let class = if index == 0 { " class=\"word\"" } else { "" };
        write!(out, "<th scope=\"col\"{class}>{}</th>", escape(heading))?;
    }
    writeln!(out, "</tr></thead><tbody>")?;
    for row in rows {
        write!(out, "<tr>")?;
        for (index, cell) in row.iter().enumerate() {
            let cell = escape(cell);
            if index == 0 {
                write!(out, "<th scope=\"row\">{cell}</th>")?;
            } else {
                write!(out, "<td>{cell}</td>")?;
            }
        }
        writeln!(out, "</tr>")?;
    }
    writeln!(out, "</tbody></table></div>")
}

/// Names of series in the order of their inks.
pub(super) fn legend(names: impl Iterator<Item = String>) -> Vec<(Ink, String)> {
    names.enumerate().map(|(index, name)| (palette::series(index), name)).collect()
}
