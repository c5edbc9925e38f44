//! The link's bytes without DMA, which the emulator lacks: polled. It keeps a byte until the one before is read, and takes one
//! to send at any time, so nothing is lost.

use motion_kernel::link::FRAME_MAX;
use stm32f4xx_hal::pac::USART2;

/// Both ends of the line.
pub(crate) struct LinkPort {
    port: USART2,
    frame: [u8; FRAME_MAX],
}

impl LinkPort {
    pub(super) fn new(port: USART2) -> Self {
        Self { port, frame: [0; FRAME_MAX] }
    }

    /// Whether a byte has come.
    pub(crate) fn has_come(&self) -> bool {
        self.port.sr().read().rxne().bit_is_set()
    }

    /// How often bytes were lost.
    pub(crate) fn lost(&self) -> u32 {
        0
    }

    /// The next byte.
    pub(crate) fn next_byte(&mut self) -> Option<u8> {
        self.has_come().then(|| self.port.dr().read().dr().bits() as u8)
    }

    /// Sends what `write` writes: so many bytes, 0 for none.
    pub(crate) fn send(&mut self, write: impl FnOnce(&mut [u8]) -> usize) {
        let length = write(&mut self.frame);
        for &byte in self.frame.iter().take(length) {
            self.port.dr().write(|w| w.dr().set(byte.into()));
        }
    }
}
