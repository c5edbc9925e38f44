//! The processor's flash, as a start finds it: parameters that are read and written before anything else runs.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use nucleo_f446re::design_parameters::PARAMETER_SECTORS;
use stm32f4xx_hal::flash::{self, FlashExt, UnlockedFlash};
use stm32f4xx_hal::pac::FLASH;

/// Where the code begins, as the linker has it.
const CODE_BEGIN: u32 = match u32::from_str_radix(env!("MOTION_CODE_BEGIN"), 10) {
    Ok(begin) => begin,
    Err(_) => panic!("a number"),
};
const _: () = assert!(
    PARAMETER_SECTORS.end == CODE_BEGIN && PARAMETER_SECTORS.end <= 0x1_0000,
    "parameters are before the code, in sectors of 16 KiB"
);

/// The processor's flash where its sectors are small, for which the HAL has the size of the largest.
struct SmallSectors<'a>(UnlockedFlash<'a>);

impl ErrorType for SmallSectors<'_> {
    type Error = flash::Error;
}

impl ReadNorFlash for SmallSectors<'_> {
    const READ_SIZE: usize = UnlockedFlash::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for SmallSectors<'_> {
    const WRITE_SIZE: usize = UnlockedFlash::WRITE_SIZE;
    const ERASE_SIZE: usize = 16 * 1024;

    /// Sector by sector, each of its own size.
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        NorFlash::erase(&mut self.0, from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0.write(offset, bytes)
    }
}

/// The parameters; new ones are written to flash, which takes 0.8 s at most (DS10693, flash memory characteristics: erase of
/// 16 KiB, byte by byte).
pub(crate) fn parameters(mut flash: FLASH) -> &'static [u8] {
    // The data cache does not see an erase: it is off meanwhile, and empty afterwards (RM0390, section 3.4.2).
    flash.acr().modify(|_, w| w.dcen().clear_bit());
    let parameters = crate::stored::parameters(SmallSectors(flash.unlocked()));
    flash.acr().modify(|_, w| w.dcrst().set_bit());
    flash.acr().modify(|_, w| w.dcrst().clear_bit());
    flash.acr().modify(|_, w| w.dcen().set_bit());
    parameters
}
