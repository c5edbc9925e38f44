//! The operator: presses the button and opens the emergency stop, led by the log.
//!
//! In the first run the button starts, holds and resumes, and every interrupt is counted. In the second run letters
//! have to come over the console to hold and resume; then the emergency stop opens. When the log has the first rows of
//! the flight recorder, the board is reset, and all begins anew.
//!
//! Where a PC drives the board over the link, the button is pressed once, in the middle of the first program.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::Mutex;
use motion_board::LogLine;
use nucleo_f446re::machine::{AXES, Number};

use super::emergency_stop;

/// Ticks that the button is down.
const PRESS_TICKS: u32 = 100;
/// Rows of the flight recorder until the reset.
const ROWS: u32 = 3;

#[derive(Clone, Copy)]
enum Act {
    Press,
    OpenEmergencyStop,
}

/// Where the script is.
#[derive(Clone, Copy)]
struct Script {
    tick: u32,
    runs: u32,
    rows: u32,
    is_running: bool,
    next: Option<(u32, Act)>,
    up_at: u32,
}

static SCRIPT: Mutex<Cell<Script>> =
    Mutex::new(Cell::new(Script { tick: 0, runs: 0, rows: 0, is_running: false, next: None, up_at: 0 }));
static IS_DOWN: AtomicBool = AtomicBool::new(false);

/// Whether the button is down.
pub(super) fn is_button_down() -> bool {
    IS_DOWN.load(Ordering::Relaxed)
}

fn change<T>(by: impl FnOnce(&mut Script) -> T) -> T {
    critical_section::with(|cs| {
        let mut script = SCRIPT.borrow(cs).get();
        let result = by(&mut script);
        SCRIPT.borrow(cs).set(script);
        result
    })
}

/// A tick is over; returns whether its interrupt is to be counted.
pub(super) fn tick() -> bool {
    change(|script| {
        script.tick += 1;
        if IS_DOWN.load(Ordering::Relaxed) && script.tick == script.up_at {
            IS_DOWN.store(false, Ordering::Relaxed);
        }
        if let Some((at, act)) = script.next
            && at == script.tick
        {
            script.next = None;
            match act {
                Act::Press => {
                    IS_DOWN.store(true, Ordering::Relaxed);
                    script.up_at = script.tick + PRESS_TICKS;
                }
                Act::OpenEmergencyStop => emergency_stop::open(),
            }
        }
        script.is_running && script.runs == 1
    })
}

/// The drives have been enabled: over the link, as the log says nothing of it.
pub(super) fn enabled() {
    if cfg!(feature = "link") {
        change(|script| {
            (script.runs, script.is_running) = (script.runs + 1, true);
            script.next = (script.runs == 1).then_some((script.tick + 1500, Act::Press));
        });
    }
}

/// What follows a line of the log. Returns whether the board is to be reset.
pub(super) fn follow(line: &LogLine<Number, AXES>) -> bool {
    change(|script| {
        let after = |ticks| script.tick + ticks;
        let next = match (line, script.runs) {
            (LogLine::Ready, _) => Some((after(100), Act::Press)),
            // In the middle of the program, and after the drives have settled.
            (LogLine::Started(_), 0) => Some((after(1500), Act::Press)),
            (LogLine::Held, 1) => Some((after(200), Act::Press)),
            (LogLine::Done, _) => Some((after(200), Act::Press)),
            (LogLine::Resumed, 2) => Some((after(500), Act::OpenEmergencyStop)),
            _ => None,
        };
        script.next = next.or(script.next);
        match line {
            LogLine::Started(_) => (script.runs, script.is_running) = (script.runs + 1, true),
            LogLine::Done | LogLine::Fault(_) => script.is_running = false,
            LogLine::Flight(_) => script.rows += 1,
            _ => {}
        }
        script.rows == ROWS
    })
}
