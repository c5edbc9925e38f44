//! G-code text to typed steps.
//!
//! **Consumes** the bytes of a program. **Produces** a [`Program`]: lines, arcs, dwells and stops with
//! absolute end points in millimetres, and [`Notice`]s of what was accepted without being acted on.
//! **Runs** in the background on the PC, in one pass, in time and memory linear in the text.
//! **Fails** with a [`GcodeError`] that names file, line, column, what was found and what was expected;
//! no bytes make it panic, and nothing is rounded, clamped or skipped without an error or a notice.
//!
//! ```
//! use motion_host::gcode::{self, StepKind};
//!
//! let program = gcode::read("slot.ngc", b"G1 X 7999.9999 F600 (cut)\nX8000.0001\nM2\n")?;
//! let StepKind::Line(last) = program.steps[1].kind else { panic!("a line") };
//! assert_eq!((last.to[0].units() - last.from[0].units()) * 5, gcode::Length::UNITS_PER_MM / 1000);
//!
//! let refused = gcode::read("slot.ngc", b"G1 X10").unwrap_err();
//! assert!(refused.to_string().starts_with("slot.ngc:1:1: found G1 without a feed, expected"));
//! # Ok::<(), gcode::GcodeError>(())
//! ```
//!
//! # The journey of a line
//!
//! 1. `lexer`: bytes to words, a letter and an exact [`Decimal`] each; comments vanish.
//! 2. `block`: the words of one line, each in its slot; a word twice, two words of one modal group
//!    and words this machine cannot obey are refused here, the leftmost first.
//! 3. `interpreter`: the slots executed in the order RS-274 prescribes, whatever the order in the line:
//!    feed, spindle and coolant; dwell; plane, units, path mode, distance modes; motion; stop or end.
//! 4. `arc`: centre, radii and sweep of G2 and G3; `spline`: control points of G5.
//!
//! # Dialect
//!
//! | words | meaning |
//! |---|---|
//! | G0 G1 G2 G3, X Y Z | motion, modal; a line of axis words alone repeats it; G80 ends it |
//! | I J K, R | centre of an arc (relative, or absolute after G90.1), or its radius (negative: more than half a turn) |
//! | G5, X Y, \[I J\] P Q | cubic Bézier curve in XY: I J from its start to its first control point, P Q from its end to its second; modal. Without I J it continues the G5 before it, whose P Q are turned round. Control points that are no point of their own (I0 J0) or fold back make a curve that stands still, which is refused |
//! | G5.5, X Y Z | quintic spline through points, one a line, from where the machine is; modal. At least five points; a line with the word G5.5 begins another spline |
//! | F | feed \[mm/min or inch/min\], positive; kept as a speed when the units change |
//! | G4 P | dwell \[s\] |
//! | G17 G18 G19 | arc plane XY, ZX, YZ; clockwise is seen from the positive end of the third axis |
//! | G20 G21, G90 G91, G90.1 G91.1 | inch or mm; absolute or incremental end points; the same for arc centres |
//! | G61, G64 \[P\] \[Q\] | exact path; corners blended within P \[mm or inch\], without P within the machine's own tolerance; short lines of one feed made longer lines and arcs within Q, which comes on top of P, without Q within a part of P |
//! | G40 G49 G54 G94 | accepted: they ask for what is always so (no compensation, first work offset, feed per minute) |
//! | M0 M1, M2 M30 | stop (M1 too: there is no optional-stop switch), end |
//! | M3–M9, S | accepted with a notice: there is no spindle, tool changer or coolant |
//! | N, `( )`, `;`, `%` | line number (first in its line), comments, tape marks |
//!
//! Anything else is an error. Blanks count nowhere outside comments, not even inside a number; letters may be
//! lower case; lines end in LF or CRLF; a UTF-8 byte-order mark at the start of the file is skipped.
//! A `%` before the first word opens the program, a later one ends it.
//!
//! # At the start
//!
//! The position is 0, 0, 0. The modes are the power-on modes of RS-274/NGC: G17, G21, G90, G91.1, G94, no
//! motion mode, no feed. Interpreters differ in the path mode; here it is [`PathMode::ExactPath`] (G61), the
//! one that never leaves the programmed path.
//!
//! # Exactness
//!
//! A [`Length`] counts 10⁻¹⁰ mm, so ten decimals of a millimetre and nine of an inch are exact, and
//! incremental programs do not drift. More decimals are an error unless they are zeros. Floating point begins
//! only with what is irrational anyhow: the centre of an R arc, radii and sweeps.

mod accessories;
mod arc;
mod block;
mod cycle;
mod decimal;
mod error;
mod expression;
mod flow;
mod frame;
mod interpreter;
mod jump;
mod lexer;
mod library;
mod message;
mod modal;
mod motion;
mod number;
mod offsets;
mod options;
mod oword;
mod parameter_file;
mod parameters;
mod polar;
mod predefined;
mod program;
mod source;
mod spline;
mod structure;
mod tool;

pub use arc::{RADIUS_MISMATCH_INCH, RADIUS_MISMATCH_MM, RADIUS_MISMATCH_RATIO};
pub use decimal::{Decimal, Length};
pub(crate) use error::describe;
pub use error::{GcodeError, Problem};
pub use options::ReadOptions;
pub use parameter_file::ParameterFile;
pub use parameters::{PARAMETER_MAX, Parameters};
pub use program::{
    ArcMove, CubicMove, Feed, LineMove, Message, Notice, NoticeKind, PathMode, Plane, Program, Step,
    StepKind, ThroughMove,
};
pub use tool::{Tool, ToolTable};

/// Reads a whole program with the default [`ReadOptions`]; `source_name` appears in errors only.
///
/// # Errors
///
/// As [`read_with`].
pub fn read(source_name: &str, text: &[u8]) -> Result<Program, GcodeError> {
    read_with(source_name, text, &ReadOptions::default())
}

/// Reads a whole program; `source_name` appears in errors only.
///
/// # Errors
///
/// The first word, leftmost in the first line at fault, that is not G-code of this dialect or asks for the
/// impossible. In a subroutine of another file, the error names that file.
pub fn read_with(source_name: &str, text: &[u8], options: &ReadOptions) -> Result<Program, GcodeError> {
    flow::Flow::new(source_name, text, options).read()
}
