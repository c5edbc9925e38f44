//! What the feeder of feed lists refuses, and what the tick refuses of it.

use motion_host::machine::Machine;
use motion_kernel::axis::{Correction, CorrectionError};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::internals::{Change, CutRamp, Density};
use motion_kernel::kernel::CorrectedIntake;
use motion_kernel::law::{FeedSegment, Law, Pulse, Ramp, Ticks};
use motion_kernel::path::Piece;
use motion_kernel::queue::{LiveStreams, Refused, Rejection, SEGMENTS_PER_TICK_MAX};

use motion_tests::check::bench::mm;

/// What one list ends with and the next begins with counts together, and so do the rests of a list.
#[test]
fn lists_are_not_denser_together_than_a_tick_allows() {
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (mut feeder, _intake) = streams.split(Machine::reference().rules(), [mm(0.0)]);
    // A tenth of a tick each, and their density.
    let tenth = Ticks::from_seconds(0.1, 1.0).expect("in range");
    let mut density = Density::NONE;
    for _ in 0..5 {
        density.follow(tenth).expect("five");
    }
    let fits = |list: Option<u8>, feeder: &mut motion_kernel::queue::LiveFeeder<'_, f64, 1>| {
        let list = list.expect("a list");
        let dwells = std::iter::repeat_with(|| feeder.dwell(list, tenth)).take(10).collect::<Vec<_>>();
        let taken = dwells.iter().take_while(|answer| answer.is_ok()).count();
        assert!(
            matches!(dwells[taken], Err(Refused::Invalid(Rejection::Dense { ticks })) if ticks < 1.0),
            "{dwells:?}"
        );
        feeder.give_up(list);
        taken
    };
    let list = feeder.begin(mm(0.0), 0.0, Density::NONE);
    assert_eq!(fits(list, &mut feeder), SEGMENTS_PER_TICK_MAX - 1);
    // The first list is not empty any more.
    let list = feeder.begin(mm(0.0), 0.0, density);
    assert_eq!(fits(list, &mut feeder), SEGMENTS_PER_TICK_MAX - 1 - 5);
}

/// A change is asked for to the list that was filled, from another one, and only where that ends at rest.
#[test]
fn a_change_to_anything_else_is_refused() {
    let machine = Machine::reference();
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), [mm(0.0)]);
    let change = |from: u8, to: u8, after: u32| Change { from, to, after, within: false };
    let refused = |from: u8, to: u8, after: u32| Err(Rejection::NoChange { from, to, after });
    assert_eq!(feeder.change(change(0, 1, 0)), refused(0, 1, 0));
    let list = feeder.begin(mm(0.0), 0.0, Density::NONE).expect("a list");
    assert_eq!(list, 1);
    for (from, to, after) in [(0, 2, 0), (0, 0, 0), (1, 1, 0), (3, 1, 0), (0, 1, Change::AFTER_MAX + 1)] {
        assert_eq!(feeder.change(change(from, to, after)), refused(from, to, after));
    }
    let up = Ramp::new(&Law::new(machine.path.pulse, machine.rules().limits).expect("limits"), 0.0, 20.0);
    let length = mm(up.length_mm());
    let segment = FeedSegment::ramp(&up, length, machine.tick_s).expect("a segment");
    feeder.segment(list, segment).expect("room");
    assert_eq!(feeder.change(change(0, 1, 0)), Err(Rejection::Moving { feed_mm_s: 20.0 }));
    // Nothing was asked for.
    let mut executor = Executor::<f64, 1>::new([mm(0.0)]);
    for _ in 0..3 {
        assert_eq!(executor.tick(&mut intake).expect("no fault").state, ExecState::Idle);
    }
}

/// What was learnt of a program's own times is not for motion that keeps none.
#[test]
fn a_learnt_correction_is_refused() {
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (_feeder, intake) = streams.split(Machine::reference().rules(), [mm(0.0)]);
    let knots = [[0.1], [0.2]];
    let correction = Correction::new(0, &knots, 40, 1.0).expect("a correction");
    assert_eq!(CorrectedIntake::from(intake).correct(correction), Err(CorrectionError::LiveControl));
}

/// The tick has passed the place where a list would take over: it says so, and ends as it would have.
#[test]
fn a_change_that_comes_too_late_is_refused() {
    let machine = Machine::reference();
    let (tick_s, rules) = (machine.tick_s, machine.rules());
    let law = Law::new(Pulse::Plateau, rules.limits).expect("limits");
    let up = Ramp::new(&law, 0.0, 20.0);
    let length = mm(up.length_mm());
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (mut feeder, mut intake) = streams.split(rules, [mm(0.0)]);
    let mut executor = Executor::<f64, 1>::new([mm(0.0)]);
    feeder.piece(Piece::line(1, [mm(0.0)], [1.0], length + length).expect("a line"), 20.0).expect("room");
    feeder.end_of_path([length + length]).expect("room");
    let list = feeder.begin(mm(0.0), 0.0, Density::NONE).expect("a list");
    for ramp in [up, up.reversed()] {
        feeder.segment(list, FeedSegment::ramp(&ramp, length, tick_s).expect("a segment")).expect("room");
    }
    // A list ends where its path does, and nowhere else.
    for other in [length, length + length + length] {
        let refused = feeder.end_of_feed(list, other);
        assert!(matches!(refused, Err(Refused::Invalid(Rejection::Lengths { .. }))), "{refused:?}");
    }
    feeder.end_of_feed(list, length + length).expect("room");
    feeder.change(Change { from: 0, to: list, after: 0, within: false }).expect("a list");
    for _ in 0..100 {
        executor.tick(&mut intake).expect("no fault");
    }
    let progress = feeder.progress();
    assert_eq!((progress.tick, progress.list, progress.done), (100, list, 0));
    // The same ramp, cut where it was 70 ticks ago, in its opening edge, and to rest.
    let cut = CutRamp { ramp: up, cut_s: 30.0 * tick_s };
    let other = feeder.begin(mm(0.0), 0.0, Density::NONE).expect("a list");
    let cut_at = Ticks::from_seconds(30.0, 1.0).expect("in range");
    let first = FeedSegment::cut(&up, cut_at, mm(cut.length_mm()), tick_s).expect("a segment");
    feeder.segment(other, first).expect("room");
    let stop = Ramp::new(&law, cut.to_mm_s(), 0.0);
    feeder
        .segment(other, FeedSegment::ramp(&stop, mm(stop.length_mm()), tick_s).expect("a segment"))
        .expect("room");
    feeder.change(Change { from: list, to: other, after: 0, within: true }).expect("a list");
    assert!(!feeder.is_refused());
    executor.tick(&mut intake).expect("no fault");
    assert!(feeder.is_refused());
    let executed = std::iter::repeat_with(|| executor.tick(&mut intake).expect("no fault"))
        .find(|executed| executed.state == ExecState::Idle)
        .expect("endless");
    assert_eq!(executed.setpoints[0].position, length + length);
}
