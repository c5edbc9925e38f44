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

#[entry]
fn main() -> ! {
    for bytes in programs() {
        run(bytes);
    }
    exit(true)
}

#[inline(never)]
fn run(bytes: &[u8]) {
    let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
    let machine = SimMachine::<AXES, LINE>::new(&reference_machine(program.header(), SUBSTEPS))
        .unwrap_or_else(|error| fail(&error));
    let mut streams = Streams::<Number, AXES, PIECES, SEGMENTS>::new();
    let mut closed = close(&program, &mut streams, &machine);
    // In place: the microbit has no room for another one.
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
