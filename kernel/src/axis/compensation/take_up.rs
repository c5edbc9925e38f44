//! Backlash, and its take-up: from rest to rest over a septic.

use serde::{Deserialize, Serialize};

use super::super::check::{Check, fits};
use crate::num::Real;
use crate::path::Setpoint;

/// Greatest backlash \[mm\].
pub const BACKLASH_MM_MAX: f64 = 1.0;
/// Greatest velocity, acceleration and jerk of a take-up over its backlash in its time: b/T, b/T², b/T³ times these.
pub const TAKE_UP_PEAKS: [f64; 3] = [2.1875, 7.513_188_404_399_293, 52.5];
/// A take-up has at most so many ticks.
pub const TAKE_UP_TICKS_MAX: f64 = 60_000.0;

/// Play between motor and load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Backlash {
    /// The play \[mm\], above 0, at most [`BACKLASH_MM_MAX`].
    pub play_mm: f64,
    /// How long the motor takes to go through it \[s\], from a tick to 60000; not faster than the axis' output
    /// ([`TAKE_UP_PEAKS`]).
    pub take_up_s: f64,
}

/// A [`Backlash`] made for the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TakeUp<R> {
    play_mm: R,
    pub(super) ticks: u16,
    per_tick: R,
    /// Over the play and the time T: b/T, b/T², b/T³.
    velocity_mm_s: R,
    accel_mm_s2: R,
    jerk_mm_s3: R,
}

impl<R: Real> TakeUp<R> {
    pub(super) fn new(check: &mut Check, backlash: &Backlash, most_mm_s: f64, tick_s: f64) -> Self {
        let &Backlash { play_mm, take_up_s } = backlash;
        let is_play = play_mm > 0.0 && play_mm <= BACKLASH_MM_MAX;
        check.that(is_play, "backlash [mm]", play_mm, "a number above 0, at most 1");
        // Whole ticks, one at least: what is rounded is less than a tick.
        let ticks = libm::round(take_up_s / tick_s);
        let expected = "from one tick to 60000";
        check.within([1.0, TAKE_UP_TICKS_MAX], "ticks of a take-up", ticks, expected);
        let take_up_s = ticks * tick_s;
        let [velocity_mm_s, accel_mm_s2, jerk_mm_s3] = [
            play_mm / take_up_s,
            play_mm / take_up_s / take_up_s,
            play_mm / take_up_s / take_up_s / take_up_s,
        ];
        let [peak, _, peak_of_jerk] = TAKE_UP_PEAKS;
        let expected = "a take-up that the output reaches, within the kernel's range";
        let is_reached = peak * velocity_mm_s <= most_mm_s && fits::<R>(8.0 * peak_of_jerk * jerk_mm_s3);
        check.that(is_reached, "velocity of a take-up [mm/s]", peak * velocity_mm_s, expected);
        Self {
            play_mm: R::from_f64(play_mm),
            ticks: ticks as u16,
            per_tick: R::from_f64(1.0 / ticks),
            velocity_mm_s: R::from_f64(velocity_mm_s),
            accel_mm_s2: R::from_f64(accel_mm_s2),
            jerk_mm_s3: R::from_f64(jerk_mm_s3),
        }
    }

    /// c of the play, after so many ticks of a take-up to the side \[mm\].
    pub(super) fn at(&self, ticks: u16, is_negative: bool) -> R {
        let share = if ticks >= self.ticks {
            R::ONE
        } else {
            let u = number::<R>(ticks) * self.per_tick;
            let u2 = u * u;
            let [c4, c5, c6, c7] = [35, 84, 70, 20].map(number::<R>);
            u2 * u2 * (c4 - u * (c5 - u * (c6 - u * c7)))
        };
        let share = if is_negative { share } else { R::ONE - share };
        -(self.play_mm * share)
    }

    /// Adds velocity, acceleration and jerk of c after so many ticks of a take-up to the side.
    pub(super) fn add(&self, setpoint: &mut Setpoint<R>, ticks: u16, is_negative: bool) {
        if ticks >= self.ticks {
            return;
        }
        let u = number::<R>(ticks) * self.per_tick;
        let w = u * (R::ONE - u);
        let [s1, s2, s3, five] = [140, 420, 840, 5].map(number::<R>);
        let velocity = self.velocity_mm_s * (s1 * w * w * w);
        let accel = self.accel_mm_s2 * (s2 * w * w * (R::ONE - u - u));
        let jerk = self.jerk_mm_s3 * (s3 * w * (R::ONE - five * w));
        let signed = |value: R| if is_negative { -value } else { value };
        setpoint.velocity_mm_s = setpoint.velocity_mm_s + signed(velocity);
        setpoint.accel_mm_s2 = setpoint.accel_mm_s2 + signed(accel);
        setpoint.jerk_mm_s3 = setpoint.jerk_mm_s3 + signed(jerk);
    }
}

fn number<R: Real>(count: u16) -> R {
    R::from_q32(i64::from(count) << 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 0.0005;

    /// Against Bernstein's form of the septic, and differences of it; to either side.
    #[test]
    fn a_take_up_goes_from_rest_to_rest() {
        let share = |u: f64| -> f64 {
            [35.0, 21.0, 7.0, 1.0]
                .iter()
                .zip(4..)
                .map(|(c, k): (&f64, i32)| c * u.powi(k) * (1.0 - u).powi(7 - k))
                .sum()
        };
        let backlash = Backlash { play_mm: 0.02, take_up_s: 0.01 };
        let take_up: TakeUp<f64> =
            Check::all(|check| TakeUp::new(check, &backlash, 1000.0, TICK_S)).expect("a take-up");
        let (h, mut peaks) = (1e-3, [0.0_f64; 3]);
        for ticks in 0..=25_u16 {
            let u = (f64::from(ticks) / 20.0).min(1.0);
            assert!((take_up.at(ticks, true) + 0.02 * share(u)).abs() < 1e-15);
            assert!((take_up.at(ticks, false) + 0.02 * (1.0 - share(u))).abs() < 1e-15);
            if !(1..20).contains(&ticks) {
                continue;
            }
            let [below, above, below2, above2] = [-h, h, -2.0 * h, 2.0 * h].map(|step| share(u + step));
            let first = (above - below) / (2.0 * h);
            let second = (above - 2.0 * share(u) + below) / (h * h);
            let third = (above2 - 2.0 * above + 2.0 * below - below2) / (2.0 * h * h * h);
            for is_negative in [true, false] {
                let mut motor = Setpoint::<f64>::default();
                take_up.add(&mut motor, ticks, is_negative);
                let sign = if is_negative { -1.0 } else { 1.0 };
                for (found, (expected, tolerance)) in
                    [motor.velocity_mm_s, motor.accel_mm_s2, motor.jerk_mm_s3].into_iter().zip([
                        (sign * 0.02 * first / 0.01, 1e-4),
                        (sign * 0.02 * second / 1e-4, 0.02),
                        (sign * 0.02 * third / 1e-6, 100.0),
                    ])
                {
                    assert!((found - expected).abs() < tolerance, "{ticks}: {found} {expected}");
                }
                let found = [motor.velocity_mm_s, motor.accel_mm_s2, motor.jerk_mm_s3];
                peaks = core::array::from_fn(|order| peaks[order].max(found[order].abs()));
            }
        }
        let most = [0.02 / 0.01, 0.02 / 1e-4, 0.02 / 1e-6];
        for order in 0..3 {
            let most = TAKE_UP_PEAKS[order] * most[order];
            assert!(peaks[order] <= most * 1.000_001 && peaks[order] > 0.9 * most, "{peaks:?}");
        }
    }
}
