//! The sine in a signal, by least squares.

use core::f64::consts::PI;

/// mean + amplitude·cos(ωt + phase).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// In the signal's unit.
    pub mean: f64,
    /// In the signal's unit, 0 or more.
    pub amplitude: f64,
    /// At t = 0 \[rad\], −π to π.
    pub phase_rad: f64,
}

/// What a sine stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Baseline {
    /// A constant: the mean.
    Mean,
    /// A straight line, whose value in the middle is the mean: positions drift.
    Line,
}

/// The sine of ω \[rad/s\] nearest to `values`, which follow each other by `tick_s` from t = 0 on.
///
/// The normal equations are solved whole, so that the values need not cover whole periods; over less than
/// half a period the baseline and the sine can't be told apart. No or equal values make a sine of no
/// amplitude.
#[must_use]
pub fn fit(values: &[f64], omega_per_s: f64, tick_s: f64, baseline: Baseline) -> Sine {
    let unknowns = if baseline == Baseline::Line { 4 } else { 3 };
    let first = values.first().copied().unwrap_or(0.0);
    let middle = 0.5 * values.len() as f64;
    // Of each row the last one is the right side.
    let mut normal = [[0.0; 5]; 4];
    for (index, &value) in values.iter().enumerate() {
        let (sine, cosine) = libm::sincos(omega_per_s * index as f64 * tick_s);
        let base = [1.0, cosine, sine, (index as f64 - middle) / middle];
        for (row, &left) in normal.iter_mut().zip(&base).take(unknowns) {
            for (cell, &above) in row.iter_mut().zip(&base) {
                *cell += left * above;
            }
            row[4] += left * (value - first);
        }
    }
    let [mean, cosine, sine, _] = solve(normal, unknowns);
    // a·cos ωt + b·sin ωt = A·cos(ωt + φ): a = A·cos φ, b = −A·sin φ.
    Sine { mean: first + mean, amplitude: libm::hypot(cosine, sine), phase_rad: libm::atan2(-sine, cosine) }
}

/// Elimination without pivoting: the matrix is nearly diagonal and positive. What can't be solved is zero.
fn solve(mut m: [[f64; 5]; 4], unknowns: usize) -> [f64; 4] {
    for pivot in 0..unknowns {
        if !(m[pivot][pivot].abs() > 0.0) {
            return [0.0; 4];
        }
        let above = m[pivot];
        for (row, cells) in m.iter_mut().enumerate().take(unknowns) {
            let part = cells[pivot] / above[pivot];
            if row != pivot {
                cells.iter_mut().zip(above).for_each(|(cell, above)| *cell -= part * above);
            }
        }
    }
    core::array::from_fn(|unknown| if unknown < unknowns { m[unknown][4] / m[unknown][unknown] } else { 0.0 })
}

/// A phase as a lag is read: from −3π/2 (exclusive) to π/2.
#[must_use]
pub fn as_lag_rad(phase_rad: f64) -> f64 {
    let turned = libm::remainder(phase_rad, 2.0 * PI);
    if turned > PI / 2.0 { turned - 2.0 * PI } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_is_found_in_any_window() {
        for (count, omega) in [(2000, 50.0), (137, 90.0), (400, 7.0)] {
            let values: Vec<f64> =
                (0..count).map(|i| 3.0 + 2.0 * (omega * f64::from(i) * 5e-4 - 1.2).cos()).collect();
            let found = fit(&values, omega, 5e-4, Baseline::Mean);
            assert!((found.mean - 3.0).abs() < 1e-6, "{found:?}");
            assert!(
                (found.amplitude - 2.0).abs() < 1e-6 && (found.phase_rad + 1.2).abs() < 1e-6,
                "{found:?}"
            );
        }
        assert!(fit(&[], 1.0, 1.0, Baseline::Mean).amplitude.abs() <= 0.0);
    }

    #[test]
    fn a_drift_is_no_sine() {
        for count in [2000, 137, 901] {
            let at = |i: i32| 40.0 + 0.01 * f64::from(i) + 0.02 * (90.0 * f64::from(i) * 5e-4 - 1.2).cos();
            let values: Vec<f64> = (0..count).map(at).collect();
            let found = fit(&values, 90.0, 5e-4, Baseline::Line);
            assert!((found.mean - 40.0 - 0.005 * f64::from(count)).abs() < 1e-9, "{found:?}");
            assert!(
                (found.amplitude - 0.02).abs() < 1e-9 && (found.phase_rad + 1.2).abs() < 1e-7,
                "{found:?}"
            );
        }
    }

    #[test]
    fn lags_are_negative() {
        assert!((as_lag_rad(3.0) - (3.0 - 2.0 * PI)).abs() < 1e-12);
        assert!((as_lag_rad(-4.0) + 4.0).abs() < 1e-12);
        assert!((as_lag_rad(0.1) - 0.1).abs() < 1e-12);
        assert!((as_lag_rad(-0.1 - 4.0 * PI) + 0.1).abs() < 1e-9);
    }
}
