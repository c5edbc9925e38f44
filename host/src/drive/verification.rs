//! Circles that show whether a tuned machine is better than it was.
//!
//! Consumes circles driven before and after, in as many planes as let every tuned axis move.

use super::circle::CircleFigures;
use super::circle_motion::{Circle, plane_of};
use super::reference::CIRCLE_FEED_MM_S;
use crate::gcode::Plane;
use crate::machine::Machine;

/// Frequencies of the circles \[Hz\].
pub const VERIFIED_HZ: [f64; 6] = [1.0, 4.0, 10.0, 13.0, 16.0, 28.0];
/// How much worse a circle may get, in counts of the encoder.
const WORSE_COUNTS: f64 = 2.0;

/// A circle that is driven before and after.
#[must_use]
pub fn circle(plane: Plane, frequency_hz: f64) -> Circle {
    Circle { plane, ..Circle::new(frequency_hz, CIRCLE_FEED_MM_S) }
}

/// The planes whose circles move every axis of `tuned`, those in which both axes are tuned first.
#[must_use]
pub fn planes(tuned: &[usize]) -> Vec<Plane> {
    let mut planes: Vec<Plane> = Vec::new();
    let is_covered =
        |planes: &[Plane], axis: usize| planes.iter().any(|plane| plane.axes()[..2].contains(&axis));
    for plane in [Plane::Xy, Plane::Zx, Plane::Yz] {
        let axes = &plane.axes()[..2];
        let is_new = axes.iter().any(|axis| !is_covered(&planes, *axis));
        if is_new && axes.iter().all(|axis| tuned.contains(axis)) {
            planes.push(plane);
        }
    }
    for &axis in tuned {
        if !is_covered(&planes, axis) {
            planes.push(plane_of(axis));
        }
    }
    planes
}

/// If both axes were tuned, the contour error counts. If only one was, its following error counts: the
/// contour error is the difference of two axes, so improving one of two that lag alike may increase it.
fn judged_um(is_tuned: [bool; 2], circle: &CircleFigures) -> f64 {
    match is_tuned {
        [true, false] => circle.following_um[0],
        [false, true] => circle.following_um[1],
        _ => circle.contour_um(),
    }
}

/// Whether a circle of two axes, of which some were tuned, got no worse, but for the encoders' rounding.
#[must_use]
pub fn is_no_worse(
    machine: &Machine,
    is_tuned: [bool; 2],
    before: &CircleFigures,
    after: &CircleFigures,
) -> bool {
    let step_um = |axis: usize| machine.axes[axis].mm_per_count.abs() * 1e3;
    let margin_um = WORSE_COUNTS * before.axes.map(step_um).into_iter().fold(0.0, f64::max);
    judged_um(is_tuned, after) <= judged_um(is_tuned, before) + margin_um
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tuned_axis_moves_beside_another_if_it_can() {
        for (tuned, expected) in [
            (&[0][..], &[Plane::Xy][..]),
            (&[1], &[Plane::Xy]),
            (&[2], &[Plane::Zx]),
            (&[0, 1], &[Plane::Xy]),
            (&[2, 0], &[Plane::Zx]),
            (&[1, 2], &[Plane::Yz]),
            (&[0, 1, 2], &[Plane::Xy, Plane::Zx]),
        ] {
            assert_eq!(planes(tuned), expected, "{tuned:?}");
        }
    }
}
