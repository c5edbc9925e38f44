//! Tuning: regulator figures from identified parameters, each with its reason.
//!
//! Consumes an [`Identification`](crate::identify::Identification) and the axis' settings; produces an
//! [`AxisTuning`]. Background. Fails if the recordings do not determine the parameters that everything
//! depends on. Other undetermined parameters stay as in the machine file or are left out, and the proposal
//! says so.
//!
//! - [`margins`]: the distance of a position loop from oscillation;
//! - [`gains`]: the gains that keep margins and leave least of disturbances;
//! - [`feedforward`]: the drive's inverse, its series, or the gains that leave the least error;
//! - [`known`]: the drive as far as it is known;
//! - [`proposal`]: the settings of one axis, in words.

pub mod error;
pub mod feedforward;
pub mod gains;
pub mod known;
pub mod margins;
pub mod proposal;

pub use error::TuningError;
pub use feedforward::Method;
pub use margins::Margins;
pub use proposal::{AxisTuning, Change, propose};
