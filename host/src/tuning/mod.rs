//! Tuning: regulator figures from what identification found, each with its reason.
//!
//! Consumes an [`Identification`](crate::identify::Identification) and the axis' settings; produces an [`AxisTuning`].
//! Background, no failure: what the recordings did not determine is left as it is, and said.
//!
//! - [`margins`]: how far a position loop is from swinging;
//! - [`gains`]: the proportional gain that keeps margins;
//! - [`feedforward`]: the drive's inverse, its series, or the gains that leave the least error;
//! - [`proposal`]: all of it for one axis, in words.

pub mod feedforward;
pub mod gains;
pub mod margins;
pub mod proposal;

pub use feedforward::Method;
pub use margins::Margins;
pub use proposal::{AxisTuning, Change, propose};
