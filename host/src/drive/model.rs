//! The linear model of an axis, for small signals: its drive without Coulomb friction and current limit, and its regulator.

use core::f64::consts::TAU;
use core::ops::{Add, Div, Mul, Sub};

use hal_sim::DriveParameters;
use motion_kernel::axis::Gains;

/// A complex number, as far as responses need it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// 0.
    pub const ZERO: Self = Self::new(0.0, 0.0);

    /// `re` + i·`im`.
    #[must_use]
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// |z|.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        libm::hypot(self.re, self.im)
    }

    /// arg z \[rad\], −π to π.
    #[must_use]
    pub fn phase_rad(self) -> f64 {
        libm::atan2(self.im, self.re)
    }

    /// re − i·im.
    #[must_use]
    pub const fn conjugate(self) -> Self {
        Self::new(self.re, -self.im)
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        self * Self::new(other.re / square, -other.im / square)
    }
}

/// Actual over commanded velocity at a frequency above 0, the command held over ticks of `tick_s`:
///
/// ```text
/// G = e^(−s(τ + Ts/2))/(1 + Tf·s) · H/(1 + H),   H = Kv(1 + 1/(Ti·s))/((1 + Tc·s)((1 + ρ)(1 + B)s + b))
/// ```
///
/// The bed accelerates by B = −μs²/((1 + μ)s² + 2ζωs + ω²) of what the axis does.
#[must_use]
pub fn response(drive: &DriveParameters, tick_s: f64, frequency_hz: f64) -> Complex {
    let real = |value: f64| Complex::new(value, 0.0);
    let s = Complex::new(0.0, TAU * frequency_hz);
    let one = real(1.0);
    let controller = real(drive.velocity_gain_per_s) * (one + one / (real(drive.integral_time_s) * s));
    let current = one + real(drive.current_lag_s) * s;
    let bed = drive.bed.map_or(Complex::ZERO, |bed| {
        let omega = TAU * bed.frequency_hz;
        let damped = real(2.0 * bed.damping_ratio * omega) * s + real(omega * omega);
        real(-bed.mass_ratio) * s * s / (real(1.0 + bed.mass_ratio) * s * s + damped)
    });
    let axis = real(1.0 + drive.load_inertia_ratio) * (one + bed) * s + real(drive.viscous_friction_per_s);
    let open = controller / (current * axis);
    let (sine, cosine) = libm::sincos(-TAU * frequency_hz * (drive.dead_time_s + 0.5 * tick_s));
    let filter = one + real(drive.command_filter_s) * s;
    Complex::new(cosine, sine) / filter * (open / (one + open))
}

/// Velocity command over following error at a frequency above 0: the regulator with its sum and its difference over
/// ticks of `tick_s`.
///
/// ```text
/// C = kp + ki·Ts/(1 − z⁻¹) + kd·(1 − z⁻¹)/Ts,   z = e^(s·Ts)
/// ```
#[must_use]
pub fn feedback(gains: &Gains, tick_s: f64, frequency_hz: f64) -> Complex {
    let real = |value: f64| Complex::new(value, 0.0);
    let (sine, cosine) = libm::sincos(-TAU * frequency_hz * tick_s);
    let change = real(1.0) - Complex::new(cosine, sine);
    real(gains.kp_per_s) + real(gains.ki_per_s2 * tick_s) / change + real(gains.kd / tick_s) * change
}

/// The frequency at which the linear model's amplitude falls below `ratio` for good \[Hz\], to 0.1 Hz; none
/// up to half the tick's frequency.
#[must_use]
pub fn bandwidth_hz(drive: &DriveParameters, tick_s: f64, ratio: f64) -> Option<f64> {
    let at = |tenths: u32| f64::from(tenths) / 10.0;
    (1..(5.0 / tick_s) as u32)
        .rev()
        .find(|&tenths| response(drive, tick_s, at(tenths)).magnitude() >= ratio)
        .map(|last| at(last + 1))
        .filter(|&hz| hz < 0.5 / tick_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slow motion lags by the first term of the inverse series, τ + Ts/2 + b·Ti/Kv = 1.675 ms.
    #[test]
    fn slow_motion_lags_by_the_series_first_term() {
        let found = response(&hal_sim::REFERENCE_X, 5e-4, 0.02);
        assert!((-found.phase_rad() / (TAU * 0.02) - 1.675e-3).abs() < 1e-6);
        assert!((found.magnitude() - 1.0).abs() < 1e-3);
    }
}
