//! The AD5754 on SPI2: bus, chip select, and the kernel's adapter over them.
//!
//! Consumes pins; produces the outputs of three axes, at 0 V. Four frames per tick, each with its own SYNC;
//! the last one loads all outputs at once (LDAC is wired high). Polled: during a burst the processor has
//! nothing else to do in the tick, and setting up DMA would cost as much. It can't hang the board: this side
//! clocks the bus, and the watchdog backs it up.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal::spi::{MODE_1, Mode};
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use motion_kernel::hal::Ad5754Output;
use nucleo_f446re::design_parameters::SYNC_HIGH_CYCLES;
use nucleo_f446re::machine::AXES;

use crate::board::{Bus, SyncPin};

/// The converter takes a bit at every falling edge of SCLK, 24 of them while SYNC is low (AD5754, serial
/// interface, standalone operation). Modes 1 and 2 both do that. Mode 1 is used: its clock rests low, so the
/// 24th falling edge is the last edge, and no clock edge is left when SYNC rises.
pub(crate) const MODE: Mode = MODE_1;

/// SYNC, which stays high for as long as the converter needs between two frames.
pub(crate) struct Sync(pub(crate) SyncPin);

impl ErrorType for Sync {
    type Error = Infallible;
}

impl OutputPin for Sync {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set_low();
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set_high();
        cortex_m::asm::delay(SYNC_HIGH_CYCLES);
        Ok(())
    }
}

/// The converter on a bus of its own.
pub(crate) type Device = ExclusiveDevice<Bus, Sync, NoDelay>;

/// The outputs of all axes.
pub(crate) type Outputs = Ad5754Output<Device, AXES>;
