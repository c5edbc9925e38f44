//! The ceilings of a move and of a junction.

use motion_kernel::plan::{Ceiling, Junction, MachineLimits, Reason, junction};

use super::error::Problem;
use crate::machine::Machine;
use crate::toolpath::fairing::feeds::lower;
use crate::toolpath::smooth::{Move, TANGENT_ROUNDING_RAD};
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

/// The ceilings of moves that follow each other. An error comes with the program line.
pub(super) fn along(moves: &[Move], machine: &Machine) -> Result<Vec<Ceilings>, (u32, Problem)> {
    let is_curve = |step: &Move| matches!(step.element, Element::Polynomial { role: Role::Curve, .. });
    let mut all = Vec::with_capacity(moves.len());
    for moves in moves.chunk_by(|before, after| is_curve(before) == is_curve(after)) {
        if moves.first().is_some_and(is_curve) {
            all.extend(along_curve(moves, machine)?);
            continue;
        }
        for step in moves {
            all.push(ceilings(step, &step.element.greatest(), machine.path.curve_feed_share, machine)?);
        }
    }
    Ok(all)
}

/// The ceilings of a curve through dense moves: those of its spans, lowered to the feeds that ramps between
/// the slowest of them reach. That leaves more of the limits for the ramps.
fn along_curve(spans: &[Move], machine: &Machine) -> Result<Vec<Ceilings>, (u32, Problem)> {
    let greatest: Vec<Greatest> = spans.iter().map(|step| step.element.greatest()).collect();
    let mut all = Vec::with_capacity(spans.len());
    for (step, greatest) in spans.iter().zip(&greatest) {
        all.push(ceilings(step, greatest, SMOOTH_FEED_SHARE, machine)?);
    }
    let mut feeds: Vec<f64> = all.iter().map(|ceilings| ceilings.programmed.feed_mm_s).collect();
    let lengths: Vec<f64> = spans.iter().map(|step| step.element.length_mm()).collect();
    lower(&mut feeds, &lengths, &machine.limits().in_any_direction());
    for (((ceiling, step), greatest), feed_mm_s) in all.iter_mut().zip(spans).zip(&greatest).zip(feeds) {
        if feed_mm_s < ceiling.programmed.feed_mm_s {
            let reason = ceiling.programmed.reason;
            let lowered = ceilings(&Move { feed_mm_s, ..*step }, greatest, SMOOTH_FEED_SHARE, machine)?;
            let lowered = Ceiling { reason, ..lowered.programmed };
            *ceiling = Ceilings { programmed: lowered, greatest: lowered };
        }
    }
    Ok(all)
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
