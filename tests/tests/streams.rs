//! The two streams: what they refuse, that refusing leaves no trace, and that delivery changes nothing.

use motion_tests::check::bench::{LIMITS, RULES, TICK_S, cruise, line, mm, point, ramp, rest_to_rest};
use motion_tests::check::planned;
use motion_tests::random::Random;
use std::convert::Infallible;

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Problem};
use motion_kernel::exec::{ExecFault, ExecState, Executed, Executor, PIECES_PER_TICK_MAX};
use motion_kernel::internals::{Ready, peak};
use motion_kernel::law::{FeedSegment, Limits, Pulse, Ticks};
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::program::{self, CheckError, Header, Item, Supply, SupplyError};
use motion_kernel::queue::{Feeder, PathRules, Refused, Rejection, SEGMENTS_PER_TICK_MAX, Streams};
use motion_kernel::units::Position;

type Feeder2<'a> = Feeder<'a, f32, 2>;

fn invalid<T: std::fmt::Debug>(answer: Result<(), Refused<T>>) -> Rejection {
    match answer {
        Err(Refused::Invalid(rejection)) => rejection,
        other => panic!("{other:?}"),
    }
}

/// Makes the streams refuse something, and says that it was the right refusal.
type Case = (&'static str, fn(&mut Feeder2<'_>) -> bool);

const ALONG: [f64; 2] = [1.0, 0.0];

fn exceeds(feeder: &mut Feeder2<'_>, limits: Limits<f64>, to_mm_s: f64, name: &str) -> bool {
    matches!(invalid(feeder.segment(ramp(limits, 0.0, to_mm_s))),
        Rejection::Limit { quantity, value, limit } if quantity.starts_with(name) && value > limit)
}

const CASES: [Case; 9] = [
    ("gap", |f| matches!(invalid(f.piece(line([0.0, 1e-5], ALONG, 1.0))), Rejection::Gap { axis: 1, .. })),
    ("feed step", |f| {
        matches!(invalid(f.segment(ramp(LIMITS, 1.0, 2.0))), Rejection::FeedStep { from_mm_s: 0.0, .. })
    }),
    ("feed", |f| exceeds(f, LIMITS, 300.1, "feed")),
    ("acceleration", |f| exceeds(f, Limits { accel_mm_s2: 501.0, ..LIMITS }, 200.0, "acceleration")),
    ("jerk", |f| exceeds(f, Limits { jerk_mm_s3: 5010.0, ..LIMITS }, 60.0, "jerk")),
    ("snap", |f| exceeds(f, Limits { snap_mm_s4: 4.01e5, ..LIMITS }, 0.1, "snap")),
    ("empty", |f| invalid(f.end_stretch(point([0.0, 0.0]))) == Rejection::Empty),
    ("end elsewhere", |f| {
        matches!(invalid(f.end_stretch(point([0.0, -1.0]))), Rejection::Gap { axis: 1, .. })
    }),
    ("out of range", |f| {
        // Far out, but where the stream stands: only possible there.
        let mut far = Streams::<f32, 2, 4, 4>::new();
        let (mut feeder, _) = far.split(RULES, point([999_999.5, 0.0]));
        let _ = f;
        matches!(invalid(feeder.piece(line([999_999.5, 0.0], ALONG, 1.0))), Rejection::Range { .. })
    }),
];

/// After every refusal the same good stretch enters and is executed to its exact end.
#[test]
fn every_rejection_is_typed_and_leaves_no_trace() {
    for (name, provoke) in CASES {
        let mut streams = Streams::<f32, 2, 8, 8>::new();
        let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
        assert!(provoke(&mut feeder), "{name}");
        feeder.piece(line([0.0, 0.0], ALONG, 2.0)).expect(name);
        // Again, in the middle of a stretch.
        let corner = invalid(feeder.piece(line([2.0, 0.0], [0.0, 1.0], 1.0)));
        assert!(matches!(corner, Rejection::Corner { angle_rad } if angle_rad > 1.4), "{corner:?}");
        assert_eq!(invalid(feeder.dwell(Ticks::ONE)), Rejection::InsideStretch);
        assert_eq!(invalid(feeder.program_stop()), Rejection::InsideStretch);
        let all = rest_to_rest(mm(2.0), 10.0);
        feeder.segment(all[0]).expect(name);
        assert!(
            matches!(invalid(feeder.end_stretch(point([2.0, 0.0]))), Rejection::Moving { feed_mm_s } if feed_mm_s == 10.0)
        );
        for &segment in &all[1..] {
            feeder.segment(segment).expect(name);
        }
        feeder.end_stretch(point([2.0, 0.0])).expect(name);
        let last = *run(&mut intake).last().expect("ticks");
        assert_eq!(last.setpoints.map(|axis| axis.position), point([2.0, 0.0]), "{name}");
    }
}

#[test]
fn streams_of_different_lengths_are_refused() {
    let mut streams = Streams::<f32, 2, 8, 8>::new();
    let (mut feeder, _) = streams.split(RULES, point([0.0, 0.0]));
    let step = Position::from_bits(1);
    feeder.piece(line([0.0, 0.0], ALONG, 2.0)).expect("a piece");
    for segment in rest_to_rest(mm(2.0) - step, 10.0) {
        feeder.segment(segment).expect("a segment");
    }
    // A single step of 2⁻³² mm is a difference.
    let refused = invalid(feeder.end_stretch(point([2.0, 0.0])));
    assert!(matches!(refused, Rejection::Lengths { path_mm, feed_mm } if path_mm > feed_mm), "{refused:?}");
}

#[test]
fn segments_too_dense_for_a_tick_are_refused() {
    let mut streams = Streams::<f32, 2, 4, 32>::new();
    let (mut feeder, _) = streams.split(RULES, point([0.0, 0.0]));
    feeder.segment(ramp(LIMITS, 0.0, 0.01)).expect("a ramp");
    for _ in 1..SEGMENTS_PER_TICK_MAX {
        feeder.segment(cruise(0.01, 1e-8)).expect("with the ramp among them");
    }
    let refused = invalid(feeder.segment(cruise(0.01, 1e-8)));
    assert!(matches!(refused, Rejection::Dense { ticks } if ticks < 1.0), "{refused:?}");
    feeder.segment(cruise(0.01, 1e-5)).expect("what lasts a tick may follow");
}

/// Until it rests with nothing left to do.
fn run(intake: &mut motion_kernel::queue::Intake<'_, f32, 2>) -> Vec<Executed<f32, 2>> {
    let mut executor = Executor::new(point([0.0, 0.0]));
    let mut ticks = Vec::new();
    loop {
        ticks.push(executor.tick(intake).expect("no fault"));
        assert!(ticks.len() < 1_000_000, "no end");
        if ticks[ticks.len() - 1].state == ExecState::Idle {
            return ticks;
        }
    }
}

#[test]
fn a_full_queue_returns_the_item_and_keeps_no_trace() {
    let mut streams = Streams::<f32, 2, 4, 4>::new();
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    for part in 0..3 {
        feeder.piece(line([f64::from(part), 0.0], ALONG, 1.0)).expect("room for three");
    }
    let fourth = line([3.0, 0.0], ALONG, 1.0);
    for _ in 0..3 {
        assert_eq!(feeder.piece(fourth), Err(Refused::Full(fourth)));
    }
    let all = rest_to_rest::<f32>(mm(4.0), 10.0);
    for &segment in &all {
        feeder.segment(segment).expect("room for three");
    }
    // The lengths are not equal yet: had the refused piece left a trace, they would be.
    assert!(matches!(invalid(feeder.end_stretch(point([3.0, 0.0]))), Rejection::Lengths { .. }));
    let mut executor = Executor::new(point([0.0, 0.0]));
    let mut taken = false;
    for _ in 0..100_000 {
        if !taken {
            taken = feeder.piece(fourth).is_ok();
        } else {
            let _ = feeder.end_stretch(point([4.0, 0.0]));
        }
        let executed = executor.tick(&mut intake).expect("no fault");
        if executed.stretches == 1 {
            assert_eq!(executed.setpoints.map(|axis| axis.position), point([4.0, 0.0]));
            return;
        }
    }
    panic!("the stretch did not end");
}

#[test]
fn what_is_not_a_finite_positive_number_makes_no_item() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0] {
        assert!(FeedSegment::<f32>::cruise(bad, mm(1.0), TICK_S).is_err(), "{bad}");
        assert!(FeedSegment::<f32>::cruise(1.0, mm(1.0), bad).is_err(), "{bad}");
        assert!(Ticks::from_seconds(bad, TICK_S).is_none(), "{bad}");
        assert!(Piece::<f32, 2>::line(1, point([0.0; 2]), [bad, 0.5], mm(1.0)).is_err(), "{bad}");
        let mut coefficients = [[0.0; 7]; 2];
        coefficients[0][0] = 1.0;
        assert!(Piece::<f32, 2>::septic(1, point([0.0; 2]), coefficients, mm(1.0)).is_ok());
        coefficients[1][6] = bad;
        assert!(Piece::<f32, 2>::septic(1, point([0.0; 2]), coefficients, mm(1.0)).is_err(), "{bad}");
    }
    assert!(FeedSegment::<f32>::cruise(0.0, mm(1.0), TICK_S).is_err());
    assert!(FeedSegment::<f32>::cruise(1.0, -mm(1.0), TICK_S).is_err());
    let none = Piece::<f32, 2>::line(1, point([0.0; 2]), ALONG, Position::ZERO);
    assert!(matches!(none, Err(PieceError::Length { .. })));
}

/// G-code on the reference machine.
fn executable(text: &str) -> Executable {
    let plan = planned(text, &Machine::reference()).expect("a plan");
    Executable::new::<f32>(&plan).expect("executable")
}

/// Set-points of all ticks, filling the streams of a capacity whenever `is_due` says so.
fn execute<const CAPACITY: usize>(
    executable: &Executable,
    mut is_due: impl FnMut(usize) -> bool,
) -> Vec<[i64; 3]> {
    let start = [Position::ZERO; 3];
    let mut streams = Box::new(Streams::<f32, 3, CAPACITY, CAPACITY>::new());
    let (mut feeder, mut intake) = streams.split(Machine::reference().rules(), start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut executor = Executor::<f32, 3>::new(start);
    let mut positions = Vec::new();
    loop {
        if is_due(positions.len()) {
            supply.fill(&mut feeder).expect("accepted");
        }
        let executed = executor.tick(&mut intake).expect("no fault");
        positions.push(executed.setpoints.map(|axis| axis.position.to_bits()));
        if executed.state == ExecState::Idle && supply.is_empty() {
            return positions;
        }
        assert!(positions.len() < 1_000_000, "no end");
    }
}

/// Short stretches, a dwell, arcs: every stretch fits the streams.
const SHORT: &str = "G61 G1 X5 F3000\nY5\nG2 X0 Y0 I-5 J0\nG4 P0.0123\nG1 X1\nY1\nX0\nY0\nG3 X0 Y0 I2 J1\nG1 Z3\nX30 Y20\nM2\n";

#[test]
fn a_capacity_of_two_is_enough() {
    let program = executable(SHORT);
    let all_at_once = execute::<512>(&program, |tick| tick == 0);
    assert_eq!(execute::<3>(&program, |_| true).last(), all_at_once.last());
}

#[test]
fn irregular_delivery_in_time_changes_no_bit() {
    let program = executable(SHORT);
    let all_at_once = execute::<512>(&program, |tick| tick == 0);
    for seed in 0..50 {
        let mut random = Random::new(seed);
        let mut due = 0;
        let positions = execute::<64>(&program, |tick| {
            let is_due = tick >= due;
            if is_due {
                due = tick + 1 + random.below(10);
            }
            is_due
        });
        assert!(positions == all_at_once, "seed {seed}");
    }
}

/// A stretch longer than the queues, alone: it starts when they are full.
#[test]
fn irregular_delivery_of_a_long_stretch_changes_no_bit() {
    let program = executable("G61 G1 X3000 F18000\nM2\n");
    let all_at_once = execute::<512>(&program, |tick| tick == 0);
    for seed in 0..10 {
        let mut random = Random::new(seed);
        let positions = execute::<64>(&program, |tick| tick == 0 || random.chance(0.2));
        assert!(positions == all_at_once, "seed {seed}");
    }
}

/// A stretch longer than the queues that follows another begins in the tick in which that one ends.
#[test]
fn a_long_stretch_after_another_loses_no_time() {
    let program = executable("G61 G1 Y1.2345 F6000\nX3000 F18000\nM2\n");
    let all_at_once = execute::<512>(&program, |tick| tick == 0);
    assert_eq!(execute::<64>(&program, |_| true).len(), all_at_once.len());
    assert!(execute::<64>(&program, |_| true) == all_at_once);
}

/// The tick may come between any two items, in whatever order a producer fills the streams: a stretch does
/// not start before neither of them can starve it at once.
#[test]
fn a_tick_after_every_item_starves_nothing() {
    let program = executable("G61 G1 X3000 F18000\nM2\n");
    let (mut pieces, mut segments) = (Vec::new(), Vec::new());
    for item in &program.items {
        match item.ready::<f32, Infallible>(program.tick_s).expect("f32 holds it") {
            Ready::Piece(piece) => pieces.push(piece),
            Ready::Segment(segment) => segments.push(segment),
            _ => {}
        }
    }
    for pieces_first in [true, false] {
        // One segment under way, which ends inside a tick, and one that waits.
        let mut streams = Box::new(Streams::<f32, 3, 64, 3>::new());
        let start = [Position::ZERO; 3];
        let (mut feeder, mut intake) = streams.split(Machine::reference().rules(), start);
        let mut executor = Executor::<f32, 3>::new(start);
        let (mut piece, mut segment) = (0, 0);
        for _ in 0..4000 {
            // One item a tick, the other stream's only when the first one is full or done.
            let mut offer_piece = || {
                let taken = pieces.get(piece).is_some_and(|&p| feeder.piece(p).is_ok());
                piece += usize::from(taken);
                taken
            };
            let first = pieces_first && offer_piece();
            if !first {
                let taken = segments.get(segment).is_some_and(|&s| feeder.segment(s).is_ok());
                segment += usize::from(taken);
                if !taken && !pieces_first {
                    let taken = pieces.get(piece).is_some_and(|&p| feeder.piece(p).is_ok());
                    piece += usize::from(taken);
                }
            }
            executor.tick(&mut intake).expect("nothing starves");
        }
        assert!(piece > 64, "it moves");
    }
}

/// A full queue alone is no reason to start: the other one would run dry at once.
#[test]
fn a_stretch_waits_for_the_stream_that_is_behind() {
    let rest = |intake: &mut motion_kernel::queue::Intake<'_, f32, 2>| {
        let mut executor = Executor::new(point([0.0, 0.0]));
        for _ in 0..1000 {
            assert_eq!(executor.tick(intake).expect("nothing starves").state, ExecState::Idle);
        }
    };
    // The feed stream is full, and there is no path.
    let mut streams = Box::new(Streams::<f32, 2, 64, 3>::new());
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    for segment in rest_to_rest(mm(10.0), 50.0) {
        feeder.segment(segment).unwrap_or_default();
    }
    rest(&mut intake);
    // The path stream is full, and the feed covers the beginning of it.
    let mut streams = Box::new(Streams::<f32, 2, 4, 64>::new());
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    for part in 0..3 {
        feeder.piece(line([f64::from(part) * 10.0, 0.0], ALONG, 10.0)).expect("a piece");
    }
    feeder.segment(ramp(LIMITS, 0.0, 0.1)).expect("a ramp");
    rest(&mut intake);
}

/// Pieces are counted over the whole program: stretches of a quarter of a tick, six short pieces each.
#[test]
fn pieces_of_several_stretches_in_one_tick_are_counted_together() {
    let mut machine = Machine::reference();
    machine.tick_s = 0.02;
    let path = &mut machine.path;
    (path.feed_mm_s, path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4) = (900.0, 1e9, 1e12, 1e12);
    for axis in &mut machine.axes {
        (axis.feed_mm_s, axis.accel_mm_s2, axis.jerk_mm_s3, axis.snap_mm_s4) = (900.0, 1e9, 1e12, 1e12);
    }
    let plan = |moves: usize| {
        let side = |word: &str| format!("{word}{}\n", 0.9 / moves as f64).repeat(moves);
        let text = format!("G91 G61 G1 F54000\n{}M2\n", (side("X") + &side("Y")).repeat(20));
        planned(&text, &machine).map(|_| ()).map_err(|e| e.problem)
    };
    assert_eq!(plan(2), Ok(()));
    let found = plan(6);
    assert!(matches!(found, Err(Problem::DensePieces { pieces: PIECES_PER_TICK_MAX, .. })), "{found:?}");
}

/// What was queued before a split is gone, and a stretch that starts elsewhere than the machine stands is
/// a fault, not a jump.
#[test]
fn split_streams_are_empty_and_a_stretch_starts_where_the_machine_stands() {
    let offer = |feeder: &mut Feeder2<'_>, from_mm: f64| {
        feeder.piece(line([from_mm, 0.0], ALONG, 10.0)).expect("a piece");
        for segment in rest_to_rest(mm(10.0), 50.0) {
            feeder.segment(segment).expect("a segment");
        }
        feeder.end_stretch(point([from_mm + 10.0, 0.0])).expect("its end");
    };
    let mut streams = Streams::<f32, 2, 8, 8>::new();
    let (mut feeder, _) = streams.split(RULES, point([0.0, 0.0]));
    offer(&mut feeder, 0.0);
    let (mut feeder, mut intake) = streams.split(RULES, point([100.0, 0.0]));
    offer(&mut feeder, 100.0);
    let mut executor = Executor::new(point([100.0, 0.0]));
    let first = executor.tick(&mut intake).expect("a tick").setpoints[0].position.to_mm();
    assert!((first - 100.0).abs() < 1e-3, "{first}");
    let mut elsewhere = Executor::new(point([99.0, 0.0]));
    let (mut feeder, mut intake) = streams.split(RULES, point([100.0, 0.0]));
    offer(&mut feeder, 100.0);
    assert_eq!(elsewhere.tick(&mut intake).map(|_| ()), Err(ExecFault::NotHere));
}

/// Many stretches in one tick: rest to rest within a quarter of it, as dense as the feeder takes them.
#[test]
fn stretches_shorter_than_a_tick_stay_within_the_step_bound() {
    let limits = Limits { accel_mm_s2: 1e9, jerk_mm_s3: 1e12, snap_mm_s4: 1e15 };
    let rules = PathRules { limits, feed_mm_s: 1e5, ..RULES };
    let mut most_in_a_tick = 0;
    for part in 0..40 {
        let length_mm = 2e-4 * 1.05_f64.powi(part);
        let mut streams = Box::new(Streams::<f32, 2, 256, 512>::new());
        let (mut feeder, mut intake) = streams.split(rules, point([0.0, 0.0]));
        let law = motion_kernel::law::Law::new(Pulse::Plateau, limits).expect("limits");
        let top = peak(&law, 0.0, 0.0, length_mm);
        let length = mm(length_mm);
        let mut at = point([0.0, 0.0]);
        let mut stretches = 0;
        while stretches < 100 {
            let ramps = [(0.0, top), (top, 0.0)].map(|(a, b)| motion_kernel::law::Ramp::new(&law, a, b));
            let half = mm(ramps[0].length_mm());
            let piece = Piece::line(1, at, [1.0, 0.0], length).expect("a piece");
            feeder.piece(piece).expect("a piece");
            let mut entered = true;
            for (ramp, length) in ramps.iter().zip([half, length - half]) {
                let segment = FeedSegment::ramp(ramp, length, TICK_S).expect("a ramp");
                entered &= feeder.segment(segment).is_ok();
            }
            if !entered {
                break; // Denser than a tick can bear, and refused.
            }
            at[0] = at[0] + length;
            feeder.end_stretch(at).expect("its end");
            stretches += 1;
        }
        let mut executor = Executor::new(point([0.0, 0.0]));
        let mut before = 0;
        loop {
            let executed = executor.tick(&mut intake).expect("within the bound");
            most_in_a_tick = most_in_a_tick.max(executed.stretches - before);
            before = executed.stretches;
            if executed.state == ExecState::Idle {
                break;
            }
        }
    }
    // Eight segments, two a stretch.
    assert!(most_in_a_tick >= 4, "{most_in_a_tick}");
}

/// A line in pieces of `piece_mm`, passed at `pieces_per_tick`.
fn dense(pieces_per_tick: f64) -> Result<(), ExecFault> {
    let (piece_mm, v) = (0.001, 0.001 * pieces_per_tick / TICK_S);
    let rise = ramp::<f32>(LIMITS, 0.0, v);
    let mut streams = Box::new(Streams::<f32, 2, 1024, 8>::new());
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    let lead_mm = rise.length().to_mm();
    let mut at_mm = 0.0;
    while lead_mm - at_mm > 15.0 {
        feeder.piece(line([at_mm, 0.0], ALONG, 15.0)).expect("the way to the feed");
        at_mm += 15.0;
    }
    feeder.piece(line([at_mm, 0.0], ALONG, (rise.length() - mm(at_mm)).to_mm())).expect("the rest of it");
    feeder.segment(rise).expect("a ramp");
    feeder.segment(cruise(v, 2.0)).expect("a cruise");
    // Fills the path stream, so that the executor starts: the feed covers more.
    let mut part = 0;
    while feeder.piece(line([lead_mm + f64::from(part) * piece_mm, 0.0], ALONG, piece_mm)).is_ok() {
        part += 1;
    }
    assert!(part > 900);
    let mut executor = Executor::new(point([0.0, 0.0]));
    loop {
        match executor.tick(&mut intake) {
            Ok(executed) if executed.motion.s > rise.length() + mm(0.85) => return Ok(()),
            Ok(_) => {}
            Err(fault) => return Err(fault),
        }
    }
}

#[test]
fn as_many_pieces_as_the_bound_end_in_a_tick_and_no_more() {
    let bound = PIECES_PER_TICK_MAX as f64;
    assert_eq!(dense(bound - 0.01), Ok(()));
    assert_eq!(dense(bound + 1.5), Err(ExecFault::TooManyPieces));
}

/// Lines of 1 µm at a feed that passes `pieces_per_tick` of them.
fn short_lines(pieces_per_tick: f64) -> String {
    let feed_mm_min = 0.001 * pieces_per_tick / TICK_S * 60.0;
    // A zigzag within the junction angle: merging keeps every line a piece.
    (1..20_000).fold("G61 G91\n".to_owned(), |text, part| {
        text + &format!("G1 X0.001 Y{:.10} F{feed_mm_min:.3}\n", f64::from(part % 2) * 1e-9)
    })
}

#[test]
fn a_program_too_dense_for_a_tick_is_refused_with_its_line_and_the_feed_that_would_do() {
    let machine = Machine::reference();
    let Err(refused) = planned(&short_lines(20.0), &machine) else { panic!("20 pieces a tick") };
    // Where the feed is reached, not where the program begins.
    let text = refused.to_string();
    let line = text.strip_prefix("test.ngc:").and_then(|rest| rest.split(':').next()?.parse().ok());
    assert!(line.is_some_and(|line: u32| line > 100), "{text}");
    let Problem::DensePieces { pieces, feed_mm_s, feed_max_mm_s, .. } = refused.problem else {
        panic!("{refused}");
    };
    assert_eq!(pieces, PIECES_PER_TICK_MAX);
    assert!(feed_max_mm_s < feed_mm_s && text.contains("expected at most 16 pieces a tick"));
    let would_do = planned(&short_lines(0.999 * feed_max_mm_s * TICK_S / 0.001), &machine).map(|_| ());
    assert_eq!(would_do, Ok(()), "the feed that it names");
    let executed = execute::<64>(&executable(&short_lines(15.9)), |_| true);
    assert!(executed.len() > 100);
}

/// Under live control lines that are too dense for their machine's feed are driven slower, and only those: not the long
/// line after them.
#[test]
fn only_what_is_dense_is_driven_slower_for_it() {
    let fast = |item: &Item<3>| match item {
        Item::Block(block) => Some((block.length.to_mm(), block.greatest().cap_mm_s)),
        _ => None,
    };
    let text: String = short_lines(10.0).lines().take(100).map(|line| format!("{line}\n")).collect();
    let items = executable(&format!("{text}X100 F3000\nM2\n")).items;
    let blocks: Vec<(f64, f64)> = items.iter().filter_map(fast).collect();
    let alone = executable("G61 G91\nG1 X100 F3000\nM2\n").items;
    let &[(_, most_mm_s)] = &alone.iter().filter_map(fast).collect::<Vec<_>>()[..] else {
        panic!("one block")
    };
    let dense_mm_s = PIECES_PER_TICK_MAX as f64 * 0.001 / TICK_S;
    assert!(dense_mm_s < 0.5 * most_mm_s);
    let (last, dense) = blocks.split_last().expect("blocks");
    assert_eq!((last.0, last.1), (100.0, most_mm_s));
    let (_, lines) = dense.split_last().expect("lines");
    assert!(lines.iter().all(|&(_, cap_mm_s)| (cap_mm_s / dense_mm_s - 1.0).abs() < 1e-6), "{blocks:?}");
}

/// The same refusals as while it runs, before it does.
#[test]
fn a_check_finds_whatever_the_streams_would_refuse() {
    let good = executable(SHORT);
    let header = Machine::reference().header();
    let found = |header: &Header<3>, items: &[Item<3>]| {
        program::check::<f32, 3, Infallible>(header, items.iter().map(|&item| Ok(item)))
    };
    let with = |index: usize, change: &dyn Fn(&mut Item<3>)| {
        let mut items = good.items.clone();
        change(&mut items[index]);
        found(&header, &items)
    };
    assert_eq!(found(&header, &good.items), Ok(()));
    let mut lines = good.items.iter().enumerate().filter(|(_, item)| matches!(item, Item::Line { .. }));
    let index = lines.nth(3).expect("lines").0;
    let refused = with(index, &|item| {
        if let Item::Line { direction, .. } = item {
            direction[1] = f64::NAN;
        }
    });
    let not_finite = SupplyError::Piece(PieceError::NotFinite { axis: 1 });
    assert_eq!(refused, Err(CheckError::Item { index: index as u32, cause: not_finite }));
    let refused = with(index, &|item| {
        if let Item::Line { start, .. } = item {
            start[2] = start[2] + mm(0.001);
        }
    });
    let Err(CheckError::Item { index: at, cause: SupplyError::Rejected(Rejection::Gap { axis: 2, .. }) }) =
        refused
    else {
        panic!("{refused:?}")
    };
    assert_eq!(at as usize, index);
    let unfinished = &good.items[..good.items.len() - 1];
    assert_eq!(found(&header, unfinished), Err(CheckError::Unfinished));
    let far = Header { start: [Position::ZERO, Position::from_bits(i64::MIN), Position::ZERO], ..header };
    assert!(matches!(found(&far, &good.items), Err(CheckError::Start { axis: 1, .. })));
}

/// For live control blocks have to hold the whole path and nothing else: without any of them, without the last one, with
/// one that is longer, with one after the end, with one that comes after what it holds, and with a stop after the first.
#[test]
fn a_check_for_live_control_finds_path_that_is_not_held() {
    let good = executable(SHORT).items;
    let header = Machine::reference().header();
    let found = |items: &[Item<3>]| {
        program::check_live::<f32, 3, Infallible>(&header, items.iter().map(|&item| Ok(item)))
    };
    assert_eq!(found(&good), Ok(()));
    let is_block = |item: &Item<3>| matches!(item, Item::Block(_));
    let last = good.iter().rposition(is_block).expect("blocks");
    let end = good.iter().rposition(|item| matches!(item, Item::EndOfStretch(_))).expect("an end");
    let is_piece = |item: &Item<3>| matches!(item, Item::Line { .. } | Item::Septic { .. });
    let piece = last + good[last..].iter().position(is_piece).expect("pieces");
    let mut longer = good.clone();
    if let Item::Block(block) = &mut longer[last] {
        block.length = block.length + Position::from_bits(1);
    }
    let mut late = good.clone();
    late[last..=piece].rotate_left(1);
    let without: Vec<_> = good.iter().filter(|item| !is_block(item)).copied().collect();
    let first_piece = without.iter().position(is_piece).expect("pieces");
    let but_last = [&good[..last], &good[last + 1..]].concat();
    let behind = [&good[..], &[good[last]]].concat();
    let first = good.iter().position(is_block).expect("blocks");
    let stopped = [&good[..=first], &[Item::Stop], &good[first + 1..]].concat();
    let cases = [
        (without, first_piece),
        (but_last, piece - 1),
        (longer, end),
        (late, piece - 1),
        (behind, good.len() + 1),
        (stopped, first + 1),
    ];
    for (case, (items, index)) in cases.into_iter().enumerate() {
        assert_eq!(found(&items), Err(CheckError::NotHeld { index: index as u32 }), "{case}");
        // Without live control blocks mean nothing.
        let plain = items.iter().map(|&item| Ok(item));
        assert_eq!(program::check::<f32, 3, Infallible>(&header, plain), Ok(()), "{case}");
    }
}

/// What follows an item that was refused would not continue what is queued.
#[test]
fn a_supply_stays_where_it_failed() {
    let header = Machine::reference().header();
    let mut items = executable(SHORT).items;
    let first = items.iter_mut().find_map(|item| match item {
        Item::Line { direction, .. } => Some(direction),
        _ => None,
    });
    first.expect("a line")[0] = f64::INFINITY;
    let mut streams = Box::new(Streams::<f32, 3, 64, 64>::new());
    let (mut feeder, mut intake) = streams.split(header.rules, header.start);
    let mut supply = Supply::new(items.into_iter().map(Ok::<_, Infallible>), header.tick_s);
    let mut executor = Executor::<f32, 3>::new(header.start);
    for _ in 0..100 {
        let refused = supply.fill(&mut feeder);
        assert_eq!(refused, Err(SupplyError::Piece(PieceError::NotFinite { axis: 0 })));
        assert!(!supply.is_empty());
        assert_eq!(executor.tick(&mut intake).expect("nothing entered").state, ExecState::Idle);
    }
}

/// 10 000 lines of 1 nm: refused with a helpful message, or executed within the bounds.
#[test]
fn ten_thousand_lines_of_a_nanometre() {
    for feed_mm_min in [0.1, 1.0, 10.0, 1000.0] {
        let line = format!("G1 X0.000001 F{feed_mm_min}\n");
        let text = "G61 G91\n".to_owned() + &line.repeat(10_000);
        match planned(&text, &Machine::reference()) {
            Ok(plan) => {
                let positions = execute::<64>(&Executable::new::<f32>(&plan).expect("executable"), |_| true);
                let end = positions[positions.len() - 1][0];
                assert!((end - mm(0.01).to_bits()).abs() <= 1, "{feed_mm_min} mm/min ends at {end}");
            }
            Err(refused) => {
                println!("{feed_mm_min} mm/min: {refused}");
                assert!(matches!(refused.problem, Problem::DensePieces { .. }), "{refused}");
            }
        }
    }
}
