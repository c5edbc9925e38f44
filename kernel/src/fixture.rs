//! What unit tests share: an axis like the reference machine's X, what is watched of it, and the rules of its
//! path.

#[cfg(feature = "guards")]
mod guarded;

#[cfg(feature = "guards")]
pub(crate) use guarded::{TICK_S, TestAxes, guarded};

use crate::axis::{AxisFigures, Feedforward, Gains, GuardFigures};
use crate::law::Limits;
use crate::queue::PathRules;

pub(crate) const MM_PER_COUNT: f64 = 1e-4;

pub(crate) fn figures() -> AxisFigures {
    AxisFigures {
        mm_per_count: MM_PER_COUNT,
        mm_s_at_10_v: 1000.0 / 3.0,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 230.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward { velocity: 1.0, ..Feedforward::default() },
        following_error_limit_mm: 1.0,
    }
}

pub(crate) const GUARD: GuardFigures = GuardFigures {
    following_error_at_rest_mm: 0.25,
    following_error_per_velocity_s: 1e-3,
    following_error_per_accel_s2: 1e-4,
    jump_mm: 0.007,
    moving_mm_s: 3.0,
    response_s: 0.013,
    load_accel_mm_s2: 1230.0,
    noise_counts: 0,
    saturation_s: 0.1,
    travel_mm: None,
};

pub(crate) const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

pub(crate) const RULES: PathRules =
    PathRules { limits: LIMITS, feed_mm_s: 300.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
