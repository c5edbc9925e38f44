//! Plans in fixed point: within every limit, feasible, as fast as those in f64, and without overflow for all that
//! is accepted. A debug build panics where fixed point overflows; an optimised one wraps.

use super::executed::Supply;
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::internals::{merge_equal, peak};
use motion_kernel::law::{
    FeedSegment, Law, LimitError, Limits, PlannedRamp, Pulse, Ramp, SegmentError, reach,
};
use motion_kernel::num::{Fixed, Real, Root, Scalar};
use motion_kernel::plan::{
    AxisLimits, Bend, Block, BlockPlan, Ceiling, Junction, MachineLimits, PlanError, junction, plan, ramps,
};
use motion_kernel::queue::{PathRules, Streams};
use motion_kernel::units::Position;
use motion_tests::judge;
use motion_tests::random::Random;

const TICK_S: f64 = 5e-4;
/// The step of fixed point.
const STEP: f64 = 1.0 / 4_294_967_296.0;
/// Promised: no ramp exceeds a limit of acceleration, jerk or snap by more than this part of it.
const LIMIT_PART: f64 = 1e-9;
/// Promised: a stretch takes at most this part longer than planned in f64, and the part of its shortest block
/// that a step is: ramps of a few nanometres are that many thousand steps.
const TIME_PART: f64 = 1e-6;

fn fixed(value: f64) -> Fixed {
    Fixed::from_f64(value)
}

/// A law in both types, of the same pulses and limits.
fn laws(pulse: Pulse, limits: [f64; 3]) -> (Law<Fixed>, Law<f64>) {
    let [accel, jerk, snap] = limits.map(fixed);
    let of = |limits| Law::new(pulse, limits).expect("accepted");
    let narrow = of(Limits { accel_mm_s2: accel, jerk_mm_s3: jerk, snap_mm_s4: snap });
    let limits = Limits { accel_mm_s2: accel.to_f64(), jerk_mm_s3: jerk.to_f64(), snap_mm_s4: snap.to_f64() };
    (narrow, Law::new(pulse, limits).expect("accepted"))
}

fn any_pulse(random: &mut Random) -> Pulse {
    *random.pick(&[Pulse::Sin2, Pulse::Plateau])
}

/// What is drawn at random: limits, lengths, feeds.
#[derive(Clone, Copy, Debug)]
enum Range {
    /// From soft to fast machines, blocks from a micrometre to ten metres.
    Machines,
    /// All that is accepted.
    Accepted,
}

impl Range {
    fn limits(self, random: &mut Random) -> [f64; 3] {
        match self {
            Self::Machines => {
                let accel = random.log(10.0, 5e4);
                let jerk = accel * random.log(1.0, 1e3);
                [accel, jerk, (jerk * random.log(1.0, 1e3)).min(1e9)]
            }
            // Least and greatest at times.
            Self::Accepted => [0; 3].map(|_| match random.below(6) {
                0 => 1.0,
                1 => 1e9,
                _ => random.log(1.0, 1e9),
            }),
        }
    }

    fn length(self, random: &mut Random) -> f64 {
        match self {
            Self::Machines => random.log(1e-3, 1e4),
            Self::Accepted => random.log(1e-6, 1e6).max(1e-6 + STEP),
        }
    }

    fn feed(self, random: &mut Random) -> f64 {
        match self {
            Self::Machines => random.log(1e-2, 2e3),
            Self::Accepted => random.log(1e-3, 1e6).max(1e-3 + STEP),
        }
    }

    /// A list of blocks in both types.
    fn blocks(self, random: &mut Random, most: usize) -> (Vec<Block<Fixed>>, Vec<Block<f64>>) {
        let same = random.once_in(2).then(|| laws(any_pulse(random), self.limits(random)));
        (0..1 + random.below(most))
            .map(|_| {
                let (law, law_f64) = same.unwrap_or_else(|| laws(any_pulse(random), self.limits(random)));
                let length_mm = fixed(if random.once_in(20) { 0.0 } else { self.length(random) });
                let cap_mm_s = fixed(self.feed(random));
                let junction = match random.below(10) {
                    0 => 0.0,
                    1..=3 => fixed(self.feed(random)).to_f64(),
                    _ => f64::INFINITY,
                };
                let wide = Block {
                    length_mm: length_mm.to_f64(),
                    cap_mm_s: cap_mm_s.to_f64(),
                    junction_mm_s: junction,
                    law: law_f64,
                };
                (Block { length_mm, cap_mm_s, junction_mm_s: fixed(junction), law }, wide)
            })
            .unzip()
    }
}

fn planned<R: Root>(blocks: &[Block<R>], start: R, end: R) -> Result<Vec<BlockPlan<R>>, PlanError> {
    let mut plans = vec![BlockPlan::default(); blocks.len()];
    plan(blocks, start, end, &mut plans).map(|()| plans)
}

/// By how much acceleration, jerk or snap of a ramp exceed their limits, as a part: in f64 from the ramp's own
/// times, which decide what is executed.
fn excess(law: &Law<Fixed>, from: Fixed, to: Fixed) -> f64 {
    let ramp = Ramp::new(law, from, to);
    let (t1, t2) = (ramp.t1_s.to_f64(), ramp.t2_s.to_f64());
    let change = (to.to_f64() - from.to_f64()).abs();
    if change == 0.0 {
        assert_eq!((t1, t2), (0.0, 0.0));
        return -1.0;
    }
    assert!(t1 > 0.0 && t2 >= t1, "{ramp:?}");
    let limits = law.limits();
    let edge = ramp.edge_s.to_f64();
    assert!(edge > 0.0 && 2.0 * edge <= t1, "{ramp:?}");
    let (accel, jerk) = (change / t2, change / ((t1 - edge) * t2));
    [
        accel / limits.accel_mm_s2.to_f64(),
        jerk / limits.jerk_mm_s3.to_f64(),
        0.5 * std::f64::consts::PI * jerk / edge / limits.snap_mm_s4.to_f64(),
    ]
    .into_iter()
    .fold(-1.0, |worst, part| f64::max(worst, part - 1.0))
}

/// All that a plan promises; the greatest excess of a limit.
fn check(blocks: &[Block<Fixed>], wide: &[Block<f64>], plans: &[BlockPlan<Fixed>]) -> f64 {
    let mut worst = -1.0_f64;
    let mut feed = plans[0].enter_mm_s;
    for (index, ((block, wide), plan)) in blocks.iter().zip(wide).zip(plans).enumerate() {
        let BlockPlan { enter_mm_s: enter, peak_mm_s: peak, exit_mm_s: exit } = *plan;
        let case = || format!("block {index}: {plan:?} {block:?}");
        assert_eq!(enter, feed, "the feed steps: {}", case());
        feed = exit;
        assert!(
            enter >= Fixed::ZERO && exit >= Fixed::ZERO && peak >= Scalar::max(enter, exit),
            "{}",
            case()
        );
        assert!(peak <= block.cap_mm_s, "{}", case());
        assert!(index + 1 == blocks.len() || exit <= block.junction_mm_s, "{}", case());
        assert!(block.length_mm == Fixed::ZERO || peak > Fixed::ZERO, "never left: {}", case());
        // Exactly, in fixed point.
        let ramps = [(enter, peak), (peak, exit)];
        let bits = |mm: Fixed| i128::from(mm.to_q32());
        let taken: i128 = ramps.iter().map(|&(from, to)| bits(block.law.ramp_length_mm(from, to))).sum();
        assert!(taken <= bits(block.length_mm), "too short: {}", case());
        // And by the law in f64, which knows nothing of fixed point.
        let exact: f64 = ramps.iter().map(|(a, b)| wide.law.ramp_length_mm(a.to_f64(), b.to_f64())).sum();
        assert!(exact <= wide.length_mm * (1.0 + 1e-12) + 2.0 * STEP, "{exact} mm: {}", case());
        for (from, to) in ramps {
            worst = worst.max(excess(&block.law, from, to));
        }
    }
    worst
}

fn wide_plans(plans: &[BlockPlan<Fixed>]) -> Vec<BlockPlan<f64>> {
    plans
        .iter()
        .map(|plan| BlockPlan {
            enter_mm_s: plan.enter_mm_s.to_f64(),
            peak_mm_s: plan.peak_mm_s.to_f64(),
            exit_mm_s: plan.exit_mm_s.to_f64(),
        })
        .collect()
}

/// Random lists, planned in both types.
fn random_lists(stream: u64, range: Range, lists: usize) {
    let mut random = Random::of_stream(stream);
    let (mut worst, mut slowest, mut slower, mut count) = (-1.0_f64, 0.0_f64, 0.0_f64, 0);
    for _ in 0..lists {
        let (blocks, wide) = range.blocks(&mut random, 40);
        let (start, end) = match random.below(3) {
            0 => (
                share(blocks[0].cap_mm_s, random.unit()),
                share(blocks[blocks.len() - 1].cap_mm_s, random.unit()),
            ),
            _ => (Fixed::ZERO, Fixed::ZERO),
        };
        let plans = match planned(&blocks, start, end) {
            Ok(plans) => plans,
            Err(PlanError::TooShortToBrake { .. } | PlanError::TooShortToAccelerate { .. })
                if start + end > Fixed::ZERO =>
            {
                continue;
            }
            Err(error) => panic!("{error}"),
        };
        count += blocks.len();
        worst = worst.max(check(&blocks, &wide, &plans));
        let Ok(reference) = planned(&wide, start.to_f64(), end.to_f64()) else { continue };
        let (found_s, wide_s) = (super::time_s(&wide, &wide_plans(&plans)), super::time_s(&wide, &reference));
        let lengths = wide.iter().map(|block| block.length_mm).filter(|&length_mm| length_mm > 0.0);
        let resolved = TIME_PART + STEP / lengths.fold(f64::INFINITY, f64::min);
        slowest = slowest.max((found_s / wide_s - 1.0) / resolved);
        slower = slower.max(found_s / wide_s - 1.0);
    }
    println!(
        "{range:?}: {count} blocks; limits exceeded by {worst:.1e}; slower than in f64 by {slower:.1e} at most, \
         {slowest:.2} of the bound"
    );
    assert!(worst <= LIMIT_PART, "{worst:e}");
    assert!(slowest <= 1.0, "{slower:e}");
}

/// `part` of a feed, not below the range.
fn share(feed: Fixed, part: f64) -> Fixed {
    fixed((feed.to_f64() * part).max(1e-3 + STEP))
}

#[test]
fn lists_of_machines_keep_limits_and_are_as_fast_as_in_f64() {
    random_lists(90, Range::Machines, 20_000);
}

#[test]
fn every_accepted_list_keeps_limits_and_is_as_fast_as_in_f64() {
    random_lists(91, Range::Accepted, 20_000);
}

/// The ends of all ranges with each other: no overflow, and the inverse problems solved as in f64.
#[test]
fn the_ends_of_the_ranges_neither_overflow_nor_exceed_limits() {
    let ends = [1.0, 1e3, 1e6, 1e9];
    let feeds = [0.0, STEP, 1e-6, 1.0, 1e3, 1e6];
    let lengths = [1e-6 + STEP, 1e-3, 1.0, 1e6];
    let mut limits = Vec::new();
    for accel in ends {
        for jerk in ends {
            limits.extend(ends.map(|snap| [accel, jerk, snap]));
        }
    }
    let (mut solved, mut worst) = (0, 0.0_f64);
    let both =
        limits.into_iter().flat_map(|limits| [Pulse::Sin2, Pulse::Plateau].map(|pulse| laws(pulse, limits)));
    for (law, wide) in both {
        for from in feeds {
            for to in feeds {
                worst = worst.max(excess(&law, fixed(from), fixed(to)));
                for length_mm in lengths {
                    let (from, to, length) = (fixed(from), fixed(to), fixed(length_mm));
                    let top = Scalar::max(from, to);
                    let found = [reach(&law, from, length), peak(&law, from, to, length)];
                    let exact = [
                        reach(&wide, from.to_f64(), length.to_f64()),
                        peak(&wide, from.to_f64(), to.to_f64(), length.to_f64()),
                    ];
                    for (least, found, exact) in [(from, found[0], exact[0]), (top, found[1], exact[1])] {
                        assert!(found >= least, "{found:?} from {least:?}");
                        // To what the steps of times and lengths are worth.
                        let (gained, whole) = (found.to_f64() - least.to_f64(), exact - least.to_f64());
                        let part = (4.0 + 100.0 * exact) * STEP / length_mm + 1e-6;
                        let steps = 4.0 * STEP * (1.0 + 1e-2 * exact);
                        assert!(
                            (gained - whole).abs() <= whole * part + steps,
                            "{gained} of {whole} from {from:?} to {to:?} in {length:?}: {law:?}"
                        );
                        solved += 1;
                    }
                    let block = Block {
                        length_mm: length,
                        cap_mm_s: fixed(1e6),
                        junction_mm_s: fixed(f64::INFINITY),
                        law,
                    };
                    let blocks = [block; 3];
                    if let Ok(plans) = planned(&blocks, from, to) {
                        let wide = blocks.map(|block| Block {
                            length_mm: block.length_mm.to_f64(),
                            cap_mm_s: 1e6,
                            junction_mm_s: f64::INFINITY,
                            law: wide,
                        });
                        worst = worst.max(check(&blocks, &wide, &plans));
                    }
                }
            }
        }
    }
    println!("{solved} solved; limits exceeded by {worst:.1e}");
    assert!(worst <= LIMIT_PART, "{worst:e}");
}

/// Changes of feed around those where one limit takes over from another, step by step.
#[test]
fn limits_are_kept_where_regimes_meet() {
    let mut random = Random::of_stream(96);
    let mut worst = -1.0_f64;
    for case in 0..4000 {
        let range = if case % 2 == 0 { Range::Machines } else { Range::Accepted };
        let [accel, jerk, snap] = range.limits(&mut random);
        let pulse = any_pulse(&mut random);
        let (law, _) = laws(pulse, [accel, jerk, snap]);
        let pi = std::f64::consts::PI;
        let peak = jerk.min((2.0 * accel * snap / pi).sqrt());
        let by_accel = match pulse {
            Pulse::Sin2 => 2.0 * accel * accel / peak,
            Pulse::Plateau => accel * (accel / peak + 0.5 * pi * peak / snap),
        };
        for meeting in [(pi / snap).powi(2) * peak.powi(3) / 2.0, by_accel] {
            let from = fixed(*random.pick(&[0.0, 1.0, 1e5]));
            for steps in -40..=40 {
                let change = fixed(meeting.min(1e6)).to_q32() + steps;
                if change > 0 {
                    worst = worst.max(excess(&law, from, from + Fixed::from_q32(change)));
                }
            }
        }
    }
    println!("limits exceeded by {worst:.1e}");
    assert!(worst <= LIMIT_PART, "{worst:e}");
}

#[test]
fn beyond_the_ranges_is_refused() {
    let good = [500.0, 5e3, 4e5];
    for (place, name) in ["acceleration", "jerk", "snap"].into_iter().enumerate() {
        for bad in [-1.0, 0.0, STEP, 1.0 - STEP, 1e9 + 1e-6, 2.0e9, f64::INFINITY] {
            let mut limits = good.map(fixed);
            limits[place] = fixed(bad);
            let [accel_mm_s2, jerk_mm_s3, snap_mm_s4] = limits;
            let value = limits[place].to_f64();
            let range = (1.0, 1e9);
            assert_eq!(
                Law::new(Pulse::Plateau, Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 }),
                Err(LimitError { quantity: name, value, range })
            );
        }
    }
    let (law, _) = laws(Pulse::Plateau, good);
    let good =
        Block { length_mm: fixed(1.0), cap_mm_s: fixed(10.0), junction_mm_s: fixed(f64::INFINITY), law };
    let short = Block { length_mm: fixed(1e-6 - STEP), ..good };
    let long = Block { length_mm: fixed(1e6 + STEP), ..good };
    let negative = Block { length_mm: fixed(-STEP), ..good };
    let slow = Block { cap_mm_s: fixed(1e-3 - STEP), ..good };
    let still = Block { cap_mm_s: Fixed::ZERO, ..good };
    let fast = Block { cap_mm_s: fixed(1e6 + STEP), ..good };
    let backward = Block { junction_mm_s: fixed(-STEP), ..good };
    for (bad, name) in [
        (short, "length [mm]"),
        (long, "length [mm]"),
        (negative, "length [mm]"),
        (still, "ceiling [mm/s]"),
        (slow, "ceiling [mm/s]"),
        (fast, "ceiling [mm/s]"),
        (backward, "junction feed [mm/s]"),
    ] {
        let refused = planned(&[good, bad], Fixed::ZERO, Fixed::ZERO);
        assert!(
            matches!(refused, Err(PlanError::Block { block: 1, quantity, .. }) if quantity == name),
            "{name}: {refused:?}"
        );
    }
    let blocks = [Block { length_mm: Fixed::ZERO, ..good }, good];
    assert!(planned(&blocks, Fixed::ZERO, Fixed::ZERO).is_ok());
    for bad in [-STEP, STEP, 1e-3 - STEP, 10.0 + STEP] {
        assert!(matches!(planned(&blocks, fixed(bad), Fixed::ZERO), Err(PlanError::EndFeed { .. })));
        assert!(matches!(planned(&blocks, Fixed::ZERO, fixed(bad)), Err(PlanError::EndFeed { .. })));
    }
    // A junction as slow is a stop.
    let pair = [Block { junction_mm_s: fixed(1e-3 - STEP), ..good }, good];
    assert_eq!(planned(&pair, Fixed::ZERO, Fixed::ZERO).expect("a plan")[0].exit_mm_s, Fixed::ZERO);
}

/// Merging adds lengths before any was checked: what would be beyond the range stays apart.
#[test]
fn merged_lengths_stay_in_range() {
    let (law, _) = laws(Pulse::Sin2, [500.0, 5e3, 4e5]);
    let block =
        |mm| Block { length_mm: fixed(mm), cap_mm_s: fixed(10.0), junction_mm_s: fixed(f64::INFINITY), law };
    let mut blocks = [block(6e5), block(4e5), block(1.0), block(2e9), block(2e9), block(2.0)];
    assert_eq!(merge_equal(&mut blocks), 5);
    assert_eq!(blocks[..2], [block(1e6), block(1.0)]);
    assert!(matches!(
        planned(&blocks[..5], Fixed::ZERO, Fixed::ZERO),
        Err(PlanError::Block { block: 2, .. })
    ));
}

/// The ceiling of an arc in the plane of two like axes.
fn ceiling<R: Root>(limits: AxisLimits<R>, share: R, radius: R, planar: R) -> Result<Ceiling<R>, LimitError> {
    let machine =
        MachineLimits { path: limits, axes: [limits; 2], pulse: Pulse::Plateau, curve_feed_share: share };
    let bend = Bend::circle(radius, planar);
    Ceiling::new(&machine, R::from_f64(f64::INFINITY), &[R::ONE; 2], &[true; 2], &bend)
}

/// Ceilings on arcs: the vectors of any state a ramp can be in, by the chain rule in f64, and the feed in f64.
#[test]
fn ceilings_keep_the_limits() {
    let mut random = Random::of_stream(92);
    let (mut worst, mut slowest, mut refused) = (0.0_f64, 0.0_f64, [0; 2]);
    for case in 0..40_000 {
        let range = if case % 2 == 0 { Range::Machines } else { Range::Accepted };
        let [accel, jerk, snap] = range.limits(&mut random).map(fixed);
        let (feed, share) = (fixed(range.feed(&mut random)), fixed(0.1 + 0.75 * random.unit()));
        let (radius, planar) = (fixed(random.log([1e-3, 1e-9][case % 2], 1e5)), fixed(random.log(0.1, 1.0)));
        let narrow = AxisLimits {
            feed_mm_s: feed,
            limits: Limits { accel_mm_s2: accel, jerk_mm_s3: jerk, snap_mm_s4: snap },
        };
        let found = match ceiling(narrow, share, radius, planar) {
            Ok(found) => found,
            Err(LimitError { value, .. }) => {
                // What the bend leaves for ramps is below the range, in f64 too unless the limits are those
                // of no machine.
                let limits = Limits {
                    accel_mm_s2: accel.to_f64(),
                    jerk_mm_s3: jerk.to_f64(),
                    snap_mm_s4: snap.to_f64(),
                };
                let wide = AxisLimits { feed_mm_s: feed.to_f64(), limits };
                let wide = ceiling(wide, share.to_f64(), radius.to_f64(), planar.to_f64()).expect("in f64");
                let Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 } = wide.law.limits();
                let least = accel_mm_s2.min(jerk_mm_s3).min(snap_mm_s4);
                assert!(value < 1.0 && (case % 2 == 1 || least < 1.0 + 1e-4), "{value} {least}");
                refused[case % 2] += 1;
                continue;
            }
        };
        let [accel, jerk, snap, r, planar] = [accel, jerk, snap, radius, planar].map(Fixed::to_f64);
        let v = found.feed_mm_s.to_f64();
        let exact = {
            let share = share.to_f64();
            let turn = planar / r;
            [
                feed.to_f64(),
                share * (accel / (planar * turn)).sqrt(),
                share * (jerk / (planar * turn * turn)).cbrt(),
                share * (snap / (planar * turn.powi(3))).powf(0.25),
            ]
            .into_iter()
            .fold(f64::INFINITY, f64::min)
        };
        slowest = slowest
            .max((1.0 - v / exact) / (1e-8 + 4e-9 * r / planar.powi(2) + 2.0 * STEP * (1.0 / r + 1.0 / v)));
        let turn = planar / r;
        let (k1, k2, k3) = (planar * turn, planar * turn * turn, planar * turn.powi(3));
        let ramp = found.law.limits();
        let ramp = [ramp.accel_mm_s2, ramp.jerk_mm_s3, ramp.snap_mm_s4].map(Fixed::to_f64);
        for a in [-1.0, 0.0, 1.0].map(|part| part * ramp[0]) {
            worst = worst.max(a.hypot(k1 * v * v) / accel - 1.0);
            for j in [-1.0, 0.0, 1.0].map(|part| part * ramp[1]) {
                worst = worst.max((j - k2 * v.powi(3)).hypot(3.0 * k1 * v * a) / jerk - 1.0);
                for s in [-1.0, 1.0].map(|part| part * ramp[2]) {
                    let across = k3 * v.powi(4) - 3.0 * k1 * a * a - 4.0 * k1 * v * j;
                    worst = worst.max((s - 6.0 * k2 * v * v * a).hypot(across) / snap - 1.0);
                }
            }
        }
    }
    println!(
        "limits exceeded by {worst:.1e}; feeds lower than in f64 by {slowest:.2} of the bound; {refused:?} refused"
    );
    assert!(worst <= 1e-8, "{worst:e}");
    assert!(slowest <= 1.0, "{slowest}");
    assert!(refused[0] < 1000 && refused[1] < 15_000, "{refused:?}");
}

/// Junctions: the steps of velocity and acceleration keep their limit.
#[test]
fn junctions_keep_the_acceleration_step() {
    let mut random = Random::of_stream(93);
    let mut worst = 0.0_f64;
    for _ in 0..100_000 {
        let angle = fixed(if random.once_in(4) { 0.0 } else { random.log(1e-8, 0.1) });
        let bend = fixed(if random.once_in(4) { 0.0 } else { random.log(1e-6, 2e3) });
        let (step, tick) = (fixed(random.log(1.0, 1e9)), fixed(random.log(1e-5, 1e-2)));
        let feed =
            junction(&Junction { angle_rad: angle, curvature_step_per_mm: bend }, fixed(0.1), step, tick);
        let [v, angle, bend, step, tick] = [feed, angle, bend, step, tick].map(Fixed::to_f64);
        if angle == 0.0 && bend == 0.0 {
            assert_eq!(feed.to_q32(), i64::MAX);
        } else {
            worst = worst.max((v * angle / tick + v * v * bend) / step - 1.0);
        }
    }
    println!("step exceeded by {worst:.1e}");
    // Beyond the range: no overflow, and a stop.
    let huge = fixed(f64::INFINITY);
    for (angle_rad, curvature_step_per_mm) in
        [(fixed(0.05), huge), (huge, Fixed::ZERO), (fixed(0.05), fixed(1e9))]
    {
        let steps = Junction { angle_rad, curvature_step_per_mm };
        assert!(junction(&steps, huge, huge, fixed(1e-3)) < fixed(10.0));
        assert_eq!(
            junction(&Junction { angle_rad: fixed(1.0), ..steps }, huge, huge, fixed(STEP)),
            Fixed::ZERO
        );
    }
    assert!(worst <= 1e-8, "{worst:e}");
}

/// The segments of any plan fill it exactly, each starting at the feed at which its predecessor ends; what
/// is too soft for a segment is refused.
#[test]
fn segments_join() {
    let mut random = Random::of_stream(95);
    let (mut count, mut refused) = (0, 0);
    for case in 0..20_000 {
        let range = if case % 2 == 0 { Range::Machines } else { Range::Accepted };
        let (mut blocks, _) = range.blocks(&mut random, 20);
        for block in blocks.iter_mut().filter(|block| block.length_mm > Fixed::ZERO) {
            block.length_mm = fixed(random.log(1e-6 + STEP, 1e3));
        }
        let plans = planned(&blocks, Fixed::ZERO, Fixed::ZERO).expect("a plan");
        let (mut end, mut feed) = (Position::ZERO, Fixed::ZERO);
        for (block, plan) in blocks.iter().zip(&plans) {
            let start = end;
            end = start + Position::from_bits(block.length_mm.to_q32());
            let made = ramps(block, plan, start, end, TICK_S).and_then(|made| {
                made.iter().flatten().map(|ramp| ramp.segment::<Fixed>(TICK_S)).collect::<Result<Vec<_>, _>>()
            });
            let made = match made {
                Ok(made) => made,
                Err(SegmentError::OutOfRange { .. }) => {
                    refused += 1;
                    break;
                }
                Err(error) => panic!("{error}: {block:?} {plan:?}"),
            };
            let mut at = start;
            for segment in &made {
                assert_eq!(segment.from_mm_s(), feed, "{block:?} {plan:?} {made:?}");
                feed = segment.to_mm_s();
                at = at + segment.length();
                count += 1;
            }
            assert_eq!((at, feed), (end, plan.exit_mm_s), "{block:?} {plan:?}");
        }
    }
    println!("{count} segments, {refused} refused");
    assert!(refused < 4000);
}

/// From the plan to the last tick without a float but at the seam: what is planned in fixed point is accepted, and
/// executed within the limits, without a step, to the exact end.
#[test]
fn plans_are_accepted_and_executed() {
    let mut random = Random::of_stream(94);
    let (mut executed, mut ticks, mut worst) = (0, 0_u64, [0.0_f64; 5]);
    while executed < 150 {
        let limits = Range::Machines.limits(&mut random);
        let (law, _) = laws(any_pulse(&mut random), limits);
        let (_, mut wide) = Range::Machines.blocks(&mut random, 30);
        let longest = 300.0 / wide.len() as f64;
        let mut blocks = Vec::new();
        for wide in &mut wide {
            let length_mm = fixed(wide.length_mm.min(longest));
            blocks.push(Block {
                length_mm,
                cap_mm_s: fixed(wide.cap_mm_s),
                junction_mm_s: fixed(wide.junction_mm_s),
                law,
            });
        }
        let plans = planned(&blocks, Fixed::ZERO, Fixed::ZERO).expect("a plan");
        // Positions are steps of the same size: lengths add up exactly.
        let mut end = Position::ZERO;
        let mut all: Vec<FeedSegment<Fixed>> = Vec::new();
        let mut planned_ramps = Vec::new();
        for (block, plan) in blocks.iter().zip(&plans) {
            let start = end;
            end = start + Position::from_bits(block.length_mm.to_q32());
            let made = ramps(block, plan, start, end, TICK_S).expect("ramps");
            let length = made.iter().flatten().fold(start, |at, ramp| at + ramp.length);
            assert_eq!(length, end, "{block:?} {plan:?}");
            all.extend(made.iter().flatten().map(|ramp| ramp.segment(TICK_S).expect("a segment")));
            planned_ramps.extend(made.into_iter().flatten());
        }
        let duration: f64 = all.iter().map(|segment| segment.duration().to_f64()).sum();
        if !(1.0..60_000.0).contains(&duration) {
            continue;
        }
        executed += 1;
        let [accel_mm_s2, jerk_mm_s3, snap_mm_s4] = limits.map(|limit| fixed(limit).to_f64());
        let rules = PathRules {
            limits: Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 },
            feed_mm_s: blocks.iter().map(|block| block.cap_mm_s.to_f64()).fold(0.0, f64::max),
            junction_angle_rad: 0.01,
            junction_gap_mm: 0.0,
        };
        let mut streams = Streams::<Fixed, 1, 64, 64>::new();
        let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
        let mut executor = Executor::<Fixed, 1>::new([Position::ZERO]);
        let mut supply = Supply::new(&all, end);
        let rounding = planned_ramps.iter().fold(0.0, |rounding: f64, &PlannedRamp { ramp, .. }| {
            let gained: f64 = ramp.peak_jerk_mm_s3 * f64::powi(2.0 * ramp.edge_s, 3);
            rounding.max(2.0 * 70.0 / 536_870_912.0 * gained / 496.1 + 2.0 * STEP * ramp.length_mm())
        });
        let mut before = [0.0; 5];
        loop {
            supply.fill(&mut feeder);
            let now = executor.tick(&mut intake).expect("no fault");
            ticks += 1;
            if now.state == ExecState::Idle {
                assert_eq!(now.setpoints[0].position, end, "not at its end");
                break;
            }
            let motion = &now.motion;
            let along = judge::along(motion);
            let limits = [rules.feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4];
            for k in 0..4 {
                worst[k] = worst[k].max(along[k].abs() / limits[k] - 1.0);
            }
            let now = [motion.s.to_mm(), along[0], along[1], along[2], along[3]];
            // The length of a tick from the feeds and accelerations at its ends; snap bounds the error, and the
            // position of a ramp is rounded: its sine, and the products of its length.
            let step = TICK_S * (before[1] + now[1]) / 2.0 - TICK_S.powi(2) * (now[2] - before[2]) / 12.0;
            let bound =
                TICK_S.powi(4) * snap_mm_s4 / 100.0 + 2e-8 + rounding + 1e-8 * TICK_S * now[1].max(before[1]);
            worst[4] = worst[4].max((now[0] - before[0] - step).abs() / bound);
            before = now;
        }
    }
    println!(
        "{executed} stretches, {ticks} ticks; feed, a, j, snap beyond limits {:?}; step {:.2} of its bound",
        &worst[..4],
        worst[4]
    );
    assert!(ticks > 100_000);
    assert!(worst[..4].iter().all(|&part| part <= 2e-8), "{worst:?}");
    assert!(worst[4] <= 1.0, "{worst:?}");
}
