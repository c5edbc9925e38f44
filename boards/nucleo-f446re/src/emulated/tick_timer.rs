//! SysTick makes the tick in the place of TIM7, whose interrupt it pends.
//!
//! Its clock is the processor's 168 MHz, in the emulator's virtual time.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SYST};
use cortex_m_rt::exception;
use critical_section::Mutex;
use nucleo_f446re::design_parameters::TICK_CYCLES;
use stm32f4xx_hal::pac::Interrupt;

/// Events so far.
static EVENTS: AtomicU32 = AtomicU32::new(0);
/// The timer, for whoever stops it: tick and model.
static TIMER: Mutex<RefCell<Option<SYST>>> = Mutex::new(RefCell::new(None));

/// Cycles since the last event.
#[inline]
fn since_event() -> u32 {
    TICK_CYCLES - 1 - SYST::get_current()
}

/// Cycles since the start; it wraps.
#[inline]
pub(crate) fn cycles() -> u32 {
    EVENTS.load(Ordering::Relaxed).wrapping_mul(TICK_CYCLES).wrapping_add(since_event())
}

/// Does `work` in no time, and returns the cycles since the last event before it.
pub(crate) fn aside(work: impl FnOnce()) -> u32 {
    critical_section::with(|cs| {
        let mut timer = TIMER.borrow_ref_mut(cs);
        let since_event = since_event();
        if let Some(timer) = timer.as_mut() {
            timer.disable_counter();
        }
        work();
        if let Some(timer) = timer.as_mut() {
            timer.enable_counter();
        }
        since_event
    })
}

/// The tick's timer.
pub(crate) struct TickTimer;

impl TickTimer {
    /// The timer; it counts, and makes no ticks yet.
    pub(crate) fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(TICK_CYCLES - 1);
        timer.clear_current();
        timer.enable_counter();
        critical_section::with(|cs| TIMER.replace(cs, Some(timer)));
        Self
    }

    /// Starts it; the first tick comes one period from now.
    pub(crate) fn start(&mut self) {
        critical_section::with(|cs| {
            if let Some(timer) = TIMER.borrow_ref_mut(cs).as_mut() {
                timer.clear_current();
                timer.enable_interrupt();
            }
        });
    }

    /// The cycles since the event.
    pub(crate) fn take(&mut self) -> u32 {
        since_event()
    }

    /// Whether the next event has come already.
    pub(crate) fn due_again(&self) -> bool {
        cortex_m::peripheral::SCB::is_pendst_pending()
    }
}

#[exception]
fn SysTick() {
    EVENTS.store(EVENTS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    NVIC::pend(Interrupt::TIM7);
}
