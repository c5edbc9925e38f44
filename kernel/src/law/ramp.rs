//! One change of feed: its peak jerk, its times, and its state at any time.
//!
//! Background: the planner chooses ramps with it, and reports evaluate it. The tick evaluates the same shapes
//! through [`FeedSegment`](super::FeedSegment), which has nothing left to divide.

use serde::{Deserialize, Serialize};

use super::limits::{Law, Limits};
use super::shape::Shape;
use crate::num::{Root, Scalar};
use crate::work;

/// A ramp between two feeds (S1, section 1). A braking ramp is the accelerating one mirrored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ramp<R> {
    /// F₀ \[mm/s\], ≥ 0.
    pub from_mm_s: R,
    /// F \[mm/s\], ≥ 0.
    pub to_mm_s: R,
    /// J_p \[mm/s³\], ≥ 0; 0 if the feeds are equal.
    pub peak_jerk_mm_s3: R,
    /// t₁, the end of the rising phase \[s\].
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
    /// The fastest ramp of the law between two feeds ≥ 0: S1 (13), (22), (23). Equal feeds give a
    /// ramp of no duration.
    #[must_use]
    pub fn new(law: &Law<R>, from_mm_s: R, to_mm_s: R) -> Self {
        let change = (to_mm_s - from_mm_s).abs();
        let (t1_s, t2_s, limited_by) = law.times_s(change);
        let peak_jerk_mm_s3 = match limited_by {
            LimitedBy::Snap if change <= R::ZERO => R::ZERO,
            // Divided twice: the square of a short time loses its digits in fixed point.
            LimitedBy::Snap => (change.times_per(R::from_f64(2.0), t1_s) / t1_s).min(law.jerk_mm_s3),
            LimitedBy::Jerk | LimitedBy::Acceleration => law.jerk_mm_s3,
        };
        Self { from_mm_s, to_mm_s, peak_jerk_mm_s3, t1_s, t2_s, limited_by }
    }

    /// As [`new`](Self::new) for the law of `limits` > 0, but for rounding. Cheaper than making that law for
    /// one ramp, most of all if acceleration fixes the ramp.
    #[must_use]
    pub fn within(limits: &Limits<R>, from_mm_s: R, to_mm_s: R) -> Self {
        work::add(1);
        let change = (to_mm_s - from_mm_s).abs();
        let (accel, snap) = (limits.accel_mm_s2, limits.snap_mm_s4);
        let (pi, two) = (R::from_f64(core::f64::consts::PI), R::from_f64(2.0));
        let jerk = limits.peak_jerk_mm_s3();
        let (rise_s, fall_start_s) = (two.times_per(accel, jerk), change / accel);
        if fall_start_s >= rise_s {
            return Self {
                from_mm_s,
                to_mm_s,
                peak_jerk_mm_s3: jerk,
                t1_s: rise_s + R::MARGIN,
                t2_s: fall_start_s + R::MARGIN,
                limited_by: LimitedBy::Acceleration,
            };
        }
        let by_jerk_s = change.sqrt() / (jerk / two).sqrt();
        let (rise_s, peak_jerk_mm_s3, limited_by) = if change <= R::ZERO {
            (R::ZERO, R::ZERO, LimitedBy::Snap)
        } else if by_jerk_s <= pi.times_per(jerk, snap) {
            let rise_s = change.times_per(pi + pi, snap).cbrt() + R::MARGIN;
            (rise_s, (change.times_per(two, rise_s) / rise_s).min(jerk), LimitedBy::Snap)
        } else {
            (by_jerk_s + R::MARGIN, jerk, LimitedBy::Jerk)
        };
        Self { from_mm_s, to_mm_s, peak_jerk_mm_s3, t1_s: rise_s, t2_s: rise_s, limited_by }
    }

    /// A constant feed for `time_s`.
    #[must_use]
    pub fn cruise(feed_mm_s: R, time_s: R) -> Self {
        Self {
            from_mm_s: feed_mm_s,
            to_mm_s: feed_mm_s,
            peak_jerk_mm_s3: R::ZERO,
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
        (self.from_mm_s + self.to_mm_s).times_per(self.duration_s(), R::from_f64(2.0))
    }

    /// The greatest acceleration \[mm/s²\], without its sign: J_p·t₁/2.
    pub fn peak_accel_mm_s2(&self) -> R {
        self.peak_jerk_mm_s3.times_per(self.t1_s, R::from_f64(2.0))
    }

    /// J_p with the sign of the change of feed.
    pub(super) fn signed_jerk_mm_s3(&self) -> R {
        if self.to_mm_s < self.from_mm_s { -self.peak_jerk_mm_s3 } else { self.peak_jerk_mm_s3 }
    }

    /// How far into an accelerating ramp its feed passes `feed_mm_s` \[mm\]: 0 at its start and below, its
    /// length at its end and above. Never too short except by rounding.
    #[must_use]
    pub fn length_to_feed_mm(&self, feed_mm_s: R) -> R {
        work::add(1);
        if feed_mm_s <= self.from_mm_s {
            return R::ZERO;
        }
        if feed_mm_s >= self.to_mm_s {
            return self.length_mm();
        }
        let (rise_s, jerk) = (self.t1_s, self.peak_jerk_mm_s3);
        let speed_scale = jerk * rise_s * rise_s;
        let length_scale = speed_scale * rise_s;
        let (gained, left) = (feed_mm_s - self.from_mm_s, self.to_mm_s - feed_mm_s);
        let curved = speed_scale * R::from_f64(Shape::END.speed);
        if gained <= curved {
            let (x, shape) = Shape::where_speed_is(gained / speed_scale);
            self.from_mm_s * (rise_s * x) + length_scale.scaled(shape.length)
        } else if left < curved {
            let (x, shape) = Shape::where_speed_is(left / speed_scale);
            self.length_mm() - (self.to_mm_s * (rise_s * x) - length_scale.scaled(shape.length))
        } else {
            let held_s = (gained - curved) / (jerk * rise_s * R::from_f64(Shape::END.accel));
            let half = R::from_f64(0.5);
            self.from_mm_s * rise_s
                + length_scale * R::from_f64(Shape::END.length)
                + held_s * (self.from_mm_s + curved + half * (gained - curved))
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
        let (rise_s, jerk) = (self.t1_s, self.signed_jerk_mm_s3());
        let accel_scale = jerk * rise_s;
        let speed_scale = accel_scale * rise_s;
        let length_scale = speed_scale * rise_s;
        let snap_scale = R::from_f64(core::f64::consts::PI).times_per(jerk, rise_s);
        if t_s < rise_s {
            let shape = Shape::at((t_s / rise_s).to_unit());
            FeedState {
                s_mm: self.from_mm_s * t_s + length_scale.scaled(shape.length),
                v_mm_s: self.from_mm_s + speed_scale.scaled(shape.speed),
                a_mm_s2: accel_scale.scaled(shape.accel),
                j_mm_s3: jerk.scaled(shape.jerk),
                snap_mm_s4: snap_scale.scaled(shape.snap),
            }
        } else if remaining_s < rise_s {
            // The rising phase, run backwards from the end.
            let shape = Shape::at((remaining_s / rise_s).to_unit());
            FeedState {
                s_mm: self.length_mm() - (self.to_mm_s * remaining_s - length_scale.scaled(shape.length)),
                v_mm_s: self.to_mm_s - speed_scale.scaled(shape.speed),
                a_mm_s2: accel_scale.scaled(shape.accel),
                j_mm_s3: -(jerk.scaled(shape.jerk)),
                snap_mm_s4: snap_scale.scaled(shape.snap),
            }
        } else {
            let end = Shape::at(R::Unit::ONE);
            let held_s = t_s - rise_s;
            let accel = accel_scale.scaled(end.accel);
            let v_start = self.from_mm_s + speed_scale.scaled(end.speed);
            let s_start = self.from_mm_s * rise_s + length_scale.scaled(end.length);
            FeedState {
                s_mm: s_start + held_s * (v_start + R::from_f64(0.5) * accel * held_s),
                v_mm_s: v_start + accel * held_s,
                a_mm_s2: accel,
                j_mm_s3: R::ZERO,
                snap_mm_s4: R::ZERO,
            }
        }
    }
}
