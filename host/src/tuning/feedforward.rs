//! Feedforward from a drive's parameters, by three methods.
//!
//! The response G of the drive has an inverse 1/G = 1 + c₁·s + c₂·s² + …: V, A and J gains 1, c₁, c₂ are the
//! series as far as S4 (1). The omitted terms grow with frequency, so gains with the least error over a range
//! of frequencies differ from the series. The inverse itself omits nothing, but it needs a lead for the dead
//! time.

use core::f64::consts::TAU;

use hal_sim::DriveParameters;
use motion_kernel::axis::{BedInverse, DriveInverse, Feedforward, Gains, PREVIEW_TICKS_MAX};

use crate::drive::inverse::inverse;
use crate::drive::model::{Complex, feedback, response};

/// Frequencies over which gains are fitted \[Hz\].
const FITTED_HZ: core::ops::RangeInclusive<u32> = 1..=20;

/// How feedforward is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The drive's inverse with friction and bed, led by dead time and half a tick.
    #[default]
    Inverse,
    /// V, A and J gains from the series of 1/G.
    Series,
    /// V, A and J gains that leave the least following error from 1 to 20 Hz.
    Fit,
}

/// c₁ \[s\] and c₂ \[s²\] of 1/G for ticks of `tick_s`, without a bed.
#[must_use]
pub fn series(drive: &DriveParameters, tick_s: f64) -> [f64; 2] {
    let late_s = drive.dead_time_s + 0.5 * tick_s + drive.command_filter_s;
    let (inertia, viscous_per_s) = (1.0 + drive.load_inertia_ratio, drive.viscous_friction_per_s);
    // 1 + 1/H = 1 + h₁·s + h₂·s² + …
    let h = drive.integral_time_s / drive.velocity_gain_per_s;
    let h1 = h * viscous_per_s;
    let h2 = h * (inertia + viscous_per_s * (drive.current_lag_s - drive.integral_time_s));
    // The dead time's exponential has late²/2; the filter's lag has no second order of its own.
    let exponential_s = late_s - drive.command_filter_s;
    let second = 0.5 * exponential_s * exponential_s + exponential_s * drive.command_filter_s;
    [late_s + h1, second + late_s * h1 + h2]
}

/// A \[s\] and J \[s²\] gain that leave the least following error under the feedback of `gains`,
/// in the least squares over harmonic motion of one velocity amplitude.
#[must_use]
pub fn fit(drive: &DriveParameters, gains: &Gains, tick_s: f64) -> [f64; 2] {
    // The normal equations of e = (1 − G·(1 + A·s + J·s²))/(s + C·G), real and imaginary part for each
    // frequency.
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for frequency_hz in FITTED_HZ.map(f64::from) {
        let s = Complex::new(0.0, TAU * frequency_hz);
        let g = response(drive, tick_s, frequency_hz);
        let closed = s + feedback(gains, tick_s, frequency_hz) * g;
        let left = Complex::new(1.0 - g.re, -g.im) / closed;
        let (of_a, of_j) = (g * s / closed, g * s * s / closed);
        for (a, b, y) in [(of_a.re, of_j.re, left.re), (of_a.im, of_j.im, left.im)] {
            aa += a * a;
            ab += a * b;
            bb += b * b;
            ay += a * y;
            by += b * y;
        }
    }
    let determinant = aa * bb - ab * ab;
    [(ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant]
}

/// Feedforward for `drive`, whose velocity is `command_gain` times what the output's scale says, under the feedback of
/// `loop_gains`, which have that factor.
#[must_use]
pub fn feedforward(
    method: Method,
    drive: &DriveParameters,
    command_gain: f64,
    loop_gains: &Gains,
    tick_s: f64,
) -> Feedforward {
    let of = |all: Feedforward| Feedforward {
        velocity: rounded(all.velocity / command_gain),
        accel_s: rounded(all.accel_s / command_gain),
        jerk_s2: rounded(all.jerk_s2 / command_gain),
        // Rounding takes no lead beyond what the kernel has room for.
        lead_s: rounded(all.lead_s).min(f64::from(PREVIEW_TICKS_MAX) * tick_s),
        tables: all.tables,
        drive: all.drive.map(|drive| DriveInverse {
            velocity_gain_per_s: rounded(drive.velocity_gain_per_s * command_gain),
            integral_time_s: rounded(drive.integral_time_s),
            current_lag_s: rounded(drive.current_lag_s),
            viscous_friction_per_s: rounded(drive.viscous_friction_per_s),
            coulomb_friction_mm_s2: rounded(drive.coulomb_friction_mm_s2),
            reversal_mm_s: drive.reversal_mm_s,
            bed: drive.bed.map(|bed| BedInverse {
                frequency_hz: rounded(bed.frequency_hz),
                damping_ratio: rounded(bed.damping_ratio),
                mass_ratio: rounded(bed.mass_ratio),
            }),
        }),
    };
    let gains = |[accel_s, jerk_s2]: [f64; 2]| Feedforward {
        velocity: 1.0,
        accel_s,
        jerk_s2,
        ..Feedforward::default()
    };
    of(match method {
        Method::Series => gains(series(drive, tick_s)),
        Method::Fit => gains(fit(drive, loop_gains, tick_s)),
        Method::Inverse => inverse(drive, tick_s),
    })
}

/// Rounds to six significant digits. No identification knows more, and the file shows the value that runs.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// S4's X axis: 1.675 ms and 6.3767·10⁻⁵ s², by polynomial division elsewhere.
    #[test]
    fn series_of_the_reference() {
        let [c1, c2] = series(&hal_sim::REFERENCE_X, 5e-4);
        assert!((c1 - 1.675e-3).abs() < 1e-9 && (c2 - 6.376_715e-5).abs() < 1e-10, "{c1:e} {c2:e}");
    }

    /// The series is the inverse's: at low frequency what it leaves is of third order.
    #[test]
    fn the_series_leaves_third_order() {
        let drive = DriveParameters { command_filter_s: 8e-4, ..hal_sim::REFERENCE_X };
        let [c1, c2] = series(&drive, 5e-4);
        let left = |hz: f64| {
            let s = Complex::new(0.0, TAU * hz);
            let inverse = Complex::new(1.0, 0.0) + Complex::new(c1, 0.0) * s + Complex::new(c2, 0.0) * s * s;
            let product = response(&drive, 5e-4, hz) * inverse;
            Complex::new(1.0 - product.re, -product.im).magnitude()
        };
        let ratio = left(0.4) / left(0.2);
        assert!((7.0..9.0).contains(&ratio), "{ratio}");
    }

    /// No neighbouring gains leave less.
    #[test]
    fn the_fit_is_the_least() {
        let drive = hal_sim::REFERENCE_Y;
        let square = |[a, j]: [f64; 2]| -> f64 {
            FITTED_HZ
                .map(|hz| {
                    let s = Complex::new(0.0, TAU * f64::from(hz));
                    let g = response(&drive, 5e-4, f64::from(hz));
                    let forward =
                        Complex::new(1.0, 0.0) + Complex::new(a, 0.0) * s + Complex::new(j, 0.0) * s * s;
                    let product = g * forward;
                    let error =
                        Complex::new(1.0 - product.re, -product.im) / (s + Complex::new(230.0, 0.0) * g);
                    error.magnitude() * error.magnitude()
                })
                .sum()
        };
        let [a, j] = fit(&drive, &Gains { kp_per_s: 230.0, ..Gains::default() }, 5e-4);
        let best = square([a, j]);
        for (da, dj) in [(1e-5, 0.0), (-1e-5, 0.0), (0.0, 1e-7), (0.0, -1e-7), (1e-5, 1e-7)] {
            assert!(square([a + da, j + dj]) > best);
        }
    }
}
