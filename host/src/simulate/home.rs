//! Homing of the simulated machine, axis by axis.
//!
//! Consumes a machine whose axes have homing settings; produces what was found, and every tick's record.
//! Positions of switches count from where the machine was switched on.

use motion_kernel::hal::IndexLatch;
use motion_kernel::homing::{Homed, Homing, HomingError, HomingInput, HomingStep};
use motion_kernel::jog::Jog;
use motion_kernel::num::Real;

use super::Observer;
use super::error::RunError;
use super::hardware::simulated;
use super::session::{Session, SessionError, Then, jog_axis};
use crate::axis_unit::AxisUnit;
use crate::machine::{HomingSettings, Machine};

/// Why axes are not those that can be homed. Displays as one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HomesError {
    /// No axis has homing settings.
    #[error("found no [axis.homing], expected one for each axis that is to be homed")]
    NoAxis,
    /// There is no such axis.
    #[error("found axis {found}, expected one with [axis.homing]: {names}")]
    Name {
        /// What was asked for.
        found: String,
        /// Which there are.
        names: String,
    },
}

/// Why the machine is not homed. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// There is no such axis to home.
    #[error(transparent)]
    Axes(#[from] HomesError),
    /// An axis was not homed.
    #[error("axis {axis}: {source}")]
    Axis {
        /// Its name.
        axis: String,
        /// Why.
        source: HomingError,
    },
    /// The machine can't be simulated, or a motion did not come to its end.
    #[error(transparent)]
    Session(#[from] SessionError),
}

impl From<RunError> for HomeError {
    fn from(error: RunError) -> Self {
        Self::Session(error.into())
    }
}

/// An axis that was homed.
#[derive(Clone, Debug, PartialEq)]
pub struct HomedAxis {
    /// Its name.
    pub name: String,
    /// What was found.
    pub homed: Homed,
    /// How long it took \[ticks\].
    pub ticks: u64,
    /// What it counts.
    pub unit: AxisUnit,
    /// Where the axis stands: its actual position \[mm, °\].
    pub position_mm: f64,
    /// Where it truly stands, from where it was switched on \[mm, °\]; nobody knows of a board's.
    pub true_mm: Option<f64>,
}

impl<R: Real, const N: usize> Session<'_, R, N> {
    /// Homes an axis.
    ///
    /// # Errors
    /// It was not homed, or there was a fault.
    pub fn home(
        &mut self,
        axis: usize,
        settings: &HomingSettings,
        observe: &mut Observer<'_, N>,
    ) -> Result<HomedAxis, HomeError> {
        let (name, unit) = (&self.machine.axes[axis].name, self.machine.axes[axis].unit());
        let mut homing =
            Homing::new(settings.config, &jog_axis(self.machine, axis), axis, self.machine.tick_s);
        let failed = |source: HomingError| HomeError::Axis { axis: name.clone(), source };
        let (mut jog, first) = (None::<Jog<N>>, self.ticks);
        loop {
            let mut next = HomingStep::Wait;
            self.drive(jog.take().into_iter().flatten(), observe, |trace, hardware, state| {
                let Ok(index) = hardware.latched(axis);
                let seen = HomingInput {
                    set: trace.executed.setpoints.map(|setpoint| setpoint.position),
                    counts: trace.axes[axis].counts,
                    is_home: trace.inputs.axes[axis].is_home(),
                    home_counts: None,
                    index,
                    state,
                };
                Ok::<_, HomeError>(match homing.poll(&seen).map_err(failed)? {
                    HomingStep::Wait => Then::GoOn,
                    HomingStep::Stop => Then::Abort,
                    HomingStep::ArmIndex => {
                        let Ok(()) = hardware.arm(axis);
                        Then::GoOn
                    }
                    step => {
                        next = step;
                        Then::End
                    }
                })
            })?;
            let rest = match next {
                HomingStep::Reference(counts, position) => self.kernel.reference(axis, counts, position),
                _ => self.kernel.rest_here(),
            };
            self.set = rest.ok_or(SessionError::Moves)?;
            match next {
                HomingStep::Move(next) => jog = Some(next),
                HomingStep::Done(homed) => {
                    let position_mm = self.set[axis].to_mm();
                    let true_mm = Some(self.simulated.truth()[axis].position_mm);
                    let ticks = self.ticks - first;
                    return Ok(HomedAxis { name: name.clone(), homed, ticks, unit, position_mm, true_mm });
                }
                _ => {}
            }
        }
    }
}

/// The axes that have settings.
#[derive(Clone, Debug)]
pub struct Homes<'a, const N: usize = 3> {
    machine: &'a Machine<N>,
    axes: Vec<(usize, &'a HomingSettings)>,
}

impl<'a, const N: usize> Homes<'a, N> {
    /// Those of a machine with these names, or all.
    ///
    /// # Errors
    /// There are none, or one of the names is none of theirs.
    pub fn new(machine: &'a Machine<N>, names: &[String]) -> Result<Self, HomesError> {
        let settings = machine.driven_axes().iter().enumerate();
        let axes = settings.filter_map(|(axis, of)| Some((axis, of.homing.as_ref()?)));
        let name = |axis: usize| &machine.axes[axis].name;
        let mut axes: Vec<_> = axes.collect();
        if let Some(other) = names.iter().find(|other| axes.iter().all(|&(axis, _)| name(axis) != *other)) {
            let names: Vec<&str> = axes.iter().map(|&(axis, _)| name(axis).as_str()).collect();
            let (found, names) = (other.clone(), names.join(", "));
            return Err(if names.is_empty() {
                HomesError::NoAxis
            } else {
                HomesError::Name { found, names }
            });
        }
        axes.retain(|&(axis, _)| names.is_empty() || names.contains(name(axis)));
        if axes.is_empty() { Err(HomesError::NoAxis) } else { Ok(Self { machine, axes }) }
    }

    /// As a board is told them: the lowest bit is the first one's.
    #[must_use]
    pub fn mask(&self) -> u16 {
        self.axes.iter().fold(0, |mask, &(axis, _)| mask | 1 << axis)
    }

    /// Homes one after the other, into `homed`.
    ///
    /// # Errors
    /// An axis is not homed, or the machine can't be simulated.
    pub fn home(&self, homed: &mut Vec<HomedAxis>, observe: &mut Observer<'_, N>) -> Result<(), HomeError> {
        let simulated = simulated(self.machine)?;
        let mut session = Session::<f32, N>::new(self.machine, &simulated)?;
        for &(axis, settings) in &self.axes {
            homed.push(session.home(axis, settings, observe)?);
        }
        Ok(())
    }
}
