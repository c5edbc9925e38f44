//! What the compiler calls where a core has no instruction: arithmetic of f64, and copies. Prints a digest of all results so
//! far after every ten thousand pairs, and the instructions where both numbers and the result are normal. Checks every byte of
//! copies and around them.
#![no_std]
#![no_main]

use core::hint::black_box;

use armv7m_runtime::operands::{Operands, digests};
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
    #[cfg(target_arch = "arm")]
    copies(&counter);
    for digest in digests() {
        println!("digest {:016x}", digest);
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

/// Copies of all lengths up to this one \[bytes\].
#[cfg(target_arch = "arm")]
const MOST: usize = 256;

#[cfg(target_arch = "arm")]
fn copies(counter: &Counter) {
    unsafe extern "C" {
        fn __aeabi_memcpy4(to: *mut u8, from: *const u8, bytes: usize);
        fn __aeabi_memcpy8(to: *mut u8, from: *const u8, bytes: usize);
    }
    /// The bytes around a copy.
    const UNTOUCHED: u8 = 0xA5;
    #[repr(align(8))]
    struct Aligned<const BYTES: usize>([u8; BYTES]);

    let mut source = Aligned([0; MOST + 8]);
    for (byte, value) in source.0.iter_mut().zip((1..=251).cycle()) {
        *byte = value;
    }
    for (copy, name, align) in
        [(__aeabi_memcpy4 as unsafe extern "C" fn(_, _, _), "copy4", 4), (__aeabi_memcpy8, "copy8", 8)]
    {
        for (from, to) in [(0, 8), (0, 8 + align), (align, 8), (align, 8 + align)] {
            for bytes in 0..=MOST {
                let mut target = Aligned([UNTOUCHED; MOST + 24]);
                let (begin, source) = (target.0[to..].as_mut_ptr(), source.0[from..].as_ptr());
                // Sound: both have as many bytes, begin at a word or two, and are apart.
                let ((), spent) = counter.count(|| unsafe { copy(begin, source, bytes) });
                let found = black_box(&target.0);
                let is_copied = (0..bytes).all(|place| found[to + place] == ((from + place) % 251) as u8 + 1);
                let is_all = found
                    .iter()
                    .enumerate()
                    .all(|(place, &byte)| (to..to + bytes).contains(&place) || byte == UNTOUCHED);
                if !is_copied || !is_all {
                    fail(&(name, from, to, bytes));
                }
                if bytes == MOST {
                    println!("{} {}", name, spent);
                }
            }
        }
    }
}
