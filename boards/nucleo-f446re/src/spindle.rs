//! Two outputs: spindle on, coolant on.
//!
//! In the tick; two register accesses. The spindle has one direction and no speed: its drive has to be set to the speed
//! of the program, which the log says. Either kind of coolant switches the one output.

use motion_kernel::hal::{OutputState, Spindle};
use stm32f4xx_hal::gpio::{AnyPin, Output};

/// The wires of spindle and coolant.
pub(crate) struct SpindleAndCoolant {
    pub(crate) spindle: AnyPin<Output>,
    pub(crate) coolant: AnyPin<Output>,
}

impl SpindleAndCoolant {
    /// Switches both.
    pub(crate) fn switch(&mut self, to: &OutputState) {
        // Programs that turn it the other way round are refused.
        self.spindle.set_state((to.spindle == Spindle::Clockwise).into());
        self.coolant.set_state(to.coolant_flows().into());
    }
}
