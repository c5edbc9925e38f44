//! Errors of a program: what was found, where, and what was expected instead.

use super::decimal::Length;
use super::program::Plane;
use thiserror::Error;

/// A program that was refused, and why. Displays as `file:line:column: found …, expected …`.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{source_name}:{line}:{column}: {problem}")]
pub struct GcodeError {
    /// Name of the program as the caller gave it.
    pub source_name: String,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
    /// The problem at that place.
    pub problem: Problem,
}

/// A problem and its place in the line.
#[derive(Debug, PartialEq)]
pub(super) struct Located {
    /// Byte offset in the line.
    pub(super) offset: usize,
    /// The problem at that place.
    pub(super) problem: Problem,
}

impl Located {
    pub(super) fn new(offset: usize, problem: Problem) -> Self {
        Self { offset, problem }
    }
}

impl GcodeError {
    pub(super) fn new(source_name: &str, line: u32, text: &[u8], located: Located) -> Self {
        let before = text.get(..located.offset).unwrap_or(text);
        // Comments may hold any script; an editor counts characters, not bytes.
        let characters = String::from_utf8_lossy(before).chars().count();
        let column = u32::try_from(characters).unwrap_or(u32::MAX).saturating_add(1);
        Self { source_name: source_name.to_owned(), line, column, problem: located.problem }
    }
}

/// A problem in a program. Words are quoted without blanks and in upper case.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum Problem {
    #[error("found {found}, expected a word such as X1.5, a comment or the end of the line")]
    Character { found: String },
    #[error("found '/' (block delete), expected a line that always runs: there is no block-delete switch")]
    BlockDelete,
    #[error("found '%' among other text, expected it alone in its line")]
    PercentInLine,
    #[error("found '{found}', expected a plain number: parameters and expressions are not supported")]
    Expression { found: char },
    #[error("found a comment without its end, expected ')' in the same line")]
    CommentNotClosed,
    #[error("found '(' inside a comment, expected ')' before the next comment")]
    CommentNested,
    #[error("found {found} after {letter}, expected a number")]
    NumberMissing { letter: char, found: String },
    #[error("found {word}, expected a number such as -12.5 after the letter")]
    NumberMalformed { word: String },
    #[error("found {word}, expected a number within ±922337203")]
    NumberTooLarge { word: String },
    #[error("found {word}, expected at most 10 decimals: more are not rounded")]
    TooManyDecimals { word: String },
    #[error("found {word} in inches, expected at most 9 decimals: more are not rounded")]
    InchesInexact { word: String },
    #[error("found {word}, expected a length within ±{} mm", Length::LIMIT)]
    LengthOutOfRange { word: String },
    #[error("found {word}, which adds up beyond the range, expected a position within ±{} mm", Length::LIMIT)]
    PositionOutOfRange { word: String },
    #[error("found {word}, expected one of the words F G I J K M N P Q R S X Y Z")]
    UnsupportedLetter { word: String },
    #[error(
        "found {word}, expected one of G0 G1 G2 G3 G4 G5 G5.5 G17 G18 G19 G20 G21 G40 G49 G54 G61 G64 G80 G90 G90.1 \
         G91 G91.1 G94"
    )]
    UnsupportedG { word: String },
    #[error("found {word}, expected one of M0 to M9 or M30")]
    UnsupportedM { word: String },
    #[error("found a second {letter} word, {word}, expected one per line")]
    WordTwice { letter: char, word: String },
    #[error("found {word} in a line with {other}, expected one of them: both set the same mode")]
    SameGroup { word: String, other: String },
    #[error("found {word}, expected a whole line number, not negative, as the first word of the line")]
    LineNumber { word: String },
    #[error("found {word}, expected a positive feed")]
    FeedNotPositive { word: String },
    #[error("found {motion} without a feed, expected an F word in this line or before it")]
    FeedMissing { motion: &'static str },
    #[error("found {word}, expected a number that is not negative")]
    Negative { word: String },
    #[error(
        "found {word} without a motion mode, expected G0, G1, G2, G3, G5 or G5.5 in this line or before it"
    )]
    AxisWithoutMotion { word: String },
    #[error("found {word} in a line without {needs}, expected no such word")]
    WordUnused { word: String, needs: &'static str },
    #[error("found G4 without a time, expected a P word in seconds")]
    DwellWithoutTime,
    #[error("found {word} in a line with {takers}, expected two lines: both would take it")]
    WordShared { word: String, takers: &'static str },
    #[error("found {motion} without a centre or radius, expected {} or R", .plane.offset_letters())]
    ArcWithoutCentre { motion: &'static str, plane: Plane },
    #[error("found {word} in an arc of the {plane} plane, expected {} or R", .plane.offset_letters())]
    ArcOffsetOutsidePlane { word: String, plane: Plane },
    #[error("found {word} in an arc with a centre, expected the centre or the radius, not both")]
    ArcCentreAndRadius { word: String },
    #[error("found an absolute centre (G90.1) with one coordinate only, expected {}", .plane.offset_letters())]
    ArcCentreIncomplete { plane: Plane },
    #[error("found an arc whose centre is its {point} point, expected a radius greater than 0")]
    ArcCentreOnPoint { point: &'static str },
    #[error(
        "found an arc that starts {start_radius_mm:.6} mm and ends {end_radius_mm:.6} mm from its centre, \
         expected a difference of {allowed_mm:.6} mm at most"
    )]
    ArcRadiiDiffer { start_radius_mm: f64, end_radius_mm: f64, allowed_mm: f64 },
    #[error(
        "found {word} for two points {chord_mm:.6} mm apart, expected a radius of half their distance or more"
    )]
    ArcRadiusTooSmall { word: String, chord_mm: f64 },
    #[error("found {word}, expected a radius other than 0")]
    ArcRadiusZero { word: String },
    #[error("found {word} for an arc that ends where it starts, expected {}: the radius leaves the centre open",
        .plane.offset_letters())]
    ArcWithoutChord { word: String, plane: Plane },
    #[error("found G5 in the {plane} plane, expected it in the XY plane (G17)")]
    SplinePlane { plane: Plane },
    #[error("found {word} in a line of G5, expected X and Y only")]
    SplineOutsidePlane { word: String },
    #[error("found {word} alone in a line of G5, expected {first} and {second}")]
    SplineControlIncomplete { word: String, first: char, second: char },
    #[error(
        "found a first G5 without I and J, expected the offset from its start to its first control point"
    )]
    SplineWithoutStart,
    #[error("found G5 without P and Q, expected the offset from its end to its second control point")]
    SplineWithoutEnd,
}

/// A byte as an error message shows it.
pub(crate) fn describe(byte: Option<u8>) -> String {
    match byte {
        None => "the end of the line".to_owned(),
        Some(byte @ b' '..=b'~') => format!("'{}'", char::from(byte)),
        Some(byte) => format!("the byte 0x{byte:02x}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters_and_survive_any_bytes() {
        let at = |text: &[u8], offset| {
            GcodeError::new("a.ngc", 3, text, Located::new(offset, Problem::BlockDelete)).column
        };
        assert_eq!(at(b"G1 X2", 3), 4);
        assert_eq!(at("(größe) T1".as_bytes(), 10), 9);
        assert_eq!(at(b"(\xff\xfe) T1", 5), 6);
        assert_eq!(at(b"", 7), 1);
    }

    #[test]
    fn a_message_has_place_found_and_expected() {
        let error = GcodeError::new("a.ngc", 3, b"/G1", Located::new(0, Problem::BlockDelete));
        assert_eq!(
            error.to_string(),
            "a.ngc:3:1: found '/' (block delete), expected a line that always runs: there is no block-delete switch"
        );
    }
}
