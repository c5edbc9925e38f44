//! `motion jog`: presses and releases jog keys of the simulated machine, or of one on a board.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::outputs::Outputs;
use super::port::{OnBoard, OptionalBoard, PortArguments};
use super::table::{self, Align};
use super::trace::TraceArguments;
use super::units::{InUnit, TableUnits, feed_per_s};
use super::{input, write_json};
use crate::board::jog::Jogs;
use crate::board::{Connection, Job};
use crate::files::{Files, interrupt};
use crate::machine::{Machine, on_machine};
use crate::simulate::job::RunInfo;
use crate::simulate::jog::{Ended, Jogged, Keys, Press};

const EXAMPLES: &str = "\
Examples:
  motion jog X+20 Y-2.5               by an increment [mm; degrees for rotary axes]
  motion jog X+20@300 --feed 3000     the key is released after 300 ticks
  motion jog X+ X- --machine mine.toml
                                      from one soft limit, [axis.travel], to the other
  motion jog X+20 --trace jog.csv     every tick, for a spreadsheet
  motion jog X+20 --port /dev/ttyACM0 --feed 300
                                      on a board; Ctrl-C releases the key

A board holds by itself where nothing comes from this command for the time of --dead-man: the PC or the cable may fail.
There, times and the greatest feed are what it tells some fifty times a second.

JSON: list of {press, from_mm, to_mm, time_s, feed_mm_s (the greatest), ended (\"distance\", \"soft limit\" or \"released\"),
stop_s, stop_mm (from the key's release to rest; null if it was not released on the way)}; of a rotary axis deg in place of mm.

Exit status: 1 if a fault ended a jog, 2 if a key is refused, 4 if Ctrl-C released one; the jogs before it are printed.";

/// Jog axes of the simulated machine, or of one on a board: one key after the other, each until it rests.
///
/// Positions and soft limits count from where the machine is switched on, as in programs.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct JogArguments {
    /// Keys: axis, + or -, a distance in mm or degrees (without one: to the soft limit), and @TICKS for the key's
    /// release.
    #[arg(value_name = "KEY", required = true)]
    presses: Vec<Press>,
    /// Feed, in mm/min or degrees/min, or with its unit: 50mm/s, 10deg/s. Without it, the axis' greatest.
    #[arg(long, value_name = "FEED", value_parser = feed_per_s, allow_negative_numbers = true)]
    feed: Option<f64>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    board: OptionalBoard,
    #[command(flatten)]
    trace: TraceArguments,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct PressJson {
    press: String,
    from_mm: f64,
    to_mm: f64,
    time_s: f64,
    feed_mm_s: f64,
    ended: &'static str,
    stop_s: Option<f64>,
    stop_mm: Option<f64>,
}

impl PressJson {
    fn new(jogged: &Jogged, tick_s: f64) -> Self {
        let &Jogged { ref press, from_mm, to_mm, ticks, feed_mm_s, ended, .. } = jogged;
        let (ended, stop) = match ended {
            Ended::Distance => ("distance", None),
            Ended::SoftLimit => ("soft limit", None),
            Ended::Released { ticks, length_mm } => ("released", Some((ticks as f64 * tick_s, length_mm))),
        };
        Self {
            press: press.to_string(),
            from_mm,
            to_mm,
            time_s: ticks as f64 * tick_s,
            feed_mm_s,
            ended,
            stop_s: stop.map(|(time_s, _)| time_s),
            stop_mm: stop.map(|(_, length_mm)| length_mm),
        }
    }
}

/// Jogs and prints.
///
/// # Errors
/// The machine file or a key is refused, a fault ended a jog, or a file can't be written.
pub fn run(arguments: &JogArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([("--machine", arguments.machine.as_deref())]);
    let outputs = Outputs::open(&mut files, &arguments.trace, None, arguments.json)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    on_machine!(machine, machine => jog(machine, arguments, outputs, out))
}

fn jog<const N: usize>(
    machine: &Machine<N>,
    arguments: &JogArguments,
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let keys = Keys::new(machine, &arguments.presses, arguments.feed)?;
    if let Some(port) = arguments.board.given() {
        if arguments.trace.trace.is_some() {
            let found = "--trace with --port".to_owned();
            return Err(CliError::Arguments {
                found,
                expected: "one of them: `motion watch --scope` traces a board",
            });
        }
        return jog_on_board(machine, arguments, (&port, &keys), out);
    }
    let mut jogged = Vec::new();
    let info = RunInfo::of_machine(machine);
    let (ended, ticks) = outputs.of_ticks(&info, |observe| keys.jog(&mut jogged, observe))?;
    // Finished jogs are written and shown, even if the next key failed.
    let written = ticks.write(|_| info.empty_trace());
    show(&jogged, machine.tick_s, arguments.json, out)?;
    ended.map_err(CliError::Jog)?;
    written.outcome(Outcome::Done)
}

/// The keys on a board.
fn jog_on_board<const N: usize>(
    machine: &Machine<N>,
    arguments: &JogArguments,
    (port, keys): (&PortArguments, &Keys<'_, N>),
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let dead_man_ms = arguments.board.dead_man_ms()?;
    port.on_board(machine, OnKeys { machine, arguments, port, keys, dead_man_ms, out })
}

/// Keys to be pressed on a board.
struct OnKeys<'a, const N: usize> {
    machine: &'a Machine<N>,
    arguments: &'a JogArguments,
    port: &'a PortArguments,
    keys: &'a Keys<'a, N>,
    dead_man_ms: u16,
    out: &'a mut dyn Write,
}

impl<const N: usize> OnBoard for OnKeys<'_, N> {
    /// Presses the keys, which Ctrl-C releases.
    fn run<const M: usize>(self, mut connection: Connection<M>) -> Result<Outcome, CliError> {
        let Self { machine, arguments, port, keys, dead_man_ms, out } = self;
        let job = Arc::new(Job::<M>::new(machine, &[]));
        let axes = machine.axis_names();
        let may = arguments.board.permissions();
        let jogs = Jogs { keys, job, axes, may, dead_man_ms };
        let (mut jogged, mut is_released, mut ended) = (Vec::new(), false, Ok(()));
        interrupt::hold_first();
        for key in 0..keys.count() {
            let one = jogs.press(key, &mut connection, &mut || {
                is_released |= interrupt::take_asked().is_some();
                is_released
            });
            match one {
                Ok(one) => jogged.push(one),
                Err(error) => ended = Err(port.refused(error)),
            }
            if is_released || ended.is_err() {
                break;
            }
        }
        // Where the board is lost it holds by itself.
        let _ = connection.settle();
        show(&jogged, machine.tick_s, arguments.json, out)?;
        ended.map(|()| if is_released { Outcome::Aborted } else { Outcome::Done })
    }
}

/// Prints what became of the keys.
fn show(jogged: &[Jogged], tick_s: f64, is_json: bool, out: &mut dyn Write) -> Result<(), CliError> {
    let press = |jogged: &Jogged| InUnit(jogged.unit, PressJson::new(jogged, tick_s));
    let presses: Vec<InUnit<PressJson>> = jogged.iter().map(press).collect();
    if is_json {
        write_json(&presses, out)?;
    } else if !presses.is_empty() {
        write_table(&presses, out).map_err(CliError::Output)?;
    }
    Ok(())
}

fn write_table(presses: &[InUnit<PressJson>], out: &mut dyn Write) -> io::Result<()> {
    let units = TableUnits::of(presses.iter().map(|InUnit(unit, _)| *unit));
    let columns = [
        ("key", "", Align::Left),
        ("from", units.head("mm"), Align::Right),
        ("to", units.head("mm"), Align::Right),
        ("time", "s", Align::Right),
        ("feed", units.head("mm/s"), Align::Right),
        ("ended by", "", Align::Left),
        ("stop", "s", Align::Right),
        ("stop", units.head("mm"), Align::Right),
    ];
    let stop = |figure: Option<f64>| figure.map_or_else(|| "-".to_owned(), |figure| format!("{figure:.4}"));
    let rows: Vec<[String; 8]> = presses
        .iter()
        .map(|InUnit(unit, press)| {
            let symbol = unit.symbol();
            [
                press.press.clone(),
                units.cell(format!("{:.4}", press.from_mm), symbol),
                units.cell(format!("{:.4}", press.to_mm), symbol),
                format!("{:.4}", press.time_s),
                units.cell(format!("{:.3}", press.feed_mm_s), &format!("{symbol}/s")),
                press.ended.to_owned(),
                stop(press.stop_s),
                units.cell(stop(press.stop_mm), symbol),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}
