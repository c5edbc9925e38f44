//! The end of everything: enables and outputs off, before anything else, and then nothing more.
//!
//! Panics, hard faults, the loss of the clock and a falling supply end here. Whoever owned the pins may have been
//! interrupted anywhere, so this takes them without asking: a few register writes that are right in any state. The
//! watchdog is no longer fed and resets the board within 10 ms. Before it runs nothing is enabled; then the board
//! waits here for a reset.
//!
//! The only `unsafe` of the firmware: the peripherals are taken a second time, which nothing survives, and the
//! processor's handlers of hard faults and NMIs have to be declared so.
#![allow(unsafe_code)]

use core::fmt::Arguments;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};
use nucleo_f446re::design_parameters::{DAC_CLEAR_FRAME, SPI_WAIT_TURNS, SYNC_HIGH_CYCLES};
use nucleo_f446re::pins::{SYNC_MASK, switching_outputs};
use stm32f4xx_hal::pac::{Peripherals, SPI2};

use crate::board::write_end;

/// Of each port, the outputs that switch something on.
const SWITCHING_B: u32 = switching_outputs(b'B');
const SWITCHING_C: u32 = switching_outputs(b'C');

/// Everything off; then the reason goes to the log, and the processor waits for the watchdog.
pub(crate) fn stop(why: &str) -> ! {
    all_off();
    end(format_args!("{why}"))
}

/// Logs, unless the log is what has failed, and waits for the watchdog.
fn end(why: Arguments<'_>) -> ! {
    static HAS_ENDED: AtomicBool = AtomicBool::new(false);
    if !HAS_ENDED.load(Ordering::Relaxed) {
        HAS_ENDED.store(true, Ordering::Relaxed);
        write_end(why);
    }
    loop {
        cortex_m::asm::nop();
    }
}

/// Drops the enables, spindle and coolant, then puts the converter to 0 V: some 10 µs.
fn all_off() {
    cortex_m::interrupt::disable();
    // Sound: with interrupts masked nothing else uses a peripheral from here on, ever.
    let Peripherals { GPIOB: port_b, GPIOC: port_c, SPI2: spi, .. } = unsafe { Peripherals::steal() };
    // Sound: in these registers every bit may be written; a 0 changes nothing, the upper half switches to low.
    port_c.bsrr().write(|w| unsafe { w.bits(SWITCHING_C << 16) });
    port_b.bsrr().write(|w| unsafe { w.bits(SWITCHING_B << 16) });
    // Not set up yet: after a supply that comes up the converter is at 0 V, after a reset it keeps its voltage until it is.
    if spi.cr1().read().spe().bit_is_clear() {
        return;
    }
    // A frame that is cut here has less than 24 bits, and the converter ignores it.
    port_b.bsrr().write(|w| unsafe { w.bits(SYNC_MASK) });
    wait_for(&spi, |spi| spi.sr().read().bsy().bit_is_clear());
    cortex_m::asm::delay(SYNC_HIGH_CYCLES);
    port_b.bsrr().write(|w| unsafe { w.bits(SYNC_MASK << 16) });
    for byte in DAC_CLEAR_FRAME {
        wait_for(&spi, |spi| spi.sr().read().txe().bit_is_set());
        spi.dr().write(|w| w.dr().set(byte.into()));
    }
    wait_for(&spi, |spi| spi.sr().read().txe().bit_is_set());
    wait_for(&spi, |spi| spi.sr().read().bsy().bit_is_clear());
    port_b.bsrr().write(|w| unsafe { w.bits(SYNC_MASK) });
}

/// Waits, but not forever: a bus that does not answer is no reason to stay with the enables' log unsaid.
fn wait_for(spi: &SPI2, is_done: impl Fn(&SPI2) -> bool) {
    for _ in 0..SPI_WAIT_TURNS {
        if is_done(spi) {
            return;
        }
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    all_off();
    end(format_args!("{info}"))
}

/// `defmt` has logged its own message; a second one would say less.
#[defmt::panic_handler]
fn panicked() -> ! {
    all_off();
    end(format_args!("see above"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    all_off();
    end(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()))
}

/// The clock's security: nothing else here makes an NMI.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    stop("the clock of the ST-LINK has failed")
}
