//! The background of a board on its own: a program in flash, the button, letters of the console.

use core::mem::MaybeUninit;
use core::sync::atomic::Ordering;

use heapless::spsc::{Consumer, Producer, Queue};
use motion_board::LogLine;
use nucleo_f446re::design_parameters::{BOARD, CONSOLE_BYTES};
use nucleo_f446re::machine::{self, AXES, Control, Intake, Machine, Number, Streams};
use rtic::Mutex;

use super::{TICKS, count_step, wait_for_tick};
use crate::board::{self, ButtonPin, Line};
use crate::console_port::{self, LOST};
use crate::tick_timer::cycles;

/// Memory for both ends.
pub(crate) struct Places {
    /// The kernel's streams until there is a program; nothing ever enters them.
    empty: MaybeUninit<motion_kernel::queue::Streams<Number, AXES, 2, 2>>,
    bytes: Queue<u8, CONSOLE_BYTES>,
}

impl Places {
    pub(crate) const fn new() -> Self {
        Self { empty: MaybeUninit::uninit(), bytes: Queue::new() }
    }
}

/// What idle owns.
pub(crate) struct Background {
    panel: Panel,
    streams: &'static mut Streams,
    machine: Machine,
}

/// What the tick owns: it takes the console's bytes.
pub(crate) struct OfTick {
    console: Line,
    received: Producer<'static, u8>,
}

impl OfTick {
    /// One tick.
    #[inline]
    pub(crate) fn tick(&mut self) {
        console_port::receive(&mut self.console, &mut self.received);
    }
}

/// The blue button and ST-LINK's serial port.
struct Panel {
    /// B1: low while it is down.
    button: ButtonPin,
    bytes: Consumer<'static, u8>,
}

impl motion_board::Panel for Panel {
    fn is_button_down(&self) -> bool {
        self.button.is_low()
    }

    fn note_step(&self) {
        count_step();
    }

    fn waiting_byte(&self) -> Option<u8> {
        self.bytes.peek().copied()
    }

    fn next_byte(&mut self) -> Option<u8> {
        self.bytes.dequeue()
    }

    fn bytes_lost(&self) -> u32 {
        LOST.load(Ordering::Relaxed)
    }
}

impl Background {
    /// Everything of it, and the kernel's end of the streams.
    pub(crate) fn new(
        places: &'static mut Places,
        streams: &'static mut Streams,
        machine: Machine,
        _: &'static [u8],
        button: ButtonPin,
        console: Line,
    ) -> (Self, Intake, OfTick) {
        let empty = places.empty.write(motion_kernel::queue::Streams::new());
        let (_, intake) = empty.split(machine.header().rules, machine.header().start);
        let (received, bytes) = places.bytes.split();
        (Self { panel: Panel { button, bytes }, streams, machine }, intake, OfTick { console, received })
    }

    /// Runs forever.
    pub(crate) fn run(&'static mut self, mut control: impl Mutex<T = Control>) -> ! {
        let Self { panel, streams, machine } = self;
        let mut background = machine::Background::new(BOARD, machine.program, streams);
        board::write(&LogLine::<Number, AXES>::Ready);
        loop {
            wait_for_tick();
            count_step();
            let begin = cycles();
            if let Some(line) = background.poll(TICKS.load(Ordering::Relaxed), panel, &mut control) {
                board::write(&line);
            }
            background.plan(panel);
            background.note_poll(cycles().wrapping_sub(begin));
        }
    }
}
