//! The fit of the drive model, in stages: from a coarse grid on the steps to everything on all runs, and the
//! question whether there is a bed.
//!
//! A search ends in the nearest valley. So several are made, and the deepest end counts. Whether that is the
//! right one can be seen: a right model leaves the errors of the readings and nothing else.

use super::bed::{LEAST_RATIO, likely_beds};
use super::coarse::{coarse, sustained_accel_mm_s2};
use super::confidence::{Confidence, UnprovenBed, confidence};
use super::parameters::{ALL, Unknown, Unknowns, without_bed};
use super::readings::{Precision, Runs};
use super::recording::{AxisRecording, span};
use super::search::{Effort, Found, LAST_EFFORT, SEARCH_SCATTER, is_met, least, search};
use super::simulation::SUBSTEPS;
use super::valleys::{EXCHANGED_EFFORT, NEAR, SETTLING_EFFORT, UNDECIDED, finished, settled};
use super::{Alternatives, AxisParametersFound, BedEstimate, Estimate, IdentifyError, RunMatch};

/// Current limits that are tried over the greatest acceleration, before every stage and where the model does not follow well: above
/// what the model asks for a limit does nothing, and a search that has gone there does not come back.
const TRIED_LIMITS: [f64; 11] = [0.6, 0.7, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.3, 1.6, 3.0];

const ROUGH_EFFORT: Effort = Effort::far(Precision { substeps: 5, slack: 2e-3 }, 12);
const MIDDLE_EFFORT: Effort = Effort::far(Precision { substeps: 10, slack: 2e-4 }, 12);
/// Of each of several beds, before the best of them is followed.
const BEGUN_EFFORT: Effort = Effort { jacobians: 4, ..MIDDLE_EFFORT };
const FINE_EFFORT: Effort = Effort::far(Precision { substeps: SUBSTEPS, slack: 5e-5 }, 6);

/// Beds that are followed.
const BEDS: usize = 3;
/// Gain in misfit from which a promised bed is searched for, one that was found is finished, and another current limit is followed.
const PROMISE: f64 = 12.0;
/// Misfit for each reading from which what was found may be a false minimum: that of a right model scatters by some
/// hundredths.
pub(super) const FOLLOWED_WELL: f64 = 1.05;
/// Beds that are tried then, without the rigid model as a guide: frequencies \[Hz\], damping and mass ratio, and
/// Jacobians.
const OTHER_BEDS_HZ: [f64; 9] = [5.5, 8.0, 12.0, 17.0, 25.0, 36.0, 52.0, 75.0, 108.0];
const OTHER_BED: (f64, f64) = (0.03, 0.05);
const OTHER_JACOBIANS: usize = 3;
/// Those that are followed ...
const OTHERS: usize = 2;
/// ... of distinct frequencies: two are one if the logarithm of their ratio is below this.
const SAME_FREQUENCY: f64 = 0.2;

/// A bed must lower the misfit by what its unknowns are worth by themselves, and by 12 more: chance gives two unknowns as much in
/// one of e⁶ cases.
const BED_GAIN: f64 = 12.0;

/// Root mean square of the residuals over the travel, above which the model is none.
const MISS_MAX: f64 = 0.05;

pub(super) struct Fit {
    pub(super) parameters: AxisParametersFound,
    pub(super) alternatives: Alternatives,
    pub(super) ends: Ends,
    pub(super) runs: Vec<RunMatch>,
    pub(super) misfit_per_reading: f64,
}

/// Where a fit ended, for one with further recordings to begin from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ends {
    pub(super) found: Unknowns,
    rivals: Vec<Unknowns>,
    /// As that of a [`Model`].
    unproven: Option<Unknowns>,
}

/// Fits the model to checked recordings.
pub(super) fn fit(recordings: &[AxisRecording], resolution_mm: f64) -> Result<Fit, IdentifyError> {
    let mut search =
        Stages { runs: Runs::new(recordings, resolution_mm), accel_mm_s2: sustained_accel_mm_s2(recordings) };
    let too_late = IdentifyError::TooLate { limit_s: search.runs.lag_limit_s() };
    let starts = coarse(recordings, resolution_mm)?;
    let model = search.best(&starts).ok_or(too_late.clone())?;
    concluded(recordings, search.runs, &model).ok_or(too_late)?
}

/// Fits the model from where an earlier fit ended. `None` if it does not follow all recordings from there.
pub(super) fn refit(recordings: &[AxisRecording], resolution_mm: f64, ends: &Ends) -> Option<Fit> {
    let mut runs = Runs::new(recordings, resolution_mm);
    runs.regroup(&ends.found, SUBSTEPS);
    let stages = Stages { runs, accel_mm_s2: sustained_accel_mm_s2(recordings) };
    let model = stages.again(ends)?;
    if stages.is_followed_well(&model) { concluded(recordings, stages.runs, &model)?.ok() } else { None }
}

/// A model that was found.
struct Model {
    found: Found,
    free: &'static [Unknown],
    /// Beside a rigid model: a bed that explains more, if not so much more that it is one.
    unproven: Option<Unknowns>,
}

impl Model {
    fn with_bed(found: Found) -> Self {
        Self { found, free: &ALL, unproven: None }
    }

    fn has_bed(&self) -> bool {
        self.free.len() == ALL.len()
    }
}

struct Stages {
    runs: Runs,
    accel_mm_s2: f64,
}

impl Stages {
    fn readings(&self) -> f64 {
        self.runs.readings()
    }

    /// One stage, with a current limit that acts.
    fn stage(&self, start: Unknowns, free: &[Unknown], effort: Effort) -> Option<Found> {
        search(&self.runs, limited(&self.runs, start, self.accel_mm_s2, effort.precision), free, effort)
    }

    /// The last two stages.
    fn last(&self, start: Unknowns, free: &[Unknown]) -> Option<Found> {
        let fine = self.stage(start, free, FINE_EFFORT)?;
        search(&self.runs, fine.unknowns, free, LAST_EFFORT)
    }

    fn best(&mut self, starts: &[Unknowns]) -> Option<Model> {
        let rough = least(starts.iter().filter_map(|start| self.stage(*start, without_bed(), ROUGH_EFFORT)))?;
        self.runs.regroup(&rough.unknowns, ROUGH_EFFORT.precision.substeps);
        let middle = self.stage(rough.unknowns, without_bed(), MIDDLE_EFFORT)?;
        let is_rigid = is_met(&self.runs, &middle);
        let model = if is_rigid { self.rigid_first(&middle) } else { self.bed_first(&middle) }?;
        if self.is_followed_well(&model) {
            return Some(model);
        }
        let model = self.with_other_limit(model);
        if self.is_followed_well(&model) {
            return Some(model);
        }
        let Some(bed) = self.other_beds(starts) else { return Some(model) };
        // Readings were grouped anew.
        let before = Model { found: settled(&self.runs, &model.found, model.free)?, ..model };
        let other = match self.rigid_from(&bed) {
            Some(rigid) => self.decided(rigid, bed),
            None => finished(&self.runs, bed, &ALL).map(Model::with_bed),
        };
        Some(match other {
            Some(other) => self.better(before, other),
            None => before,
        })
    }

    fn is_followed_well(&self, model: &Model) -> bool {
        model.found.misfit() < FOLLOWED_WELL * self.readings()
    }

    /// The same with another current limit, if more is explained then. With a limit that does not act the other unknowns have taken
    /// over its effect. Another limit alone makes the misfit worse, so each one begins a search of its own.
    fn with_other_limit(&self, model: Model) -> Model {
        let with = |part: f64| {
            let mut start = model.found.unknowns;
            start.set(Unknown::AccelLimit, part * self.accel_mm_s2);
            search(&self.runs, start, model.free, EXCHANGED_EFFORT)
        };
        let best = least(TRIED_LIMITS.into_iter().filter_map(with))
            .filter(|best| best.misfit() < model.found.misfit() - PROMISE)
            .and_then(|best| search(&self.runs, best.unknowns, model.free, LAST_EFFORT))
            .and_then(|best| finished(&self.runs, best, model.free));
        match best {
            Some(found) => Model { found, ..model },
            None => model,
        }
    }

    /// From where an earlier fit ended, with readings that it was not made of. They may show a bed that the earlier ones did not, and
    /// one that those showed has to explain enough of all of them. A model of the other kind was not looked beside yet.
    fn again(&self, ends: &Ends) -> Option<Model> {
        let has_bed = ends.found.get(Unknown::BedMassRatio) > 0.0;
        let free = if has_bed { &ALL } else { without_bed() };
        let found =
            Found { rivals: ends.rivals.clone(), ..search(&self.runs, ends.found, free, LAST_EFFORT)? };
        let model = if has_bed {
            match self.rigid_from(&found) {
                Some(rigid) => self.with_or_without(rigid, Some(found)),
                None => Model::with_bed(found),
            }
        } else {
            let known = ends.unproven.and_then(|bed| search(&self.runs, bed, &ALL, LAST_EFFORT));
            let bed = self.likely_bed(&found, known);
            self.with_or_without(found, bed)
        };
        if model.has_bed() == has_bed {
            return Some(model);
        }
        Some(Model { found: finished(&self.runs, model.found, model.free)?, ..model })
    }

    /// The one that explains more; a bed has to explain enough.
    fn better(&self, one: Model, other: Model) -> Model {
        let known = one.unproven.or(other.unproven);
        let better = match (one.has_bed(), other.has_bed()) {
            (false, true) => self.with_or_without(one.found, Some(other.found)),
            (true, false) => self.with_or_without(other.found, Some(one.found)),
            _ if other.found.misfit() < one.found.misfit() => other,
            _ => one,
        };
        if better.has_bed() { better } else { Model { unproven: better.unproven.or(known), ..better } }
    }

    /// The bed if it is one; else the rigid model, beside which a bed that explains more is not proven.
    fn with_or_without(&self, rigid: Found, bed: Option<Found>) -> Model {
        let bed = match bed {
            Some(bed) if self.is_bed(&rigid, &bed) => return Model::with_bed(bed),
            bed => bed.filter(|bed| is_heavy(bed) && gain(&self.runs, &rigid, bed) > 0.0),
        };
        Model { found: rigid, free: without_bed(), unproven: bed.map(|bed| bed.unknowns) }
    }

    /// The rigid model as it is found from a bed, where it is not far worse.
    fn rigid_from(&self, bed: &Found) -> Option<Found> {
        let mut start = bed.unknowns;
        start.set(Unknown::BedMassRatio, 0.0);
        let near = search(&self.runs, start, without_bed(), EXCHANGED_EFFORT)?;
        let is_near = near.misfit() < bed.misfit() + NEAR;
        if is_near { search(&self.runs, near.unknowns, without_bed(), LAST_EFFORT) } else { None }
    }

    /// Whether the misfits tell a bed from chance.
    fn is_bed(&self, rigid: &Found, bed: &Found) -> bool {
        is_heavy(bed) && gain(&self.runs, rigid, bed) > bed_price(&self.runs) + BED_GAIN
    }

    /// Where the rigid model follows in the middle: a bed, if its remainder promises one.
    fn rigid_first(&mut self, middle: &Found) -> Option<Model> {
        self.runs.regroup(&middle.unknowns, SUBSTEPS);
        let rigid = self.last(middle.unknowns, without_bed())?;
        self.beside(rigid, None)
    }

    /// The rigid model, or a bed beside it: one that its remainder promises, or the `known` one.
    fn beside(&self, rigid: Found, known: Option<Found>) -> Option<Model> {
        let rigid = finished(&self.runs, rigid, without_bed())?;
        let bed = self.likely_bed(&rigid, known).filter(|bed| gain(&self.runs, &rigid, bed) > PROMISE);
        let bed = bed.and_then(|bed| finished(&self.runs, bed, &ALL));
        Some(self.with_or_without(rigid, bed))
    }

    /// The best of the beds that the remainder of a rigid model promises, and of a `known` one.
    fn likely_bed(&self, rigid: &Found, known: Option<Found>) -> Option<Found> {
        let starts = likely_beds(&self.runs, rigid, Precision::LAST);
        // What is promised is linear; a search may find more.
        let promising = starts.into_iter().take(BEDS).filter(|(_, gain)| *gain > PROMISE);
        let found = promising.filter_map(|(start, _)| search(&self.runs, start, &ALL, LAST_EFFORT));
        least(found.chain(known))
    }

    /// Where it does not: beds first.
    fn bed_first(&mut self, middle: &Found) -> Option<Model> {
        let starts = likely_beds(&self.runs, middle, MIDDLE_EFFORT.precision);
        let begun =
            starts.into_iter().take(BEDS).filter_map(|(start, _)| self.stage(start, &ALL, BEGUN_EFFORT));
        let bed = least(begun).and_then(|begun| search(&self.runs, begun.unknowns, &ALL, MIDDLE_EFFORT));
        let Some(bed) = bed else { return self.rigid_first(middle) };
        self.runs.regroup(&bed.unknowns, SUBSTEPS);
        let bed = self.last(bed.unknowns, &ALL)?;
        let beside = self.rigid_from(&bed);
        if is_met(&self.runs, &bed) && is_heavy(&bed) && beside.is_none() {
            // The rigid model misses it by far, wherever it starts.
            return finished(&self.runs, bed, &ALL).map(Model::with_bed);
        }
        let rigid = least([self.last(middle.unknowns, without_bed()), beside].into_iter().flatten())?;
        self.decided(rigid, bed)
    }

    /// With a bed or without. A rigid model that follows, and is not far behind, is looked beside; else the one that is far
    /// behind is not finished.
    fn decided(&self, mut rigid: Found, mut bed: Found) -> Option<Model> {
        let ahead = rigid.misfit() - bed.misfit();
        let is_met = is_met(&self.runs, &rigid);
        if is_met && ahead < UNDECIDED {
            return self.beside(rigid, Some(bed));
        }
        let (is_bed, is_near) = (self.is_bed(&rigid, &bed), ahead.abs() < NEAR);
        if !is_bed || (is_near && !is_met) {
            rigid = finished(&self.runs, rigid, without_bed())?;
        }
        if is_bed || is_near {
            bed = finished(&self.runs, bed, &ALL)?;
        }
        Some(self.with_or_without(rigid, Some(bed)))
    }

    /// Where nothing follows: beds of all frequencies, from the start.
    fn other_beds(&mut self, starts: &[Unknowns]) -> Option<Found> {
        let effort = Effort { jacobians: OTHER_JACOBIANS, ..ROUGH_EFFORT };
        let mut found: Vec<Found> = Vec::new();
        for start in starts {
            for frequency_hz in OTHER_BEDS_HZ {
                let mut start = *start;
                start.set(Unknown::BedFrequency, frequency_hz);
                start.set(Unknown::BedDamping, OTHER_BED.0);
                start.set(Unknown::BedMassRatio, OTHER_BED.1);
                found.extend(self.stage(start, &ALL, effort));
            }
        }
        found.sort_by(|a, b| a.misfit().total_cmp(&b.misfit()));
        // Neighbours end where the best ends.
        let frequency_hz = |found: &Found| found.unknowns.get(Unknown::BedFrequency);
        let mut distinct: Vec<&Found> = Vec::new();
        for found in &found {
            let is_same =
                |other: &&Found| libm::log(frequency_hz(other) / frequency_hz(found)).abs() < SAME_FREQUENCY;
            if !distinct.iter().any(is_same) {
                distinct.push(found);
            }
        }
        let followed = distinct.into_iter().take(OTHERS).filter_map(|found| {
            let rough = search(&self.runs, found.unknowns, &ALL, ROUGH_EFFORT)?;
            self.stage(rough.unknowns, &ALL, MIDDLE_EFFORT)
        });
        let middle = least(followed)?;
        self.runs.regroup(&middle.unknowns, SUBSTEPS);
        self.last(middle.unknowns, &ALL)
    }
}

/// Whether a bed moves the axis.
fn is_heavy(bed: &Found) -> bool {
    bed.unknowns.get(Unknown::BedMassRatio) > LEAST_RATIO
}

/// By how much a bed lowers the misfit, for one of each reading.
fn gain(runs: &Runs, rigid: &Found, bed: &Found) -> f64 {
    let each = (bed.misfit() / runs.readings()).max(1.0);
    (rigid.misfit() - bed.misfit()) / each
}

/// The gain that a bed's three unknowns are worth by themselves: a logarithm of the number of readings each (Schwarz).
fn bed_price(runs: &Runs) -> f64 {
    (ALL.len() - without_bed().len()) as f64 * libm::log(runs.readings())
}

/// `start` with the current limit that fits best.
fn limited(runs: &Runs, start: Unknowns, accel_mm_s2: f64, precision: Precision) -> Unknowns {
    let with = |part: f64| {
        let mut tried = start;
        tried.set(Unknown::AccelLimit, part * accel_mm_s2);
        tried
    };
    let tried: Vec<Unknowns> = [start].into_iter().chain(TRIED_LIMITS.map(with)).collect();
    let weights = runs.weights(precision);
    let judged = runs
        .residuals(&tried, precision.substeps)
        .into_iter()
        .zip(tried)
        .filter_map(|(residuals, tried)| Some((weights.misfits(&residuals?).iter().sum::<f64>(), tried)));
    judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(start, |(_, best)| best)
}

/// The end: weights by what the model follows, and intervals.
fn concluded(
    recordings: &[AxisRecording],
    mut runs: Runs,
    model: &Model,
) -> Option<Result<Fit, IdentifyError>> {
    let free = model.free;
    runs.regroup(&model.found.unknowns, SUBSTEPS);
    let mut found = settled(&runs, &model.found, free)?;
    let (misfit, readings) = (found.misfit(), runs.readings());
    let is_met = is_met(&runs, &found);
    if is_met {
        runs.rescale(&found.misfits);
        found = Found { rivals: found.rivals, ..search(&runs, found.unknowns, free, SETTLING_EFFORT)? };
    }
    let unproven = model.unproven.and_then(|bed| search(&runs, bed, &ALL, SETTLING_EFFORT));
    let unproven = unproven.map(|bed| UnprovenBed {
        unknowns: bed.unknowns,
        log_likelihood: 0.5 * (gain(&runs, &found, &bed) - bed_price(&runs)),
    });
    if let Some(simpler) = without_filter(&runs, &found, free) {
        found = simpler;
    }
    let matches = match matches(&runs, recordings, &found) {
        Ok(matches) => matches,
        Err(error) => return Some(Err(error)),
    };
    let left = if is_met { 0.0 } else { misfit - readings };
    let confidence = confidence(&mut runs, &found, free, unproven.as_ref(), left)?;
    let tick_s = recordings[0].tick_s;
    Some(Ok(Fit {
        parameters: estimates(&confidence, &found, tick_s),
        alternatives: confidence.alternatives(),
        ends: Ends { found: found.unknowns, rivals: found.rivals.clone(), unproven: model.unproven },
        runs: matches,
        misfit_per_reading: misfit / readings,
    }))
}

/// The same without a command filter, if that one unknown is not worth its logarithm of the number of readings
/// (Schwarz), and what the stairs of the current limit may give it. What has the filter stays a rival, so intervals
/// span both.
fn without_filter(runs: &Runs, found: &Found, free: &[Unknown]) -> Option<Found> {
    let others: Vec<Unknown> =
        free.iter().copied().filter(|unknown| *unknown != Unknown::FilterSpread).collect();
    let mut start = found.unknowns;
    start.set(Unknown::FilterSpread, 0.0);
    let simpler = search(runs, start, &others, SETTLING_EFFORT)?;
    let readings = runs.readings();
    let is_enough = simpler.misfit() < found.misfit() + libm::log(readings) + SEARCH_SCATTER;
    let rivals = || found.rivals.iter().copied().chain([found.unknowns]).collect();
    is_enough.then(|| Found { rivals: rivals(), ..simpler })
}

fn matches(runs: &Runs, recordings: &[AxisRecording], found: &Found) -> Result<Vec<RunMatch>, IdentifyError> {
    let mut matches = Vec::with_capacity(recordings.len());
    for (recording, error_mm_rms) in recordings.iter().zip(runs.errors_mm_rms(&found.residuals)) {
        let travel_mm = span(&recording.actual_mm);
        let resolution_mm = runs.resolution_mm();
        if !(error_mm_rms <= MISS_MAX * travel_mm + 3.0 * resolution_mm) {
            return Err(IdentifyError::UnlikeModel {
                run: matches.len() + 1,
                error_mm: error_mm_rms,
                travel_mm,
            });
        }
        matches.push(RunMatch { error_mm_rms, travel_mm });
    }
    Ok(matches)
}

fn estimates(confidence: &Confidence, found: &Found, tick_s: f64) -> AxisParametersFound {
    let of = |unknown: Unknown| confidence.estimate(|unknowns| unknowns.get(unknown));
    let bed = (found.unknowns.get(Unknown::BedMassRatio) > 0.0).then(|| BedEstimate {
        frequency_hz: of(Unknown::BedFrequency),
        damping_ratio: of(Unknown::BedDamping),
        mass_ratio: of(Unknown::BedMassRatio),
    });
    let delay_s = |unknowns: &Unknowns| {
        unknowns.dead_time_s() + unknowns.filter_s() + unknowns.current_lag_s() + 0.5 * tick_s
    };
    let unresolved_s = found.unknowns.unresolved_filter_s();
    let or_none =
        |estimate: Estimate| Estimate { half_width_95: estimate.half_width_95 + unresolved_s, ..estimate };
    AxisParametersFound {
        command_gain: of(Unknown::Gain),
        command_offset_mm_s: of(Unknown::Offset),
        velocity_gain_per_s: of(Unknown::VelocityGain),
        integral_time_s: of(Unknown::IntegralTime),
        dead_time_s: confidence.estimate(Unknowns::dead_time_s),
        command_filter_s: or_none(confidence.estimate(Unknowns::filter_s)),
        current_lag_s: confidence.estimate(Unknowns::current_lag_s),
        total_delay_s: or_none(confidence.estimate(delay_s)),
        accel_limit_mm_s2: of(Unknown::AccelLimit),
        coulomb_friction_mm_s2: of(Unknown::Coulomb),
        viscous_friction_per_s: of(Unknown::Viscous),
        load_inertia_ratio: Estimate { value: 0.0, half_width_95: f64::INFINITY },
        bed,
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{recorded, sticking};
    use super::*;

    const RESOLUTION_MM: f64 = 1e-3;

    fn stages() -> Stages {
        let run = recorded(&sticking(), vec![0.0; 4000], RESOLUTION_MM);
        Stages { runs: Runs::new(&[run], RESOLUTION_MM), accel_mm_s2: 1.0 }
    }

    fn found(mass_ratio: f64, misfit: f64) -> Found {
        let mut unknowns = sticking();
        unknowns.set(Unknown::BedMassRatio, mass_ratio);
        Found { unknowns, residuals: Vec::new(), misfits: vec![misfit], rivals: Vec::new() }
    }

    /// Three logarithms of 4000 readings are 25, and 12 more are asked for.
    #[test]
    fn a_bed_that_gains_too_little_is_not_proven() {
        let stages = stages();
        assert!((bed_price(&stages.runs) - 24.88).abs() < 0.01);
        for (mass_ratio, gain, is_bed, is_unproven) in [
            (0.05, 38.0, true, false),
            (0.05, 36.0, false, true),
            (0.05, 1.0, false, true),
            (0.05, -1.0, false, false),
            (1e-3, 38.0, false, false),
        ] {
            let model = stages.with_or_without(found(0.0, 3900.0), Some(found(mass_ratio, 3900.0 - gain)));
            assert_eq!((model.has_bed(), model.unproven.is_some()), (is_bed, is_unproven), "{gain}");
        }
    }

    /// Whichever of two rigid models is better, and whichever came first.
    #[test]
    fn a_bed_that_is_not_proven_stays_beside_another_model() {
        let stages = stages();
        let bed = || Model::with_bed(found(0.05, 3890.0));
        let rigid = |misfit: f64, bed: Option<f64>| Model {
            found: found(0.0, misfit),
            free: without_bed(),
            unproven: bed.map(|mass_ratio| found(mass_ratio, 0.0).unknowns),
        };
        for model in [
            stages.better(bed(), rigid(3900.0, None)),
            stages.better(rigid(3900.0, None), bed()),
            stages.better(rigid(3900.0, None), rigid(3910.0, Some(0.05))),
            stages.better(rigid(3910.0, Some(0.05)), rigid(3900.0, Some(0.1))),
        ] {
            assert!(!model.has_bed() && model.unproven.is_some());
            assert!((model.found.misfit() - 3900.0).abs() < 1e-9);
        }
        let proven = stages.better(rigid(3900.0, Some(0.1)), Model::with_bed(found(0.05, 3800.0)));
        assert!(proven.has_bed() && proven.unproven.is_none());
    }
}
