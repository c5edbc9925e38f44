//! The regulator of S4 (1).
//!
//! ```text
//! U = kp·ε + kd·Δε + ki·Σε + F_V(V) + F_a(a) + F_J(J)
//! ```
//!
//! ε is the following error; V, a, J are the commanded velocity, acceleration and jerk of this tick; the F
//! are [`super::feedforward`]. P, PI, PD, PID and open loop are choices of the gains. Gains have units of
//! time, so they keep their meaning when the tick changes; [`AxesConfig`](super::AxesConfig) turns them into
//! per-tick factors.
//!
//! **Anti-windup**: while the output is at its limit, the sum takes no error that would drive the
//! output farther out.

use serde::{Deserialize, Serialize};

use super::check::{Check, fits};
use super::feedforward::{Feedforward, FeedforwardConfig, FeedforwardState};
use crate::num::{Real, is_finite, is_within};
use crate::path::Setpoint;

/// Feedback gains, output \[mm/s\] per following error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    /// Proportional \[1/s\].
    pub kp_per_s: f64,
    /// Integral \[1/s²\]: ki of S4 (1) is this times the tick.
    pub ki_per_s2: f64,
    /// Derivative \[1\]: kd of S4 (1) is this divided by the tick.
    pub kd: f64,
}

/// The regulator's configuration, per tick. Immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Regulator<R> {
    kp: R,
    ki: R,
    kd: R,
    feedforward: FeedforwardConfig<R>,
}

/// The regulator's state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RegulatorState<R> {
    /// ki·Σε \[mm/s\]: in units of the output, so that a new ki does not move it.
    integral_mm_s: R,
    /// ε of the tick before \[mm\].
    last_error_mm: R,
    feedforward: FeedforwardState<R>,
    /// The learnt correction of this stretch, added to the command \[mm/s\].
    pub correction_mm_s: R,
}

/// The regulator's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Command<R> {
    /// Velocity command \[mm/s\].
    pub velocity_mm_s: R,
    /// The command was cut at a limit.
    pub saturated: bool,
}

impl<R: Real> RegulatorState<R> {
    /// Notes a tick without output, so that the next one has no derivative kick.
    #[inline]
    pub(crate) fn watch(&mut self, error_mm: R) {
        self.last_error_mm = error_mm;
    }

    /// ε of the tick before \[mm\].
    #[inline]
    pub(super) fn last_error_mm(&self) -> R {
        self.last_error_mm
    }
}

impl<R: Real> Regulator<R> {
    /// The regulator for a control tick of `tick_s`, position set-points delayed by `preview_ticks`, and
    /// following errors up to `error_limit_mm`, beyond which the axis faults.
    ///
    /// Refused if a gain or the tick is not finite, kp, ki or kd is negative, the tick is not positive, or a
    /// gain at the error limit or feedforward is beyond the number type's range.
    pub(super) fn new(
        check: &mut Check,
        gains: Gains,
        feedforward: &Feedforward,
        preview_ticks: u8,
        tick_s: f64,
        error_limit_mm: f64,
    ) -> Self {
        check.that(tick_s > 0.0 && is_finite(tick_s), "tick [s]", tick_s, "a positive number");
        Self {
            kp: gain(check, "kp [1/s]", gains.kp_per_s, error_limit_mm),
            ki: gain(check, "ki [1/s²]", gains.ki_per_s2 * tick_s, error_limit_mm),
            kd: gain(check, "kd [1]", gains.kd / tick_s, 2.0 * error_limit_mm),
            feedforward: FeedforwardConfig::checked(check, feedforward, preview_ticks, tick_s),
        }
    }

    /// One tick: the velocity command, cut at `limits` \[mm/s\].
    #[inline]
    pub(crate) fn tick(
        &self,
        state: &mut RegulatorState<R>,
        error_mm: R,
        setpoint: &Setpoint<R>,
        limits: (R, R),
    ) -> Command<R> {
        let change_mm = error_mm - state.last_error_mm;
        state.last_error_mm = error_mm;
        let feedforward = self.feedforward.tick(&mut state.feedforward, setpoint) + state.correction_mm_s;
        let integral_mm_s = state.integral_mm_s + self.ki * error_mm;
        let wanted = feedforward + self.kp * error_mm + self.kd * change_mm + integral_mm_s;
        let (least, greatest) = limits;
        let (velocity_mm_s, saturated, winding_up) = if wanted > greatest {
            (greatest, true, error_mm > R::ZERO)
        } else if wanted < least {
            (least, true, error_mm < R::ZERO)
        } else {
            (wanted, false, false)
        };
        if !winding_up {
            state.integral_mm_s = integral_mm_s;
        }
        Command { velocity_mm_s, saturated }
    }
}

/// A gain whose product with the input is at most `per_mm` times the gain.
#[inline(never)]
fn gain<R: Real>(check: &mut Check, quantity: &'static str, value: f64, per_mm: f64) -> R {
    // Leaves room for the sum of all terms.
    let fits = is_within(value, 0.0, f64::MAX) && fits::<R>(value) && fits::<R>(8.0 * value * per_mm);
    check.that(fits, quantity, value, "a number within the kernel's range, not below 0");
    R::from_f64(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::ScaleError;
    use crate::random::Random;

    const TICK_S: f64 = 0.0005;
    const WIDE: (f64, f64) = (-1e9, 1e9);

    fn regulator(gains: Gains, feedforward: Feedforward) -> Regulator<f64> {
        new(gains, feedforward, TICK_S, 1.0).expect("valid")
    }

    fn new<R: Real>(
        gains: Gains,
        feedforward: Feedforward,
        tick_s: f64,
        error_limit_mm: f64,
    ) -> Result<Regulator<R>, ScaleError> {
        Check::all(|check| Regulator::new(check, gains, &feedforward, 0, tick_s, error_limit_mm))
    }

    /// S4 (1) written out, on a random sequence of errors and set-points.
    #[test]
    fn is_the_papers_equation() {
        let gains = Gains { kp_per_s: 230.0, ki_per_s2: 900.0, kd: 0.003 };
        let feedforward =
            Feedforward { velocity: 1.0, accel_s: 1.675e-3, jerk_s2: 2.2e-5, ..Feedforward::default() };
        let regulator = regulator(gains, feedforward);
        let mut state = RegulatorState::default();
        let (random, mut errors) = (Random::new(7), Vec::new());
        for _ in 0..1000 {
            let unit = || 2.0 * random.unit() - 1.0;
            let setpoint = Setpoint {
                velocity_mm_s: 300.0 * unit(),
                accel_mm_s2: 5e3 * unit(),
                jerk_mm_s3: 5e4 * unit(),
                ..Setpoint::default()
            };
            errors.push(0.01 * unit());
            let error = errors[errors.len() - 1];
            let found = regulator.tick(&mut state, error, &setpoint, WIDE);
            let change = error - if errors.len() > 1 { errors[errors.len() - 2] } else { 0.0 };
            let expected = gains.kp_per_s * error
                + gains.kd / TICK_S * change
                + gains.ki_per_s2 * TICK_S * errors.iter().sum::<f64>()
                + setpoint.velocity_mm_s
                + 1.675e-3 * setpoint.accel_mm_s2
                + 2.2e-5 * setpoint.jerk_mm_s3;
            assert!((found.velocity_mm_s - expected).abs() < 1e-9);
            assert!(!found.saturated);
        }
    }

    #[test]
    fn gains_of_zero_open_the_loop() {
        let open = regulator(Gains::default(), Feedforward { velocity: 1.0, ..Feedforward::default() });
        let setpoint = Setpoint { velocity_mm_s: 120.0, ..Setpoint::default() };
        let command = open.tick(&mut RegulatorState::default(), 55.0, &setpoint, WIDE);
        assert!((command.velocity_mm_s - 120.0).abs() < 1e-12);
        let mut state = RegulatorState { correction_mm_s: -2.5, ..RegulatorState::default() };
        let corrected = open.tick(&mut state, 55.0, &setpoint, WIDE);
        assert!((corrected.velocity_mm_s - 117.5).abs() < 1e-12);
    }

    /// After a long saturation the output must come back as soon as the error changes sign.
    #[test]
    fn the_sum_does_not_wind_up() {
        let regulator = regulator(Gains { kp_per_s: 10.0, ki_per_s2: 1e4, kd: 0.0 }, Feedforward::default());
        let mut state = RegulatorState::default();
        let still = Setpoint::default();
        for _ in 0..100_000 {
            let command = regulator.tick(&mut state, 5.0, &still, (-40.0, 30.0));
            assert!(command.saturated && (command.velocity_mm_s - 30.0).abs() < 1e-12);
        }
        let back = regulator.tick(&mut state, -1.0, &still, (-40.0, 30.0));
        assert!(back.velocity_mm_s < 0.0, "{}", back.velocity_mm_s);
    }

    #[test]
    fn refuses_gains_that_are_not_numbers() {
        let gains = Gains { kp_per_s: f64::NAN, ..Gains::default() };
        assert!(new::<f32>(gains, Feedforward::default(), TICK_S, 1.0).is_err());
        assert!(new::<f32>(Gains::default(), Feedforward::default(), 0.0, 1.0).is_err());
        // 8·10⁷·100 mm/s do not fit 32.32 bits.
        let strong = Gains { kp_per_s: 1e7, ..Gains::default() };
        assert!(new::<crate::num::Fixed>(strong, Feedforward::default(), TICK_S, 220.0).is_err());
        assert!(new::<f32>(strong, Feedforward::default(), TICK_S, 220.0).is_ok());
    }
}
