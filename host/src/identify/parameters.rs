//! The unknowns of an axis and how the search moves them.
//!
//! Everything is per unit of the inertia that was moved: with a load ρ the equations of hal-sim's drive
//! model only ever hold Kv/(1+ρ), a_lim/(1+ρ), a_c/(1+ρ) and b/(1+ρ), so a recording can't tell ρ.
//!
//! The search does not use dead time, command filter and current lag themselves. A first-order lag, in sub-steps as
//! the model takes them, delays by its mean L and blurs by the variance L² + L·h. A dead time that ends f of a
//! sub-step after its beginning is taken from both ends and blurs by f·(1 − f)·h². The search moves the sum of all
//! mean delays, which data fix best, the blur before the drive's loop, which they fix next, and the mean delay of
//! the current loop. In these every model is nearly a plane. In dead time and lags it is not: steps a hundredth too
//! long or short are all that remains of a search that goes astray in them.

use hal_sim::{BedMode, DriveParameters};

/// Number of unknowns.
pub(super) const COUNT: usize = 13;

/// The part of the filter in the sum of two lags, about a half, for which they are alike.
const ALIKE: f64 = 0.25;

/// Halvings for the filter's delay: to a picosecond.
const BISECTIONS: usize = 36;

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
    /// The mean delay of dead time, filter and current loop \[s\].
    Lag,
    /// That of the current loop \[s\].
    CurrentLag,
    /// The variance of the delay before the loop: the filter's, and what the end of the dead time adds \[s²\].
    FilterSpread,
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
    AccelLimit, BedDamping, BedFrequency, BedMassRatio, Coulomb, CurrentLag, FilterSpread, Gain,
    IntegralTime, Lag, Offset, VelocityGain, Viscous,
};

/// All unknowns, those of the bed last.
pub(super) const ALL: [Unknown; COUNT] = [
    Gain,
    Offset,
    VelocityGain,
    IntegralTime,
    Lag,
    CurrentLag,
    FilterSpread,
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

    /// Step of the difference quotients, in the search's coordinate, to either side.
    ///
    /// Not small: drives work in steps of their own, so positions are rough by a thousandth of a micrometre.
    pub(super) fn difference(self) -> f64 {
        match self {
            Gain => 1e-5,
            Offset => 1e-3,
            VelocityGain | IntegralTime | AccelLimit | BedFrequency => 2e-3,
            Lag => 5e-6,
            CurrentLag => 8e-6,
            FilterSpread => 1e-8,
            Coulomb => 0.5,
            Viscous => 0.02,
            BedDamping | BedMassRatio => 1e-3,
        }
    }

    /// From one set to another, in the search's coordinate.
    pub(super) fn distance(self, from: &Unknowns, to: &Unknowns) -> f64 {
        let (from, to) = (from.get(self), to.get(self));
        if self.is_logarithmic() { libm::log(to / from) } else { to - from }
    }

    /// The greatest step of one iteration, in the search's coordinate.
    pub(super) fn reach(self) -> f64 {
        match self {
            Gain => 0.05,
            Offset => 5.0,
            VelocityGain | IntegralTime => 0.7,
            AccelLimit => 0.3,
            Lag => 1.5e-3,
            CurrentLag => 0.5e-3,
            FilterSpread => 4e-6,
            Coulomb => 300.0,
            Viscous => 2.0,
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
pub(super) struct Unknowns {
    values: [f64; COUNT],
    /// h: the sub-step of the last stage \[s\], for which lags are told.
    step_s: f64,
}

impl Unknowns {
    /// All 0.
    pub(super) fn zero(step_s: f64) -> Self {
        Self { values: [0.0; COUNT], step_s }
    }

    pub(super) fn get(&self, unknown: Unknown) -> f64 {
        self.values[unknown as usize]
    }

    pub(super) fn set(&mut self, unknown: Unknown, value: f64) {
        self.values[unknown as usize] = value;
    }

    /// h \[s\].
    pub(super) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Least and greatest value; the search stays within. `lag_limit_s` bounds what the model can delay.
    fn range(&self, unknown: Unknown, lag_limit_s: f64) -> (f64, f64) {
        match unknown {
            Gain => (0.2, 5.0),
            Offset => (-100.0, 100.0),
            VelocityGain => (1.0, 2e4),
            IntegralTime => (1e-4, 100.0),
            Lag => (0.0, lag_limit_s),
            CurrentLag => (0.0, (self.get(Lag) - self.filter_delay_s()).max(0.0)),
            FilterSpread => (self.spread_s2(0.0), self.spread_s2(self.before_loop_s())),
            AccelLimit => (1.0, 1e6),
            Coulomb => (0.0, 1e5),
            Viscous => (0.0, 100.0),
            BedFrequency => (1.0, 160.0),
            BedDamping => (0.0, 0.9),
            BedMassRatio => (1e-6, 5.0),
        }
    }

    /// Moved by `steps`, cut to what one iteration may do and to the ranges.
    pub(super) fn moved(&self, free: &[Unknown], steps: &[f64], lag_limit_s: f64) -> Self {
        let mut next = *self;
        for (&unknown, &step) in free.iter().zip(steps) {
            let step = step.clamp(-unknown.reach(), unknown.reach());
            next = next.shifted(unknown, step);
        }
        next.bounded(free, lag_limit_s)
    }

    /// With the `free` unknowns cut to their ranges.
    pub(super) fn bounded(mut self, free: &[Unknown], lag_limit_s: f64) -> Self {
        for &unknown in free {
            let (least, most) = self.range(unknown, lag_limit_s);
            self.set(unknown, self.get(unknown).clamp(least, most.max(least)));
        }
        self
    }

    /// True if the unknown lies at its bound and a step of this sign would cross it.
    pub(super) fn is_held(&self, unknown: Unknown, step: f64, lag_limit_s: f64) -> bool {
        let (least, most) = self.range(unknown, lag_limit_s);
        let value = self.get(unknown);
        (value <= least && step < 0.0) || (value >= most && step > 0.0)
    }

    /// Moved by a step in the search's coordinate, however long and wherever it leads.
    pub(super) fn shifted(&self, unknown: Unknown, step: f64) -> Self {
        let mut next = *self;
        let value = self.get(unknown);
        next.set(unknown, if unknown.is_logarithmic() { value * libm::exp(step) } else { value + step });
        next
    }

    /// Dead time and mean delay of the filter \[s\].
    fn before_loop_s(&self) -> f64 {
        (self.get(Lag) - self.get(CurrentLag)).max(0.0)
    }

    /// The variance that goes with a mean delay of the filter \[s²\].
    fn spread_s2(&self, filter_delay_s: f64) -> f64 {
        let h = self.step_s;
        let steps = (self.before_loop_s() - filter_delay_s).max(0.0) / h;
        let part = steps - steps.floor();
        filter_delay_s * (filter_delay_s + h) + part * (1.0 - part) * h * h
    }

    /// Sets of unknowns that answer small commands alike.
    ///
    /// Filter and loop together have up to three real poles: one of 1 + Tf·s, two of Tc·s² + s + Kv. Any of them may be
    /// the filter's. Only friction and the current limit, which the filter does not pass, tell them apart, so each
    /// choice is a valley of its own.
    pub(super) fn exchanged(&self) -> Vec<Self> {
        let (filter_s, lag_s) = (self.filter_delay_s(), self.get(CurrentLag));
        let gain_per_s = self.get(VelocityGain);
        let root = 1.0 - 4.0 * gain_per_s * lag_s;
        if root <= 0.0 {
            return Vec::new();
        }
        // Time constants of the poles, 0 for one that is not there.
        let slow_s = 0.5 * (1.0 + root.sqrt()) / gain_per_s;
        let fast_s = lag_s / (gain_per_s * slow_s);
        let with = |filter_s: f64, left: [f64; 2]| {
            let sum_s = left[0] + left[1];
            // (1 + T₁·s)(1 + T₂·s) = 1 + s/Kv + Tc/Kv·s².
            let (gain, lag_s) = (sum_s.recip(), left[0] * left[1] / sum_s);
            let mut other = *self;
            for torque in [AccelLimit, Coulomb] {
                other.set(torque, self.get(torque) * gain / gain_per_s);
            }
            other.set(VelocityGain, gain);
            // The delay of all poles and the dead time stays ...
            let before_s = self.before_loop_s();
            let delay_s = (before_s + gain_per_s.recip() - gain.recip()).max(filter_s);
            other.set(Lag, delay_s + lag_s);
            // ... and so does the lag in steady motion: the delay before the loop, and b·Ti/Kv.
            let steady = self.get(Viscous) / gain_per_s + (before_s - delay_s) / self.get(IntegralTime);
            other.set(Viscous, (gain * steady).max(0.0));
            other.set(CurrentLag, lag_s);
            let spread = other.spread_s2(filter_s);
            other.set(FilterSpread, spread);
            other
        };
        // Where both are alike the valleys meet, and a search stays on the ridge between them.
        let sum_s = filter_s + fast_s;
        let part = filter_s / sum_s.max(f64::MIN_POSITIVE);
        let parts: &[f64] = if (part - 0.5).abs() < ALIKE { &[0.1, 0.9] } else { &[1.0 - part] };
        parts.iter().map(|part| with(part * sum_s, [(1.0 - part) * sum_s, slow_s])).collect()
    }

    /// The mean delay of the filter \[s\].
    pub(super) fn filter_delay_s(&self) -> f64 {
        let spread = self.get(FilterSpread);
        // The variance grows with the delay.
        let (mut least, mut most) = (0.0, self.before_loop_s());
        if self.spread_s2(least) >= spread {
            return least;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (least + most);
            if self.spread_s2(middle) < spread { least = middle } else { most = middle }
        }
        most
    }

    /// Sets dead time, filter and current lag \[s\].
    #[cfg(test)]
    pub(super) fn set_lags(&mut self, dead_time_s: f64, filter_s: f64, current_s: f64) {
        let delay_s =
            |lag_s: f64| if lag_s > 0.0 { self.step_s / libm::expm1(self.step_s / lag_s) } else { 0.0 };
        let (filter_s, current_s) = (delay_s(filter_s), delay_s(current_s));
        self.set(Lag, dead_time_s + filter_s + current_s);
        self.set(CurrentLag, current_s);
        self.set(FilterSpread, self.spread_s2(filter_s));
    }

    /// The time constant of a lag, in sub-steps, of this mean delay \[s\].
    fn time_constant_s(&self, delay_s: f64) -> f64 {
        if delay_s > 0.0 { self.step_s / libm::log1p(self.step_s / delay_s) } else { 0.0 }
    }

    /// Tf \[s\].
    pub(super) fn filter_s(&self) -> f64 {
        self.time_constant_s(self.filter_delay_s())
    }

    /// By how much its time constant tells more than the filter delays \[s\], if it is no longer than two sub-steps; else 0. There
    /// is half a sub-step in every lag's time constant, but none where there is no lag, and a filter as short as this may be none.
    pub(super) fn unresolved_filter_s(&self) -> f64 {
        let filter_s = self.filter_s();
        if filter_s <= 2.0 * self.step_s { filter_s - self.filter_delay_s() } else { 0.0 }
    }

    /// Tc \[s\].
    pub(super) fn current_lag_s(&self) -> f64 {
        self.time_constant_s(self.get(CurrentLag))
    }

    /// τ \[s\].
    pub(super) fn dead_time_s(&self) -> f64 {
        (self.get(Lag) - self.get(CurrentLag) - self.filter_delay_s()).max(0.0)
    }

    /// The drive with these values; on a rigid bed if the mass ratio is 0.
    pub(super) fn drive(&self) -> DriveParameters {
        let mass_ratio = self.get(BedMassRatio);
        DriveParameters {
            velocity_gain_per_s: self.get(VelocityGain),
            integral_time_s: self.get(IntegralTime),
            current_lag_s: self.current_lag_s(),
            dead_time_s: self.dead_time_s(),
            command_filter_s: self.filter_s(),
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

/// From one place to another, in the coordinates of the `free` unknowns.
pub(super) fn way(free: &[Unknown], from: &Unknowns, to: &Unknowns) -> Vec<f64> {
    free.iter().map(|unknown| unknown.distance(from, to)).collect()
}
