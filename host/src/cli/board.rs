//! `motion board`: a board behind an address, for those who have none.

use std::io::{self, Write};
use std::net::TcpListener;
use std::path::PathBuf;

use clap::Args;

use super::error::{CliError, Outcome};
use super::input;
use super::port::number;
use crate::board::{BoardError, simulator};
use crate::machine::on_machine;

const EXAMPLES: &str = "\
Examples:
  motion board &                                     the simulated machine as a board, at tcp:127.0.0.1:5000
  motion send part.ngc --port tcp:127.0.0.1:5000 --enable
  motion board --machine mine.toml --listen 127.0.0.1:5001

Runs at the pace of the clock, until it is ended. A new connection replaces the one before.";

/// Be a board with the simulated machine, behind an address.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct BoardArguments {
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Where it takes connections; port 0 for any that is free.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5000")]
    listen: String,
}

/// Runs until the process is ended.
///
/// # Errors
/// The machine file or the address is refused.
pub fn run(arguments: &BoardArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let refused = |error: io::Error| CliError::Board {
        port: format!("--listen {}", arguments.listen),
        source: BoardError::Wire(error),
    };
    let listener = TcpListener::bind(&arguments.listen).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    on_machine!(machine, machine => {
        let board = simulator::listen(machine, number(), listener, 1.0)
            .map_err(|source| CliError::Run { program: machine.name.clone(), source })?;
        writeln!(out, "machine {:?} at tcp:{address}", machine.name)
            .and_then(|()| out.flush())
            .map_err(CliError::Output)?;
        board.wait();
    });
    Ok(Outcome::Done)
}
