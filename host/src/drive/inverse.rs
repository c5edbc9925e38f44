//! The kernel's inverse of a drive whose parameters are known: simulated, or identified.

use hal_sim::DriveParameters;
use motion_kernel::axis::{BedInverse, DriveInverse, Feedforward, PREVIEW_TICKS_MAX};

/// Velocity from which the whole Coulomb friction is compensated \[mm/s\]: at 900 mm/s² (4 Hz in S4's
/// circles) it is passed within about a tick.
pub const REVERSAL_MM_S: f64 = 0.5;

/// The inverse of `drive`, per unit of the inertia that it moves, for ticks of `tick_s`. The lead is dead
/// time, command filter and the half tick for which outputs are held. The part φ of it for which the kernel's
/// preview has no room is compensated by the series V(t + φ) = V + φ·a + φ²/2·J.
#[must_use]
pub fn inverse(drive: &DriveParameters, tick_s: f64) -> Feedforward {
    let inertia = 1.0 + drive.load_inertia_ratio;
    let late_s = drive.dead_time_s + drive.command_filter_s + 0.5 * tick_s;
    let lead_s = late_s.min(f64::from(PREVIEW_TICKS_MAX) * tick_s);
    let left_s = late_s - lead_s;
    Feedforward {
        velocity: 1.0,
        accel_s: left_s,
        jerk_s2: 0.5 * left_s * left_s,
        lead_s,
        drive: Some(DriveInverse {
            velocity_gain_per_s: drive.velocity_gain_per_s / inertia,
            integral_time_s: drive.integral_time_s,
            current_lag_s: drive.current_lag_s.max(0.0),
            viscous_friction_per_s: drive.viscous_friction_per_s.max(0.0) / inertia,
            coulomb_friction_mm_s2: drive.coulomb_friction_mm_s2.max(0.0) / inertia,
            reversal_mm_s: REVERSAL_MM_S,
            bed: drive.bed.map(|bed| BedInverse {
                frequency_hz: bed.frequency_hz,
                damping_ratio: bed.damping_ratio,
                mass_ratio: bed.mass_ratio,
            }),
        }),
        ..Feedforward::default()
    }
}
