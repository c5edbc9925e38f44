//! A board at a port, for the commands that talk to one.

use clap::Args;

use super::error::{CliError, Outcome};
use crate::board::port::unique;
use crate::board::sender::{Found, Permissions};
use crate::board::simulator::{self, SimulatedBoard};
use crate::board::wire::Wire;
use crate::board::{Board, BoardError, Connection, Port, operated};
use crate::machine::Machine;
use crate::planning::on_axis_count;

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

/// What a command may do with a board's drives.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct DriveArguments {
    /// Switch the drives on if they are off.
    #[arg(long)]
    enable: bool,
    /// Clear a fault of the board before that.
    #[arg(long, requires = "enable")]
    clear_fault: bool,
    /// Switch the drives off at the end.
    #[arg(long)]
    disable: bool,
}

impl DriveArguments {
    /// What a sender may do.
    pub(super) fn permissions(self, found: Found) -> Permissions {
        Permissions { enables: self.enable, clears_fault: self.clear_fault, disables: self.disable, found }
    }
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

/// What a move that a PC has to ask for all the time may do with a board, for commands that do without one, too.
#[derive(Debug, Args)]
pub(super) struct OptionalBoard {
    #[command(flatten)]
    port: OptionalPort,
    /// On a board: after so long a silence of this command it comes to rest, s; 0.15 to 60.
    #[arg(long, value_name = "S", default_value_t = 0.25, requires = "port")]
    dead_man: f64,
    /// On a board: switch the drives on if they are off.
    #[arg(long, requires = "port")]
    enable: bool,
    /// On a board: give up what it has of a program.
    #[arg(long, requires = "port")]
    restart: bool,
}

impl OptionalBoard {
    /// The port, if one is asked for.
    pub(super) fn given(&self) -> Option<PortArguments> {
        self.port.given()
    }

    /// The time of the dead man \[ms\].
    pub(super) fn dead_man_ms(&self) -> Result<u16, CliError> {
        let dead_man_s = self.dead_man;
        // A PC that has nothing else to say says something ten times a second.
        if (0.15..=60.0).contains(&dead_man_s) {
            return Ok((dead_man_s * 1e3).round() as u16);
        }
        let found = format!("--dead-man {dead_man_s}");
        Err(CliError::Arguments { found, expected: "from 0.15 to 60 s" })
    }

    /// What a sender may do.
    pub(super) fn permissions(&self) -> Permissions {
        let found = if self.restart { Found::GivenUp } else { Found::Stays };
        Permissions { enables: self.enable, found, ..Permissions::default() }
    }
}

impl OptionalPort {
    /// The port, if one is asked for.
    pub(super) fn given(&self) -> Option<PortArguments> {
        Some(PortArguments { port: self.port.clone()?, baud: self.baud })
    }
}

impl OptionalPort {
    /// The board there, or the simulated one.
    pub(super) fn operated<const N: usize>(&self, machine: &Machine<N>) -> Result<Box<dyn Board>, CliError> {
        let port = self.port.clone().unwrap_or(Port::Simulator);
        operated::open(machine, &port, self.baud)
            .map_err(|source| CliError::Board { port: port.to_string(), source })
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
        let (board, wire) = simulator::start(machine, unique(), 1.0)
            .map_err(|source| CliError::Run { program: machine.name.clone(), source })?;
        let mut wire = Some(Box::new(wire) as Box<dyn Wire>);
        let open = Box::new(move || wire.take().ok_or_else(|| std::io::ErrorKind::BrokenPipe.into()));
        let connection = Connection::open(open, unique()).map_err(|error| self.refused(error.into()))?;
        Ok((connection, board))
    }

    /// Connects to a board for a machine, waits for its answer, and does the work.
    pub(super) fn on_board<const N: usize>(
        &self,
        machine: &Machine<N>,
        work: impl OnBoard,
    ) -> Result<Outcome, CliError> {
        if self.port == Port::Simulator {
            let (mut connection, _board) = self.simulated(machine)?;
            connection.greet().map_err(|error| self.refused(error))?;
            return work.run::<N>(connection);
        }
        on_axis_count!(machine.axis_count(), in N, M => {
            let mut connection = self.open::<M>()?;
            connection.greet().map_err(|error| self.refused(error))?;
            work.run::<M>(connection)
        })
    }

    /// Opens the port for a board of `M` axes.
    pub(super) fn open<const M: usize>(&self) -> Result<Connection<M>, CliError> {
        let (port, baud) = (self.port.clone(), self.baud);
        let open = Box::new(move || port.open(baud));
        Connection::open(open, unique()).map_err(|error| self.refused(error.into()))
    }
}

/// What a command does with a board that has answered.
pub(super) trait OnBoard {
    /// With a board of `M` axes.
    fn run<const M: usize>(self, connection: Connection<M>) -> Result<Outcome, CliError>;
}
