//! One change of feed: its peak jerk, its times, and its state at any time.
//!
//! Background: the planner chooses ramps with it, and reports evaluate it. The tick evaluates the same shapes
//! through [`FeedSegment`](super::FeedSegment), which has nothing left to divide.

#[cfg(feature = "live")]
use core::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use super::limits::{Law, Times};
use super::pulse::JerkPulse;
use crate::num::Root;
use crate::work;

/// A ramp between two feeds: a pulse of jerk, a hold, and the pulse reversed (S1, section 1). A braking ramp
/// is the accelerating one mirrored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ramp<R> {
    /// F₀ \[mm/s\], ≥ 0.
    pub from_mm_s: R,
    /// F \[mm/s\], ≥ 0.
    pub to_mm_s: R,
    /// J_p \[mm/s³\], ≥ 0; 0 if the feeds are equal.
    pub peak_jerk_mm_s3: R,
    /// e, the length of each edge of a pulse \[s\]: at most t₁/2, and just that in a sin² pulse.
    pub edge_s: R,
    /// t₁, the end of the rising phase: the length of a pulse \[s\].
    pub t1_s: R,
    /// t₂, the end of the phase of constant acceleration \[s\], ≥ t₁.
    pub t2_s: R,
    /// The limit that fixed J_p and t₁.
    pub limited_by: LimitedBy,
}

/// The limit that fixed a ramp's peak jerk and rise time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LimitedBy {
    /// Acceleration: there is a phase of constant acceleration.
    Acceleration,
    /// Jerk: the peak jerk is the jerk limit, the acceleration limit is not reached.
    Jerk,
    /// Snap: the change of feed is too small for the jerk limit.
    Snap,
}

impl LimitedBy {
    /// The limit's name, as the command line prints it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Snap => "snap",
        }
    }
}

/// The motion along the path at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeedState<R> {
    /// Length since the start of the ramp \[mm\].
    pub s_mm: R,
    /// Feed \[mm/s\].
    pub v_mm_s: R,
    /// Acceleration \[mm/s²\].
    pub a_mm_s2: R,
    /// Jerk \[mm/s³\].
    pub j_mm_s3: R,
    /// Snap \[mm/s⁴\].
    pub snap_mm_s4: R,
}

impl<R: Root> Ramp<R> {
    /// The fastest ramp of the law between two feeds ≥ 0: with sin² pulses S1 (13), (22), (23). Equal feeds
    /// give a ramp of no duration.
    #[must_use]
    pub fn new(law: &Law<R>, from_mm_s: R, to_mm_s: R) -> Self {
        let change = (to_mm_s - from_mm_s).abs();
        let Times { edge_s, rise_s: t1_s, fall_start_s: t2_s, limited_by } = law.times(change);
        let peak_jerk_mm_s3 = match limited_by {
            LimitedBy::Snap if change <= R::ZERO => R::ZERO,
            // Divided twice: the square of a short time loses its digits in fixed point.
            LimitedBy::Snap => (change.times_per(R::from_f64(2.0), t1_s) / t1_s).min(law.jerk_mm_s3),
            LimitedBy::Jerk | LimitedBy::Acceleration => law.jerk_mm_s3,
        };
        Self { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, limited_by }
    }

    /// A constant feed for `time_s`.
    #[doc(hidden)]
    #[must_use]
    pub fn cruise(feed_mm_s: R, time_s: R) -> Self {
        Self {
            from_mm_s: feed_mm_s,
            to_mm_s: feed_mm_s,
            peak_jerk_mm_s3: R::ZERO,
            edge_s: R::ZERO,
            t1_s: R::ZERO,
            t2_s: time_s,
            limited_by: LimitedBy::Snap,
        }
    }

    /// Whether the feed does not change.
    pub fn is_cruise(&self) -> bool {
        self.peak_jerk_mm_s3 <= R::ZERO
    }

    /// The same change of feed in the other direction.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self { from_mm_s: self.to_mm_s, to_mm_s: self.from_mm_s, ..self }
    }

    /// t_p \[s\]: (14).
    pub fn duration_s(&self) -> R {
        self.t1_s + self.t2_s
    }

    /// S(t_p) \[mm\]: (12).
    pub fn length_mm(&self) -> R {
        (self.from_mm_s + self.to_mm_s).half_product(self.duration_s())
    }

    /// How long a pulse holds its peak jerk \[s\]: 0 in a sin² pulse.
    pub fn plateau_s(&self) -> R {
        self.t1_s - (self.edge_s + self.edge_s)
    }

    /// The greatest acceleration \[mm/s²\], without its sign: J_p·(t₁ − e), with sin² pulses J_p·t₁/2.
    pub fn peak_accel_mm_s2(&self) -> R {
        self.peak_jerk_mm_s3 * (self.t1_s - self.edge_s)
    }

    /// The greatest snap \[mm/s⁴\]: π·J_p/(2e); 0 without edges.
    #[cfg(feature = "live")]
    pub(crate) fn peak_snap_mm_s4(&self) -> R {
        if self.edge_s <= R::ZERO {
            return R::ZERO;
        }
        R::from_f64(FRAC_PI_2).times_per(self.peak_jerk_mm_s3, self.edge_s)
    }

    /// The first of its pulses, with the sign of the change of feed.
    pub(super) fn pulse(&self) -> JerkPulse<R> {
        let jerk = self.peak_jerk_mm_s3;
        let jerk_mm_s3 = if self.to_mm_s < self.from_mm_s { -jerk } else { jerk };
        JerkPulse { jerk_mm_s3, edge_s: self.edge_s, duration_s: self.t1_s }
    }

    /// The length of a pulse with the jerk and edges of this ramp's, of which two make a change of feed
    /// > 0 \[s\].
    pub(crate) fn rise_for_s(&self, change_mm_s: R) -> R {
        JerkPulse::duration_for_s(self.peak_jerk_mm_s3, self.edge_s, change_mm_s)
    }

    /// The time of a ramp like this one that changes the feed by `change_mm_s` > 0, and its derivative, as
    /// long as the same limit fixes it \[s, s²/mm\].
    pub(crate) fn time_for_s(&self, change_mm_s: R) -> (R, R) {
        let jerk = self.peak_jerk_mm_s3;
        match self.limited_by {
            LimitedBy::Acceleration => {
                let accel = self.peak_accel_mm_s2();
                (self.t1_s + change_mm_s / accel, R::ONE / accel)
            }
            LimitedBy::Jerk if self.plateau_s() > R::ZERO => {
                let rise_s = self.rise_for_s(change_mm_s);
                (rise_s + rise_s, R::ONE / (jerk * (rise_s - self.edge_s.half())))
            }
            LimitedBy::Jerk => {
                let rise_s = ((change_mm_s + change_mm_s) / jerk).sqrt();
                (rise_s + rise_s, rise_s / change_mm_s)
            }
            LimitedBy::Snap => {
                let share = change_mm_s / (self.to_mm_s - self.from_mm_s).abs();
                let time_s = self.duration_s() * share.cbrt();
                (time_s, time_s / (R::from_f64(3.0) * change_mm_s))
            }
        }
    }

    /// How far into an accelerating ramp its feed passes `feed_mm_s` \[mm\]: 0 at its start and below, its
    /// length at its end and above. Never too short except by rounding.
    #[doc(hidden)]
    #[must_use]
    pub fn length_to_feed_mm(&self, feed_mm_s: R) -> R {
        work::add(1);
        if feed_mm_s <= self.from_mm_s {
            return R::ZERO;
        }
        if feed_mm_s >= self.to_mm_s {
            return self.length_mm();
        }
        let pulse = self.pulse();
        let (gained, left) = (feed_mm_s - self.from_mm_s, self.to_mm_s - feed_mm_s);
        let curved = pulse.speed_mm_s();
        if gained <= curved {
            let (at_s, length_mm) = pulse.where_speed_is(gained);
            self.from_mm_s * at_s + length_mm
        } else if left < curved {
            let (at_s, length_mm) = pulse.where_speed_is(left);
            self.length_mm() - (self.to_mm_s * at_s - length_mm)
        } else {
            let held_s = (gained - curved) / pulse.accel_mm_s2();
            self.from_mm_s * self.t1_s
                + pulse.length_mm()
                + held_s * (self.from_mm_s + curved + (gained - curved).half())
        }
    }

    /// The motion at `t_s` after the ramp's start: (1)–(6). Before the start it is the state at the start,
    /// after the end the state at the end, continued at constant feed. For reports; fixed point needs J_p·t₁³
    /// below 2³¹ mm.
    #[must_use]
    pub fn at(&self, t_s: R) -> FeedState<R> {
        let rest = |s_mm, v_mm_s| FeedState {
            s_mm,
            v_mm_s,
            a_mm_s2: R::ZERO,
            j_mm_s3: R::ZERO,
            snap_mm_s4: R::ZERO,
        };
        let remaining_s = self.duration_s() - t_s;
        if t_s <= R::ZERO {
            return rest(self.from_mm_s * t_s, self.from_mm_s);
        }
        if remaining_s <= R::ZERO {
            return rest(self.length_mm() - self.to_mm_s * remaining_s, self.to_mm_s);
        }
        let pulse = self.pulse();
        if t_s < self.t1_s {
            let gained = pulse.at(t_s);
            FeedState {
                s_mm: self.from_mm_s * t_s + gained.s_mm,
                v_mm_s: self.from_mm_s + gained.v_mm_s,
                ..gained
            }
        } else if remaining_s < self.t1_s {
            // The rising phase, run backwards from the end.
            let gained = pulse.at(remaining_s);
            FeedState {
                s_mm: self.length_mm() - (self.to_mm_s * remaining_s - gained.s_mm),
                v_mm_s: self.to_mm_s - gained.v_mm_s,
                j_mm_s3: -gained.j_mm_s3,
                ..gained
            }
        } else {
            let held_s = t_s - self.t1_s;
            let accel = pulse.accel_mm_s2();
            let v_start = self.from_mm_s + pulse.speed_mm_s();
            let s_start = self.from_mm_s * self.t1_s + pulse.length_mm();
            FeedState {
                s_mm: s_start + held_s * (v_start + accel.half() * held_s),
                v_mm_s: v_start + accel * held_s,
                a_mm_s2: accel,
                j_mm_s3: R::ZERO,
                snap_mm_s4: R::ZERO,
            }
        }
    }
}
