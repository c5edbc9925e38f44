//! The regulator's gains.
//!
//! Feedforward moves the axis. Feedback corrects what feedforward does not know, and lag bounds it: dead time, current loop,
//! converter. What it leaves of a disturbance is |G/(s + C·G)| for each mm/s of it.
//!
//! The drive's controller integrates, but its integral only makes up for its own velocity. What friction or inertia lack in the
//! inverse lasts for the drive's integral time, and the position keeps it; ki takes it off. Two integrals move an axis with friction to
//! and fro for ever: ki leaks a quarter faster than the drive integrates. kd makes up for the lag of the drive's velocity
//! loop, and so leaves room for kp and ki. Differences of encoder counts make noise of the current, and the noise bounds kd.
//!
//! All gains with two margins in hand are compared by what they leave on average over frequency, in ratios: Åström and Hägglund
//! (Advanced PID Control, ch. 6) take the greatest integral gain with the margins kept, which is the same for slow
//! disturbances, and pays with the fast ones.

use hal_sim::DriveParameters;
use motion_kernel::axis::Gains;

use super::feedforward::FITTED_HZ;
use super::margins::{LoopPoint, Plant, position};
use crate::drive::model::{Complex, feedback};

/// Least phase margin \[°\]: S4's machine ran 39°.
pub const PHASE_MIN_DEG: f64 = 40.0;
/// Least gain margin.
pub const GAIN_MIN: f64 = 2.0;
/// Greatest kp that is looked at \[1/s\].
const KP_MAX_PER_S: f64 = 2000.0;
/// The least: below, a loop is none.
const KP_MIN_PER_S: f64 = 0.5;
/// Margins are kept by all gains this much above and below, too: a bed lets a loop touch a gain of 1 again, and models
/// know resonances to some per cent.
const GAIN_SPREAD: f64 = 1.03;
/// kd over kp at most, in time constants of the drive's velocity loop, and ki over kp, in kp of a P regulator; steps of each.
const LEAD_MAX: f64 = 1.0;
const RESET_MAX: f64 = 1.0;
const STEPS: u32 = 12;
/// The leak of ki, in rates of the drive's integral. From one on, axes with friction come to rest; a quarter is for a drive that
/// is faster than it was found.
const LEAK: f64 = 1.25;
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
    Gains {
        kp_per_s: gains.kp_per_s * factor,
        ki_per_s2: gains.ki_per_s2 * factor,
        kd: gains.kd * factor,
        ..gains
    }
}

/// The gains that leave least of a disturbance from 1 to 20 Hz, of those that keep both margins, with kd up to `kd_max`. All
/// are 0 if none do.
#[must_use]
pub fn best(drive: &DriveParameters, tick_s: f64, kd_max: f64) -> Gains {
    let plant = Plant::new(drive, tick_s);
    let judged: Vec<(f64, Complex)> =
        FITTED_HZ.map(f64::from).map(|hz| (hz, position(drive, tick_s, hz))).collect();
    let left = |gains: &Gains| -> f64 {
        let one = Complex::new(1.0, 0.0);
        let of = |&(hz, plant): &(f64, Complex)| plant / (one + feedback(gains, tick_s, hz) * plant);
        judged.iter().map(|point| libm::log(of(point).magnitude())).sum()
    };
    let alone = Gains { kp_per_s: 1.0, ..Gains::default() };
    let Some(kp_alone_per_s) = greatest(&plant, alone, KP_MAX_PER_S) else { return Gains::default() };
    let lag_s = (1.0 + drive.load_inertia_ratio) / drive.velocity_gain_per_s;
    let leak_per_s = (LEAK / drive.integral_time_s).min(1.0 / tick_s);
    let part = |step: u32| f64::from(step) / f64::from(STEPS);
    let shapes = (0..=STEPS).flat_map(|lead| (0..=STEPS).map(move |reset| (part(lead), part(reset))));
    let closed = shapes.filter_map(|(lead, reset)| {
        let shape = Gains {
            kp_per_s: 1.0,
            ki_per_s2: RESET_MAX * reset * kp_alone_per_s,
            ki_leak_per_s: if reset > 0.0 { leak_per_s } else { 0.0 },
            kd: LEAD_MAX * lead * lag_s,
        };
        let kp_max_per_s = if shape.kd > 0.0 { kd_max / shape.kd } else { KP_MAX_PER_S };
        Some(scaled(shape, greatest(&plant, shape, kp_max_per_s.min(KP_MAX_PER_S))?))
    });
    closed.min_by(|a, b| left(a).total_cmp(&left(b))).unwrap_or_default()
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
                let factors = [before, point].map(|point| 1.0 / point.magnitude);
                let [first, second] = factors;
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
    let scaled = scaled(gains, if gains.kp_per_s > 0.0 { kp_per_s / gains.kp_per_s } else { 0.0 });
    Gains {
        kp_per_s,
        ki_per_s2: digits(scaled.ki_per_s2, 3, f64::round),
        ki_leak_per_s: digits(gains.ki_leak_per_s, 3, f64::round),
        kd: digits(scaled.kd, 3, f64::round),
    }
}

/// `value` of at least 0 with a number of decimals behind its first digit.
fn digits(value: f64, decimals: i32, round: fn(f64) -> f64) -> f64 {
    if !(value > 0.0) {
        return 0.0;
    }
    let unit = 10_f64.powi(decimals - value.log10().floor() as i32);
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

    /// Against what P alone leaves: below 0.4 at 1 Hz, below half at 4 Hz, and no more at 20.
    #[test]
    fn three_gains_leave_less_than_one() {
        for drive in [REFERENCE_X, REFERENCE_Y] {
            let plant = Plant::new(&drive, TICK_S);
            let all =
                best(&drive, TICK_S, kd_max(&drive, TICK_S, 1e-4 / 12_f64.sqrt(), drive.accel_limit_mm_s2));
            let alone = Gains { kp_per_s: 222.0, ..Gains::default() };
            println!("{all:?} {:?}", plant.margins(all));
            assert!(keeps(&plant.margins(all)));
            for (hz, part) in [(1.0, 0.4), (4.0, 0.5), (20.0, 1.0)] {
                let parts = left_um(&drive, &all, hz) / left_um(&drive, &alone, hz);
                assert!(parts < part, "{hz} Hz: {parts}");
            }
        }
    }

    /// Noise bounds kd: five times the counts, a fifth of kd, until it is not worth having.
    #[test]
    fn noise_bounds_the_derivative() {
        for counts_mm in [1e-4, 1e-3, 5e-3, 2e-2] {
            let reading_mm = counts_mm / 12_f64.sqrt();
            let bound = kd_max(&REFERENCE_X, TICK_S, reading_mm, REFERENCE_X.accel_limit_mm_s2);
            let found = best(&REFERENCE_X, TICK_S, bound);
            println!("{counts_mm} mm: kd up to {bound:.4}, {found:?}");
            assert!(found.kd <= bound * (1.0 + 1e-12) && found.kp_per_s > 150.0);
            let noise_mm_s2 = found.kd * 440.0 * 2_f64.sqrt() * reading_mm / TICK_S;
            assert!(noise_mm_s2 <= NOISE_PART * 12_300.0 * (1.0 + 1e-12), "{noise_mm_s2}");
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
            let found = best(&drive, TICK_S, 1.0);
            println!("{frequency_hz} Hz: {found:?} {:?}", plant.margins(found));
            assert!(found.kp_per_s > 0.0);
            for part in -29..=29 {
                let near = plant.margins(scaled(found, 1.0 + 1e-3 * f64::from(part)));
                assert!(near.phase_deg >= PHASE_MIN_DEG && near.gain >= GAIN_MIN, "{part}: {near:?}");
            }
        }
    }

    #[test]
    fn what_is_written_has_few_digits() {
        let gains =
            written(Gains { kp_per_s: 254.91, ki_per_s2: 12_345.6, ki_leak_per_s: 72.727, kd: 0.345_678 });
        assert_eq!(gains, Gains { kp_per_s: 254.0, ki_per_s2: 12_300.0, ki_leak_per_s: 72.73, kd: 0.3444 });
        assert_eq!(written(Gains { kp_per_s: 3.456, ..Gains::default() }).kp_per_s, 3.45);
        assert_eq!(written(Gains::default()), Gains::default());
    }
}
