//! The search: Levenberg and Marquardt's steps on the residuals of all runs.
//!
//! The variance of a run's residuals is unknown and differs: rounding of the encoder, and in runs that saturate the
//! sub-steps of the model. So every run is weighted by one over the variance that it had last, which ends where the
//! likelihood of normally distributed residuals is greatest. A Jacobian costs a dozen simulations and serves for
//! several steps while they gain.

use super::cholesky::Symmetric;
use super::parameters::{Unknown, Unknowns};
use super::simulation::{Linearised, Residuals, Runs, squares};

/// Where a search ended.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) unknowns: Unknowns,
    pub(super) residuals: Residuals,
    /// Σ n·ln(variance) over the runs: −2 × the logarithm of the likelihood, up to a constant.
    pub(super) misfit: f64,
}

/// How a search is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) substeps: u32,
    /// Most Jacobians.
    pub(super) jacobians: usize,
    /// The gain in misfit below which it ends.
    pub(super) least_gain: f64,
}

/// Steps with one Jacobian.
const STEPS_PER_JACOBIAN: usize = 6;

/// Dampings tried for one step.
const DAMPINGS: usize = 5;

/// Variances of the runs, none below what rounding alone leaves of an encoder step.
pub(super) fn variances(runs: &Runs, residuals: &Residuals, resolution_mm: f64) -> Vec<f64> {
    let least = (0.25 * resolution_mm).powi(2).max(1e-18);
    squares(residuals).iter().zip(runs.readings()).map(|(sum, n)| (sum / n).max(least)).collect()
}

pub(super) fn misfit(runs: &Runs, residuals: &Residuals, resolution_mm: f64) -> f64 {
    let variances = variances(runs, residuals, resolution_mm);
    variances.iter().zip(runs.readings()).map(|(variance, n)| n * variance.ln()).sum()
}

/// Searches from `start` over the `free` unknowns; `None` if the start can't be simulated.
pub(super) fn search(
    runs: &Runs,
    resolution_mm: f64,
    start: Unknowns,
    free: &[Unknown],
    effort: Effort,
) -> Option<Found> {
    let lag_limit_s = runs.lag_limit_s();
    let mut unknowns = start;
    let mut damping = 1e-3;
    let mut residuals = runs.residuals(&unknowns, effort.substeps)?;
    let mut last = misfit(runs, &residuals, resolution_mm);
    for _ in 0..effort.jacobians {
        let linear = runs.linearised(&unknowns, free, effort.substeps)?;
        let before = last;
        for _ in 0..STEPS_PER_JACOBIAN {
            let weights: Vec<f64> =
                variances(runs, &residuals, resolution_mm).iter().map(|variance| variance.recip()).collect();
            let step = Step { linear: &linear, weights: &weights, unknowns: &unknowns, lag_limit_s };
            let mut gained = None;
            for _ in 0..DAMPINGS {
                let next = step.from(&residuals, damping);
                let tried = next.and_then(|next| Some((next, runs.residuals(&next, effort.substeps)?)));
                let better = tried
                    .map(|(next, tried)| (misfit(runs, &tried, resolution_mm), next, tried))
                    .filter(|(misfit, ..)| *misfit < last);
                if let Some((misfit, next, tried)) = better {
                    gained = Some(last - misfit);
                    (unknowns, residuals, last) = (next, tried, misfit);
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping = (damping * 10.0).min(1e6);
            }
            // A Jacobian that gains little where it was taken has done its part.
            if gained.is_none_or(|gain| gain < 10.0 * effort.least_gain) {
                break;
            }
        }
        if before - last < effort.least_gain {
            break;
        }
        // One refusal with an old Jacobian says nothing about a new one.
        damping = damping.min(1e-2);
    }
    Some(Found { unknowns, residuals, misfit: last })
}

struct Step<'a> {
    linear: &'a Linearised,
    weights: &'a [f64],
    unknowns: &'a Unknowns,
    lag_limit_s: f64,
}

impl Step<'_> {
    /// The unknowns after a damped step; those at a bound that it would cross stay there.
    fn from(&self, residuals: &Residuals, damping: f64) -> Option<Unknowns> {
        let normal = self.linear.normal(self.weights);
        let gradient = self.linear.gradient(residuals, self.weights);
        let free = &self.linear.free;
        let mut is_moved: Vec<bool> = (0..free.len()).map(|index| normal.at(index, index) > 0.0).collect();
        for _ in 0..free.len() {
            let steps = solve_for(&normal, &gradient, &is_moved, damping)?;
            let crossing = (0..free.len()).find(|&index| {
                is_moved[index] && self.unknowns.is_held(free[index], steps[index], self.lag_limit_s)
            });
            match crossing {
                Some(index) => is_moved[index] = false,
                None => return Some(self.unknowns.moved(free, &steps, self.lag_limit_s)),
            }
        }
        None
    }
}

/// −(JᵀJ + damping·diag)⁻¹·Jᵀr over the moved unknowns, 0 for the others.
fn solve_for(normal: &Symmetric, gradient: &[f64], is_moved: &[bool], damping: f64) -> Option<Vec<f64>> {
    let moved: Vec<usize> = (0..is_moved.len()).filter(|&index| is_moved[index]).collect();
    // Scaled to a diagonal of 1: the unknowns differ by many orders of magnitude.
    let scale = |index: usize| normal.at(index, index).sqrt().recip();
    let mut system = Symmetric::zero(moved.len());
    let mut right = vec![0.0; moved.len()];
    for (row, &i) in moved.iter().enumerate() {
        for (column, &j) in moved.iter().enumerate() {
            *system.at_mut(row, column) = normal.at(i, j) * scale(i) * scale(j);
        }
        *system.at_mut(row, row) += damping;
        right[row] = -gradient[i] * scale(i);
    }
    let mut steps = vec![0.0; is_moved.len()];
    for (&index, step) in moved.iter().zip(system.solve(&right)?) {
        steps[index] = step * scale(index);
    }
    Some(steps)
}
