//! The feeds along a curve: what it allows at its tightest, with the ramps between.

use motion_kernel::law::Limits;
use motion_kernel::num::Root;

/// Part of the acceleration and the jerk that ramps may take where bends take the rest, and where a span is
/// driven so much slower than it allows that its bends take 0.44 of acceleration and 0.3 of jerk: across to
/// the ramp's, so that the sum of squares is at the limit.
const RAMP_SHARE: f64 = 0.4;
const STEEP_SHARE: f64 = 0.9;
const SLOWER: f64 = 1.5;
/// Steps of Newton for the rise of a ramp: it starts at most half too far.
const NEWTON_STEPS: usize = 4;

/// Lowers the greatest feeds of spans \[mm/s\] to what ramps from the slower ones can make of them. A span
/// costs a step for each of the spans that it slows down.
pub fn lower(feeds_mm_s: &mut [f64], lengths_mm: &[f64], limits: &Limits<f64>) {
    let own = feeds_mm_s.to_vec();
    let mut steep = own.clone();
    lower_to(RAMP_SHARE, feeds_mm_s, lengths_mm, limits);
    lower_to(STEEP_SHARE, &mut steep, lengths_mm, limits);
    for ((feed, steep), own) in feeds_mm_s.iter_mut().zip(steep).zip(own) {
        *feed = feed.max(steep.min(own / SLOWER));
    }
}

/// Lowers feeds to what ramps with a share of the limits reach.
fn lower_to(share: f64, feeds_mm_s: &mut [f64], lengths_mm: &[f64], limits: &Limits<f64>) {
    let limits =
        Limits { accel_mm_s2: share * limits.accel_mm_s2, jerk_mm_s3: share * limits.jerk_mm_s3, ..*limits };
    let own = feeds_mm_s.to_vec();
    let most_mm_s = own.iter().copied().fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..own.len()).collect();
    order.sort_by(|&a, &b| own[a].total_cmp(&own[b]));
    for from in order {
        let least_mm_s = own[from];
        // Where a slower one reaches, it reaches farther than this one would.
        if feeds_mm_s[from] < least_mm_s {
            continue;
        }
        let ahead = from + 1..own.len();
        lower_from(least_mm_s, most_mm_s, ahead, feeds_mm_s, lengths_mm, &limits);
        lower_from(least_mm_s, most_mm_s, (0..from).rev(), feeds_mm_s, lengths_mm, &limits);
    }
}

/// Lowers the spans `at`, the nearest first, to what a ramp from `least_mm_s` reaches in their middles.
fn lower_from(
    least_mm_s: f64,
    most_mm_s: f64,
    at: impl Iterator<Item = usize>,
    feeds_mm_s: &mut [f64],
    lengths_mm: &[f64],
    limits: &Limits<f64>,
) {
    let mut before_mm = 0.0;
    for index in at {
        let reach_mm = before_mm + 0.5 * lengths_mm[index];
        before_mm += lengths_mm[index];
        let fits = |rise_mm_s: f64| ramp_mm(least_mm_s, rise_mm_s, limits) <= reach_mm;
        let rise_mm_s = feeds_mm_s[index] - least_mm_s;
        // What is as slow slows down what is behind it by itself.
        if rise_mm_s <= 0.0 || fits(most_mm_s - least_mm_s) {
            break;
        }
        if !fits(rise_mm_s) {
            feeds_mm_s[index] = least_mm_s + rise_mm_s.min(rise_within_mm_s(least_mm_s, reach_mm, limits));
        }
    }
}

/// The rise of a ramp of a length, from a feed \[mm/s\]: where [`ramp_mm`] is that length.
fn rise_within_mm_s(from_mm_s: f64, length_mm: f64, limits: &Limits<f64>) -> f64 {
    let (accel, jerk) = (limits.accel_mm_s2, limits.jerk_mm_s3);
    // (v + r/2)·(r/a + a/j) = length, where the ramp reaches its acceleration.
    let half = from_mm_s + 0.5 * accel * accel / jerk;
    let rest = 2.0 * (accel * length_mm - from_mm_s * accel * accel / jerk);
    let rise = (half * half + rest).max(0.0).sqrt() - half;
    if rise > accel * accel / jerk {
        return rise;
    }
    // (v + r/2)·2t = length with r = j·t² otherwise. Newton from above, where the slope is greater.
    let mut time_s = Root::cbrt(length_mm / jerk);
    if from_mm_s > 0.0 {
        time_s = time_s.min(length_mm / (2.0 * from_mm_s));
    }
    for _ in 0..NEWTON_STEPS {
        let off_mm = (2.0 * from_mm_s + jerk * time_s * time_s) * time_s - length_mm;
        time_s -= off_mm / (2.0 * from_mm_s + 3.0 * jerk * time_s * time_s);
    }
    jerk * time_s * time_s
}

/// The length of a ramp that rises from a feed \[mm\].
fn ramp_mm(from_mm_s: f64, rise_mm_s: f64, limits: &Limits<f64>) -> f64 {
    let (accel, jerk) = (limits.accel_mm_s2, limits.jerk_mm_s3);
    let time_s = if rise_mm_s > accel * accel / jerk {
        rise_mm_s / accel + accel / jerk
    } else {
        2.0 * (rise_mm_s / jerk).sqrt()
    };
    (from_mm_s + 0.5 * rise_mm_s) * time_s
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

    /// A slow span pulls its neighbours down as far as a ramp from it reaches, and no farther.
    #[test]
    fn ramps_lead_from_slow_spans_to_fast_ones() {
        let lengths = [0.5; 200];
        let mut feeds = [50.0; 200];
        feeds[100] = 5.0;
        feeds[103] = 8.0;
        lower(&mut feeds, &lengths, &LIMITS);
        assert_eq!(feeds[100], 5.0);
        for from in [100_usize, 103] {
            for at in 0..200_usize {
                let mm = 0.5 * from.abs_diff(at) as f64 - 0.25;
                assert!(
                    at == from
                        || feeds[at] <= feeds[from]
                        || ramp_mm(feeds[from], feeds[at] - feeds[from], &LIMITS) <= mm * (1.0 + 1e-4),
                    "{from} {at} {feeds:?}"
                );
            }
        }
        // Rising on both sides, and free where the ramp has ended.
        assert!(feeds[..=100].windows(2).all(|pair| pair[0] >= pair[1]));
        assert_eq!((feeds[0], feeds[199]), (50.0, 50.0));
        assert!(feeds[95] < 30.0 && feeds[95] > 6.0, "{}", feeds[95]);
    }

    /// A ramp is steep where bends leave it the limits, and not where they take them.
    #[test]
    fn ramps_are_steep_where_little_bends() {
        let at_end = |allowed_mm_s: f64| {
            let mut feeds = [allowed_mm_s; 8];
            feeds[0] = 5.0;
            lower(&mut feeds, &[0.5; 8], &LIMITS);
            feeds[7]
        };
        let [tight, between, free] = [30.0, 45.0, 80.0].map(at_end);
        let ramp_mm = |to_mm_s: f64, share: f64| {
            let limits = Limits {
                accel_mm_s2: share * LIMITS.accel_mm_s2,
                jerk_mm_s3: share * LIMITS.jerk_mm_s3,
                ..LIMITS
            };
            super::ramp_mm(5.0, to_mm_s - 5.0, &limits)
        };
        // From the end of the slow span to the middle of the last one.
        assert!((ramp_mm(free, STEEP_SHARE) - 3.25).abs() < 1e-3, "{free}");
        assert!((between - 45.0 / SLOWER).abs() < 1e-9, "{between}");
        assert!((ramp_mm(tight, RAMP_SHARE) - 3.25).abs() < 1e-3, "{tight}");
    }

    /// A ramp of that rise is as long as it was to be.
    #[test]
    fn the_rise_of_a_ramp_makes_its_length() {
        for from_mm_s in [0.0, 0.01, 1.0, 7.0, 300.0] {
            for length_mm in [1e-4, 0.01, 0.3, 3.0, 20.0, 1e3] {
                let rise_mm_s = rise_within_mm_s(from_mm_s, length_mm, &LIMITS);
                let found_mm = ramp_mm(from_mm_s, rise_mm_s, &LIMITS);
                assert!((found_mm / length_mm - 1.0).abs() < 1e-5, "{from_mm_s} {length_mm}: {found_mm}");
            }
        }
    }
}
