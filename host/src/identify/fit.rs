//! The fit of the drive model, in stages: from a coarse grid on the steps to everything on all runs, and the
//! question whether there is a bed.

use super::confidence::covariance;
use super::differences::Parabolas;
use super::parameters::{ALL, COUNT, Unknown, Unknowns, without_bed};
use super::recording::{AxisRecording, span};
use super::search::{Effort, Found, Noise, search};
use super::simulation::{Residuals, Runs, SUBSTEPS, dot};
use super::{AxisParametersFound, BedEstimate, Estimate, IdentifyError, RunMatch};

/// Starts of the grid: velocity gain \[1/s\], integral time \[s\], lag \[ticks\] ...
const GAINS_PER_S: [f64; 5] = [60.0, 150.0, 300.0, 600.0, 1200.0];
const INTEGRAL_TIMES_S: [f64; 3] = [0.008, 0.025, 0.08];
const LAGS_TICKS: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// ... and current limit over the greatest acceleration, in which friction and bed may have helped.
const LIMITS: [f64; 2] = [0.8, 1.02];

/// Starts that are followed.
const STARTS: usize = 3;

/// Unknowns of the first stage.
const COARSE: [Unknown; 6] = [
    Unknown::Gain,
    Unknown::VelocityGain,
    Unknown::IntegralTime,
    Unknown::Lag,
    Unknown::AccelLimit,
    Unknown::Coulomb,
];

const COARSE_EFFORT: Effort = Effort { substeps: 5, jacobians: 5, is_near: false, least_gain: 20.0 };
const MIDDLE_EFFORT: Effort =
    Effort { substeps: SUBSTEPS / 2, jacobians: 12, is_near: false, least_gain: 100.0 };
const LAST_EFFORT: Effort = Effort { substeps: SUBSTEPS, jacobians: 5, is_near: true, least_gain: 2.0 };

/// A bed must raise the likelihood as much as chance does in one of e³⁰ cases, ...
const BED_GAIN: f64 = 60.0;
/// ... explain a share of all residuals that the model's own roughness can't, ...
const BED_GAIN_PER_READING: f64 = 0.02;
/// ... and have a mass ratio of this many standard deviations.
const BED_DEVIATIONS: f64 = 4.0;

/// Gain in misfit for each reading from which a bed needs no comparison at full effort: it halves the errors,
/// more than coarser sub-steps can.
const OBVIOUS: f64 = 1.4;

/// Root mean square of the residuals over the travel, above which the model is none.
const MISS_MAX: f64 = 0.05;

pub(super) struct Fit {
    pub(super) parameters: AxisParametersFound,
    pub(super) runs: Vec<RunMatch>,
}

/// Fits the model to checked recordings.
pub(super) fn fit(recordings: &[AxisRecording], resolution_mm: f64) -> Result<Fit, IdentifyError> {
    let runs = Runs::new(recordings);
    let too_late = IdentifyError::TooLate { limit_s: runs.lag_limit_s() };
    let start = coarse(recordings, resolution_mm)?.ok_or(too_late.clone())?;

    let rigid = search(&runs, resolution_mm, start, without_bed(), MIDDLE_EFFORT).ok_or(too_late.clone())?;
    let suspected = likeliest(&runs, resolution_mm, &rigid)
        .and_then(|bed| search(&runs, resolution_mm, bed, &ALL, MIDDLE_EFFORT));
    let is_obvious =
        suspected.as_ref().is_some_and(|bed| gain_per_reading(&runs, resolution_mm, &rigid, bed) > OBVIOUS);
    let with_bed = suspected.and_then(|bed| search(&runs, resolution_mm, bed.unknowns, &ALL, LAST_EFFORT));
    let found = match with_bed {
        Some(bed) if is_obvious && is_heavy(&runs, resolution_mm, &bed) => bed,
        with_bed => {
            let rigid = search(&runs, resolution_mm, rigid.unknowns, without_bed(), LAST_EFFORT)
                .ok_or(too_late.clone())?;
            with_bed.filter(|bed| is_bed(&runs, resolution_mm, &rigid, bed)).unwrap_or(rigid)
        }
    };
    let matches = matches(&runs, recordings, &found.residuals)?;
    let parameters = estimates(&runs, resolution_mm, &found, recordings[0].tick_s).ok_or(too_late)?;
    Ok(Fit { parameters, runs: matches })
}

/// The first stage, on runs that are not harmonic if there are such: a grid, and a search from its best
/// points.
fn coarse(recordings: &[AxisRecording], resolution_mm: f64) -> Result<Option<Unknowns>, IdentifyError> {
    let steps: Vec<AxisRecording> =
        recordings.iter().filter(|run| run.harmonic_hz.is_none()).cloned().collect();
    let chosen = if steps.is_empty() { recordings } else { &steps };
    let runs = Runs::new(chosen);
    let gain = slope(chosen);
    let sustained_accel_mm_s2 = sustained_accel_mm_s2(chosen);
    if gain < 0.0 {
        return Err(IdentifyError::Reversed { slope: gain });
    }
    let mut first = Unknowns([0.0; COUNT]);
    first.set(Unknown::Gain, gain.clamp(0.2, 5.0));
    first.set(Unknown::Coulomb, 0.01 * sustained_accel_mm_s2);
    first.set(Unknown::Viscous, 0.05);
    first.set(Unknown::BedFrequency, 10.0);

    let misfit =
        |residuals: &Residuals| Noise::uncorrelated(&runs, residuals, resolution_mm).misfit(residuals);
    let mut starts = Vec::new();
    for velocity_gain_per_s in GAINS_PER_S {
        for integral_time_s in INTEGRAL_TIMES_S {
            for (lag_ticks, limit) in LAGS_TICKS.into_iter().flat_map(|lag| LIMITS.map(|limit| (lag, limit)))
            {
                let mut start = first;
                let lag_s = lag_ticks * chosen[0].tick_s;
                start.set(Unknown::AccelLimit, limit * sustained_accel_mm_s2);
                start.set(Unknown::VelocityGain, velocity_gain_per_s);
                start.set(Unknown::IntegralTime, integral_time_s);
                start.set(Unknown::Lag, lag_s);
                start.set(Unknown::CurrentLag, 0.2 * lag_s);
                if let Some(residuals) = runs.residuals(&start, COARSE_EFFORT.substeps) {
                    starts.push((misfit(&residuals), start));
                }
            }
        }
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let followed = starts.iter().take(STARTS);
    let found =
        followed.filter_map(|(_, start)| search(&runs, resolution_mm, *start, &COARSE, COARSE_EFFORT));
    let best = found.min_by(|a, b| misfit(&a.residuals).total_cmp(&misfit(&b.residuals)));
    Ok(best.map(|found| found.unknowns))
}

/// Change of position over change of the command's integral, over all runs.
fn slope(recordings: &[AxisRecording]) -> f64 {
    let (mut common, mut power) = (0.0, 0.0);
    for run in recordings {
        let commanded = run.commanded_mm();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (actual_mean, commanded_mean) = (mean(&run.actual_mm), mean(&commanded));
        for (actual, commanded) in run.actual_mm.iter().zip(&commanded) {
            common += (actual - actual_mean) * (commanded - commanded_mean);
            power += (commanded - commanded_mean).powi(2);
        }
    }
    if power > 0.0 { common / power } else { 1.0 }
}

/// A start with a bed, if one promises to be worth a search.
fn likeliest(runs: &Runs, resolution_mm: f64, rigid: &Found) -> Option<Unknowns> {
    super::bed::likeliest_bed(runs, resolution_mm, rigid, MIDDLE_EFFORT.substeps)
        .filter(|(_, gain)| *gain > BED_GAIN)
        .map(|(start, _)| start)
}

/// Gain in misfit by the bed for each reading, all of them taken as independent.
fn gain_per_reading(runs: &Runs, resolution_mm: f64, rigid: &Found, bed: &Found) -> f64 {
    let noise = Noise::uncorrelated(runs, &bed.residuals, resolution_mm);
    (noise.misfit(&rigid.residuals) - noise.misfit(&bed.residuals)) / noise.independent()
}

/// Whether the recordings tell the two models apart.
fn is_bed(runs: &Runs, resolution_mm: f64, rigid: &Found, bed: &Found) -> bool {
    let noise = Noise::of(runs, &bed.residuals, resolution_mm);
    let gain = noise.misfit(&rigid.residuals) - noise.misfit(&bed.residuals);
    gain > BED_GAIN && gain > BED_GAIN_PER_READING * noise.independent() && is_heavy(runs, resolution_mm, bed)
}

/// Whether the bed's mass ratio differs from 0.
fn is_heavy(runs: &Runs, resolution_mm: f64, bed: &Found) -> bool {
    let ratio = bed.unknowns.get(Unknown::BedMassRatio);
    covariance(runs, resolution_mm, bed)
        .is_some_and(|covariance| ratio > BED_DEVIATIONS * covariance.deviation(Unknown::BedMassRatio))
}

fn matches(
    runs: &Runs,
    recordings: &[AxisRecording],
    residuals: &Residuals,
) -> Result<Vec<RunMatch>, IdentifyError> {
    let mut matches = Vec::with_capacity(recordings.len());
    for ((recording, residuals), n) in recordings.iter().zip(residuals).zip(runs.readings()) {
        let error_mm_rms = (dot(residuals, residuals) / n).sqrt();
        let travel_mm = span(&recording.actual_mm);
        if !(error_mm_rms <= MISS_MAX * travel_mm) {
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

fn estimates(runs: &Runs, resolution_mm: f64, found: &Found, tick_s: f64) -> Option<AxisParametersFound> {
    let unknowns = &found.unknowns;
    let covariance = covariance(runs, resolution_mm, found)?;
    let of = |unknown| Estimate::new(unknowns.get(unknown), covariance.deviation(unknown));
    let (lag, current_lag) = (of(Unknown::Lag), of(Unknown::CurrentLag));
    Some(AxisParametersFound {
        command_gain: of(Unknown::Gain),
        command_offset_mm_s: of(Unknown::Offset),
        velocity_gain_per_s: of(Unknown::VelocityGain),
        integral_time_s: of(Unknown::IntegralTime),
        dead_time_s: Estimate::new(
            lag.value - current_lag.value,
            covariance.deviation_of_difference(Unknown::Lag, Unknown::CurrentLag),
        ),
        current_lag_s: current_lag,
        total_delay_s: Estimate { value: lag.value + tick_s / 2.0, ..lag },
        accel_limit_mm_s2: of(Unknown::AccelLimit),
        coulomb_friction_mm_s2: of(Unknown::Coulomb),
        viscous_friction_per_s: of(Unknown::Viscous),
        bed: (unknowns.get(Unknown::BedMassRatio) > 0.0).then(|| BedEstimate {
            frequency_hz: of(Unknown::BedFrequency),
            damping_ratio: of(Unknown::BedDamping),
            mass_ratio: of(Unknown::BedMassRatio),
        }),
    })
}

/// The greatest acceleration that lasted for 5 ms in any run \[mm/s²\].
pub(super) fn sustained_accel_mm_s2(recordings: &[AxisRecording]) -> f64 {
    let of_run = |run: &AxisRecording| {
        let parabolas = Parabolas::over(5e-3, run.tick_s);
        parabolas.of(&run.actual_mm).map(|(_, _, accel)| accel.abs()).fold(0.0, f64::max)
    };
    recordings.iter().map(of_run).fold(0.0, f64::max)
}
