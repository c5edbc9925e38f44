//! The simulated machine as a board's hardware: converter, encoders, enable, spindle and coolant.
//!
//! Consumes codes and commands in the tick; [`Hardware::advance`] lets the machine move until the next one.

use core::convert::Infallible;

use hal_sim::{Ad5754Chip, ChipError, REFERENCE_LINE, SimMachine};
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs,
    VelocityChannel,
};
use motion_kernel::units::{Counts, DacCode};

use crate::AXES;

/// The machine, with cells for the dead time of every tick that the emulator keeps up with.
pub type Simulated = SimMachine<AXES, REFERENCE_LINE>;

/// What the tick owns of it.
pub struct Hardware {
    machine: &'static Simulated,
    outputs: Ad5754Output<&'static Ad5754Chip, AXES>,
    /// Spindle and coolant as they were switched last.
    pub switched: OutputState,
}

impl Hardware {
    /// With all off.
    ///
    /// # Errors
    /// The converter does not take its configuration.
    pub fn new(machine: &'static Simulated) -> Result<Self, Ad5754Error<ChipError>> {
        let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip())?;
        Ok(Self { machine, outputs, switched: OutputState::OFF })
    }

    /// Lets the machine move for a tick.
    pub fn advance(&mut self) {
        self.machine.advance();
    }
}

impl Encoder<AXES> for Hardware {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        self.machine.latch()
    }
}

impl Inputs<AXES> for Hardware {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        self.machine.read_inputs()
    }
}

impl VelocityChannel<AXES> for Hardware {
    type Error = Ad5754Error<ChipError>;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        self.outputs.write(codes)
    }
}

impl DriveEnable<AXES> for Hardware {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.machine.set_enabled(enabled)
    }
}

impl Outputs for Hardware {
    fn switch(&mut self, to: &OutputState) {
        self.switched = *to;
    }
}
