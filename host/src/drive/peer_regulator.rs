//! A regulator of the kind common in machine controllers: it knows only positions, and differences them.
//!
//! Consumes a position command and a position per servo period; produces a velocity command. It computes what
//! LinuxCNC's HAL component `pid` does with its default settings and without its limits on single terms:
//!
//! ```text
//! ε    = c[n−1] − x[n]                      its error-previous-target: the motion is to be at c[n] one period later
//! D1   = (c[n] − c[n−1])/T                  D2 = (D1[n] − D1[n−1])/T      D3 = (D2[n] − D2[n−1])/T
//! U    = bias + P·ε + I·Σε·T + D·(D1 − (x[n] − x[n−1])/T) + FF0·c + FF1·D1 + FF2·D2 + FF3·D3,  within ±maxoutput
//! ```
//!
//! **Its differences.** Seen from c[n−1], to which the error refers, D1 is the velocity half a period later,
//! D2 the acceleration then, D3 the jerk half a period before. With the period T the series of its
//! feedforward is s·(FF1 + (FF1·T/2 + FF2)·s + (FF1·T²/6 + FF3)·s²): the gains of analytic feedforward, less
//! what differencing adds.

use motion_kernel::axis::Feedforward;

/// Gains of the regulator; all of them finite.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PeerGains {
    /// The gain of the error \[1/s\].
    pub p_per_s: f64,
    /// The gain of the error's sum \[1/s²\].
    pub i_per_s2: f64,
    /// The gain of the error's change \[1\].
    pub d: f64,
    /// The gain of the position command \[1/s\].
    pub ff0_per_s: f64,
    /// The gain of its first difference \[1\].
    pub ff1: f64,
    /// The gain of its second difference \[s\].
    pub ff2_s: f64,
    /// The gain of its third difference \[s²\].
    pub ff3_s2: f64,
}

impl PeerGains {
    /// The gains with which it does what `feedforward`'s gains of velocity, acceleration and jerk do, up to
    /// the jerk, if positions are exact. Ignores the rest of `feedforward`; has no feedback.
    #[must_use]
    pub fn like(feedforward: &Feedforward, tick_s: f64) -> Self {
        let &Feedforward { velocity, accel_s, jerk_s2, .. } = feedforward;
        Self {
            ff1: velocity,
            ff2_s: accel_s - velocity * tick_s / 2.0,
            ff3_s2: jerk_s2 - velocity * tick_s * tick_s / 6.0,
            ..Self::default()
        }
    }

    /// The inverse of [`PeerGains::like`]: gains of velocity, acceleration and jerk.
    #[must_use]
    pub fn analytic(&self, tick_s: f64) -> Feedforward {
        Feedforward {
            velocity: self.ff1,
            accel_s: self.ff2_s + self.ff1 * tick_s / 2.0,
            jerk_s2: self.ff3_s2 + self.ff1 * tick_s * tick_s / 6.0,
            ..Feedforward::default()
        }
    }
}

/// The regulator of one axis, which has been at rest at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PeerRegulator {
    command_mm: f64,
    position_mm: f64,
    differences: [f64; 2],
    sum_mm_s: f64,
    /// 1 or −1 while the output is at its limit.
    limit: f64,
}

impl PeerRegulator {
    /// The position that the next tick's error refers to \[mm\].
    #[must_use]
    pub fn target_mm(&self) -> f64 {
        self.command_mm
    }

    /// One servo period of `tick_s`: the velocity command \[mm/s\] within `limits_mm_s`.
    pub fn tick(
        &mut self,
        gains: &PeerGains,
        (command_mm, position_mm): (f64, f64),
        tick_s: f64,
        limits_mm_s: (f64, f64),
    ) -> f64 {
        let error_mm = self.command_mm - position_mm;
        if error_mm * self.limit <= 0.0 {
            self.sum_mm_s += error_mm * tick_s;
        }
        let first = (command_mm - self.command_mm) / tick_s;
        let second = (first - self.differences[0]) / tick_s;
        let third = (second - self.differences[1]) / tick_s;
        let error_rate = first - (position_mm - self.position_mm) / tick_s;
        self.differences = [first, second];
        (self.command_mm, self.position_mm) = (command_mm, position_mm);
        let wanted_mm_s = gains.p_per_s * error_mm
            + gains.i_per_s2 * self.sum_mm_s
            + gains.d * error_rate
            + gains.ff0_per_s * command_mm
            + gains.ff1 * first
            + gains.ff2_s * second
            + gains.ff3_s2 * third;
        let (least, greatest) = limits_mm_s;
        self.limit = f64::from(wanted_mm_s > greatest) - f64::from(wanted_mm_s < least);
        wanted_mm_s.max(least).min(greatest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 0.0005;
    const WIDE: (f64, f64) = (-1e9, 1e9);

    /// Feedforward of a sine, against the analytic one at the time of the position that is regulated to.
    #[test]
    fn exact_differences_are_analytic_feedforward_up_to_the_jerk() {
        let analytic =
            Feedforward { velocity: 1.0, accel_s: 1.7e-3, jerk_s2: 6e-5, ..Feedforward::default() };
        let gains = PeerGains::like(&analytic, TICK_S);
        assert!((gains.analytic(TICK_S).jerk_s2 - analytic.jerk_s2).abs() < 1e-18);
        for frequency_hz in [1.0, 4.0, 10.0] {
            let omega = core::f64::consts::TAU * frequency_hz;
            let mut regulator = PeerRegulator::default();
            let (mut worst, mut jerk_part) = (0.0_f64, 0.0_f64);
            for tick in 0..4000 {
                let (sine, cosine) = (omega * f64::from(tick) * TICK_S).sin_cos();
                let (sine_before, cosine_before) = (omega * f64::from(tick - 1) * TICK_S).sin_cos();
                let found = regulator.tick(&gains, (sine, 0.0), TICK_S, WIDE);
                let of_time = omega * cosine_before
                    - analytic.accel_s * omega * omega * sine_before
                    - analytic.jerk_s2 * omega.powi(3) * cosine_before;
                if tick > 4 {
                    worst = worst.max((found - of_time).abs());
                    jerk_part = jerk_part.max((analytic.jerk_s2 * omega.powi(3) * cosine).abs());
                }
            }
            // What is left is of the fourth order: T/2·FF3·s⁴, and less.
            let left = 1.5 * TICK_S * gains.ff3_s2 * omega.powi(4);
            assert!(worst < left && left < 0.1 * jerk_part, "{frequency_hz} Hz: {worst} {left} {jerk_part}");
        }
    }

    /// White noise of rms 1 through differences: the sums of squares of their coefficients are 2, 6 and 20.
    #[test]
    fn differences_magnify_rounding() {
        let mut random = 1_u64;
        for (gains, squares, order) in [
            (PeerGains { ff1: 1.0, ..PeerGains::default() }, 2.0, 1),
            (PeerGains { ff2_s: 1.0, ..PeerGains::default() }, 6.0, 2),
            (PeerGains { ff3_s2: 1.0, ..PeerGains::default() }, 20.0, 3),
        ] {
            let (mut regulator, mut sum) = (PeerRegulator::default(), 0.0);
            for _ in 0..100_000 {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let noise = ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12.0_f64.sqrt();
                let output = regulator.tick(&gains, (noise, 0.0), TICK_S, (-1e30, 1e30));
                sum += (output * TICK_S.powi(order)).powi(2);
            }
            assert!((sum / 1e5 / squares - 1.0).abs() < 0.02, "{order}: {}", sum / 1e5);
        }
    }

    #[test]
    fn the_error_refers_to_the_command_before_and_the_sum_waits_at_the_limit() {
        let gains = PeerGains { p_per_s: 10.0, i_per_s2: 1000.0, ..PeerGains::default() };
        let mut regulator = PeerRegulator::default();
        assert!(regulator.tick(&gains, (1.0, 0.0), TICK_S, WIDE).abs() < 1e-12);
        assert!((regulator.target_mm() - 1.0).abs() < 1e-12);
        assert!((regulator.tick(&gains, (1.0, 0.0), TICK_S, WIDE) - 10.5).abs() < 1e-9);
        for _ in 0..10_000 {
            assert!((regulator.tick(&gains, (1.0, 0.0), TICK_S, (-5.0, 5.0)) - 5.0).abs() < 1e-12);
        }
        assert!(regulator.tick(&gains, (1.0, 2.0), TICK_S, (-50.0, 50.0)) < 0.0);
    }
}
