//! Bounds on where an accelerating ramp passes a feed.
//!
//! Consumes a ramp, then feeds; produces two lengths between which [`Ramp::length_to_feed_mm`] lies, at a
//! fraction of its cost: two square roots in an opening edge, one and a division on the plateau, three divisions in
//! a closing edge. Background: the planner of spanning ramps uses it for every ceiling that a ramp may pass.

use super::Ramp;
use super::pulse::JerkPulse;
use super::shape::{ABOUT_MISSING_WITHIN, ABOUT_WITHIN, Shape};
use crate::work;

/// Relative rounding of the length where the formula is exact: in the hold and on plateaus.
const EXACT_WITHIN: f64 = 1.0e-12;

/// The values of a ramp that are the same for every feed it passes.
#[derive(Clone, Copy, Debug)]
pub struct Passing {
    from_mm_s: f64,
    to_mm_s: f64,
    pulse: JerkPulse<f64>,
    length_mm: f64,
    /// One over the greatest acceleration \[s²/mm\].
    per_accel: f64,
    /// What a pulse gains \[mm/s, mm\].
    pulse_mm_s: f64,
    pulse_mm: f64,
    /// The feed gained up to which the shape of an arch holds: of all of a pulse without a plateau, or of an
    /// edge \[mm/s\].
    arch_mm_s: f64,
    /// The length of the arch \[s\], and the scale of its lengths \[mm\].
    arch_s: f64,
    arch_mm: f64,
    /// One over the scale of its feeds \[s/mm\].
    per_arch: f64,
    /// The feed gained up to which there is a plateau, and from which on the closing edge follows \[mm/s\].
    plateau_mm_s: f64,
}

impl Passing {
    /// Prepares `ramp`, which goes from a lower feed to a higher one.
    #[must_use]
    pub fn new(ramp: &Ramp<f64>) -> Self {
        let pulse = ramp.pulse();
        let arch_s = 2.0 * ramp.edge_s;
        let scale_mm_s = ramp.peak_jerk_mm_s3 * arch_s * arch_s;
        let arch_mm_s = if ramp.plateau_s() > 0.0 { Shape::<f64>::middle().speed } else { 0.25 };
        Self {
            from_mm_s: ramp.from_mm_s,
            to_mm_s: ramp.to_mm_s,
            pulse,
            length_mm: ramp.length_mm(),
            per_accel: 1.0 / ramp.peak_accel_mm_s2(),
            pulse_mm_s: pulse.speed_mm_s(),
            pulse_mm: pulse.length_mm(),
            arch_mm_s: scale_mm_s * arch_mm_s,
            arch_s,
            arch_mm: scale_mm_s * arch_s,
            per_arch: 1.0 / scale_mm_s,
            plateau_mm_s: pulse.speed_mm_s() - pulse.closing_mm_s(),
        }
    }

    /// Two lengths between which [`Ramp::length_to_feed_mm`] lies \[mm\], less than a thousandth of the
    /// ramp's length apart.
    #[must_use]
    pub fn length_to_feed_mm(&self, feed_mm_s: f64) -> (f64, f64) {
        work::add(1);
        let (gained, left) = (feed_mm_s - self.from_mm_s, self.to_mm_s - feed_mm_s);
        if gained <= 0.0 {
            return (0.0, 0.0);
        }
        if left <= 0.0 {
            return (self.length_mm, self.length_mm);
        }
        let is_near_start = gained <= self.pulse_mm_s;
        if !is_near_start && left >= self.pulse_mm_s {
            let held = gained - self.pulse_mm_s;
            let held_mm = held * self.per_accel * (feed_mm_s - 0.5 * held);
            let about_mm = self.from_mm_s * self.pulse.duration_s + self.pulse_mm + held_mm;
            let slack_mm = self.length_mm * EXACT_WITHIN;
            return (about_mm - slack_mm, about_mm + slack_mm);
        }
        let (near, end_mm_s) = if is_near_start { (gained, self.from_mm_s) } else { (left, self.to_mm_s) };
        let (straight_mm, curve_mm, slack_mm) = if near <= self.arch_mm_s {
            let (x, length) = Shape::<f64>::about_where_speed_is(near * self.per_arch);
            let (straight_mm, curve_mm) = (end_mm_s * (self.arch_s * x), self.arch_mm * length);
            (straight_mm, curve_mm, straight_mm * ABOUT_WITHIN[0] + curve_mm * ABOUT_WITHIN[1])
        } else if near <= self.plateau_mm_s {
            let (at_s, curve_mm) = self.pulse.where_speed_is(near);
            (end_mm_s * at_s, curve_mm, self.length_mm * EXACT_WITHIN)
        } else {
            let (accel, missing) = (self.pulse.accel_mm_s2(), self.pulse_mm_s - near);
            let (x, length) = Shape::<f64>::about_where_missing_is(
                missing * self.per_arch,
                accel * self.arch_s * self.per_arch,
            );
            let left_s = self.arch_s * x;
            let left_mm = left_s * (self.pulse_mm_s - 0.5 * accel * left_s) + self.arch_mm * length;
            let straight_mm = end_mm_s * (self.pulse.duration_s - left_s);
            let [time, of_length] = ABOUT_MISSING_WITHIN;
            let rounding_mm = self.length_mm * EXACT_WITHIN;
            let slack_mm = feed_mm_s * left_s * time + self.arch_mm * of_length + rounding_mm;
            (straight_mm, self.pulse_mm - left_mm, slack_mm)
        };
        let about_mm =
            if is_near_start { straight_mm + curve_mm } else { self.length_mm - (straight_mm - curve_mm) };
        (about_mm - slack_mm, about_mm + slack_mm)
    }
}
