//! Tuning: regulator figures from identified parameters, each with its reason.
//!
//! Consumes the axes of a [`Machine`](crate::machine::Machine), which it has recorded and identified; produces an
//! [`AxisTuning`] of each. Background. Fails if the recordings do not determine the parameters that everything
//! depends on. Other undetermined parameters stay as in the machine file or are left out, and the proposal
//! says so.
//!
//! - [`exploration`]: what to record of an axis, and its identification;
//! - [`margins`]: the distance of a position loop from oscillation;
//! - [`gains`]: the gains that keep margins and leave least of disturbances;
//! - [`feedforward`]: the drive's inverse, its series, or the gains that leave the least error;
//! - [`known`]: the drive as far as it is known;
//! - [`proposal`]: the settings of one axis, in words.

pub mod error;
pub mod exploration;
pub mod feedforward;
pub mod gains;
pub mod known;
pub mod margins;
mod position_loop;
pub mod proposal;

pub use error::TuningError;
pub use exploration::{identify_axes, identify_to_tune};
pub use feedforward::Method;
pub use margins::Margins;
pub use proposal::{AxisTuning, Change, propose};
