//! The inverse problems: which feed can be reached in a length.
//!
//! The length of a ramp is strictly increasing in its *higher* feed and **not** monotone in its
//! *lower* one (from 60 mm/s, slowing to 20 takes longer than stopping), so only the higher feed is
//! ever solved for. Newton's method on increasing convex functions, started above the root, falls
//! monotonically: no bracket, no bisection, and a constant bound on the iterations.
//!
//! Background only; pure; generic, but plan in f64: one unit in the last place of an f32 feed is a
//! ramp of 82 µm.

use super::limits::Law;
use crate::num::Root;

/// Newton steps after which a solve ends whatever it has. Ten reach the last places in f64, nine in
/// f32, over 20 000 random cases for each of four sets of limits; fewer are needed on most.
pub const NEWTON_STEPS_MAX: usize = 12;

/// The highest feed that can be reached from `lower_mm_s` within `length_mm`; equally, the highest
/// feed from which one can slow to `lower_mm_s` within it \[mm/s\]. Both arguments ≥ 0.
#[must_use]
pub fn reach<R: Root>(law: &Law<R>, lower_mm_s: R, length_mm: R) -> R {
    let reached = lower_mm_s + change_within(law, lower_mm_s, length_mm);
    fit(reached, lower_mm_s, |feed| law.ramp_length_mm(lower_mm_s, feed) <= length_mm)
}

/// Most steps down to a feed that fits.
const FIT_STEPS_MAX: usize = 8;

/// `feed`, or the next lower one that fits, `least` if none does: an ulp of feed may be a long ramp.
fn fit<R: Root>(feed: R, least: R, fits: impl Fn(R) -> bool) -> R {
    let mut feed = feed;
    for _ in 0..FIT_STEPS_MAX {
        if feed <= least || fits(feed) {
            return feed.max(least);
        }
        feed = feed * (R::ONE - R::from_f64(R::EPSILON));
    }
    least
}

/// The change of feed that [`reach`] adds; it keeps its digits where the sum would lose them.
fn change_within<R: Root>(law: &Law<R>, lower: R, length: R) -> R {
    if length <= R::ZERO {
        return R::ZERO;
    }
    let half = R::from_f64(0.5);
    let (x1, x2) = (law.snap_limited_to_mm_s, law.accel_limited_from_mm_s);
    let law_limits = law.limits();
    // t_p at x₁ is 2π·J'/DJ, at x₂ it is 4A/J': where one regime takes over, no root is left.
    let time_x1 = R::from_f64(core::f64::consts::TAU) * law.jerk_mm_s3 / law_limits.snap_mm_s4;
    let time_x2 = law.accel_time_s + law.accel_time_s;
    if length <= (lower + half * x1) * time_x1 {
        // x = w³, t_p = 2c·w:  w⁴ + 2·F·w = L/c
        let w = root_of_power::<R, 4>(lower + lower, length / law.snap_time);
        w * w * w
    } else if length < (lower + half * x2) * time_x2 {
        // x = w², t_p = 2·√(2/J')·w:  w³ + 2·F·w = L/√(2/J')
        let w = root_of_power::<R, 3>(lower + lower, length / law.jerk_time);
        w * w
    } else {
        // (F + x/2)(x/A + 2A/J') = L, solved for x without cancellation; a = A²/J'
        let accel = law_limits.accel_mm_s2;
        let a = half * x2;
        let al = accel * length;
        let difference = lower - a;
        let root = (difference * difference + al + al).sqrt();
        let four_a_lower = (a + a) * (lower + lower);
        (al + al - four_a_lower) / (root + lower + a)
    }
}

/// The positive root of wⁿ + p·w = q for n = 3 or 4, p ≥ 0, q > 0.
fn root_of_power<R: Root, const N: usize>(p: R, q: R) -> R {
    // The lower of q/p and the root of q, both above the root sought; q/p < ⁿ√q iff qⁿ⁻¹ < pⁿ.
    let (q_square, p_square) = (q * q, p * p);
    let linear = if N == 3 { q_square < p_square * p } else { q_square * q < p_square * p_square };
    let mut w = match (linear, N) {
        (true, _) => q / p,
        (false, 3) => q.cbrt(),
        (false, _) => q.sqrt().sqrt(),
    };
    for _ in 0..NEWTON_STEPS_MAX {
        let square = w * w;
        let (power, slope) = if N == 3 {
            (square * w, R::from_f64(3.0) * square)
        } else {
            (square * square, R::from_f64(4.0) * square * w)
        };
        let next = w - (power + p * w - q) / (slope + p);
        // `>=` also ends on what is not a number.
        if !(next < w && next > R::ZERO) {
            break;
        }
        w = next;
    }
    w
}

/// The highest feed between `from_mm_s` and `to_mm_s` that a block of `length_mm` has room for:
/// accelerate to it, then brake from it (S3, "block 12") \[mm/s\]. If the block has no room for the
/// direct ramp it is the higher of the two feeds.
#[must_use]
pub fn peak<R: Root>(law: &Law<R>, from_mm_s: R, to_mm_s: R, length_mm: R) -> R {
    let half = R::from_f64(0.5);
    let (higher, lower) = (from_mm_s.max(to_mm_s), from_mm_s.min(to_mm_s));
    let step = higher - lower;
    // Room of no more than rounding is none: with the cube of it, the peak rises by less than that.
    let rounding = R::ONE + R::from_f64(4.0 * R::EPSILON);
    if law.ramp_length_mm(lower, higher) * rounding >= length_mm {
        return higher;
    }
    let above = change_within(law, higher, half * length_mm);
    let fits = |feed: R| law.ramp_length_mm(lower, feed) + law.ramp_length_mm(higher, feed) <= length_mm;
    if step <= R::ZERO {
        return fit(higher + above, higher, fits);
    }
    // The peak is `higher` + y³. It lies between what either feed alone would reach in half the
    // length, and in y the total length is increasing and convex.
    let upper = above.max(change_within(law, lower, half * length_mm) - step);
    let mut y = upper.cbrt();
    let three = R::from_f64(3.0);
    for _ in 0..NEWTON_STEPS_MAX {
        let square = y * y;
        let change = square * y;
        // While snap limits the shorter leg, y is the cube root that its time takes.
        let short_time = if change <= law.snap_limited_to_mm_s {
            law.snap_time * (y + y)
        } else {
            law.ramp_time_s(change)
        };
        let (short, short_slope) = leg(law, higher, change, short_time, square);
        let long_time = law.ramp_time_s(change + step);
        let (long, long_slope) = leg(law, lower, change + step, long_time, square);
        let slope = three * (short_slope + long_slope);
        let next = y - (short + long - length_mm) / slope;
        if !(next < y && next > R::ZERO) {
            break;
        }
        y = next;
    }
    fit(higher + y * y * y, higher, fits)
}

/// Length of the ramp from `lower` by `change` in `time`, and its derivative by the change times
/// `square`.
fn leg<R: Root>(law: &Law<R>, lower: R, change: R, time: R, square: R) -> (R, R) {
    let half = R::from_f64(0.5);
    let mean = lower + half * change;
    // dT/dx is T/(3x), T/(2x) or 1/A.
    let time_slope = if change <= law.snap_limited_to_mm_s {
        time / (R::from_f64(3.0) * change)
    } else if change < law.accel_limited_from_mm_s {
        half * time / change
    } else {
        R::ONE / law.limits().accel_mm_s2
    };
    (mean * time, (half * time + mean * time_slope) * square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Limits;

    fn laws() -> [Law<f64>; 4] {
        [(500.0, 5e3, 4e5), (5e3, 1e5, 5e6), (12_500.0, 1e6, 1e8), (500.0, 1e5, 4e5)].map(|(a, j, d)| {
            Law::new(Limits { accel_mm_s2: a, jerk_mm_s3: j, snap_mm_s4: d }).expect("positive")
        })
    }

    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
        fn log(&mut self, from: f64, to: f64) -> f64 {
            from * (to / from).powf(self.unit())
        }
        fn feed(&mut self) -> f64 {
            if self.unit() < 0.1 { 0.0 } else { self.log(1e-2, 1e3) }
        }
    }

    #[test]
    fn reach_takes_just_the_length() {
        let mut random = Random(1);
        let mut worst = 0.0_f64;
        for _ in 0..200_000 {
            for law in &laws() {
                let (lower, length) = (random.feed(), random.log(1e-3, 2e3));
                let higher = reach(law, lower, length);
                // The change of feed is what the length depends on: compare lengths for it.
                let change = change_within(law, lower, length);
                let taken = (lower + change / 2.0) * law.ramp_time_s(change);
                worst = worst.max((taken / length - 1.0).abs());
                assert!(higher >= lower);
            }
        }
        println!("reach: worst relative length error {worst:.2e}");
        assert!(worst < 5e-15, "{worst:e}");
    }

    #[test]
    fn peak_takes_just_the_length() {
        let mut random = Random(2);
        let mut worst = 0.0_f64;
        let mut solved = 0;
        for _ in 0..200_000 {
            for law in &laws() {
                let (from, to, length) = (random.feed(), random.feed(), random.log(1e-3, 2e3));
                let peak = peak(law, from, to, length);
                let taken = law.ramp_length_mm(from, peak) + law.ramp_length_mm(peak, to);
                if law.ramp_length_mm(from, to) >= length {
                    assert!((peak - from.max(to)).abs() < f64::MIN_POSITIVE);
                } else if peak - from.max(to) > 1e-6 * peak {
                    // A smaller rise than that has lost its digits in the sum.
                    solved += 1;
                    worst = worst.max((taken / length - 1.0).abs());
                }
            }
        }
        println!("peak: {solved} solved, worst relative length error {worst:.2e}");
        assert!(solved > 200_000 && worst < 1e-9, "{worst:e}");
    }

    /// FIELD's named case: from 60 mm/s, slowing to 20 takes longer than stopping.
    #[test]
    fn length_is_not_monotone_in_the_lower_feed() {
        let law = &laws()[0];
        let (stop, slow) = (law.ramp_length_mm(60.0, 0.0), law.ramp_length_mm(60.0, 20.0));
        assert!(slow > stop, "{slow} {stop}");
    }
}
