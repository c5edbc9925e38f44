//! The kernel's traits on this board's hardware.
//!
//! In the tick. Encoders, inputs and enables can't fail; the converter fails with its bus.

use core::convert::Infallible;

use motion_kernel::fault::FaultKind;
use motion_kernel::hal::{
    DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, OutputState, VelocityChannel,
};
use motion_kernel::units::{Counts, DacCode};
use nucleo_f446re::machine::AXES;

use crate::dac::Outputs;
use crate::drives::Drives;
use crate::encoders::{Encoders, NoIndex};
use crate::spindle::SpindleAndCoolant;
use crate::switches::Switches;

/// The hardware that the tick drives.
pub(crate) struct Hardware {
    pub(crate) encoders: Encoders,
    pub(crate) outputs: Outputs,
    pub(crate) drives: Drives,
    pub(crate) switches: Switches,
    pub(crate) spindle_and_coolant: SpindleAndCoolant,
}

impl Hardware {
    /// The emergency stop's interrupt: if the stop, or a ready contact, is still open, enables are off and outputs
    /// at 0 V when this returns, and the fault is returned. A pulse that is over by now is none.
    pub(crate) fn interrupt(&mut self) -> Option<FaultKind<f32>> {
        let fault = self.drives.interrupt();
        if fault.is_some() {
            // If the bus fails, the next tick finds it too, and reports it.
            let _ = self.outputs.write(&[DacCode::ZERO; AXES]);
        }
        fault
    }
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
        Ok(self.switches.read())
    }
}

impl IndexLatch for Hardware {
    type Error = NoIndex;

    fn arm(&mut self, axis: usize) -> Result<(), NoIndex> {
        self.encoders.arm_index(axis)
    }

    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, NoIndex> {
        self.encoders.index(axis)
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
