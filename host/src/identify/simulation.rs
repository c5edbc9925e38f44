//! The runs as the search sees them: recordings, and the drive model's answers to the same commands.

use hal_sim::{DriveModel, DriveState};

use super::cholesky::Symmetric;
use super::parameters::{Unknown, Unknowns};
use super::recording::AxisRecording;

/// Cells of the simulated dead time, one per sub-step.
const LINE: usize = 1024;

/// Sub-steps of a tick in the last stage of the search: those of the reference machine. Stages before it are
/// content with half of them.
pub(super) const SUBSTEPS: u32 = 20;

/// The longest lag that is looked for \[ticks\]; the line has room for it.
const LAG_TICKS_MAX: f64 = 50.0;

/// One run, prepared.
#[derive(Clone, Debug)]
struct Run {
    command_mm_s: Vec<f64>,
    /// The position relative to the first reading.
    actual_mm: Vec<f64>,
    /// Per tick; 0 in the lead-in.
    weights: Vec<f64>,
    weight_sum: f64,
}

/// All runs of an axis.
#[derive(Clone, Debug)]
pub(super) struct Runs {
    tick_s: f64,
    runs: Vec<Run>,
}

/// Residuals of all runs: recorded − simulated, weighted, the mean of each run taken off.
pub(super) type Residuals = Vec<Vec<f64>>;

/// The model's output as a linear function of small steps in some unknowns.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    pub(super) free: Vec<Unknown>,
    /// The derivatives by run and by free unknown.
    pub(super) columns: Vec<Vec<Vec<f64>>>,
    /// JᵀJ by run.
    pub(super) normals: Vec<Symmetric>,
}

impl Run {
    fn new(recording: &AxisRecording) -> Self {
        let first_mm = recording.actual_mm.first().copied().unwrap_or_default();
        let actual_mm: Vec<f64> = recording.actual_mm.iter().map(|position| position - first_mm).collect();
        // A reading that stands has the same rounding error in every tick: all of them tell as much as one.
        let mut weights = vec![0.0; actual_mm.len()];
        let mut start = recording.lead_in_ticks;
        while start < actual_mm.len() {
            let same = actual_mm[start..].iter().take_while(|&&reading| reading == actual_mm[start]).count();
            weights[start..start + same].fill(1.0 / same as f64);
            start += same;
        }
        let weight_sum = weights.iter().sum();
        Self { command_mm_s: recording.command_mm_s.clone(), actual_mm, weights, weight_sum }
    }

    fn residuals(&self, model: &DriveModel, unknowns: &Unknowns) -> Option<Vec<f64>> {
        let mut state = DriveState::<LINE>::at_rest(model, 0.0).ok()?;
        let (gain, offset) = (unknowns.get(Unknown::Gain), unknowns.get(Unknown::Offset));
        let mut residuals = Vec::with_capacity(self.actual_mm.len());
        for (command, actual) in self.command_mm_s.iter().zip(&self.actual_mm) {
            residuals.push(actual - state.position_mm());
            model.tick(&mut state, gain * command + offset);
        }
        // Where the encoder's zero lies is unknown: the mean is taken off.
        let sum: f64 = residuals.iter().zip(&self.weights).map(|(residual, weight)| residual * weight).sum();
        let mean = sum / self.weight_sum;
        for (residual, weight) in residuals.iter_mut().zip(&self.weights) {
            *residual = (*residual - mean) * weight.sqrt();
        }
        Some(residuals)
    }
}

impl Runs {
    pub(super) fn new(recordings: &[AxisRecording]) -> Self {
        let tick_s = recordings.first().map_or(1.0, |recording| recording.tick_s);
        Self { tick_s, runs: recordings.iter().map(Run::new).collect() }
    }

    /// The longest τ + Tc that is looked for \[s\].
    pub(super) fn lag_limit_s(&self) -> f64 {
        LAG_TICKS_MAX * self.tick_s
    }

    /// Effective readings of each run.
    pub(super) fn readings(&self) -> Vec<f64> {
        self.runs.iter().map(|run| run.weight_sum).collect()
    }

    /// The residuals of each run; `None` if it can't be simulated.
    pub(super) fn residuals(&self, unknowns: &Unknowns, substeps: u32) -> Option<Residuals> {
        let model = DriveModel::new(unknowns.drive(), self.tick_s, substeps).ok()?;
        let residuals: Residuals =
            self.runs.iter().map(|run| run.residuals(&model, unknowns)).collect::<Option<_>>()?;
        residuals.iter().flatten().all(|residual| residual.is_finite()).then_some(residuals)
    }

    /// Change of the residuals per unit of one unknown's coordinate.
    pub(super) fn sensitivity(
        &self,
        unknowns: &Unknowns,
        residuals: &Residuals,
        unknown: Unknown,
        substeps: u32,
    ) -> Option<Residuals> {
        // Towards the inside, where the other side is out of range.
        let step = unknown.difference();
        let step = if unknowns.is_held(unknown, step, self.lag_limit_s()) { -step } else { step };
        let moved = self.residuals(&unknowns.moved(&[unknown], &[step], self.lag_limit_s()), substeps)?;
        let quotients = moved.into_iter().zip(residuals).map(|(mut moved, still)| {
            moved.iter_mut().zip(still).for_each(|(moved, still)| *moved = (*moved - still) / step);
            moved
        });
        Some(quotients.collect())
    }

    /// Linearises about `unknowns`.
    pub(super) fn linearised(
        &self,
        unknowns: &Unknowns,
        free: &[Unknown],
        substeps: u32,
    ) -> Option<Linearised> {
        let residuals = self.residuals(unknowns, substeps)?;
        let mut columns = vec![Vec::with_capacity(free.len()); self.runs.len()];
        for &unknown in free {
            let sensitivity = self.sensitivity(unknowns, &residuals, unknown, substeps)?;
            columns.iter_mut().zip(sensitivity).for_each(|(columns, column)| columns.push(column));
        }
        let normals = columns.iter().map(|columns| normal(columns)).collect();
        Some(Linearised { free: free.to_vec(), columns, normals })
    }
}

impl Linearised {
    /// Σ weight·JᵀJ over the runs.
    pub(super) fn normal(&self, weights: &[f64]) -> Symmetric {
        let mut sum = Symmetric::zero(self.free.len());
        self.normals.iter().zip(weights).for_each(|(normal, weight)| sum.add(*weight, normal));
        sum
    }

    /// Σ weight·Jᵀr over the runs.
    pub(super) fn gradient(&self, residuals: &Residuals, weights: &[f64]) -> Vec<f64> {
        let mut gradient = vec![0.0; self.free.len()];
        for ((columns, residuals), weight) in self.columns.iter().zip(residuals).zip(weights) {
            for (sum, column) in gradient.iter_mut().zip(columns) {
                *sum += weight * dot(column, residuals);
            }
        }
        gradient
    }
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

/// Σ a·b.
pub(super) fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

/// Σ r² of each run.
pub(super) fn squares(residuals: &Residuals) -> Vec<f64> {
    residuals.iter().map(|run| dot(run, run)).collect()
}
