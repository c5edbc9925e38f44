//! A board at a port, of a machine file: the one [`Board`] there is. The simulated machine is behind a wire, too.

use std::mem::take;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use motion_kernel::link::{Event, HomingProgress, Mode, State};
use motion_kernel::units::Position;

use super::connection::{Connection, Heard};
use super::error::BoardError;
use super::interface::{Board, BoardAxis, BoardEvent, BoardInfo, BoardState, UnderWay};
use super::items::Source;
use super::job::Job;
use super::numbers::{Numbers, in_numbers};
use super::parameters;
use super::port::{Port, unique};
use super::scope::{Scope, Ticks};
use super::sender::{Permissions, Sender, Step, check, check_outputs};
use super::simulator::{self, SimulatedBoard};
use super::stops::Stops;
use super::trigger::{Around, CAPTURE_MAX, Condition};
use super::wire::Wire;
use crate::gcode::{self, AXES_MAX};
use crate::machine::Machine;
use crate::planning::{Executable, Mode as PlanMode, on_axis_count, plan_program, require_outputs};
use crate::simulate::home::Homes;
use crate::simulate::jog::{Keys, Press, WantedJog};
use crate::simulate::session::jog_axis;
use crate::simulate::{RunInfo, faults};
use crate::trace::{AxisTick, RunTrace, TraceRow};

/// After so long a silence of this side the board holds a jog \[ms\].
const DEAD_MAN_MS: u16 = 500;

/// Connects to the board at a port, a serial one at `baud` bits/s, or starts the simulated one.
///
/// # Errors
/// There is no board, or one for another machine.
pub fn open<const N: usize>(
    machine: &Machine<N>,
    port: &Port,
    baud: u32,
) -> Result<Box<dyn Board>, BoardError> {
    if *port == Port::Simulator {
        let (board, wire) = simulator::start(machine, unique(), 1.0)?;
        let mut wire = Some(Box::new(wire) as Box<dyn Wire>);
        let open = Box::new(move || wire.take().ok_or_else(|| std::io::ErrorKind::BrokenPipe.into()));
        let connection = Connection::<N>::open(open, unique())?;
        return Ok(Box::new(Operated::<N, N>::new(machine, port, connection, Some(board))?));
    }
    on_axis_count!(machine.axis_count(), in N, M => {
        let from = port.clone();
        let open = Box::new(move || from.open(baud));
        let mut connection = Connection::<M>::open(open, unique())?;
        connection.greet()?;
        Ok(Box::new(Operated::<N, M>::new(machine, port, connection, None)?))
    })
}

/// A program that is ready to be driven.
struct Loaded<const M: usize> {
    name: String,
    job: Arc<Job<M>>,
    stops: Stops,
}

/// What comes of reading and planning: the program, and notes.
type Planned<const M: usize> = Result<(Loaded<M>, Vec<String>), BoardError>;

/// What is driven.
enum Work<const M: usize> {
    Program(Sender<M>),
    /// A key, whether the machine has moved for it, and whether it is released.
    Jog {
        sender: Sender<M>,
        has_moved: bool,
        is_released: bool,
    },
    Homing(Sender<M>),
}

impl<const M: usize> Work<M> {
    fn sender(&mut self) -> &mut Sender<M> {
        match self {
            Self::Program(sender) | Self::Jog { sender, .. } | Self::Homing(sender) => sender,
        }
    }

    fn what(&self) -> UnderWay {
        match self {
            Self::Program(_) => UnderWay::Program,
            Self::Jog { .. } => UnderWay::Jog,
            Self::Homing(_) => UnderWay::Homing,
        }
    }
}

/// Ticks that are kept. The scope's thread fills it.
#[derive(Default)]
struct Capture<const M: usize> {
    wanted: Option<Wanted<M>>,
    rows: Vec<TraceRow<M>>,
    missing: u64,
    is_over: bool,
}

enum Wanted<const M: usize> {
    Around(Around<M>),
    /// So many more.
    Next(usize),
}

impl<const M: usize> Capture<M> {
    fn add(&mut self, row: &TraceRow<M>) {
        let Self { wanted, rows, is_over, .. } = self;
        *is_over = match wanted {
            None => return,
            Some(Wanted::Around(around)) => {
                around.take(row, &mut |row| rows.push(*row));
                around.is_over() || rows.len() >= CAPTURE_MAX
            }
            Some(Wanted::Next(left)) => {
                rows.push(*row);
                *left = left.saturating_sub(1);
                *left == 0
            }
        };
        if *is_over {
            *wanted = None;
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked has said so.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A board of `M` axes, with a machine of `N` places.
struct Operated<const N: usize, const M: usize> {
    machine: Arc<Machine<N>>,
    info: BoardInfo,
    /// A job without items.
    nothing: Arc<Job<M>>,
    axes: Arc<[String]>,
    connection: Connection<M>,
    planning: Option<Receiver<Planned<M>>>,
    program: Option<Loaded<M>>,
    work: Option<Work<M>>,
    is_at_stop: bool,
    capture: Arc<Mutex<Capture<M>>>,
    /// Behind the wire; it ends with this.
    _simulated: Option<SimulatedBoard>,
}

impl<const N: usize, const M: usize> Operated<N, M> {
    fn new(
        machine: &Machine<N>,
        port: &Port,
        mut connection: Connection<M>,
        simulated: Option<SimulatedBoard>,
    ) -> Result<Self, BoardError> {
        connection.greet()?;
        in_numbers!(connection.numbers(), R => machine.axes_config::<R>().map(|_| ()))
            .map_err(|error| BoardError::Program(Box::new(error)))?;
        let nothing = Arc::new(Job::<M>::new(machine, &[]));
        let identity = connection.identity().copied().ok_or(BoardError::Silent)?;
        check(&nothing, &identity)?;
        let travel = machine.travel();
        let axes = machine.driven_axes().iter().enumerate().map(|(place, axis)| BoardAxis {
            name: axis.name.clone(),
            unit: axis.unit().symbol(),
            travel_mm: travel[place].map(|ends| ends.map(Position::to_mm)),
            feed_mm_s: jog_axis(machine, place).feed_mm_s,
            has_homing: machine.axes[place].homing.is_some(),
        });
        let info = BoardInfo {
            machine: machine.name.clone(),
            port: port.to_string(),
            tick_s: identity.tick_s,
            is_fixed_point: identity.is_fixed_point,
            axes: axes.collect(),
        };
        Ok(Self {
            axes: machine.axis_names(),
            machine: Arc::new(machine.clone()),
            info,
            nothing,
            connection,
            planning: None,
            program: None,
            work: None,
            is_at_stop: false,
            capture: Arc::default(),
            _simulated: simulated,
        })
    }

    /// Something new may begin.
    fn require_idle(&self) -> Result<(), BoardError> {
        if self.work.is_some() {
            return Err(BoardError::UnderWay);
        }
        if self.connection.is_lost() {
            return Err(BoardError::Silent);
        }
        Ok(())
    }

    /// Takes what was planned meanwhile.
    fn take_planned(&mut self, events: &mut Vec<BoardEvent>) {
        let Some(planning) = &self.planning else { return };
        let planned = match planning.try_recv() {
            Ok(planned) => planned,
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err(BoardError::Program("planning has ended".into())),
        };
        self.planning = None;
        events.push(match planned {
            Ok((program, notes)) => {
                self.program = Some(program);
                BoardEvent::Loaded(notes)
            }
            Err(error) => BoardEvent::NotLoaded(error),
        });
    }

    /// Goes on with what is under way.
    fn advance(&mut self, events: &mut Vec<BoardEvent>) {
        let Some(work) = &mut self.work else { return };
        let connection = &mut self.connection;
        if let Work::Jog { sender, has_moved, is_released } = work {
            let state = connection.status().map(|status| status.state);
            *has_moved |= state == Some(State::Moving);
            // By itself, or by the operator.
            let is_held = *has_moved && state == Some(State::Held);
            if (is_held || *is_released) && !matches!(sender.step(), Step::Greets | Step::Aborts) {
                sender.abort(connection);
            }
        }
        let what = work.what();
        let event = match work.sender().advance(connection) {
            Ok(Step::Done) => BoardEvent::Done(what),
            Ok(Step::Aborted) => BoardEvent::Aborted(what),
            Ok(_) => return,
            Err(error) => BoardEvent::Failed(what, error),
        };
        self.work = None;
        events.push(event);
    }

    /// What the program says where it is at a stop now.
    fn tell_stop(&mut self, events: &mut Vec<BoardEvent>) {
        let status = self.connection.status();
        let is_at_stop = status.is_some_and(|status| status.state == State::Stopped);
        if !std::mem::replace(&mut self.is_at_stop, is_at_stop)
            && let (Some(status), Some(program), true) = (status, &mut self.program, is_at_stop)
        {
            let set = &status.set[..self.axes.len()];
            events.push(BoardEvent::Stopped(program.stops.at(set).unwrap_or("program stop").to_owned()));
        }
    }
}

impl<const N: usize, const M: usize> Board for Operated<N, M> {
    fn info(&self) -> &BoardInfo {
        &self.info
    }

    fn state(&self) -> BoardState {
        let controls = self.connection.controls();
        let state = BoardState {
            is_lost: self.connection.is_lost(),
            under_way: self.work.as_ref().map_or(UnderWay::Nothing, Work::what),
            override_permille: controls.override_permille,
            is_single_block: controls.is_single_block,
            program: self.program.as_ref().map(|program| program.name.clone()),
            is_capturing: lock(&self.capture).wanted.is_some(),
            ..BoardState::default()
        };
        let Some(status) = self.connection.status() else { return state };
        let mm = |positions: &[Position; M]| {
            positions.iter().take(self.axes.len()).map(|position| position.to_mm()).collect()
        };
        let name = |axis: usize| self.axes.get(axis).cloned().unwrap_or_else(|| format!("axis {axis}"));
        let is_driven = matches!(self.work, Some(Work::Program(_)));
        let is_at_end = status.state == State::Idle && status.is_ended;
        let is_begun = controls.program != 0 && status.taken > 0 && !is_at_end;
        let homing = match status.homing {
            HomingProgress::UnderWay { axis, .. } => Some(name(axis.into())),
            _ => None,
        };
        let items = self.program.as_ref().filter(|_| is_driven).map(|program| program.job.items.len());
        BoardState {
            tick: status.tick,
            state: Some(status.state),
            is_foreign: self.work.is_none() && is_begun,
            set_mm: mm(&status.set),
            actual_mm: mm(&status.actual),
            feed_mm_s: status.feed_mm_s,
            line: status.line,
            is_ready: status.is_ready,
            homed: status.homed.iter().take(self.axes.len()).map(Option::is_some).collect(),
            homing,
            fault: status.fault.map(|fault| faults::told(&fault.kind, name)),
            starvations: status.starvations,
            items: items.map(|items| [(status.taken as usize).min(items), items]),
            ..state
        }
    }

    fn step(&mut self, wait: Duration) -> Vec<BoardEvent> {
        let (mut heard, mut events) = (Vec::new(), Vec::new());
        self.connection.step(wait, &mut |one| heard.push(one));
        for one in heard {
            if let Some(work) = &mut self.work
                && let Err(error) = work.sender().hear(&one)
            {
                events.push(BoardEvent::Failed(work.what(), error));
                self.work = None;
            }
            match one {
                Heard::Lost(cause) => events.push(BoardEvent::Lost(cause)),
                Heard::Back => events.push(BoardEvent::Back),
                Heard::Board(Event::Replaced) => events.push(BoardEvent::Replaced),
                Heard::Board(Event::Restarted { .. }) => {
                    self.connection.accept();
                    events.push(BoardEvent::Restarted);
                }
                Heard::Board(_) => {}
            }
        }
        self.take_planned(&mut events);
        self.advance(&mut events);
        self.tell_stop(&mut events);
        {
            let mut capture = lock(&self.capture);
            if take(&mut capture.is_over) {
                events.push(BoardEvent::Captured { missing: capture.missing });
            }
        }
        if self.connection.scope().is_some_and(Scope::has_failed)
            && let Some(error) = self.connection.end_scope().and_then(|summary| summary.error)
        {
            lock(&self.capture).wanted = None;
            events.push(BoardEvent::ScopeFailed(error.to_string()));
        }
        events
    }

    fn is_settled(&self) -> bool {
        self.connection.is_settled()
    }

    fn load(&mut self, source: Source) -> Result<(), BoardError> {
        if matches!(self.work, Some(Work::Program(_))) {
            return Err(BoardError::UnderWay);
        }
        let (to, planned) = channel();
        let (machine, outputs) = (Arc::clone(&self.machine), self.connection.identity().copied());
        let numbers = self.connection.numbers();
        self.program = None;
        self.planning = Some(planned);
        thread::spawn(move || {
            let planned = plan::<N, M>(numbers, &source, &machine).and_then(|(program, notes)| {
                if let Some(identity) = outputs {
                    check_outputs(&source.name, &program.job, identity.outputs)?;
                }
                Ok((program, notes))
            });
            // Nobody listens where another program was loaded meanwhile.
            let _ = to.send(planned);
        });
        Ok(())
    }

    fn start(&mut self) -> Result<(), BoardError> {
        self.require_idle()?;
        let program = self.program.as_mut().ok_or(BoardError::NoProgram)?;
        program.stops.rewind();
        let (job, axes) = (Arc::clone(&program.job), Arc::clone(&self.axes));
        let mut sender = Sender::new(job, axes, Permissions::default());
        sender.advance(&mut self.connection)?;
        self.work = Some(Work::Program(sender));
        Ok(())
    }

    fn hold(&mut self) {
        match &mut self.work {
            // There is nothing to go on with.
            Some(Work::Homing(sender)) => sender.abort(&mut self.connection),
            Some(work) => work.sender().hold(&mut self.connection),
            None => {
                // Before the greeting there is nothing to hold.
                let _ = self.connection.command(|link| link.press(Mode::Hold));
            }
        }
    }

    fn resume(&mut self) -> Result<(), BoardError> {
        let is_taken = match &mut self.work {
            Some(Work::Homing(_)) | None => return Err(BoardError::NothingUnderWay),
            Some(work) => work.sender().resume(&mut self.connection),
        };
        if is_taken { Ok(()) } else { Err(BoardError::Silent) }
    }

    fn abort(&mut self) {
        match &mut self.work {
            Some(work) => work.sender().abort(&mut self.connection),
            None => {
                // What somebody else has begun.
                let _ = self.connection.command(|link| link.abort());
            }
        }
    }

    fn set_override(&mut self, permille: u16) -> Result<(), BoardError> {
        if permille > 2000 {
            return Err(BoardError::Override { permille });
        }
        let set =
            self.connection.command(|link| link.control(|controls| controls.override_permille = permille));
        if set { Ok(()) } else { Err(BoardError::Silent) }
    }

    fn set_single_block(&mut self, is_on: bool) {
        let _ = self.connection.command(|link| link.control(|controls| controls.is_single_block = is_on));
    }

    fn set_drives(&mut self, are_on: bool) -> Result<(), BoardError> {
        if are_on && let Some(fault) = self.connection.status().and_then(|status| status.fault) {
            let name = |axis: usize| self.axes.get(axis).cloned().unwrap_or_else(|| format!("axis {axis}"));
            return Err(BoardError::Fault { tick: fault.tick, told: faults::told(&fault.kind, name) });
        }
        if are_on {
            self.require_idle()?;
        }
        let _ = self.connection.command(|link| link.enable(are_on));
        Ok(())
    }

    fn clear_fault(&mut self) {
        let _ = self.connection.command(|link| link.clear_fault());
    }

    fn press_key(&mut self, press: &Press, feed_mm_s: Option<f64>) -> Result<(), BoardError> {
        self.require_idle()?;
        let wanted: WantedJog = {
            let presses = [press.clone()];
            Keys::new(&self.machine, &presses, feed_mm_s)?.wanted(0)
        };
        let mut sender =
            Sender::new(Arc::clone(&self.nothing), Arc::clone(&self.axes), Permissions::default())
                .jogs(wanted, DEAD_MAN_MS);
        sender.advance(&mut self.connection)?;
        self.work = Some(Work::Jog { sender, has_moved: false, is_released: false });
        Ok(())
    }

    fn release_key(&mut self) {
        if let Some(Work::Jog { is_released, .. }) = &mut self.work {
            *is_released = true;
        }
    }

    fn home(&mut self, axes: &[String]) -> Result<(), BoardError> {
        self.require_idle()?;
        let axes = Homes::new(&self.machine, axes)?.mask();
        let mut sender =
            Sender::new(Arc::clone(&self.nothing), Arc::clone(&self.axes), Permissions::default())
                .homes(axes, DEAD_MAN_MS);
        sender.advance(&mut self.connection)?;
        self.work = Some(Work::Homing(sender));
        Ok(())
    }

    fn watch_ticks(&mut self) -> Result<(), BoardError> {
        if self.connection.scope().is_some() {
            return Ok(());
        }
        // Motion can't be followed that items began which nobody has noted.
        self.require_idle()?;
        let record = parameters::read(&mut self.connection)?;
        let identity = self.connection.identity().copied().ok_or(BoardError::Silent)?;
        let capture = Arc::clone(&self.capture);
        let sink = Box::new(move |told: Ticks<'_, M>| {
            let mut capture = lock(&capture);
            match told {
                Ticks::Row(row) => capture.add(row),
                Ticks::Gap(first, last) if !capture.rows.is_empty() => capture.missing += last - first + 1,
                Ticks::Gap(..) => {}
            }
        });
        self.connection.set_scope(Scope::start(&identity, &record, sink)?);
        Ok(())
    }

    fn capture(&mut self, trigger: Option<Condition>, before: usize, after: usize) -> Result<(), BoardError> {
        let names = self.axes.to_vec();
        if let Some(trigger) = trigger.as_ref().filter(|trigger| !trigger.suits(&names)) {
            return Err(BoardError::Trigger(trigger.clone()));
        }
        let ticks = before.saturating_add(after);
        if ticks > CAPTURE_MAX {
            return Err(BoardError::Capture { ticks });
        }
        self.watch_ticks()?;
        let wanted = match trigger {
            Some(trigger) => Wanted::Around(Around::new(trigger, names, before, after)),
            None => Wanted::Next(after.max(1)),
        };
        *lock(&self.capture) = Capture { wanted: Some(wanted), ..Capture::default() };
        Ok(())
    }

    fn take_capture(&mut self) -> Option<RunTrace<AXES_MAX>> {
        let rows = {
            let mut capture = lock(&self.capture);
            if capture.wanted.is_some() {
                return None;
            }
            take(&mut capture.rows)
        };
        if rows.is_empty() {
            return None;
        }
        let trace: RunTrace<AXES_MAX> = RunInfo::of_machine(&*self.machine).empty_trace();
        let program = self.program.as_ref().map_or_else(String::new, |program| program.name.clone());
        let mut behind = Behind::default();
        Some(RunTrace { program, ticks: rows.iter().map(|row| behind.row(row)).collect(), ..trace })
    }
}

/// Path behind the stretch under way: a board's ticks count it from the start of each.
#[derive(Default)]
struct Behind {
    before_mm: f64,
    last_mm: f64,
}

impl Behind {
    /// A tick in places for all axes that a board may have, with the path position since the first one.
    fn row<const M: usize>(&mut self, row: &TraceRow<M>) -> TraceRow<AXES_MAX> {
        if row.s_mm < self.last_mm {
            self.before_mm += self.last_mm;
        }
        self.last_mm = row.s_mm;
        TraceRow {
            tick: row.tick,
            s_mm: self.before_mm + row.s_mm,
            v_mm_s: row.v_mm_s,
            a_mm_s2: row.a_mm_s2,
            j_mm_s3: row.j_mm_s3,
            snap_mm_s4: row.snap_mm_s4,
            state: row.state,
            line: row.line,
            contour_um: row.contour_um,
            axes: std::array::from_fn(|place| row.axes.get(place).copied().unwrap_or(AxisTick::default())),
        }
    }
}

/// Reads and plans a program for a board.
fn plan<const N: usize, const M: usize>(
    numbers: Numbers,
    source: &Source,
    machine: &Machine<N>,
) -> Planned<M> {
    let refused = |error: Box<dyn std::error::Error + Send + Sync>| BoardError::Program(error);
    let program = gcode::read_with(&source.name, &source.text, &source.options)
        .map_err(|error| refused(error.into()))?;
    if !source.leaves_out_outputs {
        require_outputs(&source.name, &program.steps, machine).map_err(|error| refused(error.into()))?;
    }
    let plan = plan_program(&source.name, &program, machine, PlanMode::Spanning)
        .map_err(|error| refused(error.into()))?;
    plan.refuse_probes().map_err(|error| refused(error.into()))?;
    let executable = in_numbers!(numbers, R => Executable::new::<R>(&plan));
    let items = executable.map_err(|error| refused(error.into()))?.items;
    let job = Job::new(machine, &items);
    let stops = Stops::new(&program, &plan, &job);
    Ok((Loaded { name: source.name.clone(), job: Arc::new(job), stops }, plan.notices))
}
