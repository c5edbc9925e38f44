//! Executes every program of the bundle in closed loop with the simulated machine, one tick after the other,
//! and prints a digest of each run.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use hal_sim::SimMachine;
use hal_sim::closed_loop::{close, reference_machine};
use motion_kernel::exec::ExecState;
use motion_kernel::program::Reader;
use motion_kernel::queue::Streams;
use motion_kernel::trace::Digest;
use qemu_boards::programs::programs;
use qemu_boards::{AXES, LINE, Number, PIECES, SEGMENTS, SUBSTEPS, exit, fail};

type Queues = Streams<Number, AXES, PIECES, SEGMENTS>;

#[entry]
fn main() -> ! {
    let streams = cortex_m::singleton!(: Queues = Streams::new()).unwrap_or_else(|| fail(&"streams"));
    for bytes in programs() {
        run(bytes, streams);
    }
    exit(true)
}

#[inline(never)]
fn run(bytes: &[u8], streams: &mut Queues) {
    // Looked at where it is, as all that is large: the microbit has no room for another one.
    let program = &Reader::<AXES>::new(bytes);
    let program = program.as_ref().unwrap_or_else(|error| fail(error));
    let machine = simulated(program);
    let mut closed = close(program, streams, &machine);
    let (producer, closed_loop) = closed.as_mut().unwrap_or_else(|error| fail(error));
    let (mut digest, mut ticks) = (Digest::new(), 0_u32);
    loop {
        let is_all = producer.fill().unwrap_or_else(|error| fail(&error));
        let trace = closed_loop.tick();
        digest.add(&trace);
        ticks += 1;
        if trace.fault.is_some() || (is_all && trace.executed.state == ExecState::Idle) {
            hprintln!("{} ticks digest {:016x} fault {}", ticks, digest.value(), trace.fault.is_some());
            return;
        }
    }
}

#[inline(never)]
fn simulated(program: &Reader<'_, AXES>) -> SimMachine<AXES, LINE> {
    SimMachine::new(&reference_machine(program.header(), SUBSTEPS)).unwrap_or_else(|error| fail(&error))
}
