//! `motion home`: the axes of the simulated machine, or of one on a board, find their references.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use motion_kernel::homing::HomingStage;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::outputs::Outputs;
use super::port::{OnBoard, OptionalBoard, PortArguments};
use super::table::{self, Align};
use super::trace::TraceArguments;
use super::units::{InUnit, TableUnits};
use super::{input, write_json};
use crate::board::home::OnBoardHoming;
use crate::board::{Connection, Job};
use crate::files::{Files, interrupt};
use crate::machine::{Machine, on_machine};
use crate::simulate::home::{HomeError, HomedAxis, Homes};
use crate::simulate::job::RunInfo;

const EXAMPLES: &str = "\
Examples:
  motion machine > mine.toml          then remove the # before the keys of [axis.homing]
  motion home --machine mine.toml
  motion home --machine mine.toml --trace home.csv
                                      every tick of every axis, for a spreadsheet
  motion home --machine mine.toml --axis X --port /dev/ttyACM0 --enable
                                      on a board; Ctrl-C ends it at rest

A board homes by itself, with its own switches and index inputs, and the settings of its parameters. It ends that at
rest where nothing comes from this command for the time of --dead-man. Times are what it tells there, some fifty times
a second.

JSON: list of {axis, counts, index_counts (how far the index was beyond the switch; null: the switch is the reference),
time_s, position_mm (where the axis stands now), true_mm (the same from where it was switched on; null on a board)}; of
a rotary axis deg in place of mm.

Exit status: 1 if an axis was not homed, 2 if the machine file homes none, 4 if Ctrl-C ended it; the axes before it are
printed.";

/// Home the axes that have [axis.homing] in the machine file, one after the other: search the switch, back
/// off, approach.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct HomeArguments {
    /// Machine file; `motion machine` prints one, with the keys of homing commented out.
    #[arg(long, value_name = "FILE")]
    machine: PathBuf,
    /// Home this axis; may be given more than once. Without it, all. The order is that of the machine file.
    #[arg(long = "axis", value_name = "AXIS")]
    axes: Vec<String>,
    #[command(flatten)]
    board: OptionalBoard,
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
    true_mm: Option<f64>,
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
    let homes = Homes::new(machine, &arguments.axes).map_err(|error| refused(error.into()))?;
    if let Some(port) = arguments.board.given() {
        if arguments.trace.trace.is_some() {
            let found = "--trace with --port".to_owned();
            return Err(CliError::Arguments {
                found,
                expected: "one of them: `motion watch --scope` traces a board",
            });
        }
        let dead_man_ms = arguments.board.dead_man_ms()?;
        let (port, is_json) = (&port, arguments.json);
        return port.on_board(
            machine,
            OnHoming { machine, arguments, axes: homes.mask(), port, dead_man_ms, is_json, out },
        );
    }
    let mut homed = Vec::new();
    let info = RunInfo::of_machine(machine);
    let (ended, ticks) = outputs.of_ticks(&info, |observe| homes.home(&mut homed, observe))?;
    // Axes already homed are written and shown, even if the next axis failed.
    let written = ticks.write(|_| info.empty_trace());
    show(&homed, machine.tick_s, arguments.json, out)?;
    ended.map_err(refused)?;
    written.outcome(Outcome::Done)
}

/// Homing on a board.
struct OnHoming<'a, const N: usize> {
    machine: &'a Machine<N>,
    arguments: &'a HomeArguments,
    /// Those to home, the lowest bit is the first one's.
    axes: u16,
    port: &'a PortArguments,
    dead_man_ms: u16,
    is_json: bool,
    out: &'a mut dyn Write,
}

impl<const N: usize> OnBoard for OnHoming<'_, N> {
    /// Homes, until Ctrl-C.
    fn run<const M: usize>(self, mut connection: Connection<M>) -> Result<Outcome, CliError> {
        let Self { machine, arguments, axes, port, dead_man_ms, is_json, out } = self;
        let job = Arc::new(Job::<M>::new(machine, &[]));
        let may = arguments.board.permissions();
        let homing = OnBoardHoming { machine, job, may, dead_man_ms };
        let mut homed = Vec::new();
        interrupt::hold_first();
        let ended = homing.home(
            axes,
            &mut connection,
            &mut homed,
            &mut || interrupt::take_asked().is_some(),
            &mut |axis, stage| {
                if !is_json {
                    eprintln!("{axis}: {}", stage_words(stage));
                }
            },
        );
        // Where the board is lost it comes to rest by itself.
        let _ = connection.settle();
        show(&homed, machine.tick_s, is_json, out)?;
        let is_given_up = ended.map_err(|error| port.refused(error))?;
        if is_given_up {
            eprintln!("given up: the machine is at rest");
            return Ok(Outcome::Aborted);
        }
        Ok(Outcome::Done)
    }
}

fn stage_words(stage: HomingStage) -> &'static str {
    match stage {
        HomingStage::Search => "searches the switch",
        HomingStage::BackOff => "backs off the switch",
        HomingStage::Approach => "approaches the switch",
        HomingStage::Index => "looks for the index",
        HomingStage::Park => "goes to its park position",
    }
}

/// Prints what was found.
fn show(homed: &[HomedAxis], tick_s: f64, is_json: bool, out: &mut dyn Write) -> Result<(), CliError> {
    if is_json {
        let axes: Vec<InUnit<AxisJson<'_>>> = homed.iter().map(|axis| axis_json(axis, tick_s)).collect();
        write_json(&axes, out)
    } else if homed.is_empty() {
        Ok(())
    } else {
        write_table(homed, tick_s, out).map_err(CliError::Output)
    }
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
                axis.true_mm.map_or_else(
                    || "-".to_owned(),
                    |true_mm| units.cell(format!("{true_mm:.4}"), axis.unit.symbol()),
                ),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}
