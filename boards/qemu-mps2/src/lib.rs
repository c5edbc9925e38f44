//! What the images for emulated boards share: the number type and the capacities by core, the programs they
//! execute, counting of instructions, the way out.
//!
//! One ELF for each target serves every board with that core:
//!
//! | target | boards | number |
//! |---|---|---|
//! | thumbv7em-none-eabihf | mps2-an386 (M4F), mps2-an500 (M7) | f32 |
//! | thumbv7m-none-eabi | mps2-an385 (M3) | fixed point, or f32 in software (feature `soft-float`) |
//! | thumbv6m-none-eabi | microbit (M0) | fixed point |
//! | riscv32imafc-unknown-none-elf | virt (RISC-V with an FPU) | f32 |
//!
//! Feature `live` adds live control, which the microbit has no room for; `link` what a board that a PC drives has.
#![no_std]

#[cfg(target_arch = "arm")]
#[path = "processor/arm.rs"]
pub mod processor;
#[cfg(target_arch = "riscv32")]
#[path = "processor/riscv.rs"]
pub mod processor;

pub mod count;
#[cfg(feature = "link")]
pub mod hardware;
pub mod interrupt;
#[cfg(feature = "live")]
pub mod live;
pub mod print;
pub mod programs;
pub mod stack;
#[cfg(all(feature = "link", target_arch = "arm"))]
pub mod uart;

use ::core::panic::PanicInfo;

use armv7m_runtime as _;
use semihosting::process;

/// The kernel's number type on this core.
#[cfg(any(target_feature = "f", target_abi = "eabihf", feature = "soft-float"))]
pub type Number = f32;
/// The kernel's number type on this core.
#[cfg(not(any(target_feature = "f", target_abi = "eabihf", feature = "soft-float")))]
pub type Number = motion_kernel::num::Fixed;

/// Whether that is fixed point.
pub const IS_FIXED_POINT: bool =
    cfg!(not(any(target_feature = "f", target_abi = "eabihf", feature = "soft-float")));

/// Whether this is the core with 16 KiB of memory.
#[cfg(not(target_has_atomic = "8"))]
const IS_SMALL: bool = true;
#[cfg(target_has_atomic = "8")]
const IS_SMALL: bool = false;

/// Axes of the machine.
pub const AXES: usize = 3;
/// Capacity of the path stream.
pub const PIECES: usize = if IS_SMALL { 8 } else { 64 };
/// Capacity of the feed stream.
pub const SEGMENTS: usize = if IS_SMALL { 5 } else { 64 };
/// Cells for the dead time of a simulated axis.
pub const LINE: usize = 4;
/// Sub-steps of a simulated tick: the dead time of 1.42 ms fits the cells. More would be nearer to a drive, but what these
/// cores compute in f64 takes them longer than all else.
pub const SUBSTEPS: u32 = 1;

/// A place in static memory with a value, the first time; then none.
#[macro_export]
macro_rules! singleton {
    ($type:ty = $value:expr) => {{
        static TAKEN: ::critical_section::Mutex<::core::cell::Cell<bool>> =
            ::critical_section::Mutex::new(::core::cell::Cell::new(false));
        static mut PLACE: ::core::mem::MaybeUninit<$type> = ::core::mem::MaybeUninit::uninit();
        let is_taken = ::critical_section::with(|cs| TAKEN.borrow(cs).replace(true));
        if is_taken {
            None
        } else {
            let value = $value;
            // Sound: nobody else comes here.
            Some(unsafe { (*(&raw mut PLACE)).write(value) })
        }
    }};
}

/// Defines `budgeted_tick`, the whole tick of the kernel, outlined under this name: by it a trace of executed
/// instructions is cut. In the image's own crate: in a function of the library other parts of the tick are
/// inlined, and the counts are others.
#[macro_export]
macro_rules! budgeted_tick {
    () => {
        #[unsafe(no_mangle)]
        #[inline(never)]
        fn budgeted_tick<'a>(
            kernel: &'a mut motion_kernel::kernel::Kernel<$crate::Number, { $crate::AXES }>,
            intake: &mut motion_kernel::queue::Intake<'_, $crate::Number, { $crate::AXES }>,
            memory: &mut hal_sim::closed_loop::InMemory<{ $crate::AXES }>,
        ) -> &'a motion_kernel::trace::Trace<$crate::Number, { $crate::AXES }> {
            kernel.tick(intake, memory)
        }
    };
}

/// Ends the emulation with a status.
pub fn exit(is_good: bool) -> ! {
    print::flush();
    process::exit(i32::from(!is_good))
}

/// Says what is wrong and ends the emulation.
pub fn fail(what: &dyn ::core::fmt::Debug) -> ! {
    crate::println!("failed {:?}", what);
    exit(false)
}

/// In one place, so that whatever can panic drags this symbol into its image.
#[unsafe(no_mangle)]
#[inline(never)]
fn panic_is_linked(info: &PanicInfo<'_>) -> ! {
    crate::println!("{}", info);
    exit(false)
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    panic_is_linked(info)
}
