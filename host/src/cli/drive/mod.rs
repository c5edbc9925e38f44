//! `motion drive`: experiments with the drives, through the kernel.
//!
//! - [`step`]: the velocity steps within one tick;
//! - [`harmonic`]: amplitude and phase over frequency;
//! - [`inertia`]: harmonic motion under a growing load;
//! - [`circle`]: contour error over frequency;
//! - [`compare`]: regulators side by side;
//! - [`bode`]: the step's spectrum, harmonics and the linear model side by side;
//! - [`excitation`]: the program to record; [`identify`]: an axis from a recording;
//! - [`screw`]: backlash and pitch error, from where the load was measured;
//! - [`tune`]: identification, proposal, verification (`verification`).

pub mod bode;
pub mod circle;
pub mod compare;
pub mod excitation;
pub mod harmonic;
pub mod identify;
pub mod inertia;
pub mod screw;
pub mod step;
pub mod tune;

mod verification;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::input;
use super::outputs::{self, Written};
use super::table::{self, Align};
use crate::drive::experiment::fastest_mm_s;
use crate::drive::reference::Comparison;
use crate::drive::{DriveError, Terms};
use crate::files::{Files, OutputFile};
use crate::machine::Machine;
use crate::report::Findings;

/// More frequencies than this mean a mistyped step.
const FREQUENCIES_MAX: f64 = 1000.0;
/// A last frequency this close to the end, in steps, is taken as the end.
const SAME_STEP: f64 = 1e-6;

const EXAMPLES: &str = "\
Examples:
  motion drive step                                  delay, time constant, overshoot, peaks, bandwidth
  motion drive harmonic --from 8 --to 40 --by 4      amplitude and phase of X and Y, open loop
  motion drive inertia --loads 0,1,2                 the current limit, seen under load
  motion drive circle --report circle.html           contour error with V, VA and VAJ feedforward
  motion drive compare --report regulators.html      regulators side by side, with coarse set-points
  motion drive bode --axis Y --json                  curves from step, harmonics and the linear model
  motion drive excitation --axis Y --output y.ngc    the program whose run shows the drive of Y
  motion drive identify --axis Y --from y.csv        Y's drive from a recording of it
  motion drive screw --pitch-mm 5 --from x.csv       backlash and pitch error of X, as an instrument saw them
  motion drive tune --machine mine.toml --output mine.toml
                                                     identify the axes and set their regulators

On the reference machine at the published settings, the published figures are shown, too; exit status 1 if the run
misses the figures expected of the machine.";

/// Experiments with the drives: velocity step, harmonic motion, circle test. All run through planner and
/// kernel.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct DriveArguments {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    Step(step::StepArguments),
    Harmonic(harmonic::HarmonicArguments),
    Inertia(inertia::InertiaArguments),
    Circle(circle::CircleArguments),
    Compare(compare::CompareArguments),
    Bode(bode::BodeArguments),
    Excitation(excitation::ExcitationArguments),
    Identify(identify::IdentifyArguments),
    Screw(screw::ScrewArguments),
    Tune(tune::TuneArguments),
}

/// Makes the experiment and prints its figures.
///
/// # Errors
/// An argument or the machine file is refused, a fault ended the run, or a file can't be written.
pub fn drive(arguments: &DriveArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    match &arguments.experiment {
        Experiment::Step(arguments) => step::run(arguments, out),
        Experiment::Harmonic(arguments) => harmonic::run(arguments, out),
        Experiment::Inertia(arguments) => inertia::run(arguments, out),
        Experiment::Circle(arguments) => circle::run(arguments, out),
        Experiment::Compare(arguments) => compare::run(arguments, out),
        Experiment::Bode(arguments) => bode::run(arguments, out),
        Experiment::Excitation(arguments) => excitation::run(arguments, out),
        Experiment::Identify(arguments) => identify::run(arguments, out),
        Experiment::Screw(arguments) => screw::run(arguments, out),
        Experiment::Tune(arguments) => tune::run(arguments, out),
    }
}

/// The options of every experiment.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Write a self-contained HTML page with the curves; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print JSON; every key carries its unit.
    #[arg(long)]
    json: bool,
}

impl Common {
    fn machine(&self) -> Result<Machine, CliError> {
        input::xyz_machine(self.machine.as_ref())
    }

    /// Opened before the experiment: a wrong path should not cost the user a long run.
    fn report(&self) -> Result<Option<OutputFile>, CliError> {
        let mut files = Files::reading([("--machine", self.machine.as_deref())]);
        Ok(outputs::open(&mut files, "--report", self.report.as_ref())?)
    }

    /// Writes the page, and says where, except in JSON output.
    fn write_report(
        &self,
        report: Option<OutputFile>,
        out: &mut dyn Write,
        findings: impl FnOnce() -> Result<Findings, DriveError>,
    ) -> Result<(), CliError> {
        if report.is_none() {
            return Ok(());
        }
        let findings = findings()?;
        let mut written = Written::default();
        written.write("report", report, |file| findings.write(file));
        if written.place_of("report").is_some() && !self.json {
            writeln!(out).map_err(CliError::Output)?;
            written.say(out)?;
        }
        written.outcome(Outcome::Done).map(drop)
    }
}

/// Feedforward terms, as options call them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Feedforward {
    /// Velocity only.
    V,
    /// Velocity and acceleration.
    Va,
    /// Velocity, acceleration and jerk.
    Vaj,
    /// All that the machine file has.
    AsIs,
}

impl Feedforward {
    fn terms(self) -> Terms {
        match self {
            Self::V => Terms::V,
            Self::Va => Terms::Va,
            Self::Vaj => Terms::Vaj,
            Self::AsIs => Terms::AsIs,
        }
    }
}

/// The axis of that name.
fn axis_named(machine: &Machine, name: &str) -> Result<usize, CliError> {
    let found = machine.axes.iter().position(|axis| axis.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| CliError::Arguments {
        found: format!("axis {name}"),
        expected: "the name of an axis of the machine",
    })
}

/// The part of the greatest feed that an experiment takes which would ask for more.
const REACH_SHARE: f64 = 0.9;

/// The feed of an experiment \[mm/min\]: what was asked for, or else the published one, or nine tenths of what the
/// outputs of `axes` reach if that is less.
fn feed_mm_min(machine: &Machine, axes: &[usize], asked: Option<f64>, published: f64) -> f64 {
    let reach_mm_min = REACH_SHARE * 60.0 * fastest_mm_s(machine, axes);
    asked.unwrap_or(if published <= reach_mm_min { published } else { reach_mm_min.floor() })
}

/// `from`, `from + by`, … up to `to`.
fn frequencies(from_hz: f64, to_hz: f64, by_hz: f64) -> Result<Vec<f64>, CliError> {
    let steps = (to_hz - from_hz) / by_hz;
    if !(from_hz > 0.0 && by_hz > 0.0 && (0.0..FREQUENCIES_MAX).contains(&steps)) {
        return Err(CliError::Arguments {
            found: format!("frequencies from {from_hz} to {to_hz} by {by_hz} Hz"),
            expected: "positive frequencies in ascending order, at most 1000 of them",
        });
    }
    Ok((0..=(steps + SAME_STEP) as u32).map(|step| from_hz + f64::from(step) * by_hz).collect())
}

#[derive(Serialize)]
struct ComparisonJson {
    quantity: &'static str,
    unit: &'static str,
    measured: f64,
    expected: f64,
    tolerance: f64,
    published: f64,
    holds: bool,
}

fn comparisons_json(comparisons: &[Comparison]) -> Vec<ComparisonJson> {
    comparisons
        .iter()
        .map(|comparison| ComparisonJson {
            quantity: comparison.figure.quantity,
            unit: comparison.figure.unit,
            measured: comparison.measured,
            expected: comparison.figure.expected,
            tolerance: comparison.figure.tolerance,
            published: comparison.figure.paper,
            holds: comparison.holds(),
        })
        .collect()
}

/// Writes the figures next to the published and the expected ones; nothing if there are none.
fn write_comparisons(comparisons: &[Comparison], out: &mut dyn Write) -> io::Result<()> {
    if comparisons.is_empty() {
        return Ok(());
    }
    writeln!(out, "\nThe reference machine's figures\n")?;
    let columns = [
        ("figure", "", Align::Left),
        ("measured", "", Align::Right),
        ("expected", "", Align::Right),
        ("±", "", Align::Right),
        ("published", "", Align::Right),
        ("unit", "", Align::Left),
        ("", "", Align::Left),
    ];
    let rows: Vec<[String; 7]> = comparisons
        .iter()
        .map(|comparison| {
            let figure = &comparison.figure;
            [
                figure.quantity.to_owned(),
                format!("{:.2}", comparison.measured),
                format!("{:.2}", figure.expected),
                figure.tolerance.to_string(),
                figure.paper.to_string(),
                figure.unit.to_owned(),
                if comparison.holds() { "holds" } else { "MISSED" }.to_owned(),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}

fn outcome(comparisons: &[Comparison]) -> Outcome {
    if comparisons.iter().all(Comparison::holds) { Outcome::Done } else { Outcome::Failed }
}

/// A figure that may be missing.
fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}"))
}

/// Whether a feed given in mm/min is `mm_s`.
fn is_feed(feed_mm_min: f64, mm_s: f64) -> bool {
    (feed_mm_min / 60.0 - mm_s).abs() < 1e-9 * mm_s
}
