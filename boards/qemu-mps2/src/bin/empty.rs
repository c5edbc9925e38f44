//! What every image has without the kernel: start-up and vectors. Its size is subtracted from
//! `kernel_only`'s.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use qemu_boards as _;

#[entry]
fn main() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
