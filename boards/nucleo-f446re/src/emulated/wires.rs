//! The wires that the emulator lacks, or that the model has to see: bus and SYNC of the converter, enables, scope, button.

use core::sync::atomic::{AtomicU32, Ordering};

use embedded_hal::spi::{ErrorType, SpiBus};
use stm32f4xx_hal::gpio::{AnyPin, Output, PA10, PB12, PinState};
use stm32f4xx_hal::pac::SPI2;
use stm32f4xx_hal::spi::{self, Spi};

use super::{emergency_stop, model, script};

/// The bytes since SYNC fell, after a 1.
static FRAME: AtomicU32 = AtomicU32::new(0);

/// SPI2, and what goes over it.
pub(crate) struct Bus(pub(crate) Spi<SPI2>);

impl ErrorType for Bus {
    type Error = spi::Error;
}

impl SpiBus for Bus {
    fn read(&mut self, words: &mut [u8]) -> Result<(), spi::Error> {
        SpiBus::read(&mut self.0, words)
    }

    fn write(&mut self, words: &[u8]) -> Result<(), spi::Error> {
        for &word in words {
            FRAME.store(FRAME.load(Ordering::Relaxed) << 8 | u32::from(word), Ordering::Relaxed);
        }
        SpiBus::write(&mut self.0, words)
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), spi::Error> {
        SpiBus::transfer(&mut self.0, read, write)
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), spi::Error> {
        SpiBus::transfer_in_place(&mut self.0, words)
    }

    fn flush(&mut self) -> Result<(), spi::Error> {
        SpiBus::flush(&mut self.0)
    }
}

/// SYNC: what it encloses is a frame.
pub(crate) struct SyncPin(pub(crate) PB12<Output>);

impl SyncPin {
    pub(crate) fn set_low(&mut self) {
        self.0.set_low();
        FRAME.store(1, Ordering::Relaxed);
    }

    pub(crate) fn set_high(&mut self) {
        // Also set at the start, when it was not low.
        let frame = FRAME.swap(0, Ordering::Relaxed);
        if frame != 0 {
            model::frame(frame);
        }
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
    pub(crate) fn is_low(&mut self) -> bool {
        script::is_button_down()
    }
}
