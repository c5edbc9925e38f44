//! The judge of motion along a path: its limits at every tick, and that neither feed nor acceleration jumps between two.

use motion_kernel::law::PathMotion;
use motion_kernel::num::Real;
use motion_kernel::queue::PathRules;

/// Feed, acceleration, jerk and snap.
pub type Along = [f64; 4];

/// Feed, acceleration, jerk and snap of a tick.
pub fn along<R: Real>(motion: &PathMotion<R>) -> Along {
    [motion.v_mm_s, motion.a_mm_s2, motion.j_mm_s3, motion.snap_mm_s4].map(|value| value.to_f64())
}

/// What it judges by.
#[derive(Clone, Copy, Debug)]
pub struct Judge {
    limits: Along,
    tick_s: f64,
    share: f64,
    rounding: f64,
}

impl Judge {
    /// Quantities may exceed the limits of `rules` by the part `share` of them, and by `rounding`.
    #[must_use]
    pub const fn new(rules: &PathRules, tick_s: f64, share: f64, rounding: f64) -> Self {
        let limits = &rules.limits;
        let limits = [rules.feed_mm_s, limits.accel_mm_s2, limits.jerk_mm_s3, limits.snap_mm_s4];
        Self { limits, tick_s, share, rounding }
    }

    fn bound(&self, limit: f64) -> f64 {
        limit * (1.0 + self.share) + self.rounding
    }

    /// Every quantity is within its limit.
    ///
    /// # Errors
    /// The quantity that is not, or that is not a number.
    pub fn limits(&self, now: &Along) -> Result<(), String> {
        for (name, (value, limit)) in
            ["feed", "acceleration", "jerk", "snap"].into_iter().zip(now.iter().zip(self.limits))
        {
            // Written so that what is not a number fails.
            if !(value.abs() <= self.bound(limit)) {
                return Err(format!("{name} {value}, limit {limit}"));
            }
        }
        Ok(())
    }

    /// In a tick the feed changes by what the limit of acceleration makes of it, and no more.
    ///
    /// # Errors
    /// The step.
    pub fn feed(&self, before: &Along, now: &Along) -> Result<(), String> {
        self.step("feed", now[0] - before[0], self.limits[1])
    }

    /// The same of the acceleration and jerk.
    ///
    /// # Errors
    /// The step.
    pub fn accel(&self, before: &Along, now: &Along) -> Result<(), String> {
        self.step("acceleration", now[1] - before[1], self.limits[2])
    }

    fn step(&self, name: &str, step: f64, rate: f64) -> Result<(), String> {
        let bound = self.bound(rate * self.tick_s);
        if step.abs() <= bound { Ok(()) } else { Err(format!("the {name} steps by {step}, bound {bound}")) }
    }
}
