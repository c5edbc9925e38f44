//! Motion boards over a wire, and a simulated one that is driven in the same way.
//!
//! Consumes a [`Job`], the items of a program; produces motion on a board, and what the board tells of it. Nothing here
//! decides about motion: the board plans and comes to rest by itself, whatever becomes of the wire.
//!
//! - [`port`]: where a board is: an address, a serial port, the simulator;
//! - [`wire`]: bytes in and out;
//! - [`connection`]: the link over a wire that may come and go;
//! - [`numbers`]: the number type of its kernel;
//! - [`job`]: the items of a program for a board's axes, and its name;
//! - [`from_line`]: where a job begins that is driven from a program's line on;
//! - [`sender`]: drives a job, step by step;
//! - [`stops`]: what a program says where it stops;
//! - [`jog`]: jogs of a machine on a board;
//! - [`home`]: homing of a machine on a board;
//! - [`progress`]: how far a program is for sure;
//! - [`scope`]: every tick of a board; [`trigger`]: those around a condition;
//! - [`interface`]: a board as an operator has it; [`operated`]: one at a port;
//! - [`parameters`]: a board's parameters, read, written and compared;
//! - [`flight`]: the ticks that its flight recorder has kept;
//! - [`simulator`]: a board with a simulated machine, in a thread or behind an address;
//! - [`emulated`]: a board in an emulator;
//! - [`error`]: what boards and wires refuse.

pub mod port;
pub mod wire;
pub mod connection;
pub mod items;
pub mod numbers;
pub mod job;
pub mod from_line;
pub mod sender;
pub mod stops;
pub mod jog;
pub mod home;
pub mod progress;
pub mod scope;
pub mod trigger;
pub mod interface;
pub mod operated;
pub mod parameters;
pub mod flight;
pub mod simulator;
pub mod emulated;
pub mod error;

pub use connection::{Connection, Heard};
pub use error::BoardError;
pub use interface::Board;
pub use items::InPlanning;
pub use job::Job;
pub use numbers::Numbers;
pub(crate) use numbers::in_numbers;
pub use port::Port;
pub use scope::Scope;
pub use sender::{Sender, Step};
