//! Counts the instructions of every tick of every program of the bundle under live control, and of every poll
//! of the background between them; says how much memory both take.
//!
//! One line a figure, as `budget` prints them.
#![no_std]
#![no_main]

use motion_kernel::kernel::Kernel;
use qemu_boards::count::Counter;
use qemu_boards::interrupt::{self, with_ticks};
use qemu_boards::live::{self, Producer, Streams};
use qemu_boards::processor::{Timer, entry};
use qemu_boards::programs::seeded_programs;
use qemu_boards::{AXES, Number, exit, fail, println, stack};

/// Instructions after which the timer is set anew in a poll: fewer than it can count, which is less than a poll may take.
const COUNTABLE: u32 = 5_000_000;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    let mut timer = Some(timer);
    let kernel = size_of::<Kernel<Number, AXES>>();
    println!("ram {}", kernel + size_of::<Streams>() + size_of::<Producer<'_>>());
    let mut deepest = 0;
    for (seed, bytes) in seeded_programs() {
        println!("program");
        let is_fault = live::run(bytes, seed, |producer, closed| {
            let (polled, instructions) =
                with_ticks(&mut timer, COUNTABLE, &mut || COUNTABLE, || interrupt::count(|| producer.poll()));
            timer.as_mut().unwrap_or_else(|| fail(&"timer")).count();
            polled.unwrap_or_else(|error| fail(&error));
            let mut spent = 0;
            let trace = closed.tick_by(|kernel, intake, memory| {
                let top = stack::paint();
                let (trace, instructions) = counter.count(|| budgeted_tick(kernel, intake, memory));
                deepest = deepest.max(stack::depth(top));
                spent = instructions;
                *trace
            });
            println!("poll {}\ntick {}", instructions, spent);
            trace
        });
        if is_fault {
            fail(&"a fault");
        }
    }
    println!("stack {}", deepest);
    exit(true)
}

qemu_boards::budgeted_tick!();
qemu_boards::ticks_by_interrupt!();
