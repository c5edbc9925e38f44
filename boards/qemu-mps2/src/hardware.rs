//! The simulated machine as a board's hardware: converter, encoders, enable, spindle and coolant.
//!
//! Consumes codes and commands in the tick; [`Hardware::advance`] lets the machine move until the next one.

use core::convert::Infallible;

use hal_sim::{
    Ad5754Chip, ChipError, HomeParameters, IndexParameters, REFERENCE_LINE, SimHome, SimHomes, SimMachine,
    SwitchParameters,
};
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, OutputState, Outputs,
    VelocityChannel,
};
use motion_kernel::homing::HomingFigures;
use motion_kernel::jog::Direction;
use motion_kernel::program::Header;
use motion_kernel::units::{Counts, DacCode};

use crate::AXES;

/// The machine, with cells for the dead time of every tick that the emulator keeps up with.
pub type Simulated = SimMachine<AXES, REFERENCE_LINE>;

/// What the tick owns of it.
pub struct Hardware {
    machine: &'static Simulated,
    outputs: Ad5754Output<&'static Ad5754Chip, AXES>,
    homes: SimHomes<AXES>,
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
        Ok(Self { machine, outputs, homes: SimHomes::NONE, switched: OutputState::OFF })
    }

    /// Gives every axis that is homed a switch, and an index where it looks for one: the switch is closed from a third of the
    /// search's length on, an index follows after half of the length within which it is looked for.
    pub fn add_homes(&mut self, header: &Header<AXES>, homing: &HomingFigures<AXES>, counts: [Counts; AXES]) {
        self.homes = SimHomes::new(core::array::from_fn(|number| {
            let (axis, counts) = (header.axes.get(number)?, counts.get(number)?);
            let position_mm = self.machine.position_mm(number)?;
            let config = &homing.axes.get(number)?.as_ref()?.config;
            let sign = if config.direction == Direction::Positive { 1.0 } else { -1.0 };
            let near_mm = position_mm + sign * config.travel_mm / 3.0;
            let far_mm = near_mm + sign * config.back_off_mm;
            let index = config.index_mm.map(|index_mm| {
                let counts_of = |mm: f64| (mm / axis.mm_per_count) as i64;
                let at = Counts(counts.0 + counts_of(near_mm + sign * index_mm / 2.0 - position_mm));
                IndexParameters { counts: counts_of(index_mm).abs().max(1), at }
            });
            let closes_mm = if sign > 0.0 { (near_mm, far_mm) } else { (far_mm, near_mm) };
            let switch = Some(SwitchParameters { closes_mm, hysteresis_mm: 0.2 });
            Some(SimHome::new(HomeParameters { switch, index }, position_mm, *counts))
        }));
    }

    /// Lets the machine move for a tick.
    pub fn advance(&mut self) {
        self.machine.advance();
    }
}

impl Encoder<AXES> for Hardware {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        let Ok(counts) = self.machine.latch();
        self.homes.advance(|axis| self.machine.position_mm(axis), counts);
        Ok(counts)
    }
}

impl Inputs<AXES> for Hardware {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        let Ok(inputs) = self.machine.read_inputs();
        Ok(self.homes.with_switches(inputs))
    }
}

impl IndexLatch for Hardware {
    type Error = Infallible;

    fn arm(&mut self, axis: usize) -> Result<(), Infallible> {
        self.homes.arm(axis)
    }

    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Infallible> {
        self.homes.latched(axis)
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
