//! Who watches the supply and the clock.
//!
//! Sets three detectors up, once, before anything is enabled:
//!
//! - brown-out reset at its highest level: below it the processor is held in reset, and pull-downs hold the enables;
//! - the voltage detector just above it: an interrupt, while the processor still works to its specification;
//! - the clock's security: if the ST-LINK's clock fails, the processor goes on with its own and takes an NMI.
//!
//! Registers: RM0390, embedded flash (option bytes), PWR_CR, EXTI, RCC_CR.

use defmt::info;
use nucleo_f446re::design_parameters::{BROWN_OUT_BITS, VOLTAGE_DETECTOR_LEVEL};
use stm32f4xx_hal::pac::{EXTI, FLASH, PWR};
use stm32f4xx_hal::rcc::Rcc;

/// They open the option bytes (RM0390, FLASH_OPTKEYR).
const OPTION_KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];

/// Sets all three up. Waits while the supply is too low.
pub(crate) fn watch(flash: &FLASH, power: &PWR, lines: &EXTI, rcc: &mut Rcc) {
    rcc.apb1enr().modify(|_, w| w.pwren().set_bit());
    power.cr().modify(|_, w| w.pls().set(VOLTAGE_DETECTOR_LEVEL).pvde().set_bit());
    // Rising is the detector's output: the supply falls. Listened to before the supply is looked at, so that no edge is missed.
    lines.rtsr().modify(|_, w| w.tr16().enabled());
    lines.imr().modify(|_, w| w.mr16().unmasked());
    // The detector needs a moment.
    cortex_m::asm::delay(rcc.clocks.sysclk().raw() / 1000);
    while power.csr().read().pvdo().bit_is_set() {}
    rcc.cr().modify(|_, w| w.csson().on());
    // Only with a supply that is good: programming must not be cut.
    set_brown_out(flash);
}

/// Writes the option byte, once in the life of a board. It holds from the next reset on.
fn set_brown_out(flash: &FLASH) {
    if u8::from(flash.optcr().read().bor_lev().variant()) == BROWN_OUT_BITS {
        return;
    }
    for key in OPTION_KEYS {
        flash.optkeyr().write(|w| w.optkeyr().set(key));
    }
    // The PAC's names count the other way round: it calls 00 off.
    flash.optcr().modify(|_, w| w.bor_lev().set(BROWN_OUT_BITS));
    flash.optcr().modify(|_, w| w.optstrt().set_bit());
    while flash.sr().read().bsy().bit_is_set() {}
    flash.optcr().modify(|_, w| w.optlock().set_bit());
    info!("brown-out reset at its highest level from the next reset on");
}
