//! Bounds on where an accelerating ramp passes a feed.
//!
//! Consumes a ramp, then feeds; produces two lengths between which [`Ramp::length_to_feed_mm`] lies, at a
//! fraction of its cost: in f32, with two square roots in an opening edge, one and a division on the plateau, three
//! divisions in a closing edge. Only what is gained by a feed is a difference in f64. Background: the planner of
//! spanning ramps uses it for every ceiling that a ramp may pass.

use super::Ramp;
use super::pulse::JerkPulse;
use super::shape::{ABOUT_MISSING_WITHIN, ABOUT_WITHIN, Shape};
use crate::work;

/// Rounding in f32, as a part of the ramp's length: of all formulas, and of those that are exact but for it.
const ROUNDING: f32 = 4.0e-6;

/// The values of a ramp that are the same for every feed it passes.
#[derive(Clone, Copy, Debug)]
pub struct Passing {
    from_mm_s: f64,
    to_mm_s: f64,
    length_mm: f64,
    /// The feeds in f32.
    low_mm_s: f32,
    high_mm_s: f32,
    pulse: JerkPulse<f32>,
    /// One over the greatest acceleration \[s²/mm\].
    per_accel: f32,
    /// What a pulse gains \[mm/s, mm\].
    pulse_mm_s: f32,
    pulse_mm: f32,
    /// The feed gained up to which the shape of an arch holds: of all of a pulse without a plateau, or of an
    /// edge \[mm/s\].
    arch_mm_s: f32,
    /// The length of the arch \[s\], and the scale of its lengths \[mm\].
    arch_s: f32,
    arch_mm: f32,
    /// One over the scale of its feeds \[s/mm\].
    per_arch: f32,
    /// The feed gained up to which there is a plateau, and from which on the closing edge follows \[mm/s\].
    plateau_mm_s: f32,
}

impl Passing {
    /// Prepares `ramp`, which goes from a lower feed to a higher one.
    #[must_use]
    pub fn new(ramp: &Ramp<f64>) -> Self {
        let pulse = JerkPulse {
            jerk_mm_s3: ramp.peak_jerk_mm_s3 as f32,
            edge_s: ramp.edge_s as f32,
            duration_s: ramp.t1_s as f32,
        };
        let arch_s = 2.0 * pulse.edge_s;
        let scale_mm_s = pulse.jerk_mm_s3 * arch_s * arch_s;
        let arch_mm_s = if pulse.duration_s > arch_s { Shape::<f32>::middle().speed } else { 0.25 };
        let pulse_mm_s = pulse.speed_mm_s();
        Self {
            from_mm_s: ramp.from_mm_s,
            to_mm_s: ramp.to_mm_s,
            length_mm: ramp.length_mm(),
            low_mm_s: ramp.from_mm_s as f32,
            high_mm_s: ramp.to_mm_s as f32,
            pulse,
            per_accel: 1.0 / pulse.accel_mm_s2(),
            pulse_mm_s,
            pulse_mm: pulse.length_mm(),
            arch_mm_s: scale_mm_s * arch_mm_s,
            arch_s,
            arch_mm: scale_mm_s * arch_s,
            per_arch: 1.0 / scale_mm_s,
            plateau_mm_s: pulse_mm_s - pulse.closing_mm_s(),
        }
    }

    /// Two lengths between which [`Ramp::length_to_feed_mm`] lies \[mm\], less than a thousandth of the
    /// ramp's length apart.
    #[must_use]
    pub fn length_to_feed_mm(&self, feed_mm_s: f64) -> (f64, f64) {
        work::add(1);
        if feed_mm_s <= self.from_mm_s {
            return (0.0, 0.0);
        }
        if feed_mm_s >= self.to_mm_s {
            return (self.length_mm, self.length_mm);
        }
        let (gained, left) = ((feed_mm_s - self.from_mm_s) as f32, (self.to_mm_s - feed_mm_s) as f32);
        let (about_mm, slack_mm) = self.about_mm(gained, left);
        let (about_mm, slack_mm) = (f64::from(about_mm), f64::from(slack_mm));
        (about_mm - slack_mm, about_mm + slack_mm)
    }

    /// The length where feed has been `gained`, with what is `left` to gain \[mm/s\], and its greatest error.
    fn about_mm(&self, gained: f32, left: f32) -> (f32, f32) {
        let (length_mm, feed_mm_s) = (self.length_mm as f32, self.low_mm_s + gained);
        let rounding_mm = length_mm * ROUNDING;
        let is_near_start = gained <= self.pulse_mm_s;
        if !is_near_start && left >= self.pulse_mm_s {
            let held = gained - self.pulse_mm_s;
            let held_mm = held * self.per_accel * (feed_mm_s - 0.5 * held);
            return (self.low_mm_s * self.pulse.duration_s + self.pulse_mm + held_mm, rounding_mm);
        }
        let (near, end_mm_s) = if is_near_start { (gained, self.low_mm_s) } else { (left, self.high_mm_s) };
        let (straight_mm, curve_mm, slack_mm) = if near <= self.arch_mm_s {
            let (x, length) = Shape::<f32>::about_where_speed_is(near * self.per_arch);
            let (straight_mm, curve_mm) = (end_mm_s * (self.arch_s * x), self.arch_mm * length);
            let [time, of_length] = ABOUT_WITHIN;
            (straight_mm, curve_mm, straight_mm * time as f32 + curve_mm * of_length as f32)
        } else if near <= self.plateau_mm_s {
            let (at_s, curve_mm) = self.pulse.where_speed_is(near);
            (end_mm_s * at_s, curve_mm, 0.0)
        } else {
            let (accel, missing) = (self.pulse.accel_mm_s2(), self.pulse_mm_s - near);
            let (x, length) = Shape::<f32>::about_where_missing_is(
                missing * self.per_arch,
                accel * self.arch_s * self.per_arch,
            );
            let left_s = self.arch_s * x;
            let left_mm = left_s * (self.pulse_mm_s - 0.5 * accel * left_s) + self.arch_mm * length;
            let straight_mm = end_mm_s * (self.pulse.duration_s - left_s);
            let [time, of_length] = ABOUT_MISSING_WITHIN;
            let slack_mm = feed_mm_s * left_s * time as f32 + self.arch_mm * of_length as f32;
            (straight_mm, self.pulse_mm - left_mm, slack_mm)
        };
        let about_mm =
            if is_near_start { straight_mm + curve_mm } else { length_mm - (straight_mm - curve_mm) };
        (about_mm, slack_mm + rounding_mm)
    }
}
