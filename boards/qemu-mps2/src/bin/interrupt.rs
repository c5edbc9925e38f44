//! Executes the first program of the bundle as a board does: the tick in an interrupt, the streams filled in
//! the background, which the interrupt stops anywhere. The digest is that of the stepped run.
//!
//! The timer is set anew in every tick: after a short time that is never the same, so that the next tick
//! comes somewhere in the middle of a fill, and after that for long enough that the fill comes to its end.
//! How many ticks came in the middle of one is printed too.
#![no_std]
#![no_main]

use core::cell::Cell;

use critical_section::Mutex;
use hal_sim::closed_loop::{Closed, LoopError, close, reference_machine};
use hal_sim::{MachineParameters, SimMachine};
use motion_kernel::exec::ExecState;
use motion_kernel::program::Reader;
use motion_kernel::queue::Streams;
use motion_kernel::trace::Digest;
use qemu_boards::interrupt::with_ticks;
use qemu_boards::processor::{Timer, entry, wait};
use qemu_boards::programs::programs;
use qemu_boards::{AXES, LINE, Number, PIECES, SEGMENTS, SUBSTEPS, exit, fail, println, singleton};

type Queues = Streams<Number, AXES, PIECES, SEGMENTS>;

/// Instructions until a tick that the background is to have time for: several times what a fill takes.
const LONG: u32 = 1_250_000;
/// Instructions until a tick that is to come in the middle of a fill: from some to those of some items.
const SHORT: core::ops::Range<u32> = 125..25_000;

/// What background and tick tell each other.
#[derive(Clone, Copy, Default)]
struct Told {
    /// The background is filling the streams.
    is_filling: bool,
    ticks: u32,
    /// Ticks that came in the middle of a fill.
    inside: u32,
    /// The state after the last tick.
    is_idle: bool,
    is_faulted: bool,
}

#[entry]
fn main() -> ! {
    let streams = singleton!(Queues = Streams::new()).unwrap_or_else(|| fail(&"streams"));
    let bytes = programs().next().unwrap_or_else(|| fail(&"a bundle without a program"));
    let machine = &simulated(&machine_parameters(bytes));
    let mut closed = closed(bytes, streams, machine);
    ticks(closed.as_mut().unwrap_or_else(|error| fail(error)));
    exit(true)
}

// Closing the loop is what needs the most room: nothing of this is in the frame then.
#[inline(never)]
fn ticks((producer, closed_loop): &mut Closed<'_, Number, AXES, LINE>) {
    let mut timer = Timer::take();
    let told = &Mutex::new(Cell::new(Told::default()));
    let tell = |change: fn(&mut Told)| {
        critical_section::with(|cs| {
            let mut now = told.borrow(cs).get();
            change(&mut now);
            told.borrow(cs).set(now);
            now
        })
    };
    let (mut digest, mut random) = (Digest::new(), 1_u32);
    let mut tick = || {
        let trace = closed_loop.tick();
        digest.add(&trace);
        critical_section::with(|cs| {
            let told = told.borrow(cs);
            let mut now = told.get();
            now.ticks += 1;
            now.inside += u32::from(now.is_filling);
            now.is_idle = trace.executed.state == ExecState::Idle;
            now.is_faulted = trace.fault.is_some();
            told.set(now);
            if now.ticks.is_multiple_of(2) {
                return LONG;
            }
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            SHORT.start + (random >> 8) % (SHORT.end - SHORT.start)
        })
    };
    let mut is_all = producer.fill().unwrap_or_else(|error| fail(&error));
    let end = with_ticks(&mut timer, LONG, &mut tick, || {
        loop {
            if !is_all {
                tell(|told| told.is_filling = true);
                is_all = producer.fill().unwrap_or_else(|error| fail(&error));
                tell(|told| told.is_filling = false);
            }
            wait();
            let now = tell(|_| ());
            if now.is_faulted || (is_all && now.is_idle) {
                return now;
            }
        }
    });
    println!("{} ticks digest {:016x} fault {}", end.ticks, digest.value(), end.is_faulted);
    println!("{} ticks inside a fill", end.inside);
}

// Each made in a frame of its own, which is gone before the ticks begin.

#[inline(never)]
fn machine_parameters(bytes: &[u8]) -> MachineParameters<AXES> {
    let program = &Reader::<AXES>::new(bytes);
    reference_machine(program.as_ref().unwrap_or_else(|error| fail(error)).header(), SUBSTEPS)
}

#[inline(never)]
fn simulated(parameters: &MachineParameters<AXES>) -> SimMachine<AXES, LINE> {
    SimMachine::new(parameters).unwrap_or_else(|error| fail(&error))
}

#[inline(never)]
fn closed<'a>(
    bytes: &'a [u8],
    streams: &'a mut Queues,
    machine: &'a SimMachine<AXES, LINE>,
) -> Result<Closed<'a, Number, AXES, LINE>, LoopError> {
    let program = &Reader::<AXES>::new(bytes);
    close(program.as_ref().unwrap_or_else(|error| fail(error)), streams, machine)
}

qemu_boards::ticks_by_interrupt!();
