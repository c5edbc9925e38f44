//! `motion read`: the steps of a program as the reader understands them.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use motion_kernel::hal::Spindle;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::input;
use super::table::{self, Align};
use crate::axis_unit::AxisUnit;
use crate::gcode::{
    AXES_MAX, Axes, Axis, Feed, NoticeKind, Nurbs, Outputs, PathMode, Point, Program, SpindleSpeed, Step,
    StepKind, xyz_mm,
};

const EXAMPLES: &str = "\
Examples:
  motion read part.ngc                           a table: end point, feed and path mode of every step
  motion read part.ngc --json                    a JSON object a line, for scripts
  generate-part | motion read - --json           G-code from standard input

JSON: an object for every step, in order. All have line and kind. kind is
  line, arc, cubic, through,
  nurbs                        with from_mm, to_mm, feed_mm_min (null: rapid), path (exact, stop or blend; machine: not
                               programmed yet, the machine's choice), tolerance_mm and merging_mm (null: the machine's
                               choice)
      arc                      also plane, turn_deg (of the plane about Z), centre_mm (along its first and second axis), sweep_rad
                               (counter-clockwise positive)
      cubic                    also controls_mm (the first from the start, the second from the end, X and Y)
      through                  also begins (a spline begins with it)
      nurbs                    also degree, points_mm (control points, X Y Z), weights, knots
  probe                        with from_mm, to_mm (where the machine comes to rest), end_mm (programmed), trip_mm (null: it does
                               not trip), leaves (it trips where it leaves the surface), feed_mm_min
  dwell                        with dwell_s
  tool                         with tool: a stop for the operator to change it
  switch                       spindle or coolant change: with spindle (\"clockwise\", \"counterclockwise\" or null: off),
                               speed (rev/min; m/min or feet/min if surface, by G96), surface, flood, mist
  stop, end
Points are X Y Z; if the machine has other axes, all nine coordinates, X Y Z A B C U V W (° for A, B and C; a feed of these
alone is in °/min).
After them an object for every notice and every message, of kind notice and message, with text, and within: the line of a
subroutine in another file, where that asks for it.";

/// Print the steps of a program, in machine coordinates.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ReadArguments {
    /// G-code (`-`: standard input).
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    /// Machine file: its axes, what its probe touches, its tool radius, its subroutine that changes tools. Without it, X, Y, Z and none of the others.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// Print JSON: an object a line.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct StepJson {
    line: u32,
    #[serde(flatten)]
    kind: KindJson,
}

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum KindJson {
    Line {
        #[serde(flatten)]
        ends: MoveJson,
    },
    Arc {
        #[serde(flatten)]
        ends: MoveJson,
        plane: String,
        turn_deg: f64,
        centre_mm: [f64; 2],
        sweep_rad: f64,
    },
    Cubic {
        #[serde(flatten)]
        ends: MoveJson,
        controls_mm: [[f64; 2]; 2],
    },
    Through {
        #[serde(flatten)]
        ends: MoveJson,
        begins: bool,
    },
    Nurbs {
        #[serde(flatten)]
        ends: MoveJson,
        degree: usize,
        points_mm: Vec<[f64; 3]>,
        weights: Vec<f64>,
        knots: Vec<f64>,
    },
    Probe {
        from_mm: Vec<f64>,
        to_mm: Vec<f64>,
        end_mm: Vec<f64>,
        trip_mm: Option<[f64; 3]>,
        leaves: bool,
        feed_mm_min: Option<f64>,
    },
    Dwell {
        dwell_s: f64,
    },
    Tool {
        tool: u32,
    },
    Switch {
        spindle: Option<&'static str>,
        speed: f64,
        surface: bool,
        flood: bool,
        mist: bool,
    },
    Stop,
    End,
}

/// What all moves have.
#[derive(Serialize)]
struct MoveJson {
    from_mm: Vec<f64>,
    to_mm: Vec<f64>,
    feed_mm_min: Option<f64>,
    path: &'static str,
    tolerance_mm: Option<f64>,
    merging_mm: Option<f64>,
}

/// A notice or a message.
#[derive(Serialize)]
struct NoteJson {
    line: u32,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    within: Option<String>,
    text: String,
}

/// Reads and prints.
///
/// # Errors
/// The program is refused, or `out` can't be written.
pub fn read(arguments: &ReadArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let source = input::read(&arguments.program)?;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let program = arguments.reading.program(&source, machine.read_options())?;
    let write = if arguments.json { write_json_lines } else { write_table };
    write(&program, out).map_err(CliError::Output)?;
    Ok(Outcome::Done)
}

fn write_json_lines(program: &Program, out: &mut dyn Write) -> io::Result<()> {
    program.steps.iter().try_for_each(|step| write_json_line(&step_json(program, step), out))?;
    // Of spindle and coolant the steps tell.
    program.notices.iter().filter(|notice| !notice.kind.is_of_outputs()).try_for_each(|notice| {
        let text = notice.to_string();
        write_json_line(&NoteJson { line: notice.first_line, kind: "notice", within: None, text }, out)
    })?;
    program.messages.iter().try_for_each(|message| {
        let (within, text) = (message.within.clone(), message.text.clone());
        write_json_line(&NoteJson { line: message.line, kind: "message", within, text }, out)
    })
}

fn write_json_line(value: &impl Serialize, out: &mut dyn Write) -> io::Result<()> {
    serde_json::to_writer(&mut *out, value)?;
    writeln!(out)
}

fn step_json(program: &Program, step: &Step) -> StepJson {
    let axes = program.axes;
    let kind = match step.kind {
        StepKind::Line(line) => {
            KindJson::Line { ends: move_json(axes, [line.from, line.to], line.feed, line.mode) }
        }
        StepKind::Arc(arc) => KindJson::Arc {
            ends: move_json(axes, [arc.from, arc.to], arc.feed, arc.mode),
            plane: arc.plane.to_string(),
            turn_deg: arc.turn_deg,
            centre_mm: arc.centre_mm,
            sweep_rad: arc.sweep_rad,
        },
        StepKind::Cubic(cubic) => KindJson::Cubic {
            ends: move_json(axes, [cubic.from, cubic.to], cubic.feed, cubic.mode),
            controls_mm: cubic.controls_mm,
        },
        StepKind::Through(point) => KindJson::Through {
            ends: move_json(axes, [point.from, point.to], point.feed, point.mode),
            begins: point.begins,
        },
        StepKind::Nurbs(curve) => {
            let Nurbs { degree, points_mm, weights, knots } =
                program.nurbs.get(curve.curve).cloned().unwrap_or_default();
            let ends = move_json(axes, [curve.from, curve.to], curve.feed, curve.mode);
            KindJson::Nurbs { ends, degree, points_mm, weights, knots }
        }
        StepKind::Probe(probe) => KindJson::Probe {
            from_mm: coordinates(axes, probe.from),
            to_mm: coordinates(axes, probe.to),
            end_mm: coordinates(axes, probe.end),
            trip_mm: probe.trip.map(xyz_mm),
            leaves: probe.leaves,
            feed_mm_min: mm_min(probe.feed),
        },
        StepKind::Dwell { seconds } => KindJson::Dwell { dwell_s: seconds },
        StepKind::ToolChange { tool } => KindJson::Tool { tool },
        StepKind::Switch(outputs) => switch_json(&outputs),
        StepKind::Stop => KindJson::Stop,
        StepKind::End => KindJson::End,
    };
    StepJson { line: step.line, kind }
}

fn switch_json(outputs: &Outputs) -> KindJson {
    let &Outputs { spindle, speed, flood, mist } = outputs;
    let (speed, surface) = match speed {
        SpindleSpeed::Rpm(speed) => (speed, false),
        SpindleSpeed::Surface(speed) => (speed, true),
    };
    KindJson::Switch { spindle: direction(spindle), speed, surface, flood, mist }
}

/// How a spindle turns, in JSON; none if it does not.
pub(super) fn direction(spindle: Spindle) -> Option<&'static str> {
    match spindle {
        Spindle::Off => None,
        Spindle::Clockwise => Some("clockwise"),
        Spindle::Counterclockwise => Some("counterclockwise"),
    }
}

fn move_json(axes: Axes, [from, to]: [Point; 2], feed: Feed, mode: PathMode) -> MoveJson {
    let (path, tolerance_mm, merging_mm) = match mode {
        PathMode::Unprogrammed => ("machine", None, None),
        PathMode::ExactPath => ("exact", None, None),
        PathMode::ExactStop => ("stop", None, None),
        PathMode::Blend { tolerance_mm, merging_mm } => ("blend", tolerance_mm, merging_mm),
    };
    let [from_mm, to_mm] = [from, to].map(|point| coordinates(axes, point));
    MoveJson { from_mm, to_mm, feed_mm_min: mm_min(feed), path, tolerance_mm, merging_mm }
}

/// X, Y and Z; all nine coordinates if the machine has others.
fn coordinates(axes: Axes, point: Point) -> Vec<f64> {
    let others = axes.iter().any(|axis| !Axes::XYZ.contains(axis));
    point.iter().take(if others { AXES_MAX } else { 3 }).map(|coordinate| coordinate.to_mm()).collect()
}

fn mm_min(feed: Feed) -> Option<f64> {
    match feed {
        Feed::Rapid => None,
        Feed::MmPerMin(feed_mm_min) => Some(feed_mm_min),
    }
}

fn write_table(program: &Program, out: &mut dyn Write) -> io::Result<()> {
    let mut columns = vec![("line", "", Align::Right), ("step", "", Align::Left)];
    columns.extend(
        shown_axes(program.axes).map(|axis| (axis.name(), AxisUnit::of(axis).symbol(), Align::Right)),
    );
    columns.extend([("feed", "mm/min", Align::Right), ("path", "", Align::Left), ("more", "", Align::Left)]);
    let rows: Vec<Vec<String>> = program.steps.iter().map(|step| row(program, step)).collect();
    table::write(&columns, &rows, out)?;
    writeln!(out, "\n  {} steps", rows.len())?;
    program.notes(NoticeKind::is_of_outputs).iter().try_for_each(|note| writeln!(out, "  note: {note}"))
}

/// X, Y and Z, and the other axes of the machine.
pub(super) fn shown_axes(axes: Axes) -> impl Iterator<Item = Axis> {
    Axis::ALL.into_iter().filter(move |&axis| Axes::XYZ.contains(axis) || axes.contains(axis))
}

fn row(program: &Program, step: &Step) -> Vec<String> {
    let (name, ends, more) = match step_json(program, step).kind {
        KindJson::Line { ends } if ends.feed_mm_min.is_none() => ("rapid", Some(ends), String::new()),
        KindJson::Line { ends } => ("line", Some(ends), String::new()),
        KindJson::Arc { ends, plane, turn_deg, centre_mm: [first, second], sweep_rad } => {
            let sweep_deg = sweep_rad.to_degrees();
            let turn = if turn_deg == 0.0 { String::new() } else { format!(" turned by {turn_deg:.4}°") };
            ("arc", Some(ends), format!("{plane}{turn}, centre {first:.4} {second:.4}, {sweep_deg:.4}°"))
        }
        KindJson::Cubic { ends, controls_mm: [[i, j], [p, q]] } => {
            ("cubic", Some(ends), format!("I{i:.4} J{j:.4} P{p:.4} Q{q:.4}"))
        }
        KindJson::Through { ends, begins } => {
            ("through", Some(ends), if begins { "begins a spline" } else { "" }.to_owned())
        }
        KindJson::Nurbs { ends, degree, points_mm, .. } => {
            ("nurbs", Some(ends), format!("degree {degree}, {} control points", points_mm.len()))
        }
        KindJson::Probe { from_mm, to_mm, trip_mm, leaves, feed_mm_min, .. } => {
            let ends =
                MoveJson { from_mm, to_mm, feed_mm_min, path: "stop", tolerance_mm: None, merging_mm: None };
            let more = match trip_mm {
                Some([x, y, z]) => {
                    let trips = if leaves { "leaves" } else { "touches" };
                    format!("{trips} at X{x:.4} Y{y:.4} Z{z:.4}")
                }
                None => "does not trip".to_owned(),
            };
            ("probe", Some(ends), more)
        }
        KindJson::Dwell { dwell_s } => ("dwell", None, format!("{dwell_s} s")),
        KindJson::Tool { tool } => ("tool", None, format!("T{tool}")),
        KindJson::Switch { spindle, speed, surface, flood, mist } => {
            ("switch", None, switch_words(spindle, speed, surface, [flood, mist]))
        }
        KindJson::Stop => ("stop", None, String::new()),
        KindJson::End => ("end", None, String::new()),
    };
    let mut cells = vec![step.line.to_string(), name.to_owned()];
    match ends {
        Some(ends) => cells.extend(move_cells(program.axes, &ends)),
        None => cells.extend(vec![String::new(); shown_axes(program.axes).count() + 2]),
    }
    cells.push(more);
    cells
}

fn switch_words(spindle: Option<&str>, speed: f64, surface: bool, [flood, mist]: [bool; 2]) -> String {
    let unit = if surface { "of the surface" } else { "rev/min" };
    let spindle = spindle.map_or("spindle off".to_owned(), |turns| format!("spindle {turns} {speed} {unit}"));
    let coolant = match (flood, mist) {
        (false, false) => "coolant off",
        (true, false) => "flood",
        (false, true) => "mist",
        (true, true) => "flood and mist",
    };
    format!("{spindle}, {coolant}")
}

/// End point, feed and path mode.
fn move_cells(axes: Axes, ends: &MoveJson) -> Vec<String> {
    let cell = |axis: Axis| ends.to_mm.get(axis.index()).map_or_else(String::new, |to| format!("{to:.4}"));
    let mut cells: Vec<String> = shown_axes(axes).map(cell).collect();
    let feed = ends.feed_mm_min.map_or_else(|| "–".to_owned(), |feed_mm_min| format!("{feed_mm_min:.1}"));
    let tolerance = |letter, mm: Option<f64>| mm.map_or_else(String::new, |mm| format!(" {letter}{mm}"));
    let mode = match ends.path {
        "machine" => "–",
        "exact" => "G61",
        "stop" => "G61.1",
        _ => "G64",
    };
    let mode = format!("{mode}{}{}", tolerance('P', ends.tolerance_mm), tolerance('Q', ends.merging_mm));
    cells.extend([feed, mode]);
    cells
}
