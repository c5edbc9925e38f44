//! Geometry of the path.
//!
//! Consumes the motion along the path; produces a [`Setpoint`] for every axis. `piece` is one stretch of
//! geometry, a line or a polynomial of degree seven in arc length, and its evaluation by the chain rule.
//! `travel` has the range of the axes.
//!
//! ```
//! use motion_kernel::path::{Piece, PieceError};
//! use motion_kernel::units::Position;
//!
//! let at = |mm| Position::from_mm(mm).expect("within a kilometre");
//! let line = Piece::<f32, 2>::line(7, [at(1.0), at(2.0)], [0.6, 0.8], at(10.0))?;
//! assert!((line.end()[1].to_mm() - 10.0).abs() < 1e-6);
//! // A direction must be a unit vector.
//! assert!(Piece::<f32, 2>::line(7, [at(1.0), at(2.0)], [1.0, 1.0], at(10.0)).is_err());
//! # Ok::<(), PieceError>(())
//! ```

mod piece;
mod travel;

pub use piece::{Piece, PieceError, Setpoint};
pub(crate) use piece::{Steepness, magnitude};
pub use travel::Travel;
