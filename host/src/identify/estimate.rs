//! The result of identification: estimates of an axis' parameters.

use hal_sim::{BedMode, DriveParameters};

use super::differences::rounding;
use super::fit::{Ends, FOLLOWED_WELL};
use super::harmonic_reading::{Bandwidth, HarmonicReading};
use super::step_reading::StepReading;

/// Half an interval over the value, up to which a value counts as determined.
pub const DETERMINED: f64 = 0.3;

/// Misfit for each reading up to which a model has met the recordings.
pub(super) const MET: f64 = 1.2;

/// A value with its 95 % confidence interval, from the scatter of the recordings about the model. It does not
/// contain what the model lacks: backlash, cogging, pitch errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value, in the unit of the field that holds it.
    pub value: f64,
    /// The true value lies within value ± this in 95 of 100 cases, nominally; in the same unit. May be
    /// infinite.
    pub half_width_95: f64,
}

impl Estimate {
    /// Whether the recordings fix the value: to ± 30 % or better.
    #[must_use]
    pub fn is_determined(&self) -> bool {
        self.half_width_95 <= DETERMINED * self.value.abs()
    }

    /// The upper end of the interval: all that can be said of a quantity that is not determined.
    #[must_use]
    pub fn upper(&self) -> f64 {
        self.value + self.half_width_95
    }

    /// The same in another unit.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self { value: self.value * factor, half_width_95: self.half_width_95 * factor.abs() }
    }
}

/// A bed that moves; see [`BedMode`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BedEstimate {
    /// Natural frequency of the bed alone \[Hz\].
    pub frequency_hz: Estimate,
    /// Fraction of critical damping.
    pub damping_ratio: Estimate,
    /// Moving mass over the bed's modal mass.
    pub mass_ratio: Estimate,
}

impl BedEstimate {
    /// The frequency at which the machine shakes with the moving mass on the bed: frequency/√(1 + mass ratio)
    /// \[Hz\].
    #[must_use]
    pub fn resonance_hz(&self) -> f64 {
        self.frequency_hz.value / (1.0 + self.mass_ratio.value).sqrt()
    }
}

/// Parameters of a servo axis, of the model in [`DriveParameters`].
///
/// **Inertia.** All of it is per unit of the inertia that was moved: with a load inertia ratio ρ, gains and
/// limits stand for Kv/(1+ρ), a_lim/(1+ρ), a_c/(1+ρ) and b/(1+ρ). Commands and positions can't tell ρ, and
/// nothing that is built on them needs it.
///
/// **Lags.** Dead time, command filter and current lag are found together: their sum is sharper than any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisParametersFound {
    /// Actual over nominal scale of the command: velocity = gain·command + offset, in the steady state.
    pub command_gain: Estimate,
    /// Velocity that a command of 0 stands for \[mm/s\]: drift of converter and drive input.
    pub command_offset_mm_s: Estimate,
    /// Kv: proportional gain of the drive's velocity controller over inertia \[1/s\].
    pub velocity_gain_per_s: Estimate,
    /// Ti: its integral time \[s\].
    pub integral_time_s: Estimate,
    /// τ: dead time from the output to the velocity controller \[s\].
    pub dead_time_s: Estimate,
    /// Tf: time constant of the drive's command filter \[s\]; 0 without one.
    pub command_filter_s: Estimate,
    /// Tc: lag of the current loop \[s\].
    pub current_lag_s: Estimate,
    /// τ + Tf + Tc + half a tick: how late the drive's torque follows a command that is not held over ticks
    /// \[s\].
    pub total_delay_s: Estimate,
    /// a_lim: current limit over inertia \[mm/s²\]. Not determined if no run reached it.
    pub accel_limit_mm_s2: Estimate,
    /// a_c: Coulomb friction over inertia \[mm/s²\].
    pub coulomb_friction_mm_s2: Estimate,
    /// b: viscous friction over inertia \[1/s\].
    pub viscous_friction_per_s: Estimate,
    /// ρ: added inertia over the inertia that the drive's gain was given for. No recording of commands and
    /// positions tells it: its interval is without end.
    pub load_inertia_ratio: Estimate,
    /// The bed, if the recordings show one.
    pub bed: Option<BedEstimate>,
}

impl AxisParametersFound {
    /// The values as the drive they describe, with a load inertia ratio of 0. Its command is gain·command +
    /// offset.
    #[must_use]
    pub fn drive(&self) -> DriveParameters {
        DriveParameters {
            velocity_gain_per_s: self.velocity_gain_per_s.value,
            integral_time_s: self.integral_time_s.value,
            current_lag_s: self.current_lag_s.value,
            dead_time_s: self.dead_time_s.value,
            command_filter_s: self.command_filter_s.value,
            accel_limit_mm_s2: self.accel_limit_mm_s2.value,
            load_inertia_ratio: 0.0,
            coulomb_friction_mm_s2: self.coulomb_friction_mm_s2.value,
            viscous_friction_per_s: self.viscous_friction_per_s.value,
            bed: self.bed.map(|bed| BedMode {
                frequency_hz: bed.frequency_hz.value,
                damping_ratio: bed.damping_ratio.value,
                mass_ratio: bed.mass_ratio.value,
            }),
        }
    }
}

/// Drives that the recordings allow beside the one that was found: for intervals of what is made from all parameters together.
#[derive(Clone, Debug, PartialEq)]
pub struct Alternatives {
    /// As likely as they are drawn; of a load inertia ratio of 0, as [`AxisParametersFound::drive`]. The scale of commands is
    /// known better than all else and stays what was found.
    pub drives: Vec<DriveParameters>,
    /// What deviations are to be multiplied by: 1 where the model explains the recordings.
    pub widening: f64,
}

impl Alternatives {
    /// `value` with its interval, from what it is for each of the drives: 1.96 times the root of the mean square deviation.
    #[must_use]
    pub fn estimate(&self, value: f64, others: impl IntoIterator<Item = f64>) -> Estimate {
        // What is infinite in both does not differ.
        let deviation = |other: f64| if other.total_cmp(&value).is_eq() { 0.0 } else { other - value };
        let squares: Vec<f64> = others.into_iter().map(|other| deviation(other).powi(2)).collect();
        let deviation = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        Estimate { value, half_width_95: 1.96 * self.widening * deviation }
    }
}

/// Figures read off the recordings without any model.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// The encoder's step \[mm\]: the least difference between two readings.
    pub resolution_mm: f64,
    /// The standard deviation of the readings of an axis at rest, besides rounding \[mm\].
    pub reading_noise_mm: f64,
    /// Every velocity step from rest, in the order of the runs.
    pub steps: Vec<StepReading>,
    /// Every harmonic run, in order.
    pub harmonics: Vec<HarmonicReading>,
    /// −3 dB points of the harmonic runs.
    pub bandwidths: Vec<Bandwidth>,
    /// The greatest acceleration that lasted for 5 ms, friction already overcome \[mm/s²\]. With a run that
    /// saturates the drive: what may be asked of the axis (S4).
    pub sustained_accel_mm_s2: f64,
}

impl Figures {
    /// The standard deviation of a reading's error, rounding and noise \[mm\].
    #[must_use]
    pub fn reading_error_mm(&self) -> f64 {
        (self.resolution_mm.powi(2) / 12.0 + self.reading_noise_mm.powi(2)).sqrt()
    }

    /// Whether readings have more noise than rounding.
    fn is_noisy(&self) -> bool {
        self.reading_noise_mm > rounding(self.resolution_mm)
    }
}

/// How well the model follows one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunMatch {
    /// Root of the mean square of recorded − simulated position \[mm\]. Rounding alone leaves 0.29 encoder
    /// steps.
    pub error_mm_rms: f64,
    /// The difference of the greatest and the smallest reading \[mm\].
    pub travel_mm: f64,
}

/// Everything that recordings of an axis tell. Its `Display` is for technicians.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The fitted model.
    pub parameters: AxisParametersFound,
    /// Other drives that the recordings allow.
    pub alternatives: Alternatives,
    /// Where the search ended, for one with further recordings.
    pub(super) ends: Ends,
    /// The figures that need no model.
    pub figures: Figures,
    /// The residuals by run, in the order given.
    pub runs: Vec<RunMatch>,
    /// The weighted square of what is left of the recordings, for each reading: 1 if that is the errors that
    /// readings have, and nothing else. Above 1.2 the model lacks something that the axis has, and intervals are
    /// as wide as what is left allows.
    pub misfit_per_reading: f64,
}

impl Identification {
    /// What the recordings do not show, in words.
    #[must_use]
    pub fn lacks(&self) -> Vec<&'static str> {
        let found = &self.parameters;
        let delays = [found.dead_time_s, found.command_filter_s, found.current_lag_s];
        let is_split =
            delays.iter().all(|delay| delay.half_width_95 <= DETERMINED * found.total_delay_s.value);
        let of = |is_shown: bool, words: &'static str| (!is_shown).then_some(words);
        [
            of(
                found.accel_limit_mm_s2.is_determined(),
                "no motion reached the current limit: faster steps, or steeper limits while it is recorded",
            ),
            of(found.velocity_gain_per_s.is_determined(), "Kv: changes of velocity within a few ticks"),
            of(found.integral_time_s.is_determined(), "Ti: rests after fast motion"),
            of(
                is_split,
                "dead time, command filter and current lag are not told apart: steeper steps, finer counts",
            ),
            of(
                found.coulomb_friction_mm_s2.is_determined(),
                "Coulomb friction: slow motion in both directions",
            ),
            of(
                found.viscous_friction_per_s.is_determined(),
                "viscous friction: long motion at a high velocity beside slow motion",
            ),
            Some(
                "the load inertia: commands and positions tell everything per unit of the inertia moved only",
            ),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Whether the model explains the recordings.
    #[must_use]
    pub fn is_met(&self) -> bool {
        self.misfit_per_reading < MET
    }

    /// Whether [`identify_further`](super::identify_further) gains by longer motion: the model follows, to a twentieth more than the
    /// readings' errors, and these are not rounding, which repeats itself as the motion does and averages out no further.
    #[must_use]
    pub fn gains_by_motion(&self) -> bool {
        self.misfit_per_reading < FOLLOWED_WELL && self.figures.is_noisy()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_span_the_alternatives() {
        let drive = |velocity_gain_per_s| DriveParameters { velocity_gain_per_s, ..hal_sim::REFERENCE_X };
        let alternatives = Alternatives { drives: vec![drive(439.0), drive(441.0)], widening: 3.0 };
        let others = alternatives.drives.iter().map(|drive| 2.0 * drive.velocity_gain_per_s);
        let twice = alternatives.estimate(880.0, others);
        assert!(
            (twice.half_width_95 - 3.0 * 1.96 * 2.0).abs() < 1e-12 && twice.value.total_cmp(&880.0).is_eq()
        );
        let infinite = |value: f64| alternatives.estimate(value, [f64::INFINITY; 2]).half_width_95;
        assert!(infinite(f64::INFINITY).total_cmp(&0.0).is_eq());
        assert!(infinite(5.0).is_infinite());
    }

    /// Rounding has a standard deviation of 0.29 counts.
    #[test]
    fn noise_is_more_than_rounding() {
        let figures = |reading_noise_mm| Figures {
            resolution_mm: 1e-3,
            reading_noise_mm,
            steps: Vec::new(),
            harmonics: Vec::new(),
            bandwidths: Vec::new(),
            sustained_accel_mm_s2: 0.0,
        };
        let is_noisy = [0.0, 0.28e-3, 0.30e-3, 0.8e-3].map(|noise_mm| figures(noise_mm).is_noisy());
        assert_eq!(is_noisy, [false, false, true, true]);
    }

    #[test]
    fn determined_is_relative() {
        let is_determined = |value, half_width_95| Estimate { value, half_width_95 }.is_determined();
        assert!(is_determined(-10.0, 2.9));
        assert!(!is_determined(10.0, 3.1));
        assert!(!is_determined(0.0, 1e-9));
        assert!(!is_determined(1.0, f64::NAN));
    }
}
