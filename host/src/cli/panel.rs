//! `motion panel`: an operator's panel in the browser.

use std::io::{self, Write};
use std::net::TcpListener;
use std::path::PathBuf;

use clap::Args;

use super::error::{CliError, Outcome};
use super::input;
use super::port::OptionalPort;
use crate::files::interrupt;
use crate::machine::{Machine, on_machine};
use crate::panel::desk::Desk;
use crate::panel::picture;
use crate::panel::server::{Access, serve};

const EXAMPLES: &str = "\
Examples:
  motion panel                                       the simulated machine, at http://127.0.0.1:5080/
  motion panel --port /dev/ttyACM0 --machine mine.toml
                                                     a board at a serial port
  motion panel --listen 0.0.0.0:5080 --token Kd93mWq7xT2b   for a tablet in the workshop: http://HOST:5080/?token=Kd93mWq7xT2b

The page loads a program, starts, holds, resumes and aborts it, sets the override, jogs the axes, and keeps ticks around a
trigger. Several tabs see the same; one commands, any may hold and abort. A jog ends when its key, its tab or this command is gone.
When this command ends, the board drives what it has and comes to rest on the path. Ctrl-C holds the machine and ends it.";

/// Serve an operator's panel of a board, or of the simulated machine, to a browser.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PanelArguments {
    #[command(flatten)]
    port: OptionalPort,
    /// Machine file (`motion machine` prints one); without it, the reference machine. The board must have the same.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// Where browsers connect; port 0 for any that is free. Beyond this computer only with --token.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5080")]
    listen: String,
    /// Whoever has it may command the machine, from anywhere: `?token=` in the address. It is sent as it is, so use it in a
    /// network that you trust.
    #[arg(long, value_name = "WORD", value_parser = token)]
    token: Option<String>,
}

/// The shortest token: nobody guesses it.
const TOKEN_LEAST: usize = 12;

/// A word that an address may have.
fn token(text: &str) -> Result<String, String> {
    if text.len() < TOKEN_LEAST || !text.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
        return Err(format!("found `{text}`, expected at least {TOKEN_LEAST} letters and digits"));
    }
    Ok(text.to_owned())
}

/// Serves until Ctrl-C.
///
/// # Errors
/// The machine file or the address is refused, or there is no board.
pub fn run(arguments: &PanelArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    on_machine!(machine, machine => panel(machine, arguments, out))
}

fn panel<const N: usize>(
    machine: &Machine<N>,
    arguments: &PanelArguments,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let refused = |source: io::Error| CliError::Listen { address: arguments.listen.clone(), source };
    let listener = TcpListener::bind(&arguments.listen).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    if !address.ip().is_loopback() && arguments.token.is_none() {
        let found = format!("--listen {} without --token", arguments.listen);
        return Err(CliError::Arguments { found, expected: "a token where others can connect" });
    }
    let options = arguments.reading.options(machine.read_options())?;
    let mut board = arguments.port.operated(machine)?;
    board.watch_ticks().map_err(|source| CliError::Board { port: board.info().port.clone(), source })?;
    let desk = Desk::start(board, options, picture::of_machine(machine));
    let query = arguments.token.as_ref().map_or_else(String::new, |token| format!("?token={token}"));
    writeln!(out, "machine {:?} at http://{address}/{query}", machine.name)
        .and_then(|()| out.flush())
        .map_err(CliError::Output)?;
    interrupt::hold_first();
    let access = Access { token: arguments.token.clone() };
    let served = serve(listener, &desk, access, &mut || interrupt::take_asked().is_some());
    let has_failed = desk.has_ended();
    desk.end();
    served.map_err(refused)?;
    // A thread that has panicked has said so.
    Ok(if has_failed { Outcome::Failed } else { Outcome::Done })
}
