//! Executes every program of the bundle under live control as a board does: the tick in an interrupt, which stops
//! the background's polls anywhere; commands and times of the ticks are those of its seed.
//!
//! What a poll decides depends on the ticks that come in it, and so does the digest. So where each of them came is
//! printed: after how many more accesses of the background to what both share. With that a PC repeats the run. A tick
//! that would come in the middle of an access, which is some instructions long, comes right after it.
//!
//! Counts instructions as `live_budget` does: of every tick, and of every poll without the ticks in it.
#![no_std]
#![no_main]

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use critical_section::Mutex;
use hal_sim::SimMachine;
use hal_sim::closed_loop::live::{Ticked, close};
use hal_sim::closed_loop::reference_machine;
use motion_kernel::exec::ExecState;
use motion_kernel::internals::Access;
use motion_kernel::program::Reader;
use motion_kernel::trace::Digest;
use qemu_boards::count::Counter;
use qemu_boards::interrupt::{self, with_ticks};
use qemu_boards::live::{Closed, Producer, Streams};
use qemu_boards::processor::{Timer, entry, wait};
use qemu_boards::programs::seeded_programs;
use qemu_boards::{AXES, LINE, SUBSTEPS, exit, fail, println};

/// Instructions from one tick to the next, as powers of two: from some to more than there are between two ticks of
/// 0.5 ms at 168 MHz.
const BETWEEN: core::ops::Range<u32> = 8..17;
/// Until a tick is tried again that would have come in the middle of an access: more than what is left of the interrupt then,
/// or nothing else would ever run.
const SOON: u32 = 200;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    let mut timer = Some(timer);
    for (seed, bytes) in seeded_programs() {
        println!("program");
        let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
        let machine = SimMachine::<AXES, LINE>::new(&reference_machine(program.header(), SUBSTEPS))
            .unwrap_or_else(|error| fail(&error));
        let mut streams = Streams::new();
        let (producer, closed) =
            close(&program, &mut streams, &machine, seed).unwrap_or_else(|error| fail(&error));
        run(&counter, &mut timer, seed, producer, closed);
    }
    exit(true)
}

#[inline(never)]
fn run(
    counter: &Counter,
    timer: &mut Option<Timer>,
    seed: u64,
    producer: Producer<'_>,
    mut closed: Closed<'_>,
) {
    let (accesses, is_inside) = (AtomicU32::new(0), AtomicBool::new(false));
    let last = Mutex::new(Cell::new(Ticked { ticks: 0, state: ExecState::Idle, is_fault: false }));
    let mut random = seed as u32;
    let (mut digest, mut at) = (Digest::new(), 0);
    let mut tick = || {
        if is_inside.load(Ordering::SeqCst) {
            return SOON;
        }
        let now = accesses.load(Ordering::SeqCst);
        let mut spent = 0;
        let trace = closed.tick_by(|kernel, intake, memory| {
            let (trace, instructions) = counter.count(|| budgeted_tick(kernel, intake, memory));
            spent = instructions;
            *trace
        });
        println!("at {}\ntick {}", now - at, spent);
        at = now;
        digest.add(&trace);
        critical_section::with(|cs| {
            let last = last.borrow(cs);
            let ticks = last.get().ticks + 1;
            last.set(Ticked { ticks, state: trace.executed.state, is_fault: trace.fault.is_some() });
        });
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let least = 1 << (BETWEEN.start + (random >> 8) % (BETWEEN.end - BETWEEN.start));
        least + (random >> 16) % least
    };
    let watcher = |access| match access {
        Access::Begins => is_inside.store(true, Ordering::SeqCst),
        Access::Ends => {
            accesses.store(accesses.load(Ordering::SeqCst) + 1, Ordering::SeqCst);
            is_inside.store(false, Ordering::SeqCst);
        }
    };
    let mut producer = producer;
    let ended = with_ticks(timer, 1 << BETWEEN.end, &mut tick, || {
        producer.run(
            &watcher,
            || critical_section::with(|cs| last.borrow(cs).get()),
            |producer| {
                let (polled, instructions) = interrupt::count(|| producer.poll());
                println!("poll {}", instructions);
                polled
            },
            wait,
        )
    });
    ended.unwrap_or_else(|error| fail(&error));
    let last = critical_section::with(|cs| last.borrow(cs).get());
    println!("{} ticks digest {:016x} fault {}", last.ticks, digest.value(), last.is_fault);
}

qemu_boards::budgeted_tick!();
qemu_boards::ticks_by_interrupt!();
