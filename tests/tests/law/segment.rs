//! [`FeedSegment`], the form the tick evaluates, against the ramp it was made from.

use super::{LIMITS, PULSES, feeds, limits};
use motion_kernel::internals::Phase;
use motion_kernel::law::{
    FeedSegment, FeedState, Law, LimitedBy, Limits, PathMotion, Pulse, Ramp, SegmentError, Ticks,
};
use motion_kernel::num::{Fixed, Real, Root, Scalar};
use motion_kernel::units::Position;
use motion_tests::random::Random;

/// Greatest errors of V, A, J and snap, in the number type's epsilon times the ramp's greatest value of
/// the quantity, beyond what the rounding of time explains. Measured: 1.6, 1.4, 3.9 and 6.5 (f32).
const STATE_EPSILONS: [f64; 4] = [2.0, 4.0, 8.0, 12.0];
/// The same in fixed point, whose steps do not get smaller with the values: feeds from 1 mm/s, accelerations from
/// 1 mm/s². Measured: 100, 53, 65 and 371.
const FIXED_EPSILONS: [f64; 4] = [120.0, 64.0, 80.0, 450.0];
/// Greatest error of the position: a part of the length and of Jp·t₁³, the number type's epsilon in the sine's
/// part of Jp·(2e)³, and some steps. The first is the fixed-point product's 2⁻³² (documented with the
/// segment) twice, and the time step's 2⁻³³; the sine has snap's error and half an epsilon of time, 2π-fold.
const LENGTH_PART: f64 = 2.5 / 4_294_967_296.0;
const SINE_EPSILONS: f64 = (STATE_EPSILONS[3] + std::f64::consts::PI) / 496.1;
const CUBE_PART: f64 = 1.0 / 4_294_967_296.0;
const STEPS_MM: f64 = 6.0 / 4_294_967_296.0;

const TICK: f64 = 4_294_967_296.0;

fn ticks(ticks: f64) -> Ticks {
    Ticks::from_seconds(ticks, 1.0).expect("in range")
}

/// The states of a ramp beyond its span of time too; taken apart so that a phase is always seen from inside.
fn at_phase(ramp: &Ramp<f64>, phase: Phase, in_phase_s: f64) -> FeedState<f64> {
    ramp.at(match phase {
        Phase::Rise => in_phase_s,
        Phase::Hold => ramp.t1_s + in_phase_s,
        Phase::Fall => ramp.t2_s + in_phase_s,
    })
}

/// What a comparison found: greatest errors of V, A, J, snap as in [`STATE_EPSILONS`], and of the position in
/// parts of its bound.
#[derive(Debug, Default)]
struct Worst {
    state: [f64; 4],
    position: f64,
    points: usize,
}

/// The comparison at one moment: `in_phase_s` after the phase's start, `late_s` what the time may be off by.
struct Moment<'a> {
    ramp: &'a Ramp<f64>,
    phase: Phase,
    in_phase_s: f64,
    late_s: f64,
}

impl Worst {
    fn compare<R: Real>(&mut self, moment: &Moment<'_>, length_mm: f64, found: &PathMotion<R>) {
        let Moment { ramp, phase, in_phase_s, late_s } = *moment;
        let exact = at_phase(ramp, phase, in_phase_s);
        let (jerk, t1_s, arch_s) = (ramp.peak_jerk_mm_s3, ramp.t1_s, 2.0 * ramp.edge_s);
        let highest = ramp.from_mm_s.max(ramp.to_mm_s);
        let over_arch = |value: f64| if arch_s > 0.0 { value / arch_s } else { 0.0 };
        let peak = [highest, ramp.peak_accel_mm_s2(), jerk, over_arch(std::f64::consts::PI * jerk)];
        let crackle = over_arch(over_arch(2.0 * std::f64::consts::PI.powi(2) * jerk));
        // By how much each may change while the time is off.
        let moves = [exact.a_mm_s2, exact.j_mm_s3, exact.snap_mm_s4, crackle];
        let moved = |n: usize| {
            let chain = moves[n..].iter().enumerate();
            chain.rev().fold(0.0, |sum, (power, rate)| (sum + rate.abs()) * late_s / (power as f64 + 1.0))
        };
        let states = [
            (found.v_mm_s, exact.v_mm_s),
            (found.a_mm_s2, exact.a_mm_s2),
            (found.j_mm_s3, exact.j_mm_s3),
            (found.snap_mm_s4, exact.snap_mm_s4),
        ];
        for (n, (found, exact)) in states.iter().enumerate() {
            let error = (found.to_f64() - exact).abs() - moved(n);
            if error > 0.0 {
                self.state[n] = self.state[n].max(error / (R::EPSILON * peak[n]));
            }
        }
        let bound = LENGTH_PART * length_mm
            + SINE_EPSILONS * R::EPSILON * jerk * arch_s.powi(3)
            + CUBE_PART * jerk * t1_s.powi(3)
            + STEPS_MM
            + exact.v_mm_s.max(0.0) * late_s
            + 4.0 * f64::EPSILON * length_mm;
        let error = (found.s.to_mm() - exact.s_mm).abs();
        assert!(error <= 100.0 * bound, "{error:e} mm at {in_phase_s} s in {phase:?} of {ramp:?}: {found:?}");
        self.position = self.position.max(error / bound);
        self.points += 1;
    }

    fn check(&self, state_epsilons: [f64; 4]) {
        println!("{self:.3?}");
        for (worst, bound) in self.state.iter().zip(state_epsilons) {
            assert!(worst <= &bound, "{self:?}");
        }
        assert!(self.position <= 1.0, "{self:?}");
    }
}

/// Goes through a segment as the executor does: a part of a tick first, whole ticks after it. Of a long phase,
/// the beginning, the end and a few ticks between: adding a step n times is a product.
fn walk<R: Real>(
    random: &mut Random,
    ramp: &Ramp<f64>,
    segment: &FeedSegment<R>,
    tick_s: f64,
    worst: &mut Worst,
) {
    let length_mm = segment.length().to_mm();
    for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
        let duration = segment.phase_duration(phase);
        // How far into the phase its first whole tick ends: also at its very start, and after a whole tick.
        let first = match random.below(4) {
            0 => 0.0,
            1 => 1.0,
            _ => (random.unit() * TICK).floor() / TICK,
        };
        let whole = (duration.to_f64() - first).max(0.0);
        let mut counts: Vec<u64> = (0..8).map(|_| (whole * random.unit()) as u64).collect();
        counts.extend([0, 1, 2, (whole as u64).saturating_sub(1), whole as u64]);
        for count in counts {
            let elapsed = first + count as f64;
            let early = ticks(first) < duration;
            if !early || duration.minus(ticks(elapsed)).is_none_or(|left| left == Ticks::ZERO) {
                continue;
            }
            let fraction = segment
                .fraction_in(phase, ticks(first))
                .wrapping_add(segment.fraction_in(phase, Ticks::ONE).wrapping_mul(count));
            // Durations are rounded to 2⁻³³ tick; within a tick the time is divided by the duration in 2⁻³²
            // tick; each whole tick adds a step rounded to 2⁻⁶⁴.
            let drift = (count as f64 + 2.0) / TICK / TICK * duration.to_f64();
            let late_s = (2.0 / TICK + drift) * tick_s + 2.0 * f64::EPSILON * ramp.duration_s();
            let moment = Moment { ramp, phase, in_phase_s: elapsed * tick_s, late_s };
            worst.compare(&moment, length_mm, &segment.at(phase, fraction));
        }
    }
}

fn ends_are_exact<R: Real>(segment: &FeedSegment<R>) {
    let at_rest = |motion: &PathMotion<R>| {
        motion.a_mm_s2 == R::ZERO && motion.j_mm_s3 == R::ZERO && motion.snap_mm_s4 == R::ZERO
    };
    let (start, end) = (segment.at(Phase::Rise, 0), segment.at(Phase::Fall, u64::MAX));
    assert!(start.s == Position::ZERO && start.v_mm_s == segment.from_mm_s() && at_rest(&start), "{start:?}");
    assert!(end.s == segment.length() && end.v_mm_s == segment.to_mm_s() && at_rest(&end), "{end:?}");
    let phases = [Phase::Rise, Phase::Hold, Phase::Fall].map(|phase| segment.phase_duration(phase));
    assert_eq!(phases[0].plus(phases[1]).plus(phases[2]), segment.duration());
}

fn random_segments<R: Real>(stream: u64) {
    let mut random = Random::of_stream(stream);
    let mut worst = Worst::default();
    let mut below_a_tick = 0;
    for _ in 0..20_000 {
        let tick_s = if random.once_in(2) { 5e-4 } else { random.log(1e-5, 1e-2) };
        let law = Law::new(*random.pick(&PULSES), limits(*random.pick(&LIMITS))).expect("positive");
        let (from, to) = feeds::<R32>(&mut random);
        let ramp = Ramp::new(&law, from, to);
        let length = Position::from_mm(ramp.length_mm()).expect("in range");
        let segment = FeedSegment::<R>::ramp(&ramp, length, tick_s).expect("a segment");
        ends_are_exact(&segment);
        let ticks = segment.duration().to_f64();
        assert!(
            (ticks * tick_s - ramp.duration_s()).abs() <= (2.0 / TICK) * tick_s + 1e-15 * ramp.duration_s()
        );
        below_a_tick += usize::from(ticks < 1.0);
        walk(&mut random, &ramp, &segment, tick_s, &mut worst);
    }
    assert!(below_a_tick > 100, "ramps shorter than a tick must occur: {below_a_tick}");
    worst.check(STATE_EPSILONS);
}

/// Feeds of both types' tests are f32 values, so that a segment's rounding is not a rounding of its feeds.
type R32 = f32;

#[test]
fn f64_segments_are_their_ramps() {
    random_segments::<f64>(30);
}

#[test]
fn f32_segments_are_their_ramps() {
    random_segments::<f32>(31);
}

/// Every tick of some ramps and cruises, adding up: the executor's own way.
#[test]
fn steps_add_up() {
    let mut random = Random::of_stream(32);
    for _ in 0..200 {
        let law = Law::new(*random.pick(&PULSES), limits(*random.pick(&LIMITS[..4]))).expect("positive");
        let (from, to) = feeds::<f64>(&mut random);
        let ramp = Ramp::new(&law, from, to);
        let length = Position::from_mm(ramp.length_mm()).expect("in range");
        let segment = FeedSegment::<f64>::ramp(&ramp, length, 5e-4).expect("a segment");
        for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
            let duration = segment.phase_duration(phase);
            let (first, step) =
                (segment.fraction_in(phase, ticks(0.5)), segment.fraction_in(phase, Ticks::ONE));
            let (mut elapsed, mut fraction, mut before) = (0.5, first, Position::ZERO);
            while ticks(elapsed) < duration {
                let (found, exact) = (fraction as f64 / TICK / TICK, elapsed / duration.to_f64());
                // A phase within a tick is divided by its duration in 2⁻³² tick.
                let coarse = if duration > Ticks::ONE { 1e-15 } else { 1.0 / TICK };
                assert!(
                    (found - exact).abs() < coarse + elapsed / TICK / TICK,
                    "{phase:?} {elapsed} of {segment:?}"
                );
                let here = segment.at(phase, fraction);
                // Backwards by rounding only.
                assert!((here.s - before).to_bits() >= -4, "{before:?} {here:?}");
                before = here.s;
                (elapsed, fraction) = (elapsed + 1.0, fraction.wrapping_add(step));
            }
        }
    }
}

/// Pulses with plateaus of any length, from none to 10⁹ edges, seen in their edges too, which may be a
/// ten-millionth of a tick. Returns how many of them the number type can't hold.
fn plateaus_of_any_length<R: Real>(stream: u64, state_epsilons: [f64; 4]) -> usize {
    let mut random = Random::of_stream(stream);
    let (mut worst, mut refused) = (Worst::default(), 0);
    for _ in 0..20_000 {
        let plateau_edges = if random.once_in(5) { 0.0 } else { random.log(1e-9, 1e9) };
        let t1_s = random.log(1e-4, 1.0);
        let edge_s = t1_s / (plateau_edges + 2.0);
        let t2_s = t1_s + if random.once_in(2) { 0.0 } else { random.log(1e-5, 1.0) };
        let from_mm_s = f64::from(random.log(1e-2, 300.0) as f32);
        let to_mm_s = f64::from((from_mm_s + random.log(1.0, 2000.0) * t2_s) as f32);
        let (from_mm_s, to_mm_s) =
            if random.once_in(2) { (from_mm_s, to_mm_s) } else { (to_mm_s, from_mm_s) };
        let peak_jerk_mm_s3 = (to_mm_s - from_mm_s).abs() / t2_s / (t1_s - edge_s);
        let limited_by = LimitedBy::Jerk;
        let ramp = Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, limited_by };
        let length = Position::from_mm(ramp.length_mm()).expect("in range");
        let segment = match FeedSegment::<R>::ramp(&ramp, length, 5e-4) {
            Ok(segment) => segment,
            Err(SegmentError::OutOfRange {
                quantity: "peak snap [mm/s⁴]" | "peak jerk [mm/s³]", ..
            }) => {
                refused += 1;
                continue;
            }
            Err(error) => panic!("{error}: {ramp:?}"),
        };
        ends_are_exact(&segment);
        let [part, place] = [edge_s / t1_s, random.unit()];
        for x in [place * part, part, part + place * (1.0 - 2.0 * part), 1.0 - part, 1.0 - place * part] {
            let fraction = (x * TICK * TICK) as u64;
            let exact_s = fraction as f64 / TICK / TICK * t1_s;
            let late_s = 2.0 * f64::EPSILON * ramp.duration_s();
            for (phase, fraction, in_phase_s) in
                [(Phase::Rise, fraction, exact_s), (Phase::Fall, !fraction, t1_s - exact_s)]
            {
                let moment = Moment { ramp: &ramp, phase, in_phase_s, late_s };
                worst.compare(&moment, length.to_mm(), &segment.at(phase, fraction));
            }
        }
    }
    worst.check(state_epsilons);
    refused
}

#[test]
fn plateaus_from_none_to_a_thousand_million_edges() {
    assert_eq!(plateaus_of_any_length::<f64>(36, STATE_EPSILONS), 0);
    assert_eq!(plateaus_of_any_length::<f32>(37, STATE_EPSILONS), 0);
    // Fixed point has no place for the snap of edges of a microsecond: 6716 of 20 000.
    let refused = plateaus_of_any_length::<Fixed>(38, FIXED_EPSILONS);
    assert!(refused < 7000, "{refused}");
}

/// The phases of a segment meet: no step of position, feed or acceleration where one ends and the next begins.
#[test]
fn phases_meet() {
    fn check<R: Real>(random: &mut Random) {
        for _ in 0..20_000 {
            let law = Law::new(*random.pick(&PULSES), limits(*random.pick(&LIMITS))).expect("positive");
            let (from, to) = feeds::<R32>(random);
            let ramp = Ramp::new(&law, from, to);
            let length = Position::from_mm(ramp.length_mm()).expect("in range");
            let segment = FeedSegment::<R>::ramp(&ramp, length, 1e-3).expect("a segment");
            let peak_mm = ramp.peak_jerk_mm_s3 * ramp.t1_s.powi(3);
            let step_mm = STEPS_MM + LENGTH_PART * length.to_mm() + R::EPSILON * peak_mm;
            for (before, after) in [(Phase::Rise, Phase::Hold), (Phase::Hold, Phase::Fall)] {
                let (before, after) = (segment.at(before, u64::MAX), segment.at(after, 0));
                assert!((after.s - before.s).to_mm().abs() <= step_mm, "{before:?} {after:?} of {ramp:?}");
                let feed_step = (after.v_mm_s - before.v_mm_s).to_f64().abs();
                assert!(feed_step <= 4.0 * R::EPSILON * from.max(to), "{before:?} {after:?} of {ramp:?}");
                let accel_step = (after.a_mm_s2 - before.a_mm_s2).to_f64().abs();
                assert!(accel_step <= 4.0 * R::EPSILON * segment.peak_accel_mm_s2().to_f64());
                assert!(after.j_mm_s3.to_f64().abs() <= 1e-6 * ramp.peak_jerk_mm_s3);
            }
        }
    }
    let mut random = Random::of_stream(33);
    check::<f64>(&mut random);
    check::<f32>(&mut random);
}

/// 8 m at 0.01 mm/s, nine days: position within the stated part of the length at any tick.
#[test]
fn long_and_slow() {
    let length = Position::from_mm(8000.0).expect("in range");
    let segment = FeedSegment::<f32>::cruise(0.01, length, 5e-4).expect("a segment");
    assert_eq!(segment.phase_duration(Phase::Rise), Ticks::ZERO);
    assert_eq!(segment.duration().to_f64(), 1.6e9);
    let (first, step) =
        (segment.fraction_in(Phase::Hold, ticks(0.25)), segment.fraction_in(Phase::Hold, Ticks::ONE));
    let mut worst = 0.0_f64;
    for part in 0..=1000_u32 {
        let count = (1.6e9 - 1.0) as u64 / 1000 * u64::from(part);
        let motion = segment.at(Phase::Hold, first.wrapping_add(step.wrapping_mul(count)));
        assert!(motion.v_mm_s == 0.01 && motion.a_mm_s2 == 0.0);
        worst = worst.max((motion.s.to_mm() - (count as f64 + 0.25) * 5e-6).abs());
    }
    println!("8 m at 0.01 mm/s: {:.2} nm", worst * 1e6);
    assert!(worst <= LENGTH_PART * 8000.0);
    // A slow ramp of the softest limits: 83 minutes.
    let soft = Limits { accel_mm_s2: 1e-2, jerk_mm_s3: 1e-4, snap_mm_s4: 1e-3 };
    let ramp = Ramp::new(&Law::new(Pulse::Sin2, soft).expect("positive"), 0.0, 50.0);
    let length = Position::from_mm(ramp.length_mm()).expect("in range");
    let (mut random, mut worst) = (Random::of_stream(34), Worst::default());
    for _ in 0..100 {
        let segment = FeedSegment::<f64>::ramp(&ramp, length, 1e-5).expect("a segment");
        walk(&mut random, &ramp, &segment, 1e-5, &mut worst);
    }
    worst.check(STATE_EPSILONS);
}

/// Limits so soft that a ramp takes most of a minute and metres: f32 keeps the promised quarter of a 0.1 µm count.
#[test]
fn soft_limits_keep_their_counts_in_f32() {
    // Softer still is refused by name.
    let softer = Ramp::new(&Law::new(Pulse::Sin2, limits((50.0, 0.5, 100.0))).expect("positive"), 0.0, 300.0);
    let length = Position::from_mm(softer.length_mm()).expect("in range");
    let refused = FeedSegment::<f32>::ramp(&softer, length, 5e-4);
    assert!(matches!(refused, Err(SegmentError::OutOfRange { quantity: "jerk · (2·edge)³ [mm]", .. })));
    for (soft, to) in [((50.0, 2.0, 4e5), 300.0), ((50.0, 1.7, 100.0), 300.0), ((20.0, 1.0, 1.0), 200.0)] {
        let ramp = Ramp::new(&Law::new(Pulse::Sin2, limits(soft)).expect("positive"), 0.0, to);
        let length = Position::from_mm(ramp.length_mm()).expect("in range");
        let narrow = FeedSegment::<f32>::ramp(&ramp, length, 5e-4).expect("a segment");
        let wide = FeedSegment::<f64>::ramp(&ramp, length, 5e-4).expect("a segment");
        let mut worst = 0.0_f64;
        for part in 0..200_000_u64 {
            let fraction = part * (u64::MAX / 200_000);
            for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
                let found = narrow.at(phase, fraction).s - wide.at(phase, fraction).s;
                worst = worst.max(found.to_mm().abs());
            }
        }
        println!("{soft:?}, {:.0} s: {:.4} counts", ramp.duration_s(), worst * 1e4);
        assert!(worst < 2.5e-5, "{soft:?}: {worst:e} mm");
    }
}

/// What does not fit is refused by name.
#[test]
fn refusals() {
    let law = Law::new(Pulse::Sin2, limits(LIMITS[0])).expect("positive");
    let ramp = Ramp::new(&law, 0.0, 200.0);
    let position = |mm| Position::from_mm(mm).expect("in range");
    let made = |ramp: &Ramp<f64>, mm, tick_s| FeedSegment::<f32>::ramp(ramp, position(mm), tick_s);
    assert!(made(&ramp, 60.0, 5e-4).is_ok());
    for mm in [60.000_001, 59.999_999, 0.0, -60.0] {
        assert!(matches!(made(&ramp, mm, 5e-4), Err(SegmentError::LengthMismatch { .. })), "{mm}");
    }
    for tick_s in [0.0, -1.0, f64::NAN, 1e-12] {
        assert!(matches!(made(&ramp, 60.0, tick_s), Err(SegmentError::OutOfRange { .. })), "{tick_s}");
    }
    for feed in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
        let cruise = FeedSegment::<f32>::cruise(feed, position(1.0), 5e-4);
        let infinite = feed == f64::INFINITY;
        assert!(matches!(cruise, Err(SegmentError::OutOfRange { .. })), "{feed} {infinite} {cruise:?}");
    }
    // A ramp without a rise would step at its end, and the set-points with it.
    for from_mm_s in [0.0, 100.0, 199.999] {
        let (edge_s, t1_s, t2_s, peak_jerk_mm_s3) = (0.0, 0.0, 120.0 / (from_mm_s + 200.0), 0.0);
        let step = Ramp { from_mm_s, edge_s, t1_s, t2_s, peak_jerk_mm_s3, ..ramp };
        assert_eq!(made(&step, 60.0, 5e-4), Err(SegmentError::FeedStep { from_mm_s, to_mm_s: 200.0 }));
    }
    let nan = Ramp { from_mm_s: f64::NAN, ..ramp };
    assert!(made(&nan, 60.0, 5e-4).is_err());
    for (mut broken, quantity) in [(ramp, "t2 − t1 [s]"), (ramp, "t1 [s]")] {
        if quantity == "t1 [s]" {
            (broken.t1_s, broken.t2_s) = (-0.2, 0.8)
        } else {
            (broken.t1_s, broken.t2_s) = (0.4, 0.2)
        }
        assert!(
            matches!(made(&broken, 60.0, 5e-4), Err(SegmentError::OutOfRange { quantity: q, .. }) if q == quantity)
        );
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for place in 0..3 {
            let mut set = [500.0, 5e3, 4e5];
            set[place] = bad;
            let error = Law::new(Pulse::Sin2, limits((set[0], set[1], set[2]))).expect_err("must be refused");
            assert_eq!(error.quantity, ["acceleration", "jerk", "snap"][place]);
        }
    }
}

/// In a narrower planning type the ramp's figures carry that type's rounding, and no more.
#[test]
fn ramps_of_f32_make_segments() {
    let mut random = Random::of_stream(35);
    for _ in 0..5000 {
        let wide = limits(*random.pick(&LIMITS));
        let law = Law::new(*random.pick(&PULSES), super::narrow::<f32>(&wide)).expect("positive");
        let (from, to) = feeds::<f32>(&mut random);
        let ramp = Ramp::new(&law, <f32 as Scalar>::from_f64(from), <f32 as Scalar>::from_f64(to));
        let length = Position::from_mm(Root::sqrt(ramp.length_mm()).to_f64().powi(2)).expect("in range");
        let segment = FeedSegment::<f32>::ramp(&ramp, length, 5e-4).expect("a segment");
        ends_are_exact(&segment);
    }
}
