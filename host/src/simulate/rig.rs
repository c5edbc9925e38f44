//! The simulated machine as the kernel's hardware: encoders, inputs and enable from hal-sim, the velocity
//! outputs through the converter's adapter and real SPI frames.

use core::convert::Infallible;

use hal_sim::{Ad5754Chip, ChipError, Injection, Injector, SimMachine};
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel,
};
use motion_kernel::units::{Counts, DacCode};

use crate::machine::DEAD_TIME_CELLS;
use crate::record::AXES;

/// The simulated machine, with room for every dead time a machine file may ask for.
pub type Simulated = SimMachine<AXES, DEAD_TIME_CELLS>;

/// The machine and the adapter that talks to its converter.
pub struct Rig<'a> {
    machine: &'a Simulated,
    outputs: Ad5754Output<&'a Ad5754Chip, AXES>,
    /// What is broken.
    pub injector: Injector<AXES>,
}

impl<'a> Rig<'a> {
    /// Sets up the converter.
    ///
    /// # Errors
    /// The converter does not take its configuration.
    pub fn new(machine: &'a Simulated) -> Result<Self, Ad5754Error<ChipError>> {
        let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip())?;
        Ok(Self { machine, outputs, injector: Injector::new() })
    }

    /// Breaks something of an axis, from 0.
    pub fn inject(&mut self, axis: usize, injection: Injection) {
        self.injector.inject(self.machine, axis, injection);
    }
}

impl Encoder<AXES> for Rig<'_> {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        let Ok(counts) = self.machine.latch();
        Ok(self.injector.counts(counts))
    }
}

impl Inputs<AXES> for Rig<'_> {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        Ok(self.injector.inputs(self.machine))
    }
}

impl VelocityChannel<AXES> for Rig<'_> {
    type Error = Ad5754Error<ChipError>;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        self.outputs.write(codes)
    }
}

impl DriveEnable<AXES> for Rig<'_> {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.machine.set_enabled(enabled)
    }
}
