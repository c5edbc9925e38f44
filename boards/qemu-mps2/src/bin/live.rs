//! Executes every program of the bundle under live control, with commands that its number in the bundle
//! makes, and prints a digest of each run.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use motion_kernel::trace::Digest;
use qemu_boards::programs::programs;
use qemu_boards::{exit, fail, live};

#[entry]
fn main() -> ! {
    for (seed, bytes) in (0..).zip(programs()) {
        let (mut digest, mut ticks) = (Digest::new(), 0_u32);
        let is_fault = live::run(bytes, seed, |producer, closed| {
            producer.poll().unwrap_or_else(|error| fail(&error));
            let trace = closed.tick();
            digest.add(&trace);
            ticks += 1;
            trace
        });
        hprintln!("{} ticks digest {:016x} fault {}", ticks, digest.value(), is_fault);
    }
    exit(true)
}
