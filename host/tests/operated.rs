//! A board as an operator has it: the simulated one, at the pace of the clock.

use std::time::Duration;

use motion_host::board::interface::{BoardEvent, BoardState, UnderWay, wait_for, wait_until_at_rest};
use motion_host::board::items::Source;
use motion_host::board::operated::open;
use motion_host::board::{Board, BoardError, Port};
use motion_host::gcode::ReadOptions;
use motion_host::machine::Machine;
use motion_kernel::link::State;

use crate::board::LONGEST;

const SQUARE: &str = "G21 G90 G61\nG1 X20 F3000\nY20\n(half)\nM0\nX0\nY0\nM2\n";

fn board() -> Box<dyn Board> {
    open(&Machine::reference(), &Port::Simulator, 0).expect("a board")
}

fn load(board: &mut dyn Board, text: &str) -> BoardEvent {
    let source = Source {
        name: "part.ngc".to_owned(),
        text: text.as_bytes().to_vec(),
        options: ReadOptions::default(),
        leaves_out_outputs: false,
    };
    board.load(source).expect("nothing under way");
    let is_it = |event: &BoardEvent| matches!(event, BoardEvent::Loaded(_) | BoardEvent::NotLoaded(_));
    wait_for(board, LONGEST, &mut { is_it }).expect("planned")
}

/// Until the machine is as it is to be.
fn wait_until(board: &mut dyn Board, is_it: impl Fn(&BoardState) -> bool) {
    for _ in 0..24_000 {
        if is_it(&board.state()) {
            return;
        }
        board.step(Duration::from_millis(5));
    }
    panic!("{:?}", board.state());
}

fn wait_for_state(board: &mut dyn Board, wanted: State) {
    wait_until(board, |state| state.state == Some(wanted));
}

fn switch_on(board: &mut dyn Board) {
    wait_for_state(board, State::Off);
    board.set_drives(true).expect("no fault");
    // Until there is something to drive.
    wait_for_state(board, State::Held);
}

#[test]
fn a_program_is_loaded_driven_held_and_driven_again() {
    let mut board = board();
    let board = &mut *board;
    assert_eq!(board.info().axes.iter().map(|axis| axis.name.as_str()).collect::<Vec<_>>(), ["X", "Y", "Z"]);
    assert!(matches!(board.start(), Err(BoardError::NoProgram)));
    let refused = load(board, "G1 X5\n");
    assert!(
        matches!(&refused, BoardEvent::NotLoaded(error) if error.to_string().starts_with("part.ngc:1:")),
        "{refused:?}"
    );
    assert!(matches!(load(board, SQUARE), BoardEvent::Loaded(_)));
    assert_eq!(board.state().program.as_deref(), Some("part.ngc"));
    wait_for_state(board, State::Off);
    assert!(matches!(board.start(), Err(BoardError::Off)));
    switch_on(board);
    board.set_override(2001).expect_err("too fast");
    board.set_override(500).expect("taken");
    board.start().expect("on");
    assert!(matches!(board.start(), Err(BoardError::UnderWay)));
    wait_until(board, |state| state.set_mm.first().is_some_and(|&x_mm| x_mm > 1.0));
    board.hold();
    wait_for_state(board, State::Held);
    let here = board.state();
    assert!(here.set_mm[0] > 0.0 && here.set_mm[0] < 20.0, "{here:?}");
    assert_eq!((here.under_way, here.override_permille, here.line), (UnderWay::Program, 500, 2));
    assert_eq!(here.set_mm[1..], [0.0, 0.0]);
    board.resume().expect("there");
    let stop = wait_for(board, LONGEST, &mut |event| matches!(event, BoardEvent::Stopped(_)));
    assert!(matches!(&stop, Some(BoardEvent::Stopped(text)) if text.starts_with("line 5 stops")), "{stop:?}");
    assert_eq!(board.state().set_mm, [20.0, 20.0, 0.0]);
    board.resume().expect("there");
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(true));
    assert_eq!(board.state().set_mm, [0.0; 3]);
    assert!(matches!(board.resume(), Err(BoardError::NothingUnderWay)));

    // Once more, and given up in the middle; then from the start again, with the same stop.
    board.start().expect("at rest");
    wait_for_state(board, State::Moving);
    board.abort();
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(false));
    board.set_override(1000).expect("taken");
    board.start().expect("given up");
    wait_for_state(board, State::Stopped);
    board.resume().expect("there");
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(true));
}

#[test]
fn a_key_moves_until_its_release() {
    let mut board = board();
    let board = &mut *board;
    switch_on(board);
    let press = |text: &str| text.parse().expect("a press");
    for (text, feed_mm_s) in [("Q+", None), ("X+", Some(1e6)), ("X+", Some(0.0))] {
        let refused = board.press_key(&press(text), feed_mm_s);
        assert!(matches!(refused, Err(BoardError::Key(_))), "{text}: {refused:?}");
    }
    board.press_key(&press("Y+2.5"), None).expect("a key");
    assert!(matches!(board.press_key(&press("X+1"), None), Err(BoardError::UnderWay)));
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(true));
    assert_eq!(board.state().set_mm, [0.0, 2.5, 0.0]);
    board.press_key(&press("X+400"), Some(20.0)).expect("a key");
    wait_for_state(board, State::Moving);
    board.release_key();
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(false));
    let x_mm = board.state().set_mm[0];
    assert!(x_mm > 0.0 && x_mm < 200.0, "{x_mm}");
    // The next one begins there.
    board.press_key(&press("X-1"), None).expect("a key");
    assert_eq!(wait_until_at_rest(board, LONGEST).expect("no fault"), Some(true));
    assert!((board.state().set_mm[0] - (x_mm - 1.0)).abs() < 1e-6);
    assert_eq!(board.state().under_way, UnderWay::Nothing);
}

#[test]
fn ticks_around_a_trigger_are_captured() {
    let mut board = board();
    let board = &mut *board;
    let refused = board.capture(Some("A_err_um>1".parse().expect("a condition")), 1, 1);
    assert!(matches!(refused, Err(BoardError::Trigger(_))), "{refused:?}");
    for (before, after) in [(120_000, 1), (usize::MAX, 2), (usize::MAX, usize::MAX)] {
        assert!(matches!(board.capture(None, before, after), Err(BoardError::Capture { .. })));
    }
    switch_on(board);
    board.capture(Some("v_mm_s>30".parse().expect("a condition")), 100, 200).expect("a scope");
    assert!(board.state().is_capturing && board.take_capture().is_none());
    assert!(matches!(load(board, SQUARE), BoardEvent::Loaded(_)));
    board.start().expect("on");
    wait_for(board, LONGEST, &mut |event| matches!(event, BoardEvent::Captured { missing: 0 }))
        .expect("triggered");
    let trace = board.take_capture().expect("ticks");
    assert!(!board.state().is_capturing);
    let first = trace.ticks[0].tick;
    assert!(trace.ticks.iter().zip(first..).all(|(row, tick)| row.tick == tick));
    // The feed rises once over the limit, and stays there for a while.
    let above = |row: &motion_host::trace::TraceRow<9>| row.v_mm_s.abs() > 30.0;
    assert_eq!(trace.ticks.iter().position(above), Some(100));
    let last = trace.ticks.iter().rposition(above).expect("some");
    assert_eq!(trace.ticks.len(), last + 201);
    assert_eq!((trace.axes.len(), trace.program.as_str()), (3, "part.ngc"));
    board.abort();
    // The next ones, whatever they are.
    board.capture(None, 0, 50).expect("a scope");
    wait_for(board, LONGEST, &mut |event| matches!(event, BoardEvent::Captured { missing: 0 }))
        .expect("ticks");
    assert_eq!(board.take_capture().map(|trace| trace.ticks.len()), Some(50));
    assert!(board.take_capture().is_none());
}
