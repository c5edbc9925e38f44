//! The ceilings of a move, and what a joint allows.

use motion_kernel::plan::{Ceiling, Joint, MachineLimits, joint};

use super::error::Problem;
use crate::machine::Machine;
use crate::toolpath::smooth::{Move, TANGENT_ROUNDING_RAD};
use crate::toolpath::{Element, Greatest, angle, norm, subtract};

/// The ceiling of a move that bends as `greatest` says, driven at most at `curve_feed_share` of what its curvature
/// allows. An error comes with the program line.
pub(super) fn ceiling(
    step: &Move,
    greatest: &Greatest,
    curve_feed_share: f64,
    machine: &Machine,
) -> Result<Ceiling<f64>, (u32, Problem)> {
    let limits = MachineLimits { curve_feed_share, ..machine.limits() };
    let Greatest { bend, tangent, curved } = greatest;
    Ceiling::new(&limits, step.feed_mm_s, tangent, curved, bend).map_err(|error| (step.line, error.into()))
}

/// The greatest feed from one element to the next \[mm/s\]; 0 where the machine has to stop.
pub(super) fn joint_feed(before: &Element, after: &Element, machine: &Machine) -> f64 {
    let ([_, end], [start, _]) = (before.ends(), after.ends());
    let angle_rad = angle(end.tangent, start.tangent);
    let steps = Joint { angle_rad, curvature_step_per_mm: norm(subtract(start.curvature, end.curvature)) };
    joint(
        &steps,
        machine.path.joint_angle_rad.max(TANGENT_ROUNDING_RAD),
        machine.path.accel_step_mm_s2,
        machine.tick_s,
    )
}
