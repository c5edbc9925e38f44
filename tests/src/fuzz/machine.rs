//! The machine of a run: its axes, and how they answer other than they should.

use arbitrary::{Result, Unstructured};
use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains, GuardFigures, Guards};
use motion_kernel::fault::{Reaction, Reactions};
use motion_kernel::hal::{AxisInputs, MachineInputs};
use motion_kernel::num::Real;
use motion_kernel::units::Counts;

use super::items::TICK_S;
use crate::axes::{Fails, MM_PER_COUNT, TestAxes};

/// What is put out at rest \[V\].
pub(super) const TRIM_V: f64 = 0.1;

/// What the axes are guarded by, alike, for a machine whose encoders read a tick later what was set.
const GUARD: GuardFigures = GuardFigures {
    following_error_at_rest_mm: 0.2,
    following_error_per_velocity_s: 1e-3,
    following_error_per_accel_s2: 1e-4,
    jump_mm: 0.02,
    moving_mm_s: 5.0,
    response_s: 0.02,
    load_accel_mm_s2: 5000.0,
    noise_counts: 0,
    saturation_s: 0.1,
    travel_mm: Some([-900.0, 900.0]),
};
/// How faults end.
pub(super) const REACTIONS: Reactions =
    Reactions { ramp_ticks: 50, stop_ticks: 2000, emergency_stop: Reaction::Stop };

/// The axes, alike.
pub(super) fn axes<R: Real>() -> AxesConfig<R, 2> {
    let axis = AxisFigures {
        mm_per_count: MM_PER_COUNT,
        // Above the greatest feed, and what regulation adds to it.
        mm_s_at_10_v: 500.0,
        output_offset_v: TRIM_V,
        output_limit_v: 9.0,
        gains: Gains { kp_per_s: 100.0, ki_per_s2: 10.0, kd: 0.001 },
        feedforward: Feedforward { velocity: 1.0, accel_s: 1e-3, jerk_s2: 1e-6, ..Feedforward::default() },
        following_error_limit_mm: 1.0,
    };
    let guards = Guards { axes: [Some(GUARD); 2], reactions: REACTIONS };
    AxesConfig::new(&[axis; 2], TICK_S).and_then(|axes| axes.guarded(&guards, TICK_S)).expect("axes")
}

/// Counts that jump, inputs that change, calls that fail.
pub(super) fn upset(axes: &mut TestAxes, input: &mut Unstructured<'_>) -> Result<()> {
    match input.int_in_range(0..=3)? {
        0 => {
            let [latch, inputs, write, enable] = input.arbitrary()?;
            axes.fails = Fails { latch, inputs, write, enable };
        }
        1 => {
            axes.inputs.axes[input.choose_index(2)?] = AxisInputs::from_bits(input.arbitrary()?);
            axes.inputs.emergency_stop = input.ratio(1, 4)?;
        }
        2 => axes.counts[input.choose_index(2)?] = Counts(input.arbitrary()?),
        _ => {
            let jump = i64::from(input.arbitrary::<i16>()?);
            let counts = &mut axes.counts[input.choose_index(2)?].0;
            *counts = counts.wrapping_add(jump);
        }
    }
    Ok(())
}

/// All is well again.
pub(super) fn mend(axes: &mut TestAxes) {
    (axes.fails, axes.inputs) = (Fails::default(), MachineInputs::HEALTHY);
}
