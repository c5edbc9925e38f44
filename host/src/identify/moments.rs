//! What the drive's own clock leaves.
//!
//! A drive works in steps of its own, and a few things happen from one step to the next: the current limit stops and
//! frees the integrator, a jump of the command drives the axis to its limit, friction turns round. When in a step
//! they are due is not known, so each time the axis ends up somewhere within a step's worth of the model. Each such
//! offset has a shape and a size.

use super::parameters::{Unknown, Unknowns};
use super::readings::UNIFORM;
use super::simulation::{LANES, Simulation};

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
    /// The model, the same in every lane.
    pub(super) simulation: &'run Simulation,
    pub(super) unknowns: &'run Unknowns,
    pub(super) command_mm_s: &'run [f64],
    pub(super) positions_mm: &'run [f64],
    /// Ticks in which the current limit stops or frees the integrator, or may.
    pub(super) limited: &'run [usize],
    pub(super) tick_s: f64,
}

/// What a moment leaves in the drive's state, at the start of its tick.
#[derive(Clone, Copy, Debug)]
struct Nudge {
    tick: usize,
    integral_mm_s2: f64,
    velocity_mm_s: f64,
}

impl Motion<'_> {
    /// The offsets for every tick, each of a standard deviation of 1 \[mm\].
    pub(super) fn offsets(&self) -> Vec<Vec<f64>> {
        let Self { unknowns, tick_s, .. } = *self;
        let step_s = unknowns.step_s();
        let limit_mm_s2 = unknowns.get(Unknown::AccelLimit);
        let late_ticks = (unknowns.get(Unknown::Lag) / tick_s) as usize;
        let off_s = RECURRING * UNIFORM.sqrt() * step_s;
        // A step of the integrator is Kv/Ti·h·(limit/Kv).
        let integral_mm_s2 = off_s * limit_mm_s2 / unknowns.get(Unknown::IntegralTime);
        let limited = self.limited.iter().map(|&tick| Nudge { tick, integral_mm_s2, velocity_mm_s: 0.0 });
        let turned_mm_s = off_s * TURN * unknowns.get(Unknown::Coulomb);
        let turns = self.turns().into_iter().map(|(tick, sign)| Nudge {
            tick,
            integral_mm_s2: 0.0,
            velocity_mm_s: sign * turned_mm_s,
        });
        let mut offsets = self.shared(&limited.collect::<Vec<_>>());
        offsets.extend(self.shared(&turns.collect::<Vec<_>>()));
        offsets.extend(self.jumps(late_ticks, LIMITING * limit_mm_s2 / unknowns.get(Unknown::VelocityGain)));
        offsets
    }

    /// One offset for each of the moments, or for several of them, as the model answers: an axis may stop and start again behind
    /// a moment, which no closed form tells.
    fn shared(&self, moments: &[Nudge]) -> Vec<Vec<f64>> {
        let each = moments.len().div_ceil(OFFSETS_MAX).max(1);
        let all: Vec<&[Nudge]> = moments.chunks(each).collect();
        all.chunks(LANES).flat_map(|lanes| self.answers(lanes)).collect()
    }

    /// By how much the axis is ahead behind the moments of up to [`LANES`] offsets \[mm\].
    fn answers(&self, lanes: &[&[Nudge]]) -> Vec<Vec<f64>> {
        let mut offsets = vec![Vec::with_capacity(self.positions_mm.len()); lanes.len()];
        self.simulation.run(self.command_mm_s, &mut |tick, state| {
            for (lane, (offset, nudges)) in offsets.iter_mut().zip(lanes).enumerate() {
                offset.push(state.position[lane] - self.positions_mm[tick]);
                for nudge in nudges.iter().filter(|nudge| nudge.tick == tick) {
                    state.integral[lane] += nudge.integral_mm_s2;
                    state.velocity[lane] += nudge.velocity_mm_s;
                }
            }
        });
        offsets
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
        let off_s = (TOGETHER * UNIFORM).sqrt() * self.unknowns.step_s();
        let of = |(start, end): (usize, usize)| {
            let before = self.velocity_mm_s(start.saturating_sub(1));
            let ahead = |tick: usize| {
                let until = tick.min(end.saturating_sub(1));
                if tick < start { 0.0 } else { off_s * (self.velocity_mm_s(until) - before) }
            };
            (0..ticks).map(ahead).collect()
        };
        starts.iter().copied().zip(ends).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{recorded, sticking};
    use super::super::parameters::Unknown;
    use super::super::readings::{Precision, Runs};
    use super::super::simulation::SUBSTEPS;

    /// A drive that is driven to its limit, whose axis stops between two jumps and starts again by itself: what the model of
    /// the true values leaves is explained by the drive's clock, reading by reading.
    #[test]
    fn what_the_clock_leaves_is_explained() {
        const RESOLUTION_MM: f64 = 5e-5;
        let unknowns = sticking();
        let feed = |tick: usize| match tick {
            400..1200 => 99.996,
            1600..2400 => -99.996,
            _ => 0.0,
        };
        let run = recorded(&unknowns, (0..3200).map(feed).collect(), RESOLUTION_MM);
        let mut runs = Runs::new(&[run], RESOLUTION_MM);
        runs.regroup(&unknowns, SUBSTEPS);
        let residuals = runs.residuals(&[unknowns], SUBSTEPS).remove(0).expect("numbers");
        let whitened = runs.weights(Precision::LAST).whitened(&residuals).remove(0);
        let worst = whitened.iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
        // Errors of rounding end at the root of 3 standard deviations; the rest is left to what offsets do not tell.
        assert!(worst < 3.0, "{worst} standard deviations");
        let least_mm = residuals[0].iter().copied().fold(f64::INFINITY, f64::min);
        let greatest_mm = residuals[0].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!(
            greatest_mm - least_mm > 10.0 * RESOLUTION_MM,
            "the clock left {least_mm} to {greatest_mm} mm"
        );
    }

    /// Whether a limit that is just reached stops the integrator for a step, or not at all, the model can't tell, nor can one whose
    /// limit is a little off. Without a moment there, a single run made seed 811 of docs/DRIVES.md wrong by eight half-widths.
    #[test]
    fn a_limit_that_is_just_reached_is_explained() {
        const RESOLUTION_MM: f64 = 5e-5;
        let mut unknowns = sticking();
        unknowns.set_lags(4e-5, 0.0, 1.229e-4);
        unknowns.set(Unknown::BedMassRatio, 0.0);
        let limit_mm_s = unknowns.get(Unknown::AccelLimit) / unknowns.get(Unknown::VelocityGain);
        for part in [0.98, 0.99, 0.995, 1.005, 1.01, 1.02] {
            let feed_mm_s = |tick: usize| if (400..1200).contains(&tick) { part * limit_mm_s } else { 0.0 };
            let run = recorded(&unknowns, (0..2000).map(feed_mm_s).collect(), RESOLUTION_MM);
            for off in [-0.004, 0.0, 0.004] {
                let mut runs = Runs::new(std::slice::from_ref(&run), RESOLUTION_MM);
                runs.regroup(&unknowns.shifted(Unknown::AccelLimit, off), SUBSTEPS);
                let residuals = runs.residuals(&[unknowns], SUBSTEPS).remove(0).expect("numbers");
                let whitened = runs.weights(Precision::LAST).whitened(&residuals).remove(0);
                let worst = whitened.iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
                assert!(worst < 3.0, "{part} of the limit, off by {off}: {worst} standard deviations");
                // Below the limit the drive's integrator runs on, and the model's stops for a part of a step.
                let left_mm = residuals[0].iter().fold(0.0_f64, |left, value| left.max(value.abs()));
                assert!(part > 1.0 || left_mm > 4.0 * RESOLUTION_MM, "{part}: the clock left {left_mm} mm");
            }
        }
    }
}
