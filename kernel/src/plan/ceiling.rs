//! Stage 1: the ceiling of one block, from the machine's limits and the block's geometry.
//!
//! On a curve every axis accelerates even at constant feed. With κ = |r''|, κ' = |r'''| and
//! κ'' = |r''''| by arc length, the vectors' tangential and normal parts are
//!
//! ```text
//! acceleration   a                       κ·v²
//! jerk           j − κ'·v³               3κ·v·a
//! snap           s − 6κ'·v²·a            κ''·v⁴ − 3κ·a² − 4κ·v·j
//! ```
//!
//! At v = √(A/κ) nothing is left to change the feed with, so the budget has to be **shared**: a curve is
//! driven at a share of the feed that would use it up ([`MachineLimits::curve_feed_share`]), and ramps on it
//! get limits with which the sums above stay within the machine's limits even at that feed. All terms grow
//! with v, a and j, so the sums are smaller at any lower feed.

use crate::law::{Law, LimitError, Limits, Pulse};
use crate::num::Root;

/// A good value for [`MachineLimits::curve_feed_share`]: it costs a fifth of the feed on a long arc and
/// leaves three quarters of the acceleration, and a third of the jerk, for ramps at its very top.
pub const CURVE_FEED_SHARE: f64 = 0.8;
/// The greatest share that leaves enough of every limit for ramps on curves of any length.
pub const CURVE_FEED_SHARE_MAX: f64 = 0.85;
/// The share for a short curve between straighter ones, where the feed need not change: a hundredth of the
/// limits is left for ramps.
pub const BLEND_FEED_SHARE: f64 = 0.995;
/// Share of the jerk limit that ramps may use across the path, 3κ·v·a.
const NORMAL_JERK_SHARE: f64 = 0.55;
/// Shares of the snap limit that ramps may use: 3κ·a² and 4κ·v·j across, 6κ'·v²·a along the path.
const NORMAL_SNAP_SHARES: (f64, f64) = (0.1, 0.3);
const TANGENTIAL_SNAP_SHARE: f64 = 0.2;
/// The same shares across the path, of what constant feed leaves, where that is less.
const NORMAL_SNAP_REST_SHARES: (f64, f64) = (0.21, 0.63);

/// The limits of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits<R> {
    /// Greatest velocity \[mm/s\].
    pub feed_mm_s: R,
    /// Greatest acceleration, jerk and snap.
    pub limits: Limits<R>,
}

/// The limits of the machine: along the path, and of each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineLimits<R, const AXES: usize> {
    /// The path's: feed, and the magnitudes of the vectors of acceleration, jerk and snap.
    pub path: AxisLimits<R>,
    /// Each axis'.
    pub axes: [AxisLimits<R>; AXES],
    /// The shape of the pulses of jerk that change the feed.
    pub pulse: Pulse,
    /// Share of a curve's greatest feed that blocks are planned with, above 0 and at most
    /// [`CURVE_FEED_SHARE_MAX`]; the rest of the limits is for changing the feed on the curve.
    pub curve_feed_share: R,
}

impl<R: Root, const AXES: usize> MachineLimits<R, AXES> {
    /// The acceleration, jerk and snap that the path and every axis allow in any direction.
    #[must_use]
    pub fn in_any_direction(&self) -> Limits<R> {
        self.axes.iter().fold(self.path.limits, |limits, axis| least(&limits, &axis.limits, R::ONE))
    }
}

/// How a block bends. It holds the derivatives' roots, because R⁻³ of a radius of 1 m has no digits left in
/// fixed point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bend<R> {
    /// κ, greatest |r''| \[1/mm\]; 0 for a line. R⁻¹ for an arc.
    pub curvature_per_mm: R,
    /// √κ', of the greatest |r'''| \[1/mm\]. R⁻¹ for an arc.
    pub third_root_per_mm: R,
    /// ∛κ'', of the greatest |r''''| \[1/mm\]. R⁻¹ for an arc.
    pub fourth_root_per_mm: R,
}

impl<R: Root> Bend<R> {
    /// A circle of `radius_mm` > 0, driven with `planar` (0 … 1] of the path's length in its plane: 1 for an
    /// arc, less for a helix. In fixed point the bend is up to 2·10⁻⁹ per mm larger, never smaller: at a
    /// radius of 1 m a ceiling is lower by 10⁻⁶, relative.
    #[must_use]
    pub fn circle(radius_mm: R, planar: R) -> Self {
        let turn = planar / radius_mm;
        // A quotient beyond the type's range has already saturated.
        let is_small = turn <= R::from_f64(R::LIMITS.1);
        let more = |bend: R| if is_small { bend.rounded_up() } else { bend };
        Self {
            curvature_per_mm: more(planar * turn),
            third_root_per_mm: more(planar.sqrt() * turn),
            fourth_root_per_mm: more(planar.cbrt() * turn),
        }
    }
}

/// The reason for a block's feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// The program's feed.
    Programmed,
    /// The machine's greatest feed along the path.
    PathFeed,
    /// The greatest velocity of an axis.
    AxisFeed,
    /// Acceleration across the path: κ·v².
    Acceleration,
    /// Jerk along the path: κ'·v³.
    Jerk,
    /// Snap across the path: κ''·v⁴.
    Snap,
    /// The block is too short to reach its ceiling and brake to its exit feed.
    Braking,
    /// The block is too short to accelerate to its ceiling.
    Accelerating,
}

impl Reason {
    /// The reason in one or two words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Programmed => "programmed",
            Self::PathFeed => "path feed",
            Self::AxisFeed => "axis feed",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Snap => "snap",
            Self::Braking => "braking",
            Self::Accelerating => "accelerating",
        }
    }
}

/// A block's ceiling and the law its ramps follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceiling<R> {
    /// Greatest feed \[mm/s\].
    pub feed_mm_s: R,
    /// The reason for it.
    pub reason: Reason,
    /// The limits left for changing the feed.
    pub law: Law<R>,
}

impl<R: Root> Ceiling<R> {
    /// The ceiling of a block.
    ///
    /// `feed_mm_s` is the programmed feed, infinite for a rapid. `tangent` holds the greatest
    /// |component| of the unit tangent on each axis, `curved` whether the axis takes part in the bend.
    ///
    /// # Errors
    /// A limit of the machine, or the part of it that a bend leaves for ramps, is not positive and finite, or
    /// beyond [`Root::LIMITS`].
    pub fn new<const AXES: usize>(
        machine: &MachineLimits<R, AXES>,
        feed_mm_s: R,
        tangent: &[R; AXES],
        curved: &[bool; AXES],
        bend: &Bend<R>,
    ) -> Result<Self, LimitError> {
        let path = &machine.path;
        path.limits.check()?;
        for axis in &machine.axes {
            axis.limits.check()?;
        }
        // Along the path, and across it in the plane of the bend.
        let (mut along, mut across) = (path.limits, path.limits);
        let (mut feed, mut reason) = (feed_mm_s, Reason::Programmed);
        let mut lower = |candidate: R, why: Reason| {
            if candidate < feed {
                (feed, reason) = (candidate, why);
            }
        };
        lower(path.feed_mm_s, Reason::PathFeed);
        for ((axis, &component), &curved) in machine.axes.iter().zip(tangent).zip(curved) {
            if curved {
                across = least(&across, &axis.limits, R::ONE);
            }
            if component > R::ZERO {
                lower(axis.feed_mm_s / component, Reason::AxisFeed);
                along = least(&along, &axis.limits, component);
            }
        }
        let kappa = bend.curvature_per_mm;
        if kappa <= R::ZERO {
            return Ok(Self { feed_mm_s: feed, reason, law: Law::new(machine.pulse, along)? });
        }
        let along = least(&along, &across, R::ONE);
        let (accel, jerk, snap) = (across.accel_mm_s2, across.jerk_mm_s3, across.snap_mm_s4);
        let share = machine.curve_feed_share;
        // With radii, v² = A·R, v³ = J·R², v⁴ = DJ·R³; the root of each product is taken.
        let bends = [kappa, bend.third_root_per_mm, bend.fourth_root_per_mm];
        let [r1, r2, r3] = bends.map(|bend| R::ONE / bend);
        lower(share * accel.sqrt_product(r1), Reason::Acceleration);
        lower(share * (jerk.cbrt() * r2.cbrt() * r2.cbrt()), Reason::Jerk);
        lower(share * snap.sqrt_product(r3).sqrt_product(r3), Reason::Snap);

        // The ramps' budget at the ceiling itself, where it is smallest. κ·v, √κ'·v and ∛κ''·v are angular
        // speeds; multiplied by one feed or acceleration at a time, no product exceeds a limit.
        let constant = R::from_f64;
        let [w1, w2, w3] = bends.map(|bend| (bend * feed).rounded_up());
        let normal_accel = w1 * feed;
        let along_jerk = w2 * (w2 * feed);
        let across_snap = w3 * (w3 * (w3 * feed));
        // Where constant feed leaves little, ramps get shares of the rest: across, enough to keep half of the
        // jerk along the path, and shares of the snap; along, half of the snap that is then left.
        let half = constant(0.5);
        let middle_jerk = half * (jerk + along_jerk);
        let rest_jerk = (jerk - middle_jerk).sqrt_product(jerk + middle_jerk);
        let snap_rest = snap - across_snap;
        let (accel_rest, jerk_rest) = (
            constant(NORMAL_SNAP_REST_SHARES.0) * snap_rest,
            constant(NORMAL_SNAP_REST_SHARES.1) * snap_rest,
        );
        let used_snap = across_snap
            + accel_rest.min(constant(NORMAL_SNAP_SHARES.0) * snap)
            + jerk_rest.min(constant(NORMAL_SNAP_SHARES.1) * snap);
        let rest_along = half * (snap - used_snap).sqrt_product(snap + used_snap);
        let ramp_accel = (accel - normal_accel)
            .sqrt_product(accel + normal_accel)
            .min(constant(NORMAL_JERK_SHARE / 3.0) * jerk / w1)
            .min(constant(1.0 / 3.0) * rest_jerk / w1)
            .min((constant(NORMAL_SNAP_SHARES.0 / 3.0) * snap).sqrt_product(r1))
            .min((constant(1.0 / 3.0) * accel_rest).sqrt_product(r1))
            .min(constant(TANGENTIAL_SNAP_SHARE / 6.0) * snap / w2 / w2)
            .min(constant(1.0 / 6.0) * rest_along / w2 / w2)
            .min(along.accel_mm_s2);
        let normal_jerk = constant(3.0) * (w1 * ramp_accel);
        let ramp_jerk = ((jerk - normal_jerk).sqrt_product(jerk + normal_jerk) - along_jerk)
            .min(constant(NORMAL_SNAP_SHARES.1 / 4.0) * snap / w1)
            .min(constant(0.25) * jerk_rest / w1)
            .min(along.jerk_mm_s3);
        let normal_snap = across_snap
            + constant(3.0) * (kappa * ramp_accel * ramp_accel)
            + constant(4.0) * (w1 * ramp_jerk);
        let along_snap = constant(6.0) * (w2 * (w2 * ramp_accel));
        let ramp_snap =
            ((snap - normal_snap).sqrt_product(snap + normal_snap) - along_snap).min(along.snap_mm_s4);
        let left = Limits { accel_mm_s2: ramp_accel, jerk_mm_s3: ramp_jerk, snap_mm_s4: ramp_snap };
        let law = Law::new(machine.pulse, left)?;
        Ok(Self { feed_mm_s: feed, reason, law })
    }
}

/// The smaller limits of `a` and of `b` divided by `component`.
fn least<R: Root>(a: &Limits<R>, b: &Limits<R>, component: R) -> Limits<R> {
    a.least(&Limits {
        accel_mm_s2: b.accel_mm_s2 / component,
        jerk_mm_s3: b.jerk_mm_s3 / component,
        snap_mm_s4: b.snap_mm_s4 / component,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::LIMITS;

    fn machine() -> MachineLimits<f64, 3> {
        let all = AxisLimits { feed_mm_s: 300.0, limits: LIMITS };
        MachineLimits { path: all, axes: [all; 3], pulse: Pulse::Plateau, curve_feed_share: CURVE_FEED_SHARE }
    }

    /// Worst vectors over every state a ramp on the arc can be in, radii from 1 µm to 100 m.
    #[test]
    fn shared_budget_keeps_the_vectors_within_the_limits() {
        for share in [0.3, CURVE_FEED_SHARE, CURVE_FEED_SHARE_MAX, BLEND_FEED_SHARE] {
            vectors_stay_within(&MachineLimits { curve_feed_share: share, ..machine() });
        }
    }

    fn vectors_stay_within(machine: &MachineLimits<f64, 3>) {
        let limits = machine.path.limits;
        for exponent in -12..=20 {
            let radius = 10.0_f64.powf(f64::from(exponent) / 4.0);
            let bend = Bend::circle(radius, 1.0);
            let ceiling = Ceiling::new(machine, f64::INFINITY, &[1.0, 1.0, 0.0], &[true, true, false], &bend)
                .expect("limits");
            let ramp = ceiling.law.limits();
            let mut worst = [0.0_f64; 3];
            for i in 0..=20 {
                let v = ceiling.feed_mm_s * f64::from(i) / 20.0;
                for a in [-1.0, -0.5, 0.0, 0.5, 1.0].map(|a| a * ramp.accel_mm_s2) {
                    let accel = a.hypot(v * v / radius);
                    worst[0] = worst[0].max(accel / limits.accel_mm_s2);
                    for j in [-1.0, 0.0, 1.0].map(|j| j * ramp.jerk_mm_s3) {
                        let jerk = (j - v.powi(3) / radius.powi(2)).hypot(3.0 * v * a / radius);
                        worst[1] = worst[1].max(jerk / limits.jerk_mm_s3);
                        for s in [-1.0, 1.0].map(|s| s * ramp.snap_mm_s4) {
                            let snap = (s - 6.0 * v * v * a / radius.powi(2)).hypot(
                                v.powi(4) / radius.powi(3) - 3.0 * a * a / radius - 4.0 * v * j / radius,
                            );
                            worst[2] = worst[2].max(snap / limits.snap_mm_s4);
                        }
                    }
                }
            }
            assert!(worst.iter().all(|&w| w <= 1.0 + 1e-12), "R {radius}: {worst:?}");
            // And the budget is used: something comes close.
            assert!(worst.iter().any(|&w| w > 0.75), "R {radius}: {worst:?}");
        }
    }

    #[test]
    fn reasons_of_the_stringers_arcs() {
        let of = |radius, feed| {
            let bend = Bend::circle(radius, 1.0);
            Ceiling::new(&machine(), feed, &[1.0, 1.0, 0.0], &[true, true, false], &bend)
                .expect("limits")
                .reason
        };
        assert_eq!(of(4.0, 5000.0 / 60.0), Reason::Jerk);
        assert_eq!(of(10.0, 5000.0 / 60.0), Reason::Acceleration);
        assert_eq!(of(1000.0, 5000.0 / 60.0), Reason::Programmed);
        assert_eq!(of(1e5, f64::INFINITY), Reason::PathFeed);
        assert_eq!(of(1e-4, 10.0), Reason::Snap);
    }

    /// A line along one axis and a diagonal: axis limits divided by the direction's components.
    #[test]
    fn axes_limit_lines() {
        let mut machine = machine();
        machine.axes[2].feed_mm_s = 30.0;
        machine.axes[2].limits.jerk_mm_s3 = 1000.0;
        let line = |direction: [f64; 3]| {
            Ceiling::new(&machine, 200.0, &direction, &[false; 3], &Bend::default()).expect("limits")
        };
        let along = line([1.0, 0.0, 0.0]);
        assert_eq!((along.feed_mm_s, along.reason), (200.0, Reason::Programmed));
        let plunge = line([0.0, 0.6, 0.8]);
        assert_eq!((plunge.feed_mm_s, plunge.reason), (37.5, Reason::AxisFeed));
        assert_eq!(plunge.law.limits().jerk_mm_s3, 1250.0);
    }
}
