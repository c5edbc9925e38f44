//! Is there a bed that moves?
//!
//! A bed of small mass ratio changes the axis' response in proportion to that ratio, at frequencies that can
//! be tried one after the other. For each the part of the change that no other unknown could make is compared
//! with the residuals of the best rigid model. Searches start at the frequencies that explain most of them.
//!
//! The same tells which beds a rigid model leaves open. A light bed is lost among the errors of the readings, or the other unknowns
//! make up for it, and are wrong then. So intervals have to span what they would be beside each such bed, by its likelihood.

use super::cholesky::Symmetric;
use super::parameters::{Unknown, Unknowns, without_bed};
use super::readings::{Precision, Residuals, Runs, Weights, dot};
use super::search::{Found, damped, derivatives};

/// Frequencies that are tried, equally spaced in their logarithm \[Hz\].
const LEAST_HZ: f64 = 3.5;
const MOST_HZ: f64 = 160.0;
const TRIED: usize = 88;

/// Damping and mass ratio of the tried beds. The damping is wide enough to be seen from the neighbouring
/// frequency.
const TRIED_DAMPING: f64 = 0.03;
const TRIED_MASS_RATIO: f64 = 0.02;

/// Mass ratio below which a bed is none: it moves the axis by less than what the model leaves out.
pub(super) const LEAST_RATIO: f64 = 2e-3;
/// The greatest mass ratio of a bed that is looked for.
const MOST_RATIO: f64 = 0.3;
/// Mass ratios for which the likelihood of a bed is taken, equally spaced in their logarithm.
const RATIOS: usize = 24;

/// Added to the diagonal, as a part of it: unknowns that trade for each other are told apart by rounding only.
const DAMPING: f64 = 1e-9;

/// Beds that explain what the rigid model `found` leaves, each more than its neighbours, as starts of a search
/// with the gain in misfit that a linear estimate promises: the most promising first.
pub(super) fn likely_beds(runs: &Runs, found: &Found, precision: Precision) -> Vec<(Unknowns, f64)> {
    let (rigid, is_central) = (&found.unknowns, precision.slack == 0.0);
    let Some((columns, still)) = derivatives(runs, rigid, without_bed(), precision.substeps, is_central)
    else {
        return Vec::new();
    };
    let tried = tried_beds(runs, &runs.weights(precision), rigid, columns, &still, precision.substeps);
    let gain = |index: usize| tried.get(index).map_or(0.0, TriedBed::gain);
    let is_peak = |index: &usize| {
        let (before, own, after) = (gain(index.wrapping_sub(1)), gain(*index), gain(index + 1));
        own > 0.0 && own >= before && own >= after
    };
    let peaks = (0..tried.len()).filter(is_peak);
    let mut peaks: Vec<(Unknowns, f64)> = peaks.map(|index| (tried[index].start(), gain(index))).collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    peaks
}

/// Drives with beds that the recordings do not show, with the logarithm of how likely each is over the `rigid` one, whose
/// `columns` of derivatives and residuals are given. Before any run was seen a bed is as likely as none, and all its frequencies
/// and mass ratios are, in their logarithms.
pub(super) fn unseen_beds(
    runs: &Runs,
    weights: &Weights,
    rigid: &Unknowns,
    columns: Vec<Residuals>,
    still: &Residuals,
) -> Vec<(Unknowns, f64)> {
    let tried = tried_beds(runs, weights, rigid, columns, still, Precision::LAST.substeps);
    let ratio = |index: usize| spaced(LEAST_RATIO, MOST_RATIO, RATIOS, index);
    let log_share = -libm::log((TRIED * RATIOS) as f64);
    let of = |bed: &TriedBed, mass_ratio: f64| {
        bed.compensated(mass_ratio).map(|drive| (drive, log_share - 0.5 * bed.rise(mass_ratio)))
    };
    tried.iter().flat_map(|bed| (0..RATIOS).filter_map(move |index| of(bed, ratio(index)))).collect()
}

/// One of `count` values, equally spaced in their logarithm.
fn spaced(least: f64, most: f64, count: usize, index: usize) -> f64 {
    least * libm::pow(most / least, index as f64 / (count - 1) as f64)
}

/// A bed beside a rigid model. All that changes is in proportion to its mass ratio, over the tried one.
struct TriedBed {
    rigid: Unknowns,
    frequency_hz: f64,
    /// What the unknowns of the rigid model change by to make up for the bed as far as they can.
    compensation: Vec<f64>,
    /// Half the slope of the misfit over the mass ratio, so compensated, and half its curvature.
    slope: f64,
    curvature: f64,
}

impl TriedBed {
    /// The best mass ratio. A bed pushes back: a change of the other sign is something else.
    fn best(&self) -> f64 {
        let is_bed = self.curvature > 0.0 && self.slope < 0.0;
        if is_bed { -self.slope / self.curvature * TRIED_MASS_RATIO } else { 0.0 }
    }

    fn gain(&self) -> f64 {
        -self.rise(self.best())
    }

    /// The misfit over that of the rigid model.
    fn rise(&self, mass_ratio: f64) -> f64 {
        let part = mass_ratio / TRIED_MASS_RATIO;
        part * (2.0 * self.slope + part * self.curvature)
    }

    /// Where a search begins: the rigid model and the bed.
    fn start(&self) -> Unknowns {
        beside(&self.rigid, self.frequency_hz, self.best().clamp(1e-3, MOST_RATIO))
    }

    /// The drive with such a bed that answers most like the rigid one; `None` where it is too far for a linear estimate.
    fn compensated(&self, mass_ratio: f64) -> Option<Unknowns> {
        let part = mass_ratio / TRIED_MASS_RATIO;
        let changes =
            || without_bed().iter().zip(&self.compensation).map(|(&unknown, by)| (unknown, part * by));
        let drive = beside(&self.rigid, self.frequency_hz, mass_ratio);
        let is_near = changes().all(|(unknown, by)| by.abs() <= unknown.reach());
        is_near.then(|| changes().fold(drive, |drive, (unknown, by)| drive.shifted(unknown, by)))
    }
}

fn beside(rigid: &Unknowns, frequency_hz: f64, mass_ratio: f64) -> Unknowns {
    let mut beside = *rigid;
    beside.set(Unknown::BedFrequency, frequency_hz);
    beside.set(Unknown::BedDamping, TRIED_DAMPING);
    beside.set(Unknown::BedMassRatio, mass_ratio);
    beside
}

/// A bed of each frequency that can be simulated, with the rigid model's `columns` of derivatives and its residuals.
fn tried_beds(
    runs: &Runs,
    weights: &Weights,
    rigid: &Unknowns,
    mut columns: Vec<Residuals>,
    still: &Residuals,
    substeps: u32,
) -> Vec<TriedBed> {
    let known = columns.len();
    let frequencies_hz: Vec<f64> = (0..TRIED).map(|index| spaced(LEAST_HZ, MOST_HZ, TRIED, index)).collect();
    let sets: Vec<Unknowns> = frequencies_hz.iter().map(|hz| beside(rigid, *hz, TRIED_MASS_RATIO)).collect();
    let mut tried_hz = Vec::with_capacity(TRIED);
    for (residuals, frequency_hz) in runs.residuals(&sets, substeps).into_iter().zip(frequencies_hz) {
        let Some(mut change) = residuals else { continue };
        for (change, still) in change.iter_mut().zip(still) {
            change.iter_mut().zip(still).for_each(|(change, still)| *change -= still);
        }
        columns.push(change);
        tried_hz.push(frequency_hz);
    }
    let columns = weights.columns(&columns);
    let (all, all_gradient) = (columns.normal(), columns.gradient(still));
    let mut normal = Symmetric::zero(known);
    for row in 0..known {
        for column in 0..known {
            *normal.at_mut(row, column) = all.at(row, column);
        }
    }
    let of = |(frequency_hz, bed): (f64, usize)| {
        let gradient: Vec<f64> = (0..known).map(|row| all.at(bed, row)).collect();
        let compensation = damped(&normal, &gradient, rigid, without_bed(), DAMPING, runs.lag_limit_s())?;
        Some(TriedBed {
            rigid: *rigid,
            frequency_hz,
            slope: all_gradient[bed] + dot(&all_gradient[..known], &compensation),
            curvature: all.at(bed, bed) + dot(&gradient, &compensation),
            compensation,
        })
    };
    tried_hz.into_iter().zip(known..).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{TICK_S, recorded, sticking};
    use super::super::parameters::way;
    use super::super::search::{LAST_EFFORT, search};
    use super::super::simulation::SUBSTEPS;
    use super::*;

    const RESOLUTION_MM: f64 = 1e-3;

    /// Beside the most likely of the beds that are not shown, a search finds what was told of it: its gain, and to a third of their
    /// changes what the other unknowns are then.
    #[test]
    fn unseen_beds_are_what_searches_find() {
        let mut truth = sticking();
        truth.set(Unknown::BedFrequency, 30.0);
        truth.set(Unknown::BedDamping, 0.03);
        truth.set(Unknown::BedMassRatio, 0.004);
        let steps = |feed_mm_s: f64| -> Vec<f64> {
            (0..3000).map(|tick| if (300..1500).contains(&tick) { feed_mm_s } else { 0.0 }).collect()
        };
        let harmonic = |amplitude_mm_s: f64, hz: f64| -> Vec<f64> {
            let turn = |tick: usize| core::f64::consts::TAU * hz * TICK_S * tick as f64;
            (0..2000).map(|tick| amplitude_mm_s * libm::sin(turn(tick))).collect()
        };
        let motions = [steps(150.0), steps(10.0), harmonic(40.0, 3.0), harmonic(20.0, 18.0)];
        let recordings = motions.map(|command| recorded(&truth, command, RESOLUTION_MM));
        let mut runs = Runs::new(&recordings, RESOLUTION_MM);
        let mut start = truth;
        start.set(Unknown::BedMassRatio, 0.0);
        runs.regroup(&start, SUBSTEPS);
        let rigid = search(&runs, start, without_bed(), LAST_EFFORT).expect("an end");
        let weights = runs.weights(Precision::LAST);
        let (columns, still) =
            derivatives(&runs, &rigid.unknowns, without_bed(), SUBSTEPS, true).expect("numbers");
        let information = weights.columns(&columns).normal();
        let unseen = unseen_beds(&runs, &weights, &rigid.unknowns, columns, &still);
        let (bed, log_likelihood) = *unseen.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("a bed");
        let frequency_hz = bed.get(Unknown::BedFrequency);
        assert!((25.0..36.0).contains(&frequency_hz), "{frequency_hz} Hz");
        let told = 2.0 * (log_likelihood + libm::log((TRIED * RATIOS) as f64));
        let beside = search(&runs, bed, without_bed(), LAST_EFFORT).expect("an end");
        let gain = rigid.misfit() - beside.misfit();
        assert!((told - gain).abs() < 0.1 * gain, "told {told}, is {gain}");
        // In standard deviations, squared.
        let way = |from: &Unknowns, to: &Unknowns| information.quadratic_form(&way(without_bed(), from, to));
        let (compensated, missed) = (way(&rigid.unknowns, &bed), way(&bed, &beside.unknowns));
        assert!(compensated > 9.0 && missed < 0.1 * compensated, "{compensated} {missed}");
    }
}
