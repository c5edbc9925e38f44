//! A board with a simulated machine: what boards run, at the pace of the clock.
//!
//! Consumes the bytes of a [`Wire`]; produces motion of the simulated machine, tick by tick in the time of the wall clock, and
//! answers. Everything between the wire and the converters is [`motion_board`]'s, as on a board; the tick and the background
//! take turns here instead of one interrupting the other.

use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use motion_board::{BoardParameters, Control, Linked};
use motion_kernel::axis::AxesConfig;
use motion_kernel::fault::FaultKind;
use motion_kernel::flight::FlightRecorder;
use motion_kernel::hal::{BoardOutputs, Encoder, Inputs};
use motion_kernel::kernel::Kernel;
use motion_kernel::link::{BoardLink, Build, FRAME_MAX, Identity};
use motion_kernel::live::Leads;
use motion_kernel::program::FORMAT;
use motion_kernel::queue::LiveStreams;
use motion_kernel::scope::ScopeMemory;
use rtic_core::Exclusive;

use super::job;
use super::wire::{Pipe, Tcp, Wire};
use crate::machine::Machine;
use crate::simulate::RunError;
use crate::simulate::hardware::{Simulated, SimulatedHardware, simulated};

/// The number type, as on boards with an FPU.
type Number = f32;
/// Items that it has room for.
const ITEMS: usize = 256;
/// Capacities of the streams, and blocks that live control knows ahead.
const PIECES: usize = 256;
const SEGMENTS: usize = 16;
const PLACES: usize = 256;
/// Room for new parameters \[bytes\].
const PARAMETERS: usize = 4096;
/// Rows of its flight recorder, and how many of them come after a fault.
const ROWS: usize = 64;
const AFTER: usize = 16;
/// Ticks that wait for a PC that wants all of them.
const RECORDS: usize = 1024;
/// Between two looks at clock and wire.
const STEP: Duration = Duration::from_micros(500);
/// A machine that is late by more does not catch up: time passes more slowly there.
const LATE: Duration = Duration::from_millis(100);

/// A simulated board in a thread. It ends with this.
pub struct SimulatedBoard {
    thread: Option<JoinHandle<()>>,
    switches: Arc<Switches>,
}

/// What is switched from outside.
#[derive(Default)]
struct Switches {
    is_over: AtomicBool,
    emergency_stop: AtomicBool,
}

impl SimulatedBoard {
    /// Opens its emergency stop, or closes it.
    pub fn set_emergency_stop(&self, is_open: bool) {
        self.switches.emergency_stop.store(is_open, Ordering::Relaxed);
    }

    /// Waits for its end, which only a panic is.
    pub fn wait(mut self) {
        if let Some(thread) = self.thread.take() {
            // A thread that has panicked has said so.
            let _ = thread.join();
        }
    }
}

impl Drop for SimulatedBoard {
    fn drop(&mut self) {
        self.switches.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that has panicked has said so.
            let _ = thread.join();
        }
    }
}

/// Where a board's wires come from.
type Wires = Box<dyn FnMut() -> io::Result<Option<Box<dyn Wire>>> + Send>;

/// Starts a board with `machine`; returns it and the other end of its wire. `session` is a number that other starts do not
/// have; its time passes `pace` times as fast as the wall clock's, if this computer can.
///
/// # Errors
/// The machine can't be simulated, or regulated.
pub fn start<const N: usize>(
    machine: &Machine<N>,
    session: u32,
    pace: f64,
) -> Result<(SimulatedBoard, Pipe), RunError> {
    let (here, there) = Pipe::pair();
    let mut there = Some(there);
    let wires: Wires = Box::new(move || Ok(there.take().map(|wire| Box::new(wire) as Box<dyn Wire>)));
    Ok((spawn(machine, session, wires, pace)?, here))
}

/// Starts a board with `machine` that takes connections of `listener`, one after the other, as a serial port does: the next one
/// waits until the one before is closed. `session` and `pace` are those of [`start`].
///
/// # Errors
/// The machine can't be simulated, or regulated, or the listener can't be used so.
pub fn listen<const N: usize>(
    machine: &Machine<N>,
    session: u32,
    listener: TcpListener,
    pace: f64,
) -> Result<SimulatedBoard, RunError> {
    let refused = |error: io::Error| RunError::Simulation(error.to_string());
    listener.set_nonblocking(true).map_err(refused)?;
    let wires: Wires = Box::new(move || match listener.accept() {
        Ok((stream, _)) => {
            stream.set_nonblocking(false)?;
            Ok(Some(Box::new(Tcp::new(stream)?)))
        }
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
        Err(error) => Err(error),
    });
    spawn(machine, session, wires, pace)
}

fn spawn<const N: usize>(
    machine: &Machine<N>,
    session: u32,
    wires: Wires,
    pace: f64,
) -> Result<SimulatedBoard, RunError> {
    if parameters(machine).tick_s() != machine.tick_s {
        let found = format!("a tick of {} s; boards have a whole number of ticks a second", machine.tick_s);
        return Err(RunError::Simulation(found));
    }
    // Both are made again in the thread, where they can't be refused any more.
    simulated(machine)?;
    let _: AxesConfig<Number, N> = machine.axes_config()?;
    let record = job::parameters::<N, N>(machine);
    if let Err(refused) = motion_board::Machine::<Number, N>::new(&record, &parameters(machine)) {
        return Err(RunError::Simulation(format!("{refused:?}")));
    }
    let switches = Arc::new(Switches::default());
    let (machine, seen) = (machine.clone(), Arc::clone(&switches));
    let thread = thread::Builder::new().name("board".to_owned()).spawn(move || {
        let Ok(simulated) = simulated(&machine) else { return };
        let Ok(mut hardware) = SimulatedHardware::new(&simulated) else { return };
        let Ok(counts) = hardware.latch();
        hardware.add_homes(&machine, counts);
        let world = World { wires, wire: None, pace, switches: &seen };
        run(&machine, (session, record), (&simulated, hardware), world);
    });
    let thread = thread.map_err(|error| RunError::Simulation(error.to_string()))?;
    Ok(SimulatedBoard { thread: Some(thread), switches })
}

/// The board's figures.
fn parameters<const N: usize>(machine: &Machine<N>) -> BoardParameters {
    BoardParameters {
        tick_hz: (1.0 / machine.tick_s).round() as u32,
        cycles_hz: 1_000_000,
        counts_per_s_max: u32::MAX,
        // Ticks and background take turns.
        leads: Leads::NONE,
        outputs: BoardOutputs::CommandedSpeed,
    }
}

/// A board from power-on to power-on: with the parameters that it was given last.
fn run<const N: usize>(
    machine: &Machine<N>,
    (mut session, mut record): (u32, Vec<u8>),
    (simulated, mut hardware): (&Simulated<N>, SimulatedHardware<'_, N>),
    mut world: World<'_>,
) {
    let board = parameters(machine);
    while let Ok(started) = motion_board::Machine::<Number, N>::new(&record, &board) {
        let on = (session, &*record, &board, &started);
        let Some(next) = run_once(on, (simulated, &mut hardware), &mut world) else { return };
        (session, record) = (session.wrapping_add(1), next);
    }
}

/// What is around a board.
struct World<'a> {
    wires: Wires,
    wire: Option<Box<dyn Wire>>,
    pace: f64,
    switches: &'a Switches,
}

/// Until it is over, or until there are new parameters.
fn run_once<const N: usize>(
    (session, record, board, machine): (u32, &[u8], &BoardParameters, &motion_board::Machine<'_, Number, N>),
    (simulated, hardware): (&Simulated<N>, &mut SimulatedHardware<'_, N>),
    world: &mut World<'_>,
) -> Option<Vec<u8>> {
    let header = *machine.header();
    let identity = Identity {
        build: Build::THIS,
        format: FORMAT.into(),
        axes: N as u16,
        is_fixed_point: false,
        tick_s: header.tick_s,
        items: ITEMS as u16,
        outputs: board.outputs,
        machine: machine.program.machine_checksum(),
    };
    let mut flight = Box::new(FlightRecorder::<Number, N, ROWS, AFTER>::new());
    let mut streams = Box::new(LiveStreams::<Number, N, PIECES, SEGMENTS>::new());
    let (feeder, intake) = streams.split(header.rules, header.start);
    let mut memory = Box::new(ScopeMemory::<Number, N, RECORDS>::new());
    let (recorder, scope, log) = memory.split(&feeder);
    let Ok(counts) = hardware.latch();
    let kernel = Kernel::new(&machine.axes, header.start, counts);
    let mut control = Control::new(kernel, intake, &mut flight);
    let link = BoardLink::new(session, identity);
    let mut linked =
        Box::new(Linked::<Number, N, ITEMS, PLACES, PARAMETERS>::new(board, link, feeder, header.pulse));
    linked.set_parameters(record);
    linked.set_homing(&machine.homing, header.pulse);
    control.set_recorder(recorder);
    linked.set_scope(scope, log);
    let World { wires, wire, pace, switches } = world;
    let (mut frame, mut bytes) = ([0; FRAME_MAX], [0; 4096]);
    let (mut begin, mut ticks) = (Instant::now(), 0_u64);
    let mut came = std::collections::VecDeque::new();
    while !switches.is_over.load(Ordering::Relaxed) {
        hardware.injector.emergency_stop = switches.emergency_stop.load(Ordering::Relaxed);
        if wire.is_none()
            && let Ok(Some(next)) = wires()
        {
            *wire = Some(next);
            came.clear();
        }
        // What is read is waited for no longer than the clock allows.
        match wire.as_mut().map(|wire| wire.read(&mut bytes, STEP)) {
            Some(Ok(count)) => came.extend(&bytes[..count]),
            Some(Err(_)) => *wire = None,
            None => thread::sleep(STEP),
        }
        // Of the wall clock, when a tick is due.
        let due = |ticks: u64| Duration::from_secs_f64(ticks as f64 * header.tick_s / *pace);
        if begin.elapsed() > due(ticks) + LATE {
            begin += begin.elapsed() - due(ticks) - LATE;
        }
        while due(ticks) <= begin.elapsed() {
            let Ok(inputs) = hardware.read_inputs();
            let unhealthy = inputs.emergency_stop.then_some(FaultKind::EmergencyStop);
            control.tick(unhealthy, None, hardware);
            simulated.advance();
            ticks += 1;
            let mut shared = Exclusive(&mut control);
            linked.poll(&mut || came.pop_front(), &mut shared);
            // Times wrap.
            let now_ms = (ticks as f64 * header.tick_s * 1e3) as u64 as u32;
            let length = linked.transmit(now_ms, &mut shared, &mut frame);
            if length > 0 && wire.as_mut().is_some_and(|wire| wire.write(&frame[..length]).is_err()) {
                *wire = None;
            }
            if let Some(next) = linked.new_parameters() {
                return Some(next.to_vec());
            }
        }
    }
    None
}
