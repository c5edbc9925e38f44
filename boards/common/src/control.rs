//! What tick and background share, and the tick of every board.
//!
//! The tick has the higher priority and uses it freely; the background locks it for some tens of
//! instructions, right after a tick; for a snapshot of the scope, which copies the kernel's state, for some hundreds.

use motion_kernel::exec::ExecState;
use motion_kernel::fault::{Fault, FaultKind};
use motion_kernel::flight::FlightRecorder;
use motion_kernel::hal::{DriveEnable, Encoder, IndexLatch, Inputs, OutputState, Outputs, VelocityChannel};
use motion_kernel::kernel::Kernel;
use motion_kernel::num::Real;
use motion_kernel::queue::Intake;
use motion_kernel::scope::{Noting, Recorder};
use motion_kernel::units::{Counts, Position};

use crate::tick_timing::TickTiming;

/// Shared by tick and background: the kernel, and its last results. The flight recorder keeps `ROWS` ticks,
/// `AFTER` of them after a fault.
pub struct Control<'a, R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize> {
    pub(crate) kernel: Kernel<R, AXES>,
    /// The kernel's end of the streams: empty ones until the first start.
    pub(crate) intake: Intake<'a, R, AXES>,
    /// The tick's own figures; the board's interrupt adds to them.
    pub timing: TickTiming,
    pub(crate) flight: &'a mut FlightRecorder<R, AXES, ROWS, AFTER>,
    /// Who is told every tick.
    pub(crate) recorder: Option<Recorder<'a, R, AXES>>,
    is_healthy: bool,
    /// What spindle and coolant are to be switched to in the next tick.
    due: Option<OutputState>,
    /// Spindle or coolant may be on.
    is_switched: bool,
    index: Index,
    home: Option<HomeSwitch>,
}

/// An axis' home switch, at which every tick looks: a poll of the background may come many ticks after it has closed.
#[derive(Clone, Copy)]
struct HomeSwitch {
    axis: usize,
    is_closed: bool,
    /// The encoder's reading in the first tick that saw it close, since the background saw it open.
    closed_at: Option<Counts>,
}

/// An axis' index latch, on its way between background and tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Index {
    /// Nobody asks for it.
    Unused,
    /// The next tick is to arm that of this axis.
    Due(usize),
    /// That of this axis has taken nothing yet.
    Armed(usize),
    /// It has taken this count.
    Latched(Counts),
    /// There is none, or it failed.
    Missing,
}

/// The tick's last results.
#[derive(Clone, Copy)]
pub(crate) struct Seen<R: Real, const AXES: usize> {
    pub(crate) state: ExecState,
    /// The set position.
    pub(crate) position: [Position; AXES],
    pub(crate) fault: Option<Fault<R>>,
    /// The inputs allow a start.
    pub(crate) is_healthy: bool,
}

impl<'a, R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize>
    Control<'a, R, AXES, ROWS, AFTER>
{
    /// A kernel at rest, with its end of the streams: of streams that nothing ever enters, if the first start brings others.
    pub fn new(
        kernel: Kernel<R, AXES>,
        intake: Intake<'a, R, AXES>,
        flight: &'a mut FlightRecorder<R, AXES, ROWS, AFTER>,
    ) -> Self {
        let timing = TickTiming::new();
        let (recorder, is_healthy, is_switched) = (None, false, false);
        Self {
            kernel,
            intake,
            timing,
            flight,
            recorder,
            is_healthy,
            due: None,
            is_switched,
            index: Index::Unused,
            home: None,
        }
    }

    /// From now on `recorder` is told every tick: the tick's part of a [scope](motion_kernel::scope::ScopeMemory).
    pub fn set_recorder(&mut self, recorder: Recorder<'a, R, AXES>) {
        self.recorder = Some(recorder);
    }

    /// One control tick. `unhealthy` is the fault found in the inputs (the emergency stop, a drive that is
    /// not ready), `late` is that of the board's [`TickMonitor`](motion_kernel::tick_monitor::TickMonitor)
    /// when the tick begins. A fault switches spindle and coolant off in the tick that finds it.
    #[inline]
    pub fn tick<H>(&mut self, unhealthy: Option<FaultKind<R>>, late: Option<FaultKind<R>>, hal: &mut H)
    where
        H: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES> + Outputs + IndexLatch,
    {
        self.is_healthy = unhealthy.is_none();
        for kind in unhealthy.into_iter().chain(late) {
            self.trip(kind);
        }
        if let Index::Due(axis) = self.index {
            self.index = hal.arm(axis).map_or(Index::Missing, |()| Index::Armed(axis));
        }
        let mut noting = Noting::new(hal);
        let trace = self.kernel.tick(&mut self.intake, &mut noting);
        self.flight.add(trace);
        if let Some(recorder) = &mut self.recorder {
            recorder.tick(trace, noting.failures());
        }
        if let Some(home) = &mut self.home
            && let (Some(inputs), Some(output)) =
                (trace.inputs.axes.get(home.axis), trace.axes.get(home.axis))
        {
            let was_closed = core::mem::replace(&mut home.is_closed, inputs.is_home());
            if home.is_closed && !was_closed && home.closed_at.is_none() {
                home.closed_at = Some(output.counts);
            }
        }
        if trace.fault.is_some() {
            self.due = self.is_switched.then_some(OutputState::OFF);
        }
        if let Some(to) = self.due.take() {
            hal.switch(&to);
            self.is_switched = to != OutputState::OFF;
        }
        if let Index::Armed(axis) = self.index {
            self.index = match hal.latched(axis) {
                Ok(None) => self.index,
                Ok(Some(counts)) => Index::Latched(counts),
                Err(_) => Index::Missing,
            };
        }
    }

    /// Has the next tick arm an axis' index latch, and every tick look at it from then on.
    pub(crate) fn arm_index(&mut self, axis: usize) {
        self.index = Index::Due(axis);
    }

    /// What has become of it.
    pub(crate) fn index(&self) -> Index {
        self.index
    }

    /// What an axis' encoder read when its home switch closed first, since this found it open: contacts bounce.
    pub(crate) fn home_counts(&mut self, axis: usize) -> Option<Counts> {
        let inputs = self.kernel.trace().inputs.axes.get(axis);
        let is_closed = inputs.is_some_and(|axis| axis.is_home());
        let closed_at = match self.home {
            Some(home) if home.axis == axis && is_closed => home.closed_at,
            _ => None,
        };
        self.home = Some(HomeSwitch { axis, is_closed, closed_at });
        closed_at
    }

    /// Nobody asks for a home switch or an index any more.
    pub(crate) fn forget_homing(&mut self) {
        self.index = Index::Unused;
        self.home = None;
    }

    /// Switches spindle and coolant in the next tick, unless that finds a fault.
    pub(crate) fn switch(&mut self, to: OutputState) {
        self.due = Some(to);
    }

    /// Latches a fault that the board found after the tick; it takes effect in the next tick.
    #[inline]
    pub fn trip(&mut self, kind: FaultKind<R>) {
        self.kernel.trip(kind);
        if let Some(recorder) = &mut self.recorder {
            recorder.trip(kind);
        }
    }

    /// Whether the inputs allow a start.
    pub(crate) fn is_healthy(&self) -> bool {
        self.is_healthy
    }

    /// Whether the drives are off and may be enabled.
    pub(crate) fn may_enable(&self) -> bool {
        self.is_healthy && self.kernel.is_off() && self.kernel.fault().is_none()
    }

    pub(crate) fn seen(&self) -> Seen<R, AXES> {
        let trace = self.kernel.trace();
        Seen {
            state: trace.executed.state,
            position: trace.executed.setpoints.map(|setpoint| setpoint.position),
            fault: trace.fault,
            is_healthy: self.is_healthy,
        }
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::queue::LiveStreams;

    use super::*;
    use crate::fixture::{AXES, IdealDrives, machine};

    /// What counts is the first contact since the switch was found open, however often it opens again before the next look.
    #[test]
    fn a_bouncing_switch_counts_from_its_first_contact() {
        let machine = machine();
        let header = *machine.header();
        let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let (_, intake) = streams.split(header.rules, header.start);
        let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
        let mut control = Control::new(kernel, intake, &mut flight);
        let mut drives = IdealDrives::new();
        let mut ticks = |control: &mut Control<'_, f32, AXES, 16, 8>, contacts: &[bool]| {
            for &is_closed in contacts {
                drives.contact = Some(is_closed);
                drives.counts[0] += 10.0;
                control.tick(None, None, &mut drives);
            }
        };
        ticks(&mut control, &[false]);
        assert_eq!(control.home_counts(0), None);
        ticks(&mut control, &[false, true, false, true, true, false, true]);
        assert_eq!(control.home_counts(0), Some(Counts(30)));
        // It stays so, until it is found open.
        ticks(&mut control, &[true, true]);
        assert_eq!(control.home_counts(0), Some(Counts(30)));
        ticks(&mut control, &[false]);
        assert_eq!(control.home_counts(0), None);
        ticks(&mut control, &[true, false, true]);
        assert_eq!(control.home_counts(0), Some(Counts(120)));
        // Another axis is looked at from now on.
        assert_eq!(control.home_counts(1), None);
    }
}
