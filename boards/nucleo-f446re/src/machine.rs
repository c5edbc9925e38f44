//! The axes of the machine on this board: the reference machine's, all three alike.
//!
//! Produces the kernel's configuration, once, before the first tick. A machine of your own is changed
//! here: scale, sign, gains and limits. For the first motion of an axis lower [`OUTPUT_LIMIT_V`] and
//! [`FOLLOWING_ERROR_LIMIT_MM`]; `README.md` says when.

use motion_kernel::axis::{AxisConfig, EncoderScale, Feedforward, Gains, OutputScale, Regulator, ScaleError};
use motion_kernel::law::Limits;
use motion_kernel::queue::PathRules;

use crate::design_parameters::TICK_S;

/// Number of axes: X, Y, Z.
pub const AXES: usize = 3;
/// Travel a count, after ×4 \[mm\]; negative for an encoder that counts the other way.
pub const MM_PER_COUNT: f64 = 1.0e-4;
/// Velocity at +10 V \[mm/s\]; negative if +10 V moves the axis backwards.
pub const MM_S_AT_10_V: f64 = 20_000.0 / 60.0;
/// Voltage at which the drive stands still \[V\].
pub const OUTPUT_OFFSET_V: f64 = 0.0;
/// Greatest output in either direction \[V\].
pub const OUTPUT_LIMIT_V: f64 = 10.0;
/// Following error at which an axis faults \[mm\].
pub const FOLLOWING_ERROR_LIMIT_MM: f64 = 1.0;
/// Feedback.
pub const GAINS: Gains = Gains { kp_per_s: 230.0, ki_per_s2: 0.0, kd: 0.0 };
/// Feedforward.
pub const FEEDFORWARD: Feedforward =
    Feedforward { velocity: 1.0, accel_s: 0.001_675, jerk_s2: 2.231_850_25e-5 };
/// Greatest feed, of the path and of each axis \[mm/s\].
pub const FEED_MM_S: f64 = 300.0;
/// Greatest acceleration, jerk and snap, of the path and of each axis.
pub const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5.0e3, snap_mm_s4: 4.0e5 };

/// What the streams are held to.
pub const RULES: PathRules = PathRules {
    limits: LIMITS,
    feed_mm_s: FEED_MM_S,
    // 0.5°, as the reference machine's.
    joint_angle_rad: 0.008_728_65,
    joint_gap_mm: 5.0e-6,
};

/// The kernel's axes.
///
/// # Errors
/// A constant above is out of its range.
pub fn axis_configs() -> Result<[AxisConfig<f32>; AXES], ScaleError> {
    let axis = AxisConfig {
        encoder: EncoderScale::new(MM_PER_COUNT)?,
        output: OutputScale::new(MM_S_AT_10_V, OUTPUT_OFFSET_V, OUTPUT_LIMIT_V)?,
        regulator: Regulator::new(GAINS, FEEDFORWARD, TICK_S, FOLLOWING_ERROR_LIMIT_MM)?,
        following_error_limit_mm: FOLLOWING_ERROR_LIMIT_MM as f32,
    };
    Ok([axis; AXES])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_configuration_is_valid() {
        axis_configs().expect("in range");
    }

    /// The plan in flash is made for the reference machine, so the board must be one.
    #[test]
    fn it_is_the_reference_machine() {
        let text = include_str!("../../../host/src/machine/reference.toml");
        let values = |key: &str| -> Vec<f64> {
            text.lines()
                .filter_map(|line| line.split_once('='))
                .filter(|(name, _)| name.trim() == key)
                .map(|(_, value)| value.trim().parse().expect(key))
                .collect()
        };
        for (key, expected, count) in [
            ("tick_s", TICK_S, 1),
            ("mm_per_count", MM_PER_COUNT, AXES),
            ("mm_min_at_10_v", 60.0 * MM_S_AT_10_V, AXES),
            ("offset_v", OUTPUT_OFFSET_V, AXES),
            ("limit_v", OUTPUT_LIMIT_V, AXES),
            ("following_error_limit_mm", FOLLOWING_ERROR_LIMIT_MM, AXES),
            ("kp_per_s", GAINS.kp_per_s, AXES),
            ("ki_per_s2", GAINS.ki_per_s2, AXES),
            ("kd", GAINS.kd, AXES),
            ("feedforward_velocity", FEEDFORWARD.velocity, AXES),
            ("feedforward_accel_s", FEEDFORWARD.accel_s, AXES),
            ("feedforward_jerk_s2", FEEDFORWARD.jerk_s2, AXES),
            // Once for the path, once for each axis.
            ("feed_mm_s", FEED_MM_S, 1 + AXES),
            ("accel_mm_s2", LIMITS.accel_mm_s2, 1 + AXES),
            ("jerk_mm_s3", LIMITS.jerk_mm_s3, 1 + AXES),
            ("snap_mm_s4", LIMITS.snap_mm_s4, 1 + AXES),
        ] {
            let found = values(key);
            assert_eq!(found.len(), count, "{key}");
            for value in found {
                assert!((value - expected).abs() <= 1e-12 * expected.abs(), "{key}: {value}, {expected}");
            }
        }
        let joint_rad = values("joint_angle_deg")[0].to_radians();
        assert!((RULES.joint_angle_rad - joint_rad).abs() < 3e-6);
    }
}
