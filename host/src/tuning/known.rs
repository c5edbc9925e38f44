//! The basis of a proposal: the parameters that the recordings determine, and the machine file's for the
//! rest.

use hal_sim::{BedMode, DriveParameters};
use motion_kernel::axis::{BedInverse, DriveInverse};

use super::error::TuningError;
use crate::identify::{AxisParametersFound, BedEstimate, Estimate};
use crate::machine::AxisSettings;

/// Where a figure of the drive comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The recordings determine it.
    Recorded,
    /// Not determined: the file's value, as far as the recordings allow it.
    File,
    /// Not determined and not in the file: the least that the recordings allow.
    Least,
}

/// A drive to be inverted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Its figures.
    pub drive: DriveParameters,
    /// Where its current lag is from.
    pub current_lag: Origin,
    /// Where its viscous friction is from.
    pub viscous_friction: Origin,
    /// Where its Coulomb friction is from.
    pub coulomb_friction: Origin,
    /// Where its bed is from.
    pub bed: Origin,
}

impl Known {
    /// The parameters of the drive of `axis`.
    ///
    /// # Errors
    /// The scale of commands, Kv, Ti or the total delay is not determined: nothing could be tuned by the
    /// rest.
    pub fn new(axis: &AxisSettings, found: &AxisParametersFound, tick_s: f64) -> Result<Self, TuningError> {
        for (quantity, estimate) in [
            ("command gain", found.command_gain),
            ("Kv [1/s]", found.velocity_gain_per_s),
            ("Ti [s]", found.integral_time_s),
            ("total delay [s]", found.total_delay_s),
        ] {
            if !estimate.is_determined() {
                return Err(TuningError::Undetermined { axis: axis.name.clone(), quantity, estimate });
            }
        }
        let file = axis.feedforward.drive.as_ref();
        let of = |estimate, value: fn(&DriveInverse) -> f64| chosen(estimate, file.map(value));
        let (lag_s, current_lag) = of(found.current_lag_s, |drive| drive.current_lag_s);
        let (viscous_friction_per_s, viscous_friction) =
            of(found.viscous_friction_per_s, |drive| drive.viscous_friction_per_s);
        let (coulomb_friction_mm_s2, coulomb_friction) =
            of(found.coulomb_friction_mm_s2, |drive| drive.coulomb_friction_mm_s2);
        // However the delay is split, as a whole it is what was found. The inverse leads by dead time and filter alike.
        let both_s = (found.total_delay_s.value - 0.5 * tick_s).max(0.0);
        let current_lag_s = lag_s.min(both_s);
        let command_filter_s = found.command_filter_s.value.min(both_s - current_lag_s);
        let (bed, bed_origin) = bed_of(found.bed.as_ref(), file.and_then(|drive| drive.bed));
        let drive = DriveParameters {
            current_lag_s,
            dead_time_s: both_s - current_lag_s - command_filter_s,
            command_filter_s,
            viscous_friction_per_s,
            coulomb_friction_mm_s2,
            bed,
            ..found.drive()
        };
        Ok(Self { drive, current_lag, viscous_friction, coulomb_friction, bed: bed_origin })
    }
}

/// The estimate if it is one; else what is nearest to the file's value within its interval.
fn chosen(estimate: Estimate, file: Option<f64>) -> (f64, Origin) {
    if estimate.is_determined() {
        return (estimate.value.max(0.0), Origin::Recorded);
    }
    let (least, most) = (estimate.value - estimate.half_width_95, estimate.upper());
    // An interval that is not one bounds nothing: max and min pass over what is not a number.
    let nearest = file.unwrap_or(0.0).max(least).min(most).max(0.0);
    (nearest, if file.is_some() { Origin::File } else { Origin::Least })
}

/// A bed is inverted as a whole or not at all: with one figure of its own missing it would ring on its own.
fn bed_of(found: Option<&BedEstimate>, file: Option<BedInverse>) -> (Option<BedMode>, Origin) {
    let Some(bed) = found else { return (None, Origin::Recorded) };
    let estimates = [bed.frequency_hz, bed.damping_ratio, bed.mass_ratio];
    if estimates.iter().all(Estimate::is_determined) {
        let [frequency_hz, damping_ratio, mass_ratio] = estimates.map(|estimate| estimate.value);
        return (Some(BedMode { frequency_hz, damping_ratio, mass_ratio }), Origin::Recorded);
    }
    let kept = file.map(|BedInverse { frequency_hz, damping_ratio, mass_ratio }| BedMode {
        frequency_hz,
        damping_ratio,
        mass_ratio,
    });
    (kept, if kept.is_some() { Origin::File } else { Origin::Least })
}
