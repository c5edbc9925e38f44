//! The background of a board that a PC drives over the link.
//!
//! Consumes the bytes of the wire and the tick's results in [`Control`]; produces items for the streams, switches drives and
//! outputs as the operator and the program say, and tells the PC what the machine does. Runs in the time that the ticks leave:
//! the board calls [`Linked::poll`] and [`Linked::transmit`], over and over.
//!
//! Nothing from the wire enables drives but the operator's command, and that only without a fault and with inputs that allow
//! it.

use core::convert::Infallible;

use motion_kernel::exec::ExecState;
use motion_kernel::fault::{Fault, FaultKind};
use motion_kernel::flight::frame_max;
use motion_kernel::hal::OutputState;
use motion_kernel::homing::{HomingFigures, HomingInput, HomingStep};
use motion_kernel::jog::Jog;
use motion_kernel::law::Pulse;
use motion_kernel::link::{
    BoardLink, Came, HomingFailure, ParameterBuffer, State as MachineState, Status, WriteError,
};
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::program::SupplyError;
use motion_kernel::queue::LiveFeeder;
use motion_kernel::scope::{BODY_MAX, BoardScope, Command, Log};
use rtic_core::Mutex;

use crate::control::{Control, Index};
use crate::homing::BoardHoming;
use crate::log::LogLine;
use crate::machine::Machine;
use crate::parameters::BoardParameters;
use crate::report::{FlightDump, Report};
use crate::streamed::{Requests, Streamed};

/// Time between two messages about the machine \[ms\].
const STATUS_MS: u32 = 20;
/// The longest frame of a row of the flight recorder \[bytes\].
const FLIGHT_FRAME_MAX: usize = frame_max(9);

/// The background. `ITEMS` and `PLACES` are those of [`Streamed`]; there is room for `PARAMETERS` bytes of new parameters (three
/// axes of the reference machine take 578, nine less than 1800, each that is homed less than 110 more, each that is compensated less than 160), none on a board that can't store them.
pub struct Linked<
    'a,
    R: Real,
    const AXES: usize,
    const ITEMS: usize,
    const PLACES: usize,
    const PARAMETERS: usize = 0,
> {
    streamed: Streamed<'a, R, AXES, ITEMS, PLACES>,
    board: BoardParameters,
    /// The present parameters: a compiled program, whose items do not matter.
    parameters: &'a [u8],
    new_parameters: ParameterBuffer<PARAMETERS>,
    /// How many bytes of these are to be stored.
    to_store: Option<usize>,
    /// Spindle or coolant may be on.
    is_on: bool,
    status_ms: u32,
    /// Why the program ends early.
    refused: Option<SupplyError<Infallible>>,
    /// The log has said so.
    has_refused: bool,
    /// The log has said that there is a fault.
    has_faulted: bool,
    dump: FlightDump,
    report: Report,
    scope: Option<BoardScope<'a, R, AXES>>,
    homing: BoardHoming<AXES>,
}

impl<'a, R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize, const PARAMETERS: usize>
    Linked<'a, R, AXES, ITEMS, PLACES, PARAMETERS>
{
    /// With drives off. What is planned anew has ramps of `pulse`s.
    #[must_use]
    pub fn new(
        board: &BoardParameters,
        link: BoardLink,
        feeder: LiveFeeder<'a, R, AXES>,
        pulse: Pulse,
    ) -> Self {
        let streamed = Streamed::new(link, feeder, pulse, board.tick_s(), board.leads);
        Self {
            streamed,
            board: *board,
            parameters: &[],
            new_parameters: ParameterBuffer::new(),
            to_store: None,
            is_on: false,
            status_ms: 0,
            refused: None,
            has_refused: false,
            has_faulted: false,
            dump: FlightDump::default(),
            report: Report::default(),
            scope: None,
            homing: BoardHoming::new(&HomingFigures::NONE, pulse, board.tick_s()),
        }
    }

    /// From now on the PC may have axes homed that have figures here; without it every such command is refused.
    pub fn set_homing(&mut self, figures: &HomingFigures<AXES>, pulse: Pulse) {
        self.homing = BoardHoming::new(figures, pulse, self.board.tick_s());
    }

    /// From now on `parameters`, the present ones as a compiled program, may be read by the PC. Its items do not matter.
    pub fn set_parameters(&mut self, parameters: &'a [u8]) {
        self.parameters = parameters;
    }

    /// From now on the PC may have every tick: with the background's parts of a
    /// [`ScopeMemory`](motion_kernel::scope::ScopeMemory), whose tick's part [`Control::set_recorder`] takes.
    pub fn set_scope(&mut self, scope: BoardScope<'a, R, AXES>, log: &'a mut Log<AXES>) {
        self.scope = Some(scope);
        self.streamed.set_log(log);
    }

    /// Parameters that the PC has written, and that suit the board. It is to store them and to start anew with them;
    /// if it can't store them, [`Self::not_stored`].
    #[must_use]
    pub fn new_parameters(&self) -> Option<&[u8]> {
        self.new_parameters.bytes().get(..self.to_store?)
    }

    /// The new parameters could not be stored: the PC is told, and the present ones stay.
    pub fn not_stored(&mut self) {
        self.to_store = None;
        self.streamed.link_mut().refuse_parameters(&mut self.new_parameters, WriteError::Storage);
    }

    /// One poll: takes what `next_byte` has, obeys the operator, plans, which may take several ticks. `next_byte` is that of
    /// [`Streamed::plan`].
    pub fn poll<const ROWS: usize, const AFTER: usize>(
        &mut self,
        next_byte: &mut dyn FnMut() -> Option<u8>,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        self.poll_unless(&|| false, next_byte, control);
    }

    /// [`Self::poll`] with a hold on the board; see [`Streamed::plan`].
    pub fn poll_unless<const ROWS: usize, const AFTER: usize>(
        &mut self,
        is_hold_asked: &dyn Fn() -> bool,
        next_byte: &mut dyn FnMut() -> Option<u8>,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        let requests = self.streamed.receive(next_byte);
        self.end_homing(requests, is_hold_asked());
        let is_given_up = self.act(requests, control);
        self.home(control);
        // Behind what may have enabled the drives.
        self.receive_parameters(control);
        self.refused = self.streamed.plan(is_hold_asked, next_byte).err();
        self.switch(is_given_up, control);
    }

    /// Puts away what came of new parameters, and checks them where they are complete.
    #[inline(never)]
    fn receive_parameters<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        let Self { streamed, board, new_parameters, to_store, .. } = self;
        let link = streamed.link_mut();
        if PARAMETERS == 0 {
            // There is no room for any, so they are refused.
            link.put_parameters(new_parameters, true);
            return;
        }
        let is_off = control.lock(|control| control.kernel.is_off());
        if !link.put_parameters(new_parameters, is_off) {
            return;
        }
        // Of those before.
        *to_store = None;
        let Some(bytes) = new_parameters.take() else { return };
        let error = match Machine::<R, AXES>::new(bytes, board) {
            Ok(_) => {
                *to_store = Some(bytes.len());
                return;
            }
            Err(_) => WriteError::Unsuitable,
        };
        link.refuse_parameters(new_parameters, error);
    }

    /// What the operator asks of drives and faults; and the end of an abort. Whether the program was given up.
    #[inline(never)]
    fn act<const ROWS: usize, const AFTER: usize>(
        &mut self,
        requests: Requests,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> bool {
        let Self { streamed, board, to_store, homing, .. } = self;
        let live = streamed.state();
        // Homing aborts its own moves.
        let homes = homing.running().is_some();
        // Parameters that are to be stored need the drives off.
        let may_enable = to_store.is_none();
        control.lock(|control| {
            let is_waiting = matches!(control.seen().state, ExecState::Stopped | ExecState::Dwell);
            // At a program stop, or in a dwell, there is nothing to come to rest from.
            let is_aborted = !homes && (live == State::Aborted || live == State::Aborting && is_waiting);
            let tick = control.kernel.trace().tick;
            if requests.clears_fault {
                note(streamed, tick, Command::ClearFault);
                if let Some(Fault { kind, .. }) = control.kernel.fault() {
                    forget_lost(&kind, homing);
                }
                if control.kernel.clear_fault().is_some() {
                    control.flight.clear();
                }
            }
            let here = match requests.power {
                Some(false) => {
                    note(streamed, tick, Command::StandHere);
                    Some(control.kernel.stand_here())
                }
                Some(true) if may_enable && control.may_enable() => {
                    let settle_ticks = board.settle_ticks();
                    note(streamed, tick, Command::StandHere);
                    note(streamed, tick, Command::Enable { settle_ticks });
                    let here = control.kernel.stand_here();
                    control.kernel.enable(settle_ticks);
                    Some(here)
                }
                _ if is_aborted => {
                    control.kernel.rest_here().inspect(|_| note(streamed, tick, Command::RestHere))
                }
                _ => None,
            };
            if requests.resumes {
                note(streamed, tick, Command::Resume);
                control.kernel.resume();
            }
            if let Some(here) = here {
                streamed.restart(&mut control.intake, here, tick);
                if homing.rests() {
                    control.forget_index();
                }
            }
            here.is_some()
        })
    }

    /// What ends homing early, or asks for it.
    #[inline(never)]
    fn end_homing(&mut self, requests: Requests, is_hold_asked: bool) {
        let Self { streamed, homing, .. } = self;
        let failure = if requests.power == Some(false) {
            Some(HomingFailure::DrivesOff)
        } else if requests.aborts || requests.holds || is_hold_asked {
            Some(HomingFailure::Aborted)
        } else {
            streamed.is_silent().then_some(HomingFailure::Silent)
        };
        if failure.is_some_and(|failure| homing.end(failure)) {
            streamed.abort();
        }
        match requests.homes {
            Some(axes) if requests.may_home => homing.ask(axes),
            Some(axes) => homing.give_up(axes, failure.unwrap_or(HomingFailure::Aborted)),
            None => {}
        }
    }

    /// Goes on with homing, a step of it.
    #[inline(never)]
    fn home<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        let Self { streamed, homing, .. } = self;
        let live = streamed.state();
        control.lock(|control| {
            if let Some(Fault { kind, .. }) = control.kernel.fault() {
                forget_lost(&kind, homing);
                if homing.is_under_way() {
                    control.forget_index();
                    homing.fail(HomingFailure::Fault);
                }
            }
            if !homing.is_under_way() {
                return;
            }
            if control.kernel.is_off() {
                control.forget_index();
                return homing.fail(HomingFailure::DrivesOff);
            }
            if !control.kernel.is_on() {
                return;
            }
            let tick = control.kernel.trace().tick;
            if homing.is_asked() {
                if matches!(live, State::Aborting | State::Aborted) {
                    return;
                }
                let Some(here) = control.kernel.rest_here() else { return };
                note(streamed, tick, Command::RestHere);
                homing.begin_next();
                return streamed.restart_homing(None, &mut control.intake, here, tick);
            }
            let Some((axis, run)) = homing.running() else { return };
            let index = control.index();
            if index == Index::Missing {
                run.lacks_index();
                control.forget_index();
            }
            let trace = control.kernel.trace();
            let seen = HomingInput {
                set: trace.executed.setpoints.each_ref().map(|setpoint| setpoint.position),
                counts: trace.axes.get(axis).map(|axis| axis.counts).unwrap_or_default(),
                is_home: trace.inputs.axes.get(axis).is_some_and(|axis| axis.is_home()),
                index: if let Index::Latched(counts) = index { Some(counts) } else { None },
                state: match live {
                    State::Waiting if trace.executed.state != ExecState::Moving => State::Done,
                    State::Waiting => State::Running,
                    live => live,
                },
            };
            let step = run.poll(&seen);
            homing.tell();
            match step {
                Ok(HomingStep::Wait) => {}
                Ok(HomingStep::Stop) => streamed.abort(),
                Ok(HomingStep::ArmIndex) => control.arm_index(axis),
                Ok(HomingStep::Move(jog)) => rest(Some(Some(jog)), streamed, control, tick),
                Ok(HomingStep::Reference(counts, position)) => {
                    control.forget_index();
                    let Some(set) = control.kernel.reference(axis, counts, position) else {
                        homing.fail(HomingFailure::Failed);
                        return streamed.abort();
                    };
                    note(streamed, tick, Command::Reference { axis: axis as u16, counts, position });
                    streamed.restart_homing(None, &mut control.intake, set, tick);
                }
                Ok(HomingStep::Done(homed)) => {
                    homing.found(homed);
                    let goes_on = homing.begin_next();
                    rest(goes_on.then_some(None), streamed, control, tick);
                }
                Err(error) => {
                    control.forget_index();
                    homing.fail(error.into());
                    rest(None, streamed, control, tick);
                }
            }
        });
    }

    /// Switches spindle and coolant where the program says so, and all off where it was given up.
    // In its own stack frame, as `act`, `line` and `transmit`: what they need is free again while motion is planned.
    #[inline(never)]
    fn switch<const ROWS: usize, const AFTER: usize>(
        &mut self,
        is_given_up: bool,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        let to = match self.streamed.state() {
            _ if is_given_up => OutputState::OFF,
            State::Failed => OutputState::OFF,
            // Nothing turns before the drives hold the machine.
            _ if !control.lock(|control| control.kernel.is_on()) => return,
            _ => match self.streamed.switch() {
                Some(to) => to,
                None => return,
            },
        };
        if core::mem::replace(&mut self.is_on, to != OutputState::OFF) || self.is_on {
            control.lock(|control| control.switch(to));
        }
    }

    /// A line to log, if any, at tick `now`; for boards with a log, right after a tick. Bytes of the link were lost
    /// `bytes_lost` times since the start.
    #[inline(never)]
    pub fn line<const ROWS: usize, const AFTER: usize>(
        &mut self,
        now: u32,
        bytes_lost: u32,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        let fault = control.lock(|control| control.seen().fault);
        let had_faulted = core::mem::replace(&mut self.has_faulted, fault.is_some());
        if let Some(fault) = fault
            && !had_faulted
        {
            self.dump = FlightDump::default();
            return Some(LogLine::Fault(fault));
        }
        let had_refused = core::mem::replace(&mut self.has_refused, self.refused.is_some());
        if let Some(error) = self.refused
            && !had_refused
        {
            return Some(LogLine::Refused(error.of_any_source()));
        }
        if fault.is_some()
            && let Some(line) = self.dump.line(now, &self.board, control)
        {
            return Some(line);
        }
        self.report.line(now, &self.board, [self.streamed.starvations(), bytes_lost], control)
    }

    /// Notes the duration of a poll, log included, in cycles of the board's counter.
    pub fn note_poll(&mut self, cycles: u32) {
        self.report.note_poll(cycles);
    }

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

/// At rest between two moves of homing: begins anew there with the next one, if there is one yet, or, after homing, with what the
/// link brings.
fn rest<
    'a,
    R: Real,
    const AXES: usize,
    const ITEMS: usize,
    const PLACES: usize,
    const ROWS: usize,
    const AFTER: usize,
>(
    homes: Option<Option<Jog<AXES>>>,
    streamed: &mut Streamed<'a, R, AXES, ITEMS, PLACES>,
    control: &mut Control<'a, R, AXES, ROWS, AFTER>,
    tick: u64,
) {
    // Homing moves on at rest only.
    let Some(here) = control.kernel.rest_here() else { return };
    note(streamed, tick, Command::RestHere);
    match homes {
        Some(jog) => streamed.restart_homing(jog, &mut control.intake, here, tick),
        None => streamed.restart(&mut control.intake, here, tick),
    }
}

/// Tells the scope what was done to the kernel.
fn note<R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize>(
    streamed: &mut Streamed<'_, R, AXES, ITEMS, PLACES>,
    tick: u64,
    command: Command,
) {
    if let Some(log) = streamed.log_mut() {
        log.command(tick, command);
    }
}

/// After these faults an axis does not know any more where it is.
fn forget_lost<R, const AXES: usize>(kind: &FaultKind<R>, homing: &mut BoardHoming<AXES>) {
    match *kind {
        FaultKind::EncoderLost { axis } | FaultKind::EncoderJump { axis, .. } => {
            if let Some(homed) = homing.homed.get_mut(axis) {
                *homed = None;
            }
        }
        FaultKind::Encoder => homing.homed = [None; AXES],
        _ => {}
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

#[cfg(test)]
mod tests {
    use hal_sim::{HomeParameters, IndexParameters, SimHome, SimHomes, SwitchParameters};
    use motion_kernel::fault::FaultKind;
    use motion_kernel::flight::{FlightRecorder, FlightRow};
    use motion_kernel::hal::Spindle;
    use motion_kernel::homing::{AxisHoming, Homed, HomingConfig};
    use motion_kernel::jog::Direction;
    use motion_kernel::kernel::Kernel;
    use motion_kernel::link::{Event, FRAME_MAX, HomingProgress, HostLink, Mode};
    use motion_kernel::program::Item;
    use motion_kernel::queue::LiveStreams;
    use motion_kernel::units::{Counts, Position};
    use rtic_core::Exclusive;

    use super::*;
    use crate::fixture::{AXES, BOARD, IdealDrives, Random, TICK_S, end, identity, machine};
    use crate::runs::to_start;

    type Host = HostLink<AXES, 64, 8192>;
    type State = MachineState;

    const ITEMS: usize = 8;

    /// A program from `from` on: a straight way to the stringer's start, and the stringer.
    fn stringer(from: [Position; AXES]) -> Vec<Option<Item<AXES>>> {
        let machine = machine();
        let way = to_start(machine.header(), from)
            .expect("a way")
            .map(|item| item.unwrap_or_else(|never| match never {}));
        way.chain(machine.program.items().map(|item| item.expect("sound"))).map(Some).chain([None]).collect()
    }

    /// What an operator's side knows and does.
    struct Operator {
        host: Host,
        status: Option<Status<AXES>>,
        /// What it still has to send.
        items: std::collections::VecDeque<Option<Item<AXES>>>,
        is_ready: bool,
        /// The fault that the board's inputs find from now on.
        unhealthy: Option<FaultKind<f32>>,
        /// The board's own hold.
        is_held: bool,
        /// Nothing comes from the operator any more.
        is_silent: bool,
        /// So many frames in a thousand are cut, in both directions.
        loses: u64,
        random: Random,
        /// Rows of the flight recorder that have come.
        flight: Vec<FlightRow<f64, AXES>>,
        flight_rows: Option<u16>,
    }

    impl Operator {
        fn state(&self) -> Option<State> {
            self.status.map(|status| status.state)
        }

        /// Everything is sent and driven.
        fn is_done(&self) -> bool {
            self.items.is_empty()
                && self.host.waiting() == 0
                && self.status.is_some_and(|status| {
                    status.state == State::Idle
                        && status.aborts == self.host.controls().aborts
                        && status.taken == self.host.confirmed()
                })
        }
    }

    /// What was seen of a board.
    struct Seen {
        /// Every state with the set position when it was told first.
        states: Vec<(State, [Position; AXES])>,
        drives: IdealDrives,
        lines: Vec<LogLine<f32, AXES>>,
    }

    /// A board and an operator over a good wire, until `script` says that it is over; it is called before every tick.
    fn board(script: impl FnMut(u32, &mut Operator) -> bool) -> Seen {
        board_with([const { None }; AXES], script)
    }

    /// The same with home switches and index pulses.
    fn board_with(
        homes: [Option<SimHome>; AXES],
        mut script: impl FnMut(u32, &mut Operator) -> bool,
    ) -> Seen {
        let machine = machine();
        let header = *machine.header();
        let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let (feeder, intake) = streams.split(header.rules, header.start);
        let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
        let mut control = Control::new(kernel, intake, &mut flight);
        let link = BoardLink::new(3, identity(ITEMS));
        let mut linked = Linked::<f32, AXES, ITEMS, 64, 0>::new(&BOARD, link, feeder, header.pulse);
        linked.set_homing(&figures(), header.pulse);
        let mut drives = IdealDrives::new();
        drives.homes = SimHomes::new(homes);
        let mut operator = Operator {
            host: Host::new(1),
            status: None,
            items: std::collections::VecDeque::new(),
            is_ready: false,
            unhealthy: None,
            is_held: false,
            is_silent: false,
            loses: 0,
            random: Random(7),
            flight: Vec::new(),
            flight_rows: None,
        };
        let (mut out, mut to_board) = ([0; FRAME_MAX], std::collections::VecDeque::new());
        let (mut states, mut lines): (Vec<(State, _)>, _) = (Vec::new(), Vec::new());
        for now in 1..200_000 {
            if script(now, &mut operator) {
                return Seen { states, drives, lines };
            }
            let Operator {
                host,
                items,
                status,
                is_ready,
                unhealthy,
                is_held,
                is_silent,
                loses,
                random,
                flight,
                flight_rows,
            } = &mut operator;
            let mut cut = |length: usize| {
                if random.below(1000) < *loses { random.below(length as u64 + 1) as usize } else { length }
            };
            while let Some(item) = items.front()
                && *is_ready
                && host.push(item.as_ref()).expect("short")
            {
                items.pop_front();
            }
            let now_ms = now / 2;
            let length = if *is_silent { 0 } else { host.transmit(now_ms, &mut out) };
            to_board.extend(out[..cut(length)].iter().copied());
            drives.now = now;
            control.tick(*unhealthy, None, &mut drives);
            let mut control = Exclusive(&mut control);
            lines.extend(linked.line(now, 0, &mut control));
            linked.poll_unless(&|| *is_held, &mut || to_board.pop_front(), &mut control);
            let length = linked.transmit(now_ms, &mut control, &mut out);
            host.receive(&out[..cut(length)], now_ms, &mut |event| match event {
                Event::Status(told) => {
                    if states.last().is_none_or(|(state, _)| *state != told.state) {
                        states.push((told.state, told.set));
                    }
                    *status = Some(told);
                }
                Event::Ready { .. } => *is_ready = true,
                Event::Flight { rows, kept, .. } => {
                    flight.extend(kept);
                    *flight_rows = Some(rows);
                }
                Event::Welcome(found) => assert_eq!(found, identity(ITEMS)),
                other => panic!("{other:?}"),
            });
        }
        panic!("it never ends: {states:?}")
    }

    /// The states alone.
    fn names(seen: &Seen) -> Vec<State> {
        seen.states.iter().map(|&(state, _)| state).collect()
    }

    /// Enables, drives the stringer from where the machine stands, and is over.
    fn drive(step: &mut u32, operator: &mut Operator) -> bool {
        match *step {
            0 if operator.status.is_some_and(|status| status.is_ready) => {
                assert!(operator.host.enable(true));
                operator.is_ready = false;
                *step = 1;
            }
            1 if operator.is_ready && operator.state() == Some(State::Held) => {
                operator.items.extend(stringer(operator.status.expect("held").set));
                assert!(operator.host.press(Mode::Run));
                *step = 2;
            }
            2 if operator.is_done() => *step = 3,
            _ => {}
        }
        *step == 3
    }

    #[test]
    fn a_program_is_driven_from_where_the_machine_stands() {
        let mut step = 0;
        let seen = board(|_, operator| drive(&mut step, operator));
        assert_eq!(names(&seen), [State::Off, State::Held, State::Moving, State::Idle]);
        assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
        assert!(seen.drives.is_enabled);
    }

    /// What is told to be driven is where motion is: on the piece after it, in every status; and the next program counts anew.
    #[test]
    fn pieces_are_counted_as_they_are_driven() {
        let (mut step, mut path, mut last, mut seen) = (0, Vec::new(), 0, 0);
        board(|now, operator| {
            let before = step;
            let is_over = drive(&mut step, operator);
            if (before, step) == (1, 2) {
                let items = stringer(operator.status.expect("held").set);
                path = items
                    .into_iter()
                    .filter_map(|item| match item? {
                        Item::Line { start, length, .. } | Item::Septic { start, length, .. } => {
                            Some((start, length))
                        }
                        Item::EndOfStretch(end) => Some((end, Position::ZERO)),
                        _ => None,
                    })
                    .collect();
            }
            let Some(status) =
                operator.status.filter(|status| status.aborts == operator.host.controls().aborts)
            else {
                return is_over;
            };
            assert!(status.driven >= last, "tick {now}: {} after {last}", status.driven);
            last = status.driven;
            if step == 2
                && let Some((start, length)) = path.get(last as usize)
            {
                let squares =
                    status.set.iter().zip(start).map(|(set, start)| (*set - *start).to_mm().powi(2));
                let from_start_mm = squares.sum::<f64>().sqrt();
                assert!(
                    from_start_mm <= length.to_mm() + 1e-4,
                    "tick {now}: {from_start_mm} mm of {length:?}"
                );
                seen = seen.max(last);
            }
            is_over
        });
        assert_eq!(last as usize, path.len());
        assert!(seen > 10 && path.len() >= 15, "{seen} of {}", path.len());
    }

    /// After an abort nothing of the program before counts for the next one.
    #[test]
    fn after_an_abort_the_count_begins_anew() {
        let mut step = 0;
        let mut counts = Vec::new();
        board(|now, operator| {
            if now < 2500 {
                drive(&mut step, operator);
            } else if now == 2500 {
                counts.push(operator.status.expect("told").driven);
                assert!(operator.host.abort());
                operator.items.clear();
            }
            if let Some(status) = operator
                .status
                .filter(|status| now > 2500 && status.aborts == operator.host.controls().aborts)
            {
                counts.push(status.driven);
            }
            now == 5000
        });
        assert!(
            counts[0] > 0 && counts.len() > 100 && counts[1..].iter().all(|count| *count == 0),
            "{counts:?}"
        );
    }

    /// Off before the operator's command, whatever else was pressed.
    #[test]
    fn only_the_operators_command_enables() {
        let seen = board(|now, operator| {
            if now % 300 == 100 && operator.is_ready {
                assert!(operator.host.press(Mode::Run));
                operator.items.push_back(Some(Item::Switch(ON)));
                operator.items.extend(stringer(machine().header().start));
            }
            now == 5000
        });
        assert_eq!(names(&seen), [State::Off]);
        assert!(!seen.drives.is_enabled && seen.drives.switched.is_empty());
    }

    /// An abort in the middle of a program that the board has only the beginning of: nothing of it is driven any more, and
    /// another program follows from where the machine came to rest.
    #[test]
    fn after_an_abort_another_program_is_driven() {
        for at in [2000, 2500, 3100, 4000] {
            println!("abort at {at}");
            let (mut step, mut next) = (0, 1);
            let seen = board(|now, operator| {
                if now < at {
                    assert!(!drive(&mut step, operator));
                    return false;
                }
                if now == at {
                    assert!(
                        operator.host.abort()
                            && operator.host.control(|controls| {
                                controls.override_permille = 500;
                            })
                    );
                    operator.items.clear();
                    operator.is_ready = false;
                    return false;
                }
                drive(&mut next, operator)
            });
            use MachineState::{Held, Idle, Moving, Off};
            assert_eq!(names(&seen), [Off, Held, Moving, Held, Moving, Idle], "{:?}", seen.states);
            let ((_, before), (_, after)) = (seen.states[3], seen.states[4]);
            // Comes to rest at a place of the path, and goes on from there.
            assert_ne!(before, end());
            let gone_mm = after.iter().zip(&before).map(|(a, b)| (*a - *b).to_mm().abs()).fold(0.0, f64::max);
            assert!(gone_mm < 1.0, "{gone_mm}");
            assert_eq!(seen.states[5].1, end());
        }
    }

    /// The emergency stop in motion: off, with the fault until it is cleared; nothing moves before drives are enabled again.
    #[test]
    fn a_fault_is_told_and_cleared() {
        let (mut step, mut next, mut is_off) = (0, 0, 0);
        let seen = board(|now, operator| {
            match now {
                ..3000 => {
                    drive(&mut step, operator);
                    return false;
                }
                3000 => operator.unhealthy = Some(FaultKind::EmergencyStop),
                3600 => {
                    let fault = operator.status.and_then(|status| status.fault).expect("a fault");
                    assert_eq!((fault.kind, fault.tick), (FaultKind::EmergencyStop, 2999));
                    // Neither is obeyed in a fault.
                    assert!(operator.host.enable(true) && operator.host.press(Mode::Run));
                    operator.items.clear();
                    operator.unhealthy = None;
                }
                4000 => {
                    assert_eq!(operator.state(), Some(State::Off));
                    assert!(operator.host.clear_fault());
                }
                4100.. => {
                    let status = operator.status.expect("told");
                    assert_eq!(status.fault, None);
                    is_off += u32::from(now < 4200 && status.state == State::Off);
                    return now > 4200 && drive(&mut next, operator);
                }
                _ => {}
            }
            false
        });
        use MachineState::{Held, Idle, Moving, Off};
        assert_eq!(is_off, 100);
        let names = names(&seen);
        assert_eq!(names.first_chunk(), Some(&[Off, Held, Moving]));
        assert_eq!(names.last_chunk(), Some(&[Off, Held, Moving, Idle]), "{names:?}");
        assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
        // The log has the fault once, and then what the flight recorder kept.
        let told = seen.lines.iter().filter(|line| matches!(line, LogLine::Fault(_)));
        let rows = seen.lines.iter().filter(|line| matches!(line, LogLine::Flight(_)));
        assert_eq!((told.count(), rows.count()), (1, 16));
    }

    /// An item that does not follow the one before it: told by the state and once in the log.
    #[test]
    fn what_is_refused_is_told() {
        let mut step = 0;
        let seen = board(|_, operator| {
            let before = step;
            assert!(!drive(&mut step, operator));
            if (before, step) == (1, 2) {
                // Without the way to the start.
                operator.items.drain(..4);
            }
            operator.state() == Some(State::Refused)
        });
        let told: Vec<_> = seen.lines.iter().filter(|line| matches!(line, LogLine::Refused(_))).collect();
        assert!(matches!(told[..], [LogLine::Refused(SupplyError::Rejected(_))]), "{told:?}");
    }

    /// The board's own hold, short or long: at rest until it is over and the operator resumes.
    #[test]
    fn a_hold_on_the_board_waits_for_the_operator() {
        for ticks in [1, 1500] {
            let mut step = 0;
            let seen = board(|now, operator| {
                operator.is_held = (2500..2500 + ticks).contains(&now);
                // What is pressed while it lasts is in vain.
                if now == 3500 || now == 2500 + ticks + 1500 {
                    assert_eq!(operator.state(), Some(State::Held), "{ticks} {now}");
                    assert!(now == 3500 && ticks == 1 || operator.host.press(Mode::Run));
                }
                drive(&mut step, operator)
            });
            use MachineState::{Held, Idle, Moving, Off};
            assert_eq!(names(&seen), [Off, Held, Moving, Held, Moving, Idle]);
            assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
        }
    }

    /// A dead man's time \[ms\], in ticks, and how often a PC says something at least.
    const DEAD_MAN_MS: u16 = 250;
    const DEAD_MAN_TICKS: u32 = 500;
    const SAYS_TICKS: u32 = 200;

    /// A PC falls silent: with a dead man the board holds within the time and the stop, and its position is known; it stays
    /// there when the PC is back, until the next resume. Without one it drives what it has.
    #[test]
    fn a_dead_man_holds() {
        const FROM: u32 = 2600;
        let held_at = |dead_man_ms: u16, held_from: Option<u32>| {
            let (mut step, mut held) = (0, None);
            let seen = board(|now, operator| {
                operator.is_held = held_from.is_some_and(|from| now >= from) && held.is_none();
                operator.is_silent = held_from.is_none() && (FROM..FROM + 3000).contains(&now);
                let before = step;
                let is_over = drive(&mut step, operator);
                if (before, step) == (1, 2) {
                    assert!(operator.host.control(|controls| controls.dead_man_ms = dead_man_ms));
                }
                if now > FROM && operator.state() == Some(State::Held) {
                    held.get_or_insert(now);
                }
                // Long after the PC is back.
                if held.is_some() && now == FROM + 5000 {
                    assert_eq!(operator.state(), Some(State::Held));
                    assert!(operator.host.press(Mode::Run));
                }
                is_over
            });
            assert_eq!(seen.states.last().map(|(state, set)| (*state, *set)), Some((State::Idle, end())));
            let rests = seen.states.iter().filter(|(state, _)| *state == State::Held).count();
            // Before the start, and here.
            assert_eq!(rests, 1 + usize::from(held.is_some()));
            held
        };
        let latest = FROM + DEAD_MAN_TICKS;
        let stop_ticks = held_at(0, Some(latest)).expect("held") - latest;
        let held = held_at(DEAD_MAN_MS, None).expect("held");
        assert!(
            held > latest - SAYS_TICKS && held <= latest + 2 * stop_ticks,
            "{held} {latest} {stop_ticks}"
        );
        assert_eq!(held_at(0, None), None);
    }

    const ON: OutputState =
        OutputState { spindle: Spindle::Clockwise, speed_rpm: 9000.0, flood: true, mist: false };

    /// Spindle and coolant on before the motion and off after it, or off because of an abort.
    #[test]
    fn outputs_are_switched_and_off_after_an_abort() {
        for is_aborted in [false, true] {
            let mut step = 0;
            let seen = board(|now, operator| {
                let before = step;
                let is_over = drive(&mut step, operator);
                if (before, step) == (1, 2) {
                    operator.items.push_front(Some(Item::Switch(ON)));
                    operator.items.insert(operator.items.len() - 1, Some(Item::Switch(OutputState::OFF)));
                }
                if is_aborted && now == 3000 {
                    assert!(operator.host.abort());
                    operator.items.clear();
                }
                is_over || is_aborted && now == 5000
            });
            let switched: Vec<_> = seen.drives.switched.iter().map(|&(_, to)| to).collect();
            assert_eq!(switched, [ON, OutputState::OFF]);
            assert_eq!(seen.drives.switched[1].0 < 4500, is_aborted, "{:?}", seen.drives.switched);
        }
    }

    /// An abort at a program stop, in a dwell of minutes, and after an item that can't be executed: another program follows.
    #[test]
    fn an_abort_waits_for_nothing() {
        let dwell = Item::Dwell(motion_kernel::law::Ticks::from_seconds(600.0, TICK_S).expect("some ticks"));
        let stringer_of = |from| stringer(from).into_iter().flatten();
        let far = stringer_of(end()).find(|item| matches!(item, Item::Line { .. })).expect("a line");
        let waits = [(Item::Stop, State::Stopped), (dwell, State::Dwell), (far, State::Refused)];
        for (item, state) in waits {
            let (mut step, mut next, mut aborted) = (0, 1, None);
            let seen = board(|now, operator| {
                if let Some(aborted) = aborted {
                    assert!(now < aborted + 8000, "it waits at {:?}", operator.state());
                    return drive(&mut next, operator);
                }
                let before = step;
                drive(&mut step, operator);
                if (before, step) == (1, 2) {
                    operator.items.clear();
                    operator.items.push_front(Some(item));
                }
                if operator.state() == Some(state) {
                    assert!(operator.host.abort());
                    (aborted, operator.is_ready) = (Some(now), false);
                    operator.items.clear();
                }
                false
            });
            assert_eq!(seen.states.last(), Some(&(State::Idle, end())), "{state:?}");
        }
    }

    /// A program stop waits for the operator, and goes on.
    #[test]
    fn a_program_stop_waits() {
        let (mut step, mut stopped) = (0, 0);
        let seen = board(|_, operator| {
            let before = step;
            let is_over = drive(&mut step, operator);
            if (before, step) == (1, 2) {
                operator.items.push_front(Some(Item::Stop));
            }
            if operator.state() == Some(State::Stopped) {
                stopped += 1;
                if stopped == 500 {
                    assert!(operator.host.press(Mode::Run));
                }
            }
            is_over
        });
        use MachineState::{Held, Idle, Moving, Off, Stopped};
        assert!(stopped >= 500);
        let names: Vec<_> =
            names(&seen).into_iter().filter(|state| !matches!(state, Idle | Moving)).collect();
        assert_eq!(names, [Off, Held, Stopped]);
        assert_eq!(seen.states.last().map(|(state, set)| (*state, *set)), Some((Idle, end())));
    }

    /// All axes towards lesser positions; the second one with its index.
    fn figures() -> HomingFigures<AXES> {
        let rules = machine().header().rules;
        let at = |mm| Position::from_mm(mm).expect("in range");
        let axes = core::array::from_fn(|axis| {
            let config = HomingConfig {
                direction: Direction::Negative,
                fast_mm_s: 40.0,
                slow_mm_s: 2.0,
                travel_mm: 60.0,
                back_off_mm: 40.0,
                index_mm: (axis < 2).then_some(11.0),
                position: at(-50.0),
                park: Some(at(-45.0)),
            };
            let config = if axis == 0 { HomingConfig { index_mm: None, ..config } } else { config };
            Some(AxisHoming { config, feed_mm_s: rules.feed_mm_s, limits: rules.limits })
        });
        HomingFigures { axes }
    }

    /// Where switches close \[mm\], and index pulses every 10 mm.
    const CLOSES_MM: f64 = -20.0;

    fn homes() -> [Option<SimHome>; AXES] {
        machine().header().axes.map(|axis| {
            let counts = |mm: f64| (mm / axis.mm_per_count).round() as i64;
            let switch = SwitchParameters { closes_mm: (CLOSES_MM - 60.0, CLOSES_MM), hysteresis_mm: 0.2 };
            let index = IndexParameters { counts: counts(10.0).abs(), at: Counts(counts(CLOSES_MM - 3.0)) };
            let parameters = HomeParameters { switch: Some(switch), index: Some(index) };
            Some(SimHome::new(parameters, 0.0, Counts(0)))
        })
    }

    /// The count at which the index of an axis is.
    fn index_counts(axis: usize) -> i64 {
        ((CLOSES_MM - 3.0) / machine().header().axes[axis].mm_per_count).round() as i64
    }

    /// Enables, asks for `axes` to be homed with a dead man, and is over when that has ended; what it has come to, and every set position since.
    fn homed(
        axes: u16,
        homes: [Option<SimHome>; AXES],
        dead_man_ms: u16,
        mut meanwhile: impl FnMut(u32, &mut Operator),
    ) -> (HomingProgress, [Option<Homed>; AXES], Seen) {
        let (mut step, mut last, mut since) = (0, None, 0);
        let seen = board_with(homes, |now, operator| {
            let aborts = operator.host.controls().aborts;
            let told = operator.status.filter(|status| status.aborts == aborts);
            match step {
                0 if told.is_some_and(|status| status.is_ready) => {
                    assert!(operator.host.enable(true));
                    step = 1;
                }
                1 if told.is_some_and(|status| status.state == State::Held) => {
                    assert!(operator.host.home(axes, dead_man_ms));
                    // Before it is sent.
                    meanwhile(0, operator);
                    (step, since) = (2, now);
                }
                2 => {
                    meanwhile(now - since, operator);
                    if let Some(status) = told
                        && now > since + 10
                        && !matches!(status.homing, HomingProgress::None | HomingProgress::UnderWay { .. })
                    {
                        last = Some(status);
                        (step, since) = (3, now);
                    }
                }
                // What has ended stays at rest.
                3 if now > since + 400 => {
                    let (status, last) = (operator.status.expect("told"), last.expect("ended"));
                    assert_eq!((status.set, status.homing), (last.set, last.homing), "it moves");
                    return true;
                }
                _ => {}
            }
            false
        });
        let last = last.expect("ended");
        (last.homing, last.homed, seen)
    }

    /// One axis after the other, each to its reference and its park position; over a wire that loses a tenth, too, to the count.
    #[test]
    fn axes_are_homed_one_after_the_other() {
        let park = Position::from_mm(-45.0).expect("in range");
        let mut clean = None;
        for loses in [0, 100, 300] {
            println!("loses {loses} of 1000 frames");
            let (progress, found, seen) = homed(0b110, homes(), 3000, |_, operator| operator.loses = loses);
            assert_eq!(progress, HomingProgress::Done);
            let [None, Some(y), Some(z)] = found else { panic!("{found:?}") };
            assert_eq!(y.counts, Counts(index_counts(1)));
            assert_eq!(z.index_counts, None);
            assert_eq!(*clean.get_or_insert(found), found);
            let (state, set) = *seen.states.last().expect("told");
            assert_eq!((state, [set[1], set[2]]), (State::Held, [park; 2]));
            let names = names(&seen);
            assert_eq!(names, [State::Off, State::Held, State::Homing, State::Held]);
        }
    }

    #[test]
    fn what_cannot_be_homed_is_refused_by_name() {
        let failed = |axis, failure| HomingProgress::Failed { axis, failure };
        let of = |axes, homes| homed(axes, homes, DEAD_MAN_MS, |_, _| {}).0;
        assert_eq!(of(0b1000, homes()), failed(3, HomingFailure::NoSettings));
        assert_eq!(of(0, homes()), failed(0, HomingFailure::NoSettings));
        assert_eq!(of(0b100, [const { None }; AXES]), failed(2, HomingFailure::NoSwitch { travel_mm: 60.0 }));
        // Where the switch is and no input for the index.
        let none = [None, None, homes()[2].clone()];
        assert_eq!(of(0b110, none), failed(1, HomingFailure::NoSwitch { travel_mm: 60.0 }));
    }

    /// Whatever ends homing, at any time, ends it at rest and by its name; the axes before stay homed.
    #[test]
    fn what_ends_homing_early_is_named() {
        for at in [0, 1, 300, 900, 2000, 3500, 5000] {
            println!("after {at} ticks");
            let ended = |does: &mut dyn FnMut(u32, &mut Operator)| {
                let (progress, _, seen) =
                    homed(0b11, homes(), DEAD_MAN_MS, |ticks, operator| does(ticks, operator));
                let HomingProgress::Failed { failure, .. } = progress else { panic!("{progress:?}") };
                (failure, seen.states.last().map(|&(state, _)| state))
            };
            let aborts = ended(&mut |ticks, operator| {
                if ticks == at {
                    assert!(operator.host.abort());
                }
            });
            assert_eq!(aborts, (HomingFailure::Aborted, Some(State::Held)));
            let holds = ended(&mut |ticks, operator| {
                if ticks == at {
                    assert!(operator.host.press(Mode::Hold));
                }
            });
            assert_eq!(holds, (HomingFailure::Aborted, Some(State::Held)));
            let button = ended(&mut |ticks, operator| operator.is_held = ticks >= at);
            assert_eq!(button, (HomingFailure::Aborted, Some(State::Held)));
            // Back long after the time.
            let since = at.max(1);
            let silent = ended(&mut |ticks, operator| {
                operator.is_silent = (since..since + 2000).contains(&ticks);
            });
            assert_eq!(silent, (HomingFailure::Silent, Some(State::Held)));
            let off = ended(&mut |ticks, operator| {
                if ticks == at {
                    assert!(operator.host.enable(false));
                }
            });
            assert_eq!(off, (HomingFailure::DrivesOff, Some(State::Off)));
            let fault = ended(&mut |ticks, operator| {
                operator.unhealthy = (ticks >= at).then_some(FaultKind::EmergencyStop);
            });
            assert_eq!(fault, (HomingFailure::Fault, Some(State::Off)));
        }
    }

    /// An axis whose encoder was lost is not homed any more; the others are, also with the drives off in between.
    #[test]
    fn a_lost_encoder_is_not_homed() {
        let mut step = 0;
        let mut since = 0;
        board_with(homes(), |now, operator| {
            let aborts = operator.host.controls().aborts;
            let Some(status) = operator.status.filter(|status| status.aborts == aborts) else { return false };
            let is_homed = status.homed.map(|homed| homed.is_some());
            match step {
                0 => {
                    assert!(operator.host.enable(true));
                    step = 1;
                }
                1 if status.state == State::Held => {
                    assert!(operator.host.home(0b11, DEAD_MAN_MS));
                    step = 2;
                }
                2 if status.homing == HomingProgress::Done => {
                    assert_eq!(is_homed, [true, true, false]);
                    operator.unhealthy = Some(FaultKind::EncoderLost { axis: 1 });
                    (step, since) = (3, now);
                }
                3 if now > since + 500 => {
                    assert_eq!(is_homed, [true, false, false]);
                    operator.unhealthy = None;
                    assert!(operator.host.clear_fault() && operator.host.enable(true));
                    (step, since) = (4, now);
                }
                4 if now > since + 1000 => {
                    assert_eq!((is_homed, status.state), ([true, false, false], State::Held));
                    step = 5;
                }
                _ => {}
            }
            step == 5
        });
    }

    /// Nothing before a fault; then every row once and in order, however many frames are lost; nothing after the fault is cleared.
    #[test]
    fn the_flight_recorder_is_read() {
        for loses in [0, 300] {
            let (mut step, mut since) = (0, 0);
            board(|now, operator| {
                match step {
                    0 if operator.status.is_some() => {
                        operator.loses = loses;
                        operator.host.read_flight(0);
                        step = 1;
                    }
                    1 if operator.flight_rows.take() == Some(0) => {
                        assert!(operator.flight.is_empty());
                        operator.unhealthy = Some(FaultKind::EmergencyStop);
                        (step, since) = (2, now);
                    }
                    2 if now > since + 100 => {
                        operator.host.read_flight(0);
                        step = 3;
                    }
                    3 if operator.flight_rows.take().is_some() => {
                        let count = operator.flight.len();
                        if count < 16 {
                            operator.host.read_flight(count as u16);
                            return false;
                        }
                        let first = operator.flight[0].tick;
                        let ticks: Vec<u64> = operator.flight.iter().map(|row| row.tick).collect();
                        assert_eq!(ticks, (first..first + 16).collect::<Vec<_>>());
                        // Eight of them behind the fault's.
                        let faulted = operator.flight.iter().position(|row| row.is_faulted);
                        assert_eq!((faulted, operator.flight[7].tick), (Some(7), u64::from(since) - 1));
                        operator.unhealthy = None;
                        operator.flight.clear();
                        assert!(operator.host.clear_fault());
                        (step, since) = (4, now);
                    }
                    4 if now > since + 2000 => {
                        operator.host.read_flight(0);
                        step = 5;
                    }
                    5 if operator.flight_rows == Some(0) => return operator.flight.is_empty(),
                    _ => {}
                }
                false
            });
        }
    }

    /// Somebody else asks while a key is pressed: the board holds at once, though the other one is not silent.
    #[test]
    fn another_asker_holds_what_has_a_dead_man() {
        let (mut step, mut held) = (0, None);
        board(|now, operator| {
            if now < 2600 {
                let before = step;
                drive(&mut step, operator);
                if (before, step) == (1, 2) {
                    assert!(operator.host.control(|controls| controls.dead_man_ms = DEAD_MAN_MS));
                }
            } else if now == 2600 {
                (operator.host, operator.status) = (Host::new(77), None);
                operator.items.clear();
            } else if operator.state() == Some(State::Held) {
                held.get_or_insert(now);
            }
            now == 5000
        });
        assert!(held.is_some());
    }
}
