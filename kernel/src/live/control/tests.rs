//! Live control with an executor: commands that come too late, items that come later, blocks that contradict
//! their path.

use core::convert::Infallible;
use core::task::Poll;

use super::*;
use crate::exec::Executor;
use crate::fixture::{self, LIMITS};
use crate::law::{Law, Limits, PlannedRamp, Pulse, Ramp};
use crate::num::Fixed;
use crate::program::{Allowed, Item, PathBlock};
use crate::queue::{LiveStreams, PathRules, Rejection};
use crate::straight::Straight;

const TICK_S: f64 = 0.0005;

fn at(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

const RULES: PathRules = PathRules { feed_mm_s: 20.0, ..fixture::RULES };

/// A hundred millimetres of cruise between two ramps, on a block that is `longer` than the path by that much.
fn line(longer: Position) -> [Item<1>; 6] {
    let up = Ramp::new(&Law::new(Pulse::Plateau, LIMITS).expect("limits"), 0.0, 20.0);
    let (ramp, cruise) = (at(up.length_mm()), at(100.0));
    let whole = ramp + cruise + ramp;
    let allowed = Allowed { cap_mm_s: 20.0, limits: LIMITS };
    let line = Item::Line { line: 1, start: [Position::ZERO], direction: [1.0], length: whole };
    [
        Item::Block(PathBlock::new(whole + longer, 20.0, allowed, allowed, 0.0)),
        line,
        Item::Feed(PlannedRamp { ramp: up, length: ramp }),
        Item::Feed(PlannedRamp { ramp: Ramp::cruise(20.0, 5.0), length: cruise }),
        Item::Feed(PlannedRamp { ramp: up.reversed(), length: ramp }),
        Item::EndOfStretch([whole]),
    ]
}

/// Ticks that come between reading where the tick is and asking for a change make it too late: the command is
/// made again, from where motion is by then.
#[test]
fn a_refused_command_is_made_again() {
    let items = line(Position::ZERO);
    let ramp_s = Ramp::new(&Law::new(Pulse::Plateau, LIMITS).expect("limits"), 0.0, 20.0).duration_s();
    // In the rise, in a cruise, and just before a ramp ends.
    for seen in [50, 2000, (ramp_s / TICK_S) as u32 - 2] {
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(
            items.into_iter().map(Ok),
            Pulse::Plateau,
            TICK_S,
            Leads::NONE,
        );
        for _ in 0..seen {
            control.poll(&mut feeder).expect("items");
            executor.tick(&mut intake).expect("no fault");
        }
        let progress = feeder.progress();
        for _ in 0..5 {
            executor.tick(&mut intake).expect("no fault");
        }
        control.hold();
        control.obey(Request::Stop, &progress, &|| false, &mut feeder).expect("a stop");
        let mut ticks = 0;
        while control.state(&feeder) != State::Held && ticks < 20_000 {
            executor.tick(&mut intake).expect("no fault");
            control.poll(&mut feeder).expect("items");
            ticks += 1;
        }
        // A ramp to the end and another to rest, not 5 s of cruise.
        assert!(ticks < 1200, "seen at tick {seen}: {ticks} ticks to rest");
        assert_eq!(control.starvations(), 0, "seen at tick {seen}");
    }
}

/// Three programs from one source, which has nothing for a while before, between and after them.
#[test]
fn a_source_may_go_on_later() {
    struct Late {
        items: std::vec::IntoIter<Item<1>>,
    }
    impl Source<1> for Late {
        type Error = Infallible;
        fn poll_next(&mut self) -> Poll<Option<Result<Item<1>, Infallible>>> {
            self.items.next().map_or(Poll::Pending, |item| Poll::Ready(Some(Ok(item))))
        }
    }
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
    let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
    let none = std::vec::Vec::new().into_iter();
    let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(
        Late { items: none },
        Pulse::Plateau,
        TICK_S,
        Leads::NONE,
    );
    let mut start = Position::ZERO;
    for _ in 0..3 {
        for _ in 0..100 {
            control.poll(&mut feeder).expect("items");
            let executed = executor.tick(&mut intake).expect("no fault");
            assert_eq!(executed.setpoints[0].position, start);
            assert_eq!(control.state(&feeder), State::Waiting);
        }
        let mut items = line(Position::ZERO).to_vec();
        let Item::EndOfStretch([length]) = items[5] else { panic!("{:?}", items[5]) };
        items[1] = Item::Line { line: 1, start: [start], direction: [1.0], length };
        start = start + length;
        items[5] = Item::EndOfStretch([start]);
        control.source_mut().items = items.into_iter();
        for tick in 0.. {
            control.poll(&mut feeder).expect("items");
            if control.state(&feeder) == State::Waiting {
                break;
            }
            assert_eq!(control.state(&feeder), State::Running);
            executor.tick(&mut intake).expect("no fault");
            assert!(tick < 12_000, "it never ends");
        }
    }
    assert_eq!(control.starvations(), 0);
}

/// Limits beyond fixed point's range: the program's ramps are soft enough, and so is a stop.
#[test]
fn a_stop_asks_for_no_more_than_the_number_type_holds() {
    let hard = Limits { accel_mm_s2: 1e4, jerk_mm_s3: 1e9, snap_mm_s4: 4e9 };
    let soft = Straight::new([Position::ZERO], [at(100.0)], Pulse::Plateau, LIMITS, [20.0; 2], TICK_S)
        .expect("a way");
    let allowed = Allowed { cap_mm_s: 20.0, limits: hard };
    let items = soft.map(|item| match item {
        Ok(Item::Block(block)) => Ok(Item::Block(PathBlock::new(block.length, 20.0, allowed, allowed, 0.0))),
        item => item,
    });
    let rules = PathRules { limits: hard, ..RULES };
    let mut streams = LiveStreams::<Fixed, 1, 8, 16>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
    let mut executor = Executor::<Fixed, 1>::new([Position::ZERO]);
    let mut control =
        LiveControl::<Fixed, 1, _, Infallible, 64>::new(items, Pulse::Plateau, TICK_S, Leads::NONE);
    for tick in 0..2100 {
        if tick == 2000 {
            control.hold();
        }
        control.poll(&mut feeder).expect("a stop");
        executor.tick(&mut intake).expect("no fault");
    }
    assert_eq!(control.state(&feeder), State::Held);
}

/// After an abort, a failure or a hold, with settings and items left: all of it is as new, and so is the motion that follows.
#[test]
fn a_restart_leaves_nothing_behind() {
    for end in [2000, 100_000] {
        let wrong = Item::Line { line: 2, start: [Position::ZERO], direction: [1.0], length: at(1.0) };
        let items = line(Position::ZERO).into_iter().chain([wrong]).chain(line(Position::ZERO));
        let items: Vec<Result<_, Infallible>> = items.map(Ok).collect();
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let new =
            |items| LiveControl::<f64, 1, _, Infallible, 64>::new(items, Pulse::Plateau, TICK_S, Leads::NONE);
        let mut control = new(items.into_iter());
        control.set_override(0.9).expect("in range");
        control.set_single_block(true);
        for tick in 0.. {
            if tick == end {
                control.abort();
            }
            let state = (control.poll(&mut feeder), control.state(&feeder));
            executor.tick(&mut intake).expect("no fault");
            if matches!(state, (_, State::Aborted | State::Failed)) {
                break;
            }
        }
        control.restart();
        assert!(feeder.restart(&mut intake, [Position::ZERO]));
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let fresh = new(control.source_mut().clone());
        assert_eq!(format!("{control:?}"), format!("{fresh:?}"));
        *control.source_mut() = line(Position::ZERO).map(Ok).to_vec().into_iter();
        for _ in 0..100_000 {
            control.poll(&mut feeder).expect("executable");
            executor.tick(&mut intake).expect("no fault");
        }
        assert_eq!(control.state(&feeder), State::Done);
    }
}

/// A block that is a step longer or shorter than its path: what was handed over ends at rest, and the rest is
/// refused.
#[test]
fn blocks_that_contradict_their_path_are_refused() {
    for steps in [-1, 1, 1 << 30] {
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let items = line(Position::from_bits(steps));
        let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(
            items.into_iter().map(Ok),
            Pulse::Plateau,
            TICK_S,
            Leads::NONE,
        );
        let mut refused = 0;
        for _ in 0..20_000 {
            let polled = control.poll(&mut feeder);
            refused += usize::from(matches!(polled, Err(SupplyError::Rejected(Rejection::Blocks { .. }))));
            executor.tick(&mut intake).expect("no fault");
        }
        assert_eq!((refused, control.state(&feeder)), (20_000, State::Failed), "{steps}");
    }
}

/// However soon in a poll a stop is asked for: the plan for an override is given up, motion goes on as before, the stop takes
/// over, and the override is planned after it.
#[test]
fn a_plan_is_given_up_for_a_stop() {
    // The number of times that a whole poll asks.
    let mut whole = 0;
    let mut step = 0;
    while step <= whole {
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(
            line(Position::ZERO).into_iter().map(Ok),
            Pulse::Plateau,
            TICK_S,
            Leads::NONE,
        );
        for _ in 0..400 {
            control.poll(&mut feeder).expect("executable");
            executor.tick(&mut intake).expect("no fault");
        }
        let before = control.timeline.list().clone();
        control.set_override(0.5).expect("in range");
        let asked = core::cell::Cell::new(0);
        let is_asked = || {
            asked.set(asked.get() + 1);
            step > 0 && asked.get() >= step
        };
        control.poll_unless(&is_asked, &mut feeder).expect("executable");
        if step == 0 {
            whole = asked.get();
            assert!(control.timeline.has_next() && whole > 5, "{whole}");
        } else {
            assert!(!control.timeline.has_next(), "step {step} of {whole}");
            assert_eq!(control.mode.request(), Some(Request::Override), "step {step}");
            assert!(asked.get() <= step + 2, "it goes on asking: {} of {step}", asked.get());
            assert!(control.timeline.list().items().eq(before.items()));
            control.hold();
            // A stop is not given up for a stop.
            control.poll_unless(&|| true, &mut feeder).expect("executable");
            assert_eq!(control.timeline.request_of_next(), Some(Request::Stop));
        }
        let mut fastest_mm_s = 0.0_f64;
        for tick in 0..40_000 {
            let motion = executor.tick(&mut intake).expect("no fault").motion;
            control.poll(&mut feeder).expect("executable");
            if control.state(&feeder) == State::Held {
                control.resume();
                fastest_mm_s = 0.0;
            }
            fastest_mm_s = fastest_mm_s.max(motion.v_mm_s);
            assert!(tick < 39_999, "step {step}: {:?}", control.state(&feeder));
            if control.state(&feeder) == State::Done {
                break;
            }
        }
        assert!(step == 0 || fastest_mm_s <= 0.5 * 20.0 * (1.0 + 1e-9), "step {step}: {fastest_mm_s}");
        step += 1;
    }
}

/// With no room for more path, a list from rest that is given up is made again from the program's own feed, wherever
/// the stop is asked for.
#[test]
fn what_is_given_up_at_rest_is_the_programs_own_feed_again() {
    let [block, Item::Line { length: whole, .. }, feed @ .., end] = line(Position::ZERO) else {
        panic!("a block and its line");
    };
    let mut items = vec![block];
    items.extend(feed);
    // More pieces than the queue has places.
    let mut start = Position::ZERO;
    while start < whole {
        let length = at(4.0).min(whole - start);
        items.push(Item::Line { line: 1, start: [start], direction: [1.0], length });
        start = start + length;
    }
    items.push(end);
    let (mut step, mut given_up) = (1, 0);
    loop {
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, _) = streams.split(RULES, [Position::ZERO]);
        let program = items.clone().into_iter().map(Ok);
        let mut control =
            LiveControl::<f64, 1, _, Infallible, 64>::new(program, Pulse::Plateau, TICK_S, Leads::NONE);
        let asked = core::cell::Cell::new(0);
        let is_asked = || {
            asked.set(asked.get() + 1);
            asked.get() >= step
        };
        control.poll_unless(&is_asked, &mut feeder).expect("executable");
        assert!(!control.reader.feed_mut().replans(0), "asked at look {step}");
        if control.timeline.has_next() {
            break;
        }
        given_up += usize::from(control.reader.is_full());
        step += 1;
    }
    assert!(given_up > 0, "never with a full queue: {step}");
}
