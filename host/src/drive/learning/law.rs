//! The learning law, and how far it can be trusted.
//!
//! ```text
//! P = G/s / (1 + C·G/s)       from correction to position, inside the closed loop
//! L = γ·P*/(|P|² + ε²)        its inverse, weak where P is: ε = 0.05 of the greatest |P|
//! Q = 1/(1 + (√2 − 1)(f/fq)⁶) zero phase, −3 dB at fq
//! ```
//!
//! G is the drive with its bed and the scale of its commands, C the regulator's feedback. Following error is
//! e = e₀ − P·u, so with u′ = Q·(u + L·e) the correction's distance from its fixed point shrinks from repeat
//! to repeat by |Q(1 − L·P)| at every frequency (Bristow, Tharayil, Alleyne: A survey of iterative learning
//! control, IEEE Control Systems Magazine, 2006, gives the condition that it is below 1). The P in L is the
//! model's, the other P the machine's. [`Robustness`] states the greatest value over a range of machines, and
//! fq is chosen by it.

use core::f64::consts::{SQRT_2, TAU};

use hal_sim::DriveParameters;
use motion_kernel::axis::Gains;

use super::fourier;
use crate::drive::model::{Complex, feedback, response};

/// Relative deviation of the machine's drive from the model: Kv, Ti, Tc, τ and the bed's frequency, in every
/// combination.
pub const SPREAD: f64 = 0.2;
/// The law's filter is chosen so that a repeat leaves at most this fraction of a distance, on any machine in
/// the range.
pub const CONTRACTION_MAX: f64 = 0.8;
/// Order of the filter: that of the Butterworth low-pass which, run forward and backward, has its shape.
pub const FILTER_ORDER: u32 = 3;

/// ε over the greatest |P|.
const REGULARISATION: f64 = 0.05;
/// Highest −3 dB point over the rate of the knots: straight lines between knots follow it to 19 %.
const CORNER_OVER_KNOT_RATE: f64 = 0.25;
/// Ratio of successive −3 dB points that are tried.
const CORNER_STEP: f64 = 0.97;
/// Lowest −3 dB point \[Hz\]. Below it, feedback is as good as learning.
pub(super) const CORNER_HZ_MIN: f64 = 1.0;
/// Spacing of the frequencies at which the bound is computed \[Hz\].
const GRID_HZ: f64 = 0.5;
/// Stands for 0 Hz, where velocity over position has no value.
const REST_HZ: f64 = 1e-3;

/// The robustness filter Q: a low-pass without phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// The frequency at which its amplitude is 1/√2 \[Hz\], above 0.
    pub corner_hz: f64,
}

impl Filter {
    /// Its amplitude at a frequency: 1/(1 + (√2 − 1)(f/fq)^(2·[`FILTER_ORDER`])).
    #[must_use]
    pub fn at(&self, frequency_hz: f64) -> f64 {
        let ratio = frequency_hz / self.corner_hz;
        1.0 / (1.0 + (SQRT_2 - 1.0) * ratio.powi(2 * FILTER_ORDER.cast_signed()))
    }
}

/// The fraction of the distance from the learnable correction that one repeat leaves, in the linear model.
///
/// If it is below 1 at every frequency, learning can't diverge. It assumes that each machine in the range is
/// stable in closed loop, and ignores friction and the current limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robustness {
    /// Q.
    pub filter: Filter,
    /// Greatest |Q(1 − L·P)| up to half the tick's frequency, with Kv, Ti, Tc, τ and the bed's frequency each
    /// at 1 − [`SPREAD`], 1 and 1 + [`SPREAD`] of the model's.
    pub contraction: f64,
    /// The frequency of that \[Hz\].
    pub at_hz: f64,
}

/// One axis as the law sees it.
pub(super) struct Loop<'a> {
    pub(super) drive: &'a DriveParameters,
    /// Actual over nominal scale of commands.
    pub(super) command_gain: f64,
    pub(super) gains: Gains,
    pub(super) tick_s: f64,
    pub(super) knot_ticks: u16,
}

impl Loop<'_> {
    /// P \[s\] for another drive: from a correction in every tick to the position that the encoder reads at
    /// the ticks' starts.
    fn position(&self, drive: &DriveParameters, frequency_hz: f64) -> Complex {
        let one = Complex::new(1.0, 0.0);
        let frequency_hz = frequency_hz.max(REST_HZ);
        let omega = TAU * frequency_hz;
        let gain = Complex::new(self.command_gain, 0.0);
        let forward = gain * response(drive, self.tick_s, frequency_hz) / Complex::new(0.0, omega);
        forward / (one + feedback(&self.gains, self.tick_s, frequency_hz) * forward)
    }

    /// The fraction of a sine that straight lines between knots keep: sinc².
    fn interpolation(&self, frequency_hz: f64) -> f64 {
        let angle = core::f64::consts::PI * frequency_hz * self.tick_s * f64::from(self.knot_ticks);
        if angle > 0.0 { (libm::sin(angle) / angle).powi(2) } else { 1.0 }
    }

    /// The response from knots to position.
    fn learnt(&self, drive: &DriveParameters, frequency_hz: f64) -> Complex {
        self.position(drive, frequency_hz) * Complex::new(self.interpolation(frequency_hz), 0.0)
    }

    fn grid_hz(&self) -> impl Iterator<Item = f64> + use<> {
        let count = (0.5 / self.tick_s / GRID_HZ) as u32;
        (0..=count).map(|index| f64::from(index) * GRID_HZ)
    }

    /// L at a frequency.
    fn inverse(&self, frequency_hz: f64, (gain, epsilon): (f64, f64)) -> Complex {
        let learnt = self.learnt(self.drive, frequency_hz);
        let square = learnt.magnitude().powi(2) + epsilon * epsilon;
        learnt.conjugate() * Complex::new(gain / square, 0.0)
    }

    fn epsilon(&self) -> f64 {
        let greatest =
            self.grid_hz().map(|hz| self.learnt(self.drive, hz).magnitude()).fold(0.0_f64, f64::max);
        REGULARISATION * greatest
    }

    /// Greatest |1 − L·P| over all machines, by frequency.
    fn distances(&self, gain: f64) -> Vec<(f64, f64)> {
        let machines = varied(self.drive);
        let law = (gain, self.epsilon());
        let one = Complex::new(1.0, 0.0);
        self.grid_hz()
            .map(|hz| {
                let inverse = self.inverse(hz, law);
                let left = |drive| (one - inverse * self.learnt(drive, hz)).magnitude();
                (hz, machines.iter().map(left).fold(0.0_f64, f64::max))
            })
            .collect()
    }

    /// The bound with the filter given, or with the highest one that keeps [`CONTRACTION_MAX`]; if none does,
    /// with the lowest.
    pub(super) fn robustness(&self, gain: f64, corner_hz: Option<f64>) -> Robustness {
        let distances = self.distances(gain);
        let with = |corner_hz: f64| {
            let filter = Filter { corner_hz };
            let (mut contraction, mut at_hz) = (0.0_f64, 0.0);
            for &(hz, distance) in &distances {
                let left = filter.at(hz) * distance;
                // Written so that NaN is the greatest.
                if !(left <= contraction) {
                    (contraction, at_hz) = (left, hz);
                }
            }
            Robustness { filter, contraction, at_hz }
        };
        let mut found = with(corner_hz.unwrap_or(self.corner_hz_max()));
        while corner_hz.is_none()
            && !(found.contraction <= CONTRACTION_MAX)
            && found.filter.corner_hz > CORNER_HZ_MIN
        {
            found = with((found.filter.corner_hz * CORNER_STEP).max(CORNER_HZ_MIN));
        }
        found
    }

    /// The highest −3 dB point that knots can carry \[Hz\].
    pub(super) fn corner_hz_max(&self) -> f64 {
        CORNER_OVER_KNOT_RATE / (self.tick_s * f64::from(self.knot_ticks))
    }
}

/// The drives that the machine's may be.
fn varied(drive: &DriveParameters) -> Vec<DriveParameters> {
    let mut drives = vec![*drive];
    let changes: [fn(&mut DriveParameters, f64); 5] = [
        |drive, factor| drive.velocity_gain_per_s *= factor,
        |drive, factor| drive.integral_time_s *= factor,
        |drive, factor| drive.current_lag_s *= factor,
        |drive, factor| drive.dead_time_s *= factor,
        |drive, factor| {
            if let Some(bed) = &mut drive.bed {
                bed.frequency_hz *= factor;
            }
        },
    ];
    for change in changes {
        drives = drives
            .iter()
            .flat_map(|drive| {
                [1.0 - SPREAD, 1.0, 1.0 + SPREAD].map(|factor| {
                    let mut drive = *drive;
                    change(&mut drive, factor);
                    drive
                })
            })
            .collect();
        // Without a bed, the last change has no effect.
        drives.dedup();
    }
    drives
}

/// L and Q over the bins of a signal of a certain length.
pub(super) struct Law {
    inverse: Vec<Complex>,
    filter: Vec<f64>,
}

impl Law {
    /// For signals of `ticks`; their spectra are longer by at least `margin_ticks`.
    pub(super) fn new(
        axis: &Loop<'_>,
        gain: f64,
        filter: Filter,
        (ticks, margin_ticks): (usize, usize),
    ) -> Self {
        let length = (ticks + margin_ticks).next_power_of_two();
        let law = (gain, axis.epsilon());
        let bin_hz = 1.0 / (length as f64 * axis.tick_s);
        let mut inverse = vec![Complex::ZERO; length];
        let mut amplitudes = vec![0.0; length];
        for bin in 0..=length / 2 {
            let hz = bin as f64 * bin_hz;
            let (value, amplitude) = (axis.inverse(hz, law), filter.at(hz));
            let mirrored = (length - bin) % length;
            (inverse[bin], amplitudes[bin]) = (value, amplitude);
            (inverse[mirrored], amplitudes[mirrored]) = (value.conjugate(), amplitude);
        }
        Self { inverse, filter: amplitudes }
    }

    /// Q·(u + `step`·L·e) \[mm/s\] from the correction that acted and the error that it left \[mm\]. A step
    /// from 0 to 1 keeps the bound: |1 − step·L·P| is at most 1 − step + step·|1 − L·P|.
    pub(super) fn next(&self, correction_mm_s: &[f64], error_mm: &[f64], step: f64) -> Vec<f64> {
        let length = self.inverse.len();
        let correction = fourier::spectrum(&faded(correction_mm_s, length));
        let mut error = fourier::spectrum(&faded(error_mm, length));
        for (((error, correction), &inverse), &filter) in
            error.iter_mut().zip(correction).zip(&self.inverse).zip(&self.filter)
        {
            *error = (correction + inverse * *error * Complex::new(step, 0.0)) * Complex::new(filter, 0.0);
        }
        let mut next = fourier::signal(error);
        next.truncate(correction_mm_s.len());
        next
    }
}

/// A signal of another length: from its end it returns to its beginning on half a cosine, so that its
/// periodic continuation has no step to be learnt.
fn faded(signal: &[f64], length: usize) -> Vec<f64> {
    let mut longer = Vec::with_capacity(length);
    longer.extend_from_slice(signal);
    let (Some(&first), Some(&last)) = (signal.first(), signal.last()) else {
        return vec![0.0; length];
    };
    let more = length.saturating_sub(signal.len());
    longer.extend((0..more).map(|index| {
        let part = (index + 1) as f64 / (more + 1) as f64;
        first + (last - first) * 0.5 * (1.0 + libm::cos(core::f64::consts::PI * part))
    }));
    longer
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: Gains = Gains { kp_per_s: 230.0, ki_per_s2: 0.0, kd: 0.0 };

    fn reference(drive: &DriveParameters) -> Loop<'_> {
        Loop { drive, command_gain: 1.0, gains: GAINS, tick_s: 5e-4, knot_ticks: 4 }
    }

    #[test]
    fn the_filter_is_3_db_down_at_its_corner() {
        let filter = Filter { corner_hz: 80.0 };
        assert!((filter.at(80.0) - 1.0 / SQRT_2).abs() < 1e-12);
        assert!(1.0 - filter.at(20.0) < 2e-4 && filter.at(320.0) < 1e-3);
    }

    /// Slow motion: what is commanded more is held back by kp, u = kp·Δx.
    #[test]
    fn slowly_the_inverse_is_kp() {
        let axis = reference(&hal_sim::REFERENCE_X);
        let inverse = axis.inverse(0.1, (1.0, 0.0));
        assert!((inverse.magnitude() - 230.0).abs() < 0.5, "{inverse:?}");
    }

    /// A drive that moves twice as far as its commands say is held by half the gain, and learns from half the
    /// command.
    #[test]
    fn the_scale_of_commands_is_a_part_of_the_loop() {
        let once = reference(&hal_sim::REFERENCE_X);
        let gains = Gains { kp_per_s: 115.0, ..GAINS };
        let twice = Loop { command_gain: 2.0, gains, ..reference(&hal_sim::REFERENCE_X) };
        for hz in [1.0, 10.0, 60.0] {
            let (once, twice) = (once.position(once.drive, hz), twice.position(twice.drive, hz));
            let half = Complex::new(0.5, 0.0) * twice;
            assert!((once.re - half.re).abs() + (once.im - half.im).abs() < 1e-12, "{once:?} {twice:?}");
        }
    }

    /// A model that is right leaves what the filter and ε leave; a machine that is 20 % off still converges.
    #[test]
    fn the_bound_is_kept_over_the_range() {
        for drive in [&hal_sim::REFERENCE_X, &hal_sim::REFERENCE_Y] {
            let found = reference(drive).robustness(1.0, None);
            assert!(found.contraction <= CONTRACTION_MAX, "{found:?}");
            assert!(found.filter.corner_hz > 60.0, "{found:?}");
        }
        assert_eq!(varied(&hal_sim::REFERENCE_X).len(), 81);
        assert_eq!(varied(&hal_sim::REFERENCE_Y).len(), 243);
    }

    /// 20 % of a long dead time are a large phase: only a lower filter keeps the bound.
    #[test]
    fn a_slow_loop_gets_a_low_filter() {
        let slow = DriveParameters { dead_time_s: 0.0142, ..hal_sim::REFERENCE_X };
        let gains = Gains { kp_per_s: 23.0, ..GAINS };
        let found = Loop { gains, ..reference(&slow) }.robustness(1.0, None);
        assert!(found.contraction <= CONTRACTION_MAX && found.filter.corner_hz < 70.0, "{found:?}");
    }

    /// The linear loop, repeated on paper: P applied to a correction, learnt away.
    #[test]
    fn what_the_model_makes_is_learnt_away() {
        let axis = reference(&hal_sim::REFERENCE_X);
        let (ticks, length) = (1500, 2048);
        let law = Law::new(&axis, 1.0, Filter { corner_hz: 100.0 }, (ticks, 400));
        let error: Vec<f64> = (0..ticks)
            .map(|tick| {
                let part = core::f64::consts::PI * tick as f64 / ticks as f64;
                0.02 * part.sin().powi(4) * (part * 60.0).sin()
            })
            .collect();
        let response: Vec<Complex> = (0..length)
            .map(|bin| {
                let hz = bin.min(length - bin) as f64 / (length as f64 * axis.tick_s);
                let value = axis.learnt(axis.drive, hz);
                if bin > length / 2 { value.conjugate() } else { value }
            })
            .collect();
        let left = |correction: &[f64]| -> Vec<f64> {
            let bins = fourier::spectrum(&faded(correction, length));
            let moved = fourier::signal(bins.iter().zip(&response).map(|(&a, &b)| a * b).collect());
            error.iter().zip(moved).map(|(error, moved)| error - moved).collect()
        };
        let greatest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let mut correction = vec![0.0; ticks];
        for _ in 0..5 {
            correction = law.next(&correction, &left(&correction), 1.0);
        }
        let left = greatest(&left(&correction));
        assert!(left < 0.01 * greatest(&error), "{left}");
    }
}
