//! What the encoder's readings tell: recorded − simulated position, with the errors that readings have.
//!
//! Three errors are known:
//!
//! - **Rounding.** Uniform over a count, with the variance q²/12. An axis that covers a whole number of counts
//!   from tick to tick, or stands, repeats its rounding error. Such ticks are one reading: their mean.
//! - **Noise** of whole counts, independent from tick to tick, as the readings at rest show it.
//! - **Moments.** A drive is driven to its limit, stops and frees its integrator, and friction turns round, each in a
//!   step of the drive's own clock. Each time the axis ends up to a step of it beside the model. These offsets are
//!   unknowns of known size and shape: what they could explain counts for nothing.
//!
//! Where the encoder's zero lies is not known in any run: one more offset, of any size.

use super::cholesky::{Lower, Symmetric};
use super::moments::Motion;
use super::parameters::Unknowns;
use super::recording::{AxisRecording, span};
use super::simulation::{LANES, SUBSTEPS, Simulation};

/// The longest lag that is looked for \[ticks\].
const LAG_TICKS_MAX: f64 = 50.0;

/// Part of a count within which rounding errors of successive ticks repeat ...
const SAME_ROUNDING: f64 = 0.2;
/// ... until together they have moved by this part.
const NEXT_ROUNDING: f64 = 0.5;

/// Ticks of the command of rest after which an axis is quiet, but for the start of a run, where it stands.
const QUIET_TICKS: usize = 600;

/// Variance of a number between 0 and 1 of which nothing is known.
pub(super) const UNIFORM: f64 = 1.0 / 12.0;

/// Variance of readings, in counts², below which they are those of an axis that creeps over a count now and then.
const CREEP: f64 = 0.1 * UNIFORM;

/// How exactly the model is asked to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Precision {
    pub(super) substeps: u32,
    /// Error that every reading may have besides its own, over the run's travel. A model that is still far off
    /// is judged by the shape of its motion, not by the last digit of one run.
    pub(super) slack: f64,
}

impl Precision {
    pub(super) const LAST: Self = Self { substeps: SUBSTEPS, slack: 0.0 };
}

/// One run, prepared.
#[derive(Clone, Debug)]
struct Run {
    command_mm_s: Vec<f64>,
    /// Means over the groups of the position relative to the first reading.
    actual_mm: Vec<f64>,
    /// First tick of every group, and the end of the last.
    starts: Vec<usize>,
    /// Variance of every group's mean \[mm²\].
    variances: Vec<f64>,
    /// The offsets that moments leave, by group, each of a standard deviation of 1 \[mm\].
    moments: Vec<Vec<f64>>,
    travel_mm: f64,
    /// What the variances are to be multiplied by: the model may not follow.
    scale: f64,
}

/// All runs of an axis.
#[derive(Clone, Debug)]
pub(super) struct Runs {
    tick_s: f64,
    resolution_mm: f64,
    noise_mm2: f64,
    raw: Vec<Vec<f64>>,
    runs: Vec<Run>,
    lead_in_ticks: Vec<usize>,
}

/// Residuals of the groups by run \[mm\].
pub(super) type Residuals = Vec<Vec<f64>>;

/// The weights of a run, and its offsets.
struct Whitening {
    roots: Vec<f64>,
    /// Columns of the offsets, weighted.
    offsets: Vec<Vec<f64>>,
    factor: Option<Lower>,
}

impl Whitening {
    /// A column of residuals, weighted, followed by the coefficients that its offsets take off.
    fn of(&self, column: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let weighted: Vec<f64> = column.iter().zip(&self.roots).map(|(value, root)| value * root).collect();
        let mut common: Vec<f64> = self.offsets.iter().map(|offset| dot(offset, &weighted)).collect();
        if let Some(factor) = &self.factor {
            factor.forward(&mut common);
        }
        (weighted, common)
    }
}

/// The weights of all runs.
pub(super) struct Weights(Vec<Whitening>);

impl Weights {
    /// Σ weighted squares of each run's residuals, less what its offsets explain.
    pub(super) fn misfits(&self, residuals: &Residuals) -> Vec<f64> {
        let of_run = |(whitening, residuals): (&Whitening, &Vec<f64>)| {
            let (weighted, common) = whitening.of(residuals);
            (dot(&weighted, &weighted) - dot(&common, &common)).max(0.0)
        };
        self.0.iter().zip(residuals).map(of_run).collect()
    }

    /// Columns of derivatives, given as residuals by column.
    pub(super) fn columns(&self, columns: &[Residuals]) -> Columns<'_> {
        let of_run = |(index, whitening): (usize, &Whitening)| {
            columns.iter().map(|column| whitening.of(&column[index])).collect()
        };
        Columns { weights: self, count: columns.len(), runs: self.0.iter().enumerate().map(of_run).collect() }
    }

    /// The weighted residuals of each run, less what its offsets explain: white, with a variance of 1, where the
    /// model is right.
    pub(super) fn whitened(&self, residuals: &Residuals) -> Vec<Vec<f64>> {
        let of_run = |(whitening, residuals): (&Whitening, &Vec<f64>)| {
            let (mut weighted, mut common) = whitening.of(residuals);
            if let Some(factor) = &whitening.factor {
                factor.backward(&mut common);
                for (offset, by) in whitening.offsets.iter().zip(&common) {
                    weighted.iter_mut().zip(offset).for_each(|(value, offset)| *value -= by * offset);
                }
            }
            weighted
        };
        self.0.iter().zip(residuals).map(of_run).collect()
    }
}

/// Columns of derivatives, weighted, run by run.
pub(super) struct Columns<'a> {
    weights: &'a Weights,
    count: usize,
    /// With the coefficients that offsets take off.
    runs: Vec<Vec<(Vec<f64>, Vec<f64>)>>,
}

impl Columns<'_> {
    /// JᵀWJ, offsets taken off.
    pub(super) fn normal(&self) -> Symmetric {
        let mut normal = Symmetric::zero(self.count);
        for columns in &self.runs {
            for (row, (weighted, common)) in columns.iter().enumerate() {
                for (column, (other, other_common)) in columns.iter().enumerate().take(row + 1) {
                    let value = dot(weighted, other) - dot(common, other_common);
                    *normal.at_mut(row, column) += value;
                    if row != column {
                        *normal.at_mut(column, row) += value;
                    }
                }
            }
        }
        normal
    }

    /// JᵀWr, offsets taken off.
    pub(super) fn gradient(&self, residuals: &Residuals) -> Vec<f64> {
        let mut gradient = vec![0.0; self.count];
        for ((columns, whitening), residuals) in self.runs.iter().zip(&self.weights.0).zip(residuals) {
            let (left, left_common) = whitening.of(residuals);
            for (sum, (weighted, common)) in gradient.iter_mut().zip(columns) {
                *sum += dot(weighted, &left) - dot(common, &left_common);
            }
        }
        gradient
    }
}

impl Runs {
    pub(super) fn new(recordings: &[AxisRecording], resolution_mm: f64) -> Self {
        let tick_s = recordings.first().map_or(1.0, |recording| recording.tick_s);
        let raw: Vec<Vec<f64>> = recordings
            .iter()
            .map(|recording| {
                let first_mm = recording.actual_mm.first().copied().unwrap_or_default();
                recording.actual_mm.iter().map(|position| position - first_mm).collect()
            })
            .collect();
        let runs = recordings
            .iter()
            .map(|recording| Run {
                command_mm_s: recording.command_mm_s.clone(),
                actual_mm: Vec::new(),
                starts: Vec::new(),
                variances: Vec::new(),
                moments: Vec::new(),
                travel_mm: span(&recording.actual_mm),
                scale: 1.0,
            })
            .collect();
        let noise_mm2 = noise_mm2(recordings, resolution_mm);
        let lead_in_ticks = recordings.iter().map(|recording| recording.lead_in_ticks).collect();
        let mut runs = Self { tick_s, resolution_mm, noise_mm2, raw, runs, lead_in_ticks };
        for run in 0..runs.runs.len() {
            runs.group(run, &|_| 0.5);
        }
        runs
    }

    /// Groups the readings of a run; `part` is the part of a count by which the axis moves in a tick, −½ to ½.
    fn group(&mut self, run: usize, part: &dyn Fn(usize) -> f64) {
        let (raw, lead_in) = (&self.raw[run], self.lead_in_ticks[run]);
        let rounding_mm2 = UNIFORM * self.resolution_mm * self.resolution_mm;
        let (mut starts, mut variances, mut means) = (Vec::new(), Vec::new(), Vec::new());
        let mut start = lead_in;
        while start < raw.len() {
            let (mut end, mut moved) = (start + 1, 0.0_f64);
            while end < raw.len() {
                let by = part(end - 1);
                if by.abs() > SAME_ROUNDING || (moved + by).abs() > NEXT_ROUNDING {
                    break;
                }
                moved += by;
                end += 1;
            }
            let n = (end - start) as f64;
            starts.push(start);
            // Over half a count the errors begin to cancel.
            variances.push(rounding_mm2 * (1.0 - moved.abs()) + self.noise_mm2 / n + 1e-20);
            means.push(raw[start..end].iter().sum::<f64>() / n);
            start = end;
        }
        starts.push(raw.len());
        let run = &mut self.runs[run];
        (run.starts, run.variances, run.actual_mm) = (starts, variances, means);
    }

    /// Groups the readings anew by the motion of the model, and takes over its moments.
    pub(super) fn regroup(&mut self, unknowns: &Unknowns, substeps: u32) {
        let (resolution_mm, tick_s) = (self.resolution_mm, self.tick_s);
        let simulation = Simulation::new(&[*unknowns; LANES], tick_s, substeps);
        for index in 0..self.runs.len() {
            let mut positions = Vec::with_capacity(self.raw[index].len());
            let command = &self.runs[index].command_mm_s;
            let limited = simulation.run(command, &mut |_, state| positions.push(state.position[0]));
            let motion = Motion {
                simulation: &simulation,
                unknowns,
                command_mm_s: command,
                positions_mm: &positions,
                limited: &limited,
                tick_s,
            };
            // Only the last stage has no slack, which is wider than what moments leave.
            let moments = if substeps == SUBSTEPS { motion.offsets() } else { Vec::new() };
            if resolution_mm > 0.0 {
                self.group(index, &|tick| {
                    let counts = (positions[tick + 1] - positions[tick]) / resolution_mm;
                    counts - counts.round()
                });
            }
            let run = &mut self.runs[index];
            let of_groups = |offset: Vec<f64>| {
                run.starts.windows(2).map(|ends| offset[(ends[0] + ends[1]) / 2]).collect::<Vec<f64>>()
            };
            run.moments = moments.into_iter().map(of_groups).collect();
        }
    }

    /// Takes over how well the model follows each run. What it does not follow counts for less.
    pub(super) fn rescale(&mut self, misfits: &[f64]) {
        for (run, misfit) in self.runs.iter_mut().zip(misfits) {
            let scale = run.scale * misfit / run.actual_mm.len().max(1) as f64;
            // Within what chance does, a run has the errors that its readings must have.
            let by_chance = 1.0 + 6.0 / (run.actual_mm.len().max(1) as f64).sqrt();
            run.scale = if scale > by_chance { scale } else { 1.0 };
        }
    }

    /// Multiplies the variances of each run.
    pub(super) fn scale_variances(&mut self, factors: &[f64]) {
        self.runs.iter_mut().zip(factors).for_each(|(run, factor)| run.scale *= factor);
    }

    /// The longest τ + Tf + Tc that is looked for \[s\].
    pub(super) fn lag_limit_s(&self) -> f64 {
        LAG_TICKS_MAX * self.tick_s
    }

    /// The encoder's step \[mm\].
    pub(super) fn resolution_mm(&self) -> f64 {
        self.resolution_mm
    }

    /// Independent readings of all runs.
    pub(super) fn readings(&self) -> f64 {
        self.runs.iter().map(|run| run.actual_mm.len() as f64).sum()
    }

    /// The residuals of several sets of unknowns; `None` for one that ends in what is not a number.
    pub(super) fn residuals(&self, sets: &[Unknowns], substeps: u32) -> Vec<Option<Residuals>> {
        sets.chunks(LANES).flat_map(|sets| self.residuals_of_lanes(sets, substeps)).collect()
    }

    fn residuals_of_lanes(&self, sets: &[Unknowns], substeps: u32) -> Vec<Option<Residuals>> {
        let lanes: [Unknowns; LANES] = core::array::from_fn(|lane| sets[lane.min(sets.len() - 1)]);
        let simulation = Simulation::new(&lanes, self.tick_s, substeps);
        let mut all = vec![Vec::with_capacity(self.runs.len()); sets.len()];
        for run in &self.runs {
            let mut sums = vec![[0.0; LANES]; run.actual_mm.len()];
            let mut group = 0;
            simulation.run(&run.command_mm_s, &mut |tick, state| {
                if tick < run.starts[0] {
                    return;
                }
                if tick >= run.starts[group + 1] {
                    group += 1;
                }
                for (sum, position) in sums[group].iter_mut().zip(state.position) {
                    *sum += position;
                }
            });
            for (lane, residuals) in all.iter_mut().enumerate() {
                let of_group = |group: usize| {
                    let ticks = (run.starts[group + 1] - run.starts[group]) as f64;
                    run.actual_mm[group] - sums[group][lane] / ticks
                };
                residuals.push((0..run.actual_mm.len()).map(of_group).collect::<Vec<f64>>());
            }
        }
        all.into_iter()
            .map(|residuals| {
                let is_finite = |run: &Vec<f64>| run.iter().all(|value| value.is_finite());
                residuals.iter().all(is_finite).then_some(residuals)
            })
            .collect()
    }

    /// The weights of all runs, for as long as groups and scales stay as they are.
    pub(super) fn weights(&self, precision: Precision) -> Weights {
        Weights(self.runs.iter().map(|run| self.whitening(run, precision)).collect())
    }

    fn whitening(&self, run: &Run, Precision { slack, .. }: Precision) -> Whitening {
        let slack_mm2 = (slack * run.travel_mm).powi(2);
        let roots: Vec<f64> =
            run.variances.iter().map(|variance| (variance * run.scale + slack_mm2).sqrt().recip()).collect();
        let mut offsets = vec![roots.clone()];
        for moment in run.moments.iter().filter(|_| slack == 0.0) {
            offsets.push(moment.iter().zip(&roots).map(|(value, root)| value * root).collect());
        }
        let mut normal = normal(&offsets);
        for index in 1..offsets.len() {
            *normal.at_mut(index, index) += 1.0;
        }
        Whitening { roots, offsets, factor: normal.factor() }
    }

    /// Root of the mean square of each run's residuals \[mm\], about their mean.
    pub(super) fn errors_mm_rms(&self, residuals: &Residuals) -> Vec<f64> {
        let of_run = |residuals: &Vec<f64>| {
            let n = residuals.len().max(1) as f64;
            let mean = residuals.iter().sum::<f64>() / n;
            (residuals.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt()
        };
        residuals.iter().map(of_run).collect()
    }
}

/// The variance of a reading besides rounding \[mm²\], from second differences where the axis is quiet.
pub(super) fn noise_mm2(recordings: &[AxisRecording], resolution_mm: f64) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for readings in recordings.iter().flat_map(quiet) {
        // By then an axis that drifts has reached its velocity.
        let settled = &readings[readings.len() / 2..];
        let [first, .., last] = settled else { continue };
        // Drift changes the rounding: a count once in a while at first, and then every reading has its own.
        let drift = (last - first).abs() / (settled.len() - 1) as f64;
        let rounding = (drift * resolution_mm / 3.0).min(UNIFORM * resolution_mm * resolution_mm);
        let readings = if rounding > CREEP * resolution_mm * resolution_mm { settled } else { readings };
        let differences = readings.windows(3).map(|at| at[0] - 2.0 * at[1] + at[2]);
        let n = readings.len().saturating_sub(2) as f64;
        // Second differences of independent readings have six times their variance.
        squares += differences.map(|value| value * value).sum::<f64>() / 6.0 - n * rounding;
        count += n;
    }
    let noise = if count > 0.0 { squares / count } else { 0.0 };
    if noise > CREEP * resolution_mm * resolution_mm { noise } else { 0.0 }
}

/// The stretches of a run in which nothing is asked of the axis, and nothing has been for a while.
fn quiet(run: &AxisRecording) -> Vec<&[f64]> {
    let is_rest = |tick: usize| run.command_mm_s[tick] == run.rest_mm_s();
    let mut stretches = Vec::new();
    let mut start = 0;
    while start < run.command_mm_s.len() {
        let end = (start..run.command_mm_s.len()).find(|&tick| !is_rest(tick));
        let end = end.unwrap_or(run.command_mm_s.len());
        let begins = if start == 0 { 0 } else { start + QUIET_TICKS };
        stretches.extend(run.actual_mm.get(begins..end));
        start = end + 1;
    }
    stretches
}

fn normal(columns: &[Vec<f64>]) -> Symmetric {
    let mut normal = Symmetric::zero(columns.len());
    for (row, left) in columns.iter().enumerate() {
        for (column, right) in columns.iter().enumerate().take(row + 1) {
            let value = dot(left, right);
            *normal.at_mut(row, column) = value;
            *normal.at_mut(column, row) = value;
        }
    }
    normal
}

/// Sums side by side: one alone waits for each addition.
const SUMS: usize = 8;

/// Σ a·b, over the shorter of both.
pub(super) fn dot(left: &[f64], right: &[f64]) -> f64 {
    let count = left.len().min(right.len());
    let (left, right) = (&left[..count], &right[..count]);
    let ((left, left_rest), (right, right_rest)) = (left.as_chunks::<SUMS>(), right.as_chunks::<SUMS>());
    let mut sums = [0.0; SUMS];
    for (left, right) in left.iter().zip(right) {
        for (sum, (left, right)) in sums.iter_mut().zip(left.iter().zip(right)) {
            *sum += left * right;
        }
    }
    let rest: f64 = left_rest.iter().zip(right_rest).map(|(left, right)| left * right).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers: every order of summation is exact.
    #[test]
    fn products_are_those_of_the_shorter() {
        let values: Vec<f64> = (1..=40).map(f64::from).collect();
        for (left, right) in [(0, 5), (7, 7), (8, 8), (15, 17), (20, 15), (33, 40), (40, 40)] {
            let expected: u32 = (1..=left.min(right) as u32).map(|value| value * (41 - value)).sum();
            let back: Vec<f64> = values.iter().rev().copied().collect();
            let found = dot(&values[..left], &back[..right]);
            assert!(
                (found - f64::from(expected)).abs() < 0.5,
                "{left} and {right}: {found}, expected {expected}"
            );
        }
    }
}
