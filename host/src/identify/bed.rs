//! Is there a bed that moves?
//!
//! A bed of small mass ratio changes the axis' response in proportion to that ratio, at frequencies that can
//! be tried one after the other. For each the part of the change that no other unknown could make is compared
//! with the residuals of the best rigid model. Searches start at the frequencies that explain most of them.

use super::parameters::{Unknown, Unknowns, without_bed};
use super::readings::{Precision, Residuals, Runs, dot};
use super::search::{Found, derivatives};

/// Frequencies that are tried, equally spaced in their logarithm \[Hz\].
const LEAST_HZ: f64 = 3.5;
const MOST_HZ: f64 = 160.0;
const TRIED: usize = 88;

/// Damping and mass ratio of the tried beds. The damping is wide enough to be seen from the neighbouring
/// frequency.
const TRIED_DAMPING: f64 = 0.03;
const TRIED_MASS_RATIO: f64 = 0.02;

/// Beds that explain what the rigid model `found` leaves, each more than its neighbours, as starts of a search
/// with the gain in misfit that a linear estimate promises: the most promising first.
pub(super) fn likely_beds(runs: &Runs, found: &Found, precision: Precision) -> Vec<(Unknowns, f64)> {
    likely(runs, found, precision).unwrap_or_default()
}

fn likely(runs: &Runs, found: &Found, precision: Precision) -> Option<Vec<(Unknowns, f64)>> {
    let (mut columns, still) =
        derivatives(runs, &found.unknowns, without_bed(), precision.substeps, precision.slack == 0.0)?;
    let tried: Vec<Unknowns> = (0..TRIED)
        .map(|index| {
            let share = index as f64 / (TRIED - 1) as f64;
            let mut tried = found.unknowns;
            tried.set(Unknown::BedFrequency, LEAST_HZ * libm::pow(MOST_HZ / LEAST_HZ, share));
            tried.set(Unknown::BedDamping, TRIED_DAMPING);
            tried.set(Unknown::BedMassRatio, TRIED_MASS_RATIO);
            tried
        })
        .collect();
    let known = columns.len();
    for change in runs.residuals(&tried, precision.substeps) {
        let mut change: Residuals = change?;
        for (change, still) in change.iter_mut().zip(&still) {
            change.iter_mut().zip(still).for_each(|(change, still)| *change -= still);
        }
        columns.push(change);
    }
    let sums = runs.weights(precision).sums(&columns, &still);
    let mut normal = super::cholesky::Symmetric::zero(known);
    for row in 0..known {
        for column in 0..known {
            *normal.at_mut(row, column) = sums.normal.at(row, column);
        }
        *normal.at_mut(row, row) *= 1.0 + 1e-9;
    }
    let residual_share = normal.solve(&sums.gradient[..known])?;
    let mut gains = Vec::with_capacity(TRIED);
    for index in 0..TRIED {
        // Both orthogonal to the columns of the Jacobian: aᵀ(1 − J(JᵀJ)⁻¹Jᵀ)b.
        let change = known + index;
        let gradient: Vec<f64> = (0..known).map(|row| sums.normal.at(change, row)).collect();
        let own_share = normal.solve(&gradient)?;
        let power = sums.normal.at(change, change) - dot(&gradient, &own_share);
        let common = sums.gradient[change] - dot(&gradient, &residual_share);
        // A bed pushes back: a change of the other sign is something else.
        let is_bed = power > 0.0 && common < 0.0;
        gains.push(if is_bed { (common * common / power, -common / power) } else { (0.0, 0.0) });
    }
    let mut peaks: Vec<(Unknowns, f64)> = (0..TRIED)
        .filter(|&index| {
            let of = |index: usize| gains.get(index).map_or(0.0, |gain| gain.0);
            let (gain, before, after) = (of(index), of(index.wrapping_sub(1)), of(index + 1));
            gain > 0.0 && gain >= before && gain >= after
        })
        .map(|index| {
            let mut start = tried[index];
            let ratio = (gains[index].1 * TRIED_MASS_RATIO).clamp(1e-3, 0.3);
            start.set(Unknown::BedMassRatio, ratio);
            (start, gains[index].0)
        })
        .collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    Some(peaks)
}
