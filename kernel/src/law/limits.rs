//! Limits along the path, and the constants of the law that follow from them.
//!
//! Consumes the limits of a machine or of a block, and the shape of the pulses; produces a [`Law`] that
//! [`Ramp`](super::Ramp) and [`reach`](super::reach()) share. Here is the one choice between the regimes of a
//! ramp. Background.
//!
//! A change of feed x is made by a pulse of jerk of length P, a hold, and the pulse reversed. A pulse has two
//! edges of length e, each half of a sin² arch, and between them the peak jerk Jp holds for P − 2e. With
//! J' = min(J, √(2·A·DJ/π)) and e' = πJ'/(2·DJ), the shortest edge to J',
//!
//! | what limits | sin² | with a plateau |
//! |---|---|---|
//! | snap | e = P/2, P = (2πx/DJ)^⅓ | the same |
//! | jerk | e = P/2, P = √(2x/J') | e = e', P = e'/2 + √(e'²/4 + x/J') |
//! | acceleration | e = P/2, P = 2A/J' | e = e', P = A/J' + e' |
//!
//! and t₂, the end of the hold, is P or, where acceleration limits, x/A. The sin² column is S1 (22) and (23)
//! with t₁ = P. The other one is the fastest of its family.

use core::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::pulse::JerkPulse;
use super::ramp::LimitedBy;
use crate::num::Root;
use crate::work;

/// The shape of a pulse of jerk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "lowercase")]
pub enum Pulse {
    /// One sin² arch, S1 to the letter.
    Sin2,
    /// Two halves of an arch, as short as snap allows, and between them a plateau of constant jerk: faster
    /// wherever jerk limits.
    #[default]
    Plateau,
}

impl Pulse {
    /// Its name: what machine files and the command line call the law.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sin2 => "sin2",
            Self::Plateau => "plateau",
        }
    }
}

/// Limits along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits<R> {
    /// Greatest acceleration \[mm/s²\], > 0. A_max of S1.
    pub accel_mm_s2: R,
    /// Greatest jerk \[mm/s³\], > 0. J_max of S1.
    pub jerk_mm_s3: R,
    /// Greatest snap, the rate of change of jerk \[mm/s⁴\], > 0. DJ_max of S1.
    pub snap_mm_s4: R,
}

/// A limit that is not positive and finite, or beyond what the number type can plan with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LimitError {
    /// The quantity: "acceleration", "jerk" or "snap".
    pub quantity: &'static str,
    /// The value given.
    pub value: f64,
    /// Least and greatest value accepted: [`Root::LIMITS`].
    pub range: (f64, f64),
}

impl core::fmt::Display for LimitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} limit {}: expected a positive finite number", self.quantity, self.value)?;
        let (least, greatest) = self.range;
        if least > 0.0 { write!(f, " from {least} to {greatest}") } else { Ok(()) }
    }
}

impl core::error::Error for LimitError {}

impl<R: Root> Limits<R> {
    /// The smaller of each.
    #[must_use]
    pub fn least(&self, other: &Self) -> Self {
        work::add(1);
        Self {
            accel_mm_s2: self.accel_mm_s2.min(other.accel_mm_s2),
            jerk_mm_s3: self.jerk_mm_s3.min(other.jerk_mm_s3),
            snap_mm_s4: self.snap_mm_s4.min(other.snap_mm_s4),
        }
    }

    /// The greater of each.
    #[must_use]
    pub(crate) fn greatest(&self, other: &Self) -> Self {
        Self {
            accel_mm_s2: self.accel_mm_s2.max(other.accel_mm_s2),
            jerk_mm_s3: self.jerk_mm_s3.max(other.jerk_mm_s3),
            snap_mm_s4: self.snap_mm_s4.max(other.snap_mm_s4),
        }
    }

    /// Checks whether plans can be made with them.
    ///
    /// # Errors
    /// A limit is not positive and finite, or beyond [`Root::LIMITS`].
    pub(crate) fn check(&self) -> Result<(), LimitError> {
        let (least, greatest) = R::LIMITS;
        for (quantity, limit) in
            [("acceleration", self.accel_mm_s2), ("jerk", self.jerk_mm_s3), ("snap", self.snap_mm_s4)]
        {
            let value = limit.to_f64();
            if !(value > 0.0 && value.is_finite() && value >= least && value <= greatest) {
                return Err(LimitError { quantity, value, range: R::LIMITS });
            }
        }
        Ok(())
    }
}

/// The law for one set of limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law<R> {
    pulse: Pulse,
    limits: Limits<R>,
    /// J' = min(J_max, √(2·A_max·DJ_max/π)): the peak jerk of every ramp large enough for it; the
    /// first two terms of (22) \[mm/s³\].
    pub(super) jerk_mm_s3: R,
    /// 2e' = πJ'/DJ: the length of a pulse up to which snap fixes the ramp \[s\].
    pub(super) snap_time_s: R,
    /// The length of a pulse from which on acceleration fixes the ramp; with sin² pulses 2A/J', (15) \[s\].
    pub(super) accel_time_s: R,
}

/// The times of a ramp \[s\], and what fixed them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times<R> {
    /// e.
    pub(super) edge_s: R,
    /// P, t₁ of S1.
    pub(super) rise_s: R,
    /// t₂.
    pub(super) fall_start_s: R,
    pub(super) limited_by: LimitedBy,
}

impl<R: Root> Law<R> {
    /// The law for `limits`, with pulses of this shape.
    ///
    /// # Errors
    /// A limit is not positive and finite, or beyond [`Root::LIMITS`]: from 1 to 10⁹ in fixed point.
    pub fn new(pulse: Pulse, limits: Limits<R>) -> Result<Self, LimitError> {
        limits.check()?;
        Ok(Self::within(pulse, limits))
    }

    /// The law for limits that were checked before.
    #[must_use]
    pub(crate) fn within(pulse: Pulse, limits: Limits<R>) -> Self {
        let Limits { accel_mm_s2: accel, jerk_mm_s3: jerk, snap_mm_s4: snap } = limits;
        let (pi, two) = (R::from_f64(PI), R::from_f64(2.0));
        let peak = jerk.min(accel.sqrt_product(snap * R::from_f64(2.0 / PI)));
        let snap_time_s = pi.times_per(peak, snap);
        let accel_time_s = match pulse {
            Pulse::Sin2 => two.times_per(accel, peak),
            // No shorter than two edges, which it is by rounding where the plateau is empty.
            Pulse::Plateau => (accel / peak + snap_time_s.half()).max(snap_time_s),
        };
        Self { pulse, limits, jerk_mm_s3: peak, snap_time_s, accel_time_s }
    }

    /// The limits this law keeps.
    pub fn limits(&self) -> Limits<R> {
        self.limits
    }

    /// The shape of its pulses.
    #[doc(hidden)]
    pub fn pulse(&self) -> Pulse {
        self.pulse
    }

    /// The duration of a ramp that changes the feed by `change_mm_s` ≥ 0 \[s\]: t_p of (14).
    #[doc(hidden)]
    pub fn ramp_time_s(&self, change_mm_s: R) -> R {
        let Times { rise_s, fall_start_s, .. } = self.times(change_mm_s);
        rise_s + fall_start_s
    }

    /// The times of a ramp that changes the feed by `change_mm_s` ≥ 0: the one choice between the regimes. In
    /// fixed point pulses and hold are up to 8 steps (1.9 ns) too long, never too short, so the limits hold
    /// whatever the rounding. The regime is found by comparing times, because regimes may meet at changes of
    /// feed of only a few steps.
    pub(super) fn times(&self, change_mm_s: R) -> Times<R> {
        work::add(1);
        if change_mm_s <= R::ZERO {
            let (edge_s, rise_s, fall_start_s) = (R::ZERO, R::ZERO, R::ZERO);
            return Times { edge_s, rise_s, fall_start_s, limited_by: LimitedBy::Snap };
        }
        let by_jerk_s = self.by_jerk_s(change_mm_s);
        let (rise_s, limited_by) = if by_jerk_s <= self.snap_time_s {
            (change_mm_s.cbrt_quotient(self.limits.snap_mm_s4 / R::from_f64(TAU)), LimitedBy::Snap)
        } else if by_jerk_s < self.accel_time_s {
            (by_jerk_s, LimitedBy::Jerk)
        } else {
            (self.accel_time_s, LimitedBy::Acceleration)
        };
        let rise_s = rise_s.rounded_up();
        let (edge_s, rise_s) = match (self.pulse, limited_by) {
            (Pulse::Sin2, _) | (Pulse::Plateau, LimitedBy::Snap) => {
                let edge_s = rise_s.half();
                (edge_s, edge_s + edge_s)
            }
            (Pulse::Plateau, _) => (self.snap_time_s.rounded_up().half().min(rise_s.half()), rise_s),
        };
        let fall_start_s = match limited_by {
            LimitedBy::Acceleration => (change_mm_s / self.limits.accel_mm_s2).rounded_up().max(rise_s),
            LimitedBy::Jerk | LimitedBy::Snap => rise_s,
        };
        Times { edge_s, rise_s, fall_start_s, limited_by }
    }

    /// P where jerk limits \[s\].
    fn by_jerk_s(&self, change_mm_s: R) -> R {
        match self.pulse {
            Pulse::Sin2 => change_mm_s.sqrt() / self.jerk_root(),
            Pulse::Plateau => {
                JerkPulse::duration_for_s(self.jerk_mm_s3, self.snap_time_s.half(), change_mm_s)
            }
        }
    }

    /// The change of feed that a ramp without a hold makes with pulses of length `rise_s` and edges e':
    /// J'·P·(P − e') \[mm/s\]. Saturates in fixed point.
    pub(super) fn change_mm_s(&self, rise_s: R) -> R {
        // The first product is at most A.
        ((rise_s - self.snap_time_s.half()) * self.jerk_mm_s3).times_per(rise_s, R::ONE)
    }

    /// √(J'/2): P = √x/√(J'/2) where jerk fixes the sin² pulse.
    pub(super) fn jerk_root(&self) -> R {
        self.jerk_mm_s3.half().sqrt()
    }

    /// (DJ/2π)^⅓: P = x^⅓/(DJ/2π)^⅓ where snap fixes the ramp.
    pub(super) fn snap_root(&self) -> R {
        (self.limits.snap_mm_s4 / R::from_f64(TAU)).cbrt()
    }

    /// Up to this change of feed snap fixes the ramp: x₁ = J'·2e'·e' \[mm/s\].
    pub(super) fn snap_limited_to_mm_s(&self) -> R {
        self.change_mm_s(self.snap_time_s)
    }

    /// From this change of feed on acceleration fixes the ramp: x₂ = A·P \[mm/s\].
    pub(super) fn accel_limited_from_mm_s(&self) -> R {
        self.accel_time_s.times_per(self.limits.accel_mm_s2, R::ONE)
    }

    /// The length of a ramp between the two feeds \[mm\], the same up and down: (12). Saturates in fixed
    /// point.
    pub fn ramp_length_mm(&self, from_mm_s: R, to_mm_s: R) -> R {
        let time_s = self.ramp_time_s((to_mm_s - from_mm_s).abs());
        (from_mm_s + to_mm_s).half_product(time_s)
    }
}
