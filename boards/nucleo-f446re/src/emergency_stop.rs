//! The emergency stop's input and its interrupt.
//!
//! Consumes a level, and its rising edge. After an interrupt the line is off until the next tick arms it again.

use stm32f4xx_hal::gpio::{Edge, ExtiPin, Input, PD2};
use stm32f4xx_hal::pac::EXTI;
use stm32f4xx_hal::syscfg::SysCfg;

/// The emergency stop's input, and its line of the interrupt controller (EXTI2).
pub(crate) struct EmergencyStop {
    pin: PD2<Input>,
    lines: EXTI,
    is_armed: bool,
}

impl EmergencyStop {
    /// The input; it interrupts at rising edges, as soon as interrupts are on.
    pub(crate) fn new(mut pin: PD2<Input>, mut lines: EXTI, routing: &mut SysCfg) -> Self {
        pin.make_interrupt_source(routing);
        pin.trigger_on_edge(&mut lines, Edge::Rising);
        pin.enable_interrupt(&mut lines);
        Self { pin, lines, is_armed: true }
    }

    /// Whether its contact is open now.
    pub(crate) fn is_open(&self) -> bool {
        self.pin.is_high()
    }

    /// Lets it interrupt again.
    #[inline]
    pub(crate) fn arm(&mut self) {
        if !self.is_armed {
            self.is_armed = true;
            self.pin.clear_interrupt_pending_bit();
            self.pin.enable_interrupt(&mut self.lines);
        }
    }

    /// Takes the interrupt; the next one comes after [`EmergencyStop::arm`].
    pub(crate) fn take(&mut self) {
        self.is_armed = false;
        self.pin.disable_interrupt(&mut self.lines);
        self.pin.clear_interrupt_pending_bit();
    }
}
