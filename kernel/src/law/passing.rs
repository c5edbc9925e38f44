//! Bounds on where an accelerating ramp passes a feed.
//!
//! Consumes a ramp, then feeds; produces two lengths between which [`Ramp::length_to_feed_mm`] lies, at a
//! fraction of its cost: in f32, with two square roots in an opening edge, two and a division on the plateau, three
//! divisions in a closing edge. Only what is gained by a feed is a difference in f64. Background: the planner of
//! spanning ramps uses it for every ceiling that a ramp may pass.

use super::Ramp;
use super::pulse::JerkPulse;
use super::shape::{ABOUT_MISSING_WITHIN, ABOUT_WITHIN, Shape};
use crate::num::is_finite;
use crate::work;

/// Greatest rounding in f32, as a part of the ramp's length; in the hold and on the plateau it is the only error.
const ROUNDING: f32 = 1.0e-6;

/// The values of a ramp that are the same for every feed it passes.
#[derive(Clone, Copy, Debug)]
pub struct Passing {
    from_mm_s: f64,
    to_mm_s: f64,
    length_mm: f64,
    /// The feeds in f32.
    from_narrow_mm_s: f32,
    to_narrow_mm_s: f32,
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
            from_narrow_mm_s: ramp.from_mm_s as f32,
            to_narrow_mm_s: ramp.to_mm_s as f32,
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
    /// ramp's length apart unless f32 is too narrow for the ramp's figures.
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
        if is_finite(about_mm) && is_finite(slack_mm) {
            (about_mm - slack_mm, about_mm + slack_mm)
        } else {
            // Limits that f32 does not hold.
            (0.0, self.length_mm)
        }
    }

    /// The length where feed has been `gained`, with what is `left` to gain \[mm/s\], and its greatest error.
    fn about_mm(&self, gained: f32, left: f32) -> (f32, f32) {
        let (length_mm, feed_mm_s) = (self.length_mm as f32, self.from_narrow_mm_s + gained);
        let rounding_mm = length_mm * ROUNDING;
        let is_near_start = gained <= self.pulse_mm_s;
        if !is_near_start && left >= self.pulse_mm_s {
            let held = gained - self.pulse_mm_s;
            let held_mm = held * self.per_accel * (feed_mm_s - 0.5 * held);
            return (self.from_narrow_mm_s * self.pulse.duration_s + self.pulse_mm + held_mm, rounding_mm);
        }
        let (near, end_mm_s) =
            if is_near_start { (gained, self.from_narrow_mm_s) } else { (left, self.to_narrow_mm_s) };
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

#[cfg(test)]
mod tests {
    use std::println;

    use super::*;
    use crate::law::{Law, Limits, Pulse};
    use crate::random::Random;

    /// Ramps of all regimes and sizes, from rest too, and such that are longer than their law asks for, as when one is
    /// driven on to rest: what the bounds allow for rounding is needed to a quarter, and is enough.
    #[test]
    fn bounds_allow_for_rounding() {
        let random = Random::new(21);
        let mut worst = 0.0_f64;
        for number in 0..100_000 {
            let pulse = if number % 2 == 0 { Pulse::Plateau } else { Pulse::Sin2 };
            let limits = Limits {
                accel_mm_s2: random.log(1.0, 1e5),
                jerk_mm_s3: random.log(1.0, 1e7),
                snap_mm_s4: random.log(10.0, 1e10),
            };
            let law = Law::new(pulse, limits).expect("limits");
            let from_mm_s = if number % 3 == 0 { 0.0 } else { random.log(1e-3, 1e3) };
            let mut ramp = Ramp::new(&law, from_mm_s, from_mm_s + random.log(1e-6, 1e3));
            if number % 5 == 0 {
                (ramp.t1_s, ramp.t2_s) = (ramp.t1_s * 1.25, ramp.t2_s * 1.5);
                let change = ramp.to_mm_s - ramp.from_mm_s;
                ramp.peak_jerk_mm_s3 = change / ramp.t2_s / (ramp.t1_s - ramp.edge_s);
            }
            let change = ramp.to_mm_s - ramp.from_mm_s;
            let part = random.log(1e-6, 1.0);
            let gained = change * if number % 7 < 4 { part } else { 1.0 - part };
            let (feed_mm_s, left) = (from_mm_s + gained, change - gained);
            let (passing, exact_mm) = (Passing::new(&ramp), ramp.length_to_feed_mm(feed_mm_s));
            let (about_mm, slack_mm) = passing.about_mm(gained as f32, left as f32);
            let length_mm = ramp.length_mm();
            let own_mm = f64::from(slack_mm) - length_mm * f64::from(ROUNDING);
            let off = (libm::fabs(f64::from(about_mm) - exact_mm) - own_mm) / length_mm;
            // Where the feed hardly changes its own last place is a long way.
            let (low_mm, high_mm) = passing.length_to_feed_mm(feed_mm_s);
            if gained > 1e-9 * feed_mm_s && left > 1e-9 * feed_mm_s {
                worst = worst.max(off);
                assert!(
                    low_mm <= exact_mm && exact_mm <= high_mm,
                    "{number}: {ramp:?} {low_mm} {exact_mm} {high_mm}"
                );
            }
        }
        println!("worst: {worst:e} of the length");
        assert!(worst < f64::from(ROUNDING) && worst > 0.25 * f64::from(ROUNDING), "{worst:e}");
    }

    /// Limits that f32 does not hold: the bounds say nothing, and the exact length decides.
    #[test]
    fn what_f32_does_not_hold_is_left_open() {
        let limits = Limits { accel_mm_s2: 1e30, jerk_mm_s3: 1e60, snap_mm_s4: 1e90 };
        let ramp = Ramp::new(&Law::new(Pulse::Plateau, limits).expect("limits"), 1.0, 2.0);
        assert_eq!(Passing::new(&ramp).length_to_feed_mm(1.5), (0.0, ramp.length_mm()));
    }
}
