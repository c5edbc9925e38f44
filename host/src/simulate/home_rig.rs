//! The simulated machine as the kernel's hardware, with home switches and index latches.

use std::convert::Infallible;

use hal_sim::SimHome;
use motion_kernel::hal::{DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, VelocityChannel};
use motion_kernel::units::{Counts, DacCode};

use super::error::RunError;
use super::rig::{Rig, Simulated};
use crate::machine::Machine;
use crate::record::AXES;

/// The rig, and what each axis that can be homed has for it.
pub(super) struct HomeRig<'a> {
    rig: Rig<'a>,
    machine: &'a Simulated,
    homes: [Option<SimHome>; AXES],
}

impl<'a> HomeRig<'a> {
    /// The rig as it is switched on, and what its encoders read.
    pub(super) fn new(
        machine: &Machine,
        simulated: &'a Simulated,
    ) -> Result<(Self, [Counts; AXES]), RunError> {
        let mut rig = Rig::new(simulated).map_err(|error| RunError::Simulation(format!("{error:?}")))?;
        let Ok(counts) = rig.latch();
        let truth = simulated.truth();
        let homes = core::array::from_fn(|axis| {
            let homing = machine.axes[axis].homing.as_ref()?;
            Some(SimHome::new(homing.simulated, truth[axis].position_mm, counts[axis]))
        });
        Ok((Self { rig, machine: simulated, homes }, counts))
    }
}

impl Encoder<AXES> for HomeRig<'_> {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        let counts = self.rig.latch()?;
        for ((home, truth), counts) in self.homes.iter_mut().zip(self.machine.truth()).zip(counts) {
            if let Some(home) = home {
                home.advance(truth.position_mm, counts);
            }
        }
        Ok(counts)
    }
}

impl Inputs<AXES> for HomeRig<'_> {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        let mut inputs = self.rig.read_inputs()?;
        for (axis, home) in inputs.axes.iter_mut().zip(&self.homes) {
            *axis = axis.with_home(home.as_ref().is_some_and(SimHome::is_closed));
        }
        Ok(inputs)
    }
}

impl VelocityChannel<AXES> for HomeRig<'_> {
    type Error = <Rig<'static> as VelocityChannel<AXES>>::Error;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        self.rig.write(codes)
    }
}

impl DriveEnable<AXES> for HomeRig<'_> {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.rig.set_enabled(enabled)
    }
}

impl IndexLatch for HomeRig<'_> {
    type Error = Infallible;

    fn arm(&mut self, axis: usize) -> Result<(), Infallible> {
        if let Some(Some(home)) = self.homes.get_mut(axis) {
            home.arm();
        }
        Ok(())
    }

    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Infallible> {
        Ok(self.homes.get(axis).and_then(|home| home.as_ref()?.latched()))
    }
}
