//! A RISC-V hart on QEMU's `virt`: the machine timer makes the ticks, `minstret` counts instructions.

use core::arch::asm;

use riscv::register::{mie, minstret, mstatus};
pub use riscv_rt::entry;

/// The count wraps after this.
pub const WRAP: u32 = u32::MAX;
/// The core-local interruptor's registers, and the rate of its clock: 10 MHz, as QEMU has them.
const TIME: *const u32 = 0x0200_BFF8 as *const u32;
const COMPARE: *mut u32 = 0x0200_4000 as *mut u32;
/// Steps of that clock in as many instructions, as the emulator is told (`-icount shift=6`): 64 ns each.
const STEPS: u32 = 16;
const INSTRUCTIONS: u32 = 25;
/// What is left of an interrupt when it arms the timer.
const EXIT: u32 = 150;
/// What `minstret` counts for an instruction there: nanoseconds.
const COUNTED: u32 = 64;

/// The timer, as it was when the last interrupt ended.
pub struct Timer {
    since: u32,
}

static SINCE: core::sync::atomic::AtomicU32 = core::sync::atomic::AtomicU32::new(0);

impl Timer {
    /// There is one.
    pub fn take() -> Option<Self> {
        Some(Self { since: 0 })
    }

    /// `minstret` always counts.
    pub fn count(&mut self) {}

    /// From now on it interrupts.
    pub(crate) fn enable_interrupt(&mut self) {
        compare(u64::MAX);
        // Sound: who is called is there.
        unsafe {
            mie::set_mtimer();
            mstatus::set_mie();
        }
    }

    pub(crate) fn stop(&mut self) {
        // Sound: nobody waits for it.
        unsafe { mie::clear_mtimer() };
    }

    /// In an interrupt: the steps since it was armed.
    pub(crate) fn interrupted(&mut self, _armed: u32) -> u32 {
        now().wrapping_sub(self.since)
    }

    /// Interrupts after so many instructions.
    pub(crate) fn arm(&mut self, instructions: u32) -> u32 {
        let steps = u64::from((instructions + EXIT) / INSTRUCTIONS * STEPS);
        compare(time() + steps);
        self.since = now();
        SINCE.store(self.since, core::sync::atomic::Ordering::Relaxed);
        0
    }
}

fn time() -> u64 {
    // Sound: registers of the emulated machine. Read again if the lower half ran over.
    unsafe {
        loop {
            let (high, low) = (TIME.add(1).read_volatile(), TIME.read_volatile());
            if high == TIME.add(1).read_volatile() {
                return u64::from(high) << 32 | u64::from(low);
            }
        }
    }
}

fn compare(at: u64) {
    // Sound: as above. Never earlier than meant in between.
    unsafe {
        COMPARE.write_volatile(u32::MAX);
        COMPARE.add(1).write_volatile((at >> 32) as u32);
        COMPARE.write_volatile(at as u32);
    }
}

/// Steps since the timer was armed.
pub(crate) fn since_armed(_armed: u32) -> u32 {
    now().wrapping_sub(SINCE.load(core::sync::atomic::Ordering::Relaxed))
}

/// Instructions in so many steps.
pub(crate) fn instructions(steps: u32) -> u32 {
    steps / COUNTED
}

/// A count that rises with time.
#[inline(always)]
pub fn now() -> u32 {
    minstret::read() as u32
}

/// Twice as many instructions as `turns`.
#[inline(always)]
pub(crate) fn spend(turns: u32) {
    // Sound: counts a register down, two instructions a turn.
    unsafe {
        asm!("2:", "addi {turns}, {turns}, -1", "bnez {turns}, 2b", turns = inout(reg) turns => _,
            options(nomem, nostack))
    }
}

/// Until the next interrupt.
pub fn wait() {
    riscv::asm::wfi();
}

/// Where the stack ends now.
#[inline(always)]
pub(crate) fn stack_pointer() -> usize {
    let sp: usize;
    // Sound: reads a register.
    unsafe { asm!("mv {}, sp", out(reg) sp, options(nomem, nostack)) };
    sp
}

/// The interrupt. `riscv-rt` keeps the background's integer registers only: those of floats are kept here.
pub fn interrupt() {
    let mut kept = [0_u32; 21];
    let at = kept.as_mut_ptr();
    // Sound: writes the registers that a function may change into an array of as many words, and reads them again.
    unsafe {
        asm!(
            "fsw ft0, 0({at})", "fsw ft1, 4({at})", "fsw ft2, 8({at})", "fsw ft3, 12({at})",
            "fsw ft4, 16({at})", "fsw ft5, 20({at})", "fsw ft6, 24({at})", "fsw ft7, 28({at})",
            "fsw fa0, 32({at})", "fsw fa1, 36({at})", "fsw fa2, 40({at})", "fsw fa3, 44({at})",
            "fsw fa4, 48({at})", "fsw fa5, 52({at})", "fsw fa6, 56({at})", "fsw fa7, 60({at})",
            "fsw ft8, 64({at})", "fsw ft9, 68({at})", "fsw ft10, 72({at})", "fsw ft11, 76({at})",
            "frcsr {status}", "sw {status}, 80({at})",
            at = in(reg) at, status = out(reg) _,
        );
        crate::interrupt::tick();
        asm!(
            "flw ft0, 0({at})", "flw ft1, 4({at})", "flw ft2, 8({at})", "flw ft3, 12({at})",
            "flw ft4, 16({at})", "flw ft5, 20({at})", "flw ft6, 24({at})", "flw ft7, 28({at})",
            "flw fa0, 32({at})", "flw fa1, 36({at})", "flw fa2, 40({at})", "flw fa3, 44({at})",
            "flw fa4, 48({at})", "flw fa5, 52({at})", "flw fa6, 56({at})", "flw fa7, 60({at})",
            "flw ft8, 64({at})", "flw ft9, 68({at})", "flw ft10, 72({at})", "flw ft11, 76({at})",
            "lw {status}, 80({at})", "fscsr {status}",
            at = in(reg) at, status = out(reg) _,
        );
    }
}

/// Defines the interrupt, in the image's own crate: others have no use for it.
#[macro_export]
macro_rules! ticks_by_interrupt {
    () => {
        #[riscv_rt::core_interrupt(riscv::interrupt::Interrupt::MachineTimer)]
        fn machine_timer() {
            $crate::processor::interrupt();
        }
    };
}
