//! The jerk law, with sin² pulses and with plateaus, from outside: against the papers' printed examples, and
//! against its definition integrated in thirty digits.

#![allow(clippy::float_cmp, reason = "exact values are the point")]

mod inverse;
mod optimal;
mod oracle;
mod ramp;
mod segment;
mod cut;

use motion_kernel::law::Limits;
use motion_kernel::num::Root;
use motion_tests::PULSES;
use motion_tests::random::Random;

/// Sets of limits: S1's; a fast machine; a faster one; one whose jerk limit is out of reach; two whose ramps
/// are mostly limited by jerk, and mostly by acceleration. All are f32 values too.
const LIMITS: [(f64, f64, f64); 6] = [
    (500.0, 5e3, 4e5),
    (5e3, 1e5, 5e6),
    (12_500.0, 1e6, 1e8),
    (500.0, 1e5, 4e5),
    (100.0, 100.0, 1e4),
    (1.0, 1e4, 1e8),
];

fn limits((accel_mm_s2, jerk_mm_s3, snap_mm_s4): (f64, f64, f64)) -> Limits<f64> {
    Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 }
}

/// The same in the type under test. `limits` are values of that type.
fn narrow<R: Root>(limits: &Limits<f64>) -> Limits<R> {
    Limits {
        accel_mm_s2: R::from_f64(limits.accel_mm_s2),
        jerk_mm_s3: R::from_f64(limits.jerk_mm_s3),
        snap_mm_s4: R::from_f64(limits.snap_mm_s4),
    }
}

/// A feed from 10⁻³ to 10³ mm/s, at times 0; a value of `R`.
fn feed<R: Root>(random: &mut Random) -> f64 {
    if random.once_in(8) { 0.0 } else { R::from_f64(random.log(1e-3, 1e3)).to_f64() }
}

/// Two feeds, also close to each other, so that all regimes occur.
fn feeds<R: Root>(random: &mut Random) -> (f64, f64) {
    let from = feed::<R>(random);
    let to = match random.below(3) {
        0 => R::from_f64((from * (1.0 + random.log(1e-4, 1.0))).min(1e3)).to_f64(),
        1 => R::from_f64(from * (1.0 - random.log(1e-4, 1.0))).to_f64(),
        _ => feed::<R>(random),
    };
    (from, to)
}
