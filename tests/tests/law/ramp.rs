//! One ramp: [`Ramp`] against S1's examples and against the oracle.

use super::oracle::{Choice, Exact, Motion, Quadrature, choose};
use super::{LIMITS, PULSES, feed, feeds, limits, narrow};
use motion_kernel::law::{FeedState, Law, LimitedBy, Pulse, Ramp};
use motion_kernel::num::Root;
use motion_tests::dd::{Dd, dd};
use motion_tests::random::Random;

/// Greatest relative errors of S, V, A, J and snap, beyond what the rounding of time explains (see
/// [`excess`]). Measured: 1.0·10⁻¹⁵ and, in f32, 4.2·10⁻⁷, for the jerk; the others are below.
const RELATIVE_F64: f64 = 1e-14;
const RELATIVE_F32: f64 = 1e-6;

/// S1's examples, to the digits printed there, in mm. In the third, t₁, A and S(t₁) are printed as
/// 0.0316, 0.0635 and 0.00058: the first is rounded and the other two follow from the rounded one.
#[test]
fn examples_of_the_paper() {
    struct Example {
        feeds_mm_s: (f64, f64),
        limited_by: LimitedBy,
        /// Jp, t₁, t₂, t_p, DJ(t₁/4), A(t₁), V(t₁), S(t₁), S(t₂), S(t_p), each with half a unit of its
        /// last printed place.
        printed: [(f64, f64); 10],
    }
    let examples = [
        Example {
            feeds_mm_s: (0.0, 200.0),
            limited_by: LimitedBy::Acceleration,
            printed: [
                (5000.0, 50.0),
                (0.2, 0.05),
                (0.4, 0.05),
                (0.6, 0.05),
                (78_540.0, 5.0),
                (500.0, 50.0),
                (50.0, 5.0),
                (2.8, 0.05),
                (22.8, 0.05),
                (60.0, 5.0),
            ],
        },
        Example {
            feeds_mm_s: (19.0, 100.0),
            limited_by: LimitedBy::Jerk,
            printed: [
                (5000.0, 50.0),
                (0.18, 0.005),
                (0.18, 0.005),
                (0.36, 0.005),
                (87_270.0, 5.0),
                (450.0, 5.0),
                (59.5, 0.05),
                (5.5, 0.05),
                (5.5, 0.05),
                (21.4, 0.05),
            ],
        },
        Example {
            feeds_mm_s: (18.0, 20.0),
            limited_by: LimitedBy::Snap,
            printed: [
                (4018.0, 0.5),
                (0.03155, 5e-6),
                (0.03155, 5e-6),
                (0.0631, 5e-5),
                (400_000.0, 500.0),
                (63.38, 0.005),
                (19.0, 0.5),
                (0.577, 5e-4),
                (0.577, 5e-4),
                (1.2, 0.05),
            ],
        },
    ];
    let law = Law::new(Pulse::Sin2, limits(LIMITS[0])).expect("positive");
    for Example { feeds_mm_s: (from, to), limited_by, printed } in &examples {
        let up = Ramp::new(&law, *from, *to);
        assert_eq!(up.limited_by, *limited_by);
        let (t1, end) = (up.at(up.t1_s), up.at(up.duration_s()));
        let found = [
            up.peak_jerk_mm_s3,
            up.t1_s,
            up.t2_s,
            up.duration_s(),
            up.at(up.t1_s / 4.0).snap_mm_s4,
            t1.a_mm_s2,
            t1.v_mm_s,
            t1.s_mm,
            up.at(up.t2_s).s_mm,
            end.s_mm,
        ];
        for (index, (found, (printed, half_place))) in found.iter().zip(printed).enumerate() {
            assert!((found - printed).abs() <= *half_place, "column {index}: {found}, printed {printed}");
        }
        // Rounding of time: the end is approached within it.
        assert!((end.v_mm_s - to).abs() < 1e-12 && end.a_mm_s2.abs() < 1e-9);
        // The braking ramp is the mirror image.
        let down = Ramp::new(&law, *to, *from);
        assert_eq!((down.t1_s, down.t2_s, down.peak_jerk_mm_s3), (up.t1_s, up.t2_s, up.peak_jerk_mm_s3));
        for part in 1..64 {
            let t = up.duration_s() * f64::from(part) / 64.0;
            let (here, mirror) = (up.at(t), down.at(down.duration_s() - t));
            assert!((here.s_mm + mirror.s_mm - up.length_mm()).abs() < 1e-13 * up.length_mm());
            assert!((here.v_mm_s - mirror.v_mm_s).abs() < 1e-12 * to);
            assert!((here.a_mm_s2 + mirror.a_mm_s2).abs() < 1e-9);
            assert!((here.j_mm_s3 - mirror.j_mm_s3).abs() < 1e-7);
            assert!((here.snap_mm_s4 + mirror.snap_mm_s4).abs() < 1e-5);
        }
    }
}

/// S1's first example prints only "0.2" for t₁; here all that is exact in it.
#[test]
fn first_example_exactly() {
    let ramp = Ramp::new(&Law::new(Pulse::Sin2, limits(LIMITS[0])).expect("positive"), 0.0, 200.0);
    assert_eq!((ramp.peak_jerk_mm_s3, ramp.t1_s, ramp.t2_s), (5000.0, 0.2, 0.4));
    let s1_mm = 5000.0 * 0.008 * (1.0 / 12.0 - 1.0 / (8.0 * std::f64::consts::PI.powi(2)));
    assert!((ramp.at(0.2).s_mm - s1_mm).abs() < 1e-15);
    assert!((ramp.at(0.4).s_mm - s1_mm - 20.0).abs() < 1e-14);
    assert!((ramp.length_mm() - 60.0).abs() < 1e-14);
}

/// How far an error is beyond what the rounding of time explains, relative to the value.
///
/// The argument and the ramp's times are numbers of the type under test, so a value can't be better
/// than the law's over t ± 2 ulp(t_p): where it passes through zero or starts from it that is all it is
/// worth. What Taylor's formula with all of the value's derivatives allows over that span is taken off;
/// the rest is relative to the value itself.
fn excess(found: f64, exact: Dd, derivatives: &[f64], span_s: f64) -> f64 {
    let (mut term, mut allowed) = (1.0, 0.0);
    for (n, derivative) in derivatives.iter().enumerate() {
        term *= span_s / (n as f64 + 1.0);
        allowed += derivative.abs() * term;
    }
    let error = (dd(found) - exact).abs().hi - allowed;
    if error <= 0.0 { 0.0 } else { error / exact.hi.abs() }
}

fn excesses<R: Root>(found: &FeedState<R>, exact: &Motion, crackle: f64, span_s: f64) -> [f64; 5] {
    let chain = [exact.v.hi, exact.a.hi, exact.j.hi, exact.snap.hi, crackle];
    let pairs = [
        (found.s_mm, exact.s),
        (found.v_mm_s, exact.v),
        (found.a_mm_s2, exact.a),
        (found.j_mm_s3, exact.j),
        (found.snap_mm_s4, exact.snap),
    ];
    std::array::from_fn(|n| excess(pairs[n].0.to_f64(), pairs[n].1, &chain[n..], span_s))
}

/// `count` ascending times in a ramp: everywhere, close to both sides of every phase's ends, and the
/// ends themselves with their neighbours.
fn times<R: Root>(random: &mut Random, exact: &Exact<'_>, count: usize) -> Vec<f64> {
    let [edge, t1, t2, end] = [exact.edge, exact.t1, exact.t2, exact.end].map(|time| time.hi);
    let ends = [0.0, edge, t1 - edge, t1, t2, t2 + edge, end - edge, end];
    let mut times: Vec<f64> = ends.iter().flat_map(|end| [end.next_down(), *end, end.next_up()]).collect();
    while times.len() < count {
        times.push(if random.once_in(2) {
            exact.end.hi * random.unit()
        } else {
            let near = random.log(1e-9, 0.5) * exact.t1.hi;
            random.pick(&ends) + if random.once_in(2) { near } else { -near }
        });
    }
    let times = times.iter().map(|t| R::from_f64(t.clamp(0.0, exact.end.hi)).to_f64());
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times
}

fn worst_over_random_ramps<R: Root>(stream: u64, ramps: usize, points: usize) -> [f64; 5] {
    let mut random = Random::of_stream(stream);
    let quadrature = Quadrature::new();
    let mut worst = [0.0_f64; 5];
    let mut regimes = [0; 3];
    while regimes.iter().sum::<usize>() < ramps {
        let (pulse, limits) = (*random.pick(&PULSES), limits(*random.pick(&LIMITS)));
        let law = Law::new(pulse, narrow::<R>(&limits)).expect("positive");
        let (from, to) = feeds::<R>(&mut random);
        if from == to {
            continue;
        }
        let ramp = Ramp::new(&law, R::from_f64(from), R::from_f64(to));
        regimes[ramp.limited_by as usize] += 1;
        let exact = Exact::new(&quadrature, (pulse, &limits), from, to);
        let (arch_s, end) = (2.0 * exact.edge.hi, exact.end.hi);
        let span_s = 2.0 * R::EPSILON * end;
        let crackle = 2.0 * std::f64::consts::PI.powi(2) * exact.jerk.hi / (arch_s * arch_s);
        assert!((ramp.length_mm().to_f64() / exact.length.hi - 1.0).abs() < 8.0 * R::EPSILON, "{ramp:?}");
        let times = times::<R>(&mut random, &exact, points);
        for (&t, motion) in times.iter().zip(exact.at_each(&times)) {
            let found = excesses(&ramp.at(R::from_f64(t)), &motion, crackle, span_s);
            for (quantity, (worst, found)) in worst.iter_mut().zip(found).enumerate() {
                assert!(found < 1e-2, "quantity {quantity} at {t} of {ramp:?}: {motion:?}");
                *worst = worst.max(found);
            }
        }
    }
    println!("ramps limited by acceleration, jerk, snap: {regimes:?}; worst S V A J snap: {worst:?}");
    assert!(regimes.iter().all(|&count| count > ramps / 40), "all regimes must occur: {regimes:?}");
    worst
}

#[test]
fn f64_is_the_integrated_law() {
    let worst = worst_over_random_ramps::<f64>(1, 1000, 1000);
    assert!(worst.iter().all(|worst| *worst <= RELATIVE_F64), "{worst:?}");
}

#[test]
fn f32_is_the_integrated_law() {
    let worst = worst_over_random_ramps::<f32>(2, 200, 500);
    assert!(worst.iter().all(|worst| *worst <= RELATIVE_F32), "{worst:?}");
}

/// Outside its time a ramp continues at constant feed; equal feeds are no ramp.
#[test]
fn outside_and_without_a_change() {
    let mut random = Random::of_stream(3);
    for _ in 0..1000 {
        let law = Law::new(*random.pick(&PULSES), limits(*random.pick(&LIMITS))).expect("positive");
        let (from, to) = feeds::<f64>(&mut random);
        let ramp = Ramp::new(&law, from, to);
        let (end_s, length_mm) = (ramp.duration_s(), ramp.length_mm());
        for outside_s in [0.0, 1e-9, 1.0] {
            let (before, after) = (ramp.at(-outside_s), ramp.at(end_s + outside_s));
            assert_eq!((before.s_mm, before.v_mm_s), (-from * outside_s, from));
            assert!(
                (after.s_mm - length_mm - to * outside_s).abs()
                    <= 1e-15 * length_mm + 4e-16 * to * (end_s + outside_s)
            );
            assert_eq!(after.v_mm_s, to);
            assert_eq!((before.a_mm_s2, before.j_mm_s3, before.snap_mm_s4), (0.0, 0.0, 0.0));
            assert_eq!((after.a_mm_s2, after.j_mm_s3, after.snap_mm_s4), (0.0, 0.0, 0.0));
        }
        let none = Ramp::new(&law, from, from);
        assert_eq!((none.duration_s(), none.length_mm(), none.peak_jerk_mm_s3), (0.0, 0.0, 0.0));
        assert_eq!(none.at(0.0).v_mm_s, from);
    }
}

/// The kernel's regimes, its peak jerk and times against min(…) of (22) and (23), across the
/// boundaries x₁ and x₂ of the regimes, in f64 and in f32.
#[test]
fn choice_of_jerk_and_times() {
    fn check<R: Root>(random: &mut Random) {
        for (set, pulse) in LIMITS.into_iter().flat_map(|set| PULSES.map(|pulse| (set, pulse))) {
            let limits = limits(set);
            let law = Law::new(pulse, narrow::<R>(&limits)).expect("positive");
            let Choice { jerk, t1, .. } = choose(pulse, &limits, dd(1e9));
            let peak = jerk.hi;
            let boundaries = [(std::f64::consts::PI / set.2).powi(2) * peak.powi(3) / 2.0, set.0 * t1.hi];
            for n in 0..4000 {
                let change = match n % 4 {
                    0 => random.log(1e-12, 1e3),
                    1 => feed::<R>(random),
                    _ => {
                        random.pick(&boundaries)
                            * (1.0 + (random.unit() - 0.5) * 10.0_f64.powi(-(random.below(16) as i32)))
                    }
                };
                let change = R::from_f64(change);
                let ramp = Ramp::new(&law, R::ZERO, change);
                let Choice { jerk, edge, t1, t2 } = choose(pulse, &limits, dd(change.to_f64()));
                let tolerance = 12.0 * R::EPSILON;
                for (found, exact) in
                    [(ramp.peak_jerk_mm_s3, jerk), (ramp.edge_s, edge), (ramp.t1_s, t1), (ramp.t2_s, t2)]
                {
                    assert!((found.to_f64() - exact.hi).abs() <= tolerance * exact.hi, "{ramp:?}: {exact:?}");
                }
            }
        }
    }
    let mut random = Random::of_stream(4);
    check::<f64>(&mut random);
    check::<f32>(&mut random);
}

/// Where one limit takes over from another, rounded times decide which one: peaks are beyond their limits by rounding
/// only, which is less than the streams allow for.
#[test]
fn peaks_keep_their_limits_but_for_rounding() {
    let mut random = Random::of_stream(11);
    let mut worst = [0.0_f64; 3];
    for _ in 0..400_000 {
        let accel = random.log(1.0, 2e4);
        let snap = accel * random.log(30.0, 3e5);
        // At times out of reach, so that acceleration takes over from snap.
        let jerk = if random.once_in(2) { 1e9 } else { accel * random.log(3.0, 300.0) };
        let law = Law::new(*random.pick(&PULSES), limits((accel, jerk, snap))).expect("limits");
        let peak = jerk.min((2.0 * accel * snap / std::f64::consts::PI).sqrt());
        let snap_s = std::f64::consts::PI * peak / snap;
        let border = match (random.once_in(2), law.pulse()) {
            (false, _) => 0.5 * peak * snap_s * snap_s,
            (true, Pulse::Sin2) => 2.0 * accel * accel / peak,
            (true, Pulse::Plateau) => accel * (accel / peak + 0.5 * snap_s),
        };
        let near = (random.unit() - 0.5) * 2.0_f64.powi(-(random.below(10) as i32) - 42);
        let ramp = Ramp::new(&law, 0.0, border * (1.0 + near));
        let peaks = [
            ramp.peak_accel_mm_s2() / accel,
            ramp.peak_jerk_mm_s3 / jerk,
            0.5 * std::f64::consts::PI * ramp.peak_jerk_mm_s3 / ramp.edge_s / snap,
        ];
        for (worst, peak) in worst.iter_mut().zip(peaks) {
            *worst = worst.max((peak - 1.0) / f64::EPSILON);
        }
    }
    println!("beyond acceleration, jerk and snap by at most {worst:?} times the rounding of 1");
    assert!(worst.iter().all(|&worst| worst <= 8.0), "{worst:?}");
}
