//! `motion drive identify`: the parameters of an axis, from a recording or from the simulated machine.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::axis_named;
use super::tune::FoundJson;
use crate::cli::error::{CliError, Outcome};
use crate::cli::input;
use crate::cli::write_json;
use crate::drive::DriveError;
use crate::drive::recorded::{self, Scales};
use crate::identify::{Identification, identify};
use crate::machine::Machine;
use crate::tuning::identify_axes;

const HELP: &str = "\
With --from nothing is simulated and nothing moves. The file is a recording (`motion run --record`, `motion send
--record`), which holds its own scales, or CSV with the heading time_s,command_v,counts and a row for every control
tick: the converter's output in V, and the encoder's count. It begins at rest. `motion drive excitation` writes the
program to record. Without --from the simulated axis of the machine file is identified.

Examples:
  motion drive identify --axis Y --machine mine.toml --from y.csv
  motion drive identify --from x.csv --mm-s-at-10-v 333.3 --mm-per-count 0.0001 --json

JSON: axis, found (as in `motion drive tune`), misfit_per_reading (1: the model explains the recording; above 1.2 the axis
has something that it lacks), encoder_step_mm, lacks: list of what the recording does not show.";

/// Identify an axis from a recording, or the simulated one.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct IdentifyArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// The recording: of `motion`, or CSV.
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Velocity at 10 V, mm/s; without it, the machine file's. For CSV.
    #[arg(long, value_name = "MM_S", requires = "from", allow_negative_numbers = true)]
    mm_s_at_10_v: Option<f64>,
    /// Travel of a count, mm; without it, the machine file's. For CSV.
    #[arg(long, value_name = "MM", requires = "from", allow_negative_numbers = true)]
    mm_per_count: Option<f64>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Print JSON; every key carries its unit.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct IdentifyJson<'run> {
    axis: &'run str,
    found: FoundJson,
    misfit_per_reading: f64,
    encoder_step_mm: f64,
    lacks: Vec<&'static str>,
}

/// Reads or runs, identifies, prints.
///
/// # Errors
/// An argument or a file is refused, or the axis can't be identified.
pub fn run(arguments: &IdentifyArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::xyz_machine(arguments.machine.as_ref())?;
    let axis = axis_named(&machine, &arguments.axis)?;
    let settings = &machine.axes[axis];
    let scales = Scales {
        mm_s_at_10_v: arguments.mm_s_at_10_v.unwrap_or(settings.mm_s_at_10_v),
        mm_per_count: arguments.mm_per_count.unwrap_or(settings.mm_per_count),
    };
    for (found, name) in [(scales.mm_s_at_10_v, "--mm-s-at-10-v"), (scales.mm_per_count, "--mm-per-count")] {
        if !(found.is_finite() && found != 0.0) {
            return Err(CliError::Arguments {
                found: format!("{name} {found}"),
                expected: "a number that is not 0",
            });
        }
    }
    let found = match &arguments.from {
        Some(path) => from_recording(&machine, axis, path, scales)?,
        None => identify_axes(&machine, &[axis])?.remove(0),
    };
    let lacks = found.lacks();
    if arguments.json {
        let json = IdentifyJson {
            axis: &settings.name,
            found: FoundJson::of(&found),
            misfit_per_reading: found.misfit_per_reading,
            encoder_step_mm: found.figures.resolution_mm,
            lacks,
        };
        write_json(&json, out)?;
    } else {
        writeln!(out, "Axis {}\n\n{found}", settings.name).map_err(CliError::Output)?;
        for lack in lacks {
            writeln!(out, "  note: {lack}").map_err(CliError::Output)?;
        }
    }
    Ok(Outcome::Done)
}

/// Identifies axis `axis` of `machine` from a file.
pub(super) fn from_recording(
    machine: &Machine,
    axis: usize,
    path: &Path,
    scales: Scales,
) -> Result<Identification, CliError> {
    let source = input::read(path)?;
    let recording = recorded::read(&source.name, &source.text, axis, scales)?;
    let name = machine.axes[axis].name.clone();
    identify(&[recording]).map_err(|source| DriveError::Identification { axis: name, source }.into())
}
