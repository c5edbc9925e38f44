//! Frames for the PC, in order of urgency: parameters, status, flight recorder, scope.

use motion_kernel::exec::ExecState;
use motion_kernel::flight::frame_max;
use motion_kernel::link::{Came, State as MachineState, Status};
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::scope::BODY_MAX;
use rtic_core::Mutex;

use super::Linked;
use crate::control::Control;

/// Time between two messages about the machine \[ms\].
const STATUS_MS: u32 = 20;
/// The longest frame of a row of the flight recorder \[bytes\].
const FLIGHT_FRAME_MAX: usize = frame_max(9);

impl<'a, R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize, const PARAMETERS: usize>
    Linked<'a, R, AXES, ITEMS, PLACES, PARAMETERS>
{
    /// Writes the next frame for the PC to `out`, which needs [`FRAME_MAX`](motion_kernel::link::FRAME_MAX) bytes, at the time
    /// `now_ms`, which may wrap; returns its length, 0 if there is nothing to say.
    #[inline(never)]
    pub fn transmit<const ROWS: usize, const AFTER: usize>(
        &mut self,
        now_ms: u32,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
        out: &mut [u8],
    ) -> usize {
        let Self { streamed, parameters, new_parameters, .. } = self;
        let length = streamed.link_mut().transmit_parameters(parameters, new_parameters, out);
        if length > 0 {
            return length;
        }
        if now_ms.wrapping_sub(self.status_ms) < STATUS_MS {
            let length = self.streamed.transmit(now_ms, None, out);
            // In the room that is left.
            if length > 0 {
                return length;
            }
            let length = self.transmit_flight(control, out);
            return if length > 0 { length } else { self.transmit_scope(control, out) };
        }
        self.status_ms = now_ms;
        let (live, starvations) = (self.streamed.state(), self.streamed.starvations());
        // Before the position: a piece that is driven meanwhile is told as the one under way.
        let driven = self.streamed.driven();
        let (progress, homed) = (self.homing.progress, self.homing.homed);
        let homes = self.homing.is_under_way();
        let status = control.lock(|control| {
            let (trace, is_off) = (control.kernel.trace(), control.kernel.is_off());
            Status {
                // Counts wrap.
                tick: trace.tick as u32,
                state: match machine_state(is_off, live, trace.executed.state) {
                    state if homes && state != MachineState::Off => MachineState::Homing,
                    state => state,
                },
                set: trace.axes.each_ref().map(|axis| axis.set),
                actual: trace.axes.each_ref().map(|axis| axis.actual),
                feed_mm_s: trace.executed.motion.v_mm_s.to_f64(),
                line: trace.executed.line,
                // What has come is known where it is written.
                aborts: 0,
                taken: 0,
                driven,
                is_ended: false,
                starvations,
                is_ready: control.is_healthy(),
                fault: trace.fault.map(|fault| fault.to_f64()),
                homing: progress,
                homed,
            }
        });
        self.streamed.transmit(
            now_ms,
            Some(&|came: Came| Status {
                aborts: came.aborts,
                taken: came.taken,
                is_ended: came.is_ended,
                ..status
            }),
            out,
        )
    }

    /// The row of the flight recorder that is asked for. Before a fault there is none: its rows change with every tick.
    #[inline(never)]
    fn transmit_flight<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
        out: &mut [u8],
    ) -> usize {
        let link = self.streamed.link_mut();
        let Some(number) = link.flight_row() else { return 0 };
        let (rows, row) = control.lock(|control| {
            let flight = &control.flight;
            if flight.is_frozen() { (flight.count(), flight.row(number.into()).copied()) } else { (0, None) }
        });
        let mut bytes = [0; FLIGHT_FRAME_MAX];
        let frame = row.and_then(|row| row.to_frame(&mut bytes)).unwrap_or_default();
        link.transmit_flight(rows as u16, frame, out)
    }

    /// The next frame of the scope.
    #[inline(never)]
    fn transmit_scope<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
        out: &mut [u8],
    ) -> usize {
        let Self { streamed, scope: Some(scope), .. } = self else { return 0 };
        let asked = streamed.link_mut().scope();
        let Some(log) = streamed.log_mut() else { return 0 };
        scope.obey(asked, log);
        if scope.is_snapshot_due(log) {
            control.lock(|control| {
                if let Control { kernel, intake, recorder: Some(recorder), .. } = control {
                    scope.take_snapshot(kernel, intake, recorder, log);
                }
            });
            streamed.tell_lists();
        }
        let mut bytes = [0; BODY_MAX];
        let Some(body) = streamed.log_mut().and_then(|log| scope.body(log, &mut bytes)) else { return 0 };
        let written = bytes.get(..body.length).unwrap_or_default();
        streamed.link_mut().transmit_scope((body.epoch, body.number), written, out)
    }
}

/// What the machine does, by its drives, live control and the tick.
fn machine_state(is_off: bool, live: State, tick: ExecState) -> MachineState {
    match (live, tick) {
        _ if is_off => MachineState::Off,
        (State::Failed, _) => MachineState::Refused,
        (_, ExecState::Stopped) => MachineState::Stopped,
        (_, ExecState::Dwell) => MachineState::Dwell,
        (State::Held | State::Aborted, _) => MachineState::Held,
        (State::Waiting | State::Done, ExecState::Idle) => MachineState::Idle,
        (State::Running, ExecState::Held) => MachineState::Starved,
        _ => MachineState::Moving,
    }
}
