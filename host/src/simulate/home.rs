//! Homing of the simulated machine, axis by axis, through kernel and closed loop.
//!
//! Consumes a machine whose axes have homing settings; produces what was found, and every tick's record. The machine stands at
//! 0 as far as it knows, which is as good as nowhere; positions of switches count from there.

use std::convert::Infallible;

use hal_sim::SimHome;
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, VelocityChannel};
use motion_kernel::homing::{Homed, Homing, HomingError, Seen, Step};
use motion_kernel::jog::{Jog, JogAxis};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::Limits;
use motion_kernel::live::{Director, State};
use motion_kernel::num::Real;
use motion_kernel::program::Item;
use motion_kernel::queue::LiveStreams;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode, Position};

use super::Observer;
use super::contour::Contour;
use super::job::Sheet;
use super::rig::{Rig, Simulated};
use super::run::{RunError, fault_record, tick_record};
use crate::machine::{AxisSettings, HomingSettings, Machine};
use crate::record::{AXES, FaultRecord};

/// Path enough to stop on at any feed, as for a run under live control.
const PIECES: usize = 64;
const SEGMENTS: usize = 16;
const PLACES: usize = 64;

/// Why the machine is not homed. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// The simulation can't be made.
    #[error(transparent)]
    Run(#[from] RunError),
    /// No axis has homing settings.
    #[error("found no [axis.homing], expected one for each axis that is to be homed")]
    NoAxis,
    /// An axis was not homed.
    #[error("axis {axis}: {source}")]
    Axis {
        /// Its name.
        axis: String,
        /// Why.
        source: HomingError,
    },
    /// The kernel found a fault.
    #[error("fault in tick {}: {}: {}", .0.tick, .0.fault, .0.detail)]
    Fault(FaultRecord),
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
    /// Where the axis stands: its actual position \[mm\].
    pub position_mm: f64,
    /// Where it truly stands, from where it was switched on \[mm\].
    pub true_mm: f64,
}

/// The rig with home switches and index latches.
struct HomeRig<'a> {
    rig: Rig<'a>,
    machine: &'a Simulated,
    homes: [Option<SimHome>; AXES],
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

/// A simulated machine, switched on, that goes from one motion to the next.
pub struct Session<'a, R: Real> {
    machine: &'a Machine,
    simulated: &'a Simulated,
    rig: HomeRig<'a>,
    kernel: Kernel<R, AXES>,
    streams: Box<LiveStreams<R, AXES, PIECES, SEGMENTS>>,
    /// Where it stands.
    set: [Position; AXES],
    contour: Contour,
    ticks: u64,
}

/// What a tick asks of the motion under way.
enum Then {
    GoOn,
    Abort,
    End,
}

impl<'a, R: Real> Session<'a, R> {
    /// A machine at rest, drives on.
    ///
    /// # Errors
    /// It can't be simulated, or regulated.
    pub fn new(machine: &'a Machine, simulated: &'a Simulated) -> Result<Self, RunError> {
        let mut rig = Rig::new(simulated).map_err(|error| RunError::Simulation(format!("{error:?}")))?;
        let Ok(counts) = rig.latch();
        let truth = simulated.truth();
        let homes = core::array::from_fn(|axis| {
            let homing = machine.axes[axis].homing.as_ref()?;
            Some(SimHome::new(homing.simulated, truth[axis].position_mm, counts[axis]))
        });
        let set = [Position::ZERO; AXES];
        let mut kernel = Kernel::new(&machine.axes_config()?, set, counts);
        kernel.enable(0);
        let rig = HomeRig { rig, machine: simulated, homes };
        let (streams, contour) = (Box::default(), Contour::default());
        Ok(Self { machine, simulated, rig, kernel, streams, set, contour, ticks: 0 })
    }

    /// Where the machine stands: its set positions, at rest.
    #[must_use]
    pub fn position(&self) -> [Position; AXES] {
        self.set
    }

    /// Homes an axis.
    ///
    /// # Errors
    /// It was not homed, or there was a fault.
    pub fn home(
        &mut self,
        axis: usize,
        settings: &HomingSettings,
        observe: &mut Observer<'_>,
    ) -> Result<HomedAxis, HomeError> {
        let AxisSettings { name, feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4, .. } =
            &self.machine.axes[axis];
        let path = &self.machine.path;
        let of_axis = Limits { accel_mm_s2: *accel_mm_s2, jerk_mm_s3: *jerk_mm_s3, snap_mm_s4: *snap_mm_s4 };
        let limits = of_axis.least(&path.limits());
        let jog = JogAxis { feed_mm_s: feed_mm_s.min(path.feed_mm_s), limits, travel: None };
        let mut homing = Homing::new(settings.config, &jog, axis, self.machine.tick_s);
        let failed = |source: HomingError| HomeError::Axis { axis: name.clone(), source };
        let (mut jog, first) = (None::<Jog<AXES>>, self.ticks);
        loop {
            let mut next = Step::Wait;
            self.drive(jog.take().into_iter().flatten(), observe, |trace, rig, state| {
                let Ok(index) = rig.latched(axis);
                let seen = Seen {
                    set: trace.executed.setpoints.map(|setpoint| setpoint.position),
                    counts: trace.axes[axis].counts,
                    is_home: trace.inputs.axes[axis].is_home(),
                    index,
                    state,
                };
                Ok(match homing.turn(&seen).map_err(failed)? {
                    Step::Wait => Then::GoOn,
                    Step::Stop => Then::Abort,
                    Step::ArmIndex => {
                        let Ok(()) = rig.arm(axis);
                        Then::GoOn
                    }
                    step => {
                        next = step;
                        Then::End
                    }
                })
            })?;
            let rest = match next {
                Step::Reference(counts, position) => self.kernel.reference(axis, counts, position),
                _ => self.kernel.rest_here(),
            };
            self.set = rest.ok_or_else(|| failed(HomingError::Failed))?;
            match next {
                Step::Move(next) => jog = Some(next),
                Step::Done(homed) => {
                    let position_mm = self.set[axis].to_mm();
                    let true_mm = self.simulated.truth()[axis].position_mm;
                    let ticks = self.ticks - first;
                    return Ok(HomedAxis { name: name.clone(), homed, ticks, position_mm, true_mm });
                }
                _ => {}
            }
        }
    }

    /// Drives items from where the machine stands to their end.
    ///
    /// # Errors
    /// An item can't be executed, or there was a fault.
    pub fn run(
        &mut self,
        items: impl Iterator<Item = Result<Item<AXES>, Infallible>>,
        observe: &mut Observer<'_>,
    ) -> Result<(), HomeError> {
        self.drive(items, observe, |trace, _, state| {
            let is_done = state == State::Done && trace.executed.state == ExecState::Idle;
            Ok(if is_done { Then::End } else { Then::GoOn })
        })?;
        self.set = self.kernel.rest_here().unwrap_or(self.set);
        Ok(())
    }

    /// Ticks under a director, until one asks for the end.
    fn drive(
        &mut self,
        items: impl Iterator<Item = Result<Item<AXES>, Infallible>>,
        observe: &mut Observer<'_>,
        mut look: impl FnMut(&Trace<R, AXES>, &mut HomeRig<'a>, State) -> Result<Then, HomeError>,
    ) -> Result<(), HomeError> {
        let (mut feeder, mut intake) = self.streams.split(self.machine.rules(), self.set);
        let mut director = Director::<R, AXES, _, _, PLACES>::new(items, self.machine.tick_s, 0);
        loop {
            director.turn(&mut feeder).map_err(RunError::Rejected)?;
            let trace = *self.kernel.tick(&mut intake, &mut self.rig);
            self.simulated.advance();
            self.ticks += 1;
            observe(&tick_record(&trace, 0.0, &mut self.contour));
            if let Some(fault) = trace.fault {
                return Err(HomeError::Fault(fault_record(
                    &fault,
                    &self.machine.header(),
                    &Sheet::of_machine(self.machine),
                )));
            }
            match look(&trace, &mut self.rig, director.state(&feeder))? {
                Then::GoOn => {}
                Then::Abort => director.abort(),
                Then::End => return Ok(()),
            }
        }
    }
}

/// Homes every axis that has settings, one after the other, into `homed`.
///
/// # Errors
/// An axis is not homed, or the machine can't be simulated.
pub fn home(
    machine: &Machine,
    homed: &mut Vec<HomedAxis>,
    observe: &mut Observer<'_>,
) -> Result<(), HomeError> {
    if machine.axes.iter().all(|axis| axis.homing.is_none()) {
        return Err(HomeError::NoAxis);
    }
    let simulated =
        Simulated::new(&machine.simulated()).map_err(|error| RunError::Simulation(error.to_string()))?;
    let mut session = Session::<f32>::new(machine, &simulated)?;
    for (axis, settings) in machine.axes.iter().enumerate() {
        if let Some(homing) = &settings.homing {
            homed.push(session.home(axis, homing, observe)?);
        }
    }
    Ok(())
}
