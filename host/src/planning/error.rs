//! Refusals of planning, with file and line.

use motion_kernel::law::{LimitError, SegmentError, Ticks};
use motion_kernel::plan::PlanError;
use motion_kernel::units::Position;

use crate::axis_unit::AxisUnit;
use crate::gcode::Axis;
use crate::toolpath::spline::SplineError;
use crate::toolpath::{CompileError, NoAxis};

/// A place in a file, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column, where the problem has one.
    pub column: Option<u32>,
}

impl From<u32> for Place {
    fn from(line: u32) -> Self {
        Self { line, column: None }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.line)?;
        self.column.map_or(Ok(()), |column| write!(f, ":{column}"))
    }
}

/// A program or block list that can't be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{source_name}:{place}: {problem}")]
pub struct PlanningError {
    /// File name.
    pub source_name: String,
    /// Where.
    pub place: Place,
    /// The problem.
    pub problem: Problem,
}

impl PlanningError {
    /// A problem in a line of a program.
    pub(crate) fn at_line(source_name: &str, (line, problem): (u32, Problem)) -> Self {
        Self { source_name: source_name.to_owned(), place: line.into(), problem }
    }
}

/// Something that fails with a problem in a program line.
pub(crate) type AtLine<T> = Result<T, (u32, Problem)>;

/// A problem: the value that was found, and what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The geometry has no executable form.
    #[error("found {0}")]
    Geometry(#[from] CompileError),
    /// There is no spline through the points.
    #[error("found {0}")]
    Spline(#[from] SplineError),
    /// The parts of a NURBS do not belong together. What is read from G-code does.
    #[error("found a NURBS without its curve, expected one with weights and knots that fit its degree")]
    Nurbs,
    /// A probing move for a board.
    #[error("found a probing move, expected none: a board has no probe input yet")]
    NoProbeInput,
    /// A limit that results for the block is unusable.
    #[error("found {} limit {}, expected a positive finite number", .0.quantity, .0.value)]
    Limit(#[from] LimitError),
    /// The look-ahead has no plan.
    #[error("found {}", unplannable(.0))]
    Plan(#[from] PlanError),
    /// A ramp or a cruise is beyond the tick's range.
    #[error("found {}", unmade(error, *tick_s))]
    Segment {
        /// The segment's error.
        error: SegmentError,
        /// The tick \[s\].
        tick_s: f64,
    },
    /// A move leaves the travel of an axis.
    #[error("found {axis} at {found:.4} {unit}, expected its travel, {low} to {high} {unit}")]
    Travel {
        /// The axis' name.
        axis: String,
        /// The axis' position there.
        found: f64,
        /// The axis' least position.
        low: f64,
        /// The axis' greatest position.
        high: f64,
        /// The unit of the three: "mm" or "°".
        unit: &'static str,
    },
    /// A move leaves the space that the kernel has positions for.
    #[error(
        "found a path through {axis} = {found} {}, expected coordinates within ±{} {}",
        AxisUnit::of(*axis).symbol(), Position::LIMIT_MM, AxisUnit::of(*axis).symbol()
    )]
    Coordinate {
        /// The axis.
        axis: Axis,
        /// The coordinate, in the axis' unit.
        found: f64,
    },
    /// A curve needs an axis that the machine does not have.
    #[error("found {0}")]
    NoAxis(#[from] NoAxis),
    /// More pieces than the tick handles.
    #[error(
        "found {pieces} pieces over {length_mm:.6} mm, which {feed_mm_s:.3} mm/s pass within one tick of \
         {tick_s} s, expected at most {pieces} pieces a tick, so a feed of at most {feed_max_mm_s:.3} mm/s \
         here or longer moves"
    )]
    DensePieces {
        /// The bound.
        pieces: usize,
        /// The length they cover \[mm\].
        length_mm: f64,
        /// The planned feed \[mm/s\].
        feed_mm_s: f64,
        /// The feed at which they would be accepted \[mm/s\].
        feed_max_mm_s: f64,
        /// The tick \[s\].
        tick_s: f64,
    },
    /// More feed segments than the tick handles.
    #[error("found {segments} feed segments and dwells within {ticks:.3} ticks, expected at least 1 tick")]
    DenseSegments {
        /// The bound.
        segments: usize,
        /// The time that they take \[ticks\].
        ticks: f64,
    },
    /// A dwell that can't be executed.
    #[error("found a dwell of {seconds} s, expected {}", at_most_ticks(*tick_s))]
    Dwell {
        /// The duration \[s\].
        seconds: f64,
        /// The tick \[s\].
        tick_s: f64,
    },
    /// The machine has no output for a word.
    #[error(
        "found {word}, and the machine file has no [{table}], expected that table if the board has the output, or \
         --no-spindle to leave the word out"
    )]
    NoOutput {
        /// M3, M4, M7 or M8.
        word: &'static str,
        /// The table of the machine file.
        table: &'static str,
    },
    /// The spindle is commanded to turn faster than it may.
    #[error("found a spindle speed of {found_rpm} rev/min, expected at most speed_max_rpm = {max_rpm}")]
    SpindleSpeed {
        /// The commanded speed \[rev/min\].
        found_rpm: f64,
        /// The greatest \[rev/min\].
        max_rpm: f64,
    },
    /// The spindle is commanded to turn the other way round.
    #[error("found M4, expected M3: the spindle turns clockwise only, turns = \"clockwise\"")]
    SpindleDirection,
    /// The spindle turns at a speed of the surface.
    #[error(
        "found a spindle turning after G96, whose speed would have to follow the tool's radius, expected a speed in \
         revolutions per minute (G97)"
    )]
    SurfaceSpeed,
    /// Coolant of a kind that the machine does not have.
    #[error("found {word}, expected coolant of the kind that [coolant] of the machine file has")]
    Coolant {
        /// M7 or M8.
        word: &'static str,
    },
    /// The file is not a block list.
    #[error("{0}")]
    Json(String),
}

fn unplannable(error: &PlanError) -> String {
    match error {
        PlanError::Block { quantity, value, .. } => format!(
            "{quantity} {value}, expected a length from 0 to {} mm, a ceiling above 0, a junction feed not below 0",
            Position::LIMIT_MM
        ),
        PlanError::EndFeed { quantity, feed_mm_s, greatest_mm_s } => {
            format!("{quantity} {feed_mm_s} mm/s, expected from 0 to {greatest_mm_s} mm/s")
        }
        PlanError::TooShortToBrake { start_mm_s, greatest_mm_s } => format!(
            "start feed {start_mm_s} mm/s, expected at most {greatest_mm_s} mm/s: the path is too short to brake \
             from more"
        ),
        PlanError::TooShortToAccelerate { end_mm_s, greatest_mm_s } => format!(
            "end feed {end_mm_s} mm/s, expected at most {greatest_mm_s} mm/s: the path is too short to reach more"
        ),
        // A ramp or room, of which the kernel says all there is.
        _ => error.to_string(),
    }
}

/// A problem that names the axis that it is about.
pub(super) fn named<const N: usize>(problem: Problem, axes: &[Option<Axis>; N]) -> Problem {
    match problem {
        Problem::Geometry(CompileError::Coordinate { axis: place, mm: found }) => {
            axes.get(place).copied().flatten().map_or(problem, |axis| Problem::Coordinate { axis, found })
        }
        problem => problem,
    }
}

fn unmade(error: &SegmentError, tick_s: f64) -> String {
    match *error {
        // The kernel's quantities carry their units: "t1 [s]".
        SegmentError::OutOfRange { quantity, value } => {
            let (name, unit) = quantity.trim_end_matches(']').split_once(" [").unwrap_or((quantity, ""));
            let name = match name {
                "t1" => "the time of a pulse of jerk",
                // Of a ramp's hold, or of a cruise.
                "t2 − t1" => "the time without jerk",
                name => name,
            };
            let expected = match unit {
                // The one length that depends on the number type, and that f32 alone can refuse here.
                "mm" if name.starts_with("jerk") => format!(
                    "at most {} mm, for positions good to a quarter of a 0.1 µm count in f32: \
                     a higher jerk limit or a lower feed",
                    <f32 as motion_kernel::num::Real>::RAMP_MM_MAX
                ),
                "s" => at_most_ticks(tick_s),
                "mm" => format!("from 0 to {} mm", Position::LIMIT_MM),
                _ => {
                    "a number that is not below 0 and within the range of the kernel's number type".to_owned()
                }
            };
            // All digits of 1e160 help nobody.
            if (1e-3..1e9).contains(&value) {
                format!("{name} = {value} {unit}, expected {expected}")
            } else {
                format!("{name} = {value:e} {unit}, expected {expected}")
            }
        }
        SegmentError::LengthMismatch { ramp_mm, path_mm } => {
            format!("a ramp of {ramp_mm} mm, expected the length of its path, {path_mm} mm")
        }
        _ => error.to_string().replacen(": expected", ", expected", 1),
    }
}

/// The longest duration of a dwell, or of a part of a move at constant feed or acceleration.
fn at_most_ticks(tick_s: f64) -> String {
    format!("at most {} s ({} ticks)", Ticks::LIMIT * tick_s, Ticks::LIMIT)
}
