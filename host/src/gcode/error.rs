//! Errors of a program: what was found, where, and what was expected instead.

use super::axis::{Axes, Axis};
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
#[derive(Clone, Debug, PartialEq)]
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
    #[error("found an empty file, expected G-code")]
    EmptyText,
    #[error("found UTF-16 text, expected UTF-8 or ASCII: save the program in one of these")]
    WideText,
    #[error("found {found}, expected a word such as X1.5, a comment or the end of the line")]
    Character { found: String },
    #[error("found '%' among other text, expected it alone in its line")]
    PercentInLine,
    #[error("found {found}, expected {expected}")]
    Syntax { found: String, expected: &'static str },
    #[error("found brackets and parameters within each other, expected {levels} levels at most")]
    ExpressionTooDeep { levels: u32 },
    #[error("found {found}, expected an expression with a value")]
    Undefined { found: &'static str },
    #[error("found '<' without a name and its '>', expected a name such as <depth>")]
    NameNotClosed,
    #[error(
        "found parameter {found}, expected a whole number from 1 to {}",
        super::parameters::PARAMETER_MAX
    )]
    ParameterNumber { found: f64 },
    #[error("found #<{name}>, to which nothing was assigned, expected an assignment before it")]
    ParameterUnset { name: String },
    #[error("found {name} where a value is assigned, expected another parameter: programs can only read it")]
    ParameterReadOnly { name: String },
    #[error("found a comment without its end, expected ')' in the same line")]
    CommentNotClosed,
    #[error("found '(' inside a comment, expected ')' before the next comment")]
    CommentNested,
    #[error("found {found} after {letter}, expected a number")]
    NumberMissing { letter: char, found: String },
    #[error("found {word}, expected a number such as -12.5 after the letter")]
    NumberMalformed { word: String },
    #[error("found {word}, expected a number within ±1.7e308")]
    NumberTooLarge { word: String },
    #[error("found {word}, expected a value within ±{} {}", Length::LIMIT, unit(.word))]
    LengthOutOfRange { word: String },
    #[error(
        "found {word}, which adds up beyond the range, expected a position within ±{} {}",
        Length::LIMIT,
        unit(.word)
    )]
    PositionOutOfRange { word: String },
    #[error("found {word}, expected an axis of the machine: {axes}")]
    NoSuchAxis { word: String, axes: Axes },
    #[error("found a move of {axis}, expected moves of the machine's axes: {axes}")]
    MissingAxisMoves { axis: Axis, axes: Axes },
    #[error(
        "found tool {number} with an offset along {axis}, expected offsets along the machine's axes: {axes}"
    )]
    ToolOffsetAxis { number: u32, axis: Axis, axes: Axes },
    #[error("found {motion} in the {plane} plane, expected a plane of the machine's axes: {axes}")]
    PlaneWithoutAxes { motion: &'static str, plane: Plane, axes: Axes },
    #[error(
        "found {word}, expected one of G0 G1 G2 G3 G4 G5 G5.1 G5.2 G5.3 G5.5 G6.2 G6.3 G7 G8 G10 G17 G18 G19 G20 G21 G28 G28.1 G30 G30.1 G38.2 to G38.5 G40 to G42.1 \
         G43 G43.1 G43.2 G49 G52 G53 G54 to G59.3 G61 G61.1 G64 G73 G80 to G83 G85 G86 G88 G89 G90 G90.1 G91 G91.1 \
         G92 to G92.3 G93 to G99"
    )]
    UnsupportedG { word: String },
    #[error("found {word}, which runs a program of the user's, expected a word that goes without")]
    UserProgram { word: String },
    #[error("found {word}, expected one of M0 to M9, M30, M48 to M53, M60 to M68, M70 to M73, M98 or M99")]
    UnsupportedM { word: String },
    #[error("found {word}, which needs a spindle encoder, expected a word that goes without")]
    NeedsEncoder { word: String },
    #[error(
        "found {word}, which needs a probe, expected [[probe.box]] in a machine file (--machine), which says what it \
         touches"
    )]
    NeedsProbe { word: String },
    #[error("found a second {letter} word, {word}, expected one per line")]
    WordTwice { letter: char, word: String },
    #[error("found {word} in a line with {other}, expected one of them: both set the same mode")]
    SameGroup { word: String, other: String },
    #[error("found {word}, expected a line number, not negative, as the first word of the line")]
    LineNumber { word: String },
    #[error("found {word}, expected it as the first word of its line")]
    OWordPlace { word: String },
    #[error("found {word}, expected {expected}")]
    NotThisCount { word: String, expected: &'static str },
    #[error("found {word}, expected a feed that is not negative")]
    FeedNegative { word: String },
    #[error("found {motion} without a feed, expected an F word in this line or before it")]
    FeedMissing { motion: &'static str },
    #[error("found {word}, expected a number that is not negative")]
    Negative { word: String },
    #[error(
        "found {word} without a motion mode, expected G0, G1, G2, G3, G5, G5.1, G5.2, G5.5, G6.2, G38.2 or a drilling cycle in this line \
         or before it"
    )]
    AxisWithoutMotion { word: String },
    #[error("found {word} in a line without {needs}, expected no such word")]
    WordUnused { word: String, needs: &'static str },
    #[error("found {word} in a line whose axis words another word takes, expected two lines")]
    AxesTaken { word: String },
    #[error("found {word} in a line with @ or ^, expected either of them, not both")]
    PolarWithAxes { word: String },
    #[error("found {word} at X0 Y0, where there is no angle, expected both @ and ^ after G90")]
    PolarAtZero { word: String },
    #[error("found {word} with G53, expected {expected}")]
    MachineMove { word: String, expected: &'static str },
    #[error("found {word}, expected {expected}")]
    Cycle { word: &'static str, expected: &'static str },
    #[error("found {word} in a line of M98 or M99, expected no other words but N, P and L")]
    SubprogramAlone { word: String },
    #[error("found M98 without a number, expected the number of a subprogram in a P word")]
    SubprogramWithoutNumber,
    #[error("found more than {steps_max} steps or messages, expected fewer: is there a loop without an end?")]
    TooManySteps { steps_max: usize },
    #[error("found M72, but no modes that were saved, expected M70 or M73 before it")]
    NothingSaved,
    #[error("found the end of the program by its own decision ({text}), expected its conditions to be met")]
    Aborted { text: String },
    #[error("found {motion} without F after G93, expected F in every line with such a move")]
    InverseTimeMissing { motion: &'static str },
    #[error("found {motion} after G93, expected a line or an arc: curves have no feed of inverse time")]
    CurveTimed { motion: &'static str },
    #[error("found {motion} after G95 without a spindle's speed, expected S in revolutions per minute (G97)")]
    SpindleSpeedMissing { motion: &'static str },
    #[error(
        "found an offset of {mm} mm in parameter {number}, expected a length within ±{} mm",
        Length::LIMIT
    )]
    OffsetOutOfRange { number: u32, mm: f64 },
    #[error(
        "found an offset that puts the position beyond the range, expected a position within ±{} mm",
        Length::LIMIT
    )]
    WorkOutOfRange,
    #[error("found {word}, expected {expected}")]
    Setup { word: String, expected: &'static str },
    #[error("found tool {number}, expected a tool of the tool table")]
    ToolUnknown { number: u32 },
    #[error("found a line without a T word, expected a tool such as T1 P1 Z12.5 D6")]
    NoTool,
    #[error("found {word} in a line of the tool table, expected T P X Y Z D I J or Q")]
    NoToolWord { word: String },
    #[error("found a second {word}, expected every tool once")]
    ToolTwice { word: String },
    #[error("found {found}, expected the number of a parameter, 1 to 5601, and its value")]
    ParameterLine { found: String },
    #[error("found {value} for parameter {number}, expected one value that it can have")]
    ParameterValue { number: u32, value: f64 },
    #[error("found O{found}, expected a whole number, 0 or more, as a label")]
    Label { found: f64 },
    #[error("found a computed label, expected it with call only")]
    LabelComputed,
    #[error(
        "found O{label} within the block of this label that begins in line {line}, expected another label"
    )]
    LabelOpen { label: String, line: u32 },
    #[error("found O{label} {keyword} without its end up to line {last}, expected O{label} {end}")]
    BlockOpen { label: String, keyword: &'static str, end: &'static str, last: u32 },
    #[error("found O{label} where {open}, expected it after the beginning of its block")]
    BlockNotOpen { label: String, open: String },
    #[error("found O{label} sub {place} in line {line}, expected every sub once, outside of other blocks")]
    SubPlace { label: String, place: &'static str, line: u32 },
    #[error(
        "found a call of O{label}, expected a subroutine of this file, or a file {label}.ngc in a folder of subroutines"
    )]
    SubroutineMissing { label: String },
    #[error("found {error} in reading {path}, expected a file of a subroutine")]
    SubroutineUnreadable { path: String, error: String },
    #[error("found no O{label} in {path}, expected the subroutine of this name")]
    SubroutineNotInFile { label: String, path: String },
    #[error("found the end of the file in a subprogram, expected M99")]
    SubprogramWithoutEnd,
    #[error("found a return outside of subroutines, expected it between sub and endsub")]
    ReturnOutside,
    #[error("found {found} in a subroutine that was called otherwise, expected {expected}")]
    ReturnMismatch { found: &'static str, expected: &'static str },
    #[error("found more than 30 arguments, expected 30 at most")]
    TooManyArguments,
    #[error("found subroutines within each other, expected {levels} levels at most")]
    TooDeep { levels: usize },
    #[error(
        "found more than {lines_max} lines executed up to here, expected fewer: is there a loop without an end?"
    )]
    TooManyLines { lines_max: u64 },
    #[error("found G4 without a time, expected a P word in seconds")]
    DwellWithoutTime,
    #[error(
        "found {word} in a line with two words that take {letter}, expected two lines: both would take it"
    )]
    WordShared { word: String, letter: char },
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
    #[error("found {motion} in the {plane} plane, expected it in the XY plane (G17)")]
    SplinePlane { motion: &'static str, plane: Plane },
    #[error("found {word} in a line of {cycle}, expected X, Y and Z only")]
    CycleAxis { word: String, cycle: &'static str },
    #[error("found {word} in a line of G5 or G5.1, expected X and Y only")]
    SplineOutsidePlane { word: String },
    #[error("found {word} alone in a line of G5 or G5.1, expected {first} and {second}")]
    SplineControlIncomplete { word: String, first: char, second: char },
    #[error(
        "found a first G5 without I and J, expected the offset from its start to its first control point"
    )]
    SplineWithoutStart,
    #[error("found G5.1 without I and J, expected the offset from its start to its control point")]
    QuadraticWithoutControl,
    #[error("found {points} control points, expected {order} at least: the order of the NURBS")]
    NurbsPoints { points: usize, order: u32 },
    #[error("found {found}, expected {expected}")]
    Nurbs { found: String, expected: &'static str },
    #[error("found {word} with G41 or G42 in force, expected G40 in a line before it")]
    Compensated { word: String },
    #[error(
        "found tool {number}, whose radius is not known, expected it in a tool table (--tools), radius_mm under [tool] \
         in a machine file, G10 L1 P{number} R before it, or G41.1 D or G42.1 D with the tool's diameter"
    )]
    CompensationRadius { number: u32 },
    #[error(
        "found a first move of {length_mm:.6} mm after G41 or G42, expected a longer one than the tool's radius, \
         {radius_mm:.6} mm"
    )]
    CompensationEntry { length_mm: f64, radius_mm: f64 },
    #[error(
        "found an arc that is too tight for the tool, expected one of more than its radius, {radius_mm:.6} mm"
    )]
    CompensatedArc { radius_mm: f64 },
    #[error(
        "found a corner up to here that does not let the tool in, expected room for its radius, {radius_mm:.6} mm, beside \
         both of its moves"
    )]
    Gouge { radius_mm: f64 },
    #[error("found {motion} right after G40, expected G0 or G1, which takes the tool back to the path")]
    CompensationLeft { motion: &'static str },
    #[error("found {motion} after G93 or G95, expected G94: a probe moves at a feed per minute")]
    ProbeFeed { motion: &'static str },
    #[error("found {motion} to where the machine is, expected another point")]
    ProbeStands { motion: &'static str },
    #[error(
        "found {motion} where the probe {}, at {at} of the machine, expected a start where it {}",
        touches(*.is_touched), touches(!.is_touched)
    )]
    ProbeTripped { motion: &'static str, at: String, is_touched: bool },
    #[error(
        "found {motion} up to {to} of the machine, where the probe {} as before, expected a way on which that changes, \
         or a word with which the program goes on without: G38.3 or G38.5",
        touches(*.is_touched)
    )]
    ProbeMissed { motion: &'static str, to: String, is_touched: bool },
    #[error("found {word} in a line of M6, expected it in a line of its own: a subroutine changes the tool")]
    BesideToolChange { word: String },
    #[error(
        "found the end of the subroutine that changes tools without tool {tool}{}, expected M6 in it, or endsub [1]",
        returned(*.found)
    )]
    ToolNotChanged { tool: u32, found: Option<f64> },
    #[error("found G5 without P and Q, expected the offset from its end to its second control point")]
    SplineWithoutEnd,
}

/// The unit of a word's value.
fn unit(word: &str) -> &'static str {
    let axis = word.bytes().next().and_then(Axis::of_letter);
    if axis.is_some_and(Axis::is_rotary) { "°" } else { "mm" }
}

impl Problem {
    /// Whether it is about one word that has no meaning here, whatever else is in its line.
    pub(super) fn is_of_a_word(&self) -> bool {
        matches!(
            self,
            Self::NoSuchAxis { .. }
                | Self::UnsupportedG { .. }
                | Self::UnsupportedM { .. }
                | Self::UserProgram { .. }
                | Self::NeedsEncoder { .. }
                | Self::NeedsProbe { .. }
        )
    }

    /// What it is about: a G or M word, or the letter of another word. Of other problems, nothing.
    pub(super) fn subject(&self) -> Option<&str> {
        match self {
            Self::UnsupportedG { word }
            | Self::UnsupportedM { word }
            | Self::UserProgram { word }
            | Self::NeedsEncoder { word }
            | Self::NeedsProbe { word } => Some(word),
            Self::NoSuchAxis { word, .. } | Self::WordUnused { word, .. } => word.get(..1),
            Self::SubroutineMissing { label } => Some(label),
            Self::ParameterUnset { name } => Some(name),
            _ => None,
        }
    }

    /// Whether a program without its earlier refusals might not have it: where the machine is and what parameters are
    /// depends on every line.
    pub(super) fn may_follow(&self) -> bool {
        matches!(
            self,
            Self::ParameterUnset { .. }
                | Self::Undefined { .. }
                | Self::FeedMissing { .. }
                | Self::AxisWithoutMotion { .. }
                | Self::WordUnused { .. }
                | Self::SplineWithoutStart
                | Self::SplineWithoutEnd
                | Self::QuadraticWithoutControl
                | Self::ArcRadiiDiffer { .. }
                | Self::ArcCentreOnPoint { .. }
                | Self::ArcRadiusTooSmall { .. }
                | Self::ArcWithoutChord { .. }
                | Self::PolarAtZero { .. }
                | Self::Gouge { .. }
                | Self::CompensatedArc { .. }
                | Self::CompensationEntry { .. }
                | Self::ProbeTripped { .. }
                | Self::ProbeMissed { .. }
                | Self::ProbeStands { .. }
                | Self::NothingSaved
                | Self::Aborted { .. }
        )
    }
}

fn returned(found: Option<f64>) -> String {
    found.map_or_else(String::new, |value| format!(", which returns {value}"))
}

fn touches(is_touched: bool) -> &'static str {
    if is_touched { "touches" } else { "does not touch" }
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
            GcodeError::new("a.ngc", 3, text, Located::new(offset, Problem::PercentInLine)).column
        };
        assert_eq!(at(b"G1 X2", 3), 4);
        assert_eq!(at("(größe) T1".as_bytes(), 10), 9);
        assert_eq!(at(b"(\xff\xfe) T1", 5), 6);
        assert_eq!(at(b"", 7), 1);
    }

    #[test]
    fn a_message_has_place_found_and_expected() {
        let error = GcodeError::new("a.ngc", 3, b"%G1", Located::new(0, Problem::PercentInLine));
        assert_eq!(error.to_string(), "a.ngc:3:1: found '%' among other text, expected it alone in its line");
    }
}
