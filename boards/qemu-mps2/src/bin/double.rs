//! Sums, differences, products, quotients and comparisons of f64: a digest of all results so far after every ten thousand
//! pairs, and the instructions of those of two normal numbers that make one.
#![no_std]
#![no_main]

use core::hint::black_box;

use armv7m_double::operands::{Operands, PAIRS, Results};
use qemu_boards::count::Counter;
use qemu_boards::processor::{Timer, entry};
use qemu_boards::{exit, fail, println};

/// Pairs of which instructions are counted.
const COUNTED: usize = 4000;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    for pair in Operands::new(1).take(COUNTED) {
        count(&counter, "sum", pair, |x, y| x + y);
        count(&counter, "difference", pair, |x, y| x - y);
        count(&counter, "product", pair, |x, y| x * y);
        count(&counter, "quotient", pair, |x, y| x / y);
        count(&counter, "comparison", pair, |x, y| if x < y { 1.0 } else { 2.0 });
    }
    let mut results = Results::default();
    for (number, (a, b)) in (1..).zip(Operands::new(2).take(PAIRS)) {
        let (x, y) = black_box((f64::from_bits(a), f64::from_bits(b)));
        results.take(x + y, x - y, x * y, x / y, [x < y, x <= y, x > y, x >= y]);
        if number % 10_000 == 0 {
            println!("digest {:016x}", results.digest());
        }
    }
    exit(true)
}

fn count(counter: &Counter, name: &str, (a, b): (u64, u64), operation: fn(f64, f64) -> f64) {
    let (x, y, operation) = black_box((f64::from_bits(a), f64::from_bits(b), operation));
    let (result, spent) = counter.count(|| operation(x, y));
    if [x, y, result].map(f64::to_bits).iter().all(|bits| (1..0x7FF).contains(&(bits >> 52 & 0x7FF))) {
        println!("{} {}", name, spent);
    }
}
