//! Ceilings of moves that follow each other, and what their joints allow.
//!
//! Consumes moves with their blends; produces blocks with ceiling, law and joint feed, ready for look-ahead.
//!
//! **A blend's share.** A blend is passed at [`BLEND_FEED_SHARE`] of what its curvature allows if the feed can be
//! changed before and after it: if on the rests of the elements on both sides at least that feed can be reached
//! which the machine's own share would allow, from the feed beyond them. Otherwise it is a curve like any other, and
//! that share leaves something of the limits for changing the feed on it.

use motion_kernel::law::reach;
use motion_kernel::plan::{BLEND_FEED_SHARE, Ceiling, Joint, MachineLimits, Reason, joint};

use super::error::Problem;
use super::stretch::StretchBlock;
use crate::machine::Machine;
use crate::toolpath::smooth::{Move, TANGENT_ROUNDING_RAD};
use crate::toolpath::{Element, Greatest, Role, angle, norm, subtract};

/// The blocks of `moves`; the joint feed of the last one is 0. An error comes with the program line.
pub(super) fn blocks(moves: &[Move], machine: &Machine) -> Result<Vec<StretchBlock>, (u32, Problem)> {
    // How a curve bends takes a search along it: once for each, whatever share it is then given.
    let bends: Vec<Greatest> = moves.iter().map(|step| step.element.greatest()).collect();
    let mut blocks = Vec::with_capacity(moves.len());
    for (step, greatest) in moves.iter().zip(&bends) {
        let share = if is_blend(&step.element) { BLEND_FEED_SHARE } else { machine.path.curve_feed_share };
        blocks.push(block(step, greatest, share, machine)?);
    }
    for index in 1..blocks.len() {
        blocks[index - 1].joint_mm_s =
            joint_feed(&blocks[index - 1].element, &blocks[index].element, machine);
    }
    let crowded: Vec<usize> = (0..blocks.len())
        .filter(|&index| is_blend(&blocks[index].element) && is_crowded(&blocks, index, machine))
        .collect();
    for index in crowded {
        let share = machine.path.curve_feed_share;
        let StretchBlock { ceiling, greatest, .. } = block(&moves[index], &bends[index], share, machine)?;
        (blocks[index].ceiling, blocks[index].greatest) = (ceiling, greatest);
    }
    Ok(blocks)
}

fn block(
    step: &Move,
    greatest: &Greatest,
    curve_feed_share: f64,
    machine: &Machine,
) -> Result<StretchBlock, (u32, Problem)> {
    let Move { line, element, feed_mm_s, .. } = *step;
    let limits = MachineLimits { curve_feed_share, ..machine.limits() };
    let Greatest { bend, tangent, curved } = greatest;
    let at = |feed_mm_s: f64| {
        Ceiling::new(&limits, feed_mm_s, tangent, curved, bend).map_err(|error| (line, error.into()))
    };
    let ceiling = at(feed_mm_s)?;
    let greatest = if ceiling.reason == Reason::Programmed { at(f64::INFINITY)? } else { ceiling };
    Ok(StretchBlock { line, element, ceiling, greatest, feed_mm_s, joint_mm_s: 0.0 })
}

fn is_blend(element: &Element) -> bool {
    matches!(element, Element::Polynomial { role: Role::Blend, .. })
}

/// Whether the rests beside the blend at `index` are too short to reach, from the feed beyond them, even what the
/// machine's share would allow on the blend.
fn is_crowded(blocks: &[StretchBlock], index: usize, machine: &Machine) -> bool {
    let wanted_mm_s = blocks[index].ceiling.feed_mm_s * machine.path.curve_feed_share / BLEND_FEED_SHARE;
    let is_too_short = |rest: &StretchBlock, beyond: Option<&StretchBlock>, joint_mm_s: f64| {
        let beyond_mm_s = beyond.map_or(0.0, |beyond| beyond.ceiling.feed_mm_s.min(joint_mm_s));
        reach(&rest.ceiling.law, beyond_mm_s, rest.element.length_mm()) < wanted_mm_s
    };
    // A blend stands between two elements.
    let (before, after) = (&blocks[index - 1], &blocks[index + 1]);
    let first = index.checked_sub(2).map(|index| &blocks[index]);
    is_too_short(before, first, first.map_or(0.0, |first| first.joint_mm_s))
        || is_too_short(after, blocks.get(index + 2), after.joint_mm_s)
}

/// The greatest feed from one element to the next \[mm/s\]; 0 where the machine has to stop.
fn joint_feed(before: &Element, after: &Element, machine: &Machine) -> f64 {
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
