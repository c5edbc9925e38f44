//! The serial console's bytes, from the tick to the background.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::Producer;
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::Rx;

/// Number of times that bytes were garbled, overrun, or found no room.
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);

/// Takes the byte that has come since the tick before, if any: two can't come within a tick.
pub(crate) fn receive(port: &mut Rx<USART2>, bytes: &mut Producer<'static, u8>) {
    let is_lost = match port.read() {
        Ok(byte) => bytes.enqueue(byte).is_err(),
        Err(nb::Error::WouldBlock) => false,
        Err(nb::Error::Other(_)) => true,
    };
    if is_lost {
        LOST.store(LOST.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
    }
}
