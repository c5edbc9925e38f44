//! `motion flight`: the ticks kept by a board's flight recorder, from the board's log, or from the board.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use motion_kernel::flight::FlightRow;

use super::error::{CliError, Outcome};
use super::input::{self, Source};
use super::outputs::Outputs;
use super::port::{OnBoard, OptionalPort, PortArguments};
use super::trace::TraceArguments;
use crate::board::{self, BoardError, Connection};
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
  motion flight --port /dev/ttyACM0 --trace flight.csv
                                                     from a board on the link, at any time after a fault

A board writes the last ticks before a fault, and some after it, to its log, one per line, as `flight [01, 03, …]`, and
keeps them until the fault is cleared. The path position counts from the start of each stretch.

Exit status: 1 if the board has kept no ticks.";

/// Read the ticks around a fault from a board's log, or from a board on the link.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct FlightArguments {
    /// The log (`-`: standard input).
    #[arg(value_name = "LOG", required_unless_present = "port", conflicts_with = "port")]
    log: Option<PathBuf>,
    #[command(flatten)]
    port: OptionalPort,
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
        Files::reading([("LOG", arguments.log.as_deref()), ("--machine", arguments.machine.as_deref())]);
    let outputs = Outputs::open(&mut files, &arguments.trace, arguments.report.as_ref(), false)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    if let Some(port) = arguments.port.given() {
        return on_machine!(machine, machine => {
            port.on_board(machine, OnFlight { machine, port: &port, outputs, out })
        });
    }
    let Some(log) = &arguments.log else {
        let found = "no LOG".to_owned();
        return Err(CliError::Arguments { found, expected: "a board's log, or --port" });
    };
    let source = input::read(log)?;
    on_machine!(machine, machine => read(machine, source, outputs, out))
}

fn read<const N: usize>(
    machine: &Machine<N>,
    source: Source,
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let rows = flight::read(&String::from_utf8_lossy(&source.text))
        .map_err(|error| CliError::Flight { path: source.name.clone(), source: error })?;
    show(machine, (source.name, rows), outputs, out)
}

/// The flight recorder of a board.
struct OnFlight<'a, const N: usize> {
    machine: &'a Machine<N>,
    port: &'a PortArguments,
    outputs: Outputs,
    out: &'a mut dyn Write,
}

impl<const N: usize> OnBoard for OnFlight<'_, N> {
    fn run<const M: usize>(self, mut connection: Connection<M>) -> Result<Outcome, CliError> {
        let Self { machine, port, outputs, out } = self;
        let kept = board::flight::read(&mut connection).map_err(|error| port.refused(error))?;
        if kept.is_empty() {
            return Err(port.refused(BoardError::NoFlight));
        }
        let rows = kept.iter().map(flight::with_places).collect();
        show(machine, (port.port.to_string(), rows), outputs, out)
    }
}

fn show<const N: usize>(
    machine: &Machine<N>,
    (name, rows): (String, Vec<FlightRow<f64, N>>),
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let info = RunInfo { program: name, ..RunInfo::of_machine(machine) };
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
