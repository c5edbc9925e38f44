//! Ticks between any two operations of one poll of the background, under random commands.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;

use super::{Leads, LiveControl, State};
use crate::exec::{ExecState, Executor};
use crate::law::{Law, Limits, PathMotion, Pulse};
use crate::plan::{Block, BlockPlan, plan, ramps};
use crate::program::{Allowed, Item, PathBlock};
use crate::queue::watch::Access;
use crate::queue::{Intake, LiveStreams, PathRules};
use crate::random::Random;
use crate::units::Position;

const TICK_S: f64 = 0.0005;
const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 4e5 };
/// Longer lines are cut \[mm\].
const PIECE_MM: f64 = 4.0;

/// Adds the items of a straight stretch of blocks from rest to rest; returns each block's end and ceiling.
fn stretch(random: &Random, pulse: Pulse, from: Position, items: &mut Vec<Item<1>>) -> Vec<(Position, f64)> {
    let law = Law::new(pulse, LIMITS).expect("limits");
    let count = 1 + (random.unit() * 8.0) as usize;
    let blocks: Vec<Block<f64>> = (0..count)
        .map(|_| {
            let length_mm = Position::from_mm(random.log(0.02, 20.0)).expect("in range").to_mm();
            Block { length_mm, cap_mm_s: random.log(2.0, 80.0), junction_mm_s: f64::INFINITY, law }
        })
        .collect();
    let mut plans = vec![BlockPlan::default(); count];
    plan(&blocks, 0.0, 0.0, &mut plans).expect("a plan");
    let mut placed: Vec<(Position, Item<1>)> = Vec::new();
    let (mut start, mut caps) = (Position::ZERO, Vec::new());
    for (block, plan) in blocks.iter().zip(&plans) {
        let length = Position::from_mm(block.length_mm).expect("in range");
        let (end, cap_mm_s) = (start + length, block.cap_mm_s);
        let allowed = Allowed { cap_mm_s, limits: LIMITS };
        placed.push((start, Item::Block(PathBlock::new(length, cap_mm_s, allowed, allowed, 1e6))));
        let mut at = start;
        while at < end {
            let part = Position::from_mm(PIECE_MM).expect("in range").min(end - at);
            placed.push((at, Item::Line { line: 1, start: [from + at], direction: [1.0], length: part }));
            at = at + part;
        }
        let mut at = start;
        for ramp in ramps(block, plan, start, end, TICK_S).expect("ramps").into_iter().flatten() {
            placed.push((at, Item::Feed(ramp)));
            at = at + ramp.length;
        }
        start = end;
        caps.push((end, cap_mm_s));
    }
    placed.sort_by_key(|&(at, _)| at);
    items.extend(placed.into_iter().map(|(_, item)| item));
    items.push(Item::EndOfStretch([from + start]));
    caps
}

/// Ticks, and compares each tick with the one before.
struct TestMachine<'a> {
    executor: Executor<f64, 1>,
    intake: Intake<'a, f64, 1>,
    /// Where each stretch begins, and its ceilings.
    stretches: Vec<(Position, Vec<(Position, f64)>)>,
    before: PathMotion<f64>,
    stretch: usize,
    state: ExecState,
    ticks: u64,
}

impl TestMachine<'_> {
    fn tick(&mut self) {
        let executed = self.executor.tick(&mut self.intake).expect("no fault");
        (self.ticks, self.state) = (self.ticks + 1, executed.state);
        let (now, h) = (executed.motion, TICK_S);
        let rounding = 1.0 + 1e-9;
        for (value, limit) in [
            (now.a_mm_s2, LIMITS.accel_mm_s2),
            (now.j_mm_s3, LIMITS.jerk_mm_s3),
            (now.snap_mm_s4, LIMITS.snap_mm_s4),
        ] {
            assert!(value.abs() <= limit * rounding, "tick {}: {now:?}", self.ticks);
        }
        let stretch = executed.stretches as usize;
        let mut then = self.before;
        if stretch != self.stretch {
            // The stretch has ended in this tick, and perhaps the next one has begun: lengths continue.
            assert_eq!(stretch, self.stretch + 1, "one at a time");
            let (_, caps) = &self.stretches[self.stretch];
            then.s = then.s - caps[caps.len() - 1].0;
            self.stretch = stretch;
        }
        // Hermite quadrature, with snap that may step within its limit.
        let snap = LIMITS.snap_mm_s4;
        let d = (now.s - then.s).to_mm() - h * ((now.v_mm_s + then.v_mm_s) / 2.0)
            + h * h * (now.a_mm_s2 - then.a_mm_s2) / 12.0;
        assert!(d.abs() <= 8.1e-3 * snap * h.powi(4) + 2e-8, "tick {}: {d} mm, {then:?} {now:?}", self.ticks);
        let d = now.v_mm_s - then.v_mm_s - h * (now.a_mm_s2 + then.a_mm_s2) / 2.0
            + h * h * (now.j_mm_s3 - then.j_mm_s3) / 12.0;
        assert!(
            d.abs() <= 3.3e-2 * snap * h.powi(3) + 1e-9,
            "tick {}: {d} mm/s, {then:?} {now:?}",
            self.ticks
        );
        let d = now.j_mm_s3 - then.j_mm_s3;
        assert!(d.abs() <= snap * h * rounding, "tick {}: {d} mm/s³, {then:?} {now:?}", self.ticks);
        self.before = now;
        let at = executed.setpoints[0].position;
        let Some((start, caps)) = self.stretches.get(stretch) else {
            let (start, caps) = &self.stretches[stretch - 1];
            assert_eq!(at, *start + caps[caps.len() - 1].0, "the end is exact");
            return;
        };
        assert!((at - (*start + now.s)).to_bits().abs() <= 2, "tick {}: off the path", self.ticks);
        let near = Position::from_bits(64);
        let cap = |at: Position| caps.iter().find(|&&(end, _)| at <= end).map_or(0.0, |&(_, cap)| cap);
        let most_mm_s = cap(now.s + near).max(cap(now.s - near));
        assert!(now.v_mm_s <= most_mm_s * rounding, "tick {}: {now:?} above {most_mm_s}", self.ticks);
    }
}

/// A refused or late word costs time, but never breaks a limit: a list is legal whenever the tick finds it.
#[test]
fn ticks_between_any_two_operations_of_a_poll() {
    let (mut ticks, mut inside, mut starvations, mut commands, mut asked) = (0, 0_u64, 0, 0_u64, 0_u64);
    for seed in 0..150 {
        println!("seed {seed}");
        let random = Random::new(seed);
        let pulse = if seed % 3 == 0 { Pulse::Sin2 } else { Pulse::Plateau };
        let (mut items, mut stretches, mut from) = (Vec::new(), Vec::new(), Position::ZERO);
        for _ in 0..1 + (random.unit() * 3.0) as usize {
            let caps = stretch(&random, pulse, from, &mut items);
            let end = from + caps[caps.len() - 1].0;
            stretches.push((from, caps));
            from = end;
        }
        let rules =
            PathRules { limits: LIMITS, feed_mm_s: 100.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
        let mut streams = LiveStreams::<f64, 1, 64, 16>::new();
        let (mut feeder, intake) = streams.split(rules, [Position::ZERO]);
        let machine = RefCell::new(TestMachine {
            executor: Executor::new([Position::ZERO]),
            intake,
            stretches,
            before: PathMotion::default(),
            stretch: 0,
            state: ExecState::Idle,
            ticks: 0,
        });
        let (often, interrupts) = (random.log(1e-3, 0.5), random.log(1e-3, 0.7));
        let count = Cell::new(0_u64);
        let between = |access| {
            if access == Access::Begins && random.chance(interrupts) {
                count.set(count.get() + 1);
                machine.borrow_mut().tick();
            }
        };
        feeder.watch(&between);
        let leads =
            Leads { stop_ticks: (random.unit() * 3.0) as u32, plan_ticks: (random.unit() * 6.0) as u32 };
        // Asked for between the steps of plans, and then given or not.
        let (asks, is_asked) = (random.log(1e-6, 1e-2), Cell::new(false));
        let items = items.into_iter().map(Ok);
        let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(items, pulse, TICK_S, leads);
        loop {
            let ticks = machine.borrow().ticks;
            assert!(ticks < 400_000, "seed {seed}: no end, {:?}", control.state(&feeder));
            // In the end every command is withdrawn.
            let was_asked = is_asked.replace(false);
            if ticks > 60_000 {
                control.resume();
                control.set_override(1.0).expect("in range");
            } else if was_asked && random.chance(0.5) {
                asked += 1;
                control.hold();
            } else if random.chance(often) {
                commands += 1;
                match (random.unit() * 4.0) as usize {
                    0 => control.hold(),
                    1 => control.resume(),
                    2 => control.set_override(1.0).expect("in range"),
                    _ => control.set_override(random.log(0.05, 2.0)).expect("in range"),
                }
            }
            let is_stop_asked = || {
                is_asked.set(is_asked.get() || ticks <= 60_000 && random.chance(asks));
                is_asked.get()
            };
            control
                .poll_unless(&is_stop_asked, &mut feeder)
                .unwrap_or_else(|error| panic!("seed {seed}: {error:?}"));
            machine.borrow_mut().tick();
            if control.state(&feeder) == State::Done {
                break;
            }
        }
        let machine = machine.borrow();
        assert_eq!(machine.stretch, machine.stretches.len(), "seed {seed}");
        assert_eq!(machine.state, ExecState::Idle, "seed {seed}");
        ticks += machine.ticks;
        inside += count.get();
        starvations += control.starvations();
    }
    println!(
        "{ticks} ticks, {inside} of them in a poll; {commands} commands, {asked} holds asked for in a plan, {starvations} \
         stops for want of data"
    );
    assert!(inside > 10_000 && commands > 5_000 && asked > 500, "{inside} {commands} {asked}");
}
