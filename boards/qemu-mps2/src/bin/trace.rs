//! Ticks without a simulated machine, whose encoders read what was set in the tick before: few instructions
//! around the tick, so that all that are executed can be traced.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use hal_sim::closed_loop::InMemory;
use motion_kernel::axis::AxesConfig;
use motion_kernel::exec::ExecState;
use motion_kernel::kernel::Kernel;
use motion_kernel::program::{Header, Reader, Supply};
use motion_kernel::queue::Streams;
use motion_kernel::units::{Counts, DacCode};
use qemu_boards::programs::programs;
use qemu_boards::{AXES, Number, PIECES, SEGMENTS, exit, fail};

#[entry]
fn main() -> ! {
    let bytes = programs().next().unwrap_or_else(|| fail(&"a bundle without a program"));
    let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
    let &Header { tick_s, rules, ref axes, start, .. } = program.header();
    let config = AxesConfig::<Number, _>::new(axes, tick_s).unwrap_or_else(|error| fail(&error));
    let steps = config.axes.map(|config| config.encoder.position(Counts(1)).to_bits());
    let mut streams = Streams::<Number, AXES, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(rules, start);
    let mut supply = Supply::new(program.items(), tick_s);
    let mut memory = InMemory { counts: [Counts(0); AXES], codes: [DacCode::ZERO; AXES], enabled: None };
    let mut kernel = Kernel::new(&config, start, memory.counts);
    kernel.enable(0);
    loop {
        supply.fill(&mut feeder).unwrap_or_else(|error| fail(&error));
        let trace = budgeted_tick(&mut kernel, &mut intake, &mut memory);
        if trace.fault.is_some() {
            fail(&"a fault");
        }
        let setpoints = &trace.executed.setpoints;
        for ((counts, setpoint), step) in memory.counts.iter_mut().zip(setpoints).zip(steps) {
            *counts = Counts(setpoint.position.to_bits() / step);
        }
        if trace.executed.state == ExecState::Idle && supply.is_empty() {
            exit(true);
        }
    }
}

qemu_boards::budgeted_tick!();
