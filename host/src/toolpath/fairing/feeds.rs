//! The feeds along a curve: what it allows at its tightest, with the ramps between.

use motion_kernel::law::Limits;

/// Part of the acceleration and the jerk that the ramps may take: the rest bends.
const RAMP_SHARE: f64 = 0.4;
/// Halvings of the rise of a ramp.
const HALVINGS: usize = 20;

/// Lowers the greatest feeds of spans \[mm/s\] to what ramps from the slower ones can make of them. A span
/// costs a step for each of the spans that it slows down.
pub fn lower(feeds_mm_s: &mut [f64], lengths_mm: &[f64], limits: &Limits<f64>) {
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
        lower_from(least_mm_s, most_mm_s, ahead, feeds_mm_s, lengths_mm, limits);
        lower_from(least_mm_s, most_mm_s, (0..from).rev(), feeds_mm_s, lengths_mm, limits);
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
        if rise_mm_s < 0.0 || fits(most_mm_s - least_mm_s) {
            break;
        }
        if !fits(rise_mm_s) {
            let (mut low, mut high) = (0.0, rise_mm_s);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if fits(middle) { low = middle } else { high = middle }
            }
            feeds_mm_s[index] = least_mm_s + low;
        }
    }
}

/// The length of a ramp that rises from a feed \[mm\].
fn ramp_mm(from_mm_s: f64, rise_mm_s: f64, limits: &Limits<f64>) -> f64 {
    let (accel, jerk) = (RAMP_SHARE * limits.accel_mm_s2, RAMP_SHARE * limits.jerk_mm_s3);
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
        assert!(feeds[95] < 25.0 && feeds[95] > 6.0, "{}", feeds[95]);
    }
}
