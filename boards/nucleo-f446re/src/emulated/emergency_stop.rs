//! The emergency stop, opened by the script, which pends its interrupt too.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use stm32f4xx_hal::pac::Interrupt;

use super::tick_timer::cycles;

static IS_OPEN: AtomicBool = AtomicBool::new(false);
static OPENED: AtomicU32 = AtomicU32::new(0);

/// Opens its contact, somewhere between two ticks.
pub(super) fn open() {
    IS_OPEN.store(true, Ordering::Relaxed);
    OPENED.store(cycles(), Ordering::Relaxed);
    NVIC::pend(Interrupt::EXTI2);
}

/// Cycles since it was opened, if it is.
pub(super) fn since_opened() -> Option<u32> {
    IS_OPEN.load(Ordering::Relaxed).then(|| cycles().wrapping_sub(OPENED.load(Ordering::Relaxed)))
}

/// The input.
pub(crate) struct EmergencyStop;

impl EmergencyStop {
    /// Whether its contact is open now.
    pub(crate) fn is_open(&self) -> bool {
        IS_OPEN.load(Ordering::Relaxed)
    }

    pub(crate) fn arm(&mut self) {}

    pub(crate) fn take(&mut self) {}
}
