//! `motion parameters`: a board's parameters.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use motion_kernel::link::Identity;
use serde_json::Value;

use super::error::{CliError, Outcome};
use super::outputs::Written;
use super::port::PortArguments;
use super::{input, write_json};
use crate::board::job;
use crate::board::parameters::{Difference, Figures, disable, read, write};
use crate::board::{BoardError, Connection, Port};
use crate::files::Files;
use crate::machine::{Machine, on_machine};
use crate::planning::on_axis_count;

const EXAMPLES: &str = "\
Examples:
  motion parameters get --port /dev/ttyACM0                        every figure
  motion parameters get --port /dev/ttyACM0 --output board.bin     the record, to keep
  motion parameters diff --port /dev/ttyACM0 --machine mine.toml   what the board and the file have not in common
  motion parameters set --port /dev/ttyACM0 --machine mine.toml    gives the board the file's machine

A board takes parameters while its drives are off (--disable switches them off), checks them, and starts anew with them. Its machine is a compiled
program without items: limits, scales, gains, feedforward, guards, homing, compensation.

JSON: get: {name: figure, …}; diff: list of {name, board, file}.
Exit status: diff: 1 if something differs.";

/// Read, write or compare the parameters of a board.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ParametersArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Print the board's parameters.
    Get {
        #[command(flatten)]
        port: PortArguments,
        /// Write the record; an existing file is replaced.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Give the board the machine of a file.
    Set {
        #[command(flatten)]
        port: PortArguments,
        /// Machine file (`motion machine` prints one).
        #[arg(long, value_name = "FILE")]
        machine: PathBuf,
        /// Switch the drives off before.
        #[arg(long)]
        disable: bool,
    },
    /// List what the board and a machine file have not in common.
    Diff {
        #[command(flatten)]
        port: PortArguments,
        #[command(flatten)]
        machine: MachineArguments,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
}

#[derive(Debug, Args)]
struct MachineArguments {
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
}

/// Reads, writes or compares.
///
/// # Errors
/// There is no board, it refuses, or a file can't be read or written.
pub fn run(arguments: &ParametersArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    match &arguments.what {
        What::Get { port, output, json } => {
            let mut files = Files::reading([]);
            let output = output.as_ref().map(|path| files.output("--output", path)).transpose()?;
            let identity = identity(port)?;
            let (record, figures) = on_axis_count!(usize::from(identity.axes), M => of_board::<M>(port))?;
            let mut written = Written::default();
            written.write("parameters", output, |file| file.write_all(&record));
            if *json {
                let figures = figures.iter().map(|(name, value)| (name.to_owned(), value.clone()));
                write_json(&Value::Object(figures.collect()), out)?;
            } else {
                for (name, value) in figures.iter() {
                    writeln!(out, "{name} = {value}").map_err(CliError::Output)?;
                }
            }
            written.outcome(Outcome::Done)
        }
        What::Set { port, machine, disable } => {
            let machine = input::any_machine(Some(machine))?;
            on_machine!(machine, machine => set(port, machine, *disable, out))
        }
        What::Diff { port, machine, json } => {
            let machine = input::any_machine(machine.machine.as_ref())?;
            on_machine!(machine, machine => compare(port, machine, *json, out))
        }
    }
}

/// What the board is, of however many axes.
pub(super) fn identity(port: &PortArguments) -> Result<Identity, CliError> {
    if port.port == Port::Simulator {
        let found = "--port simulator, which this process would start".to_owned();
        return Err(CliError::Arguments { found, expected: "the port of a board (`motion board` is one)" });
    }
    let mut connection = port.open::<1>()?;
    connection.greet().map_err(|error| port.refused(error))?;
    match connection.identity() {
        Some(identity) if (1..=9).contains(&identity.axes) => Ok(*identity),
        _ => Err(port.refused(BoardError::Silent)),
    }
}

fn connected<const M: usize>(port: &PortArguments) -> Result<Connection<M>, CliError> {
    let mut connection = port.open::<M>()?;
    let greeted = connection.greet();
    let linked = greeted.and_then(|()| match connection.identity() {
        Some(identity) => BoardError::unless_linked(identity, M),
        None => Err(BoardError::Silent),
    });
    linked.map(|()| connection).map_err(|error| port.refused(error))
}

fn of_board<const M: usize>(port: &PortArguments) -> Result<(Vec<u8>, Figures), CliError> {
    let record = read(&mut connected::<M>(port)?).map_err(|error| port.refused(error))?;
    let figures = Figures::of::<M>(&record);
    let figures = figures.map_err(|error| port.refused(BoardError::NoParameters(error)))?;
    Ok((record, figures))
}

fn set<const N: usize>(
    port: &PortArguments,
    machine: &Machine<N>,
    disable: bool,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    identity(port)?;
    let identity = on_axis_count!(machine.axis_count(), in N, M => {
        let mut connection = connected::<M>(port)?;
        if disable {
            self::disable(&mut connection).map_err(|error| port.refused(error))?;
        }
        write(&mut connection, &job::parameters::<N, M>(machine)).map_err(|error| port.refused(error))?
    });
    writeln!(out, "{} has machine {:?}, {:08x}", port.port, machine.name, identity.machine)
        .map_err(CliError::Output)?;
    Ok(Outcome::Done)
}

fn compare<const N: usize>(
    port: &PortArguments,
    machine: &Machine<N>,
    json: bool,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    on_axis_count!(machine.axis_count(), in N, M => {
        let (_, board) = of_board::<M>(port)?;
        let file = job::parameters::<N, M>(machine);
        let file = Figures::of::<M>(&file).map_err(|error| port.refused(BoardError::NoParameters(error)))?;
        print(&board.differences(&file), json, out)
    })
}

fn print(differences: &[Difference], json: bool, out: &mut dyn Write) -> Result<Outcome, CliError> {
    if json {
        let list = differences.iter().map(|Difference { name, first, second }| {
            serde_json::json!({ "name": name, "board": first, "file": second })
        });
        write_json(&list.collect::<Vec<_>>(), out)?;
    } else {
        let shown =
            |value: &Option<Value>| value.as_ref().map_or_else(|| "none".to_owned(), Value::to_string);
        for Difference { name, first, second } in differences {
            writeln!(out, "{name}: board {}, file {}", shown(first), shown(second))
                .map_err(CliError::Output)?;
        }
        if differences.is_empty() {
            writeln!(out, "nothing differs").map_err(CliError::Output)?;
        }
    }
    Ok(if differences.is_empty() { Outcome::Done } else { Outcome::Failed })
}
