//! Executes every program of the bundle in closed loop with the simulated machine, one tick after the other,
//! its second stretch with a correction, and prints a digest of each run.
#![no_std]
#![no_main]

use hal_sim::closed_loop::{Closed, LoopError, close, reference_machine, some_knots};
use hal_sim::{MachineParameters, SimMachine};
use motion_kernel::exec::ExecState;
use motion_kernel::program::Reader;
use motion_kernel::queue::Streams;
use motion_kernel::trace::Digest;
use qemu_boards::processor::entry;
use qemu_boards::programs::programs;
use qemu_boards::{AXES, LINE, Number, PIECES, SEGMENTS, SUBSTEPS, exit, fail, println, singleton};

type Queues = Streams<Number, AXES, PIECES, SEGMENTS>;

#[entry]
fn main() -> ! {
    let streams = singleton!(Queues = Streams::new()).unwrap_or_else(|| fail(&"streams"));
    for bytes in programs() {
        run(bytes, &machine_parameters(bytes), streams);
    }
    exit(true)
}

#[inline(never)]
fn run(bytes: &[u8], parameters: &MachineParameters<AXES>, streams: &mut Queues) {
    // All that is large is looked at where it is: the microbit has no room for another one.
    let machine = &simulated(parameters);
    let knots = some_knots::<Number, AXES>();
    let mut closed = closed(bytes, streams, machine);
    let closed = closed.as_mut().unwrap_or_else(|error| fail(error));
    closed.1.correct(&knots).unwrap_or_else(|error| fail(&error));
    ticks(closed);
}

// Closing the loop is what needs the most room: nothing of this is in the frame then.
#[inline(never)]
fn ticks((producer, closed_loop): &mut Closed<'_, Number, AXES, LINE>) {
    let (mut digest, mut ticks) = (Digest::new(), 0_u32);
    loop {
        let is_all = producer.fill().unwrap_or_else(|error| fail(&error));
        let trace = closed_loop.tick();
        digest.add(&trace);
        ticks += 1;
        if trace.fault.is_some() || (is_all && trace.executed.state == ExecState::Idle) {
            println!("{} ticks digest {:016x} fault {}", ticks, digest.value(), trace.fault.is_some());
            return;
        }
    }
}

// The program's header, a kilobyte, is gone before the ticks begin.

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
