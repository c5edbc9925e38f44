//! The search: Levenberg and Marquardt's steps on the residuals of all runs.
//!
//! The variance of a run's residuals is unknown and differs: rounding of the encoder, and in runs that
//! saturate the sub-steps of the model. So every run is weighted by one over the variance that it had last,
//! and by how many independent readings its correlated residuals are worth, which ends where the likelihood
//! of normally distributed residuals is greatest. A Jacobian costs a dozen simulations and serves for several
//! steps while they gain.

use super::cholesky::Symmetric;
use super::confidence::correlation_factor;
use super::parameters::{Unknown, Unknowns};
use super::simulation::{Linearised, Residuals, Runs, squares};

/// The end of a search.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) unknowns: Unknowns,
    pub(super) residuals: Residuals,
    /// The last Jacobian, a few steps before the end.
    pub(super) linear: Option<Linearised>,
}

/// How a search is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) substeps: u32,
    /// Most Jacobians.
    pub(super) jacobians: usize,
    /// Whether the start is close. Far from it all residuals are correlated, and weights by that would give
    /// up runs that the model does not follow yet.
    pub(super) is_near: bool,
    /// The gain in misfit below which it ends.
    pub(super) least_gain: f64,
}

/// Steps with one Jacobian.
const STEPS_PER_JACOBIAN: usize = 6;

/// Correlation factor from which residuals are the model's and not the encoder's.
const CORRELATED: f64 = 3.0;

/// The most that correlation takes from a run during the search: one that the model does not follow yet must
/// still outweigh the last digit of the others.
const CORRELATION_MAX: f64 = 30.0;

/// Moments of a run at which the model is rough.
const MOMENTS: f64 = 4.0;

/// Error of one such moment with [`SUBSTEPS`](super::simulation::SUBSTEPS) \[mm\]: the integrator of the
/// drive stops or continues a sub-step too early or too late.
const ROUGHNESS_MM: f64 = 0.5e-3;

/// Dampings tried for one step.
const DAMPINGS: usize = 5;

/// The weight of each run's residuals: their variance, and how many independent readings they are.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    variances: Vec<f64>,
    independent: Vec<f64>,
    least_variance: f64,
    readings: Vec<f64>,
}

impl Noise {
    pub(super) fn of(runs: &Runs, residuals: &Residuals, resolution_mm: f64) -> Self {
        let readings = runs.readings();
        let independent = readings
            .iter()
            .zip(residuals)
            .map(|(n, run)| n / correlation_factor(run).min(CORRELATION_MAX))
            .collect();
        Self::with(runs, residuals, resolution_mm, independent)
    }

    /// The weights as if every reading were independent.
    pub(super) fn uncorrelated(runs: &Runs, residuals: &Residuals, resolution_mm: f64) -> Self {
        Self::with(runs, residuals, resolution_mm, runs.readings())
    }

    fn with(runs: &Runs, residuals: &Residuals, resolution_mm: f64, independent: Vec<f64>) -> Self {
        // Below what rounding alone leaves of an encoder step, a run has been met.
        let least_variance = (0.25 * resolution_mm).powi(2).max(1e-18);
        let readings = runs.readings();
        let mut noise = Self { variances: Vec::new(), independent, least_variance, readings };
        noise.variances = noise.variances_of(residuals);
        noise
    }

    fn variances_of(&self, residuals: &Residuals) -> Vec<f64> {
        let means = squares(residuals).into_iter().zip(&self.readings).map(|(sum, n)| sum / n);
        means.map(|variance| variance.max(self.least_variance)).collect()
    }

    /// Information of one reading of each run: one over its variance and its correlation.
    pub(super) fn weights(&self) -> Vec<f64> {
        let of_run = |((variance, independent), n): ((&f64, &f64), &f64)| independent / n / variance;
        self.variances.iter().zip(&self.independent).zip(&self.readings).map(of_run).collect()
    }

    /// The same for runs that the model does not quite follow, careful: what is left of them are the few
    /// errors of the moments at which they saturate or reverse, whatever their autocorrelation promises.
    pub(super) fn careful(mut self) -> Self {
        let runs = self.independent.iter_mut().zip(&mut self.variances).zip(&self.readings);
        for ((independent, variance), n) in runs {
            if *independent < n / CORRELATED {
                *independent = independent.min(MOMENTS);
                *variance = variance.max(ROUGHNESS_MM * ROUGHNESS_MM);
            }
        }
        self
    }

    /// Independent readings of all runs.
    pub(super) fn independent(&self) -> f64 {
        self.independent.iter().sum()
    }

    /// Σ n·ln(variance) over the runs, n their independent readings here: −2 × the logarithm of the
    /// likelihood, up to a constant.
    pub(super) fn misfit(&self, residuals: &Residuals) -> f64 {
        self.variances_of(residuals)
            .iter()
            .zip(&self.independent)
            .map(|(variance, n)| n * variance.ln())
            .sum()
    }
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
    let mut last_linear = None;
    for _ in 0..effort.jacobians {
        let linear = runs.linearised(&unknowns, free, effort.substeps)?;
        let mut gained = 0.0;
        for _ in 0..STEPS_PER_JACOBIAN {
            let of = if effort.is_near { Noise::of } else { Noise::uncorrelated };
            let noise = of(runs, &residuals, resolution_mm);
            let last = noise.misfit(&residuals);
            let weights = noise.weights();
            let step = Step { linear: &linear, weights: &weights, unknowns: &unknowns, lag_limit_s };
            let mut gain = 0.0;
            for _ in 0..DAMPINGS {
                let next = step.from(&residuals, damping);
                let tried = next.and_then(|next| Some((next, runs.residuals(&next, effort.substeps)?)));
                if let Some((next, tried)) = tried.filter(|(_, tried)| noise.misfit(tried) < last) {
                    gain = last - noise.misfit(&tried);
                    (unknowns, residuals) = (next, tried);
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
                damping = (damping * 10.0).min(1e6);
            }
            gained += gain;
            // A Jacobian that gains little where it was taken has done its part.
            if gain < 10.0 * effort.least_gain {
                break;
            }
        }
        last_linear = Some(linear);
        if gained < effort.least_gain {
            break;
        }
        // A refusal with an old Jacobian says nothing about a new one.
        damping = damping.min(1e-3);
    }
    Some(Found { unknowns, residuals, linear: last_linear })
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
