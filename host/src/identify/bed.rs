//! Is there a bed that moves?
//!
//! A bed of small mass ratio changes the axis' response in proportion to that ratio, at frequencies that can
//! be tried one after the other. For each the part of the change that no other unknown could make is compared
//! with the residuals of the best rigid model. The search starts at the frequency that explains most of them.

use super::parameters::{Unknown, Unknowns, without_bed};
use super::search::{Found, Noise};
use super::simulation::{Residuals, Runs, dot};

/// Frequencies that are tried, equally spaced in their logarithm \[Hz\].
const LEAST_HZ: f64 = 4.0;
const MOST_HZ: f64 = 60.0;
const TRIED: usize = 28;

/// Damping and mass ratio of the tried beds. The damping is wide enough to be seen from the neighbouring
/// frequency.
const TRIED_DAMPING: f64 = 0.05;
const TRIED_MASS_RATIO: f64 = 0.02;

/// The bed that explains most of what the rigid model `found` leaves, as a start of a search, with the gain
/// in misfit that a linear estimate promises.
pub(super) fn likeliest_bed(
    runs: &Runs,
    resolution_mm: f64,
    found: &Found,
    substeps: u32,
) -> Option<(Unknowns, f64)> {
    let linear = runs.linearised(&found.unknowns, without_bed(), substeps)?;
    let weights = Noise::uncorrelated(runs, &found.residuals, resolution_mm).weights();
    let mut normal = linear.normal(&weights);
    for index in 0..linear.free.len() {
        *normal.at_mut(index, index) *= 1.0 + 1e-9;
    }
    let weighted = |left: &Residuals, right: &Residuals| -> f64 {
        left.iter().zip(right).zip(&weights).map(|((left, right), weight)| weight * dot(left, right)).sum()
    };
    let residual_gradient = linear.gradient(&found.residuals, &weights);
    let residual_share = normal.solve(&residual_gradient)?;

    let mut best: Option<(Unknowns, f64)> = None;
    for index in 0..TRIED {
        let share = index as f64 / (TRIED - 1) as f64;
        let mut tried = found.unknowns;
        tried.set(Unknown::BedFrequency, LEAST_HZ * (MOST_HZ / LEAST_HZ).powf(share));
        tried.set(Unknown::BedDamping, TRIED_DAMPING);
        tried.set(Unknown::BedMassRatio, TRIED_MASS_RATIO);
        let mut change = runs.residuals(&tried, substeps)?;
        for (change, still) in change.iter_mut().zip(&found.residuals) {
            change.iter_mut().zip(still).for_each(|(change, still)| *change -= still);
        }
        // Both orthogonal to the columns of the Jacobian: aᵀ(1 − J(JᵀJ)⁻¹Jᵀ)b.
        let gradient = linear.gradient(&change, &weights);
        let own_share = normal.solve(&gradient)?;
        let power = weighted(&change, &change) - dot(&gradient, &own_share);
        let common = weighted(&change, &found.residuals) - dot(&gradient, &residual_share);
        // A bed pushes back: a change of the other sign is something else.
        if power > 0.0 && common < 0.0 {
            let gain = common * common / power;
            if best.as_ref().is_none_or(|(_, most)| gain > *most) {
                let ratio = (-common / power * TRIED_MASS_RATIO).clamp(1e-4, 0.5);
                tried.set(Unknown::BedMassRatio, ratio);
                best = Some((tried, gain));
            }
        }
    }
    best
}
