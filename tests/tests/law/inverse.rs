//! The inverse problems against bisection in thirty digits.

use super::oracle::length;
use super::{LIMITS, PULSES, feed, limits, narrow};
use motion_kernel::internals::peak;
use motion_kernel::law::{Law, Limits, Pulse, reach};
use motion_kernel::num::Root;
use motion_tests::dd::{Dd, dd};
use motion_tests::random::Random;

/// Greatest errors of a feed in units in the last place, in f64 and f32. Measured over six seeds: 4.4 and 5.3;
/// 4.6 and 5.3. Newton's steps are bounded, so this also says that the bound is enough.
const REACH_ULP: (f64, f64) = (6.0, 7.0);
const PEAK_ULP: (f64, f64) = (6.0, 7.0);
/// How much longer than the room a ramp to a feed found may be, relative, in the type's epsilon: the rounding of
/// the length. An ulp of feed is far more: at 83 mm/s 0.1 µm of ramp in f64, 82 µm in f32.
const OVERRUN_EPSILONS: f64 = 8.0;

/// The distance of values around `value` in `R`.
fn ulp<R: Root>(value: f64) -> f64 {
    R::EPSILON * value.log2().floor().exp2()
}

/// By how many ulp of `R` `found` is off the root of the increasing `excess` above `least`.
fn error_ulp<R: Root>(found: f64, least: f64, excess: impl Fn(Dd) -> Dd) -> f64 {
    let ulp = ulp::<R>(found);
    let mut below = 1.0;
    let mut low = dd(found);
    while low.hi > least && excess(low) > Dd::ZERO {
        low = dd((found - below * ulp).max(least));
        below *= 2.0;
    }
    let mut high = dd(found);
    let mut above = 1.0;
    while excess(high) < Dd::ZERO {
        high = dd(found) + dd(above * ulp);
        above *= 2.0;
        assert!(above < 1e6, "far from the root");
    }
    while (high - low).hi > 1e-3 * ulp {
        let middle = (low + high) * dd(0.5);
        if excess(middle) > Dd::ZERO { high = middle } else { low = middle }
    }
    ((dd(found) - low).hi / ulp).abs()
}

/// Shares of errors up to 1 and 2 ulp, and the greatest.
#[derive(Debug, Default)]
struct Errors {
    cases: usize,
    to_one: usize,
    to_two: usize,
    worst: f64,
    /// Greatest by which the ramp to the found feed is longer than the length, relative.
    overrun: f64,
}

impl Errors {
    fn add(&mut self, error: f64, taken: Dd, room: f64) {
        self.cases += 1;
        self.to_one += usize::from(error <= 1.0);
        self.to_two += usize::from(error <= 2.0);
        self.worst = self.worst.max(error);
        self.overrun = self.overrun.max((taken.hi - room) / room);
    }

    fn check<R: Root>(&self, what: &str, bound: f64) {
        let percent = |count: usize| 100.0 * count as f64 / self.cases as f64;
        println!(
            "{what}: {} cases, {:.1} % within 1 ulp, {:.1} % within 2, worst {:.2} ulp; overrun {:.1e}",
            self.cases,
            percent(self.to_one),
            percent(self.to_two),
            self.worst,
            self.overrun
        );
        assert!(self.cases > 1000 && self.worst <= bound, "{what}: {self:?}");
        assert!(self.overrun <= OVERRUN_EPSILONS * R::EPSILON, "{what}: {self:?}");
    }
}

fn room<R: Root>(random: &mut Random) -> f64 {
    R::from_f64(random.log(1e-6, 2e3)).to_f64()
}

fn laws<R: Root>() -> Vec<(Limits<f64>, Law<R>)> {
    let sets = PULSES.iter().flat_map(|&pulse| LIMITS.map(|set| (pulse, limits(set))));
    sets.map(|(pulse, limits)| (limits, Law::new(pulse, narrow(&limits)).expect("positive"))).collect()
}

fn reach_errors<R: Root>(stream: u64, bound: f64) {
    let mut random = Random::of_stream(stream);
    let laws = laws::<R>();
    let mut errors = Errors::default();
    for _ in 0..20_000 {
        let (limits, law) = random.pick(&laws);
        let (lower, room) = (feed::<R>(&mut random), room::<R>(&mut random));
        let found = reach(law, R::from_f64(lower), R::from_f64(room)).to_f64();
        let error =
            error_ulp::<R>(found, lower, |higher| length(law.pulse(), limits, dd(lower), higher) - dd(room));
        assert!(error < 100.0, "{error} ulp: {limits:?} from {lower} within {room}: {found}");
        errors.add(error, length(law.pulse(), limits, dd(lower), dd(found)), room);
    }
    errors.check::<R>("reach", bound);
}

fn peak_errors<R: Root>(stream: u64, bound: f64) {
    let mut random = Random::of_stream(stream);
    let laws = laws::<R>();
    let mut errors = Errors::default();
    for _ in 0..20_000 {
        let (limits, law) = random.pick(&laws);
        let (from, other, room) = (feed::<R>(&mut random), feed::<R>(&mut random), room::<R>(&mut random));
        let to = if random.once_in(4) { from } else { other };
        let found = peak(law, R::from_f64(from), R::from_f64(to), R::from_f64(room)).to_f64();
        if length(law.pulse(), limits, dd(from), dd(to)) >= dd(room) {
            assert_eq!(found, from.max(to), "no room: {limits:?} {from} {to} {room}");
            continue;
        }
        let both =
            |peak| length(law.pulse(), limits, dd(from), peak) + length(law.pulse(), limits, peak, dd(to));
        let error = error_ulp::<R>(found, from.max(to), |peak| both(peak) - dd(room));
        assert!(error < 100.0, "{error} ulp: {limits:?} {from} to {to} within {room}: {found}");
        errors.add(error, both(dd(found)), room);
    }
    errors.check::<R>("peak", bound);
}

#[test]
fn reach_in_f64() {
    reach_errors::<f64>(40, REACH_ULP.0);
}

#[test]
fn reach_in_f32() {
    reach_errors::<f32>(41, REACH_ULP.1);
}

#[test]
fn peak_in_f64() {
    peak_errors::<f64>(42, PEAK_ULP.0);
}

#[test]
fn peak_in_f32() {
    peak_errors::<f32>(43, PEAK_ULP.1);
}

/// The length of a ramp grows with its higher feed everywhere, regimes' boundaries included; and more room
/// never gives a lower feed than the errors above explain.
#[test]
fn monotone_in_the_higher_feed() {
    let mut random = Random::of_stream(44);
    let laws = laws::<f64>();
    for _ in 0..100_000 {
        let (limits, law) = random.pick(&laws);
        let lower = feed::<f64>(&mut random);
        let peak_jerk = (2.0 * limits.accel_mm_s2 * limits.snap_mm_s4 / std::f64::consts::PI)
            .sqrt()
            .min(limits.jerk_mm_s3);
        let boundary = match random.below(3) {
            0 => (std::f64::consts::PI / limits.snap_mm_s4).powi(2) * peak_jerk.powi(3) / 2.0,
            1 if law.pulse() == Pulse::Sin2 => 2.0 * limits.accel_mm_s2.powi(2) / peak_jerk,
            1 => {
                let edge_s = std::f64::consts::PI * peak_jerk / (2.0 * limits.snap_mm_s4);
                limits.accel_mm_s2 * (limits.accel_mm_s2 / peak_jerk + edge_s)
            }
            _ => random.log(1e-6, 1e3),
        };
        let change = boundary * (1.0 + (random.unit() - 0.5) * random.log(1e-12, 1.0));
        let more = change * (1.0 + random.log(1e-12, 1e-1)) + 8.0 * ulp::<f64>(lower + change);
        let (short, long) =
            (law.ramp_length_mm(lower, lower + change), law.ramp_length_mm(lower, lower + more));
        assert!(long >= short, "{limits:?} from {lower} by {change} {more}: {short} {long}");
        let room = random.log(1e-6, 2e3);
        let (near, far) = (reach(law, lower, room), reach(law, lower, room * (1.0 + random.log(1e-15, 1.0))));
        assert!(far >= near - 8.0 * ulp::<f64>(near), "{limits:?} from {lower} within {room}: {near} {far}");
        assert!(near >= lower);
    }
}

/// S1's limits do not show the often-quoted example; these do: from 60 mm/s stopping takes 2.94 mm, slowing to
/// 20 mm/s takes 3.20 mm. So within 3 mm one can brake to 0 from 60 mm/s, not to 20, and again to 40.
#[test]
fn not_monotone_in_the_lower_feed() {
    let limits = Limits { accel_mm_s2: 2000.0, jerk_mm_s3: 5e4, snap_mm_s4: 5e6 };
    let law = Law::new(Pulse::Sin2, limits).expect("positive");
    let printed = |lower: f64| (law.ramp_length_mm(60.0, lower) * 100.0).round() / 100.0;
    assert_eq!((printed(0.0), printed(20.0)), (2.94, 3.2));
    assert!(printed(40.0) < 3.0);
    let from = [0.0, 20.0, 40.0].map(|lower| reach(&law, lower, 3.0));
    assert!(from[0] > 60.0 && from[1] < 60.0 && from[2] > 60.0, "{from:?}");
    // 200 mm/s with S1's limits: to 0 in 60.0 mm, to 50 in 62.5 mm, to 100 in 60.0 mm.
    let law = Law::new(Pulse::Sin2, super::limits(LIMITS[0])).expect("positive");
    for (lower, mm) in [(0.0, 60.0), (50.0, 62.5), (100.0, 60.0)] {
        assert!((law.ramp_length_mm(200.0, lower) - mm).abs() < 1e-12);
    }
    // 30 mm: more feed to begin with, less to reach.
    for (lower, reached) in [(0.0, 130.3), (50.0, 124.2), (100.0, 139.3)] {
        assert!((reach(&law, lower, 30.0) - reached).abs() < 0.05);
    }
}

/// At the edges: no room, no feed, huge and tiny figures.
#[test]
fn edges() {
    for (_, law) in &laws::<f64>() {
        for lower in [0.0, 1e-3, 83.0] {
            assert_eq!((reach(law, lower, 0.0), reach(law, lower, -1.0)), (lower, lower));
            assert_eq!(peak(law, lower, lower, 0.0), lower);
            assert_eq!(peak(law, 0.0, lower + 1.0, 0.0), lower + 1.0);
        }
        for room in [1e-300, 1e-30, 1e-12, 1e12, 1e30] {
            for lower in [0.0, 1e-30, 1.0, 1e6] {
                let (reached, top) = (reach(law, lower, room), peak(law, lower, 0.5 * lower, room));
                assert!(reached.is_finite() && reached >= lower, "{lower} {room}: {reached}");
                assert!(top.is_finite() && top >= lower, "{lower} {room}: {top}");
            }
        }
    }
}
