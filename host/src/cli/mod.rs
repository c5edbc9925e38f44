//! The command line: what users and scripts rely on.
//!
//! Consumes arguments, files and standard input; produces text for people, `--json` for scripts, CSV for
//! tables. An error is one line on standard error that names file, line and column, what was found and what
//! was expected.
//!
//! | exit status | meaning |
//! |---:|---|
//! | 0 | done: a run came to the end of its program |
//! | 1 | a fault ended the run, a check failed, or the kernel refused the motion |
//! | 2 | wrong input: an argument, a program, a machine file, a path; found before the work |
//! | 3 | the run was held, and no command resumed it |
//! | 4 | the run was aborted |
//! | 5 | the run finished before a command of `--at` was due |
//! | 6 | results could not be written: a file, or standard output |
//! | 130, 143 | interrupted: Ctrl-C (SIGINT), SIGTERM |
//!
//! With 1, 3, 4, 5 and 6 the results are printed, as far as standard output takes them. A reader who leaves
//! early (`| head`) changes no status. In all cases, a file that can't be written completely stays
//! as it was ([`files`](crate::files)).
//!
//! - [`profile`]: one ramp of the feed law, in figures;
//! - [`read`]: the steps of a program;
//! - [`check`]: all refusals of a program, or what it needs and where its time goes;
//! - [`plan`]: the feed plan of a program or a block list;
//! - [`compare`]: the times of programs, exact and blended, compared with the least possible;
//! - [`run`]: a program through plan, kernel and simulated machine;
//! - [`replay`]: runs a recording again;
//! - [`page`]: a page that plans and runs programs in a browser;
//! - [`flight`]: the ticks around a fault, from a board's log;
//! - [`spline`]: points to a spline and its run, or the experiment on path smoothness;
//! - [`drive`]: experiments with the drives: step, harmonic motion, circles;
//! - [`compile`]: a program as bytes, for a board;
//! - [`send`]: a program on a board, over a wire;
//! - [`send::resume`]: a program after a power cut;
//! - [`watch`]: what a board does;
//! - [`panel`]: an operator's panel in the browser;
//! - [`parameters`]: a board's parameters;
//! - [`board`]: a board with the simulated machine;
//! - [`home`]: the simulated axes find their references;
//! - [`jog`]: presses and releases jog keys of the simulated machine;
//! - [`machine`]: the reference machine's file, and the meaning of its keys;
//! - [`demo`]: `motion` without a command;
//! - [`help`]: the list of commands, completions of shells, man pages;
//! - [`error`]: errors and exit statuses;
//! - `input`, `outputs`, `port`, `until_closed`, `table`, `trace`, `units`, `progress`: shared by the commands.

mod against;
pub mod board;
pub mod check;
pub mod compare;
pub mod compile;
pub mod demo;
pub mod drive;
pub mod error;
pub mod flight;
pub mod help;
pub mod home;
pub mod jog;
pub mod machine;
pub mod page;
pub mod panel;
pub mod parameters;
pub mod plan;
pub mod profile;
pub mod read;
pub mod replay;
pub mod run;
pub mod send;
pub mod spline;
pub mod watch;

mod input;
mod outputs;
mod port;
mod progress;
mod scope;
mod table;
mod trace;
mod units;
mod until_closed;

use std::io::{self, BufWriter, Write};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use self::error::{CliError, Outcome};
use self::until_closed::UntilClosed;
use crate::files::interrupt;

/// Columns of help: examples are laid out for them.
const HELP_WIDTH: usize = 120;

const EXAMPLES: &str = "\
Examples:
  motion                                         the built-in demonstration; writes stringer.html
  motion run part.ngc --report part.html         run a program, with a report on the axes
  motion replay part.mrec                        run a recording again, to the same bits
  motion read part.ngc                           the steps of a program, with absolute end points
  motion page                                    a page that plans and runs programs in a browser
  motion check part.ngc                          all refusals at once; time, needs and advice
  motion plan part.ngc                           what limits the feed, block by block
  motion compare parts/                          how long programs take, exact and blended
  motion profile --from 0 --to 200 --accel 500 --jerk 5000 --snap 400000
  motion spline points.csv --tolerance 0.01      a quintic spline close to points, and its run
  motion drive circle --report circle.html       the axes' circle test, with its pictures
  motion compile part.ngc -o part.bin            the plan as bytes, for a board
  motion send part.ngc --port /dev/ttyACM0       a program on a board, over a wire
  motion send part.ngc --port /dev/ttyACM0 --from-line 120
                                                 from the path of line 120 on
  motion resume --port /dev/ttyACM0              goes on after a power cut
  motion panel --port /dev/ttyACM0               an operator's panel in the browser
  motion watch --port /dev/ttyACM0               what the board does
  motion parameters diff --port /dev/ttyACM0 --machine mine.toml
                                                 what the board and the file have not in common
  motion board                                   the simulated machine as a board, behind an address
  motion home --machine mine.toml                the axes find their references
  motion jog X+20 Y-2.5@300 --feed 3000          press keys, release one after 300 ticks
  motion machine > mine.toml                     a machine file to start from
  motion machine --explain                       the meaning of its keys

Exit status:
  0  done: a run came to the end of its program
  1  a fault ended the run, a check failed, or the kernel refused the motion
  2  wrong input, found before the work
  3  the run was held, and no command resumed it
  4  the run was aborted
  5  the run finished before a command of --at was due
  6  results could not be written: a file, or standard output
  130, 143  interrupted by Ctrl-C or SIGTERM
With 1, 3, 4, 5 and 6 the results are printed. A file that can't be written completely stays as it was.";

/// G-code to motion: plans the feed, runs the real-time kernel, and shows how simulated ±10 V axes follow.
///
/// Without a command, plans and runs a built-in program on the built-in machine and writes a report.
#[derive(Debug, Parser)]
#[command(name = "motion", version, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::RunArguments),
    Replay(replay::ReplayArguments),
    Flight(flight::FlightArguments),
    Read(read::ReadArguments),
    Check(check::CheckArguments),
    Plan(plan::PlanArguments),
    Compare(compare::CompareArguments),
    Profile(profile::ProfileArguments),
    Page(page::PageArguments),
    Spline(spline::SplineArguments),
    Drive(drive::DriveArguments),
    Compile(compile::CompileArguments),
    Send(send::SendArguments),
    Resume(send::resume::ResumeArguments),
    Watch(watch::WatchArguments),
    Panel(panel::PanelArguments),
    Parameters(parameters::ParametersArguments),
    Board(board::BoardArguments),
    Home(home::HomeArguments),
    Jog(jog::JogArguments),
    Machine(machine::MachineArguments),
    Completions(help::CompletionsArguments),
    Man(help::ManArguments),
}

/// The arguments, as they are.
fn plain_command() -> clap::Command {
    Cli::command().term_width(HELP_WIDTH)
}

/// The arguments, with a list of commands by purpose.
fn command() -> clap::Command {
    help::grouped(plain_command())
}

/// The whole program: arguments to exit status.
#[must_use]
pub fn main() -> ExitCode {
    interrupt::watch();
    let cli = Cli::from_arg_matches(&command().get_matches()).unwrap_or_else(|error| error.exit());
    let mut out = BufWriter::new(UntilClosed::new(io::stdout().lock()));
    let done = execute(&cli, &mut out);
    // Output printed before an error must appear before it.
    let flushed = out.flush();
    match CliError::all([flushed.map(|()| Outcome::Done).map_err(CliError::Output), done]) {
        Ok(outcome) => outcome.exit_code(),
        Err(failure) => {
            // Nobody may be left to read it, which changes no status.
            let _ = writeln!(io::stderr(), "motion: {failure}");
            failure.exit_code()
        }
    }
}

fn execute(cli: &Cli, out: &mut dyn Write) -> Result<Outcome, CliError> {
    match &cli.command {
        None => demo::demonstrate(out),
        Some(Command::Run(arguments)) => run::run(arguments, out),
        Some(Command::Replay(arguments)) => replay::replay(arguments, out),
        Some(Command::Flight(arguments)) => flight::flight(arguments, out),
        Some(Command::Read(arguments)) => read::read(arguments, out),
        Some(Command::Check(arguments)) => check::run(arguments, out),
        Some(Command::Plan(arguments)) => plan::plan(arguments, out),
        Some(Command::Compare(arguments)) => compare::compare(arguments, out),
        Some(Command::Profile(arguments)) => profile::profile(arguments, out),
        Some(Command::Page(arguments)) => page::page(arguments, out),
        Some(Command::Spline(arguments)) => spline::run(arguments, out),
        Some(Command::Drive(arguments)) => drive::drive(arguments, out),
        Some(Command::Compile(arguments)) => compile::compile(arguments, out),
        Some(Command::Send(arguments)) => send::send(arguments, out),
        Some(Command::Resume(arguments)) => send::resume::resume(arguments, out),
        Some(Command::Watch(arguments)) => watch::watch(arguments, out),
        Some(Command::Panel(arguments)) => panel::run(arguments, out),
        Some(Command::Parameters(arguments)) => parameters::run(arguments, out),
        Some(Command::Board(arguments)) => board::run(arguments, out),
        Some(Command::Home(arguments)) => home::run(arguments, out),
        Some(Command::Jog(arguments)) => jog::run(arguments, out),
        Some(Command::Machine(arguments)) => machine::print(arguments, out),
        Some(Command::Completions(arguments)) => help::completions(arguments, out),
        Some(Command::Man(arguments)) => help::man(arguments, out),
    }
}

/// Writes `value` as indented JSON with a line end.
fn write_json(value: &impl serde::Serialize, out: &mut dyn Write) -> Result<(), CliError> {
    serde_json::to_writer_pretty(&mut *out, value).map_err(|error| CliError::Output(error.into()))?;
    writeln!(out).map_err(CliError::Output)
}

/// The cause of a failed write, in the system's words.
fn csv_failure(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(cause) => cause,
        other => io::Error::other(format!("{other:?}")),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_arguments_are_consistent() {
        super::command().debug_assert();
    }
}
