//! The kernel's traits on this board's hardware.
//!
//! In the tick. Encoders and enables can't fail; there are no axis inputs; the converter fails with its bus.

use core::convert::Infallible;

use motion_kernel::hal::{DriveEnable, Encoder, Inputs, MachineInputs, OutputState, VelocityChannel};
use motion_kernel::units::{Counts, DacCode};
use nucleo_f446re::machine::AXES;

use crate::dac::Outputs;
use crate::drives::Drives;
use crate::encoders::Encoders;
use crate::spindle::SpindleAndCoolant;

/// The hardware that the tick drives.
pub(crate) struct Hardware {
    pub(crate) encoders: Encoders,
    pub(crate) outputs: Outputs,
    pub(crate) drives: Drives,
    pub(crate) spindle_and_coolant: SpindleAndCoolant,
}

impl Encoder<AXES> for Hardware {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        Ok(self.encoders.latch())
    }
}

impl Inputs<AXES> for Hardware {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        Ok(MachineInputs::HEALTHY)
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

impl motion_kernel::hal::Outputs for Hardware {
    fn switch(&mut self, to: &OutputState) {
        self.spindle_and_coolant.switch(to);
    }
}
