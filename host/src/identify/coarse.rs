//! The first stage of the fit: a coarse grid on the steps, and searches from its best points.

use super::IdentifyError;
use super::cholesky::Symmetric;
use super::differences::Parabolas;
use super::parameters::{Unknown, Unknowns};
use super::readings::{Precision, Runs, dot};
use super::recording::AxisRecording;
use super::search::{Effort, Found, search};
use super::simulation::SUBSTEPS;

/// Starts of the grid: velocity gain \[1/s\], integral time \[s\], lag \[ticks\] ...
const GAINS_PER_S: [f64; 6] = [18.0, 40.0, 90.0, 200.0, 450.0, 1000.0];
const INTEGRAL_TIMES_S: [f64; 4] = [0.006, 0.02, 0.07, 0.25];
const LAGS_TICKS: [f64; 5] = [1.0, 3.0, 6.0, 12.0, 30.0];
/// ... current limit over the greatest acceleration, in which friction and bed may have helped ...
const LIMITS: [f64; 2] = [0.85, 1.2];
/// ... and Coulomb friction over it.
const FRICTIONS: [f64; 2] = [0.01, 0.2];

/// Starts that are followed: on the steps, and of those on all runs.
const FOLLOWED: usize = 6;
const CONTINUED: usize = 2;

/// Unknowns of the first stage.
const COARSE: [Unknown; 7] = [
    Unknown::Gain,
    Unknown::Offset,
    Unknown::VelocityGain,
    Unknown::IntegralTime,
    Unknown::Lag,
    Unknown::AccelLimit,
    Unknown::Coulomb,
];

const GRID: Precision = Precision { substeps: 3, slack: 1e-2 };
const COARSE_EFFORT: Effort = Effort::far(Precision { substeps: 4, slack: 5e-3 }, 8);

/// The first stage, on runs that are not harmonic if there are such: a grid, and searches from its best
/// points. The likeliest first.
pub(super) fn coarse(
    recordings: &[AxisRecording],
    resolution_mm: f64,
) -> Result<Vec<Unknowns>, IdentifyError> {
    let steps: Vec<AxisRecording> =
        recordings.iter().filter(|run| run.harmonic_hz.is_none()).cloned().collect();
    let chosen = if steps.is_empty() { recordings } else { &steps };
    let runs = Runs::new(chosen, resolution_mm);
    let (gain, drift_mm_s) = slope_and_drift(chosen);
    let sustained_accel_mm_s2 = sustained_accel_mm_s2(chosen);
    if gain < 0.0 {
        return Err(IdentifyError::Reversed { slope: gain });
    }
    let mut first = Unknowns::zero(chosen[0].tick_s / f64::from(SUBSTEPS));
    first.set(Unknown::Gain, gain.clamp(0.2, 5.0));
    first.set(Unknown::Offset, drift_mm_s);
    first.set(Unknown::Viscous, 0.05);
    first.set(Unknown::BedFrequency, 10.0);
    let mut starts = Vec::new();
    for velocity_gain_per_s in GAINS_PER_S {
        for integral_time_s in
            INTEGRAL_TIMES_S.into_iter().filter(|time_s| time_s * velocity_gain_per_s > 0.5)
        {
            for lag_s in LAGS_TICKS.map(|ticks| ticks * chosen[0].tick_s) {
                for (limit, friction) in
                    LIMITS.into_iter().flat_map(|limit| FRICTIONS.map(|part| (limit, part)))
                {
                    let mut start = first;
                    start.set(Unknown::AccelLimit, limit * sustained_accel_mm_s2);
                    start.set(Unknown::Coulomb, friction * sustained_accel_mm_s2);
                    start.set(Unknown::VelocityGain, velocity_gain_per_s);
                    start.set(Unknown::IntegralTime, integral_time_s);
                    start.set(Unknown::Lag, lag_s);
                    start.set(Unknown::CurrentLag, (0.2 * lag_s).min(0.3 / velocity_gain_per_s));
                    starts.push(start);
                }
            }
        }
    }
    let results = runs.residuals(&starts, GRID.substeps);
    let weights = runs.weights(GRID);
    let mut judged: Vec<(f64, Unknowns)> = results
        .into_iter()
        .zip(starts)
        .filter_map(|(residuals, start)| Some((weights.misfits(&residuals?).iter().sum(), start)))
        .collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Neighbours of the best end where the best ends.
    let mut followed: Vec<Unknowns> = Vec::new();
    for (_, start) in judged {
        let is_other = |unknown: Unknown, other: &Unknowns| start.get(unknown) != other.get(unknown);
        let is_new = followed
            .iter()
            .all(|other| is_other(Unknown::VelocityGain, other) || is_other(Unknown::IntegralTime, other));
        if is_new {
            followed.push(start);
        }
        if followed.len() == FOLLOWED {
            break;
        }
    }
    let mut found: Vec<Found> =
        followed.into_iter().filter_map(|start| search(&runs, start, &COARSE, COARSE_EFFORT)).collect();
    found.sort_by(|a, b| a.misfit().total_cmp(&b.misfit()));
    Ok(found.into_iter().take(CONTINUED).map(|found| found.unknowns).collect())
}

/// How an axis without any lag would fit best: by its gain, and its velocity at command 0 \[mm/s\].
///
/// A run without a lag is off by a lag's travel in every one of its motions, and back after it.
fn slope_and_drift(recordings: &[AxisRecording]) -> (f64, f64) {
    let mut normal = Symmetric::zero(2);
    let mut right = [0.0; 2];
    for run in recordings {
        let times_s: Vec<f64> = (0..run.actual_mm.len()).map(|tick| tick as f64 * run.tick_s).collect();
        let centred = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|value| value - mean).collect::<Vec<f64>>()
        };
        let columns = [centred(&run.commanded_mm()), centred(&times_s)];
        let actual = centred(&run.actual_mm);
        for (row, column) in columns.iter().enumerate() {
            right[row] += dot(column, &actual);
            for (other, values) in columns.iter().enumerate() {
                *normal.at_mut(row, other) += dot(column, values);
            }
        }
    }
    match normal.solve(&right).as_deref() {
        Some(&[gain, drift_mm_s]) => (gain, drift_mm_s),
        _ => (1.0, 0.0),
    }
}

/// The greatest acceleration that lasted for 5 ms in any run \[mm/s²\].
pub(super) fn sustained_accel_mm_s2(recordings: &[AxisRecording]) -> f64 {
    let of_run = |run: &AxisRecording| Parabolas::over(5e-3, run.tick_s).greatest_accel(&run.actual_mm);
    recordings.iter().map(of_run).fold(0.0, f64::max)
}
