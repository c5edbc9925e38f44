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
use motion_kernel::hal::OutputState;
use motion_kernel::homing::HomingFigures;
use motion_kernel::law::Pulse;
use motion_kernel::link::{BoardLink, ParameterBuffer, WriteError};
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::program::SupplyError;
use motion_kernel::queue::LiveFeeder;
use motion_kernel::scope::{BoardScope, Command, Log};
use rtic_core::Mutex;

use crate::control::Control;
use crate::homing::BoardHoming;
use crate::log::LogLine;
use crate::machine::Machine;
use crate::parameters::BoardParameters;
use crate::report::{FlightDump, Report};
use crate::streamed::{Requests, Streamed};

mod homing;
#[cfg(test)]
mod tests;
mod transmit;

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
                    control.forget_homing();
                }
            }
            here.is_some()
        })
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
