//! `motion board`: a board behind an address, for those who have none.

use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use clap::Args;

use super::error::{CliError, Outcome};
use super::input;
use crate::board::emulated::{Core, Emulated, EmulatedError};
use crate::board::port::unique;
use crate::board::{job, simulator};
use crate::files::interrupt;
use crate::machine::{Machine, on_machine};

const EXAMPLES: &str = "\
Examples:
  motion board &                                     the simulated machine as a board, at tcp:127.0.0.1:5000
  motion send part.ngc --port tcp:127.0.0.1:5000 --enable
  motion board --machine mine.toml --listen 127.0.0.1:5001
  motion board --emulated                            a Cortex-M4F in QEMU runs what boards run
  motion board --emulated m3 --image linked          a Cortex-M3, in fixed point

Runs at the pace of the clock, until it is ended. It takes one connection after the other, as a serial port does.";

/// Be a board with the simulated machine, behind an address.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct BoardArguments {
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// An emulated board (QEMU) with its machine inside, of three axes.
    #[arg(long, value_name = "m4f|m3", num_args = 0..=1, default_missing_value = "m4f", value_parser = core)]
    emulated: Option<Core>,
    /// The emulated board's image; without it, that of the tests (`cargo test -p motion-tests --test target`).
    #[arg(long, value_name = "FILE", requires = "emulated")]
    image: Option<PathBuf>,
    /// Where it takes connections; port 0 for any that is free.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5000")]
    listen: String,
}

fn core(text: &str) -> Result<Core, String> {
    match text {
        "m4f" => Ok(Core::M4f),
        "m3" => Ok(Core::M3),
        other => Err(format!("found {other}, expected m4f or m3")),
    }
}

/// Runs until the process is ended.
///
/// # Errors
/// The machine file or the address is refused.
pub fn run(arguments: &BoardArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let refused = |source: io::Error| CliError::Listen { address: arguments.listen.clone(), source };
    let listener = TcpListener::bind(&arguments.listen).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    if let Some(core) = arguments.emulated {
        // The emulator opens it again.
        drop(listener);
        return on_machine!(machine, machine => emulate(arguments, core, machine, address, out));
    }
    on_machine!(machine, machine => {
        let board = simulator::listen(machine, unique(), listener, 1.0)
            .map_err(|source| CliError::Run { program: machine.name.clone(), source })?;
        writeln!(out, "machine {:?} at tcp:{address}", machine.name)
            .and_then(|()| out.flush())
            .map_err(CliError::Output)?;
        // It ends with this process, or by a failure that it has told.
        board.wait();
    });
    Ok(Outcome::Failed)
}

fn emulate<const N: usize>(
    arguments: &BoardArguments,
    core: Core,
    machine: &Machine<N>,
    address: SocketAddr,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    if machine.axis_count() != 3 {
        return Err(EmulatedError::Axes(machine.axis_count()).into());
    }
    let image = arguments.image.clone().unwrap_or_else(|| core.image());
    let record = job::parameters::<N, 3>(machine);
    interrupt::hold_first();
    let mut emulated = Emulated::start(core, &image, &record, unique(), address)?;
    // Until it takes connections, or has ended.
    while TcpStream::connect(address).is_err() && !emulated.has_ended().map_err(EmulatedError::Emulator)? {
        thread::sleep(Duration::from_millis(20));
    }
    writeln!(out, "machine {:?} at tcp:{address}", machine.name)
        .and_then(|()| out.flush())
        .map_err(CliError::Output)?;
    // Looked at, so that a signal finds the emulator's owner awake, and it ends with this process.
    while !emulated.has_ended().map_err(EmulatedError::Emulator)? {
        if interrupt::take_asked().is_some() {
            return Ok(Outcome::Done);
        }
        thread::sleep(Duration::from_millis(100));
    }
    Ok(Outcome::Failed)
}
