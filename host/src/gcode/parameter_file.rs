//! The parameters that are kept from run to run, in LinuxCNC's format.
//!
//! A parameter a line: its number, blanks, its value; lengths in millimetres. What a program changes is kept if
//! its number is in the file, or one of the numbers that are always kept: the places of G28 and G30, G92, and
//! the coordinate systems (5161 to 5390).

use std::collections::BTreeMap;
use std::fmt;

use super::decimal::Length;
use super::error::{GcodeError, Located, Problem};
use super::parameters::{PARAMETER_MAX, Parameters, SELECTED};

/// Parameters to start a program with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterFile {
    values: BTreeMap<u32, f64>,
}

impl ParameterFile {
    /// Reads a file; `source_name` appears in errors only.
    ///
    /// # Errors
    /// A line is no number of a parameter and its value, a parameter is there twice, or an offset is beyond
    /// what a length can be.
    pub fn parse(source_name: &str, text: &[u8]) -> Result<Self, GcodeError> {
        let mut file = Self::default();
        for (line, number) in text.split(|&byte| byte == b'\n').zip(1..) {
            file.add(line).map_err(|located| GcodeError::new(source_name, number, line, located))?;
        }
        Ok(file)
    }

    fn add(&mut self, line: &[u8]) -> Result<(), Located> {
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_whitespace();
        let Some(number) = words.next().filter(|word| !word.starts_with([';', '#'])) else { return Ok(()) };
        let wrong = |found: &str| {
            let found: String = found.chars().take(40).collect();
            Located::new(0, Problem::ParameterLine { found })
        };
        let known = number.parse().ok().filter(|number| (1..=PARAMETER_MAX).contains(number));
        let key: u32 = known.ok_or_else(|| wrong(number))?;
        let value = words.next().ok_or_else(|| wrong("no value"))?;
        if let Some(more) = words.next() {
            return Err(wrong(more));
        }
        let value: f64 =
            value.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| wrong(value))?;
        if !fits(key, value) || self.values.insert(key, value).is_some() {
            return Err(Located::new(0, Problem::ParameterValue { number: key, value }));
        }
        Ok(())
    }

    /// The values, by number.
    pub(super) fn values(&self) -> &BTreeMap<u32, f64> {
        &self.values
    }

    /// The file as a program leaves it.
    #[must_use]
    pub fn after(&self, parameters: &Parameters) -> Self {
        let numbers = self.values.keys().copied().chain(kept());
        Self { values: numbers.map(|number| (number, parameters.get(number))).collect() }
    }
}

/// Whether a parameter can have a value: lengths and the coordinate system in force are bounded.
pub(super) fn fits(number: u32, value: f64) -> bool {
    match number {
        SELECTED => (1.0..=9.0).contains(&value) && value.fract() == 0.0,
        _ if is_offset(number) => Length::nearest(value).is_some(),
        _ => true,
    }
}

/// Whether a parameter is a length along X, Y or Z.
pub(super) fn is_offset(number: u32) -> bool {
    matches!(number, 5161..=5163 | 5181..=5183 | 5211..=5213)
        || (5221..=5383).contains(&number) && matches!((number - 5221) % 20, 0..=2)
}

/// The numbers that are always kept.
fn kept() -> impl Iterator<Item = u32> {
    let systems = (0..9).flat_map(|system| 5221 + system * 20..=5230 + system * 20);
    (5161..=5169).chain(5181..=5189).chain(5210..=5220).chain(systems)
}

/// As it is written to a file: every value as the shortest number that reads as the same.
impl fmt::Display for ParameterFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.values.iter().try_for_each(|(number, value)| writeln!(f, "{number}\t{value:?}"))
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_as_the_same() {
        let file = ParameterFile::parse("m.var", b"5221\t10.5\r\n31 0.1\n\n5220  3\n").unwrap();
        let mut parameters = Parameters::with(file.values());
        parameters.set(31, 1.0 / 3.0);
        parameters.set(32, 7.0);
        parameters.set(5390, 45.0);
        let after = file.after(&parameters);
        assert_eq!(ParameterFile::parse("m.var", after.to_string().as_bytes()), Ok(after.clone()));
        assert_eq!(after.values.get(&31), Some(&(1.0 / 3.0)));
        assert_eq!(
            (after.values.get(&32), after.values.get(&5390), after.values.get(&5220)),
            (None, Some(&45.0), Some(&3.0))
        );
        assert_eq!(after.values.len(), 9 + 9 + 11 + 90 + 1);
    }

    #[test]
    fn lines_that_are_no_parameters_are_refused() {
        for (text, message) in [
            ("5221 1\nx 2", "m.var:2:1: found x"),
            ("5221", "m.var:1:1: found no value"),
            ("5221 1 2", "m.var:1:1: found 2"),
            ("5221 nan", "m.var:1:1: found nan"),
            ("5602 1", "m.var:1:1: found 5602"),
            ("5221 1\n5221 1", "m.var:2:1: found 1 for parameter 5221"),
            ("5221 1e7", "m.var:1:1: found 10000000 for parameter 5221"),
            ("5220 0", "m.var:1:1: found 0 for parameter 5220"),
        ] {
            let error = ParameterFile::parse("m.var", text.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
