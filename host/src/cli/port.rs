//! A board at a port, for the commands that talk to one.

use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;

use super::error::CliError;
use crate::board::simulator::{self, SimulatedBoard};
use crate::board::wire::Wire;
use crate::board::{BoardError, Connection, Port};
use crate::machine::Machine;

/// Where the board is.
#[derive(Clone, Debug, Args)]
pub(super) struct PortArguments {
    /// Where the board is: `tcp:HOST:PORT`, a serial port such as `/dev/ttyACM0` or `COM3`, or `simulator` for the
    /// simulated machine in this process.
    #[arg(long)]
    pub(super) port: Port,
    /// Bits a second of a serial port.
    #[arg(long, value_name = "BITS_S", default_value_t = 921_600)]
    baud: u32,
}

/// Where a board is, for commands that do without one, too.
#[derive(Debug, Args)]
pub(super) struct OptionalPort {
    /// Where the board is, as of `motion send`; without it, the simulated machine moves in no time.
    #[arg(long)]
    port: Option<Port>,
    /// Bits a second of a serial port.
    #[arg(long, value_name = "BITS_S", default_value_t = 921_600, requires = "port")]
    baud: u32,
}

impl OptionalPort {
    /// The port, if one is asked for.
    pub(super) fn given(&self) -> Option<PortArguments> {
        Some(PortArguments { port: self.port.clone()?, baud: self.baud })
    }
}

impl PortArguments {
    /// An error at this port.
    pub(super) fn refused(&self, source: BoardError) -> CliError {
        CliError::Board { port: self.port.to_string(), source }
    }

    /// Starts the simulated board, and connects to it; it lives as long as what comes with the connection.
    pub(super) fn simulated<const N: usize>(
        &self,
        machine: &Machine<N>,
    ) -> Result<(Connection<N>, SimulatedBoard), CliError> {
        let (board, wire) = simulator::start(machine, number(), 1.0)
            .map_err(|source| CliError::Run { program: machine.name.clone(), source })?;
        let mut wire = Some(Box::new(wire) as Box<dyn Wire>);
        let open = Box::new(move || wire.take().ok_or_else(|| std::io::ErrorKind::BrokenPipe.into()));
        let connection = Connection::open(open, number()).map_err(|error| self.refused(error.into()))?;
        Ok((connection, board))
    }

    /// Opens the port for a board of `M` axes.
    pub(super) fn open<const M: usize>(&self) -> Result<Connection<M>, CliError> {
        let (port, baud) = (self.port.clone(), self.baud);
        let open = Box::new(move || port.open(baud));
        Connection::open(open, number()).map_err(|error| self.refused(error.into()))
    }
}

/// A number that no other start has: of the time.
pub(super) fn number() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    now.as_secs() as u32 ^ now.subsec_nanos().rotate_left(2)
}
