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
pub(super) type Column = (&'static str, &'static str, Align);

/// Writes a table with one cell per column in every row.
pub(super) fn write<const COLUMNS: usize>(
    columns: &[Column; COLUMNS],
    rows: &[[String; COLUMNS]],
    out: &mut dyn Write,
) -> io::Result<()> {
    let width = |text: &str| text.chars().count();
    let widths: [usize; COLUMNS] = std::array::from_fn(|index| {
        let (heading, unit, _) = columns[index];
        let widest = rows.iter().map(|row| width(&row[index])).max().unwrap_or(0);
        widest.max(width(heading)).max(width(unit))
    });
    let mut line = |cells: [&str; COLUMNS]| {
        let mut text = String::new();
        for ((cell, widest), (_, _, align)) in cells.iter().zip(widths).zip(columns) {
            let blanks = " ".repeat(widest - width(cell));
            text += &" ".repeat(GAP);
            match align {
                Align::Left => text += &[*cell, &blanks].concat(),
                Align::Right => text += &[&blanks, *cell].concat(),
            }
        }
        writeln!(out, "{}", text.trim_end())
    };
    line(columns.each_ref().map(|(heading, _, _)| *heading))?;
    if columns.iter().any(|(_, unit, _)| !unit.is_empty()) {
        line(columns.each_ref().map(|(_, unit, _)| *unit))?;
    }
    rows.iter().try_for_each(|row| line(row.each_ref().map(String::as_str)))
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
