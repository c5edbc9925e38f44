//! Ramps that are cut in their rise, against the integral of their jerk.

use super::{LIMITS, PULSES, feeds, limits};
use motion_kernel::internals::{CutRamp, Phase};
use motion_kernel::law::{FeedSegment, Law, PathMotion, Ramp, SegmentError, Ticks};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::units::Position;
use motion_tests::random::Random;
use std::f64::consts::PI;

const TICK_S: f64 = 0.0005;
/// Error of the position: some steps, and a fixed-point product's 2⁻³² of every term, of which there are three.
const STEPS_MM: f64 = 8.0 / 4_294_967_296.0;
const PART: f64 = 3.0 / 4_294_967_296.0;

/// s, v, a of a jerk over time: Gauss's rule with three points, the Taylor polynomial's remainder in integral form.
fn integrated(state: [f64; 3], jerk: impl Fn(f64) -> f64, from_s: f64, to_s: f64) -> [f64; 3] {
    let [mut s, mut v, mut a] = state;
    let parts = 64;
    let width = (to_s - from_s) / f64::from(parts);
    let root = 0.6_f64.sqrt();
    for part in 0..parts {
        let start = from_s + f64::from(part) * width;
        let points = [(-root, 5.0 / 9.0), (0.0, 8.0 / 9.0), (root, 5.0 / 9.0)];
        let (mut ds, mut dv, mut da) = (0.0, 0.0, 0.0);
        for (at, weight) in points {
            let t = 0.5 * width * (1.0 + at);
            let left = width - t;
            let j = jerk(start + t) * weight * 0.5 * width;
            (da, dv, ds) = (da + j, dv + j * left, ds + j * left * left / 2.0);
        }
        s += v * width + a * width * width / 2.0 + ds;
        v += a * width + dv;
        a += da;
    }
    [s, v, a]
}

/// Every tick of a cut ramp as the executor walks through it.
fn walk<R: Real>(segment: &FeedSegment<R>, mut visit: impl FnMut(f64, &PathMotion<R>)) {
    let mut before = 0.0;
    for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
        let duration = segment.phase_duration(phase);
        // A part of a tick first, as wherever a phase begins inside one.
        let first = Ticks::from_bits((f64::ceil(before) * 4_294_967_296.0 - before * 4_294_967_296.0) as u64);
        let mut elapsed = first;
        let mut fraction = segment.fraction_at_start(phase).wrapping_add(segment.fraction_in(phase, first));
        while elapsed < duration {
            visit(before + elapsed.to_f64(), &segment.at(phase, fraction));
            elapsed = elapsed.plus(Ticks::ONE);
            fraction = fraction.wrapping_add(segment.fraction_in(phase, Ticks::ONE));
        }
        before += duration.to_f64();
    }
}

/// A random ramp and where it is cut.
fn some(random: &mut Random) -> Option<(Ramp<f64>, Ticks)> {
    let law = Law::new(*random.pick(&PULSES), limits(*random.pick(&LIMITS))).expect("limits");
    let (from, to) = feeds::<f32>(random);
    let ramp = Ramp::new(&law, from, to);
    let half = ramp.edge_s / TICK_S;
    (half > 1.0 && half < 4000.0).then(|| {
        let at = 0.01 + random.unit() * (half - 0.01);
        let at = if random.once_in(2) { at.ceil().min(half.floor()) } else { at };
        (ramp, Ticks::from_seconds(at, 1.0).expect("in range"))
    })
}

fn check<R: Real>(stream: u64, epsilon: f64) -> usize {
    let mut random = Random::of_stream(stream);
    let (mut worst, mut points) = ([0.0_f64; 5], 0);
    for _ in 0..600 {
        let Some((ramp, at)) = some(&mut random) else { continue };
        let cut = CutRamp { ramp, cut_s: at.to_f64() * TICK_S };
        let length = Position::from_mm(cut.length_mm()).expect("in range");
        let segment = match FeedSegment::<R>::cut(&ramp, at, length, TICK_S) {
            Ok(segment) => segment,
            Err(SegmentError::OutOfRange { .. }) => continue,
            Err(error) => panic!("{error} of {cut:?}"),
        };
        let (cut_s, t1_s, arch_s) = (cut.cut_s, ramp.t1_s, 2.0 * ramp.edge_s);
        let peak = if ramp.to_mm_s < ramp.from_mm_s { -ramp.peak_jerk_mm_s3 } else { ramp.peak_jerk_mm_s3 };
        // The law's jerk, its beginning backwards, and both once more with the other sign.
        let jerk = |t: f64| {
            let u = t.rem_euclid(2.0 * cut_s);
            let x = if u < cut_s { u } else { 2.0 * cut_s - u } / arch_s;
            peak * (PI * x).sin().powi(2) * if t < 2.0 * cut_s { 1.0 } else { -1.0 }
        };
        let (mut state, mut at_s) = ([0.0, ramp.from_mm_s, 0.0], 0.0);
        let mut to = |t: f64| {
            for knot in [cut_s, 2.0 * cut_s, 3.0 * cut_s] {
                if at_s < knot && knot < t {
                    state = integrated(state, jerk, at_s, knot);
                    at_s = knot;
                }
            }
            state = integrated(state, jerk, at_s, t);
            at_s = t;
            state
        };
        let highest = ramp.from_mm_s.max(ramp.to_mm_s);
        walk(&segment, |ticks, found| {
            let t = ticks * TICK_S;
            let [s, v, a] = to(t);
            // Time is rounded to 2^-32 tick.
            let late_s = 4.0 * TICK_S / 4_294_967_296.0 + 1e-15;
            let scale = peak.abs() * t1_s;
            // As far as the rise would have gone: its products have fractions of 32 bits.
            let whole_mm = highest * t1_s;
            let errors = [
                (found.s.to_mm() - s).abs()
                    / (STEPS_MM + whole_mm * PART + scale * t1_s * t1_s * (epsilon + PART) + v * late_s),
                (found.v_mm_s.to_f64() - v).abs() / (highest.max(scale * t1_s) * epsilon + a.abs() * late_s),
                (found.a_mm_s2.to_f64() - a).abs() / (scale * epsilon + peak.abs() * late_s),
                (found.j_mm_s3.to_f64() - jerk(t)).abs() / (peak.abs() * (epsilon + 6.3 * late_s / arch_s)),
                found.snap_mm_s4.to_f64().abs() / (PI * peak.abs() / arch_s * (1.0 + epsilon)),
            ];
            for (worst, error) in worst.iter_mut().zip(errors) {
                *worst = worst.max(error);
            }
            points += 1;
        });
        let [s, v, a] = to(cut.duration_s());
        assert!((s - cut.length_mm()).abs() < 1e-9 * (1.0 + s), "{cut:?}: {s}");
        assert!((v - cut.to_mm_s()).abs() < 1e-9 * highest, "{cut:?}: {v}");
        assert!(a.abs() < 1e-9 * peak.abs() * t1_s, "{cut:?}: {a}");
    }
    println!("{points} points, worst in parts of the bounds {worst:.3?}");
    assert!(worst.iter().all(|&worst| worst <= 1.0), "{worst:?}");
    points
}

#[test]
fn a_cut_ramp_is_the_integral_of_its_jerk() {
    let points = check::<f64>(31, 1e-12) + check::<f32>(32, 2e-6) + check::<Fixed>(33, 1e-6);
    assert!(points > 100_000, "{points}");
}

/// Up to the cut both are one ramp, to the bit.
#[test]
fn the_rise_is_that_of_the_ramp_under_way() {
    let (mut random, mut compared) = (Random::of_stream(34), 0);
    for _ in 0..800 {
        let Some((ramp, at)) = some(&mut random) else { continue };
        let cut = CutRamp { ramp, cut_s: at.to_f64() * TICK_S };
        let length = |mm| Position::from_mm(mm).expect("in range");
        let whole = FeedSegment::<f32>::ramp(&ramp, length(ramp.length_mm()), TICK_S);
        let other = FeedSegment::<f32>::cut(&ramp, at, length(cut.length_mm()), TICK_S);
        let (Ok(whole), Ok(other)) = (whole, other) else { continue };
        let mut fraction = 0;
        for _ in 0..(at.to_f64() as u64) {
            fraction += whole.fraction_in(Phase::Rise, Ticks::ONE);
            assert_eq!(whole.at(Phase::Rise, fraction), other.at(Phase::Rise, fraction), "{ramp:?}");
            compared += 1;
        }
    }
    assert!(compared > 10_000, "{compared}");
}

#[test]
fn a_cut_belongs_in_the_opening_edge() {
    let mut random = Random::of_stream(35);
    let (ramp, _) = std::iter::repeat_with(|| some(&mut random)).flatten().next().expect("endless");
    for share in [0.0, 1.0002, 1.8] {
        let at = Ticks::from_seconds(share * ramp.edge_s, TICK_S).expect("in range");
        let refused = FeedSegment::<f64>::cut(&ramp, at, Position::ZERO, TICK_S);
        assert!(matches!(refused, Err(SegmentError::OutOfRange { .. })), "{share}: {refused:?}");
    }
}
