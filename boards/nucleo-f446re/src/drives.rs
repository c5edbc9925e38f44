//! The digital side of the drives: enables, their ready contacts, the emergency stop.
//!
//! Consumes four inputs per tick; produces three outputs. A few register accesses. Inputs have pull-ups and
//! low is healthy: a broken wire, a missing connector and a drive without supply all read as stop.
//!
//! This is not a safety function: the emergency stop must cut the drives' power by itself, and only tells the
//! firmware that it has.

use motion_kernel::fault::FaultKind;
use nucleo_f446re::machine::AXES;
use stm32f4xx_hal::gpio::{AnyPin, Input, Output};

/// The drives' wires.
pub(crate) struct Drives {
    pub(crate) enables: [AnyPin<Output>; AXES],
    pub(crate) ready: [AnyPin<Input>; AXES],
    pub(crate) emergency_stop: AnyPin<Input>,
}

impl Drives {
    /// The reason to stop, if any, the emergency stop first. If there is one, the drives are off when this
    /// returns, whatever else happens in the tick.
    pub(crate) fn check(&mut self) -> Option<FaultKind<f32>> {
        let fault = if self.emergency_stop.is_high() {
            Some(FaultKind::EmergencyStop)
        } else {
            self.ready.iter().position(AnyPin::is_high).map(|axis| FaultKind::Drive { axis })
        };
        if fault.is_some() {
            self.switch(false);
        }
        fault
    }

    /// Switches all enables.
    pub(crate) fn switch(&mut self, enabled: bool) {
        for enable in &mut self.enables {
            enable.set_state(enabled.into());
        }
    }
}
