//! The inverse problems: which feed can be reached in a length.
//!
//! The length of a ramp is strictly increasing in its *higher* feed and **not** monotone in its
//! *lower* one (from 60 mm/s, slowing to 20 takes longer than stopping), so only the higher feed is
//! ever solved for. Newton's method on increasing convex functions, started above the root, falls
//! monotonically: no bracket, no bisection, and a constant bound on the iterations.
//!
//! Background only; pure; generic. In f32 one unit in the last place of a feed is a ramp of up to 82 µm, so
//! f32 is for tests only. In fixed point the solution's precision is that of its times, in steps of 0.23 ns.

use super::limits::{Law, Pulse, Times};
use super::ramp::LimitedBy;
use crate::num::Root;

/// Newton steps after which a solve ends in any case. Ten reach the last places in f64, nine in f32, over 20
/// 000 random cases for each of four sets of limits; most need fewer.
pub(super) const NEWTON_STEPS_MAX: usize = 12;

/// The highest feed that can be reached from `lower_mm_s` within `length_mm`; equally, the highest
/// feed from which one can slow to `lower_mm_s` within it \[mm/s\]. Both arguments ≥ 0.
#[must_use]
pub fn reach<R: Root>(law: &Law<R>, lower_mm_s: R, length_mm: R) -> R {
    let reached = lower_mm_s + change_within(law, lower_mm_s, length_mm);
    fit(reached, lower_mm_s, |feed| law.ramp_length_mm(lower_mm_s, feed) <= length_mm)
}

/// Greatest number of steps down to a feed that fits, each twice as long as the one before.
const FIT_STEPS_MAX: usize = 48;

/// Returns `feed`, or the next lower one that fits, or `least` if none does: an ulp of feed may be a long
/// ramp.
fn fit<R: Root>(feed: R, least: R, fits: impl Fn(R) -> bool) -> R {
    let (mut low, mut high, mut step) = (feed, feed, feed.spacing());
    let mut steps = 0;
    while low > least && !fits(low) {
        if steps == FIT_STEPS_MAX {
            return least;
        }
        (low, high, step) = (low - step, low, step + step);
        steps += 1;
    }
    low = low.max(least);
    // The last step was as long as all steps before it together, and it may have gone too far: bisect it.
    for _ in 1..steps {
        let middle = low + (high - low).half();
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The change of feed that [`reach`] adds. It keeps digits that the sum would lose.
fn change_within<R: Root>(law: &Law<R>, lower: R, length: R) -> R {
    if length <= R::ZERO {
        return R::ZERO;
    }
    let double_lower = lower + lower;
    let x2 = law.accel_limited_from_mm_s();
    // The ramp by x₁ has the length (2F + x₁)·P with P = πJ'/DJ, the one by x₂ likewise.
    if length / law.snap_time_s - double_lower <= law.snap_limited_to_mm_s() {
        // x = w³, P = w/k with k = (DJ/2π)^⅓:  w·(x + 2F) = k·L
        let w = root_of_power::<R, 4>(double_lower, law.snap_root(), length);
        w * w * w
    } else if length / law.accel_time_s - double_lower < x2 {
        match law.pulse() {
            Pulse::Sin2 => {
                // x = w², P = w/k with k = √(J'/2):  w·(x + 2F) = k·L
                let w = root_of_power::<R, 3>(double_lower, law.jerk_root(), length);
                w * w
            }
            Pulse::Plateau => law.change_mm_s(pulse_within(law, double_lower, length)),
        }
    } else {
        // (F + x/2)(x/A + P) = L, solved for x without cancellation; a = A·P/2:
        // x = (2AL − 4aF)/(√((F − a)² + 2AL) + F + a), no square taken by itself.
        let accel = law.limits().accel_mm_s2;
        let a = x2.half();
        let all = (accel + accel).sqrt_product(length);
        let taken = x2.sqrt_product(double_lower);
        (all - taken).times_per(all + taken, (lower - a).root_of_squares(all) + lower + a)
    }
}

/// The length P of a pulse with a plateau for which a ramp without a hold from `double_lower`/2 takes
/// `length`: P·(2F + J'·P·(P − e')) = L, of which P is longer than two edges and shorter than acceleration allows.
fn pulse_within<R: Root>(law: &Law<R>, double_lower: R, length: R) -> R {
    let edge_mm_s2 = law.snap_time_s.half() * law.jerk_mm_s3;
    // All of these are above the root; x ≥ J'·P²/2 gives the second.
    let by_jerk_s = (length + length).cbrt_quotient(law.jerk_mm_s3);
    let mut pulse_s = law.accel_time_s.min(by_jerk_s);
    if double_lower > R::ZERO {
        pulse_s = pulse_s.min(length.times_per(R::ONE, double_lower));
    }
    pulse_s = pulse_s.rounded_up();
    // Increasing and convex in P: Newton falls to the root.
    for _ in 0..NEWTON_STEPS_MAX {
        let change = law.change_mm_s(pulse_s);
        // The residual of the equation divided by P: both sides are feeds.
        let residual = change + double_lower - length.times_per(R::ONE, pulse_s);
        let slope = R::from_f64(3.0) * change + double_lower + edge_mm_s2 * pulse_s;
        let next = pulse_s - pulse_s.times_per(residual, slope);
        // `<` also ends on NaN.
        if !(next > R::ZERO && next < pulse_s) {
            break;
        }
        pulse_s = next;
    }
    pulse_s
}

/// The positive root of w·(wⁿ⁻¹ + p) = k·L for n = 3 or 4, p ≥ 0, k > 0, L > 0.
fn root_of_power<R: Root, const N: usize>(p: R, k: R, length: R) -> R {
    let power = match N {
        3 => length.cbrt() * k.cbrt(),
        _ => length.sqrt_product(k).sqrt(),
    };
    // Both starts are above the root.
    let mut w = if p > R::ZERO { length.times_per(k, p).min(power) } else { power };
    let n = R::from_f64(N as f64);
    for step in 0..NEWTON_STEPS_MAX {
        let change = if N == 3 { w * w } else { w * w * w };
        // The residual of the equation divided by w: both sides are feeds.
        let residual = change + p - length.times_per(k, w);
        let next = w - w.times_per(residual, n * change + p);
        // By rounding, the start may be below the root; the first step lands above it, and the others fall.
        // `>` and `<` also end on NaN.
        if !(next > R::ZERO && (step == 0 || next < w)) {
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
    let (higher, lower) = (from_mm_s.max(to_mm_s), from_mm_s.min(to_mm_s));
    let step = higher - lower;
    // Room within rounding counts as none: the peak would rise by less than that.
    let rounding = R::from_f64(4.0) * length_mm.spacing();
    if length_mm - law.ramp_length_mm(lower, higher) <= rounding {
        return higher;
    }
    let above = change_within(law, higher, length_mm.half());
    // Subtracted, because the sum may be beyond fixed point.
    let fits = |feed: R| law.ramp_length_mm(lower, feed) <= length_mm - law.ramp_length_mm(higher, feed);
    if step <= R::ZERO {
        return fit(higher + above, higher, fits);
    }
    // The peak is `higher` + y³. It lies between what either feed alone would reach in half the
    // length, and in y the total length is increasing and convex.
    let upper = above.max(change_within(law, lower, length_mm.half()) - step);
    let mut y = upper.cbrt().rounded_up();
    let (two, three) = (R::from_f64(2.0), R::from_f64(3.0));
    let (snap_root, snap_limited_to) = (law.snap_root(), law.snap_limited_to_mm_s());
    for _ in 0..NEWTON_STEPS_MAX {
        let square = y * y;
        let (change, by_y) = (square * y, three * square);
        // While snap limits the shorter ramp, y is the cube root in its time.
        let short_time = if change <= snap_limited_to {
            ((y + y) / snap_root, two / snap_root)
        } else {
            time(law, change, by_y)
        };
        let (short, short_slope) = length(higher, change, short_time, by_y);
        let (long, long_slope) = length(lower, change + step, time(law, change + step, by_y), by_y);
        let (excess, slope) = (short + long - length_mm, short_slope + long_slope);
        if !(excess > R::ZERO && slope > R::ZERO) {
            break;
        }
        let next = y - excess / slope;
        if !(next < y && next > R::ZERO) {
            break;
        }
        y = next;
    }
    fit(higher + y * y * y, higher, fits)
}

/// Duration of the ramp by `change` > 0, and its derivative by y; the derivative of the change is `by_y`.
fn time<R: Root>(law: &Law<R>, change: R, by_y: R) -> (R, R) {
    let Times { rise_s, fall_start_s, edge_s, limited_by } = law.times(change);
    let time = rise_s + fall_start_s;
    // dT/dx is T/(3x), T/(2x) or, with a plateau, 2/(J'·(2P − e)), or 1/A.
    let slope = match (limited_by, law.pulse()) {
        (LimitedBy::Snap, _) => time.times_per(by_y, R::from_f64(3.0) * change),
        (LimitedBy::Jerk, Pulse::Sin2) => time.times_per(by_y, change + change),
        (LimitedBy::Jerk, Pulse::Plateau) => {
            by_y.times_per(R::from_f64(2.0), law.jerk_mm_s3) / (time - edge_s)
        }
        (LimitedBy::Acceleration, _) => by_y / law.limits().accel_mm_s2,
    };
    (time, slope)
}

/// Length of the ramp from `lower` by `change`, and its derivative by y, from its time and that derivative.
fn length<R: Root>(lower: R, change: R, (time, time_slope): (R, R), by_y: R) -> (R, R) {
    let mean = lower + change.half();
    (mean * time, time.half() * by_y + mean * time_slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Limits;
    use crate::random::Random;

    fn laws() -> impl Iterator<Item = Law<f64>> + Clone {
        let sets = [(500.0, 5e3, 4e5), (5e3, 1e5, 5e6), (12_500.0, 1e6, 1e8), (500.0, 1e5, 4e5)];
        [Pulse::Sin2, Pulse::Plateau].into_iter().flat_map(move |pulse| {
            sets.into_iter().map(move |(a, j, d)| {
                let limits = Limits { accel_mm_s2: a, jerk_mm_s3: j, snap_mm_s4: d };
                Law::new(pulse, limits).expect("positive")
            })
        })
    }

    /// Rest, or a feed of any size \[mm/s\].
    fn feed(random: &Random) -> f64 {
        if random.chance(0.1) { 0.0 } else { random.log(1e-2, 1e3) }
    }

    #[test]
    fn reach_takes_just_the_length() {
        let (random, laws) = (Random::new(1), laws().collect::<Vec<_>>());
        let mut worst = 0.0_f64;
        for _ in 0..200_000 {
            for law in &laws {
                let (lower, length) = (feed(&random), random.log(1e-3, 2e3));
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
        let (random, laws) = (Random::new(2), laws().collect::<Vec<_>>());
        let mut worst = 0.0_f64;
        let mut solved = 0;
        for _ in 0..200_000 {
            for law in &laws {
                let (from, to, length) = (feed(&random), feed(&random), random.log(1e-3, 2e3));
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
        let law = laws().next().expect("the first");
        let (stop, slow) = (law.ramp_length_mm(60.0, 0.0), law.ramp_length_mm(60.0, 20.0));
        assert!(slow > stop, "{slow} {stop}");
    }
}
