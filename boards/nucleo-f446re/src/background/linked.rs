//! The background of a board that a PC drives over the link.
//!
//! The PC alone enables the drives, and starts. The button holds: as long as it is down, motion comes to rest and stays there,
//! until the PC resumes.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::SCB;
use motion_board::LogLine;
use motion_kernel::homing::HomingFigures;
use motion_kernel::law::Pulse;
use motion_kernel::link::{BoardLink, Build, Identity};
use motion_kernel::program::FORMAT;
use nucleo_f446re::design_parameters::{BOARD, LINK_ITEMS, TICK_HZ};
use nucleo_f446re::machine::{AXES, Control, Feeder, Intake, Linked, Machine, Number, Streams};
use rtic::Mutex;

use super::{TICKS, count_step, wait_for_tick};
use crate::board::{self, ButtonPin, Line};
use crate::stored;
use crate::tick_timer::cycles;

/// Memory for both ends: none.
pub(crate) struct Places;

impl Places {
    pub(crate) const fn new() -> Self {
        Self
    }
}

/// What idle owns.
pub(crate) struct Background {
    /// Until it runs.
    feeder: Option<Feeder>,
    pulse: Pulse,
    homing: HomingFigures<AXES>,
    identity: Identity,
    parameters: &'static [u8],
    button: ButtonPin,
    port: Line,
}

/// What the tick owns: nothing, as bytes come and go without it.
pub(crate) struct OfTick;

impl OfTick {
    /// One tick.
    #[inline]
    pub(crate) fn tick(&mut self) {}
}

impl Background {
    /// Everything of it, and the kernel's end of the streams.
    pub(crate) fn new(
        _: &'static mut Places,
        streams: &'static mut Streams,
        machine: Machine,
        parameters: &'static [u8],
        button: ButtonPin,
        port: Line,
    ) -> (Self, Intake, OfTick) {
        let header = machine.header();
        let (feeder, intake) = streams.split(header.rules, header.start);
        let identity = Identity {
            build: Build::THIS,
            format: FORMAT.into(),
            axes: AXES as u16,
            is_fixed_point: false,
            tick_s: BOARD.tick_s(),
            items: LINK_ITEMS as u16,
            outputs: BOARD.outputs,
            machine: machine.program.machine_checksum(),
        };
        let (pulse, homing) = (header.pulse, machine.homing);
        (Self { feeder: Some(feeder), pulse, homing, identity, parameters, button, port }, intake, OfTick)
    }

    /// Runs forever.
    pub(crate) fn run(&'static mut self, mut control: impl Mutex<T = Control>) -> ! {
        let Self { feeder, pulse, homing, identity, parameters, button, port } = self;
        board::write(&LogLine::<Number, AXES>::Linked);
        while !port.has_come() {
            count_step();
            board::pause();
        }
        // Of two starts the memory, the unique identifier and the timers can all be the same. What differs is when the PC's
        // first byte comes, which its clock decides and not this one's: here in cycles of 6 ns since the start.
        let mut linked = begin(cycles(), identity, defmt::unwrap!(feeder.take()), *pulse);
        linked.set_parameters(parameters);
        linked.set_homing(homing, *pulse);
        let mut clock = Clock { ticks: 0, ms: 0 };
        loop {
            wait_for_tick();
            count_step();
            let (begin, now) = (cycles(), TICKS.load(Ordering::Relaxed));
            if let Some(line) = linked.line(now, port.lost(), &mut control) {
                board::write(&line);
            }
            let mut next_byte = || {
                count_step();
                port.next_byte()
            };
            linked.poll_unless(&|| button.is_low(), &mut next_byte, &mut control);
            port.send(|frame| {
                linked.transmit(clock.ms_at(TICKS.load(Ordering::Relaxed)), &mut control, frame)
            });
            linked.note_poll(cycles().wrapping_sub(begin));
            // The drives are off, and stay so.
            match linked.new_parameters().map(stored::keep) {
                Some(true) => SCB::sys_reset(),
                Some(false) => linked.not_stored(),
                None => {}
            }
        }
    }
}

/// Made where it stays; the parts are in a stack frame that is free again afterwards.
#[inline(never)]
fn begin(session: u32, identity: &Identity, feeder: Feeder, pulse: Pulse) -> Linked {
    Linked::new(&BOARD, BoardLink::new(session, *identity), feeder, pulse)
}

/// The link's time: milliseconds that wrap only where 32 bits do, as ticks would not.
struct Clock {
    ticks: u32,
    ms: u32,
}

impl Clock {
    const TICKS_PER_MS: u32 = TICK_HZ / 1000;

    /// The time at tick `now` \[ms\].
    fn ms_at(&mut self, now: u32) -> u32 {
        let passed_ms = now.wrapping_sub(self.ticks) / Self::TICKS_PER_MS;
        self.ticks = self.ticks.wrapping_add(passed_ms * Self::TICKS_PER_MS);
        self.ms = self.ms.wrapping_add(passed_ms);
        self.ms
    }
}
