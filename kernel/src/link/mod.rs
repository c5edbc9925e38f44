//! The link between a PC and a board: bytes in, bytes out, time in.
//!
//! The same code runs at both ends, over any wire that carries bytes: a serial port, a socket, a test. It owns no port and
//! no clock; the caller hands it what came in, and sends what it hands out.
//!
//! ```text
//! PC                                                              board, background
//! ──                                                              ─────
//! HostLink  ── controls: what the operator wants, as a whole ──►  BoardLink ─► Controls      urgent
//!           ── items, numbered, as far as there is room ───────►            ─► ItemQueue     bulk
//!           ── parameters, in pieces, while drives are off ────►            ─► ParameterBuffer
//!           ◄── taken: which came, how many more may ───────────            ◄─ ItemQueue
//!           ◄── status: position, feed, line, fault ────────────            ◄─ Status        may be lost
//!           ◄── flight recorder, row by row, as asked for ────            ◄─ FlightRecorder
//!           ◄── scope: what every tick consumed ───────────────            ◄─ BoardScope    may be lost
//! ```
//!
//! - `frame`: messages on the wire, in COBS with a CRC-32;
//! - `message`: what is said;
//! - `parameters`: new parameters on a board, as they come;
//! - `board`, `host`: the two ends.
//!
//! **Nothing is lost or doubled.** Items have numbers; the board takes the next one only, says which it has, and the PC
//! sends again from there. How many may be under way is what the board has room for.
//!
//! **Controls are a state, not events.** Each message has all of them, so the newest one replaces those before it, whatever
//! was lost, and a hold waits for nothing. Presses that matter by themselves (a resume after a hold of the board's own) are
//! counted.
//!
//! **A session** is the time between two starts of the board. Its number is in every message, so neither end goes on with
//! the other's past. Who asked last has the board; whoever had it before is told, and commands nothing any more.

mod board;
mod frame;
mod host;
mod message;
mod parameters;
#[cfg(test)]
mod tests;

pub use board::{BoardLink, Came, ItemQueue};
pub use frame::{Deframer, FRAME_MAX};
pub use host::{Event, HostLink, PushError};
pub use message::{
    Build, Controls, HomingFailure, HomingProgress, Identity, Mode, Piece, State, Status, WriteError,
};
pub use parameters::ParameterBuffer;
