//! `motion compile`: a planned program as bytes, for a board.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motion_kernel::num::{Fixed, Root};

use super::error::{CliError, Outcome};
use super::input;
use super::outputs::Written;
use super::progress;
use crate::files::{Files, OutputFile};
use crate::gcode::Program;
use crate::machine::{Machine, on_machine};
use crate::planning::{Executable, Mode, Plan, require_outputs};

const EXAMPLES: &str = "\
Examples:
  motion compile part.ngc --machine mine.toml --output part.bin
  motion compile part.ngc --live --output part.bin            for a board with live control, like the NUCLEO
  motion compile part.ngc --number fixed --output part.bin    for a board without an FPU

The file holds the machine's scales, gains, guards and path limits, every piece of path, every ramp, with --live
the blocks that limit the feed along the path, and a checksum. Its format is documented with motion_kernel::program.";

/// Plan a program and write it for a board, with the machine it is for.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct CompileArguments {
    /// G-code (`-`: standard input).
    program: PathBuf,
    /// The file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// The number type of the board's kernel.
    #[arg(long, value_enum, default_value_t = Number::F32)]
    number: Number,
    /// One pair of sin² ramps per block, whatever the machine's law is; without it, ramps follow it and may
    /// span blocks.
    #[arg(long)]
    per_block: bool,
    /// For a board with live control: include the path's blocks, so that the board can plan anew.
    #[arg(long)]
    live: bool,
    /// Leave out the words of spindle and coolant (M3, M4, M5, S, M7, M8, M9) that the machine has no output for: it has
    /// those of the tables `spindle` and `coolant` of its file. Without this, a program that needs another one is refused.
    #[arg(long)]
    no_spindle: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Number {
    F32,
    Fixed,
}

/// Plans, checks, writes.
///
/// # Errors
/// The program or the machine file is refused, or a file can't be read or written.
pub fn compile(arguments: &CompileArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([
        ("PROGRAM", Some(arguments.program.as_path())),
        ("--machine", arguments.machine.as_deref()),
        ("--parameters", arguments.reading.parameters.as_deref()),
        ("--tools", arguments.reading.tools.as_deref()),
    ]);
    let output = files.output("--output", &arguments.output)?;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.program)?;
    let mode = if arguments.per_block { Mode::PerBlock } else { Mode::Spanning };
    let program = arguments.reading.program(&source, machine.read_options())?;
    on_machine!(machine, machine => compile_for(machine, arguments, &source.name, (&program, mode), output, out))
}

/// Compiles a program for a machine.
fn compile_for<const N: usize>(
    machine: &Machine<N>,
    arguments: &CompileArguments,
    source_name: &str,
    (program, mode): (&Program, Mode),
    output: OutputFile,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    if !arguments.no_spindle {
        require_outputs(source_name, &program.steps, machine)?;
    }
    let plan = progress::plan(source_name, program, machine, mode)?;
    plan.refuse_probes()?;
    let executable = match arguments.number {
        Number::F32 => executable::<f32, N>(&plan, machine),
        Number::Fixed => executable::<Fixed, N>(&plan, machine),
    }?;
    let (count, bytes) = if arguments.live {
        (executable.items.len(), executable.to_live_bytes(machine))
    } else {
        (executable.without_blocks().count(), executable.to_bytes(machine))
    };
    let mut written = Written::default();
    written.write("program", Some(output), |file| file.write_all(&bytes));
    for notice in &plan.notices {
        writeln!(out, "note: {notice}").map_err(CliError::Output)?;
    }
    writeln!(
        out,
        "{}: {} items, {} bytes; {:.3} mm in {:.3} s at {} ticks/s, on machine \"{}\"",
        arguments.output.display(),
        count,
        bytes.len(),
        plan.length_mm,
        plan.time_s,
        (1.0 / machine.tick_s).round(),
        machine.name
    )
    .map_err(CliError::Output)?;
    written.outcome(Outcome::Done)
}

/// The program in the board's number type, if that holds its axes, too.
fn executable<R: Root, const N: usize>(
    plan: &Plan<N>,
    machine: &Machine<N>,
) -> Result<Executable<N>, CliError> {
    machine.axes_config::<R>().map_err(|source| CliError::Axis { machine: machine.name.clone(), source })?;
    Ok(Executable::new::<R>(plan)?)
}
