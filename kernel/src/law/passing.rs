//! Bounds on where an accelerating ramp passes a feed.
//!
//! Consumes a ramp, then feeds; produces two lengths between which [`Ramp::length_to_feed_mm`] lies, at a
//! fraction of its cost: no division, two square roots. Background: the planner of spanning ramps uses it for
//! every ceiling that a ramp may pass.

use super::Ramp;
use super::shape::{ABOUT_WITHIN, Shape};
use crate::work;

/// Relative rounding of the length while acceleration is held, where the formula is exact.
const HELD_WITHIN: f64 = 1.0e-12;

/// The values of a ramp that are the same for every feed it passes.
#[derive(Clone, Copy, Debug)]
pub struct Passing {
    from_mm_s: f64,
    to_mm_s: f64,
    rise_s: f64,
    length_mm: f64,
    /// The feed gained while acceleration rises \[mm/s\]: a quarter of the scale of feeds.
    curved_mm_s: f64,
    /// 1 / `curved_mm_s`.
    per_curved: f64,
    /// The scale of lengths: Jp·t₁³ \[mm\].
    curve_mm: f64,
    /// One over the greatest acceleration \[s²/mm\].
    per_accel: f64,
}

impl Passing {
    /// Prepares `ramp`, which goes from a lower feed to a higher one.
    #[must_use]
    pub fn new(ramp: &Ramp<f64>) -> Self {
        let accel = ramp.peak_accel_mm_s2();
        let per_accel = 1.0 / accel;
        let rise_s = ramp.t1_s;
        Self {
            from_mm_s: ramp.from_mm_s,
            to_mm_s: ramp.to_mm_s,
            rise_s,
            length_mm: ramp.length_mm(),
            curved_mm_s: 0.5 * accel * rise_s,
            per_curved: 2.0 * per_accel / rise_s,
            curve_mm: 2.0 * accel * rise_s * rise_s,
            per_accel,
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
        let near_start = gained <= self.curved_mm_s;
        if !near_start && left >= self.curved_mm_s {
            let straight_mm = self.from_mm_s * self.rise_s + self.curve_mm * Shape::END.length;
            let held = gained - self.curved_mm_s;
            let held_mm = held * self.per_accel * (feed_mm_s - 0.5 * held);
            let slack_mm = self.length_mm * HELD_WITHIN;
            let about_mm = straight_mm + held_mm;
            return (about_mm - slack_mm, about_mm + slack_mm);
        }
        let (near, end_mm_s) = if near_start { (gained, self.from_mm_s) } else { (left, self.to_mm_s) };
        let (x, shape_length) = Shape::<f64>::about_where_speed_is(0.25 * (near * self.per_curved));
        let straight_mm = end_mm_s * (self.rise_s * x);
        let curve_mm = self.curve_mm * shape_length;
        let slack_mm = straight_mm * ABOUT_WITHIN[0] + curve_mm * ABOUT_WITHIN[1];
        let about_mm =
            if near_start { straight_mm + curve_mm } else { self.length_mm - (straight_mm - curve_mm) };
        (about_mm - slack_mm, about_mm + slack_mm)
    }
}
