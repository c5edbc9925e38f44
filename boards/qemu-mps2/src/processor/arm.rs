//! A Cortex-M: SysTick counts instructions and makes the ticks.

use core::arch::asm;

use cortex_m::peripheral::{SCB, SYST, syst::SystClkSource};
pub use cortex_m_rt::entry;

/// Until this the timer counts, and from 0 on again.
pub const WRAP: u32 = 0x00FF_FFFF;
/// Steps of the timer in as many instructions, as the emulator is told (`-icount shift=6`): 25 MHz, 64 ns each.
const STEPS: u32 = 8;
const INSTRUCTIONS: u32 = 5;

/// The timer.
pub struct Timer(SYST);

impl Timer {
    /// There is one.
    pub fn take() -> Option<Self> {
        let mut timer = cortex_m::Peripherals::take()?.SYST;
        timer.set_clock_source(SystClkSource::Core);
        Some(Self(timer))
    }

    /// Starts it for counting, [`WRAP`] steps long.
    pub fn count(&mut self) {
        self.start(WRAP);
    }

    /// From now on it interrupts.
    pub(crate) fn enable_interrupt(&mut self) {
        self.0.enable_interrupt();
    }

    pub(crate) fn stop(&mut self) {
        self.0.disable_interrupt();
        self.0.disable_counter();
    }

    /// In an interrupt: stops and returns the steps since it was armed for as many; then counts.
    pub(crate) fn interrupted(&mut self, armed: u32) -> u32 {
        self.0.disable_counter();
        let passed = armed + begun(armed);
        self.count();
        passed
    }

    /// Interrupts after so many instructions; returns the steps.
    pub(crate) fn arm(&mut self, instructions: u32) -> u32 {
        let steps = (instructions / INSTRUCTIONS * STEPS).clamp(STEPS, WRAP);
        self.start(steps);
        steps
    }

    fn start(&mut self, steps: u32) {
        self.0.set_reload(steps);
        self.0.clear_current();
        self.0.enable_counter();
    }
}

/// Steps since the timer was armed for as many, with interrupts masked.
pub(crate) fn since_armed(armed: u32) -> u32 {
    let before = begun(armed);
    // If the interrupt is due, it has begun anew.
    if SCB::is_pendst_pending() { armed + begun(armed) } else { before }
}

fn begun(armed: u32) -> u32 {
    armed.saturating_sub(SYST::get_current())
}

/// Instructions in so many steps.
pub(crate) fn instructions(steps: u32) -> u32 {
    steps / STEPS * INSTRUCTIONS
}

/// A count that rises with time; it wraps after [`WRAP`].
#[inline(always)]
pub fn now() -> u32 {
    WRAP - SYST::get_current()
}

/// Twice as many instructions as `turns`.
#[inline(always)]
pub(crate) fn spend(turns: u32) {
    // Sound: counts a register down, two instructions a turn.
    unsafe {
        asm!("2:", "subs {turns}, {turns}, #1", "bne 2b", turns = inout(reg) turns => _, options(nomem, nostack))
    }
}

/// Until the next interrupt.
pub fn wait() {
    cortex_m::asm::wfi();
}

/// Where the stack ends now.
#[inline(always)]
pub(crate) fn stack_pointer() -> usize {
    cortex_m::register::msp::read() as usize
}

/// Defines the interrupt, in the image's own crate: others have no use for it.
#[macro_export]
macro_rules! ticks_by_interrupt {
    () => {
        #[cortex_m_rt::exception]
        fn SysTick() {
            $crate::interrupt::tick();
        }
    };
}
