//! A simulated machine that goes from one motion to the next: kernel, streams and closed loop, switched on
//! once.
//!
//! Consumes a machine, then items of motion, one motion after the other, each under live control; produces
//! every tick's record. The machine stands at 0 as far as it knows, until an axis is homed.

use std::convert::Infallible;

use motion_kernel::axis::AxesConfig;
use motion_kernel::exec::ExecState;
use motion_kernel::hal::Encoder;
use motion_kernel::homing::AxisHoming;
use motion_kernel::jog::JogAxis;
use motion_kernel::kernel::Kernel;
use motion_kernel::law::Limits;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::program::Item;
use motion_kernel::queue::LiveStreams;
use motion_kernel::trace::Trace;
use motion_kernel::units::Position;

use super::Observer;
use super::contour::Contour;
use super::error::RunError;
use super::faults;
use super::hardware::{Simulated, SimulatedHardware};
use super::job::RunInfo;
use super::run::trace_row;
use crate::machine::{AxisSettings, HomingSettings, Machine};
use crate::trace::TracedFault;

/// Path enough to stop on at any feed, as for a run under live control.
const PIECES: usize = 64;
const SEGMENTS: usize = 16;
const PLACES: usize = 64;

/// Why a motion did not come to its end. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The machine can't be simulated, or the motion not executed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The motion is over, and the machine moves.
    #[error("found the machine moving at a motion's end, expected it at rest")]
    Moves,
    /// The kernel found a fault.
    #[error("fault in tick {}, at {at}: {}: {}", .fault.tick, .fault.fault, .fault.detail)]
    Fault {
        /// The fault.
        fault: Box<TracedFault>,
        /// The set positions, for people.
        at: String,
    },
}

/// A simulated machine, switched on.
pub struct Session<'a, R: Real, const N: usize = 3> {
    pub(super) machine: &'a Machine<N>,
    pub(super) simulated: &'a Simulated<N>,
    pub(super) kernel: Kernel<R, N>,
    config: AxesConfig<R, N>,
    hardware: SimulatedHardware<'a, N>,
    streams: Box<LiveStreams<R, N, PIECES, SEGMENTS>>,
    /// Where it stands.
    pub(super) set: [Position; N],
    contour: Contour<N>,
    pub(super) ticks: u64,
}

/// What a tick asks of the motion under way.
pub(super) enum Then {
    GoOn,
    /// To come to rest, and to give up what is left.
    Abort,
    End,
}

impl<'a, R: Real, const N: usize> Session<'a, R, N> {
    /// A machine at rest, drives on.
    ///
    /// # Errors
    /// It can't be simulated, or regulated.
    pub fn new(machine: &'a Machine<N>, simulated: &'a Simulated<N>) -> Result<Self, RunError> {
        let mut hardware = SimulatedHardware::new(simulated)?;
        let Ok(counts) = hardware.latch();
        hardware.add_homes(machine, counts);
        let (config, set) = (machine.axes_config()?, [Position::ZERO; N]);
        let mut kernel = Kernel::new(&config, set, counts);
        kernel.enable(0);
        let contour = Contour::new(machine.linear_places());
        let streams = Box::default();
        Ok(Self { machine, simulated, kernel, config, hardware, streams, set, contour, ticks: 0 })
    }

    /// Where the machine stands: its set positions, at rest.
    #[must_use]
    pub fn position(&self) -> [Position; N] {
        self.set
    }

    /// Drives items from where the machine stands to their end.
    ///
    /// # Errors
    /// An item can't be executed, or there was a fault.
    pub fn run(
        &mut self,
        items: impl Iterator<Item = Result<Item<N>, Infallible>>,
        observe: &mut Observer<'_, N>,
    ) -> Result<(), SessionError> {
        self.drive(items, observe, |trace, _, state| {
            let is_done = state == State::Done && trace.executed.state == ExecState::Idle;
            Ok::<_, SessionError>(if is_done { Then::End } else { Then::GoOn })
        })?;
        self.rest()
    }

    /// Takes where a motion has come to rest for where the machine stands.
    pub(super) fn rest(&mut self) -> Result<(), SessionError> {
        self.set = self.kernel.rest_here().ok_or(SessionError::Moves)?;
        Ok(())
    }

    /// Ticks under live control, until one asks for the end.
    pub(super) fn drive<E: From<SessionError>>(
        &mut self,
        items: impl Iterator<Item = Result<Item<N>, Infallible>>,
        observe: &mut Observer<'_, N>,
        mut after_tick: impl FnMut(&Trace<R, N>, &mut SimulatedHardware<'a, N>, State) -> Result<Then, E>,
    ) -> Result<(), E> {
        let (mut feeder, mut intake) = self.streams.split(self.machine.rules(), self.set);
        let mut control = LiveControl::<R, N, _, _, PLACES>::new(
            items,
            self.machine.path.pulse,
            self.machine.tick_s,
            Leads::NONE,
        );
        loop {
            control.poll(&mut feeder).map_err(|error| SessionError::Run(RunError::Rejected(error)))?;
            let trace = *self.kernel.tick(&mut intake, &mut self.hardware);
            self.simulated.advance();
            self.ticks += 1;
            observe(&trace_row(&trace, 0.0, &mut self.contour));
            if let Some(fault) = trace.fault {
                let job = (&self.machine.header(), &RunInfo::of_machine(self.machine));
                let setpoints = &trace.executed.setpoints;
                let fault = Box::new(faults::traced(&fault, job, &self.config, setpoints));
                let axes = self.machine.driven_axes().iter().zip(setpoints);
                let at = axes.map(|(axis, set)| {
                    format!("{} {:.4} {}", axis.name, set.position.to_mm(), axis.unit().symbol())
                });
                let at = at.collect::<Vec<_>>().join(", ");
                return Err(SessionError::Fault { fault, at }.into());
            }
            match after_tick(&trace, &mut self.hardware, control.state(&feeder))? {
                Then::GoOn => {}
                Then::Abort => control.abort(),
                Then::End => return Ok(()),
            }
        }
    }
}

/// How a board homes an axis; none if it is not homed.
pub(crate) fn homing_figures<const N: usize>(machine: &Machine<N>, axis: usize) -> Option<AxisHoming> {
    let JogAxis { feed_mm_s, limits, .. } = jog_axis(machine, axis);
    machine.axes[axis].homing.map(|HomingSettings { config, .. }| AxisHoming { config, feed_mm_s, limits })
}

/// What an axis may do by itself, not knowing where it is: its limits, and those of any path, which bind linear axes.
pub(crate) fn jog_axis<const N: usize>(machine: &Machine<N>, axis: usize) -> JogAxis {
    let &AxisSettings { feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4, .. } = &machine.axes[axis];
    let path = &machine.path;
    let own = Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 };
    let (feed_mm_s, limits) = match machine.axes[axis].letter {
        Some(letter) if letter.is_rotary() => (feed_mm_s, own),
        _ => (feed_mm_s.min(path.feed_mm_s), own.least(&path.limits())),
    };
    JogAxis { feed_mm_s, limits, pulse: path.pulse, travel: None }
}
