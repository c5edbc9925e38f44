//! The serial console's bytes, from the tick to the background.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::Producer;
use nucleo_f446re::design_parameters::CONSOLE_BAUD;
use stm32f4xx_hal::gpio::{Alternate, PA3};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::{Rx, SerialExt};

/// Number of times that bytes were garbled, overrun, or found no room.
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);

/// The receiver behind its pin. Without its baud rate the board does not start.
pub(crate) fn open(port: USART2, receive: PA3<Alternate<7>>, rcc: &mut Rcc) -> Rx<USART2> {
    match port.rx(receive, CONSOLE_BAUD.bps(), rcc) {
        Ok(console) => console,
        Err(_) => defmt::panic!("console: {=u32} baud can't be had", CONSOLE_BAUD),
    }
}

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
