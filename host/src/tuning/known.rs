//! The basis of a proposal: the parameters that the recordings determine, and the machine file's for the
//! rest.

use hal_sim::{BedMode, DriveParameters};
use motion_kernel::axis::{BedInverse, DriveInverse, Gains};

use super::error::TuningError;
use super::margins::Margins;
use crate::identify::{AxisParametersFound, BedEstimate, Estimate};
use crate::machine::AxisSettings;

/// What the interval of a bed's damping may change margins by, as a part of them.
pub const MARGINS_KNOWN: f64 = 0.01;

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

/// Whether the damping of the bed, if there is one, is known as well as the margins of a loop need it.
pub(super) fn is_damping_known(found: &AxisParametersFound, loop_gains: Gains, tick_s: f64) -> bool {
    let drive = found.drive();
    let (Some(bed), Some(estimate)) = (drive.bed, found.bed) else { return true };
    let margins = |damping_ratio: f64| {
        let bed = Some(BedMode { damping_ratio: damping_ratio.max(0.0), ..bed });
        Margins::of(&DriveParameters { bed, ..drive }, loop_gains, tick_s)
    };
    let is = margins(bed.damping_ratio);
    // What is infinite in both does not differ.
    let is_near =
        |is: f64, other: f64| other.total_cmp(&is).is_eq() || (other - is).abs() <= MARGINS_KNOWN * is.abs();
    let half_width = estimate.damping_ratio.half_width_95;
    [-half_width, half_width].into_iter().all(|off| {
        let other = margins(bed.damping_ratio + off);
        is_near(is.phase_deg, other.phase_deg) && is_near(is.gain, other.gain)
    })
}

#[cfg(test)]
mod tests {
    use hal_sim::REFERENCE_Y;

    use super::*;
    const TICK_S: f64 = 0.5e-3;

    /// The drive as it is known, but for the damping of its bed.
    fn found(drive: &DriveParameters, damping_half_width: f64) -> AxisParametersFound {
        let of = |value: f64| Estimate { value, half_width_95: 0.0 };
        AxisParametersFound {
            command_gain: of(1.0),
            command_offset_mm_s: of(0.0),
            velocity_gain_per_s: of(drive.velocity_gain_per_s),
            integral_time_s: of(drive.integral_time_s),
            dead_time_s: of(drive.dead_time_s),
            command_filter_s: of(drive.command_filter_s),
            current_lag_s: of(drive.current_lag_s),
            total_delay_s: of(drive.dead_time_s
                + drive.command_filter_s
                + drive.current_lag_s
                + 0.5 * TICK_S),
            accel_limit_mm_s2: of(drive.accel_limit_mm_s2),
            coulomb_friction_mm_s2: of(drive.coulomb_friction_mm_s2),
            viscous_friction_per_s: of(drive.viscous_friction_per_s),
            load_inertia_ratio: of(0.0),
            bed: drive.bed.map(|bed| BedEstimate {
                frequency_hz: of(bed.frequency_hz),
                damping_ratio: Estimate { value: bed.damping_ratio, half_width_95: damping_half_width },
                mass_ratio: of(bed.mass_ratio),
            }),
        }
    }

    /// The peak of a bed of 60 Hz bounds the gain. Half of its damping more or less changes that, a hundredth does not.
    #[test]
    fn margins_hang_on_a_sharp_peak() {
        let bed = BedMode { frequency_hz: 60.0, damping_ratio: 0.0065, mass_ratio: 0.25 };
        let sharp = DriveParameters { bed: Some(bed), ..REFERENCE_Y };
        let gains = Gains { kp_per_s: 40.0, ..Gains::default() };
        let is_known = |half_width: f64| is_damping_known(&found(&sharp, half_width), gains, TICK_S);
        assert!(is_known(0.000_02) && !is_known(0.003) && !is_known(f64::INFINITY));
        let margins = |damping_ratio: f64| {
            let bed = Some(BedMode { damping_ratio, ..bed });
            Margins::of(&DriveParameters { bed, ..sharp }, gains, TICK_S).gain
        };
        let part = margins(0.0095) / margins(0.0065) - 1.0;
        assert!(part.abs() > MARGINS_KNOWN, "{part}");
        let rigid = DriveParameters { bed: None, ..REFERENCE_Y };
        assert!(is_damping_known(&found(&rigid, 0.003), gains, TICK_S));
    }
}
