//! Circles that show whether a tuned machine is better than it was.
//!
//! Consumes circles driven before and after, in as many planes as let every tuned axis move. Every circle stays within what its axes
//! bear.

use core::f64::consts::TAU;

use super::circle::CircleFigures;
use super::circle_motion::{Circle, plane_of};
use super::experiment::fastest_mm_s;
use super::reference::CIRCLE_FEED_MM_S;
use crate::gcode::Plane;
use crate::identify::Identification;
use crate::machine::Machine;

/// Frequencies of the circles \[Hz\].
pub const VERIFIED_HZ: [f64; 6] = [1.0, 4.0, 10.0, 13.0, 16.0, 28.0];
/// The part of the acceleration that the current limit leaves over friction which a circle takes.
const ACCEL_SHARE: f64 = 0.6;
/// The part of the outputs' reach: feedback needs some, too.
const REACH_SHARE: f64 = 0.9;
/// How much worse a circle may get, in counts of the encoder.
const WORSE_COUNTS: f64 = 2.0;

/// The acceleration that the current limit leaves an axis over friction \[mm/s²\], if that was found.
#[must_use]
pub fn bears_mm_s2(found: &Identification) -> Option<f64> {
    let parameters = &found.parameters;
    let limit = parameters.accel_limit_mm_s2;
    limit.is_determined().then(|| (limit.value - parameters.coulomb_friction_mm_s2.value).max(0.0))
}

/// A circle that is driven before and after: at the feed of S4's circles, or slower where the outputs of its axes do not reach it, or
/// an acceleration of `bears_mm_s2` \[mm/s²\], infinite where that is not known; then with the reason.
#[must_use]
pub fn circle(
    plane: Plane,
    frequency_hz: f64,
    machine: &Machine,
    bears_mm_s2: f64,
) -> (Circle, Option<String>) {
    let [first, second, _] = plane.axes();
    let reach_mm_s = REACH_SHARE * fastest_mm_s(machine, &[first, second]);
    let bears_mm_s = ACCEL_SHARE * bears_mm_s2 / (TAU * frequency_hz);
    let feed_mm_s = CIRCLE_FEED_MM_S.min(reach_mm_s).min(bears_mm_s);
    let slower = (feed_mm_s < CIRCLE_FEED_MM_S).then(|| {
        if reach_mm_s < bears_mm_s {
            format!("the outputs reach {:.0} mm/min", reach_mm_s * 60.0)
        } else {
            format!("the current limit that was found bears {bears_mm_s2:.0} mm/s²")
        }
    });
    (Circle { plane, ..Circle::new(frequency_hz, feed_mm_s) }, slower)
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

/// What decides whether a circle got worse.
#[derive(Clone, Copy, Debug)]
pub struct Verdict<'m> {
    /// The machine after tuning.
    pub machine: &'m Machine,
    /// Which of the circle's axes were tuned.
    pub is_tuned: [bool; 2],
}

impl Verdict<'_> {
    /// What counts \[µm\]. If both axes were tuned, the contour error. If only one was, its following error: the
    /// contour error is the difference of two axes, so improving one of two that lag alike may increase it.
    #[must_use]
    pub fn judged_um(&self, circle: &CircleFigures) -> f64 {
        match self.is_tuned {
            [true, false] => circle.following_um[0],
            [false, true] => circle.following_um[1],
            _ => circle.contour_um(),
        }
    }

    /// Whether a circle got no worse, but for the encoders' rounding.
    #[must_use]
    pub fn is_no_worse(&self, before: &CircleFigures, after: &CircleFigures) -> bool {
        let step_um = |axis: usize| self.machine.axes[axis].mm_per_count.abs() * 1e3;
        let margin_um = WORSE_COUNTS * before.axes.map(step_um).into_iter().fold(0.0, f64::max);
        self.judged_um(after) <= self.judged_um(before) + margin_um
    }
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
