//! Flash in memory, as the emulator's flash is not written by a program: two sectors that a reset leaves as they are.

use core::sync::atomic::{AtomicU8, Ordering};

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

/// With room for the longest record alone, as memory is short.
const SECTOR: usize = 1088;
const BYTES: usize = 2 * SECTOR;

// Not initialised, as flash.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.FLASH")]
static MEMORY: [AtomicU8; BYTES] = [const { AtomicU8::new(0) }; BYTES];

pub(super) struct Flash;

impl Flash {
    fn part(from: u32, length: usize) -> Result<&'static [AtomicU8], NorFlashErrorKind> {
        let from = from as usize;
        MEMORY.get(from..from + length).ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let part = Self::part(offset, bytes.len())?;
        for (byte, from) in bytes.iter_mut().zip(part) {
            *byte = from.load(Ordering::Relaxed);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        for byte in Self::part(from, to.saturating_sub(from) as usize)? {
            byte.store(0xff, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Clears bits, as flash does.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        for (place, byte) in Self::part(offset, bytes.len())?.iter().zip(bytes) {
            place.fetch_and(*byte, Ordering::Relaxed);
        }
        Ok(())
    }
}
