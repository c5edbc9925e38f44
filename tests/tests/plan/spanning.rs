//! Ramps that span blocks: legal everywhere, and as fast as can be asked of them.
//!
//! The yardstick is a plan that always exists: acceleration alone under ceilings that are widened by c·t₁/2 on both
//! sides, then filtered in time with the law's own pulse of length t₁ ([`Yardstick`]). With t₁ = 2A/J it keeps the
//! jerk limit only where its acceleration does not swing from +A to −A within t₁, where the pulses add up; t₁ is
//! stretched until it does. An interval with no room to hold its feed stays up to a twentieth slower than it: its filter
//! lets the end of one ramp overlap the begin of the next, which two ramps of the law do not.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use motion_kernel::internals::{Passing, merge_equal};
use motion_kernel::law::{Law, Limits, Ramp};
use motion_kernel::plan::{Block, Node, PlanError, nodes_for, plan_spanning};

use super::{block, from_rest, law, laws, planned, random_blocks, time_s};
use motion_tests::PULSES;
use motion_tests::random::Random;

/// A ramp or a cruise with its place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) start_mm: f64,
    pub(crate) length_mm: f64,
    pub(crate) ramp: Ramp<f64>,
}

pub(crate) fn spans_between(
    blocks: &[Block<f64>],
    start: f64,
    end: f64,
) -> Result<Option<(f64, Vec<Span>)>, PlanError> {
    let mut places = vec![Node::EMPTY; nodes_for(blocks.len())];
    let mut spans = Vec::new();
    let mut put = |start_mm: f64, &ramp: &Ramp<f64>| {
        spans.push(Span { start_mm, length_mm: ramp.length_mm(), ramp });
    };
    let time_s = plan_spanning(blocks, start, end, &mut places, &mut put)?;
    Ok(time_s.map(|time_s| (time_s, spans)))
}

pub(crate) fn spans(blocks: &[Block<f64>]) -> (f64, Vec<Span>) {
    spans_between(blocks, 0.0, 0.0).expect("in range").expect("a plan")
}

/// Every ceiling, junction and limit at many instants of every span, and that the spans are one motion.
pub(crate) fn legal(blocks: &[Block<f64>], start: f64, end: f64, spans: &[Span]) -> Result<(), String> {
    const WITHIN: f64 = 1.0 + 1e-9;
    let mut ends = Vec::new();
    let mut total = 0.0;
    for block in blocks {
        total += block.length_mm;
        ends.push(total);
    }
    let rounding = 1e-8 + 1e-12 * total;
    let (mut at, mut feed) = (0.0, start);
    for span in spans {
        if (span.start_mm - at).abs() > rounding || span.ramp.from_mm_s != feed || span.length_mm < 0.0 {
            return Err(format!("{span:?} after {at} mm at {feed} mm/s"));
        }
        let duration = span.ramp.duration_s();
        for part in 0..=64 {
            let state = span.ramp.at(duration * f64::from(part) / 64.0);
            let s = if span.ramp.peak_jerk_mm_s3 <= 0.0 {
                span.length_mm * f64::from(part) / 64.0
            } else {
                state.s_mm
            };
            let s = span.start_mm + s;
            // The blocks that are certainly reached, and certainly not left.
            let first = ends.partition_point(|&end| end <= s + rounding);
            let last = ends.partition_point(|&end| end < s - rounding);
            for block in
                blocks.iter().take(first + 1).skip(last).filter(|block| block.length_mm > 2.0 * rounding)
            {
                // At the junction itself the lower ceiling holds already; only one of them can be said to be broken.
                if first == last && state.v_mm_s > block.cap_mm_s * WITHIN {
                    return Err(format!("{} mm/s at {s} mm below {}", state.v_mm_s, block.cap_mm_s));
                }
                let limits = block.law.limits();
                if first == last
                    && (state.a_mm_s2.abs() > limits.accel_mm_s2 * WITHIN
                        || state.j_mm_s3.abs() > limits.jerk_mm_s3 * WITHIN
                        || state.snap_mm_s4.abs() > limits.snap_mm_s4 * WITHIN)
                {
                    return Err(format!("{state:?} at {s} mm within {limits:?}"));
                }
            }
        }
        at = span.start_mm + span.length_mm;
        feed = span.ramp.to_mm_s;
    }
    if (at - total).abs() > rounding || feed != end {
        return Err(format!("ends at {at} of {total} mm with {feed} of {end} mm/s"));
    }
    // Feeds through junctions, from the spans that hold them.
    for (block, &junction) in blocks.iter().zip(&ends).take(blocks.len().saturating_sub(1)) {
        // Where exactly the junction lies is known to rounding only.
        let found = [-rounding, 0.0, rounding].map(|off| feed_at(spans, junction + off));
        let found = found.into_iter().fold(f64::INFINITY, f64::min);
        if found > block.junction_mm_s * WITHIN + 1e-6 {
            return Err(format!(
                "{found} mm/s through the junction at {junction} mm, at most {}",
                block.junction_mm_s
            ));
        }
    }
    Ok(())
}

/// The feed at `s_mm`, by halving the time.
fn feed_at(spans: &[Span], s_mm: f64) -> f64 {
    let index = spans.partition_point(|span| span.start_mm < s_mm).saturating_sub(1);
    let Some(span) = spans.get(index) else { return 0.0 };
    if span.ramp.peak_jerk_mm_s3 <= 0.0 {
        return span.ramp.from_mm_s;
    }
    // Over the length of path that it is driven on, which is the ramp's own but for rounding.
    let s_mm = (s_mm - span.start_mm) * (span.ramp.length_mm() / span.length_mm);
    let (mut early, mut late) = (0.0, span.ramp.duration_s());
    for _ in 0..80 {
        let middle = 0.5 * (early + late);
        if span.ramp.at(middle).s_mm < s_mm { early = middle } else { late = middle }
    }
    span.ramp.at(late).v_mm_s
}

/// One pair of ramps for all equal neighbours together.
pub(crate) fn merged_s(blocks: &[Block<f64>]) -> f64 {
    let mut blocks = blocks.to_vec();
    let count = merge_equal(&mut blocks);
    blocks.truncate(count);
    time_s(&blocks, &from_rest(&blocks))
}

/// The plan under acceleration alone, of ceilings widened by their feed times `t1_s`/2.
struct Yardstick {
    time_s: f64,
    /// Durations and accelerations.
    parts: Vec<(f64, f64)>,
}

impl Yardstick {
    fn new(blocks: &[Block<f64>], t1_s: f64) -> Self {
        let accel = blocks[0].law.limits().accel_mm_s2;
        let (mut widened, mut total) = (Vec::new(), 0.0);
        for block in blocks.iter().filter(|block| block.length_mm > 0.0) {
            let more = block.cap_mm_s * t1_s / 2.0;
            widened.push((total - more, total + block.length_mm + more, block.cap_mm_s));
            total += block.length_mm;
        }
        let mut cuts: Vec<f64> =
            widened.iter().flat_map(|w| [w.0, w.1]).filter(|&s| s > 0.0 && s < total).collect();
        cuts.extend([0.0, total]);
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        let mut events: Vec<(f64, f64, bool)> =
            widened.iter().flat_map(|&(from, to, cap)| [(from, cap, true), (to, cap, false)]).collect();
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut events = events.into_iter().peekable();
        let mut open = BTreeMap::<u64, usize>::new();
        let caps: Vec<f64> = cuts
            .windows(2)
            .map(|cut| {
                while let Some((_, cap, begins)) = events.next_if(|event| event.0 <= 0.5 * (cut[0] + cut[1]))
                {
                    let count = open.entry(cap.to_bits()).or_default();
                    if begins {
                        *count += 1;
                    } else if *count == 1 {
                        open.remove(&cap.to_bits());
                    } else {
                        *count -= 1;
                    }
                }
                f64::from_bits(*open.keys().next().expect("a ceiling everywhere"))
            })
            .collect();
        let mut feeds = vec![0.0_f64; cuts.len()];
        let reached =
            |from: f64, index: usize| (from * from + 2.0 * accel * (cuts[index + 1] - cuts[index])).sqrt();
        for index in 0..caps.len() {
            let next = caps.get(index + 1).copied().unwrap_or(0.0);
            feeds[index + 1] = reached(feeds[index], index).min(caps[index]).min(next);
        }
        for index in (0..caps.len()).rev() {
            feeds[index] = feeds[index].min(reached(feeds[index + 1], index));
        }
        let mut parts = Vec::new();
        for (index, &cap) in caps.iter().enumerate() {
            let (from, to, length) = (feeds[index], feeds[index + 1], cuts[index + 1] - cuts[index]);
            let top = ((from * from + to * to) / 2.0 + accel * length).sqrt().min(cap);
            let held = length - (2.0 * top * top - from * from - to * to) / (2.0 * accel);
            parts.extend([
                ((top - from) / accel, accel),
                (held.max(0.0) / top, 0.0),
                ((top - to) / accel, -accel),
            ]);
        }
        Self { time_s: parts.iter().map(|part| part.0).sum(), parts }
    }

    /// The greatest jerk once filtered with (2/t₁)·sin²(πt/t₁).
    fn jerk_mm_s3(&self, t1_s: f64) -> f64 {
        let (mut switches, mut t, mut accel) = (Vec::new(), 0.0, 0.0);
        for &(duration, next) in self.parts.iter().filter(|part| part.0 > 1e-12) {
            if next != accel {
                switches.push((t, next - accel));
                accel = next;
            }
            t += duration;
        }
        switches.push((t, -accel));
        let samples = (0..=4000).map(|n| (t + t1_s) * f64::from(n) / 4000.0);
        let jerk = |at: f64| -> f64 {
            let first = switches.partition_point(|switch| switch.0 < at - t1_s);
            let active = switches[first..].iter().take_while(|switch| switch.0 < at);
            active.map(|&(t, step)| step * 2.0 / t1_s * (PI * (at - t) / t1_s).sin().powi(2)).sum()
        };
        samples.map(|at| jerk(at).abs()).fold(0.0, f64::max)
    }

    /// The time of the fastest one that keeps the jerk limit, and of the one with t₁ = 2A/J \[s\].
    fn times_s(blocks: &[Block<f64>]) -> (f64, f64) {
        let limits = blocks[0].law.limits();
        let jerk = limits.jerk_mm_s3.min((2.0 * limits.accel_mm_s2 * limits.snap_mm_s4 / PI).sqrt());
        let shortest = 2.0 * limits.accel_mm_s2 / jerk;
        let literal = Self::new(blocks, shortest).time_s + shortest;
        let mut t1_s = shortest;
        loop {
            let plan = Self::new(blocks, t1_s);
            if plan.jerk_mm_s3(t1_s) <= jerk * 1.001 {
                return (plan.time_s + t1_s, literal);
            }
            t1_s *= 1.02;
        }
    }
}

/// How the plan compares; panics if it is not legal or faster than acceleration allows.
struct Compared {
    name: &'static str,
    /// Against the lesser of the merged plan and the yardstick, legal and literal.
    ratio: f64,
    literal: f64,
    blocks: usize,
    time_s: f64,
}

fn compared(name: &'static str, blocks: &[Block<f64>]) -> Compared {
    let (spanning_s, spans) = spans(blocks);
    if let Err(error) = legal(blocks, 0.0, 0.0, &spans) {
        panic!("{name}: {error}\n{blocks:?}");
    }
    let sum: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
    assert!((sum - spanning_s).abs() < 1e-9 * sum);
    let merged = merged_s(blocks);
    let (yardstick, literal) = Yardstick::times_s(blocks);
    let bound = Yardstick::new(blocks, 0.0).time_s;
    assert!(spanning_s > bound * (1.0 - 1e-9), "{name}: {spanning_s} s, acceleration alone {bound} s");
    // The planner takes the faster of both.
    let time_s = spanning_s.min(merged);
    Compared {
        name,
        ratio: time_s / merged.min(yardstick),
        literal: time_s / merged.min(literal),
        blocks: blocks.len(),
        time_s,
    }
}

pub(crate) fn rising_steps(steps: usize, step_mm: f64, low: f64, high: f64) -> Vec<Block<f64>> {
    (0..steps).map(|n| block(step_mm, low + (high - low) * n as f64 / steps as f64)).collect()
}

/// The named cases, and steps up and down, from 1 µm to 100 mm.
#[test]
fn named_cases_are_as_fast_as_the_yardstick() {
    let feed = 5000.0 / 60.0;
    let mut all = vec![
        compared("500 x 0.1 mm", &vec![block(0.1, feed); 500]),
        compared("10 000 x 1 nm", &vec![block(1e-6, feed); 10_000]),
        compared("8 m", &[block(8000.0, feed)]),
        compared(
            "alternating 0.1 mm",
            &(0..400).map(|n| block(0.1, [80.0, 40.0][n % 2])).collect::<Vec<_>>(),
        ),
        compared("alternating 5 mm", &(0..100).map(|n| block(5.0, [80.0, 40.0][n % 2])).collect::<Vec<_>>()),
        compared(
            "saw-tooth 0.5 mm",
            &(0..400).map(|n| block(0.5, 5.0 + 8.0 * (n % 10) as f64)).collect::<Vec<_>>(),
        ),
        compared(
            "saw-tooth 5 mm",
            &(0..100).map(|n| block(5.0, 5.0 + 8.0 * (n % 10) as f64)).collect::<Vec<_>>(),
        ),
        compared(
            "zero-length blocks",
            &(0..300).map(|n| block([0.3, 0.0, 0.7][n % 3], 30.0 + (n % 7) as f64)).collect::<Vec<_>>(),
        ),
    ];
    assert!(all[0].time_s <= 0.967, "{} s", all[0].time_s);
    for step_mm in [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0] {
        for steps in [20, 500] {
            for (low, high) in [(1.0, 80.0), (20.0, 200.0)] {
                let up = rising_steps(steps, step_mm, low, high);
                let down: Vec<_> = up.iter().rev().copied().collect();
                let both: Vec<_> = up.iter().chain(&down).copied().collect();
                all.extend([
                    compared("steps up", &up),
                    compared("down", &down),
                    compared("up and down", &both),
                ]);
            }
        }
    }
    for case in &all {
        let Compared { name, ratio, literal, blocks, time_s } = case;
        println!(
            "{name}, {blocks} blocks: {time_s:.4} s, {ratio:.4} of the yardstick, {literal:.4} of the literal"
        );
    }
    let worst = all.iter().map(|case| case.ratio).fold(0.0, f64::max);
    assert!(worst <= 1.02, "{worst}");
}

/// Random lists of many kinds, all with one law.
#[test]
fn random_lists_are_as_fast_as_the_yardstick() {
    let mut random = Random::of_stream(31);
    let mut all = Vec::new();
    for case in 0..1000 {
        let count = 1 + random.below(120);
        let step = random.log(1e-3, 50.0);
        let mut walk = 50.0;
        let blocks: Vec<_> = (0..count)
            .map(|n| match case % 5 {
                0 => block(random.log(1e-3, 100.0), random.log(1.0, 200.0)),
                1 => block(step * random.log(0.01, 1.0), 50.0 + 50.0 * random.log(0.01, 1.0)),
                2 => block(step, if n % 2 == 0 { 90.0 } else { 30.0 }),
                3 => block(step, 10.0 + 150.0 * (n + 1) as f64 / count as f64),
                _ => {
                    walk = f64::clamp(walk * random.log(0.8, 1.25), 1.0, 200.0);
                    block(step * random.log(0.01, 1.0), walk)
                }
            })
            .collect();
        all.push(compared("random", &blocks));
    }
    all.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    let above = |limit: f64| all.iter().filter(|case| case.ratio > limit).count();
    let literal = all.iter().filter(|case| case.literal > 1.02).count();
    println!(
        "worst {:.4}, {} above 1.02 of the yardstick, {literal} of the literal",
        all[0].ratio,
        above(1.02)
    );
    // Single intervals without room to hold; everything else is within.
    assert!(above(1.02) <= 5 && all[0].ratio < 1.05);
    assert!(literal <= 20, "{literal}");
}

/// Every block with limits of its own, junctions that slow and stop, any feed at both ends.
#[test]
fn random_lists_are_legal() {
    let mut random = Random::of_stream(32);
    let (mut made, mut none) = (0, 0);
    for _ in 0..3000 {
        let blocks = random_blocks(&mut random, 60, 1e-3);
        let ends = [blocks[0].cap_mm_s, blocks[blocks.len() - 1].cap_mm_s]
            .map(|cap| if random.once_in(2) { 0.0 } else { cap * random.log(0.01, 1.0) });
        if planned(&blocks, ends[0], ends[1]).is_err() {
            continue;
        }
        match spans_between(&blocks, ends[0], ends[1]).expect("in range") {
            None => none += 1,
            Some((_, spans)) => {
                made += 1;
                if let Err(error) = legal(&blocks, ends[0], ends[1], &spans) {
                    panic!("{error}\nfrom {ends:?}: {blocks:?}");
                }
                assert!(spans_between(&blocks, ends[0], ends[1]).expect("again").expect("again").1 == spans);
            }
        }
    }
    println!("{made} plans, {none} lists without one");
    assert!(made > 1500 && none * 50 < made, "{made} {none}");
}

#[test]
fn too_few_places_are_refused() {
    let blocks = [block(1.0, 10.0), block(1.0, 20.0)];
    let mut places = [Node::EMPTY; 3];
    let refused = plan_spanning(&blocks, 0.0, 0.0, &mut places, &mut |_, _| {});
    assert_eq!(refused, Err(PlanError::Room { of: "nodes", needed: 6, places: 3 }));
}

/// The inverse: how far into a ramp a feed is passed.
#[test]
fn a_ramp_passes_its_feeds_where_it_says() {
    let laws = laws();
    let mut random = Random::of_stream(33);
    for n in 0..20_000 {
        let law = laws[n % laws.len()];
        let from = random.log(1e-2, 1e2);
        let ramp = Ramp::new(&law, from, from + random.log(1e-3, 1e3));
        let t = ramp.duration_s() * random.log(1e-3, 1.0);
        let state = ramp.at(t);
        let found = ramp.length_to_feed_mm(state.v_mm_s);
        // Where the feed hardly changes a last place of it is a long way.
        let slack = 8.0 * f64::EPSILON * state.v_mm_s * state.v_mm_s / state.a_mm_s2;
        assert!(
            (found - state.s_mm).abs() <= 1e-9 * ramp.length_mm() + slack,
            "{ramp:?} {t}: {found} {state:?}"
        );
        let (low, high) = Passing::new(&ramp).length_to_feed_mm(state.v_mm_s);
        assert!(low <= found && found <= high, "{ramp:?} {t}: {low} {found} {high}");
        assert!(high - low <= 1e-3 * ramp.length_mm(), "{ramp:?} {t}: {low} {high}");
    }
}

/// Backwards the same plan, whatever limits each block has.
#[test]
fn a_list_takes_as_long_backwards() {
    for pulse in PULSES {
        let mut random = Random::of_stream(37);
        let (mut worst, mut lists) = (0.0_f64, 0);
        for _ in 0..500 {
            let mut blocks = random_blocks(&mut random, 30, 0.1);
            for block in &mut blocks {
                block.junction_mm_s = f64::INFINITY;
                block.law = Law::new(pulse, block.law.limits()).expect("limits");
            }
            let Some(off) = off_backwards(&blocks) else { continue };
            (worst, lists) = (worst.max(off), lists + 1);
        }
        println!("{}: worst {worst:.1e} of {lists} lists", pulse.name());
        assert!(worst < BACKWARDS_OFF_MAX && lists > 400, "{}: {worst}", pulse.name());
    }
}

/// Parts of the time by which a list may differ from itself backwards.
const BACKWARDS_OFF_MAX: f64 = 2e-5;

/// By what part of its time a list takes longer or shorter backwards; none if it has no length or no plan.
fn off_backwards(blocks: &[Block<f64>]) -> Option<f64> {
    let mut back = blocks.to_vec();
    back.reverse();
    let [on, back] =
        [blocks, &back].map(|blocks| spans_between(blocks, 0.0, 0.0).ok()?.map(|(time_s, _)| time_s));
    let (on, back) = (on?, back?);
    (on > 0.0).then_some((on / back - 1.0).abs())
}

/// A long, soft block between short, hard ones. Where it ends was off by a last place on the way back, and so
/// its limits held for the ramp beside it too: that one did not fit, and the slowest feed was held over all
/// of its length, for 9309 s instead of 313.
#[test]
fn a_soft_block_does_not_reach_over_its_ends() {
    let hard = (5e3, 1e5, 5e6);
    let soft = (100.0, 100.0, 1e4);
    for pulse in PULSES {
        let list = |middle_mm: f64| {
            let figures = [(2.917, 36.0, hard), (middle_mm, 2.4, soft), (0.157, 0.08, hard)];
            figures.map(|(length_mm, cap_mm_s, (accel_mm_s2, jerk_mm_s3, snap_mm_s4))| {
                let limits = Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 };
                let law = Law::new(pulse, limits).expect("limits");
                Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law }
            })
        };
        for step in 0..1000 {
            let blocks = list(700.0 + 0.137 * f64::from(step));
            let off = off_backwards(&blocks).expect("a plan");
            assert!(off < BACKWARDS_OFF_MAX, "{}, {} mm: {off}", pulse.name(), blocks[1].length_mm);
        }
    }
}

/// Strong and weak blocks by turns, of which only the strong ones would let every third ceiling be rested in: minima that
/// cannot be reached, by the thousand.
pub(crate) fn unreachable(weak_mm_s2: f64, slope: f64, length_mm: f64) -> Vec<Block<f64>> {
    let (weak, strong) = (law(weak_mm_s2, 1e4, 1e6), law(5e4, 1e9, 1e12));
    (0..3000)
        .flat_map(|n| {
            let cap_mm_s = 100.0 * (1.0 + slope * f64::from(n) / 3000.0);
            [(0.2, 1.0, weak), (0.4, 1.5, strong), (0.4, 2.0, weak)].map(|(part, higher, law)| Block {
                length_mm: length_mm * part,
                cap_mm_s: cap_mm_s * higher,
                junction_mm_s: f64::INFINITY,
                law,
            })
        })
        .collect()
}

/// A chain of minima that are given up one after the other from the same foot is no reason for having no plan.
#[test]
fn a_long_chain_of_minima_is_given_up() {
    let on = unreachable(500.0, 0.0, 0.01);
    let back: Vec<_> = on.iter().rev().copied().collect();
    for blocks in [on, back] {
        let (time_s, made) = spans(&blocks);
        if let Err(error) = legal(&blocks, 0.0, 0.0, &made) {
            panic!("{error}");
        }
        assert!(time_s <= merged_s(&blocks) * (1.0 + 1e-9), "{time_s} {}", merged_s(&blocks));
    }
}
