//! A whole board with its machine simulated, which a PC drives over the link on UART 0: ticks in real time, drives enabled
//! and programs started by the PC alone.
//!
//! The bundle holds one program without items: its header and guards are the parameters of machine and board. Its seed is
//! the session's number, which has to be another one at every start: a board that is emulated has nothing by which it could
//! tell two starts apart. What is wrong with either is said by semihosting, and ends the emulation with status 1.
//!
//! ```text
//! SysTick  Hardware ─► Control::tick ─► Hardware ─► SimMachine::advance
//!                           │
//! main     Port ─► Linked::poll, Linked::transmit ─► Port
//!            ▲                                         │
//! IRQ 0    UART                                      UART
//! ```
#![no_std]
#![no_main]

use core::cell::Cell;
use core::convert::Infallible;
use core::ffi::CStr;
use core::num::{NonZeroU32, NonZeroU64};

use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use critical_section::Mutex;
use hal_sim::closed_loop::reference_machine;
use motion_board::machine::MachineError;
use motion_board::{BoardOutputs, BoardParameters};
use motion_kernel::flight::FlightRecorder;
use motion_kernel::hal::Encoder;
use motion_kernel::kernel::Kernel;
use motion_kernel::link::{BoardLink, Build, Identity};
use motion_kernel::live::Leads;
use motion_kernel::program::{FORMAT, ProgramError, Reader};
use motion_kernel::scope::ScopeMemory;
use qemu_boards::hardware::{Hardware, Simulated};
use qemu_boards::live::{PLACES, Streams};
use qemu_boards::processor::{entry, wait};
use qemu_boards::programs::seeded_programs;
use qemu_boards::uart::{self, Port};
use qemu_boards::{AXES, IS_FIXED_POINT, Number, SUBSTEPS, singleton};
use semihosting::process;
use semihosting::sys::arm_compat::sys_write0;

/// The processor's clock [Hz].
const CLOCK_HZ: u32 = 25_000_000;
/// SysTick counts so far.
const PERIOD_MAX: u32 = 1 << 24;
/// Items that have room before they are taken into the streams.
const ITEMS: usize = 256;
/// Rows of the flight recorder, and how many of them come after a fault.
const ROWS: usize = 64;
const AFTER: usize = 16;
/// Ticks that wait for a PC that wants all of them: those of a plan for another override.
const RECORDS: usize = 256;

type Control = motion_board::Control<'static, Number, AXES, ROWS, AFTER>;
type Flight = FlightRecorder<Number, AXES, ROWS, AFTER>;
type Scope = ScopeMemory<Number, AXES, RECORDS>;
type Linked = motion_board::Linked<'static, Number, AXES, ITEMS, PLACES>;
type Machine = motion_board::Machine<'static, Number, AXES>;

/// What the tick owns; the background borrows it for some tens of instructions.
struct Foreground {
    control: Control,
    hardware: Hardware,
    ticks: u64,
}

// Sound: there is one core, and who uses it has taken it out of its place with interrupts masked.
unsafe impl Send for Foreground {}

static FOREGROUND: Mutex<Cell<Option<&'static mut Foreground>>> = Mutex::new(Cell::new(None));

/// What `using` makes of the foreground; none before there is one.
fn with_foreground<T>(using: impl FnOnce(&mut Foreground) -> T) -> Option<T> {
    critical_section::with(|cs| {
        let place = FOREGROUND.borrow(cs);
        let foreground = place.take()?;
        let result = using(foreground);
        place.set(Some(foreground));
        Some(result)
    })
}

/// The background's way to it.
struct Shared;

impl rtic_core::Mutex for Shared {
    type T = Control;

    fn lock<R>(&mut self, using: impl FnOnce(&mut Control) -> R) -> R {
        let result = with_foreground(|foreground| using(&mut foreground.control));
        result.unwrap_or_else(|| refuse(c"the background began before the tick"))
    }
}

#[entry]
fn main() -> ! {
    match run() {
        Ok(never) => match never {},
        Err(what) => refuse(what),
    }
}

/// Says what is wrong and ends the emulation. Without formatting, which could panic.
fn refuse(what: &CStr) -> ! {
    sys_write0(c"the board can't start: ");
    sys_write0(what);
    sys_write0(c"\n");
    process::exit(1)
}

/// Starts, and is the background.
fn run() -> Result<Infallible, &'static CStr> {
    const TWICE: &CStr = c"it was started twice";
    let mut records = seeded_programs();
    let (Some((session, record)), None) = (records.next(), records.next()) else {
        return Err(
            c"expected one parameter record behind its count 1, the session and its length, at 0x200000",
        );
    };
    let (board, period, ticks_per_s) = timing(record)?;
    let machine = Machine::new(record, &board).map_err(of_machine)?;
    if machine.program.items().next().is_some() {
        return Err(
            c"the parameter record has items: expected the header and the guards of a program, without any",
        );
    }
    let mut peripherals = Peripherals::take().ok_or(TWICE)?;
    let link = BoardLink::new(session as u32, identity(record, &machine));
    let streams = singleton!(Streams = Streams::new()).ok_or(TWICE)?;
    let (feeder, intake) = streams.split(machine.header().rules, machine.header().start);
    let (recorder, scope, log) = singleton!(Scope = Scope::new()).ok_or(TWICE)?.split(&feeder);
    start(&machine, |kernel, hardware| {
        let flight = singleton!(Flight = Flight::new())?;
        let mut control = Control::new(kernel, intake, flight);
        control.set_recorder(recorder);
        singleton!(Foreground = Foreground { control, hardware, ticks: 0 })
    })?;
    let pulse = machine.header().pulse;
    let linked = singleton!(Linked = Linked::new(&board, link, feeder, pulse)).ok_or(TWICE)?;
    linked.set_parameters(record);
    linked.set_homing(&machine.homing, pulse);
    linked.set_scope(scope, log);
    let mut port = Port::start(&mut peripherals.NVIC).ok_or(TWICE)?;
    tick_every(period, &mut peripherals.SYST);
    loop {
        linked.poll(&mut || port.next_byte(), &mut Shared);
        let ticks = with_foreground(|foreground| foreground.ticks).unwrap_or_default();
        let now_ms = (ticks.wrapping_mul(1000) / ticks_per_s) as u32;
        let has_sent = port.send(|frame| linked.transmit(now_ms, &mut Shared, frame));
        if !has_sent && !port.has_bytes() {
            wait();
        }
    }
}

/// The board for the record's tick, the clock's steps of one, and their number in a second.
#[inline(never)]
fn timing(record: &'static [u8]) -> Result<(BoardParameters, u32, NonZeroU64), &'static CStr> {
    let program = Reader::<AXES>::new(record).map_err(|error| of_program(&error))?;
    // The nearest one: whether it is the record's tick is checked with the rest.
    let tick_hz = NonZeroU32::new((1.0 / program.header().tick_s + 0.5) as u32);
    let period = tick_hz.map(|tick_hz| CLOCK_HZ / tick_hz).filter(|period| (2..=PERIOD_MAX).contains(period));
    let (Some(tick_hz), Some(period)) = (tick_hz, period) else {
        return Err(c"the parameter record's tick is out of range: expected 2 to 12500000 ticks a second");
    };
    let board = BoardParameters {
        tick_hz: tick_hz.get(),
        cycles_hz: CLOCK_HZ,
        counts_per_s_max: u32::MAX,
        // As a board with some hundreds of millions of instructions a second has them.
        leads: Leads { stop_ticks: 3, plan_ticks: 8 },
        outputs: BoardOutputs::CommandedSpeed,
    };
    Ok((board, period, tick_hz.into()))
}

/// What the board says about itself.
fn identity(record: &[u8], machine: &Machine) -> Identity {
    Identity {
        build: Build::THIS,
        format: FORMAT.into(),
        axes: AXES as u16,
        is_fixed_point: IS_FIXED_POINT,
        tick_s: machine.header().tick_s,
        items: ITEMS as u16,
        outputs: BoardOutputs::CommandedSpeed,
        machine: record.last_chunk().map_or(0, |&checksum| u32::from_le_bytes(checksum)),
    }
}

/// The machine at rest, drives off, and its kernel; `place` gives them their place.
#[inline(never)]
fn start(
    machine: &Machine,
    place: impl FnOnce(Kernel<Number, AXES>, Hardware) -> Option<&'static mut Foreground>,
) -> Result<(), &'static CStr> {
    const TWICE: &CStr = c"it was started twice";
    let simulated = Simulated::new(&reference_machine(machine.header(), SUBSTEPS)).map_err(|_| {
        c"the machine of the parameter record can't be simulated: its tick, scales or resolutions"
    })?;
    let simulated: &'static Simulated = singleton!(Simulated = simulated).ok_or(TWICE)?;
    let mut hardware = Hardware::new(simulated).map_err(|_| c"the simulated converter does not start")?;
    let Ok(counts) = hardware.latch();
    hardware.add_homes(machine.header(), &machine.homing, counts);
    let kernel = Kernel::new(&machine.axes, machine.header().start, counts);
    let foreground = place(kernel, hardware).ok_or(TWICE)?;
    critical_section::with(|cs| FOREGROUND.borrow(cs).set(Some(foreground)));
    Ok(())
}

fn tick_every(period: u32, timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(period - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

#[cortex_m_rt::exception]
fn SysTick() {
    with_foreground(|Foreground { control, hardware, ticks }| {
        control.tick(None, None, hardware);
        hardware.advance();
        *ticks = ticks.wrapping_add(1);
    });
}

/// Every interrupt that has no name here: that of the UART.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(interrupt: i16) {
    if interrupt == uart::INTERRUPT.cast_signed() {
        uart::receive();
    }
}

fn of_program(error: &ProgramError) -> &'static CStr {
    match error {
        ProgramError::NotAProgram => c"the parameter record does not begin with MOTN",
        ProgramError::Version { .. } => c"the parameter record is of another version of the format",
        ProgramError::Axes { .. } => c"the parameter record is for another number of axes: expected 3",
        ProgramError::Checksum { .. } => c"the parameter record is damaged: its checksum is another one",
        _ => c"the parameter record has no header or guards where they should be",
    }
}

fn of_machine(error: MachineError) -> &'static CStr {
    match error {
        MachineError::Program(error) => of_program(&error),
        MachineError::Tick { .. } => {
            c"the parameter record's tick: expected a whole number of ticks a second"
        }
        MachineError::CountRate { .. } => {
            c"the parameter record: an axis counts more than 2^32 times a second"
        }
        MachineError::Unguarded => c"the parameter record has no guards",
        MachineError::Axes(_) => c"the parameter record: a figure of an axis is out of its range",
        MachineError::Items(_) => c"the parameter record: its start is out of the range of positions",
        // Of items, which it must not have.
        MachineError::Counterclockwise { .. }
        | MachineError::SecondSpeed { .. }
        | MachineError::Speed { .. }
        | MachineError::LeftOn => c"the parameter record has items that can't be executed",
    }
}
