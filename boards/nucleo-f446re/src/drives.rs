//! The digital side of the drives: enables, their ready contacts, the emergency stop.
//!
//! Consumes four inputs per tick; produces three outputs. A few register accesses. Inputs have pull-ups and
//! low is healthy: a broken wire, a missing connector and a drive without supply all read as stop. The emergency
//! stop also interrupts when it opens, at most once a tick however often it bounces.
//!
//! This is not a safety function: the emergency stop must cut the drives' power by itself, and only tells the
//! firmware that it has.

use motion_kernel::fault::FaultKind;
use nucleo_f446re::machine::AXES;
use stm32f4xx_hal::gpio::{AnyPin, Input};

use crate::board::EnablePin;
use crate::emergency_stop::EmergencyStop;

/// The drives' wires.
pub(crate) struct Drives {
    pub(crate) enables: [EnablePin; AXES],
    pub(crate) ready: [AnyPin<Input>; AXES],
    pub(crate) emergency_stop: EmergencyStop,
}

impl Drives {
    /// As [`Drives::check`], from the emergency stop's interrupt.
    pub(crate) fn interrupt(&mut self) -> Option<FaultKind<f32>> {
        self.emergency_stop.take();
        self.check()
    }

    /// Once a tick: as [`Drives::check`]; from here on the emergency stop may interrupt.
    pub(crate) fn tick(&mut self) -> Option<FaultKind<f32>> {
        self.emergency_stop.arm();
        self.check()
    }

    /// The reason to stop, if any, the emergency stop first. If there is one, the drives are off when this
    /// returns, whatever else happens in the tick.
    fn check(&mut self) -> Option<FaultKind<f32>> {
        let fault = if self.emergency_stop.is_open() {
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
