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

/// The sine of ω \[rad/s\] nearest to `values`, which follow each other by `tick_s` from t = 0 on.
///
/// The normal equations are solved whole, so that the values need not cover whole periods; over less than half a
/// period the mean and the sine can't be told apart. No or equal values make a sine of no amplitude.
#[must_use]
pub fn fit(values: &[f64], omega_per_s: f64, tick_s: f64) -> Sine {
    let mut normal = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for (index, &value) in values.iter().enumerate() {
        let (sine, cosine) = libm::sincos(omega_per_s * index as f64 * tick_s);
        let base = [1.0, cosine, sine];
        for (row, &left) in base.iter().enumerate() {
            for (column, &above) in base.iter().enumerate() {
                normal[row][column] += left * above;
            }
            right[row] += left * value;
        }
    }
    let [mean, cosine, sine] = solve(normal, right);
    // a·cos ωt + b·sin ωt = A·cos(ωt + φ): a = A·cos φ, b = −A·sin φ.
    Sine { mean, amplitude: libm::hypot(cosine, sine), phase_rad: libm::atan2(-sine, cosine) }
}

/// Cramer's rule: the matrix is nearly diagonal. What can't be solved is zero.
fn solve(m: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let determinant = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(&m);
    if !(whole.abs() > 0.0) {
        return [0.0; 3];
    }
    core::array::from_fn(|unknown| {
        let mut replaced = m;
        for (row, &value) in replaced.iter_mut().zip(&right) {
            row[unknown] = value;
        }
        determinant(&replaced) / whole
    })
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
            let found = fit(&values, omega, 5e-4);
            assert!((found.mean - 3.0).abs() < 1e-6, "{found:?}");
            assert!(
                (found.amplitude - 2.0).abs() < 1e-6 && (found.phase_rad + 1.2).abs() < 1e-6,
                "{found:?}"
            );
        }
        assert!(fit(&[], 1.0, 1.0).amplitude.abs() <= 0.0);
    }

    #[test]
    fn lags_are_negative() {
        assert!((as_lag_rad(3.0) - (3.0 - 2.0 * PI)).abs() < 1e-12);
        assert!((as_lag_rad(-4.0) + 4.0).abs() < 1e-12);
        assert!((as_lag_rad(0.1) - 0.1).abs() < 1e-12);
        assert!((as_lag_rad(-0.1 - 4.0 * PI) + 0.1).abs() < 1e-9);
    }
}
