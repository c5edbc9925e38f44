//! One pulse of jerk: an edge, a plateau, and the edge mirrored.
//!
//! Consumes peak jerk, edge and length of a pulse; produces what is gained by any time in it, and the time by
//! which a feed is gained. Background: the tick's form of it is made in [`segment`](super::segment).
//!
//! The opening edge is the first half of the [`Shape`] of an arch of length 2e. On the plateau jerk is
//! constant. The closing edge is the opening one run backwards from the pulse's end, where acceleration is at
//! its peak a: with w the time left, feed is v − a·w plus what an edge gains by w.

use core::f64::consts::PI;

use super::ramp::FeedState;
use super::shape::Shape;
use crate::num::Root;

/// Newton steps after which the place in a closing edge has its last digit in f64.
const CLOSING_STEPS_MAX: usize = 8;

/// A pulse of jerk.
#[derive(Clone, Copy, Debug)]
pub(super) struct JerkPulse<R> {
    /// Peak jerk, with its sign \[mm/s³\].
    pub(super) jerk_mm_s3: R,
    /// Length of an edge \[s\].
    pub(super) edge_s: R,
    /// Length of the pulse \[s\], at least two edges.
    pub(super) duration_s: R,
}

/// Jerk times the length of an arch, once, twice and three times: the scales of its shape.
struct Scales<R> {
    accel: R,
    speed: R,
    length: R,
}

impl<R: Root> JerkPulse<R> {
    /// The length of a pulse with this peak jerk > 0 and these edges, of which two make a change of feed: P of
    /// x = Jp·P·(P − e) \[s\].
    pub(super) fn duration_for_s(jerk_mm_s3: R, edge_s: R, change_mm_s: R) -> R {
        let middle_s = edge_s.half();
        middle_s + middle_s.root_of_square_and_quotient(change_mm_s, jerk_mm_s3)
    }

    /// The length of the arch that the two edges make \[s\].
    fn arch_s(&self) -> R {
        self.edge_s + self.edge_s
    }

    fn plateau_s(&self) -> R {
        self.duration_s - self.arch_s()
    }

    fn scales(&self) -> Scales<R> {
        let accel = self.jerk_mm_s3 * self.arch_s();
        let speed = accel * self.arch_s();
        Scales { accel, speed, length: speed * self.arch_s() }
    }

    /// The acceleration gained by its end: (7).
    pub(super) fn accel_mm_s2(&self) -> R {
        self.jerk_mm_s3 * (self.duration_s - self.edge_s)
    }

    /// The feed gained by its end: (8).
    pub(super) fn speed_mm_s(&self) -> R {
        self.accel_mm_s2() * self.duration_s.half()
    }

    /// The length gained by its end: (9).
    pub(super) fn length_mm(&self) -> R {
        // Half of the acceleration times the second moment of the jerk about the end: of a box of length P −
        // e widened by an edge, around the middle.
        let half_s = self.duration_s.half();
        let wide_s = self.duration_s - self.edge_s;
        let moment = half_s * half_s
            + wide_s * wide_s * R::from_f64(1.0 / 12.0)
            + self.edge_s * self.edge_s * R::from_f64(0.25 - 2.0 / (PI * PI));
        self.accel_mm_s2().half() * moment
    }

    /// What is gained by its end, where jerk and snap are 0.
    pub(super) fn end(&self) -> FeedState<R> {
        FeedState {
            s_mm: self.length_mm(),
            v_mm_s: self.speed_mm_s(),
            a_mm_s2: self.accel_mm_s2(),
            ..FeedState::default()
        }
    }

    /// The feed gained in its closing edge: what acceleration gains at its peak, less what it is below that.
    pub(super) fn closing_mm_s(&self) -> R {
        self.accel_mm_s2() * self.edge_s - self.gained(&Shape::middle()).v_mm_s
    }

    /// What is gained `t_s` after its start, 0 … its length.
    pub(super) fn at(&self, t_s: R) -> FeedState<R> {
        let left_s = self.duration_s - t_s;
        if t_s <= self.edge_s {
            self.opening(t_s)
        } else if left_s < self.edge_s {
            self.closing(left_s)
        } else {
            self.plateau(t_s - self.edge_s)
        }
    }

    /// What is gained `t_s` after its start, in the opening edge.
    fn opening(&self, t_s: R) -> FeedState<R> {
        if t_s <= R::ZERO {
            return FeedState::default();
        }
        self.gained(&Shape::at((t_s / self.arch_s()).to_unit()))
    }

    /// What an arch has gained.
    pub(super) fn gained(&self, shape: &Shape<R::Unit>) -> FeedState<R> {
        let Scales { accel, speed, length } = self.scales();
        let snap = R::from_f64(PI).times_per(self.jerk_mm_s3, self.arch_s());
        FeedState {
            s_mm: length.scaled(shape.length),
            v_mm_s: speed.scaled(shape.speed),
            a_mm_s2: accel.scaled(shape.accel),
            j_mm_s3: self.jerk_mm_s3.scaled(shape.jerk),
            snap_mm_s4: snap.scaled(shape.snap),
        }
    }

    /// What is gained `after_s` after the plateau's start.
    fn plateau(&self, after_s: R) -> FeedState<R> {
        let third = R::from_f64(1.0 / 3.0);
        let edge = self.gained(&Shape::middle());
        let bent = self.jerk_mm_s3.half() * after_s;
        FeedState {
            s_mm: edge.s_mm + after_s * (edge.v_mm_s + after_s * (edge.a_mm_s2.half() + third * bent)),
            v_mm_s: edge.v_mm_s + after_s * (edge.a_mm_s2 + bent),
            a_mm_s2: edge.a_mm_s2 + self.jerk_mm_s3 * after_s,
            j_mm_s3: self.jerk_mm_s3,
            snap_mm_s4: R::ZERO,
        }
    }

    /// What is gained `left_s` before its end, in the closing edge.
    fn closing(&self, left_s: R) -> FeedState<R> {
        let accel = self.accel_mm_s2();
        let edge = self.opening(left_s);
        FeedState {
            s_mm: self.length_mm() - left_s * (self.speed_mm_s() - accel.half() * left_s) - edge.s_mm,
            v_mm_s: self.speed_mm_s() - (accel * left_s - edge.v_mm_s),
            a_mm_s2: accel - edge.a_mm_s2,
            j_mm_s3: edge.j_mm_s3,
            snap_mm_s4: -edge.snap_mm_s4,
        }
    }

    /// When the feed gained is `speed_mm_s`, 0 … what is gained by its end, and the length gained by then;
    /// for a pulse of positive jerk. Never too early except by rounding.
    pub(super) fn where_speed_is(&self, speed_mm_s: R) -> (R, R) {
        let Scales { speed, length, .. } = self.scales();
        let plateau_s = self.plateau_s();
        let edge = self.gained(&Shape::middle());
        if plateau_s <= R::ZERO || speed_mm_s <= edge.v_mm_s {
            let (x, shape) = Shape::where_speed_is(speed_mm_s / speed);
            return (self.arch_s() * x, length.scaled(shape.length));
        }
        let plateau_mm_s = plateau_s * (edge.a_mm_s2 + self.jerk_mm_s3.half() * plateau_s);
        let held = speed_mm_s - edge.v_mm_s;
        if held <= plateau_mm_s {
            let after_s = self.plateau_time_s(edge.a_mm_s2, held);
            return (self.edge_s + after_s, self.plateau(after_s).s_mm);
        }
        let left_s = self.closing_time_s(self.speed_mm_s() - speed_mm_s);
        (self.duration_s - left_s, self.closing(left_s).s_mm)
    }

    /// The time on the plateau by which feed has grown by `gained`, from the acceleration at its start.
    fn plateau_time_s(&self, accel_mm_s2: R, gained: R) -> R {
        // The root that loses no digits.
        let twice = gained + gained;
        let root = accel_mm_s2.root_of_squares(self.jerk_mm_s3.sqrt_product(twice));
        twice.times_per(R::ONE, accel_mm_s2 + root)
    }

    /// The time before the pulse's end at which `missing` of its feed is still to be gained, in the closing
    /// edge.
    ///
    /// Newton's method on a concave function from below: the result is never above the root except by
    /// rounding.
    fn closing_time_s(&self, missing: R) -> R {
        let accel = self.accel_mm_s2();
        let mut left_s = missing / accel;
        for _ in 0..CLOSING_STEPS_MAX {
            let edge = self.opening(left_s.min(self.edge_s));
            let next = left_s + (missing - (accel * left_s - edge.v_mm_s)) / (accel - edge.a_mm_s2);
            // `>` also ends on NaN.
            if !(next > left_s && next <= self.edge_s) {
                break;
            }
            left_s = next;
        }
        left_s
    }
}
