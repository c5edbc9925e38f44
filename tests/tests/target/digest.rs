//! One digest over everything that a run sets, reads and puts out: equal on the PC and on every core.

use hal_sim::SimMachine;
use hal_sim::closed_loop::{close, live, reference_machine, some_knots};
use motion_kernel::exec::ExecState;
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Reader;
use motion_kernel::queue::{LiveStreams, Streams};
use motion_kernel::trace::Digest;

use crate::programs;
use crate::tools::{BOARDS, Board, Case, Clock, LIVE_BOARDS, M0, Tools, bundles, by_place};

/// As the boards simulate (`boards/qemu-mps2/src/lib.rs`).
pub(crate) const LINE: usize = 4;
pub(crate) const SUBSTEPS: u32 = 1;
const GENERATED: usize = 50;
/// So many of the runs must have a stretch that is corrected.
const CORRECTED_MIN: u32 = 10;
/// Under live control.
const LIVE_GENERATED: usize = 20;
/// As the boards have room (`boards/qemu-mps2/src/live.rs`).
pub(crate) const LIVE_SEGMENTS: usize = 16;
pub(crate) const PLACES: usize = 64;
/// How many ticks must have come in the middle of a fill.
const INSIDE_MIN: u32 = 20;

/// Whether the second stretch is corrected, as the boards do when they are stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Correct {
    Nothing,
    SecondStretch,
}

/// What a board prints of a run.
fn on_the_pc_in<R: Real>(bytes: &[u8], correct: Correct) -> String {
    let program = Reader::<3>::new(bytes).expect("a program");
    let parameters = reference_machine(program.header(), SUBSTEPS);
    let machine = SimMachine::<3, LINE>::new(&parameters).expect("a machine");
    let knots = some_knots::<R, 3>();
    let mut streams = Streams::<R, 3, 64, 64>::new();
    let (mut producer, mut closed_loop) = close(&program, &mut streams, &machine).expect("a loop");
    if correct == Correct::SecondStretch {
        closed_loop.correct(&knots).expect("small");
    }
    let (mut digest, mut ticks) = (Digest::new(), 0);
    loop {
        let is_all = producer.fill().expect("accepted");
        let trace = closed_loop.tick();
        digest.add(&trace);
        ticks += 1;
        if trace.fault.is_some() || (is_all && trace.executed.state == ExecState::Idle) {
            return format!("{ticks} ticks digest {:016x} fault {}", digest.value(), trace.fault.is_some());
        }
    }
}

fn on_the_pc(board: Board, bytes: &[u8], correct: Correct) -> String {
    if board.number == "f32" {
        on_the_pc_in::<f32>(bytes, correct)
    } else {
        on_the_pc_in::<Fixed>(bytes, correct)
    }
}

/// The same under live control with the commands of `seed`.
fn live_on_the_pc_in<R: Real>(bytes: &[u8], seed: u64) -> String {
    let program = Reader::<3>::new(bytes).expect("a program");
    let parameters = reference_machine(program.header(), SUBSTEPS);
    let machine = SimMachine::<3, LINE>::new(&parameters).expect("a machine");
    let mut streams = LiveStreams::<R, 3, 64, LIVE_SEGMENTS>::new();
    let (mut producer, mut closed_loop) =
        live::close::<_, _, _, _, PLACES, _>(&program, &mut streams, &machine, seed).expect("a loop");
    let (mut digest, mut ticks) = (Digest::new(), 0);
    loop {
        producer.poll().expect("accepted");
        let trace = closed_loop.tick();
        digest.add(&trace);
        ticks += 1;
        if trace.fault.is_some() || producer.is_over(trace.executed.state) {
            return format!("{ticks} ticks digest {:016x} fault {}", digest.value(), trace.fault.is_some());
        }
    }
}

pub(crate) fn the_same_bits_on_every_core(tools: &Tools) -> Result<(), String> {
    let generated = programs::generated(GENERATED);
    let mut all = vec![("the stringer".to_owned(), programs::stringer())];
    all.extend(programs::inverted().into_iter().map(|bytes| ("drives inverted".to_owned(), bytes)));
    all.push(("tables of feedforward".to_owned(), programs::with_tables()));
    all.extend(generated.into_iter().map(|(seed, bytes)| (format!("seed {seed}"), bytes)));
    let mut corrected = 0;
    let bytes: Vec<_> = all.iter().map(|(_, bytes)| bytes.clone()).collect();
    for board in BOARDS {
        let mut printed = String::new();
        for bundle in bundles(board, &by_place(&bytes)) {
            printed += &tools.run_cases(board, "closed_loop", &bundle, Clock::Free)?;
        }
        let lines: Vec<_> = printed.lines().collect();
        if lines.len() != all.len() {
            return Err(format!("{}: {} runs of {}", board.core, lines.len(), all.len()));
        }
        for ((name, bytes), line) in all.iter().zip(lines) {
            let expected = on_the_pc(board, bytes, Correct::SecondStretch);
            corrected += u32::from(board == M0 && expected != on_the_pc(board, bytes, Correct::Nothing));
            if line != expected {
                return Err(format!("{}, {name}: {line}, on the PC {expected}", board.core));
            }
            if !line.ends_with("fault false") {
                return Err(format!("{name}: {line}"));
            }
        }
    }
    // Programs of one stretch have nothing to correct.
    if corrected < CORRECTED_MIN {
        return Err(format!("{corrected} runs with a correction, expected {CORRECTED_MIN}"));
    }
    Ok(())
}

/// Held, resumed, overridden, given up and kept waiting at random: what live control plans anew on a core is what it plans
/// on the PC.
pub(crate) fn the_same_bits_under_live_control(tools: &Tools) -> Result<(), String> {
    let cases = by_place(&programs::live(LIVE_GENERATED));
    for board in LIVE_BOARDS {
        for bundle in bundles(board, &cases) {
            let printed = tools.run_cases(board, "live", &bundle, Clock::Free)?;
            if printed.lines().count() != bundle.len() {
                return Err(format!("{}: {printed}, {} runs expected", board.core, bundle.len()));
            }
            for (Case { seed, bytes }, line) in bundle.iter().zip(printed.lines()) {
                let expected = if board.number == "f32" {
                    live_on_the_pc_in::<f32>(bytes, u64::from(*seed))
                } else {
                    live_on_the_pc_in::<Fixed>(bytes, u64::from(*seed))
                };
                if line != expected || !line.ends_with("fault false") {
                    return Err(format!("{}, program {seed}: {line}, on the PC {expected}", board.core));
                }
            }
        }
    }
    Ok(())
}

pub(crate) fn the_same_bits_from_an_interrupt(tools: &Tools) -> Result<(), String> {
    // The stringer's items all fit the streams: there would be nothing to stop.
    let facets = programs::facets();
    for board in BOARDS {
        let printed = tools.run(board, "interrupt", core::slice::from_ref(&facets), Clock::Counting)?;
        let expected = on_the_pc(board, &facets, Correct::Nothing);
        let mut lines = printed.lines();
        if lines.next() != Some(expected.as_str()) {
            return Err(format!("{}: {printed}, on the PC {expected}", board.core));
        }
        // Nothing would be shown by ticks that all come while the background waits.
        let inside =
            lines.next().and_then(|line| line.strip_suffix(" ticks inside a fill")?.parse::<u32>().ok());
        if inside.is_none_or(|inside| inside < INSIDE_MIN) {
            return Err(format!("{}: {inside:?} ticks inside a fill, expected {INSIDE_MIN}", board.core));
        }
    }
    Ok(())
}

/// A coefficient of the path that is off by one last place of an f32 gives another digest, and the same other one everywhere.
pub(crate) fn one_last_place_is_seen(tools: &Tools) -> Result<(), String> {
    let (stringer, changed) = (programs::stringer(), programs::stringer_off_by_a_last_place());
    for board in BOARDS {
        let [before, after] =
            [&stringer, &changed].map(|bytes| on_the_pc(board, bytes, Correct::SecondStretch));
        let printed = tools.run(board, "closed_loop", core::slice::from_ref(&changed), Clock::Free)?;
        if before == after || printed.trim() != after {
            return Err(format!("{}: {before}, changed {after}, on the board {printed}", board.core));
        }
    }
    Ok(())
}
