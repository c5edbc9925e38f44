//! The ceilings of a move and of a junction.

use motion_kernel::plan::{Ceiling, Junction, MachineLimits, Reason, junction};

use super::error::Problem;
use crate::machine::Machine;
use crate::toolpath::smooth::{Move, TANGENT_ROUNDING_RAD};
use crate::toolpath::{Element, Greatest, angle, norm, subtract};

/// The ceilings of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ceilings {
    /// The ceiling at the programmed feed.
    pub programmed: Ceiling<f64>,
    /// The ceiling without a programmed feed.
    pub greatest: Ceiling<f64>,
}

/// The ceilings of a move that bends as `greatest` says, driven at most at `curve_feed_share` of what its
/// curvature allows. An error comes with the program line.
pub(super) fn ceilings(
    step: &Move,
    greatest: &Greatest,
    curve_feed_share: f64,
    machine: &Machine,
) -> Result<Ceilings, (u32, Problem)> {
    let limits = MachineLimits { curve_feed_share, ..machine.limits() };
    let Greatest { bend, tangent, curved } = greatest;
    let at = |feed_mm_s: f64| {
        Ceiling::new(&limits, feed_mm_s, tangent, curved, bend).map_err(|error| (step.line, error.into()))
    };
    let programmed = at(step.feed_mm_s)?;
    let greatest = if programmed.reason == Reason::Programmed { at(f64::INFINITY)? } else { programmed };
    Ok(Ceilings { programmed, greatest })
}

/// The greatest feed from one element to the next \[mm/s\]; 0 where the machine has to stop.
pub(super) fn junction_feed(before: &Element, after: &Element, machine: &Machine) -> f64 {
    let ([_, end], [start, _]) = (before.ends(), after.ends());
    let angle_rad = angle(end.tangent, start.tangent);
    let steps = Junction { angle_rad, curvature_step_per_mm: norm(subtract(start.curvature, end.curvature)) };
    junction(
        &steps,
        machine.path.junction_angle_rad.max(TANGENT_ROUNDING_RAD),
        machine.path.accel_step_mm_s2,
        machine.tick_s,
    )
}
