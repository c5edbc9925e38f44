//! Geometry of the path.
//!
//! Consumes the motion along the path; produces a [`Setpoint`] for every axis. [`piece`] is one stretch
//! of geometry, a line or a polynomial of degree seven in arc length, and its evaluation by the chain
//! rule. `travel` is where the axes may go.

pub mod piece;
mod travel;

pub use piece::{Geometry, Piece, PieceError, Setpoint};
pub(crate) use piece::{Steepness, magnitude};
pub use travel::Travel;
