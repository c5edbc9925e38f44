//! `motion spline`: from points to a spline, to pieces and to a run; without points, the experiment on path
//! smoothness.

mod experiment;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::input;
use super::outputs::Outputs;
use super::run::{self, RunJson};
use super::trace::TraceArguments;
use super::write_json;
use crate::files::Files;
use crate::planning::plan_spline;
use crate::planning::spline::Pieces;
use crate::points::{self, Points};
use crate::report::spline::spline_findings;
use crate::simulate::RunOptions;
use crate::toolpath::spline::{self, Degree, Spline, SplineError};

const HELP: &str = "\
POINTS.csv has the heading x_mm,y_mm,z_mm or x_mm,y_mm,z_mm,u and one point per line; without u, the parameter grows by the
distance from point to point. The spline goes through all points or, with a tolerance, within that distance of each and
with fewer knots. A quintic one has continuous derivatives up to the fourth, so the jerk of every axis is continuous; a cubic
one steps in jerk at its knots. The machine moves from the origin to the first point by a rapid.

Examples:
  motion spline points.csv --feed 3000               through all points, on the reference machine
  motion spline points.csv --tolerance 0.01 --report points.html
                                                     within 10 µm of each; the run, points, deviation
  motion spline --report smoothness.html             published arcs, cubic and quintic side by side

JSON of a run: that of `motion run`, and spline: degree, points, spans, length_mm, deviation_mm (greatest, of a point),
jerk_step_mm_s3 (greatest, at a knot and the programmed feed), pieces, position_error_mm and feed_error (of the pieces).
JSON of the experiment: feed_mm_s, tick_s; paths: list of name, length_mm, time_s, ticks, deviation_mm (from the arcs), junctions
(time_s, published_s, accel_step_mm_s2 of X and Y, jerk_step_mm_s3), by_tick (tick_s, jerk_max_mm_s3, jerk_step_max_mm_s3);
evaluators: list of name, feed_error, feed_error_badly_parametrised.";

/// Run a spline through points, or compare arcs, cubic and quintic splines.
///
/// Without POINTS.csv: two arcs of 10 and 8 mm radius, and cubic and quintic splines through ten of their
/// points, at constant feed; velocity, acceleration and jerk of the axes.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct SplineArguments {
    /// The points; `-` is standard input.
    #[arg(value_name = "POINTS.csv")]
    points: Option<PathBuf>,
    /// Degree of the spline.
    #[arg(long, value_name = "DEGREE", default_value = "5", requires = "points")]
    degree: DegreeArgument,
    /// Feed, mm/min.
    #[arg(
        long,
        value_name = "MM_MIN",
        default_value_t = 1000.0,
        requires = "points",
        allow_negative_numbers = true
    )]
    feed: f64,
    /// Greatest distance of a point from the spline, mm; 0: the spline goes through all.
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 0.0,
        requires = "points",
        allow_negative_numbers = true
    )]
    tolerance: f64,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE", requires = "points")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    trace: TraceArguments,
    /// Write a self-contained HTML page; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum DegreeArgument {
    /// Continuous acceleration.
    #[value(name = "3")]
    Cubic,
    /// Continuous jerk.
    #[value(name = "5")]
    Quintic,
}

impl DegreeArgument {
    fn degree(self) -> Degree {
        match self {
            Self::Cubic => Degree::Cubic,
            Self::Quintic => Degree::Quintic,
        }
    }
}

/// Runs the points' spline, or makes the experiment.
///
/// # Errors
/// An argument, the points or the machine file is refused, there is no spline or no plan, or a file can't be
/// written.
pub fn run(arguments: &SplineArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    match &arguments.points {
        Some(path) => run_points(path, arguments, out),
        None => experiment::run(arguments, out),
    }
}

fn run_points(path: &Path, arguments: &SplineArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let feed_mm_s = arguments.feed / 60.0;
    if !(feed_mm_s > 0.0 && feed_mm_s.is_finite()) {
        return Err(CliError::Arguments {
            found: format!("--feed {}", arguments.feed),
            expected: "a finite feed above 0 mm/min",
        });
    }
    let mut files = Files::reading([("POINTS.csv", Some(path)), ("--machine", arguments.machine.as_deref())]);
    let mut outputs = Outputs::open(&mut files, &arguments.trace, arguments.report.as_ref(), arguments.json)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let machine = input::xyz_machine(arguments.machine.as_ref())?;
    let source = input::read(path)?;
    let points = points::read(&source.name, &source.text)?;
    let (spline, parameters) = fit(&points, arguments).map_err(|error| {
        let line = error.point().and_then(|point| points.lines.get(point));
        let place = line.map_or_else(|| source.name.clone(), |line| format!("{}:{line}", source.name));
        match error {
            // The error is in an argument, not in the file.
            SplineError::Tolerance { mm } => CliError::Arguments {
                found: format!("--tolerance {mm}"),
                expected: "a finite number of mm that is not below 0",
            },
            source => CliError::Spline { place, source },
        }
    })?;
    let (mut plan, pieces) = plan_spline(&source.name, &spline, &points.lines, feed_mm_s, &machine)?;
    let figures = SplineFigures::of(&spline, points.points.len(), &pieces, feed_mm_s);
    plan.notices.extend(figures.words());
    if outputs.has_report() {
        outputs = outputs.below(spline_findings(&points, &parameters, &spline, arguments.tolerance));
    }
    let (summary, written) = run::execute(&RunOptions::default(), &plan, &machine, outputs, None)?;
    if arguments.json {
        write_json(&SplineJson { run: run::json(&summary), spline: figures }, out)?;
    } else {
        run::write_summary(&summary, out).map_err(CliError::Output)?;
        written.say(out)?;
    }
    written.outcome(Outcome::of(&summary))
}

/// The spline, and the points' parameters.
fn fit(points: &Points, arguments: &SplineArguments) -> Result<(Spline, Vec<f64>), SplineError> {
    let parameters = match &points.parameters {
        Some(parameters) => parameters.clone(),
        None => spline::chord_lengths(&points.points)?,
    };
    let spline = spline::fit(&points.points, &parameters, arguments.degree.degree(), arguments.tolerance)?;
    Ok((spline, parameters))
}

#[derive(Serialize)]
struct SplineJson<'run> {
    #[serde(flatten)]
    run: RunJson<'run>,
    spline: SplineFigures,
}

#[derive(Serialize)]
struct SplineFigures {
    degree: usize,
    points: usize,
    spans: usize,
    length_mm: f64,
    deviation_mm: f64,
    jerk_step_mm_s3: f64,
    pieces: usize,
    position_error_mm: f64,
    feed_error: f64,
}

impl SplineFigures {
    fn of(spline: &Spline, points: usize, pieces: &Pieces, feed_mm_s: f64) -> Self {
        let course = crate::smoothness::course(spline);
        let steps = course.junction_steps(feed_mm_s);
        Self {
            degree: spline.degree().number(),
            points,
            spans: spline.spans().len(),
            length_mm: course.length_mm(),
            deviation_mm: spline.deviation_mm(),
            jerk_step_mm_s3: steps
                .iter()
                .map(crate::smoothness::JunctionStep::jerk_step_mm_s3)
                .fold(0.0, f64::max),
            pieces: pieces.count,
            position_error_mm: pieces.deviation.position_mm,
            feed_error: pieces.deviation.feed,
        }
    }

    fn words(&self) -> [String; 2] {
        let Self { degree, points, spans, length_mm, deviation_mm, jerk_step_mm_s3, .. } = self;
        [
            format!(
                "spline of degree {degree}, {spans} spans, {length_mm:.4} mm: within {deviation_mm:.2e} mm of {points} points; \
                 at the programmed feed the jerk steps by at most {jerk_step_mm_s3:.3} mm/s³ at a knot"
            ),
            format!(
                "compiled to {} pieces of degree 7 in arc length: within {:.1e} mm of the spline, feed within {:.1e} of \
                 what is set",
                self.pieces, self.position_error_mm, self.feed_error
            ),
        ]
    }
}
