//! Tests: ramps that are given up one after the other.

use super::list::Item;
use super::splice::Splice;
use crate::law::{FeedSegment, Law, Limits, Phase, PlannedRamp, Pulse, Ramp, Ticks};
use crate::queue::{Acceptance, PathRules};
use crate::random::Random;
use crate::units::Position;

/// Of the greatest figures of a run, in parts of them: a few roundings of sums of terms of their size.
const ROUNDING: f64 = 1e-13;
const TICK_S: f64 = 5e-4;

/// Given up 200 times in a row, each ramp beginning where the last one was left: every one is accepted, goes
/// on from the state in which the one before is given up, keeps the limits, and ends at rest of acceleration
/// at the feed of its pulses. No error accumulates.
#[test]
fn ramps_given_up_one_after_the_other_do_not_drift() {
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
    let rules = PathRules { limits, feed_mm_s: 300.0, junction_angle_rad: 0.0, junction_gap_mm: 0.0 };
    for (number, pulse) in [Pulse::Sin2, Pulse::Plateau].into_iter().cycle().take(40).enumerate() {
        let (random, law) = (Random::new(number as u64), Law::within(pulse, limits));
        let mut accept = Acceptance::<f64, 1>::new(rules, [Position::ZERO]);
        let mut start = Splice { stretch: 0, at: Position::ZERO, feed_mm_s: 0.0 };
        let (mut cuts, mut on_plateaus) = (0, 0);
        while cuts < 200 {
            let from_mm_s = start.feed_mm_s;
            let to_mm_s = 300.0 * random.unit();
            if libm::fabs(to_mm_s - from_mm_s) < 1.0 {
                continue;
            }
            let ramp = Ramp::new(&law, from_mm_s, to_mm_s);
            let length = Position::from_mm(ramp.length_mm()).expect("in range");
            let whole = Item::Feed(PlannedRamp { ramp, length });
            // On the plateau most of the time, else anywhere before the ramp brakes.
            let (phase, from_s, to_s) = match cuts % 5 {
                0 => (Phase::Rise, 0.0, ramp.t1_s),
                1 => (Phase::Hold, 0.0, ramp.t2_s - ramp.t1_s),
                _ => (Phase::Rise, ramp.edge_s, ramp.t1_s - ramp.edge_s),
            };
            let elapsed =
                Ticks::from_seconds(from_s + (to_s - from_s) * random.unit(), TICK_S).expect("in range");
            let Some(cut) = whole.cut(phase, elapsed, TICK_S) else { continue };
            let [whole, left] = [&whole, &cut].map(segment_of);
            goes_on(&whole, &left, phase, elapsed, &limits);
            keeps(&left, &limits);
            accept.segment(&left).unwrap_or_else(|error| panic!("{pulse:?} {number}, cut {cuts}: {error}"));
            let end = cut.end(&start, TICK_S);
            if let Item::Feed(PlannedRamp { ramp, .. }) = cut {
                // By its own pulses, which are not what it was cut by.
                let to_mm_s = ramp.peak_jerk_mm_s3 * (ramp.t1_s - ramp.edge_s) * ramp.t2_s;
                let off = libm::fabs(end.feed_mm_s - from_mm_s) - to_mm_s;
                assert!(
                    libm::fabs(off) <= ROUNDING * 300.0,
                    "{pulse:?} {number}, cut {cuts}: off by {off} mm/s"
                );
            }
            let plateau = ramp.edge_s..ramp.t1_s - ramp.edge_s;
            on_plateaus +=
                usize::from(phase == Phase::Rise && plateau.contains(&(elapsed.to_f64() * TICK_S)));
            (start, cuts) = (end, cuts + 1);
        }
        assert!(pulse == Pulse::Sin2 || on_plateaus > 80, "{on_plateaus} of {cuts}");
    }
}

fn segment_of(item: &Item) -> FeedSegment<f64> {
    match item {
        Item::Feed(planned) => planned.segment(TICK_S),
        Item::Cut { ramp, at, length } => FeedSegment::cut(ramp, *at, *length, TICK_S),
        _ => panic!("{item:?} is no feed"),
    }
    .expect("a segment")
}

/// Where `whole` is given up, `left` is in the same state.
fn goes_on(
    whole: &FeedSegment<f64>,
    left: &FeedSegment<f64>,
    phase: Phase,
    elapsed: Ticks,
    limits: &Limits<f64>,
) {
    let [then, now] = [whole, left].map(|segment| segment.at(phase, segment.fraction_after(phase, elapsed)));
    // Time is counted in steps of 2⁻³² tick; both lengths are rounded to position steps.
    let step_s = f64::powi(2.0, -32) * TICK_S;
    let place_mm = 2e-8;
    for (name, then, now, most) in [
        ("place", then.s.to_mm(), now.s.to_mm(), place_mm),
        ("feed", then.v_mm_s, now.v_mm_s, step_s * limits.accel_mm_s2 + ROUNDING * 300.0),
        ("acceleration", then.a_mm_s2, now.a_mm_s2, step_s * limits.jerk_mm_s3),
        ("jerk", then.j_mm_s3, now.j_mm_s3, step_s * limits.snap_mm_s4),
    ] {
        assert!(libm::fabs(now - then) <= most, "{name} goes from {then} to {now}");
    }
}

/// Every tick is within the limits, and acceleration and jerk come to 0 with the end.
fn keeps(segment: &FeedSegment<f64>, limits: &Limits<f64>) {
    for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
        let duration = segment.phase_duration(phase);
        let mut elapsed = Ticks::ZERO;
        while elapsed < duration {
            let motion = segment.at(phase, segment.fraction_after(phase, elapsed));
            let shares = [
                motion.a_mm_s2 / limits.accel_mm_s2,
                motion.j_mm_s3 / limits.jerk_mm_s3,
                motion.snap_mm_s4 / limits.snap_mm_s4,
            ];
            assert!(shares.into_iter().all(|share| libm::fabs(share) <= 1.0 + ROUNDING), "{shares:?}");
            elapsed = elapsed.plus(Ticks::ONE);
        }
    }
    // A step before the end, which is the fraction 0 again.
    let last = segment.phase_duration(Phase::Fall).minus(Ticks::from_bits(1)).expect("a fall");
    let end = segment.at(Phase::Fall, segment.fraction_after(Phase::Fall, last));
    let clock = 2.0 * f64::powi(2.0, -32) * TICK_S * limits.jerk_mm_s3;
    assert!(
        libm::fabs(end.a_mm_s2) <= clock && libm::fabs(end.v_mm_s - segment.to_mm_s()) <= clock,
        "{end:?}"
    );
}
