//! Parameters of a velocity-mode servo drive and its axis.
//!
//! Torque and current are written as the acceleration they give the unloaded axis, so no motor
//! constant is needed. Lengths are in mm, like everywhere in the project; the published figures of
//! the reference axis are in m.

use crate::parameter::{ParameterError, finite, not_negative, positive};

/// The machine bed that the moving mass pushes against: one lightly damped mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BedMode {
    /// Natural frequency of the bed alone \[Hz\], > 0. With the moving mass on it the resonance lies
    /// at frequency/√(1 + mass ratio).
    pub frequency_hz: f64,
    /// Fraction of critical damping, ≥ 0.
    pub damping_ratio: f64,
    /// Moving mass over the bed's modal mass, > 0.
    pub mass_ratio: f64,
}

/// One axis with its drive. Immutable once given to a [`DriveModel`](crate::DriveModel).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveParameters {
    /// Proportional gain of the velocity controller, per unit of unloaded inertia \[1/s\], > 0.
    pub velocity_gain_per_s: f64,
    /// Integral time of the velocity controller \[s\], > 0.
    pub integral_time_s: f64,
    /// Lag of the current loop \[s\], ≥ 0; 0 switches it off.
    pub current_lag_s: f64,
    /// Dead time from the DAC to the velocity controller \[s\], ≥ 0.
    pub dead_time_s: f64,
    /// Time constant of the drive's command filter \[s\], ≥ 0; 0 switches it off.
    pub command_filter_s: f64,
    /// Current limit over unloaded inertia \[mm/s²\], > 0.
    pub accel_limit_mm_s2: f64,
    /// Added inertia over unloaded inertia, > −1. Negative makes the axis lighter than it was when
    /// the gain was given.
    pub load_inertia_ratio: f64,
    /// Coulomb friction over unloaded inertia \[mm/s²\], ≥ 0.
    pub coulomb_friction_mm_s2: f64,
    /// Viscous friction over unloaded inertia \[1/s\], ≥ 0.
    pub viscous_friction_per_s: f64,
    /// The machine bed, if it moves.
    pub bed: Option<BedMode>,
}

/// The X axis of the machine measured in S4, fitted so that the paper's figures come out together.
pub const REFERENCE_X: DriveParameters = DriveParameters {
    velocity_gain_per_s: 440.0,
    integral_time_s: 0.0275,
    current_lag_s: 0.00037,
    dead_time_s: 0.00142,
    command_filter_s: 0.0,
    accel_limit_mm_s2: 12_300.0,
    load_inertia_ratio: 0.0,
    coulomb_friction_mm_s2: 85.0,
    viscous_friction_per_s: 0.08,
    bed: None,
};

/// The Y axis of the same machine: three times the friction, and it shakes the bed at 13 Hz.
pub const REFERENCE_Y: DriveParameters = DriveParameters {
    coulomb_friction_mm_s2: 260.0,
    bed: Some(BedMode { frequency_hz: 13.4, damping_ratio: 0.03, mass_ratio: 0.06 }),
    ..REFERENCE_X
};

/// A Z axis like X; S4 has measurements of X and Y only.
pub const REFERENCE_Z: DriveParameters = REFERENCE_X;

impl DriveParameters {
    /// Checks every value against its documented range.
    ///
    /// # Errors
    /// The first value that is not finite or out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("velocity_gain_per_s", self.velocity_gain_per_s)?;
        positive("integral_time_s", self.integral_time_s)?;
        not_negative("current_lag_s", self.current_lag_s)?;
        not_negative("dead_time_s", self.dead_time_s)?;
        not_negative("command_filter_s", self.command_filter_s)?;
        positive("accel_limit_mm_s2", self.accel_limit_mm_s2)?;
        finite("load_inertia_ratio", self.load_inertia_ratio)?;
        if self.load_inertia_ratio <= -1.0 {
            let value = self.load_inertia_ratio;
            return Err(ParameterError::OutOfRange { quantity: "load_inertia_ratio", value });
        }
        not_negative("coulomb_friction_mm_s2", self.coulomb_friction_mm_s2)?;
        not_negative("viscous_friction_per_s", self.viscous_friction_per_s)?;
        if let Some(bed) = self.bed {
            positive("bed.frequency_hz", bed.frequency_hz)?;
            not_negative("bed.damping_ratio", bed.damping_ratio)?;
            positive("bed.mass_ratio", bed.mass_ratio)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_axes_are_accepted() {
        for parameters in [REFERENCE_X, REFERENCE_Y, REFERENCE_Z] {
            assert_eq!(parameters.check(), Ok(()));
        }
    }

    #[test]
    fn a_refusal_names_the_quantity_and_its_value() {
        let heavy = DriveParameters { load_inertia_ratio: -1.0, ..REFERENCE_X };
        let out_of_range = ParameterError::OutOfRange { quantity: "load_inertia_ratio", value: -1.0 };
        assert_eq!(heavy.check(), Err(out_of_range));

        let endless = DriveParameters { dead_time_s: f64::INFINITY, ..REFERENCE_X };
        let not_finite = ParameterError::NotFinite { quantity: "dead_time_s", value: f64::INFINITY };
        assert_eq!(endless.check(), Err(not_finite));

        let bed = BedMode { frequency_hz: 13.4, damping_ratio: -0.1, mass_ratio: 0.06 };
        let driven = DriveParameters { bed: Some(bed), ..REFERENCE_X };
        let out_of_range = ParameterError::OutOfRange { quantity: "bed.damping_ratio", value: -0.1 };
        assert_eq!(driven.check(), Err(out_of_range));
    }

    #[test]
    fn a_value_that_is_not_a_number_is_refused() {
        let broken = DriveParameters { velocity_gain_per_s: f64::NAN, ..REFERENCE_X };
        assert!(matches!(
            broken.check(),
            Err(ParameterError::NotFinite { quantity: "velocity_gain_per_s", .. })
        ));
    }
}
