//! Tables for people: a heading, units under it, columns that line up.

use std::io::{self, Write};

/// Blanks between two columns.
const GAP: usize = 2;

/// The alignment of a column's text.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Right,
}

/// A column: heading, unit (may be empty), alignment.
pub(super) type Column<'a> = (&'a str, &'a str, Align);

/// Writes a table with one cell per column in every row.
pub(super) fn write(
    columns: &[Column<'_>],
    rows: &[impl AsRef<[String]>],
    out: &mut dyn Write,
) -> io::Result<()> {
    let width = |text: &str| text.chars().count();
    let mut widths: Vec<usize> =
        columns.iter().map(|(heading, unit, _)| width(heading).max(width(unit))).collect();
    for row in rows {
        for (widest, cell) in widths.iter_mut().zip(row.as_ref()) {
            *widest = width(cell).max(*widest);
        }
    }
    let mut line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut text = String::new();
        for ((cell, &widest), (_, _, align)) in cells.zip(&widths).zip(columns) {
            let blanks = " ".repeat(widest - width(cell));
            text += &" ".repeat(GAP);
            match align {
                Align::Left => text += &[cell, &blanks].concat(),
                Align::Right => text += &[&blanks, cell].concat(),
            }
        }
        writeln!(out, "{}", text.trim_end())
    };
    line(&mut columns.iter().map(|(heading, _, _)| *heading))?;
    if columns.iter().any(|(_, unit, _)| !unit.is_empty()) {
        line(&mut columns.iter().map(|(_, unit, _)| *unit))?;
    }
    rows.iter().try_for_each(|row| line(&mut row.as_ref().iter().map(String::as_str)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_by_characters() {
        let mut text = Vec::new();
        let columns = [("kind", "", Align::Left), ("accel", "mm/s²", Align::Right)];
        let rows = [["arc".to_owned(), "7".to_owned()], ["straight".to_owned(), "123456".to_owned()]];
        write(&columns, &rows, &mut text).expect("memory");
        let found = String::from_utf8(text).expect("UTF-8");
        let lines: Vec<&str> = found.lines().collect();
        let expected =
            ["  kind       accel", "             mm/s²", "  arc            7", "  straight  123456"];
        assert_eq!(lines, expected);
    }
}
