//! Limits along the path, and the constants of the law that follow from them.
//!
//! Consumes the limits of a machine or of a block; produces a [`Law`] that [`Ramp`](super::Ramp)
//! and [`reach`](super::reach()) share, so that roots are taken once per set of limits. Background.

use core::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::ramp::LimitedBy;
use crate::num::Root;
use crate::work;

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
    pub fn greatest(&self, other: &Self) -> Self {
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
    pub fn check(&self) -> Result<(), LimitError> {
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

    /// J' = min(J_max, √(2·A_max·DJ_max/π)): the peak jerk of every ramp large enough for it; the first two
    /// terms of (22) \[mm/s³\].
    pub(super) fn peak_jerk_mm_s3(&self) -> R {
        self.jerk_mm_s3.min(self.accel_mm_s2.sqrt_product(self.snap_mm_s4 * R::from_f64(2.0 / PI)))
    }
}

/// The law for one set of limits. Symbols of S1 in the fields' docs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law<R> {
    limits: Limits<R>,
    /// J' = min(J_max, √(2·A_max·DJ_max/π)): the peak jerk of every ramp large enough for it; the
    /// first two terms of (22) \[mm/s³\].
    pub(super) jerk_mm_s3: R,
    /// x₁ = π²J'³/(2·DJ²): up to this change of feed, snap fixes the ramp \[mm/s\].
    pub(super) snap_limited_to_mm_s: R,
    /// x₂ = 2A²/J': from this change of feed on, acceleration fixes the ramp \[mm/s\].
    pub(super) accel_limited_from_mm_s: R,
    /// (DJ/2π)^⅓: t₁ = x^⅓/(DJ/2π)^⅓ when snap fixes the ramp.
    pub(super) snap_root: R,
    /// √(J'/2): t₁ = √x/√(J'/2) when jerk fixes the ramp.
    pub(super) jerk_root: R,
    /// πJ'/DJ: t₁ of the ramp by x₁ \[s\].
    pub(super) snap_time_s: R,
    /// 2A/J': t₁ of the ramp by x₂, and when acceleration fixes the ramp, (15) \[s\].
    pub(super) accel_time_s: R,
}

impl<R: Root> Law<R> {
    /// The law for `limits`.
    ///
    /// # Errors
    /// A limit is not positive and finite, or beyond [`Root::LIMITS`]: from 1 to 10⁹ in fixed point.
    pub fn new(limits: Limits<R>) -> Result<Self, LimitError> {
        limits.check()?;
        let Limits { accel_mm_s2: accel, jerk_mm_s3: _, snap_mm_s4: snap } = limits;
        let constant = R::from_f64;
        let (pi, two) = (constant(PI), constant(2.0));
        let peak = limits.peak_jerk_mm_s3();
        let snap_time_s = pi.times_per(peak, snap);
        let accel_time_s = two.times_per(accel, peak);
        Ok(Self {
            limits,
            jerk_mm_s3: peak,
            // The first product is below A.
            snap_limited_to_mm_s: (snap_time_s * (peak / two)).times_per(snap_time_s, R::ONE),
            accel_limited_from_mm_s: accel_time_s.times_per(accel, R::ONE),
            snap_root: (snap / constant(TAU)).cbrt(),
            jerk_root: (peak / two).sqrt(),
            snap_time_s,
            accel_time_s,
        })
    }

    /// The limits this law keeps.
    pub fn limits(&self) -> Limits<R> {
        self.limits
    }

    /// The duration of a ramp that changes the feed by `change_mm_s` ≥ 0 \[s\]: t_p of (14).
    pub fn ramp_time_s(&self, change_mm_s: R) -> R {
        let (rise_s, fall_start_s, _) = self.times_s(change_mm_s);
        rise_s + fall_start_s
    }

    /// (t₁, t₂) of a ramp that changes the feed by `change_mm_s` ≥ 0 \[s\], and what fixed them: (13), (22),
    /// (23). In fixed point they are up to 8 steps (1.9 ns) too long, never too short, so the limits hold
    /// whatever the rounding. The regime is found by comparing times, because regimes may meet at changes of
    /// feed of only a few steps.
    pub(super) fn times_s(&self, change_mm_s: R) -> (R, R, LimitedBy) {
        work::add(1);
        if change_mm_s <= R::ZERO {
            return (R::ZERO, R::ZERO, LimitedBy::Snap);
        }
        let by_jerk_s = change_mm_s.sqrt() / self.jerk_root;
        if by_jerk_s <= self.snap_time_s {
            let rise_s = change_mm_s.cbrt() / self.snap_root + R::MARGIN;
            (rise_s, rise_s, LimitedBy::Snap)
        } else if by_jerk_s < self.accel_time_s {
            let rise_s = by_jerk_s + R::MARGIN;
            (rise_s, rise_s, LimitedBy::Jerk)
        } else {
            let rise_s = self.accel_time_s + R::MARGIN;
            let fall_start_s = change_mm_s / self.limits.accel_mm_s2 + R::MARGIN;
            (rise_s, fall_start_s.max(rise_s), LimitedBy::Acceleration)
        }
    }

    /// The length of a ramp between the two feeds \[mm\], the same up and down: (12). Saturates in fixed
    /// point.
    pub fn ramp_length_mm(&self, from_mm_s: R, to_mm_s: R) -> R {
        let time_s = self.ramp_time_s((to_mm_s - from_mm_s).abs());
        (from_mm_s + to_mm_s).times_per(time_s, R::from_f64(2.0))
    }
}
