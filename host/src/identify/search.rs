//! The search: Levenberg and Marquardt's steps on the residuals of all runs.
//!
//! Four dampings are tried at once, because four simulations cost little more than one. The variance of the
//! readings is known, so the sum of weighted squares says how good a model is by itself: one for every reading
//! is all that a right model leaves. A run that the model does not follow counts for less, by that much.

use super::cholesky::Symmetric;
use super::estimate::MET;
use super::parameters::{Unknown, Unknowns};
use super::readings::{Precision, Residuals, Runs};
use super::simulation::LANES;

/// The end of a search.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) unknowns: Unknowns,
    pub(super) residuals: Residuals,
    /// The weighted squares of each run, of the weights as they were at the end.
    pub(super) misfits: Vec<f64>,
    /// Ends of other searches that are hardly worse, as far as it is known.
    pub(super) rivals: Vec<Unknowns>,
}

impl Found {
    pub(super) fn misfit(&self) -> f64 {
        self.misfits.iter().sum()
    }
}

/// How a search is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) precision: Precision,
    /// Most Jacobians.
    pub(super) jacobians: usize,
    /// The gain in misfit below which it ends.
    pub(super) least_gain: f64,
    pub(super) differences: Differences,
}

/// What derivatives are made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Differences {
    /// From one side: half of the simulations.
    OneSided,
    /// From one side until a Jacobian gains less than [`NEAR_GAIN`], then from both.
    CentralAtEnd,
    /// From both sides.
    Central,
}

impl Effort {
    /// Far from the end.
    pub(super) const fn far(precision: Precision, jacobians: usize) -> Self {
        Self { precision, jacobians, least_gain: 1.0, differences: Differences::OneSided }
    }
}

/// That of the last stage.
pub(super) const LAST_EFFORT: Effort = Effort {
    precision: Precision::LAST,
    jacobians: 25,
    least_gain: 0.02,
    differences: Differences::CentralAtEnd,
};

/// The gain in misfit of a Jacobian from which the end is far, and derivatives need not be exact.
const NEAR_GAIN: f64 = 10.0;

/// Two searches for one minimum end this far apart in misfit: positions are low stairs where the limit acts, and a long floor is
/// rough.
pub(super) const SEARCH_SCATTER: f64 = 10.0;

/// The one with the least misfit.
pub(super) fn least(found: impl Iterator<Item = Found>) -> Option<Found> {
    found.min_by(|a, b| a.misfit().total_cmp(&b.misfit()))
}

/// Whether what was found explains the recordings.
pub(super) fn is_met(runs: &Runs, found: &Found) -> bool {
    found.misfit() < MET * runs.readings()
}

/// Dampings that are tried at once, over the last that was good.
const DAMPINGS: [f64; LANES] = [0.01, 1.0, 30.0, 1e3];
/// A search also ends where it gains less than this part of the misfit beyond what readings leave: far from them the last digits
/// tell nothing.
const LEAST_PART: f64 = 1e-4;
/// Steps with one Jacobian ...
const STEPS_PER_JACOBIAN: usize = 5;
/// ... while each gains this part of the misfit.
const SAME_JACOBIAN: f64 = 2e-3;

/// The model's derivatives about `unknowns`, as residuals by free unknown, and the residuals there. Those that are not central
/// take half of the simulations.
pub(super) fn derivatives(
    runs: &Runs,
    unknowns: &Unknowns,
    free: &[Unknown],
    substeps: u32,
    is_central: bool,
) -> Option<(Vec<Residuals>, Residuals)> {
    let lag_limit_s = runs.lag_limit_s();
    let neighbour = |unknown: Unknown, step: f64| {
        // Not across a bound.
        let is_held = unknowns.is_held(unknown, step, lag_limit_s);
        let moved = if is_held { *unknowns } else { unknowns.shifted(unknown, step) };
        moved.bounded(&[unknown], lag_limit_s)
    };
    let pair = |unknown: Unknown| {
        let step = unknown.difference();
        let [up, down] = [step, -step].map(|step| neighbour(unknown, step));
        let off = |other: &Unknowns| unknown.distance(unknowns, other).abs();
        match is_central {
            true => [up, down],
            // A bound may be near.
            false if off(&down) > 2.0 * off(&up) => [down, *unknowns],
            false => [up, *unknowns],
        }
    };
    let pairs: Vec<[Unknowns; 2]> = free.iter().map(|unknown| pair(*unknown)).collect();
    // Each set once.
    let others = pairs.iter().flatten().filter(|set| *set != unknowns);
    let sets: Vec<Unknowns> = [*unknowns].into_iter().chain(others.copied()).collect();
    let mut all = runs.residuals(&sets, substeps).into_iter();
    let still = all.next()??;
    let mut columns = Vec::with_capacity(free.len());
    for (&unknown, pair) in free.iter().zip(&pairs) {
        let span = unknown.distance(&pair[1], &pair[0]);
        let per_unit = if span.abs() > 0.0 { span.recip() } else { 0.0 };
        let mut of = |set: &Unknowns| if set == unknowns { Some(still.clone()) } else { all.next()? };
        let (mut column, less) = (of(&pair[0])?, of(&pair[1])?);
        for (column, less) in column.iter_mut().zip(&less) {
            column.iter_mut().zip(less).for_each(|(more, less)| *more = (*more - less) * per_unit);
        }
        columns.push(column);
    }
    Some((columns, still))
}

/// Searches from `start` over the `free` unknowns; `None` if the start can't be simulated.
pub(super) fn search(runs: &Runs, start: Unknowns, free: &[Unknown], effort: Effort) -> Option<Found> {
    search_unless(runs, start, free, effort, |_| false)
}

/// The same; `None`, too, as soon as `is_vain` holds for the place that a Jacobian led to.
pub(super) fn search_unless(
    runs: &Runs,
    start: Unknowns,
    free: &[Unknown],
    effort: Effort,
    is_vain: impl Fn(&Found) -> bool,
) -> Option<Found> {
    let Effort { precision, jacobians, least_gain, differences } = effort;
    let mut is_central = differences == Differences::Central;
    let weights = runs.weights(precision);
    let (readings, lag_limit_s) = (runs.readings(), runs.lag_limit_s());
    let mut damping = 1e-3;
    let mut found: Option<Found> = None;
    for _ in 0..jacobians {
        let unknowns = found.as_ref().map_or(start, |found| found.unknowns);
        let (columns, residuals) = derivatives(runs, &unknowns, free, precision.substeps, is_central)?;
        let columns = weights.columns(&columns);
        let normal = columns.normal();
        let misfits = weights.misfits(&residuals);
        let mut best = Found { unknowns, residuals, misfits, rivals: Vec::new() };
        let first = best.misfit();
        for round in 0..STEPS_PER_JACOBIAN {
            let before = best.misfit();
            let gradient = columns.gradient(&best.residuals);
            let dampings = DAMPINGS.map(|factor| (damping * factor).clamp(1e-9, 1e9));
            let from = best.unknowns;
            let tried: Vec<Unknowns> = dampings
                .iter()
                .map(|damping| {
                    let steps = damped(&normal, &gradient, &from, free, *damping, lag_limit_s);
                    steps.map_or(from, |steps| from.moved(free, &steps, lag_limit_s))
                })
                .collect();
            let results = runs.residuals(&tried, precision.substeps);
            for ((unknowns, residuals), tried_damping) in tried.into_iter().zip(results).zip(dampings) {
                let Some(residuals) = residuals else { continue };
                let misfits = weights.misfits(&residuals);
                if misfits.iter().sum::<f64>() < best.misfit() {
                    best = Found { unknowns, residuals, misfits, rivals: Vec::new() };
                    damping = tried_damping;
                }
            }
            let gain = before - best.misfit();
            if gain <= 0.0 {
                damping = (damping * 1e3).min(1e3);
            }
            // The first refusal of a Jacobian may be one of too long steps; later ones ask for a new Jacobian.
            if gain < SAME_JACOBIAN * before && (round > 0 || gain > 0.0) {
                break;
            }
        }
        let gain = first - best.misfit();
        if is_vain(&best) {
            return None;
        }
        let least_gain = least_gain.max(LEAST_PART * (best.misfit() - readings));
        found = Some(best);
        if differences == Differences::CentralAtEnd && !is_central {
            is_central = !(gain > NEAR_GAIN.max(least_gain));
        } else if !(gain > least_gain) {
            break;
        }
        damping = damping.clamp(1e-8, 1.0);
    }
    found
}

/// −(JᵀJ + damping·diag)⁻¹·Jᵀr; 0 for unknowns that nothing shows, and for those at a bound that they would cross.
pub(super) fn damped(
    normal: &Symmetric,
    gradient: &[f64],
    unknowns: &Unknowns,
    free: &[Unknown],
    damping: f64,
    lag_limit_s: f64,
) -> Option<Vec<f64>> {
    let mut is_moved: Vec<bool> = (0..free.len()).map(|index| normal.at(index, index) > 0.0).collect();
    for _ in 0..free.len() {
        let steps = solve_for(normal, gradient, &is_moved, damping)?;
        let crossing = (0..free.len())
            .find(|&index| is_moved[index] && unknowns.is_held(free[index], steps[index], lag_limit_s));
        match crossing {
            Some(index) => is_moved[index] = false,
            None => return Some(steps),
        }
    }
    None
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

#[cfg(test)]
mod tests {
    use super::super::fixtures::{harmonic, sticking};
    use super::super::parameters::ALL;
    use super::super::simulation::SUBSTEPS;
    use super::*;

    fn squares(residuals: &Residuals) -> f64 {
        residuals.iter().flatten().map(|value| value * value).sum()
    }

    /// One motion leaves much open: with differences from one side alone a search ends 1.3 too early.
    #[test]
    fn a_search_ends_where_central_differences_end() {
        let runs = harmonic();
        let start = sticking().shifted(Unknown::VelocityGain, 0.02).shifted(Unknown::Coulomb, 10.0);
        let end =
            |differences| search(&runs, start, &ALL, Effort { differences, ..LAST_EFFORT }).expect("an end");
        let (end, central) = (end(Differences::CentralAtEnd), end(Differences::Central));
        assert!((end.misfit() - central.misfit()).abs() < 0.5, "{} {}", end.misfit(), central.misfit());
        assert!(end.misfit() < MET * runs.readings(), "{} of {}", end.misfit(), runs.readings());
    }

    /// Just below a bound there is no room for a whole step up.
    #[test]
    fn one_sided_differences_keep_away_from_bounds() {
        let runs = harmonic();
        let lag_limit_s = runs.lag_limit_s();
        let mut near = sticking();
        near.set(Unknown::Lag, lag_limit_s - 1e-8 * Unknown::Lag.difference());
        let column = |is_central: bool| {
            let (columns, _) =
                derivatives(&runs, &near, &[Unknown::Lag], SUBSTEPS, is_central).expect("numbers");
            columns.into_iter().next().expect("a column")
        };
        let (mut difference, central) = (column(false), column(true));
        for (one, other) in difference.iter_mut().flatten().zip(central.iter().flatten()) {
            *one -= other;
        }
        let part = (squares(&difference) / squares(&central)).sqrt();
        // 8e-3 towards the bound.
        assert!(part < 1e-6, "{part}");
    }
}
