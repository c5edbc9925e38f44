//! The AD5754 on SPI2: bus, chip select, and the kernel's adapter over them.
//!
//! Consumes pins; produces the outputs of three axes, at 0 V. Four frames per tick, each with its own SYNC;
//! the last one loads all outputs at once (LDAC is wired high). The registers are used directly: the HAL's driver and
//! a device over it take four times the instructions for twelve bytes. Polled: while a frame leaves, the processor
//! waits. It can't hang the board: this side clocks the bus, and the watchdog backs it up.

use embedded_hal::spi::{Error, ErrorKind, ErrorType, MODE_1, Mode, Operation, SpiDevice};
use motion_kernel::hal::Ad5754Output;
use nucleo_f446re::design_parameters::SYNC_HIGH_CYCLES;
use nucleo_f446re::machine::AXES;
use stm32f4xx_hal::pac::SPI2;
use stm32f4xx_hal::spi::Spi;

use crate::board::{Bus, SyncPin};
use crate::tick_timer::cycles;

/// The converter takes a bit at every falling edge of SCLK, 24 of them while SYNC is low (AD5754, serial
/// interface, standalone operation). Modes 1 and 2 both do that. Mode 1 is used: its clock rests low, so the
/// 24th falling edge is the last edge, and no clock edge is left when SYNC rises.
pub(crate) const MODE: Mode = MODE_1;

/// SPI2, which only sends. (Nothing is wired to its input, so what it receives is not looked at.)
pub(crate) struct Sender(SPI2);

impl Sender {
    /// The bus that the HAL has set up.
    pub(crate) fn new(spi: Spi<SPI2>) -> Self {
        Self(spi.release().0)
    }

    /// Sends a byte, as soon as there is room for it.
    #[inline]
    pub(crate) fn send(&mut self, byte: u8) {
        while self.0.sr().read().txe().bit_is_clear() {}
        self.0.dr().write(|w| w.dr().set(byte.into()));
    }

    /// Waits until the last byte has left (RM0390, SPI: TXE, then BSY).
    #[inline]
    pub(crate) fn finish(&mut self) {
        while self.0.sr().read().txe().bit_is_clear() {}
        while self.0.sr().read().bsy().bit_is_set() {}
    }
}

/// The converter on a bus of its own.
pub(crate) struct Device {
    bus: Bus,
    sync: SyncPin,
    /// When SYNC has risen last \[cycles\].
    risen: u32,
}

impl Device {
    /// The converter behind `bus`; SYNC is high.
    pub(crate) fn new(bus: Bus, sync: SyncPin) -> Self {
        Self { bus, sync, risen: cycles() }
    }
}

/// Something else than a write was asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnlySends;

impl Error for OnlySends {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for Device {
    type Error = OnlySends;
}

impl SpiDevice for Device {
    #[inline]
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), OnlySends> {
        // SYNC stays high for as long as the converter needs between two frames. Nearly always it has been already.
        while cycles().wrapping_sub(self.risen) < SYNC_HIGH_CYCLES {}
        self.sync.set_low();
        let sent = operations.iter().try_for_each(|operation| match operation {
            Operation::Write(bytes) => {
                bytes.iter().for_each(|&byte| self.bus.send(byte));
                Ok(())
            }
            _ => Err(OnlySends),
        });
        self.bus.finish();
        self.sync.set_high();
        self.risen = cycles();
        sent
    }
}

/// The outputs of all axes.
pub(crate) type Outputs = Ad5754Output<Device, AXES>;
