//! The simulated machine as the kernel's hardware: encoders, inputs and enable from hal-sim, the velocity
//! outputs through the converters' adapters and real SPI frames; with home switches and index latches where
//! they are asked for.
//!
//! [`Hardware`] is what a run asks of any machine.

use core::convert::Infallible;

use hal_sim::{CHANNELS, ChipError, Injection, Injector, SimHome, SimHomes, SimMachine};
use motion_kernel::hal::{
    Ad5754Error, DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, OutputState, Outputs,
    VelocityChannel,
};
use motion_kernel::num::Scalar;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use super::converters::Converters;
use super::error::RunError;
use super::inject::Break;
use crate::gcode::AXES_MAX;
use crate::machine::{DEAD_TIME_CELLS, Machine};

/// A machine to run a program on: what the kernel asks of a board, and the time between two ticks.
pub trait Hardware<const N: usize = 3>:
    Encoder<N> + Inputs<N> + VelocityChannel<N> + DriveEnable<N> + Outputs
{
    /// What the encoders read before the first tick.
    fn start_counts(&mut self) -> [Counts; N];

    /// Lets the time from one tick to the next pass; `trace` is what the tick did. False ends the run there.
    fn advance<R: Scalar>(&mut self, trace: &Trace<R, N>) -> bool;
}

/// The simulated machine, with room for every dead time a machine file may ask for.
pub type Simulated<const N: usize = 3> = SimMachine<N, DEAD_TIME_CELLS, { AXES_MAX.div_ceil(CHANNELS) }>;

/// The machine's drives, converters and encoders, at rest at the origin.
///
/// # Errors
/// They can't be simulated.
pub fn simulated<const N: usize>(machine: &Machine<N>) -> Result<Simulated<N>, RunError> {
    Simulated::<N>::new(&machine.simulated()).map_err(|error| RunError::Simulation(error.to_string()))
}

/// The machine and the adapters that talk to its converters.
pub struct SimulatedHardware<'a, const N: usize = 3> {
    machine: &'a Simulated<N>,
    outputs: Converters<'a>,
    /// What is broken.
    pub injector: Injector<N>,
    /// What will break.
    pub(super) breaks: Vec<Break>,
    /// What axes that can be homed have for it.
    homes: SimHomes<N>,
    /// Ticks so far.
    ticks: u64,
}

impl<'a, const N: usize> SimulatedHardware<'a, N> {
    /// Sets up the converters.
    ///
    /// # Errors
    /// A converter does not take its configuration.
    pub fn new(machine: &'a Simulated<N>) -> Result<Self, RunError> {
        let outputs = Converters::setup(machine.chips(), N)
            .map_err(|error| RunError::Simulation(format!("{error:?}")))?;
        let (injector, homes) = (Injector::new(), SimHomes::NONE);
        Ok(Self { machine, outputs, injector, breaks: Vec::new(), homes, ticks: 0 })
    }

    /// Adds home switches and index latches of the axes that have settings for them, where encoders read
    /// `counts`.
    pub fn add_homes(&mut self, machine: &Machine<N>, counts: [Counts; N]) {
        let truth = self.machine.truth();
        self.homes = SimHomes::new(core::array::from_fn(|axis| {
            let homing = machine.axes[axis].homing.as_ref()?;
            Some(SimHome::new(homing.simulated, truth[axis].position_mm, counts[axis]))
        }));
    }

    /// Breaks something of an axis, from 0.
    pub fn inject(&mut self, axis: usize, injection: Injection) {
        self.injector.inject(self.machine, axis, injection);
    }

    /// Breaks what is to break before the next tick.
    fn break_now(&mut self) {
        for index in 0..self.breaks.len() {
            let Break { tick, of_axis } = self.breaks[index];
            match of_axis {
                _ if tick != self.ticks => {}
                Some((axis, injection)) => self.inject(axis, injection),
                None => self.injector.emergency_stop = true,
            }
        }
    }
}

impl<const N: usize> Hardware<N> for SimulatedHardware<'_, N> {
    fn start_counts(&mut self) -> [Counts; N] {
        let Ok(counts) = self.latch();
        self.break_now();
        counts
    }

    fn advance<R: Scalar>(&mut self, _: &Trace<R, N>) -> bool {
        self.machine.advance();
        self.ticks += 1;
        self.break_now();
        true
    }
}

impl<const N: usize> Encoder<N> for SimulatedHardware<'_, N> {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; N], Infallible> {
        let Ok(counts) = self.machine.latch();
        let counts = self.injector.counts(counts);
        self.homes.advance(|axis| self.machine.position_mm(axis), counts);
        Ok(counts)
    }
}

impl<const N: usize> Inputs<N> for SimulatedHardware<'_, N> {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<N>, Infallible> {
        Ok(self.homes.with_switches(self.injector.inputs(self.machine)))
    }
}

impl<const N: usize> VelocityChannel<N> for SimulatedHardware<'_, N> {
    type Error = Ad5754Error<ChipError>;

    fn write(&mut self, codes: &[DacCode; N]) -> Result<(), Self::Error> {
        self.outputs.write(codes)
    }
}

impl<const N: usize> DriveEnable<N> for SimulatedHardware<'_, N> {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.machine.set_enabled(enabled)
    }
}

/// Neither moves an axis.
impl<const N: usize> Outputs for SimulatedHardware<'_, N> {
    fn switch(&mut self, _: &OutputState) {}
}

impl<const N: usize> IndexLatch for SimulatedHardware<'_, N> {
    type Error = Infallible;

    fn arm(&mut self, axis: usize) -> Result<(), Infallible> {
        self.homes.arm(axis)
    }

    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Infallible> {
        self.homes.latched(axis)
    }
}
