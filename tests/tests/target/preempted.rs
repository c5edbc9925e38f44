//! Live control whose background is stopped by ticks anywhere, as on a board: a PC repeats what the emulated board did, from
//! where each tick came, and has the same digest.

use std::cell::{Cell, RefCell};

use hal_sim::SimMachine;
use hal_sim::closed_loop::live::{Ticked, close};
use hal_sim::closed_loop::reference_machine;
use motion_kernel::exec::ExecState;
use motion_kernel::internals::Access;
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Reader;
use motion_kernel::queue::LiveStreams;
use motion_kernel::trace::Digest;

use crate::digest::{LINE, LIVE_SEGMENTS, PLACES, SUBSTEPS};
use crate::programs;
use crate::tools::{Board, Case, Clock, Tools, WATCHED_BOARDS, bundles, by_place};

/// Random programs.
const GENERATED: usize = 6;
/// How many ticks must have come in the middle of polls, over all programs.
const INSIDE_MIN: u32 = 5_000;

/// What a board printed of a program.
struct Ran<'a> {
    /// Accesses of the background before each tick, since the one before.
    at: Vec<u32>,
    /// Its last line.
    end: &'a str,
}

fn ran(printed: &str) -> Vec<Ran<'_>> {
    let mut runs = Vec::new();
    for line in printed.lines() {
        if line == "program" {
            runs.push(Ran { at: Vec::new(), end: "" });
        } else if let Some(run) = runs.last_mut() {
            match line.strip_prefix("at ").map(str::parse) {
                Some(Ok(at)) => run.at.push(at),
                _ => run.end = line,
            }
        }
    }
    runs
}

/// The same on the PC.
struct Repeated {
    /// What the board must have printed at the end.
    end: String,
    /// Ticks that came in the middle of a poll.
    inside: u32,
    /// Whether all of the board's ticks were made, and no others were needed.
    is_whole: bool,
}

fn repeat<R: Real>(bytes: &[u8], seed: u64, at: &[u32]) -> Repeated {
    let program = Reader::<3>::new(bytes).expect("a program");
    let parameters = reference_machine(program.header(), SUBSTEPS);
    let machine = SimMachine::<3, LINE>::new(&parameters).expect("a machine");
    let mut streams = LiveStreams::<R, 3, 64, LIVE_SEGMENTS>::new();
    let (producer, closed) =
        close::<_, _, _, _, PLACES, _>(&program, &mut streams, &machine, seed).expect("a loop");
    let (closed, digest) = (RefCell::new(closed), RefCell::new(Digest::new()));
    let last = Cell::new(Ticked { ticks: 0, state: ExecState::Idle, is_fault: false });
    let (accesses, polls, inside) = (Cell::new(0_u32), Cell::new(false), Cell::new(0));
    let due = || {
        while at.get(last.get().ticks as usize) == Some(&accesses.get()) {
            accesses.set(0);
            let trace = closed.borrow_mut().tick();
            digest.borrow_mut().add(&trace);
            inside.set(inside.get() + u32::from(polls.get()));
            let ticks = last.get().ticks + 1;
            last.set(Ticked { ticks, state: trace.executed.state, is_fault: trace.fault.is_some() });
        }
    };
    let watcher = |access| match access {
        Access::Begins => due(),
        Access::Ends => accesses.set(accesses.get() + 1),
    };
    // The board would not have ticked on: then the run ends, by a fault that is none.
    let is_missing = Cell::new(false);
    let mut producer = producer;
    let done = producer.run(
        &watcher,
        || Ticked { is_fault: last.get().is_fault || is_missing.get(), ..last.get() },
        |producer| {
            polls.set(true);
            let polled = producer.poll();
            polls.set(false);
            polled
        },
        // Else the board waited for a tick that it printed, after this access or one of the next.
        || {
            let next = at.get(last.get().ticks as usize);
            is_missing.set(next.is_none_or(|next| *next < accesses.get()));
        },
    );
    done.expect("accepted");
    due();
    let is_whole = last.get().ticks as usize == at.len() && !is_missing.get();
    let Ticked { ticks, is_fault, .. } = last.get();
    let end = format!("{ticks} ticks digest {:016x} fault {is_fault}", digest.borrow().value());
    Repeated { end, inside: inside.get(), is_whole }
}

fn repeat_on(board: Board, case: &Case, at: &[u32]) -> Repeated {
    let seed = u64::from(case.seed);
    if board.number == "f32" {
        repeat::<f32>(&case.bytes, seed, at)
    } else {
        repeat::<Fixed>(&case.bytes, seed, at)
    }
}

pub(crate) fn the_same_bits_where_ticks_stop_the_background(tools: &Tools) -> Result<(), String> {
    let cases = by_place(&programs::live(GENERATED));
    for board in WATCHED_BOARDS {
        let mut inside = 0;
        for bundle in bundles(board, &cases) {
            let printed = tools.run_cases(board, "live_interrupt", &bundle, Clock::Counting)?;
            let runs = ran(&printed);
            if runs.len() != bundle.len() {
                return Err(format!("{}: {} runs of {}", board.core, runs.len(), bundle.len()));
            }
            for (case, Ran { at, end }) in bundle.iter().zip(runs) {
                let repeated = repeat_on(board, case, &at);
                if end != repeated.end || !repeated.is_whole || !end.ends_with("fault false") {
                    let seed = case.seed;
                    return Err(format!("{}, program {seed}: {end}, on the PC {}", board.core, repeated.end));
                }
                inside += repeated.inside;
            }
        }
        println!("{}: {inside} ticks in the middle of a poll", board.core);
        if inside < INSIDE_MIN {
            return Err(format!("{}: {inside} ticks inside a poll, expected {INSIDE_MIN}", board.core));
        }
    }
    Ok(())
}

/// The last place of one coefficient is seen in what the background hands over, wherever the ticks stop it.
pub(crate) fn one_last_place_is_seen(tools: &Tools) -> Result<(), String> {
    let [stringer, changed] =
        programs::live_stringer_and_off_by_a_last_place().map(|bytes| Case { seed: 0, bytes });
    for board in WATCHED_BOARDS {
        let printed =
            tools.run_cases(board, "live_interrupt", core::slice::from_ref(&changed), Clock::Counting)?;
        let [Ran { at, end }] = &ran(&printed)[..] else { return Err(format!("{}: {printed}", board.core)) };
        let [before, after] = [&stringer, &changed].map(|case| repeat_on(board, case, at).end);
        if before == after || *end != after {
            return Err(format!("{}: {before}, changed {after}, on the board {end}", board.core));
        }
    }
    Ok(())
}
