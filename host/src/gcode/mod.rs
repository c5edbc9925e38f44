//! G-code text to typed steps.
//!
//! **Consumes** the bytes of a program, and of files with subroutines. **Produces** a [`Program`]: lines, arcs, dwells
//! and stops in machine coordinates in millimetres, [`Message`]s for the operator, and [`Notice`]s of what was accepted
//! without being acted on.
//! **Runs** in the background on the PC, in time and memory linear in the lines executed.
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
//! 1. `source`, `library`: the text of a file, and the files of subroutines.
//! 2. `flow`, `jump`, `structure`, `oword`: which line comes next. Only a file with O-words is looked through as a
//!    whole, once.
//! 3. `lexer`: bytes to words, a letter and a [`Decimal`] or a computed number each; `expression` and `parameters`
//!    compute it, `predefined` knows the parameters that tell the state.
//! 4. `block`: the words of one line, each in its slot; a word twice, two words of one modal group and words that
//!    nothing takes are refused here, the leftmost first.
//! 5. `interpreter`: the slots executed in the order RS-274 prescribes, whatever the order in the line: comments for the
//!    operator; feed mode, feed; `accessories`: speed, tool, spindle, coolant; dwell; plane, units, path mode, distance
//!    modes; `offsets`: tool length, coordinate system, G10, G28, G30, G52, G92; `motion`; stop or end.
//! 6. `motion`: `arc` gives centre, radii and sweep of G2 and G3, `spline` and `nurbs` the control points of G5, G5.1, G5.2 and G6.2, `cycle` the moves of
//!    a drilling cycle, `probe` where a probing move ends, `polar` the point of `@` and `^`; `frame` makes machine coordinates of the program's.
//!
//! # Dialect
//!
//! The semantics are those of LinuxCNC 2.9's interpreter; a test compares every move with it
//! (`tests/peers/linuxcnc/interpreter.py`). What differs is told below.
//!
//! | words | meaning |
//! |---|---|
//! | G0 G1 G2 G3, X Y Z A B C U V W | motion, modal; a line of axis words alone repeats it; G80 ends it. Axes that the machine does not have are refused ([`ReadOptions::axes`]). A, B and C are in degrees, after G20 too, and count on beyond a turn; arcs take them along, as they take U, V and W |
//! | `@` `^` | X and Y as the distance from the program's zero and the angle about it \[°\] |
//! | I J K, R, P | centre of an arc (relative, or absolute after G90.1), or its radius (negative: more than half a turn); P whole turns. Start and end radius may differ as [`RADIUS_MISMATCH_RATIO`] says |
//! | G5, X Y, \[I J\] P Q | cubic Bézier curve in XY: I J from its start to its first control point, P Q from its end to its second; modal. Without I J it continues the G5 before it, whose P Q are turned round. Control points that are no point of their own (I0 J0) or fold back make a curve that stands still, which is refused |
//! | G5.1, X Y I J | quadratic Bézier curve in XY: I J from its start to its control point; modal |
//! | G5.5, axis words | quintic spline through points, one a line, from where the machine is; modal. At least five points; a line with the word G5.5 begins another spline. Of this project alone |
//! | G5.2 \[P\] \[X Y P\] \[L\], X Y P, G5.3 | NURBS in the plane (here XY) from where the machine is, with uniform knots: control points with weights P, one a line; P alone in the first line is the weight of its start, otherwise 1; L: order, without it 3. Under G91 all control points count from the start. As in LinuxCNC 2.9, in ZX and YZ as in 2.10 |
//! | G6.2 X Y R K P Q, X Y R K, G6.2 K | NURBS in the plane of arcs with knots K, whole numbers: control points with weights R; P: order; Q1 to Q3, a way of approximation, is not acted on. The first K stands in as many lines as the order, as does the last, whose lines end the NURBS and are no control points. A line leads to its first point. G6.3 may follow. As in LinuxCNC 2.10 |
//! | G38.2 to G38.5 | a straight move at F up to where the probe touches the surface (.2, .3) or leaves it (.4, .5), modal; the machine brakes from there, and the program goes on from where it rests. #5061 to #5063 are where the probe tripped, in the coordinates and units in force, #5070 is 1. Without: .2 and .4 are refused; .3 and .5 set the programmed end, and 0 |
//! | G73 G81 G82 G83 G85 G86 G88 G89, R P Q L, G98 G99 | drilling cycles along the plane's normal, modal; they end where the first began, or at R |
//! | F, G93 G94 G95 | feed along X, Y and Z \[mm/min or inch/min\]; of a move without them along U, V and W, and of A, B and C alone in °/min; kept as a speed when the units change; of a minute's part, a minute, a revolution at the commanded speed |
//! | G4 P | dwell \[s\] |
//! | G17 G18 G19 | arc plane XY, ZX, YZ; clockwise is seen from the positive end of the third axis |
//! | G20 G21, G90 G91, G90.1 G91.1, G7 G8 | inch or mm; absolute or incremental end points; the same for arc centres; X as a diameter or a radius |
//! | G54 to G59.3, G10 L2 L20, G52, G92 to G92.3, G53 | coordinate systems with a rotation about Z; shifts; a move in machine coordinates |
//! | G28 G28.1 G30 G30.1 | to a stored place, by way of a point; store it |
//! | T, M6, M61 Q | the operator changes the tool: a stop with its number and remark; or [`ReadOptions::change_subroutine`] does, told below; the tool that is there |
//! | G43 H, G43.1, G43.2, G49, G10 L1 L10 L11 | tool lengths, from the tool table. Without a table every tool has length 0, which is told; with one, a tool that is not in it is refused. G10 changes the table for this program alone |
//! | G61, G61.1, G64 \[P\] \[Q\] | exact path; with a full stop after every move; corners blended within P \[mm or inch\], without P within the machine's own tolerance; short lines of one feed made longer lines and arcs within Q, which comes on top of P, without Q within a part of P |
//! | M0 M1 M60, M2 M30 | stop (M1 by a switch), end |
//! | M3 M4 M5 S, M7 M8 M9 | spindle with its speed \[rev/min\] and coolant switch, where they are not so already, at rest; M2 and any other end switch all off; M6 stops the spindle, as do G86 and G88 for a while. Without `[spindle]` or `[coolant]` in the machine file not acted on, which is told |
//! | G96 D, G97 | S is a speed of the surface \[m/min or feet/min\], or of the spindle; a spindle that turns after G96 is refused, as none here follows the radius |
//! | M48 to M53, M62 to M68 | kept as modes and read back by parameters, otherwise not acted on, which is told |
//! | M70 to M73 | modes saved and restored |
//! | G40, G41 G42 \[D\], G41.1 G42.1 D \[L\] | cutter radius compensation in XY and ZX: the path of the tool's centre beside the programmed one, by the radius of the tool in the table, or half the D of G41.1 |
//! | G80 | ends a drilling cycle |
//! | `#1`, `#<name>`, `#<_name>`, `[…]` | parameters of a subroutine (#1 to #30, names) and of all, read before any assignment of their line; expressions with all operators and functions of LinuxCNC |
//! | O…  sub, call, return, if, while, do, repeat, break, continue | subroutines and loops, named or numbered; other files are looked for in [`ReadOptions::subroutines`] |
//! | M98 P L, M99 | Fanuc's subprograms, which begin with a bare O… and work on their caller's parameters |
//! | N, `( )`, `;`, `%`, `/`, `*44` | line number (first in its line), comments, tape marks, a line left out by a switch, a checksum, which is not looked at |
//! | `(MSG,…)` `(DEBUG,…)` `(PRINT,…)` `(ABORT,…)` | a text for the operator; with values of parameters; an end by the program's own decision. `(PROBEOPEN …)`, `(LOG,…)` and their like write no file, which is told |
//!
//! Anything else is an error. G33, G74, G76, G84 need a spindle encoder, G38.2 to G38.5 a probe ([`ReadOptions::probe`]), M100 to M199 a program of the
//! user's: they may stand in subroutines that are not called. Blanks count nowhere outside comments, not even inside a
//! number; letters may be lower case; lines end in LF or CRLF; a UTF-8 byte-order mark at the start of the file is skipped.
//! A `%` before the first word opens the program, a later one ends it. Behind the end only subroutines are read.
//!
//! Where this reader differs from LinuxCNC's interpreter:
//!
//! - What parameters store for axes that the machine does not have (origins, shifts, places) moves nothing; a tool with an
//!   offset along one of them is refused.
//! - Drilling cycles, G5 and NURBS move no axes but X, Y and Z; LinuxCNC leaves A, B and C in a drilling cycle out without a word. So
//!   do probing moves. There are no wrapped rotary axes and no indexers.
//! - F in a line that switches the units is taken in the new unit, with a notice.
//! - Two words that would take one letter (`G64 P1 G4`) are refused, and letters that nothing takes; D alone is noticed.
//! - A drilling cycle before any G98 or G99 ends where it began, as Fanuc's do; LinuxCNC begins with G99.
//! - A file without an end is accepted, with a notice. So is an R up to 0.005 mm short of the chord.
//! - G41 and G42 are refused where the tool's radius is not known, and where a move of the tool would begin behind its end;
//!   LinuxCNC takes 0, and drives some of them backwards. G61, G64, G98, G99, M48 to M53 and M62 to M68 may be changed
//!   with compensation; predefined parameters give the programmed position.
//! - The probe trips where the machine file's boxes say, so #5061 to #5070 are known before anything moves. G38.2 to G38.5
//!   are refused after G93 as they are after G95. G38.3 and G38.5 from where they look for trip there, without a move.
//! - M72 and the end behind M73 restore the length of G43.1, where LinuxCNC takes the table's of the tool in the spindle; they
//!   restore no other offsets.
//! - The position behind G10 L2 R of the system in force, with G92 in force, is where the machine is; LinuxCNC's interpreter takes
//!   another. So it does in G53, G28 and G30 where G20 or G21 follows G43.1, and in a drilling cycle that G20 or G21 falls into.
//! - After G93 a feed may be below 0.1 of the unit a minute, to which LinuxCNC raises it.
//! - M6 for the tool that is in the spindle does not stop the program, and without any T it is noticed.
//! - A closing `%` and the end of a file switch spindle and coolant off, as M2 does.
//! - Loops run to their end after a `break` or `continue` of another loop, where LinuxCNC may leave a `do` early.
//!
//! # Tools changed by a subroutine
//!
//! The machine file may name a subroutine, `change_subroutine` under `[tool]`. It is looked for like any that is called. M6 for
//! another tool than that in the spindle calls it, and stands in a line with no other words than N, T, S and F. Its #1 is the
//! tool's number; as in LinuxCNC's own remapping of M6, `#<selected_tool>`, `#<tool_in_spindle>`, `#<selected_pocket>` and
//! `#<current_pocket>` are set (a pocket without a table is −1). M6 in it is the stop for the operator. Without M6 it returns a
//! value above 0 (`endsub [1]`), and the tool counts as changed; everything else is refused.
//!
//! # At the start
//!
//! The machine stands at 0, 0, 0; the offsets are those of [`ReadOptions::parameters`]. The modes are the power-on
//! modes of RS-274/NGC: G17, G21, G90, G91.1, G94, G98, no motion mode, no feed. Interpreters differ in the path mode; here
//! it is the machine's choice ([`PathMode::Unprogrammed`]), which planning makes and tells.
//!
//! # Bounds
//!
//! Subroutines within each other: 100. Brackets: 64. Lines executed and steps made: [`ReadOptions::lines_max`],
//! [`ReadOptions::steps_max`]. A program takes its text and some 320 bytes a step.
//!
//! # Exactness
//!
//! A [`Length`] counts 10⁻¹⁰ mm, so ten decimals of a millimetre and nine of an inch are exact, and
//! incremental programs do not drift. More decimals are rounded, with a notice. Floating point begins
//! only with what is irrational anyhow: expressions, rotations, the centre of an R arc, radii and sweeps.

mod accessories;
mod arc;
mod axis;
mod block;
mod cutter;
mod cutter_path;
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
mod lines;
mod message;
mod modal;
mod motion;
mod number;
mod nurbs;
mod offsets;
mod options;
mod oword;
mod parameter_file;
mod parameters;
mod polar;
mod predefined;
mod probe;
mod program;
mod reading;
mod source;
mod spline;
mod structure;
mod survey;
mod tool;

pub use arc::{RADIUS_MISMATCH_INCH, RADIUS_MISMATCH_MM, RADIUS_MISMATCH_RATIO};
pub use axis::{AXES_MAX, Axes, Axis, AxisGroup, ORIGIN, Point, xyz_mm};
pub use decimal::{Decimal, Length};
pub(crate) use error::describe;
pub use error::{GcodeError, Problem};
pub(crate) use frame::turn_sin_cos;
pub use lines::{Lines, Runs};
pub use options::ReadOptions;
pub use parameter_file::ParameterFile;
pub use parameters::{PARAMETER_MAX, Parameters};
pub use probe::Probe;
pub use program::{
    ArcMove, Batch, CubicMove, Feed, LineMove, Message, Notice, NoticeKind, Nurbs, NurbsMove, Outputs,
    PathMode, Plane, ProbeMove, Program, SpindleSpeed, Step, StepKind, Systems, ThroughMove,
};
pub use reading::Reading;
pub use survey::{Refusal, refusals};
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
