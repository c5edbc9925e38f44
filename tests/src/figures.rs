//! Committed figures: what was measured, as a Markdown table in `tests/expected`, and the copies of it that
//! the documents show.
//!
//! A test measures, then calls [`hold`]: it fails if a figure has grown by more than its tolerance, if any
//! text differs, or if a document shows something else or none shows it. With `MOTION_ACCEPT=1` in the environment the
//! measured table is written instead, to the file and into the documents:
//!
//! ```text
//! <!-- figures: budgets -->
//! …the table…
//! <!-- end of figures -->
//! ```

use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The documents that may show figures, from the repository's root.
const DOCUMENTS: [&str; 4] =
    ["docs/FIGURES.md", "host/AXIS.md", "host/FAULTS.md", "boards/qemu-mps2/README.md"];
const END: &str = "<!-- end of figures -->";

/// A table of figures. A cell that reads as a number is compared with a tolerance, any other as text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// One cell for each column.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(columns: &[&str]) -> Self {
        Self { columns: columns.iter().map(|&name| name.to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// It does not have a cell for every column.
    pub fn row<C: ToString>(&mut self, cells: &[C]) {
        assert_eq!(cells.len(), self.columns.len());
        self.rows.push(cells.iter().map(ToString::to_string).collect());
    }

    /// As Markdown; columns of figures are set flush right.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let is_number = |column: usize| self.rows.iter().any(|row| number(&row[column]).is_some());
        let mut text = format!("| {} |\n|", self.columns.join(" | "));
        for column in 0..self.columns.len() {
            text.push_str(if is_number(column) { "---:|" } else { "---|" });
        }
        text.push('\n');
        for row in &self.rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
        text
    }

    /// What [`Table::to_markdown`] makes.
    #[must_use]
    pub fn from_markdown(text: &str) -> Self {
        let cells = |line: &str| -> Vec<String> {
            line.trim().trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
        };
        let mut lines = text.lines();
        let columns = lines.next().map(cells).unwrap_or_default();
        Self { columns, rows: lines.skip(1).map(cells).collect() }
    }
}

fn number(cell: &str) -> Option<f64> {
    cell.parse().ok()
}

/// Whether what is measured is to be written instead of compared.
#[must_use]
pub fn is_accepting() -> bool {
    std::env::var("MOTION_ACCEPT").is_ok_and(|value| value == "1")
}

/// Holds `measured` to the committed table `name`; no figure may have grown by more than the part `growth`
/// of it.
///
/// # Errors
/// What differs, and the command that accepts it.
pub fn hold(name: &str, measured: &Table, growth: f64) -> Result<(), String> {
    let path = root().join("tests/expected").join(format!("{name}.md"));
    if is_accepting() {
        write(&path, &measured.to_markdown())?;
        return each_copy(name, |document, copy| write(document, &copy.replaced(&measured.to_markdown())));
    }
    let committed = std::fs::read_to_string(&path)
        .map_err(|error| format!("{}: {error}; MOTION_ACCEPT=1 writes it", path.display()))?;
    let differences = differences(&Table::from_markdown(&committed), measured, growth);
    if !differences.is_empty() {
        return Err(format!(
            "{}: {} figures differ from what is committed:\n{}\nmeasured now:\n{}\
             Run the test with MOTION_ACCEPT=1 to accept them.",
            path.display(),
            differences.len(),
            differences.join("\n"),
            measured.to_markdown()
        ));
    }
    each_copy(name, |document, copy| {
        if copy.shown == committed {
            Ok(())
        } else {
            Err(format!("{} shows other figures than {}", document.display(), path.display()))
        }
    })
}

/// Every difference, one line each.
fn differences(committed: &Table, measured: &Table, growth: f64) -> Vec<String> {
    if committed.columns != measured.columns {
        return vec![format!("columns {:?}, committed {:?}", measured.columns, committed.columns)];
    }
    if committed.rows.len() != measured.rows.len() {
        return vec![format!("{} rows, committed {}", measured.rows.len(), committed.rows.len())];
    }
    let mut found = Vec::new();
    for (committed_row, row) in committed.rows.iter().zip(&measured.rows) {
        for ((column, was), is) in committed.columns.iter().zip(committed_row).zip(row) {
            let holds = match (number(was), number(is)) {
                (Some(was), Some(is)) => is <= was + growth * was.abs(),
                _ => was == is,
            };
            if !holds {
                found.push(format!("{}, {column}: {is}, committed {was}", row[0]));
            }
        }
    }
    found
}

/// A document's text around the figures it shows.
struct Copy<'a> {
    before: &'a str,
    shown: &'a str,
    after: &'a str,
}

impl<'a> Copy<'a> {
    /// The copy of the figures `name`; none if the document does not show them, or does not say where they end.
    fn find(text: &'a str, name: &str) -> Option<Self> {
        let begin = format!("<!-- figures: {name} -->\n");
        let start = text.find(&begin)? + begin.len();
        let end = start + text[start..].find(END)?;
        Some(Self { before: &text[..start], shown: &text[start..end], after: &text[end..] })
    }

    fn replaced(&self, figures: &str) -> String {
        [self.before, figures, self.after].concat()
    }
}

/// Calls `act` with every document that shows the figures `name`: one at least does.
fn each_copy(name: &str, act: impl Fn(&Path, &Copy<'_>) -> Result<(), String>) -> Result<(), String> {
    let mut shown = 0;
    for document in DOCUMENTS {
        let path = root().join(document);
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        if let Some(copy) = Copy::find(&text, name) {
            act(&path, &copy)?;
            shown += 1;
        }
    }
    if shown == 0 {
        return Err(format!("no document shows {name} between <!-- figures: {name} --> and {END}"));
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(figure: &str, text: &str) -> Table {
        let mut table = Table::new(&["what", "figure", "text"]);
        table.row(&["tick", figure, text]);
        table
    }

    #[test]
    fn a_copy_is_replaced_where_it_stands() {
        let text =
            format!("head\n<!-- figures: a -->\n{END}\nmiddle\n<!-- figures: b -->\nold\n{END}\ntail\n");
        let replaced = Copy::find(&text, "a").unwrap().replaced("new\n");
        assert_eq!(replaced, text.replacen("a -->\n", "a -->\nnew\n", 1));
        let copy = Copy::find(&replaced, "b").unwrap();
        assert_eq!(copy.shown, "old\n");
        assert_eq!(copy.replaced("new\n"), replaced.replacen("old", "new", 1));
        assert!(Copy::find(&text, "c").is_none() && Copy::find("<!-- figures: a -->\nopen", "a").is_none());
    }

    #[test]
    fn every_committed_table_is_shown() {
        for file in std::fs::read_dir(root().join("tests/expected")).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "md") {
                let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
                each_copy(&name, |_, _| Ok(())).unwrap();
            }
        }
        assert!(each_copy("none of them", |_, _| Ok(())).is_err());
    }

    #[test]
    fn growth_and_other_texts_are_found() {
        let committed = Table::from_markdown(&table("1000", "a1").to_markdown());
        assert_eq!(committed, table("1000", "a1"));
        assert!(differences(&committed, &table("1020", "a1"), 0.02).is_empty());
        assert!(differences(&committed, &table("10", "a1"), 0.02).is_empty());
        assert_eq!(differences(&committed, &table("1021", "a1"), 0.02).len(), 1);
        assert_eq!(differences(&committed, &table("none", "a2"), 0.02).len(), 2);
        assert_eq!(differences(&committed, &Table::new(&["what"]), 0.02).len(), 1);
    }
}
