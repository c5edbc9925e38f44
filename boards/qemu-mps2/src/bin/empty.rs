//! What every image has without the kernel: start-up and vectors. Its size is subtracted from
//! `kernel_only`'s.
#![no_std]
#![no_main]

use qemu_boards::processor::{entry, wait};

#[entry]
fn main() -> ! {
    loop {
        wait();
    }
}
