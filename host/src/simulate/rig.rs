//! The simulated machine as the kernel's hardware: encoders, inputs and enable from hal-sim, the velocity
//! outputs through the converter's adapter and real SPI frames.
//!
//! [`Hardware`] is what a run asks of any machine.

use core::convert::Infallible;

use hal_sim::{Ad5754Chip, ChipError, SimMachine};
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel,
};
use motion_kernel::num::Scalar;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use crate::machine::DEAD_TIME_CELLS;
use crate::record::AXES;

/// A machine to run a program on: what the kernel asks of a board, and the time between two ticks.
pub trait Hardware: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES> {
    /// What the encoders read before the first tick.
    fn start_counts(&mut self) -> [Counts; AXES];

    /// Lets the time from one tick to the next pass; `trace` is what the tick did. False ends the run there.
    fn advance<R: Scalar>(&mut self, trace: &Trace<R, AXES>) -> bool;
}

/// The simulated machine, with room for every dead time a machine file may ask for.
pub type Simulated = SimMachine<AXES, DEAD_TIME_CELLS>;

/// The machine and the adapter that talks to its converter.
pub struct Rig<'a> {
    machine: &'a Simulated,
    outputs: Ad5754Output<&'a Ad5754Chip, AXES>,
}

impl<'a> Rig<'a> {
    /// Sets up the converter.
    ///
    /// # Errors
    /// The converter does not take its configuration.
    pub fn new(machine: &'a Simulated) -> Result<Self, Ad5754Error<ChipError>> {
        let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip())?;
        Ok(Self { machine, outputs })
    }
}

impl Hardware for Rig<'_> {
    fn start_counts(&mut self) -> [Counts; AXES] {
        let Ok(counts) = self.latch();
        counts
    }

    fn advance<R: Scalar>(&mut self, _: &Trace<R, AXES>) -> bool {
        self.machine.advance();
        true
    }
}

impl Encoder<AXES> for Rig<'_> {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        self.machine.latch()
    }
}

impl Inputs<AXES> for Rig<'_> {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        self.machine.read_inputs()
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
