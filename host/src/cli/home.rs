//! `motion home`: the axes of the simulated machine find their references.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::outputs::Outputs;
use super::table::{self, Align};
use super::trace::TraceArguments;
use super::units::{InUnit, TableUnits};
use super::{input, write_json};
use crate::files::Files;
use crate::machine::{Machine, on_machine};
use crate::simulate::home::{HomeError, HomedAxis, Homes};
use crate::simulate::job::RunInfo;

const EXAMPLES: &str = "\
Examples:
  motion machine > mine.toml          then remove the # before the keys of [axis.homing]
  motion home --machine mine.toml
  motion home --machine mine.toml --trace home.csv
                                      every tick of every axis, for a spreadsheet

JSON: list of {axis, counts, index_counts (how far the index was beyond the switch; null: the switch is the reference),
time_s, position_mm (where the axis stands now), true_mm (the same from where it was switched on)}; of a rotary axis deg in
place of mm.

Exit status: 1 if an axis was not homed, 2 if the machine file homes none; the axes before it are printed.";

/// Home the axes that have [axis.homing] in the machine file, one after the other: search the switch, back
/// off, approach.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct HomeArguments {
    /// Machine file; `motion machine` prints one, with the keys of homing commented out.
    #[arg(long, value_name = "FILE")]
    machine: PathBuf,
    #[command(flatten)]
    trace: TraceArguments,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct AxisJson<'a> {
    axis: &'a str,
    counts: i64,
    index_counts: Option<i64>,
    time_s: f64,
    position_mm: f64,
    true_mm: f64,
}

/// Homes and prints.
///
/// # Errors
/// The machine file is refused or homes no axis, an axis is not homed, or a file can't be written.
pub fn run(arguments: &HomeArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([("--machine", Some(arguments.machine.as_path()))]);
    let outputs = Outputs::open(&mut files, &arguments.trace, None, arguments.json)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let machine = input::any_machine(Some(&arguments.machine))?;
    on_machine!(machine, machine => home(machine, arguments, outputs, out))
}

fn home<const N: usize>(
    machine: &Machine<N>,
    arguments: &HomeArguments,
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let name = arguments.machine.display().to_string();
    let refused = |source: HomeError| CliError::Home { machine: name.clone(), source };
    let homes = Homes::new(machine).map_err(refused)?;
    let mut homed = Vec::new();
    let info = RunInfo::of_machine(machine);
    let (ended, ticks) = outputs.of_ticks(&info, |observe| homes.home(&mut homed, observe))?;
    // Axes already homed are written and shown, even if the next axis failed.
    let written = ticks.write(|_| info.empty_trace());
    if arguments.json {
        let axis = |axis| axis_json(axis, machine.tick_s);
        let axes: Vec<InUnit<AxisJson<'_>>> = homed.iter().map(axis).collect();
        write_json(&axes, out)?;
    } else if !homed.is_empty() {
        write_table(&homed, machine.tick_s, out).map_err(CliError::Output)?;
    }
    ended.map_err(refused)?;
    written.outcome(Outcome::Done)
}

fn axis_json(axis: &HomedAxis, tick_s: f64) -> InUnit<AxisJson<'_>> {
    let HomedAxis { name, homed, ticks, unit, position_mm, true_mm } = axis;
    let json = AxisJson {
        axis: name,
        counts: homed.counts.0,
        index_counts: homed.index_counts,
        time_s: *ticks as f64 * tick_s,
        position_mm: *position_mm,
        true_mm: *true_mm,
    };
    InUnit(*unit, json)
}

fn write_table(homed: &[HomedAxis], tick_s: f64, out: &mut dyn Write) -> io::Result<()> {
    let units = TableUnits::of(homed.iter().map(|axis| axis.unit));
    let columns = [
        ("axis", "", Align::Left),
        ("reference", "counts", Align::Right),
        ("index behind", "counts", Align::Right),
        ("time", "s", Align::Right),
        ("stands at", units.head("mm"), Align::Right),
        ("from switching on", units.head("mm"), Align::Right),
    ];
    let rows: Vec<[String; 6]> = homed
        .iter()
        .map(|axis| {
            [
                axis.name.clone(),
                axis.homed.counts.0.to_string(),
                axis.homed.index_counts.map_or_else(|| "-".to_owned(), |counts| counts.to_string()),
                format!("{:.4}", axis.ticks as f64 * tick_s),
                units.cell(format!("{:.4}", axis.position_mm), axis.unit.symbol()),
                units.cell(format!("{:.4}", axis.true_mm), axis.unit.symbol()),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}
