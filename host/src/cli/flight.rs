//! `motion flight`: the ticks kept by a board's flight recorder, from the board's log.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::error::{CliError, Outcome};
use super::input::{self, Source};
use super::outputs::Outputs;
use super::trace::TraceArguments;
use crate::files::Files;
use crate::flight;
use crate::machine::{Machine, on_machine};
use crate::simulate::RunInfo;
use crate::trace::{RunTrace, TracedFault};

const EXAMPLES: &str = "\
Examples:
  probe-rs run … | tee board.log                     a board's log, with a fault in it
  motion flight board.log --machine mine.toml --report flight.html
                                                     the ticks around the fault, as pictures

A board writes the last ticks before a fault, and some after it, to its log, one per line, as `flight [01, 03, …]`. The
path position counts from the start of each stretch.";

/// Read the ticks around a fault from a board's log.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct FlightArguments {
    /// The log (`-`: standard input).
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Machine file, for the tick and the axes' names; without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    trace: TraceArguments,
    /// Write a self-contained HTML page; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
}

/// Reads and shows.
///
/// # Errors
/// The log has no frame or a damaged one, or a file can't be read or written.
pub fn flight(arguments: &FlightArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files =
        Files::reading([("LOG", Some(arguments.log.as_path())), ("--machine", arguments.machine.as_deref())]);
    let outputs = Outputs::open(&mut files, &arguments.trace, arguments.report.as_ref(), false)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.log)?;
    on_machine!(machine, machine => show(machine, source, outputs, out))
}

fn show<const N: usize>(
    machine: &Machine<N>,
    source: Source,
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let rows = flight::read(&String::from_utf8_lossy(&source.text))
        .map_err(|error| CliError::Flight { path: source.name.clone(), source: error })?;
    let info = RunInfo { program: source.name, ..RunInfo::of_machine(machine) };
    let faults = rows.iter().find(|row| row.is_faulted).map(|row| TracedFault {
        tick: row.tick,
        axis: None,
        fault: "fault latched".to_owned(),
        detail: "what it was stands in the log".to_owned(),
    });
    let mut trace = RunTrace {
        faults: faults.into_iter().collect(),
        notices: flight::words(&rows, machine),
        ticks: flight::ticks(&rows, machine),
        ..info.empty_trace()
    };
    for (axis, settings) in trace.axes.iter_mut().zip(machine.driven_axes()) {
        axis.following_error_limit_um = settings.following_error_limit_mm * 1e3;
    }
    let written = outputs.of_trace(&info, &trace)?;
    for line in &trace.notices {
        writeln!(out, "  {line}").map_err(CliError::Output)?;
    }
    written.say(out)?;
    written.outcome(Outcome::Done)
}
