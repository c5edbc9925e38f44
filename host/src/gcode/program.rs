//! The steps of a program, in its order.

use super::axis::{Axes, Point};
use super::lines::Lines;
use super::parameters::Parameters;
use motion_kernel::hal::Spindle;
use std::fmt;

/// A program, read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// The axes of the machine that it was read for.
    pub axes: Axes,
    /// The steps, in order. Moves of no length are not listed.
    pub steps: Vec<Step>,
    /// The curves of [`NurbsMove`]s.
    pub nurbs: Vec<Nurbs>,
    /// Words that were accepted and not acted on, those of spindle and coolant unless the machine has them: at most
    /// one notice per kind, in the order of their first
    /// lines.
    pub notices: Vec<Notice>,
    /// What the operator is to read, in the order of the program.
    pub messages: Vec<Message>,
    /// Tools that were in the spindle, whoever changed them, in the order of their first use.
    pub tools: Vec<u32>,
    /// Changes of the tool in the spindle: before the step of an index, and to which; 0: to none.
    pub tool_changes: Vec<(usize, u32)>,
    /// When its lines run.
    pub lines: Lines,
    /// Tools that were used without a tool table: taken to have length 0, and the radius of the options.
    pub tools_assumed: Vec<u32>,
    /// That radius \[mm\].
    pub tool_radius_mm: f64,
    /// Coordinate systems that moves are made in.
    pub systems: Systems,
    /// The parameters at the end.
    pub parameters: Parameters,
}

/// A part of a program, in its order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// The steps.
    pub steps: Vec<Step>,
    /// The curves of [`NurbsMove`]s among them.
    pub nurbs: Vec<Nurbs>,
    /// What the operator is to read; a message's step is the index in this part.
    pub messages: Vec<Message>,
}

/// A set of coordinate systems, 1 for G54 to 9 for G59.3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Systems(u16);

impl Systems {
    /// Adds a system.
    pub(super) fn insert(&mut self, system: u32) {
        self.0 |= 1_u16.checked_shl(system).unwrap_or(0);
    }

    /// The systems, in order.
    pub fn iter(self) -> impl Iterator<Item = u32> {
        (1..=9).filter(move |&system| self.0 & (1 << system) != 0)
    }
}

/// A text for the operator: a `(MSG,…)`, or the tool that a stop is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Line of the program that asks for it, from 1; in a subroutine of another file, the line that called it.
    pub line: u32,
    /// Of another file: its name and the line there.
    pub within: Option<String>,
    /// It is shown before the step of this index.
    pub step: usize,
    /// The text.
    pub text: String,
}

impl Program {
    /// Notices but those of a kind that `is_acted_on`, tools that were assumed, and messages, a line each.
    #[must_use]
    pub fn notes(&self, is_acted_on: impl Fn(NoticeKind) -> bool) -> Vec<String> {
        let notices = self.notices.iter().filter(|notice| !is_acted_on(notice.kind));
        let mut notes: Vec<String> = notices.map(ToString::to_string).collect();
        if !self.tools_assumed.is_empty() {
            let tools: Vec<String> = self.tools_assumed.iter().map(ToString::to_string).collect();
            let tools = tools.join(", ");
            let assumed = match self.tool_radius_mm {
                0.0 => "length and radius 0".to_owned(),
                radius_mm => format!("length 0 and radius {radius_mm} mm"),
            };
            notes.push(format!("{assumed} are assumed, there is no tool table: tools {tools}"));
        }
        let shown = self.messages.iter().take(Self::MESSAGES_SHOWN);
        notes.extend(shown.map(|message| {
            let within = message.within.as_ref().map_or_else(String::new, |within| format!(", {within}"));
            format!("line {}{within}: message: {}", message.line, message.text)
        }));
        if let Some(more @ 1..) = self.messages.len().checked_sub(Self::MESSAGES_SHOWN) {
            notes.push(format!("{more} more messages"));
        }
        notes
    }

    /// The tool in the spindle at a step; 0: none, or the one that was there before the program.
    #[must_use]
    pub fn tool_at(&self, step: usize) -> u32 {
        let until = self.tool_changes.partition_point(|&(before, _)| before <= step);
        until.checked_sub(1).and_then(|last| self.tool_changes.get(last)).map_or(0, |&(_, tool)| tool)
    }

    /// Most messages that [`Self::notes`] lists.
    const MESSAGES_SHOWN: usize = 100;
}

/// One thing to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Line of the program that asks for it, from 1; in a subroutine of another file, the line that called it.
    pub line: u32,
    /// The action.
    pub kind: StepKind,
}

/// The action of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepKind {
    /// G0 or G1.
    Line(LineMove),
    /// G2 or G3.
    Arc(ArcMove),
    /// G5.
    Cubic(CubicMove),
    /// A point of G5.5.
    Through(ThroughMove),
    /// G5.2 to G5.3, or G6.2.
    Nurbs(NurbsMove),
    /// G38.2 to G38.5.
    Probe(ProbeMove),
    /// G4: stand still.
    Dwell {
        /// How long \[s\], 0 or more.
        seconds: f64,
    },
    /// M6: stop until the operator has changed the tool.
    ToolChange {
        /// T; 0: no tool.
        tool: u32,
    },
    /// M3, M4, M5, S, M7, M8, M9, and where other words switch these: spindle and coolant are not what they were.
    Switch(Outputs),
    /// M0, M1 or M60: stop until the operator resumes.
    Stop,
    /// M2, M30 or a closing `%`: nothing follows.
    End,
}

impl StepKind {
    /// Start and end of a move.
    #[must_use]
    pub fn ends(&self) -> Option<[Point; 2]> {
        match self {
            Self::Line(line) => Some([line.from, line.to]),
            Self::Arc(arc) => Some([arc.from, arc.to]),
            Self::Cubic(curve) => Some([curve.from, curve.to]),
            Self::Through(point) => Some([point.from, point.to]),
            Self::Nurbs(curve) => Some([curve.from, curve.to]),
            Self::Probe(probe) => Some([probe.from, probe.to]),
            Self::Dwell { .. } | Self::ToolChange { .. } | Self::Switch(_) | Self::Stop | Self::End => None,
        }
    }

    /// The path mode of a move; none for a probing move, which stops before and behind it whatever the mode.
    #[must_use]
    pub fn mode(&self) -> Option<PathMode> {
        match self {
            Self::Line(line) => Some(line.mode),
            Self::Arc(arc) => Some(arc.mode),
            Self::Cubic(curve) => Some(curve.mode),
            Self::Through(point) => Some(point.mode),
            Self::Nurbs(curve) => Some(curve.mode),
            Self::Probe(_)
            | Self::Dwell { .. }
            | Self::ToolChange { .. }
            | Self::Switch(_)
            | Self::Stop
            | Self::End => None,
        }
    }

    /// The same, to set it.
    pub fn mode_mut(&mut self) -> Option<&mut PathMode> {
        match self {
            Self::Line(line) => Some(&mut line.mode),
            Self::Arc(arc) => Some(&mut arc.mode),
            Self::Cubic(curve) => Some(&mut curve.mode),
            Self::Through(point) => Some(&mut point.mode),
            Self::Nurbs(curve) => Some(&mut curve.mode),
            Self::Probe(_)
            | Self::Dwell { .. }
            | Self::ToolChange { .. }
            | Self::Switch(_)
            | Self::Stop
            | Self::End => None,
        }
    }
}

/// What spindle and coolant do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// How the spindle turns.
    pub spindle: Spindle,
    /// Its commanded speed; 0 rev/min if it does not turn.
    pub speed: SpindleSpeed,
    /// M8.
    pub flood: bool,
    /// M7.
    pub mist: bool,
}

/// Commanded speed of the spindle, 0 or more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpindleSpeed {
    /// G97 \[rev/min\].
    Rpm(f64),
    /// G96: of the surface, in m/min, after G20 in feet/min. It follows the tool's distance from the spindle's axis.
    Surface(f64),
}

impl Default for SpindleSpeed {
    fn default() -> Self {
        Self::Rpm(0.0)
    }
}

/// A straight move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineMove {
    /// Start.
    pub from: Point,
    /// End; differs from the start.
    pub to: Point,
    /// Feed along the line.
    pub feed: Feed,
    /// How its ends are passed.
    pub mode: PathMode,
}

/// An arc, or a helix if start and end differ along the plane's normal.
///
/// Where the radii differ (within the tolerance of [`RADIUS_MISMATCH_RATIO`](super::RADIUS_MISMATCH_RATIO)),
/// the curve from the exact start to the exact end is a spiral: the radius, like the height, goes linearly
/// with the angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcMove {
    /// Start.
    pub from: Point,
    /// End.
    pub to: Point,
    /// Plane of the arc, before its turn.
    pub plane: Plane,
    /// Turn of the plane and its axes about Z \[°\], counter-clockwise: a rotated coordinate system turns ZX and YZ.
    pub turn_deg: f64,
    /// Centre \[mm\]: coordinates along the plane's first and second axis, in that order (ZX: Z, then X).
    pub centre_mm: [f64; 2],
    /// Distance of the start from the centre in the plane \[mm\], greater than 0.
    pub start_radius_mm: f64,
    /// Distance of the end from the centre in the plane \[mm\], greater than 0.
    pub end_radius_mm: f64,
    /// Angle run through \[rad\], not 0: counter-clockwise positive, seen from the positive end of the
    /// plane's normal; a full circle is ±2π, and every further turn (P) adds as much.
    pub sweep_rad: f64,
    /// Feed along the path, the height of a helix included.
    pub feed: Feed,
    /// How its ends are passed.
    pub mode: PathMode,
}

/// A cubic Bézier curve in the XY plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubicMove {
    /// Start.
    pub from: Point,
    /// End; Z is that of the start.
    pub to: Point,
    /// X and Y of the first control point from the start, and of the second from the end \[mm\].
    pub controls_mm: [[f64; 2]; 2],
    /// Feed along the curve.
    pub feed: Feed,
    /// How its ends are passed.
    pub mode: PathMode,
}

/// The move to the next point of a quintic spline, which passes through all points of consecutive moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThroughMove {
    /// The point before.
    pub from: Point,
    /// The point; differs from the one before.
    pub to: Point,
    /// Whether the spline begins with it, whatever was before.
    pub begins: bool,
    /// Feed along the spline up to the point.
    pub feed: Feed,
    /// How the spline's ends are passed.
    pub mode: PathMode,
}

/// A move along a NURBS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NurbsMove {
    /// Start: the first control point.
    pub from: Point,
    /// End: the last control point.
    pub to: Point,
    /// Index of the curve in [`Program::nurbs`].
    pub curve: usize,
    /// Feed along the curve.
    pub feed: Feed,
    /// How its ends are passed.
    pub mode: PathMode,
}

/// A straight move that ends where the probe trips, with a full stop before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeMove {
    /// Start.
    pub from: Point,
    /// Where the machine comes to rest: braked from where the probe tripped, or the programmed end.
    pub to: Point,
    /// The programmed end.
    pub end: Point,
    /// Where the probe trips; absent if it does not.
    pub trip: Option<Point>,
    /// It trips where it leaves the surface.
    pub leaves: bool,
    /// Feed along the line.
    pub feed: Feed,
}

/// A rational spline from its first control point to its last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nurbs {
    /// Degree, 1 or more: the order is one more.
    pub degree: usize,
    /// Control points \[mm\], X Y Z in machine coordinates.
    pub points_mm: Vec<[f64; 3]>,
    /// Weight of each control point, positive.
    pub weights: Vec<f64>,
    /// Knots, `degree + 1` more than control points; none is below the one before, and the first `degree + 1`
    /// are equal, as are the last.
    pub knots: Vec<f64>,
}

/// Speed of a move along its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// G0: as fast as the machine may.
    Rapid,
    /// Programmed feed \[mm/min; °/min of a move of A, B and C alone\], positive.
    MmPerMin(f64),
}

impl Feed {
    /// The same \[mm/s\]; infinite for a rapid.
    #[must_use]
    pub fn mm_s(self) -> f64 {
        match self {
            Self::Rapid => f64::INFINITY,
            Self::MmPerMin(feed_mm_min) => feed_mm_min / 60.0,
        }
    }
}

/// The treatment of the path at a corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PathMode {
    /// None of them was programmed yet: the machine's choice.
    #[default]
    Unprogrammed,
    /// G61: the path is kept.
    ExactPath,
    /// G61.1: a full stop after every move.
    ExactStop,
    /// G64: corners may be rounded; where two moves differ, within the smaller tolerance.
    Blend {
        /// Greatest distance from the programmed path \[mm\], 0 or more; the machine's choice if absent.
        tolerance_mm: Option<f64>,
        /// How far short lines may be from what stands for them \[mm\], 0 or more, on top of the tolerance;
        /// if absent, a part of the tolerance.
        merging_mm: Option<f64>,
    },
}

/// Plane of arcs, named by its first and second axis; with the normal as third they are right-handed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Plane {
    /// G17: X, Y, normal Z; offsets I, J.
    #[default]
    Xy,
    /// G18: Z, X, normal Y; offsets K, I. In the usual drawing with X to the right and Z up, Y points away
    /// from the reader, so that a clockwise arc looks counter-clockwise.
    Zx,
    /// G19: Y, Z, normal X; offsets J, K.
    Yz,
}

impl Plane {
    /// Indices in X Y Z of the first axis, the second axis and the normal.
    #[must_use]
    pub const fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Zx => [2, 0, 1],
            Self::Yz => [1, 2, 0],
        }
    }

    /// Letters of the offsets, for messages.
    pub(super) const fn offset_letters(self) -> &'static str {
        match self {
            Self::Xy => "I and J",
            Self::Zx => "I and K",
            Self::Yz => "J and K",
        }
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Xy => "XY",
            Self::Zx => "ZX",
            Self::Yz => "YZ",
        })
    }
}

/// Something accepted that the reader of the program should know of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Notice {
    /// What.
    pub kind: NoticeKind,
    /// Line where it occurs first, from 1.
    pub first_line: u32,
    /// The number of lines in which it occurs.
    pub count: u32,
}

/// Kinds of notices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoticeKind {
    /// M3, M4, M5.
    Spindle,
    /// S.
    SpindleSpeed,
    /// M6 without a tool that T selected.
    ToolChange,
    /// M7, M8, M9.
    Coolant,
    /// M48 to M53.
    Override,
    /// M62 to M65, M67, M68.
    Output,
    /// M66.
    Input,
    /// `(PROBEOPEN …)`, `(LOG,…)` and the like.
    File,
    /// D in a line that takes none.
    IdleD,
    /// More decimals than are exact.
    Rounded,
    /// A line that begins with `/`.
    BlockDeleted,
    /// F in a line that switches the units: controllers differ in which unit they take it.
    FeedInNewUnits,
    /// R a rounding error smaller than half the chord.
    RadiusEnlarged,
    /// M99 in the main program.
    MainReturn,
    /// Text after the end.
    TextAfterEnd,
    /// No M2, M30 or closing `%`.
    NoProgramEnd,
}

impl NoticeKind {
    /// Whether it is of words that steps tell, and that a machine with spindle and coolant acts on.
    #[must_use]
    pub fn is_of_outputs(self) -> bool {
        matches!(self, Self::Spindle | Self::SpindleSpeed | Self::Coolant)
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.kind {
            NoticeKind::Spindle => "M3, M4, M5 are not acted on: there is no spindle",
            NoticeKind::SpindleSpeed => "S is not acted on: there is no spindle",
            NoticeKind::Coolant => "M7, M8, M9 are not acted on: there is no coolant",
            NoticeKind::ToolChange => "M6 without a T word is not acted on: no tool is selected",
            NoticeKind::Override => "M48 to M53 are not acted on: overrides are the operator's",
            NoticeKind::Output => "M62 to M65, M67, M68 are not acted on: there are no outputs",
            NoticeKind::Input => "M66 reads 0 and does not wait: there are no inputs",
            NoticeKind::File => "(PROBEOPEN …), (LOG,…) and the like are not acted on: no file is written",
            NoticeKind::IdleD => "D is not acted on: nothing in its line takes it",
            NoticeKind::Rounded => "numbers with more decimals than are exact are rounded to 0.0000000001 mm",
            NoticeKind::BlockDeleted => "lines that begin with / are left out",
            NoticeKind::FeedInNewUnits => "F in a line that switches the units is taken in the new unit",
            NoticeKind::RadiusEnlarged => {
                "R falls short of half the chord by a rounding error: half circle made"
            }
            NoticeKind::MainReturn => "M99 ends the main program; Fanuc's would begin it again",
            NoticeKind::TextAfterEnd => "text after the end of the program is not read",
            NoticeKind::NoProgramEnd => "no M2, M30 or % at the end: is the file complete?",
        };
        write!(f, "line {}: {text}", self.first_line)?;
        if self.count > 1 { write!(f, " ({} lines)", self.count) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_right_handed() {
        for plane in [Plane::Xy, Plane::Zx, Plane::Yz] {
            let [first, second, normal] = plane.axes();
            assert_eq!([(first + 1) % 3, (first + 2) % 3], [second, normal], "{plane}");
        }
    }

    #[test]
    fn notices_count_their_lines() {
        let mut notice = Notice { kind: NoticeKind::SpindleSpeed, first_line: 4, count: 1 };
        assert_eq!(notice.to_string(), "line 4: S is not acted on: there is no spindle");
        notice.count = 9;
        assert_eq!(notice.to_string(), "line 4: S is not acted on: there is no spindle (9 lines)");
    }
}
