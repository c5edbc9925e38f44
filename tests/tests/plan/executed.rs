//! Plans of block lists as the executor drives them, tick by tick: every ceiling, junction and limit where the machine is at
//! that tick, not only where a span says it is.
//!
//! The oracle knows the blocks' ends and the executed position, feed, acceleration, jerk and snap, and nothing of spans.

use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::law::{FeedSegment, Limits};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::plan::Block;
use motion_kernel::queue::{Feeder, PathRules, Refused, Streams};
use motion_kernel::units::Position;

use super::spanning::{Span, rising_steps, spans};
use super::{block, laws};
use motion_tests::judge::along;
use motion_tests::random::Random;

const TICK_S: f64 = 0.0005;
/// Where a junction lies is known to some position steps, and to the digits of the sum of lengths \[mm\].
const ROUNDING_MM: f64 = 2.0e-9;
/// Greatest piece \[mm\].
const PIECE_MM: f64 = 16.0;

fn position(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

/// The segments of a plan over exact positions, up to `end`.
fn segments<R: Real>(spans: &[Span], end: Position) -> Vec<FeedSegment<R>> {
    let starts: Vec<Position> = spans.iter().map(|span| position(span.start_mm)).chain([end]).collect();
    let made = spans.iter().zip(starts.windows(2)).filter_map(|(span, ends)| {
        let length = ends[1] - ends[0];
        if !span.ramp.is_cruise() {
            return Some(FeedSegment::ramp(&span.ramp, length, TICK_S).expect("a ramp"));
        }
        let is_any = length > Position::ZERO;
        is_any.then(|| FeedSegment::cruise(span.ramp.from_mm_s, length, TICK_S).expect("a cruise"))
    });
    made.collect()
}

/// What was found, as parts of what is allowed; above 1 something is broken.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    feed: f64,
    junction: f64,
    accel: f64,
    jerk: f64,
    snap: f64,
    ticks: u64,
}

impl Worst {
    fn all(&self) -> [f64; 5] {
        [self.feed, self.junction, self.accel, self.jerk, self.snap]
    }

    fn merge(&mut self, other: &Self) {
        self.feed = self.feed.max(other.feed);
        self.junction = self.junction.max(other.junction);
        self.accel = self.accel.max(other.accel);
        self.jerk = self.jerk.max(other.jerk);
        self.snap = self.snap.max(other.snap);
        self.ticks += other.ticks;
    }
}

/// A stretch along one axis, in lines of at most 16 mm, that fills the streams.
pub(crate) struct Supply<'a, R> {
    segments: &'a [FeedSegment<R>],
    at: Position,
    end: Position,
    is_ended: bool,
}

fn is_taken<T: std::fmt::Debug>(answer: Result<(), Refused<T>>) -> bool {
    match answer {
        Ok(()) => true,
        Err(Refused::Full(_)) => false,
        Err(refused) => panic!("{refused:?}"),
    }
}

impl<'a, R: Real> Supply<'a, R> {
    pub(crate) fn new(segments: &'a [FeedSegment<R>], end: Position) -> Self {
        Self { segments, at: Position::ZERO, end, is_ended: false }
    }

    pub(crate) fn fill(&mut self, feeder: &mut Feeder<'_, R, 1>) {
        while self.at < self.end {
            let length = Ord::min(self.end - self.at, position(PIECE_MM));
            if !is_taken(feeder.piece(Piece::line(1, [self.at], [1.0], length).expect("a line"))) {
                break;
            }
            self.at = self.at + length;
        }
        while let [first, rest @ ..] = self.segments
            && is_taken(feeder.segment(*first))
        {
            self.segments = rest;
        }
        if self.at == self.end && self.segments.is_empty() && !self.is_ended {
            self.is_ended = is_taken(feeder.end_stretch([self.end]));
        }
    }
}

/// Plans and executes; `digits` is what the number type keeps of a feed.
fn executed<R: Real>(name: &str, blocks: &[Block<f64>], digits: f64) -> Worst {
    let (time_s, spans) = spans(blocks);
    let ends_mm: Vec<f64> = blocks
        .iter()
        .scan(0.0, |at, block| {
            *at += block.length_mm;
            Some(*at)
        })
        .collect();
    let end = position(ends_mm[ends_mm.len() - 1]);
    let all = segments::<R>(&spans, end);
    let greatest =
        |of: fn(&Limits<f64>) -> f64| blocks.iter().map(|b| of(&b.law.limits())).fold(0.0, f64::max);
    let limits = Limits {
        accel_mm_s2: greatest(|limits| limits.accel_mm_s2),
        jerk_mm_s3: greatest(|limits| limits.jerk_mm_s3),
        snap_mm_s4: greatest(|limits| limits.snap_mm_s4),
    };
    let feed_mm_s = blocks.iter().map(|block| block.cap_mm_s).fold(0.0, f64::max);
    // In f32 a piece ends within a rounding of its length.
    let rules = PathRules { limits, feed_mm_s, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let mut streams = Streams::<R, 1, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
    let mut executor = Executor::<R, 1>::new([Position::ZERO]);
    let mut supply = Supply::new(&all, end);
    let mut worst = Worst::default();
    // Position, feed and acceleration of the tick before.
    let (mut first, mut before) = (0, [0.0; 3]);
    loop {
        supply.fill(&mut feeder);
        let now = executor.tick(&mut intake).unwrap_or_else(|fault| panic!("{name}: {fault:?}"));
        if now.state == ExecState::Idle {
            assert_eq!(now.setpoints[0].position, end, "{name}: not at its end");
            break;
        }
        worst.ticks += 1;
        let motion = &now.motion;
        let s_mm = motion.s.to_mm();
        let [v, a, j, snap] = along(motion);
        // Junctions since the last tick: the acceleration there is that of either tick but for what jerk makes of it.
        while first < blocks.len() && ends_mm[first] < s_mm - ROUNDING_MM {
            let change = limits.jerk_mm_s3 * TICK_S;
            let junction_mm = ends_mm[first];
            let on = (junction_mm - before[0] - ROUNDING_MM) * (before[2] - change);
            let back = (s_mm - junction_mm + ROUNDING_MM) * -(a + change);
            let least = (before[1].powi(2) + 2.0 * on).max(v.powi(2) + 2.0 * back);
            if let Some(next) = blocks.get(first + 1).filter(|_| least > 0.0) {
                let allowed = blocks[first].junction_mm_s.min(blocks[first].cap_mm_s).min(next.cap_mm_s);
                let off = 2.0 * limits.accel_mm_s2 * ROUNDING_MM / allowed;
                worst.junction = worst.junction.max(least.sqrt() / (allowed * (1.0 + digits) + off));
            }
            first += 1;
        }
        // The block that the machine certainly is in.
        if let Some(block) = blocks.get(first).filter(|block| {
            s_mm < ends_mm[first] - ROUNDING_MM && s_mm > ends_mm[first] - block.length_mm + ROUNDING_MM
        }) {
            // Off by a rounding of the position, the feed is another: v·dv = a·ds.
            let off = limits.accel_mm_s2 * ROUNDING_MM / block.cap_mm_s;
            let own = block.law.limits();
            worst.feed = worst.feed.max(v / (block.cap_mm_s * (1.0 + digits) + off));
            worst.accel = worst.accel.max(a.abs() / (own.accel_mm_s2 * (1.0 + digits)));
            worst.jerk = worst.jerk.max(j.abs() / (own.jerk_mm_s3 * (1.0 + digits)));
            worst.snap = worst.snap.max(snap.abs() / (own.snap_mm_s4 * (1.0 + digits)));
        }
        before = [s_mm, v, a];
    }
    let executed_s = worst.ticks as f64 * TICK_S;
    assert!(
        (executed_s - time_s).abs() <= TICK_S * 1.01 + 1e-9 * time_s,
        "{name}: {executed_s} s of {time_s} s"
    );
    if let Some(part) = worst.all().into_iter().find(|&part| part > 1.0) {
        panic!("{name}: {part} of what is allowed: {worst:?}");
    }
    worst
}

/// In both kinds of floating point.
fn both(name: &str, blocks: &[Block<f64>]) -> Worst {
    let mut worst = executed::<f64>(name, blocks, 1e-9);
    worst.merge(&executed::<f32>(name, blocks, 1e-6));
    worst
}

#[test]
fn named_cases_keep_every_limit_in_every_tick() {
    let feed = 5000.0 / 60.0;
    let mut all = vec![
        ("500 x 0.1 mm", vec![block(0.1, feed); 500]),
        ("10 000 x 1 nm", vec![block(1e-6, feed); 10_000]),
        ("8 m", vec![block(8000.0, feed)]),
        ("alternating 0.1 mm", (0..400).map(|n| block(0.1, [80.0, 40.0][n % 2])).collect()),
        ("alternating 5 mm", (0..100).map(|n| block(5.0, [80.0, 40.0][n % 2])).collect()),
        ("saw-tooth 0.5 mm", (0..400).map(|n| block(0.5, 5.0 + 8.0 * (n % 10) as f64)).collect()),
        ("saw-tooth 5 mm", (0..100).map(|n| block(5.0, 5.0 + 8.0 * (n % 10) as f64)).collect()),
        (
            "zero-length blocks",
            (0..300).map(|n| block([0.3, 0.0, 0.7][n % 3], 30.0 + (n % 7) as f64)).collect(),
        ),
    ];
    for step_mm in [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0] {
        let steps = if step_mm > 1.0 { 20 } else { 500 };
        let up = rising_steps(steps, step_mm, 1.0, 80.0);
        let down: Vec<_> = up.iter().rev().copied().collect();
        all.push(("steps up and down", up.iter().chain(&down).copied().collect()));
        all.push(("steps down and up", down.iter().chain(&up).copied().collect()));
        all.push(("steps up", up));
        all.push(("steps down", down));
    }
    let mut worst = Worst::default();
    for (name, blocks) in &all {
        worst.merge(&both(name, blocks));
    }
    println!("{worst:?}");
    assert!(worst.ticks > 500_000);
    // The ceilings and the limits are used, not only kept. No change of feed here is enough for all the acceleration.
    assert!(worst.feed > 0.9999 && worst.accel > 0.9 && worst.jerk > 0.999, "{worst:?}");
}

/// Every block with a law of its own or all with one, junctions that slow.
#[test]
fn random_lists_keep_every_limit_in_every_tick() {
    let mut random = Random::of_stream(41);
    let mut worst = Worst::default();
    for case in 0..300 {
        let count = 1 + random.below(80);
        let length_mm = random.log(0.02, 5.0);
        let (is_mixed, laws) = (random.once_in(2), laws());
        let same = *random.pick(&laws[..2]);
        let mut walk = 50.0;
        let blocks: Vec<_> = (0..count)
            .map(|_| {
                walk = f64::clamp(walk * random.log(0.7, 1.4), 2.0, 150.0);
                let cap_mm_s = if case % 2 == 0 { walk } else { random.log(2.0, 150.0) };
                Block {
                    length_mm: if random.once_in(20) { 0.0 } else { length_mm * random.log(0.1, 1.0) },
                    cap_mm_s,
                    junction_mm_s: if random.once_in(5) { random.log(1.0, 100.0) } else { f64::INFINITY },
                    law: if is_mixed { *random.pick(&laws[..8]) } else { same },
                }
            })
            .collect();
        if blocks.iter().all(|block| block.length_mm <= 0.0) {
            continue;
        }
        worst.merge(&both(&format!("case {case}"), &blocks));
    }
    println!("{worst:?}");
    assert!(worst.ticks > 500_000);
    assert!(worst.feed > 0.9999 && worst.junction > 0.99 && worst.accel > 0.999, "{worst:?}");
}
