//! The kernel's three traits on this board's hardware.
//!
//! In the tick. Encoders and enables can't fail; the converter fails with its bus.

use core::convert::Infallible;

use motion_kernel::hal::{DriveEnable, Encoder, VelocityChannel};
use motion_kernel::units::{Counts, DacCode};
use nucleo_f446re::machine::AXES;

use crate::dac::Outputs;
use crate::drives::Drives;
use crate::encoders::Encoders;

/// What the tick drives.
pub(crate) struct Hardware {
    pub(crate) encoders: Encoders,
    pub(crate) outputs: Outputs,
    pub(crate) drives: Drives,
}

impl Encoder<AXES> for Hardware {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        Ok(self.encoders.latch())
    }
}

impl VelocityChannel<AXES> for Hardware {
    type Error = <Outputs as VelocityChannel<AXES>>::Error;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        self.outputs.write(codes)
    }
}

impl DriveEnable<AXES> for Hardware {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.drives.switch(enabled);
        Ok(())
    }
}
