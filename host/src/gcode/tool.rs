//! The tool table, in LinuxCNC's format.
//!
//! A tool a line: `T3 P3 X0 Z-12.5 D6 I0 J0 Q0 ; remark`, lengths in millimetres. What is not given is 0.

use std::collections::BTreeMap;

use super::axis::{Axis, Point};
use super::decimal::Length;
use super::error::{GcodeError, Located, Problem};
use super::expression::NoParameters;
use super::lexer::{Cursor, Item, Items, Word};
use super::modal::Units;

/// A tool of the table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tool {
    /// T, 0 or more.
    pub number: u32,
    /// P: its place in the changer.
    pub pocket: u32,
    /// What G43 adds, along every axis that the machine has.
    pub offset: Point,
    /// D.
    pub diameter: Length,
    /// I and J \[°\]: front and back angle of a lathe tool.
    pub angles_deg: [f64; 2],
    /// Q: orientation of a lathe tool, 0 to 9.
    pub orientation: u32,
    /// The text after the semicolon.
    pub remark: String,
}

/// The tools there are, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolTable {
    tools: BTreeMap<u32, Tool>,
}

impl ToolTable {
    /// Reads a table; `source_name` appears in errors only.
    ///
    /// # Errors
    /// A line is no tool, or a tool is there twice.
    pub fn parse(source_name: &str, text: &[u8]) -> Result<Self, GcodeError> {
        let mut table = Self::default();
        for (line, number) in text.split(|&byte| byte == b'\n').zip(1..) {
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            table.add(line).map_err(|located| GcodeError::new(source_name, number, line, located))?;
        }
        Ok(table)
    }

    fn add(&mut self, line: &[u8]) -> Result<(), Located> {
        let mut tool = Tool::default();
        let mut number: Option<Word<'_>> = None;
        for item in Items::new(Cursor::new(line), &NoParameters) {
            let word = match item? {
                Item::Word(word) => word,
                Item::Comment(_) => continue,
                Item::Assignment(_) => return Err(Located::new(0, Problem::NoTool)),
            };
            let length = |word| Units::Millimetres.length(word);
            match word.letter {
                b'T' => {
                    tool.number = word.count(0, "a whole tool number, 0 or more")?;
                    number = Some(word);
                }
                b'P' => tool.pocket = word.count(0, "a whole number of a pocket, 0 or more")?,
                b'D' => tool.diameter = length(word)?,
                b'I' => tool.angles_deg[0] = word.number.to_f64(),
                b'J' => tool.angles_deg[1] = word.number.to_f64(),
                b'Q' => tool.orientation = word.count(0, "a whole orientation from 0 to 9")?,
                letter => match Axis::of_letter(letter) {
                    Some(axis) => tool.offset[axis.index()] = length(word)?,
                    None => return Err(word.problem(|word| Problem::NoToolWord { word })),
                },
            }
        }
        if let Some(remark) = line.iter().position(|&byte| byte == b';') {
            let remark = line.get(remark + 1..).unwrap_or_default();
            tool.remark = String::from_utf8_lossy(remark).trim().to_owned();
        }
        let Some(number) = number else {
            let is_empty = line.iter().take_while(|byte| **byte != b';').all(u8::is_ascii_whitespace);
            return if is_empty { Ok(()) } else { Err(Located::new(0, Problem::NoTool)) };
        };
        if self.tools.contains_key(&tool.number) {
            return Err(number.problem(|word| Problem::ToolTwice { word }));
        }
        self.tools.insert(tool.number, tool);
        Ok(())
    }

    /// A tool by its number.
    #[must_use]
    pub fn get(&self, number: u32) -> Option<&Tool> {
        self.tools.get(&number)
    }

    /// A tool to change; a new one if there is none of this number.
    pub(super) fn entry(&mut self, number: u32) -> &mut Tool {
        self.tools.entry(number).or_insert_with(|| Tool { number, ..Tool::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read() {
        let text = "; machine tools\nT1 P1 D3.175 Z+12.5 W-3 ; 1/8 end mill\n\nt99p2x-.5 I90 J-45 Q3 A0\r\n";
        let table = ToolTable::parse("tool.tbl", text.as_bytes()).unwrap();
        let tool = table.get(1).unwrap();
        assert_eq!(
            (tool.offset[2].to_mm(), tool.diameter.to_mm(), tool.remark.as_str()),
            (12.5, 3.175, "1/8 end mill")
        );
        assert_eq!(table.get(99).unwrap().offset[0].to_mm(), -0.5);
        assert_eq!(table.get(2), None);
    }

    #[test]
    fn lines_that_are_no_tools_are_refused() {
        for (text, message) in [
            ("T1 P1\nT1 P2", "tool.tbl:2:1: found a second T1"),
            ("P1 Z2", "tool.tbl:1:1: found a line without a T word"),
            ("T1.5", "tool.tbl:1:1: found T1.5"),
            ("T-1", "tool.tbl:1:1: found T-1"),
            ("T1 F5", "tool.tbl:1:4: found F5"),
            ("T1 Z9999999", "tool.tbl:1:4: found Z9999999"),
            ("T1 Zx", "tool.tbl:1:4: found 'x' after Z"),
            ("#1=5", "tool.tbl:1:1: found a line without a T word"),
        ] {
            let error = ToolTable::parse("tool.tbl", text.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
