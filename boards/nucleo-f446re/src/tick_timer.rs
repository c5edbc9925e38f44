//! The timer that makes the tick: TIM7, a basic timer that can do nothing else.
//!
//! Produces an interrupt every period. Its counter continues from the event, so it tells the tick how late it
//! began; a second event before the tick is done is an overrun. Registers: RM0390, basic timers.

use cortex_m::peripheral::DWT;
use nucleo_f446re::design_parameters::{APB1_TIMER_HZ, SYSCLK_HZ, TICK_TIMER_PRESCALER, TICK_TIMER_RELOAD};
use stm32f4xx_hal::pac::TIM7;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Core cycles since the start; it wraps.
#[inline]
pub(crate) fn cycles() -> u32 {
    DWT::cycle_count()
}

/// Core cycles per count of the timer.
const CYCLES_PER_COUNT: u32 = SYSCLK_HZ / APB1_TIMER_HZ;

/// The tick's timer.
pub(crate) struct TickTimer {
    timer: TIM7,
}

impl TickTimer {
    /// The timer, configured and stopped.
    pub(crate) fn new(timer: TIM7, rcc: &mut Rcc) -> Self {
        TIM7::enable(rcc);
        TIM7::reset(rcc);
        timer.psc().write(|w| w.psc().set(TICK_TIMER_PRESCALER));
        timer.arr().write(|w| w.arr().set(TICK_TIMER_RELOAD));
        // Loads the prescaler; the event that this makes is not a tick.
        timer.egr().write(|w| w.ug().set_bit());
        timer.sr().write(|w| w.uif().clear_bit());
        timer.dier().write(|w| w.uie().set_bit());
        Self { timer }
    }

    /// Starts it; the first tick comes one period from now.
    pub(crate) fn start(&mut self) {
        self.timer.cr1().modify(|_, w| w.cen().set_bit());
    }

    /// Takes the event; returns the core cycles since it happened. Called at the beginning of the tick, so
    /// that the interrupt is no longer pending long before the tick returns.
    pub(crate) fn take(&mut self) -> u32 {
        let counts = u32::from(self.timer.cnt().read().cnt().bits());
        self.timer.sr().write(|w| w.uif().clear_bit());
        counts * CYCLES_PER_COUNT
    }

    /// Whether the next event has come already.
    pub(crate) fn due_again(&self) -> bool {
        self.timer.sr().read().uif().bit_is_set()
    }
}
