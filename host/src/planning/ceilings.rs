//! The ceilings of a move and of a junction.

use motion_kernel::plan::{Ceiling, Junction, MachineLimits, Reason, junction};

use super::error::Problem;
use crate::machine::Machine;
use crate::toolpath::fairing::feeds::lower;
use crate::toolpath::smooth::{Move, Run, TANGENT_ROUNDING_RAD};
use crate::toolpath::{Element, Greatest, Role, angle, norm, subtract};

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

/// The part of the feed that a curve through dense moves allows, with which it is driven: where it is
/// tightest the feed hardly changes, and before and behind it is lower anyhow.
const SMOOTH_FEED_SHARE: f64 = 0.93;

/// The ceilings of the moves of a run. An error comes with the program line.
pub(super) fn along(run: &Run, machine: &Machine) -> Result<Vec<Ceilings>, (u32, Problem)> {
    let is_curve = |step: &Move| matches!(step.element, Element::Polynomial { role: Role::Curve, .. });
    let mut all: Vec<Ceilings> = Vec::with_capacity(run.moves().len());
    for moves in run.moves().chunk_by(|before, after| is_curve(before) == is_curve(after)) {
        let first = all.len();
        let is_smooth = moves.first().is_some_and(is_curve);
        let share = if is_smooth { SMOOTH_FEED_SHARE } else { machine.path.curve_feed_share };
        for (index, step) in moves.iter().enumerate() {
            all.push(ceilings(step, &run.greatest(first + index), share, machine)?);
        }
        if is_smooth {
            lower_curve(run, first, &mut all[first..], machine)?;
        }
    }
    Ok(all)
}

/// Lowers the ceilings of a curve through dense moves, those of a run from `first` on, to the feeds that ramps
/// between the slowest of them reach. That leaves more of the limits for the ramps.
fn lower_curve(
    run: &Run,
    first: usize,
    all: &mut [Ceilings],
    machine: &Machine,
) -> Result<(), (u32, Problem)> {
    let mut feeds: Vec<f64> = all.iter().map(|ceilings| ceilings.programmed.feed_mm_s).collect();
    let lengths: Vec<f64> = (first..first + all.len()).map(|index| run.length_mm(index)).collect();
    lower(&mut feeds, &lengths, &machine.limits().in_any_direction());
    for (index, (ceiling, feed_mm_s)) in all.iter_mut().zip(feeds).enumerate() {
        if feed_mm_s < ceiling.programmed.feed_mm_s {
            let reason = ceiling.programmed.reason;
            let step = Move { feed_mm_s, ..run.moves()[first + index] };
            let lowered = ceilings(&step, &run.greatest(first + index), SMOOTH_FEED_SHARE, machine)?;
            let lowered = Ceiling { reason, ..lowered.programmed };
            *ceiling = Ceilings { programmed: lowered, greatest: lowered };
        }
    }
    Ok(())
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
