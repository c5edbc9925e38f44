//! Executes every program of the bundle under live control, with the commands of its seed, and prints a digest of each run.
#![no_std]
#![no_main]

use motion_kernel::trace::Digest;
use qemu_boards::processor::entry;
use qemu_boards::programs::seeded_programs;
use qemu_boards::{exit, fail, live, println};

#[entry]
fn main() -> ! {
    for (seed, bytes) in seeded_programs() {
        let (mut digest, mut ticks) = (Digest::new(), 0_u32);
        let is_fault = live::run(bytes, seed, |producer, closed| {
            producer.poll().unwrap_or_else(|error| fail(&error));
            let trace = closed.tick();
            digest.add(&trace);
            ticks += 1;
            trace
        });
        println!("{} ticks digest {:016x} fault {}", ticks, digest.value(), is_fault);
    }
    exit(true)
}
