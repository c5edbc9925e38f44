//! The unknowns of an axis and how the search moves them.
//!
//! Everything is per unit of the inertia that was moved: with a load ρ the equations of hal-sim's drive
//! model only ever hold Kv/(1+ρ), a_lim/(1+ρ), a_c/(1+ρ) and b/(1+ρ), so a recording can't tell ρ.
//!
//! The search does not use dead time and current lag themselves but their sum, which data fix well, and the
//! current lag, which they fix less well.

use hal_sim::{BedMode, DriveParameters};

/// Number of unknowns.
pub(super) const COUNT: usize = 12;

/// An unknown, by its place in [`Unknowns`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unknown {
    /// Command gain: actual over nominal.
    Gain,
    /// Velocity at command 0 \[mm/s\].
    Offset,
    /// Kv \[1/s\].
    VelocityGain,
    /// Ti \[s\].
    IntegralTime,
    /// τ + Tc \[s\].
    Lag,
    /// Tc \[s\].
    CurrentLag,
    /// \[mm/s²\].
    AccelLimit,
    /// \[mm/s²\].
    Coulomb,
    /// \[1/s\].
    Viscous,
    /// \[Hz\].
    BedFrequency,
    /// 1.
    BedDamping,
    /// 1.
    BedMassRatio,
}

use Unknown::{
    AccelLimit, BedDamping, BedFrequency, BedMassRatio, Coulomb, CurrentLag, Gain, IntegralTime, Lag, Offset,
    VelocityGain, Viscous,
};

/// All unknowns, those of the bed last.
pub(super) const ALL: [Unknown; COUNT] = [
    Gain,
    Offset,
    VelocityGain,
    IntegralTime,
    Lag,
    CurrentLag,
    AccelLimit,
    Coulomb,
    Viscous,
    BedFrequency,
    BedDamping,
    BedMassRatio,
];

/// The parameters of an axis on a rigid bed.
pub(super) fn without_bed() -> &'static [Unknown] {
    &ALL[..COUNT - 3]
}

impl Unknown {
    /// Positive quantities of unknown size are searched by their logarithm.
    fn is_logarithmic(self) -> bool {
        matches!(self, Gain | VelocityGain | IntegralTime | AccelLimit | BedFrequency)
    }

    /// Step of the difference quotients, in the search's coordinate.
    ///
    /// Large: the model's limits act from sub-step to sub-step, so its positions are rough by about 1 µm
    /// where a run saturates. Roughness over a small step would pass for sensitivity.
    pub(super) fn difference(self) -> f64 {
        match self {
            Gain => 1e-3,
            Offset => 0.1,
            VelocityGain | IntegralTime | AccelLimit => 0.02,
            Lag => 5e-5,
            CurrentLag => 5e-5,
            Coulomb => 15.0,
            Viscous => 0.5,
            BedFrequency | BedDamping | BedMassRatio => 0.005,
        }
    }

    /// The greatest step of one iteration, in the search's coordinate.
    fn reach(self) -> f64 {
        match self {
            Gain => 0.05,
            Offset => 5.0,
            VelocityGain | IntegralTime => 0.7,
            AccelLimit => 0.3,
            Lag => 1.5e-3,
            CurrentLag => 0.5e-3,
            Coulomb => 300.0,
            Viscous => 1.0,
            BedFrequency => 0.1,
            BedDamping => 0.05,
            BedMassRatio => 0.1,
        }
    }
}

impl Unknown {
    /// Standard deviation before any run was seen, in the search's coordinate.
    pub(super) fn ignorance(self) -> f64 {
        20.0 * self.reach()
    }
}

/// A value for every unknown, in the units of [`Unknown`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unknowns(pub(super) [f64; COUNT]);

impl Unknowns {
    pub(super) fn get(&self, unknown: Unknown) -> f64 {
        self.0[unknown as usize]
    }

    pub(super) fn set(&mut self, unknown: Unknown, value: f64) {
        self.0[unknown as usize] = value;
    }

    /// Least and greatest value; the search stays within. `lag_limit_s` bounds what the model can delay.
    fn range(&self, unknown: Unknown, lag_limit_s: f64) -> (f64, f64) {
        match unknown {
            Gain => (0.2, 5.0),
            Offset => (-100.0, 100.0),
            VelocityGain => (1.0, 2e4),
            IntegralTime => (1e-4, 100.0),
            Lag => (self.get(CurrentLag), lag_limit_s),
            CurrentLag => (0.0, self.get(Lag)),
            AccelLimit => (1.0, 1e6),
            Coulomb => (0.0, 1e5),
            Viscous => (0.0, 100.0),
            BedFrequency => (1.0, 200.0),
            BedDamping => (0.0, 0.9),
            BedMassRatio => (1e-6, 5.0),
        }
    }

    /// Moved by `steps`, cut to what one iteration may do and to the ranges.
    pub(super) fn moved(&self, free: &[Unknown], steps: &[f64], lag_limit_s: f64) -> Self {
        let mut next = *self;
        for (&unknown, &step) in free.iter().zip(steps) {
            let step = step.clamp(-unknown.reach(), unknown.reach());
            let value = self.get(unknown);
            next.set(unknown, if unknown.is_logarithmic() { value * step.exp() } else { value + step });
        }
        for &unknown in free {
            let (least, most) = next.range(unknown, lag_limit_s);
            next.set(unknown, next.get(unknown).clamp(least, most.max(least)));
        }
        next
    }

    /// True if the unknown lies at its bound and a step of this sign would cross it.
    pub(super) fn is_held(&self, unknown: Unknown, step: f64, lag_limit_s: f64) -> bool {
        let (least, most) = self.range(unknown, lag_limit_s);
        let value = self.get(unknown);
        (value <= least && step < 0.0) || (value >= most && step > 0.0)
    }

    /// The standard deviation in the unit of the value from one in the search's coordinate.
    pub(super) fn deviation(&self, unknown: Unknown, deviation: f64) -> f64 {
        if unknown.is_logarithmic() { self.get(unknown) * deviation } else { deviation }
    }

    /// The drive with these values; on a rigid bed if the mass ratio is 0.
    pub(super) fn drive(&self) -> DriveParameters {
        let mass_ratio = self.get(BedMassRatio);
        DriveParameters {
            velocity_gain_per_s: self.get(VelocityGain),
            integral_time_s: self.get(IntegralTime),
            current_lag_s: self.get(CurrentLag),
            dead_time_s: (self.get(Lag) - self.get(CurrentLag)).max(0.0),
            command_filter_s: 0.0,
            accel_limit_mm_s2: self.get(AccelLimit),
            load_inertia_ratio: 0.0,
            coulomb_friction_mm_s2: self.get(Coulomb),
            viscous_friction_per_s: self.get(Viscous),
            bed: (mass_ratio > 0.0).then(|| BedMode {
                frequency_hz: self.get(BedFrequency),
                damping_ratio: self.get(BedDamping),
                mass_ratio,
            }),
        }
    }
}
