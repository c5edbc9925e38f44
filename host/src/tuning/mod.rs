//! Tuning: regulator figures from what identification found, each with its reason.
//!
//! Consumes an [`Identification`](crate::identify::Identification) and the axis' settings; produces an [`AxisTuning`].
//! Background. Fails if the recordings do not determine what everything depends on; what else they do not determine
//! stays as the machine file has it, or is left out, and that is said.
//!
//! - [`margins`]: how far a position loop is from swinging;
//! - [`gains`]: the proportional gain that keeps margins;
//! - [`feedforward`]: the drive's inverse, its series, or the gains that leave the least error;
//! - [`known`]: the drive that all of it is made for, as far as it is known;
//! - [`proposal`]: all of it for one axis, in words.

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
