//! Limits along the path, and the constants of the law that follow from them.
//!
//! Consumes the limits of a machine or of a block; produces a [`Law`] that [`Ramp`](super::Ramp)
//! and [`reach`](super::reach()) share, so that roots are taken once per set of limits. Background.

use serde::{Deserialize, Serialize};

use crate::num::Root;

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

/// A limit that is not a positive finite number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LimitError {
    /// The quantity: "acceleration", "jerk" or "snap".
    pub quantity: &'static str,
    /// What was given.
    pub value: f64,
}

impl core::fmt::Display for LimitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} limit {}: expected a positive finite number", self.quantity, self.value)
    }
}

impl core::error::Error for LimitError {}

/// The law for one set of limits. Symbols of S1 in the fields' docs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law<R> {
    limits: Limits<R>,
    /// J' = min(J_max, √(2·A_max·DJ_max/π)): the peak jerk of every ramp large enough for it; the
    /// first two terms of (22) \[mm/s³\].
    pub(super) jerk_mm_s3: R,
    /// x₁ = π²J'³/(2·DJ²): up to this change of feed snap fixes the ramp \[mm/s\].
    pub(super) snap_limited_to_mm_s: R,
    /// x₂ = 2A²/J': from this change of feed on acceleration fixes the ramp \[mm/s\].
    pub(super) accel_limited_from_mm_s: R,
    /// c = (2π/DJ)^⅓: t₁ = c·x^⅓ when snap fixes the ramp.
    pub(super) snap_time: R,
    /// √(2/J'): t₁ = √(2/J')·√x when jerk fixes the ramp.
    pub(super) jerk_time: R,
    /// 2A/J': t₁ when acceleration fixes the ramp, (15) \[s\].
    pub(super) accel_time_s: R,
}

impl<R: Root> Law<R> {
    /// The law for `limits`.
    ///
    /// # Errors
    /// A limit is not positive and finite.
    pub fn new(limits: Limits<R>) -> Result<Self, LimitError> {
        let Limits { accel_mm_s2: accel, jerk_mm_s3: jerk, snap_mm_s4: snap } = limits;
        for (quantity, value) in [("acceleration", accel), ("jerk", jerk), ("snap", snap)] {
            if !(value > R::ZERO && value.to_f64().is_finite()) {
                return Err(LimitError { quantity, value: value.to_f64() });
            }
        }
        let pi = R::from_f64(core::f64::consts::PI);
        let two = R::from_f64(2.0);
        let peak = jerk.min((two * accel * snap / pi).sqrt());
        let ratio = pi * peak / snap;
        Ok(Self {
            limits,
            jerk_mm_s3: peak,
            snap_limited_to_mm_s: ratio * ratio * peak / two,
            accel_limited_from_mm_s: two * accel * accel / peak,
            snap_time: (two * pi / snap).cbrt(),
            jerk_time: (two / peak).sqrt(),
            accel_time_s: two * accel / peak,
        })
    }

    /// The limits this law keeps.
    pub fn limits(&self) -> Limits<R> {
        self.limits
    }

    /// The duration of a ramp that changes the feed by `change_mm_s` ≥ 0 \[s\]: t_p of (14).
    pub fn ramp_time_s(&self, change_mm_s: R) -> R {
        let (rise_s, fall_start_s) = self.times_s(change_mm_s);
        rise_s + fall_start_s
    }

    /// (t₁, t₂) of a ramp that changes the feed by `change_mm_s` ≥ 0 \[s\]: (13), (22), (23).
    pub(super) fn times_s(&self, change_mm_s: R) -> (R, R) {
        if change_mm_s <= self.snap_limited_to_mm_s {
            let rise_s = self.snap_time * change_mm_s.cbrt();
            (rise_s, rise_s)
        } else if change_mm_s < self.accel_limited_from_mm_s {
            let rise_s = self.jerk_time * change_mm_s.sqrt();
            (rise_s, rise_s)
        } else {
            (self.accel_time_s, change_mm_s / self.limits.accel_mm_s2)
        }
    }

    /// The length of path a ramp between the two feeds takes \[mm\], the same up and down: (12).
    pub fn ramp_length_mm(&self, from_mm_s: R, to_mm_s: R) -> R {
        R::from_f64(0.5) * (from_mm_s + to_mm_s) * self.ramp_time_s((to_mm_s - from_mm_s).abs())
    }
}
