//! The choice (22), (23) keeps the limits, and no other law made of sin² pulses is faster.

use super::{LIMITS, feeds, limits};
use motion_kernel::law::{Law, Limits, Pulse, Ramp};
use motion_tests::random::Random;
use std::f64::consts::PI;

/// Room for rounding.
const ROUNDING: f64 = 1e-12;

/// Whether a pulse of jerk of this height and width keeps the limits.
fn keeps(limits: &Limits<f64>, jerk: f64, width_s: f64) -> bool {
    jerk <= limits.jerk_mm_s3
        && jerk * width_s / 2.0 <= limits.accel_mm_s2
        && PI * jerk / width_s <= limits.snap_mm_s4
}

/// The limits a little wider, so that the best choice itself is within them.
fn widened(limits: &Limits<f64>, by: f64) -> Limits<f64> {
    Limits {
        accel_mm_s2: limits.accel_mm_s2 * by,
        jerk_mm_s3: limits.jerk_mm_s3 * by,
        snap_mm_s4: limits.snap_mm_s4 * by,
    }
}

/// A factor around 1, from far away to very near.
fn around_one(random: &mut Random) -> f64 {
    let away = random.log(1e-9, 3.0);
    if random.once_in(2) { 1.0 + away } else { 1.0 / (1.0 + away) }
}

#[test]
fn no_other_pulses_are_faster() {
    let mut random = Random::of_stream(20);
    let (mut symmetric, mut asymmetric, mut nearest) = (0, 0, f64::INFINITY);
    for _ in 0..20_000 {
        let limits = limits(*random.pick(&LIMITS));
        let law = Law::new(Pulse::Sin2, limits).expect("positive");
        let (from, to) = feeds::<f64>(&mut random);
        let change = (to - from).abs();
        if change <= 0.0 {
            continue;
        }
        let best = Ramp::new(&law, from, to);
        let within = widened(&limits, 1.0 + ROUNDING);
        assert!(keeps(&within, best.peak_jerk_mm_s3, best.t1_s), "{best:?}");
        let other =
            |random: &mut Random| (best.peak_jerk_mm_s3 * around_one(random), best.t1_s * around_one(random));
        for _ in 0..20 {
            // S1's own form: the same pulse twice; (13) and (14) give its duration.
            let (jerk, t1_s) = other(&mut random);
            let t2_s = 2.0 * change / (jerk * t1_s);
            if keeps(&limits, jerk, t1_s) && t2_s >= t1_s {
                symmetric += 1;
                nearest = nearest.min((t1_s + t2_s) / best.duration_s() - 1.0);
            }
            // Pulses of different width that reach the same acceleration.
            let (jerk, rise_s) = other(&mut random);
            let fall_s = rise_s * around_one(&mut random);
            let accel = jerk * rise_s / 2.0;
            let hold_s = change / accel - (rise_s + fall_s) / 2.0;
            if keeps(&limits, jerk, rise_s) && keeps(&limits, 2.0 * accel / fall_s, fall_s) && hold_s >= 0.0 {
                asymmetric += 1;
                nearest = nearest.min((rise_s + hold_s + fall_s) / best.duration_s() - 1.0);
            }
        }
    }
    println!("{symmetric} symmetric, {asymmetric} asymmetric; the nearest is slower by {nearest:.1e}");
    assert!(symmetric > 20_000 && asymmetric > 5_000);
    assert!(nearest >= -ROUNDING, "a faster law exists: {nearest:e}");
}
