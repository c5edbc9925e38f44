//! Reasons why there is no proposal for an axis.

use motion_kernel::axis::ScaleError;

use super::gains::{GAIN_MIN, KP_MIN_PER_S, PHASE_MIN_DEG};
use crate::identify::{DETERMINED, Estimate};

/// What was found of an axis is nothing to tune by.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TuningError {
    /// A parameter that everything depends on is not known.
    #[error(
        "tuning of axis {axis}: found {quantity} {value:.6} ± {width:.6}, expected recordings that determine it to \
         ± {percent:.0} %",
        value = .estimate.value,
        width = .estimate.half_width_95,
        percent = 100.0 * DETERMINED
    )]
    Undetermined {
        /// The axis's name.
        axis: String,
        /// The parameter and its unit.
        quantity: &'static str,
        /// What is known of it.
        estimate: Estimate,
    },
    /// No position loop keeps its margins.
    #[error(
        "tuning of axis {axis}: found a lag that leaves no gain of the position loop its margins, expected {PHASE_MIN_DEG}° and a \
         factor {GAIN_MIN} from kp = {KP_MIN_PER_S} 1/s on"
    )]
    Lag {
        /// The axis's name.
        axis: String,
    },
    /// The kernel can't run even the series.
    #[error("tuning of axis {axis}: found {} {}, expected {}", .cause.quantity, .cause.value, .cause.expected)]
    Refused {
        /// The axis's name.
        axis: String,
        /// What it says.
        cause: ScaleError,
    },
}
