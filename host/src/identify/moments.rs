//! What the drive's own clock leaves.
//!
//! A drive works in steps of its own, and a few things happen from one step to the next: the current limit stops and
//! frees the integrator, a jump of the command drives the axis to its limit, friction turns round. When in a step
//! they are due is not known, so each time the axis ends up somewhere within a step's worth of the model. Each such
//! offset has a shape and a size.

use super::parameters::{Unknown, Unknowns};
use super::readings::UNIFORM;

/// Part of the limit from which a jump of the command drives the axis to it.
const LIMITING: f64 = 0.5;

/// All jumps begin at the start of a tick, so they share one error: together they must tell no more than one of
/// them would.
const TOGETHER: f64 = 16.0;

/// Most offsets of one kind; where there are more, several that follow each other share one.
const OFFSETS_MAX: usize = 24;

/// Friction turns round by twice its size.
const TURN: f64 = 2.0;

/// In harmonic motion moments recur at the same place of a step: errors are alike, and so many tell as little as one.
const RECURRING: f64 = 4.0;

/// The motion of the model in one run.
pub(super) struct Motion<'run> {
    pub(super) command_mm_s: &'run [f64],
    pub(super) positions_mm: &'run [f64],
    /// Ticks in which the current limit stops or frees the integrator.
    pub(super) limited: &'run [usize],
    pub(super) tick_s: f64,
}

/// The velocity loop v'' + Kv·v' + Kv/Ti·v = 0 by its poles: e^(−mean·t) with cos, or cosh, of difference·t.
struct Loop {
    mean_per_s: f64,
    /// Square of half the difference of the poles; negative where they are complex.
    half_square_per_s2: f64,
    product_per_s2: f64,
}

impl Loop {
    fn new(unknowns: &Unknowns) -> Self {
        let gain_per_s = unknowns.get(Unknown::VelocityGain);
        let product_per_s2 = gain_per_s / unknowns.get(Unknown::IntegralTime);
        let mean_per_s = 0.5 * gain_per_s;
        Self { mean_per_s, half_square_per_s2: mean_per_s * mean_per_s - product_per_s2, product_per_s2 }
    }

    /// e^(−mean·t)·sinh(d·t)/d and e^(−mean·t)·cosh(d·t).
    fn at(&self, time_s: f64) -> (f64, f64) {
        let d = self.half_square_per_s2.abs().sqrt().max(1e-6);
        let decay = |rate: f64| libm::exp(rate * time_s);
        if self.half_square_per_s2 > 0.0 {
            let (slow, fast) = (decay(d - self.mean_per_s), decay(-d - self.mean_per_s));
            ((slow - fast) / (2.0 * d), 0.5 * (slow + fast))
        } else {
            let all = decay(-self.mean_per_s);
            (all * libm::sin(d * time_s) / d, all * libm::cos(d * time_s))
        }
    }

    /// Position after an impulse of velocity of 1.
    fn impulse_s(&self, time_s: f64) -> f64 {
        self.at(time_s).0
    }

    /// Position after a step of torque of 1: the integral of the above.
    fn step_s2(&self, time_s: f64) -> f64 {
        let (sine, cosine) = self.at(time_s);
        (1.0 - cosine - self.mean_per_s * sine) / self.product_per_s2
    }
}

impl Motion<'_> {
    /// The offsets for every tick \[mm\], of a standard deviation of 1 for a drive's step of 1 s.
    pub(super) fn offsets(&self, unknowns: &Unknowns) -> Vec<Vec<f64>> {
        let servo = Loop::new(unknowns);
        let limit_mm_s2 = unknowns.get(Unknown::AccelLimit);
        let late_ticks = (unknowns.get(Unknown::Lag) / self.tick_s) as usize;
        // A step of the integrator is Kv/Ti·h·(limit/Kv).
        let torque_mm_s3 = RECURRING * UNIFORM.sqrt() * limit_mm_s2 / unknowns.get(Unknown::IntegralTime);
        let limited: Vec<(usize, f64)> = self.limited.iter().map(|&tick| (tick, 1.0)).collect();
        let mut offsets = self.shared(&limited, &|time_s| torque_mm_s3 * servo.step_s2(time_s));
        let turned_mm_s2 = RECURRING * UNIFORM.sqrt() * TURN * unknowns.get(Unknown::Coulomb);
        offsets.extend(self.shared(&self.turns(), &|time_s| turned_mm_s2 * servo.impulse_s(time_s)));
        offsets.extend(self.jumps(late_ticks, LIMITING * limit_mm_s2 / unknowns.get(Unknown::VelocityGain)));
        offsets
    }

    /// One offset for each of the moments with their signs, or for several of them.
    fn shared(&self, moments: &[(usize, f64)], shape: &dyn Fn(f64) -> f64) -> Vec<Vec<f64>> {
        let ticks = self.positions_mm.len();
        let shape: Vec<f64> = (0..ticks).map(|tick| shape(tick as f64 * self.tick_s)).collect();
        let each = moments.len().div_ceil(OFFSETS_MAX).max(1);
        let of = |moments: &[(usize, f64)]| {
            let mut offset = vec![0.0; ticks];
            for &(start, sign) in moments {
                offset[start..].iter_mut().zip(&shape).for_each(|(offset, shape)| *offset += sign * shape);
            }
            offset
        };
        moments.chunks(each).map(of).collect()
    }

    fn velocity_mm_s(&self, tick: usize) -> f64 {
        let positions = self.positions_mm;
        let tick = tick.min(positions.len().saturating_sub(2));
        positions.get(tick + 1).map_or(0.0, |next| (next - positions[tick]) / self.tick_s)
    }

    /// Ticks in which the direction changes, with the sign of the new one.
    fn turns(&self) -> Vec<(usize, f64)> {
        let mut turns = Vec::new();
        let mut sign = 0.0;
        for (tick, pair) in self.positions_mm.windows(2).enumerate() {
            let moved = pair[1] - pair[0];
            if moved != 0.0 && moved.signum() != sign {
                if sign != 0.0 {
                    turns.push((tick, moved.signum()));
                }
                sign = moved.signum();
            }
        }
        turns
    }

    /// How far the axis would be ahead if it had begun to push earlier at a jump of the command of at least
    /// `least_mm_s`.
    fn jumps(&self, late_ticks: usize, least_mm_s: f64) -> Vec<Vec<f64>> {
        let (command, ticks) = (self.command_mm_s, self.positions_mm.len());
        let starts: Vec<usize> = (1..ticks)
            .filter(|&tick| (command[tick] - command[tick - 1]).abs() > least_mm_s)
            .map(|tick| (tick + late_ticks).min(ticks))
            .collect();
        // Where every tick jumps, nothing is to be told apart.
        if starts.len() > OFFSETS_MAX {
            return Vec::new();
        }
        let ends = starts.iter().copied().skip(1).chain([ticks]);
        let size = (TOGETHER * UNIFORM).sqrt();
        let of = |(start, end): (usize, usize)| {
            let before = self.velocity_mm_s(start.saturating_sub(1));
            let ahead = |tick: usize| {
                let until = tick.min(end.saturating_sub(1));
                if tick < start { 0.0 } else { size * (self.velocity_mm_s(until) - before) }
            };
            (0..ticks).map(ahead).collect()
        };
        starts.iter().copied().zip(ends).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The closed forms against Euler's steps, with real and with complex poles.
    #[test]
    fn the_loop_answers_as_its_equation() {
        for (gain_per_s, integral_time_s) in [(100.0, 0.2), (100.0, 0.02)] {
            let mut unknowns = Unknowns::zero(2.5e-5);
            unknowns.set(Unknown::VelocityGain, gain_per_s);
            unknowns.set(Unknown::IntegralTime, integral_time_s);
            let servo = Loop::new(&unknowns);
            for (velocity, torque) in [(1.0, 0.0), (0.0, 1.0)] {
                let (mut x, mut v, mut sum) = (0.0, velocity, 0.0);
                let h = 1e-6;
                for step in 0..100_000 {
                    let time_s = f64::from(step) * h;
                    let expected =
                        if velocity > 0.0 { servo.impulse_s(time_s) } else { servo.step_s2(time_s) };
                    assert!((x - expected).abs() < 2e-6, "{time_s} s: {x}, {expected}");
                    let accel = torque - gain_per_s * v - gain_per_s / integral_time_s * sum;
                    sum += h * v;
                    x += h * v;
                    v += h * accel;
                }
            }
        }
    }
}
