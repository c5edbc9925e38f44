//! The wires that the emulator lacks, or that the model has to see: bus and SYNC of the converter, enables, scope, button.

use core::sync::atomic::{AtomicU32, Ordering};

use stm32f4xx_hal::gpio::{AnyPin, Output, PA10, PB12, PinState};

use super::{emergency_stop, model, script};
use crate::dac::Sender;

/// What the bus has sent since SYNC fell: a 1 and the bytes.
static FRAME: AtomicU32 = AtomicU32::new(0);

/// SPI2, and what goes over it.
pub(crate) struct Bus {
    sender: Sender,
    frame: u32,
}

impl Bus {
    pub(crate) fn new(sender: Sender) -> Self {
        Self { sender, frame: 1 }
    }

    #[inline]
    pub(crate) fn send(&mut self, byte: u8) {
        self.frame = self.frame << 8 | u32::from(byte);
        self.sender.send(byte);
    }

    #[inline]
    pub(crate) fn finish(&mut self) {
        self.sender.finish();
        FRAME.store(self.frame, Ordering::Relaxed);
        self.frame = 1;
    }
}

/// SYNC: what it encloses is a frame.
pub(crate) struct SyncPin(pub(crate) PB12<Output>);

impl SyncPin {
    pub(crate) fn set_low(&mut self) {
        self.0.set_low();
        FRAME.store(0, Ordering::Relaxed);
    }

    pub(crate) fn set_high(&mut self) {
        model::frame(FRAME.load(Ordering::Relaxed));
        self.0.set_high();
    }
}

/// The enable of an axis.
pub(crate) struct EnablePin {
    pub(crate) pin: AnyPin<Output>,
    pub(crate) axis: usize,
}

impl EnablePin {
    pub(crate) fn set_state(&mut self, state: PinState) {
        self.pin.set_state(state);
        model::enable(self.axis, state == PinState::High, emergency_stop::since_opened());
    }
}

/// The scope's output: its falling edge ends the tick.
pub(crate) struct ScopePin(pub(crate) PA10<Output>);

impl ScopePin {
    pub(crate) fn set_high(&mut self) {
        self.0.set_high();
    }

    pub(crate) fn set_low(&mut self) {
        self.0.set_low();
        model::end_of_tick();
    }
}

/// The button, pressed by the script.
pub(crate) struct ButtonPin;

impl ButtonPin {
    pub(crate) fn is_low(&self) -> bool {
        script::is_button_down()
    }
}
