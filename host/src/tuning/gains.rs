//! The regulator's gains.
//!
//! Feedforward moves the axis. Feedback corrects what feedforward does not know, and lag bounds it: dead time, current loop,
//! converter. What it leaves of a disturbance is |G/(s + C·G)| for each mm/s of it.
//!
//! kd makes up for the lag of the drive's velocity loop, and so leaves room for kp. Differences of encoder counts make noise of the
//! current, and the noise bounds kd. ki stays 0: the drive integrates already, and two integrals move an axis with friction to and
//! fro for ever.
//!
//! Gains with two margins in hand that nowhere leave more than kp alone are compared by what they leave on average below half of
//! the crossover of kp alone, in ratios: above, feedback magnifies rather than corrects.

use hal_sim::DriveParameters;
use motion_kernel::axis::Gains;

use super::margins::{LoopPoint, Plant, position};
use crate::drive::model::{Complex, feedback};

/// Least phase margin \[°\]: S4's machine ran 39°.
pub const PHASE_MIN_DEG: f64 = 40.0;
/// Least gain margin.
pub const GAIN_MIN: f64 = 2.0;
/// Greatest kp that is looked at \[1/s\].
const KP_MAX_PER_S: f64 = 2000.0;
/// The least that is a position loop \[1/s\].
pub const KP_MIN_PER_S: f64 = 0.5;
/// Margins are kept by all gains this much above and below, too: a bed lets a loop touch a gain of 1 again, and models
/// know resonances to some per cent.
const GAIN_SPREAD: f64 = 1.03;
/// kd over kp at most, in time constants of the drive's velocity loop, and steps to it.
const LEAD_MAX: f64 = 1.0;
const STEPS: u32 = 24;
/// Frequencies at which gains are compared: even parts of the crossover of kp alone, up to this.
const JUDGED_TO: f64 = 0.5;
const JUDGED: u32 = 20;
/// What rounding may add to what kp alone leaves.
const NO_MORE: f64 = 1.0 + 1e-9;
/// Noise that kd may make of encoder counts, root mean square: the part of the current limit.
pub const NOISE_PART: f64 = 0.005;

/// The greatest kd whose noise of torque stays within [`NOISE_PART`] of `limit_mm_s2` \[mm/s²\], with readings whose errors
/// have a standard deviation of `reading_mm` \[mm\].
#[must_use]
pub fn kd_max(drive: &DriveParameters, tick_s: f64, reading_mm: f64, limit_mm_s2: f64) -> f64 {
    let inertia = 1.0 + drive.load_inertia_ratio;
    // The difference of two readings has √2 of their deviation. The drive's controller makes torque of it at once.
    let per_kd_mm_s2 = drive.velocity_gain_per_s / inertia * core::f64::consts::SQRT_2 * reading_mm / tick_s;
    NOISE_PART * limit_mm_s2 / per_kd_mm_s2
}

/// `gains` times `factor`.
#[must_use]
pub fn scaled(gains: Gains, factor: f64) -> Gains {
    Gains { kp_per_s: gains.kp_per_s * factor, ki_per_s2: gains.ki_per_s2 * factor, kd: gains.kd * factor }
}

/// The gains that leave least of disturbances, of those that keep both margins, with kd up to `kd_max`. None if kp alone does not
/// keep them.
#[must_use]
pub fn best(drive: &DriveParameters, tick_s: f64, kd_max: f64) -> Option<Gains> {
    let plant = Plant::new(drive, tick_s);
    let only_kp = Gains { kp_per_s: 1.0, ..Gains::default() };
    let alone = scaled(only_kp, greatest(&plant, only_kp, KP_MAX_PER_S)?);
    let crossover_hz = plant.margins(alone).crossover_hz;
    let judged: Vec<(f64, Complex)> = (1..=JUDGED)
        .map(|part| JUDGED_TO * crossover_hz * f64::from(part) / f64::from(JUDGED))
        .map(|hz| (hz, position(drive, tick_s, hz)))
        .collect();
    let left = |gains: &Gains| -> Vec<f64> {
        let one = Complex::new(1.0, 0.0);
        let of = |&(hz, plant): &(f64, Complex)| plant / (one + feedback(gains, tick_s, hz) * plant);
        judged.iter().map(|point| of(point).magnitude()).collect()
    };
    let left_alone = left(&alone);
    let lag_s = (1.0 + drive.load_inertia_ratio) / drive.velocity_gain_per_s;
    let mut best = (0.0, alone);
    for step in 1..=STEPS {
        let shape = Gains { kd: LEAD_MAX * lag_s * f64::from(step) / f64::from(STEPS), ..only_kp };
        let Some(kp_per_s) = greatest(&plant, shape, (kd_max / shape.kd).min(KP_MAX_PER_S)) else { continue };
        let gains = scaled(shape, kp_per_s);
        let parts: Vec<f64> =
            left(&gains).into_iter().zip(&left_alone).map(|(left, alone)| left / alone).collect();
        let sum: f64 = parts.iter().map(|part| libm::log(*part)).sum();
        if sum < best.0 && parts.iter().all(|part| *part <= NO_MORE) {
            best = (sum, gains);
        }
    }
    Some(best.1)
}

/// The greatest factor of `shape` up to `factor_max` that keeps both margins, and so do its neighbours.
fn greatest(plant: &Plant, shape: Gains, factor_max: f64) -> Option<f64> {
    // A factor lets a point of the loop have a gain of 1, or half a circle of lag. What points forbid are intervals.
    let mut forbidden: Vec<(f64, f64)> = Vec::new();
    let is_late = |point: &LoopPoint| (core::f64::consts::PI + point.phase_rad).to_degrees() < PHASE_MIN_DEG;
    let mut before: Option<LoopPoint> = None;
    for point in plant.opened(shape) {
        if let Some(before) = before {
            if is_late(&point) || is_late(&before) {
                let [first, second] = [before, point].map(|point| 1.0 / point.magnitude);
                forbidden.push((first.min(second) / GAIN_SPREAD, first.max(second) * GAIN_SPREAD));
            }
            if point.turns_over(&before) {
                let magnitude = point.magnitude.max(before.magnitude);
                forbidden.push((1.0 / (GAIN_MIN * GAIN_SPREAD * magnitude), f64::INFINITY));
            }
        }
        before = Some(point);
    }
    forbidden.sort_by(|a, b| b.1.total_cmp(&a.1));
    // From above: an interval that ends higher has been passed before.
    let factor = forbidden
        .iter()
        .fold(factor_max, |factor, &(from, to)| if factor < to { factor.min(from) } else { factor });
    (factor >= KP_MIN_PER_S).then_some(factor)
}

/// `gains` as they are written: fewer digits, kp no greater, the shape as it is.
#[must_use]
pub fn written(gains: Gains) -> Gains {
    let kp_per_s = digits(gains.kp_per_s, 2, f64::floor);
    Gains { kp_per_s, kd: digits(gains.kd * kp_per_s / gains.kp_per_s, 3, f64::round), ..gains }
}

/// `value` of at least 0 with a number of decimals behind its first digit.
fn digits(value: f64, decimals: i32, round: fn(f64) -> f64) -> f64 {
    if !(value > 0.0) {
        return 0.0;
    }
    let unit = 10_f64.powi(decimals - libm::log10(value).floor() as i32);
    round(value * unit) / unit
}

#[cfg(test)]
mod tests {
    use hal_sim::{BedMode, REFERENCE_X, REFERENCE_Y};

    use super::super::margins::Margins;
    use super::*;

    const TICK_S: f64 = 5e-4;

    fn keeps(margins: &Margins) -> bool {
        margins.phase_deg >= PHASE_MIN_DEG && margins.gain >= GAIN_MIN
    }

    /// What is left of a disturbance of 1 mm/s at a frequency \[µm\].
    fn left_um(drive: &DriveParameters, gains: &Gains, hz: f64) -> f64 {
        let plant = position(drive, TICK_S, hz);
        1e3 * (plant / (Complex::new(1.0, 0.0) + feedback(gains, TICK_S, hz) * plant)).magnitude()
    }

    #[test]
    fn the_gain_alone_is_the_greatest_that_keeps_margins() {
        for drive in [REFERENCE_X, REFERENCE_Y] {
            let plant = Plant::new(&drive, TICK_S);
            let alone = Gains { kp_per_s: 1.0, ..Gains::default() };
            let found = greatest(&plant, alone, KP_MAX_PER_S).expect("a gain");
            assert!((210.0..235.0).contains(&found), "{found}");
            let keeps = |factor: f64| keeps(&plant.margins(scaled(alone, factor)));
            assert!(keeps(found) && keeps(0.98 * GAIN_SPREAD * found) && !keeps(1.02 * GAIN_SPREAD * found));
        }
    }

    /// Against what kp alone leaves: below three quarters from 1 to 20 Hz.
    #[test]
    fn two_gains_leave_less_than_one() {
        for drive in [REFERENCE_X, REFERENCE_Y] {
            let plant = Plant::new(&drive, TICK_S);
            let all =
                best(&drive, TICK_S, kd_max(&drive, TICK_S, 1e-4 / 12_f64.sqrt(), drive.accel_limit_mm_s2))
                    .expect("gains");
            let alone = Gains { kp_per_s: 222.0, ..Gains::default() };
            println!("{all:?} {:?}", plant.margins(all));
            assert!(keeps(&plant.margins(all)));
            for (hz, part) in [(1.0, 0.75), (4.0, 0.75), (20.0, 0.75)] {
                let parts = left_um(&drive, &all, hz) / left_um(&drive, &alone, hz);
                assert!(parts < part, "{hz} Hz: {parts}");
            }
        }
    }

    /// Noise bounds kd: ten times the counts leave a third of it, fifty times a twentieth.
    #[test]
    fn noise_bounds_the_derivative() {
        let of = |counts_mm: f64| {
            let reading_mm = counts_mm / 12_f64.sqrt();
            let bound = kd_max(&REFERENCE_X, TICK_S, reading_mm, REFERENCE_X.accel_limit_mm_s2);
            let found = best(&REFERENCE_X, TICK_S, bound).expect("gains");
            println!("{counts_mm} mm: kd up to {bound:.4}, {found:?}");
            assert!(found.kd <= bound * (1.0 + 1e-12));
            found
        };
        let [fine, coarse, coarsest] = [1e-4, 1e-3, 5e-3].map(of);
        assert!(fine.kd > 0.45 && coarse.kd < 0.4 * fine.kd && coarsest.kd < 0.05 * fine.kd);
        assert!(fine.kp_per_s > 310.0 && coarse.kp_per_s > 250.0 && coarsest.kp_per_s > 215.0);
    }

    /// Slow drives with coarse encoders: frequencies at which feedback magnifies would speak for none.
    #[test]
    fn slow_loops_are_not_weakened() {
        for (gain_per_s, accel_limit_mm_s2, alone_per_s) in
            [(100.0, 6000.0, 40.0), (60.0, 3000.0, 28.0), (10.0, 3000.0, 5.0)]
        {
            let drive = DriveParameters {
                velocity_gain_per_s: gain_per_s,
                integral_time_s: 0.05,
                current_lag_s: 2e-3,
                dead_time_s: 4e-3,
                command_filter_s: 4e-3,
                accel_limit_mm_s2,
                ..REFERENCE_X
            };
            let bound = kd_max(&drive, TICK_S, 5e-3 / 12_f64.sqrt(), accel_limit_mm_s2);
            let found = best(&drive, TICK_S, bound).expect("gains");
            println!("{found:?} {:?}", Plant::new(&drive, TICK_S).margins(found));
            let alone = Gains { kp_per_s: alone_per_s, ..Gains::default() };
            for hz in [0.2, 0.5, 1.0] {
                let parts = left_um(&drive, &found, hz) / left_um(&drive, &alone, hz);
                assert!(parts < 1.05, "Kv {gain_per_s}, {hz} Hz: {parts}");
            }
        }
    }

    /// A loop that touches a gain of 1 again at a bed keeps its margins with 3 % more and less.
    #[test]
    fn no_bed_is_grazed() {
        for (frequency_hz, damping_ratio, mass_ratio) in
            [(13.4, 0.03, 0.06), (25.0, 0.01, 0.2), (40.0, 0.005, 0.3), (60.0, 0.02, 0.3), (8.0, 0.005, 0.3)]
        {
            let bed = Some(BedMode { frequency_hz, damping_ratio, mass_ratio });
            let drive = DriveParameters { bed, ..REFERENCE_X };
            let plant = Plant::new(&drive, TICK_S);
            let found = best(&drive, TICK_S, 1.0).expect("gains");
            println!("{frequency_hz} Hz: {found:?} {:?}", plant.margins(found));
            assert!(found.kp_per_s > 0.0);
            for part in -29..=29 {
                let near = plant.margins(scaled(found, 1.0 + 1e-3 * f64::from(part)));
                // Intervals are those of the frequencies that are looked at.
                assert!(near.phase_deg >= PHASE_MIN_DEG - 0.1 && near.gain >= GAIN_MIN, "{part}: {near:?}");
            }
        }
    }

    #[test]
    fn what_is_written_has_few_digits() {
        let gains = written(Gains { kp_per_s: 254.91, kd: 0.345_678, ..Gains::default() });
        assert_eq!(gains, Gains { kp_per_s: 254.0, kd: 0.3444, ..Gains::default() });
        assert_eq!(written(Gains { kp_per_s: 3.456, ..Gains::default() }).kp_per_s, 3.45);
    }
}
