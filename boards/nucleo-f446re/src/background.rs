//! The idle loop: a poll of the background after a tick, over and over.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::Consumer;
use motion_board::LogLine;
use nucleo_f446re::design_parameters::BOARD;
use nucleo_f446re::machine::{AXES, Background, Control, Machine, Number, Streams};
use rtic::Mutex;

use crate::board::{self, ButtonPin};
use crate::console_port::LOST;
use crate::tick_timer::cycles;

/// Number of ticks since the start; counted by the tick.
pub(crate) static TICKS: AtomicU32 = AtomicU32::new(0);
/// Number of steps of the background: polls, and steps of plans in them. The tick feeds the watchdog only while it
/// increases.
pub(crate) static STEPS: AtomicU32 = AtomicU32::new(0);

/// The blue button and ST-LINK's serial port.
pub(crate) struct Panel {
    /// B1: low while it is down.
    pub(crate) button: ButtonPin,
    pub(crate) bytes: Consumer<'static, u8>,
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

/// The background is alive.
fn count_step() {
    STEPS.store(STEPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// Runs forever.
pub(crate) fn run(
    mut control: impl Mutex<T = Control>,
    streams: &'static mut Streams,
    machine: &Machine,
    panel: &mut Panel,
) -> ! {
    let mut background = Background::new(BOARD, machine.program, streams);
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

/// Returns when a tick has just ended.
fn wait_for_tick() {
    let before = TICKS.load(Ordering::Relaxed);
    while TICKS.load(Ordering::Relaxed) == before {
        board::pause();
    }
}
