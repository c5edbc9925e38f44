//! Geometry of the path, and walking along it.
//!
//! Consumes path positions from the feed law; produces a [`Setpoint`] for every axis.
//!
//! - [`piece`]: one stretch of geometry, a line or a polynomial of degree seven in arc length, and
//!   its evaluation by the chain rule;
//! - [`walk`]: from piece to piece within a tick, a bounded number of them.

pub mod piece;
pub mod walk;

pub use piece::{Geometry, Piece, PieceError, Setpoint};
pub use walk::{PIECES_PER_TICK_MAX, Walker};
