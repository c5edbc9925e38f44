//! How well the recordings fix the unknowns.
//!
//! Residuals of neighbouring ticks resemble each other, so n of them tell as little as n/γ independent ones;
//! γ is one plus twice the sum of their autocorrelation. The covariance of the unknowns is the inverse of the
//! information that is left.

use super::cholesky::Symmetric;
use super::parameters::{COUNT, Unknown};
use super::search::{Found, Noise};
use super::simulation::{Runs, dot};

/// Lags over which autocorrelation is summed at most.
const LAGS_MAX: usize = 400;

/// Covariance of all unknowns in the units of their values; infinite where they were not searched.
#[derive(Clone, Debug)]
pub(super) struct Covariance(Symmetric);

/// γ of one run's residuals, at least 1.
pub(super) fn correlation_factor(residuals: &[f64]) -> f64 {
    let power = dot(residuals, residuals);
    if !(power > 0.0) {
        return 1.0;
    }
    let correlations =
        (1..LAGS_MAX.min(residuals.len())).map(|lag| dot(&residuals[lag..], residuals) / power);
    // Beyond its first zero the estimate is noise.
    1.0 + 2.0 * correlations.take_while(|&correlation| correlation > 0.0).sum::<f64>()
}

/// The covariance of what a search found; `None` if it found nothing that can be linearised.
pub(super) fn covariance(runs: &Runs, resolution_mm: f64, found: &Found) -> Option<Covariance> {
    let unknowns = &found.unknowns;
    let linear = found.linear.as_ref()?;
    let free = &linear.free;
    let noise = Noise::of(runs, &found.residuals, resolution_mm).careful();
    let mut information = linear.normal(&noise.weights());
    for (index, unknown) in free.iter().enumerate() {
        // An unknown that no run shows ends with this width, far beyond what counts as determined.
        *information.at_mut(index, index) += unknown.ignorance().powi(-2);
    }
    // Scaled to a diagonal of 1 for the inversion.
    let scale: Vec<f64> = (0..free.len()).map(|index| information.at(index, index).sqrt().recip()).collect();
    let mut scaled = Symmetric::zero(free.len());
    for row in 0..free.len() {
        for column in 0..free.len() {
            *scaled.at_mut(row, column) = information.at(row, column) * scale[row] * scale[column];
        }
    }
    let inverse = scaled.inverse()?;
    let mut covariance = Symmetric::zero(COUNT);
    for index in 0..COUNT {
        *covariance.at_mut(index, index) = f64::INFINITY;
    }
    let unit: Vec<f64> =
        free.iter().zip(&scale).map(|(&unknown, scale)| unknowns.deviation(unknown, *scale)).collect();
    for (row, &left) in free.iter().enumerate() {
        for (column, &right) in free.iter().enumerate() {
            *covariance.at_mut(left as usize, right as usize) =
                inverse.at(row, column) * unit[row] * unit[column];
        }
    }
    Some(Covariance(covariance))
}

impl Covariance {
    /// Standard deviation of one unknown.
    pub(super) fn deviation(&self, unknown: Unknown) -> f64 {
        self.0.at(unknown as usize, unknown as usize).sqrt()
    }

    /// Standard deviation of the difference of two unknowns.
    pub(super) fn deviation_of_difference(&self, left: Unknown, right: Unknown) -> f64 {
        let (left, right) = (left as usize, right as usize);
        let square = self.0.at(left, left) + self.0.at(right, right) - 2.0 * self.0.at(left, right);
        square.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_residuals_count_once() {
        // An aperiodic sequence of signs, each standing for ten ticks: between 1 + 2·(9 + … + 1)/10 = 10 and
        // noise.
        let mut state = 12345_u32;
        let mut signs = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if state >> 31 == 0 { 1.0 } else { -1.0 }
        };
        let alone: Vec<f64> = (0..20_000).map(|_| signs()).collect();
        let standing: Vec<f64> = alone.iter().take(2000).flat_map(|&sign| [sign; 10]).collect();
        assert!((1.0..1.3).contains(&correlation_factor(&alone)));
        assert!((8.0..13.0).contains(&correlation_factor(&standing)));
        assert_eq!(correlation_factor(&[0.0; 10]), 1.0);
    }
}
