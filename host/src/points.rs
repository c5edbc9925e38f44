//! Lists of points, which splines go through: CSV.
//!
//! Consumes text with the heading `x_mm,y_mm,z_mm` or `x_mm,y_mm,z_mm,u` and a row of numbers for every
//! point; produces the points, their parameters if there are any, and their lines. Blank lines, and lines
//! that start with `#`, are left out. Nothing is guessed: what is not a finite number is refused with line
//! and column. Background; linear.

use csv::{ByteRecord, ReaderBuilder};

use crate::toolpath::Vector;

const HEADING: [&str; 4] = ["x_mm", "y_mm", "z_mm", "u"];
/// Characters of what was found that are shown.
const SHOWN: usize = 20;

/// Points of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// The points \[mm\].
    pub points: Vec<Vector>,
    /// Their parameters, if the file has them.
    pub parameters: Option<Vec<f64>>,
    /// The line of each, from 1.
    pub lines: Vec<u32>,
}

/// A list that can't be read: place, what was found, what was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{source_name}:{line}:{column}: found {found}, expected {expected}")]
pub struct PointsError {
    /// File name.
    pub source_name: String,
    /// Line, from 1.
    pub line: u32,
    /// Column, from 1.
    pub column: u32,
    /// What is there.
    pub found: String,
    /// What should be.
    pub expected: &'static str,
}

/// Reads a list of points.
///
/// # Errors
/// The text is not UTF-8, has no heading, or a row is not of as many finite numbers as the heading says.
pub fn read(source_name: &str, text: &[u8]) -> Result<Points, PointsError> {
    let fail = |line: u32, column: usize, found: String, expected| PointsError {
        source_name: source_name.to_owned(),
        line,
        column: u32::try_from(column).unwrap_or(u32::MAX),
        found,
        expected,
    };
    let text = std::str::from_utf8(text).map_err(|error| {
        let good = &text[..error.valid_up_to()];
        let line = good.iter().filter(|&&byte| byte == b'\n').count() + 1;
        let column = String::from_utf8_lossy(good).lines().last().map_or(0, |line| line.chars().count()) + 1;
        fail(u32::try_from(line).unwrap_or(u32::MAX), column, "a byte that is not UTF-8".to_owned(), "text")
    })?;
    // The reader counts a line as it ends, and ends a record at the first of two characters.
    let mut text = text.trim_start_matches('\u{feff}').replace("\r\n", "\n");
    text.push('\n');
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .quoting(false)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let mut points = Points::default();
    let mut columns = None;
    let mut record = ByteRecord::new();
    let mut line = 0;
    // Reading from memory does not fail.
    while reader.read_byte_record(&mut record).unwrap_or(false) {
        line = u32::try_from(reader.position().line() - 1).unwrap_or(u32::MAX);
        let fields: Vec<String> =
            record.iter().map(|field| String::from_utf8_lossy(field).into_owned()).collect();
        if fields.iter().all(|field| field.trim().is_empty()) && fields.len() == 1 {
            continue;
        }
        let Some(columns) = columns else {
            let found: Vec<&str> = fields.iter().map(|field| field.trim()).collect();
            if found != HEADING && found != HEADING[..3] {
                let expected = "the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u";
                return Err(fail(line, 1, shown(&fields.join(",")), expected));
            }
            if found.len() == HEADING.len() {
                points.parameters = Some(Vec::new());
            }
            columns = Some(found.len());
            continue;
        };
        if fields.len() != columns {
            let found = format!("{} columns", fields.len());
            let expected =
                if columns == 3 { "3 columns, as in the heading" } else { "4 columns, as in the heading" };
            // Where the first one too many begins, or the line ends.
            let column = column_of(&fields, fields.len().min(columns));
            return Err(fail(line, column, found, expected));
        }
        let mut numbers = [0.0; HEADING.len()];
        for (index, (field, number)) in fields.iter().zip(&mut numbers).enumerate() {
            let text = field.trim();
            let parsed: Option<f64> = text.parse().ok().filter(|number: &f64| number.is_finite());
            *number = parsed.ok_or_else(|| {
                let indent = field.chars().take_while(|c| c.is_whitespace()).count();
                let indent = if text.is_empty() { 0 } else { indent };
                fail(line, column_of(&fields, index) + indent, shown(text), "a finite number")
            })?;
        }
        let [x, y, z, u] = numbers;
        points.points.push([x, y, z]);
        points.lines.push(line);
        if let Some(parameters) = &mut points.parameters {
            parameters.push(u);
        }
    }
    if columns.is_none() {
        let expected = "the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u";
        return Err(fail(line.max(1), 1, "no line with text".to_owned(), expected));
    }
    Ok(points)
}

/// The column, from 1, where field `index` of a line begins; of one that is not there, just past the last
/// one.
fn column_of(fields: &[String], index: usize) -> usize {
    let before: usize = fields.iter().take(index).map(|field| field.chars().count() + 1).sum();
    if index < fields.len() { before + 1 } else { before.max(1) }
}

fn shown(text: &str) -> String {
    let text = text.trim();
    if text.is_empty() {
        return "nothing".to_owned();
    }
    let mut shown: String = text.chars().take(SHOWN).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > SHOWN {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        read("p.csv", text.as_bytes()).expect_err("no list").to_string()
    }

    #[test]
    fn lines_are_those_of_the_file() {
        let text = "# a list\n\nx_mm, y_mm ,z_mm,u\r\n0,1,2,0\r\n\r\n# between\n 3 , 4.5,-6e-1,0.5";
        let found = read("p.csv", text.as_bytes()).expect("a list");
        assert_eq!(found.points, [[0.0, 1.0, 2.0], [3.0, 4.5, -0.6]]);
        assert_eq!(found.parameters, Some(vec![0.0, 0.5]));
        assert_eq!(found.lines, [4, 7]);
        let plain = read("p.csv", "\u{feff}x_mm,y_mm,z_mm\n1,2,3\n".as_bytes()).expect("a list");
        assert_eq!((plain.points, plain.parameters, plain.lines), (vec![[1.0, 2.0, 3.0]], None, vec![2]));
    }

    #[test]
    fn every_refusal_names_its_place() {
        let heading = "x_mm,y_mm,z_mm\n";
        for (text, expected) in [
            (
                "",
                "p.csv:1:1: found no line with text, expected the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u",
            ),
            (
                "\n# nothing\n",
                "p.csv:1:1: found no line with text, expected the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u",
            ),
            ("\n1,2,3\n", "p.csv:2:1: found 1,2,3, expected the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u"),
            (
                "x_mm,z_mm,y_mm\n",
                "p.csv:1:1: found x_mm,z_mm,y_mm, expected the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u",
            ),
        ] {
            assert_eq!(refusal(text), expected);
        }
        for (row, expected) in [
            ("1,two,3", "2:3: found two, expected a finite number"),
            ("1,  nan,3", "2:5: found nan, expected a finite number"),
            ("1,,3", "2:3: found nothing, expected a finite number"),
            ("1,2,1e999", "2:5: found 1e999, expected a finite number"),
            ("1,2", "2:4: found 2 columns, expected 3 columns, as in the heading"),
            ("1,2,3,4", "2:7: found 4 columns, expected 3 columns, as in the heading"),
            ("\"1\",2,3", "2:1: found \"1\", expected a finite number"),
            ("ü,2,3", "2:1: found ü, expected a finite number"),
        ] {
            assert_eq!(refusal(&format!("{heading}{row}\n")), format!("p.csv:{expected}"));
        }
        let bytes = [heading.as_bytes(), b"1,\xff,3\n"].concat();
        let error = read("p.csv", &bytes).expect_err("no text");
        assert_eq!(error.to_string(), "p.csv:2:3: found a byte that is not UTF-8, expected text");
    }
}
