//! Ticks in the interrupt of a timer, which stop the background anywhere, and what time is left to it.

use core::cell::RefCell;
use core::mem;

use critical_section::Mutex;

use crate::processor::{self, Timer};

/// What a tick of the timer calls. It says after how many instructions of the background it wants to be called again.
pub type Handler<'a> = dyn FnMut() -> u32 + 'a;

/// The timer, and who it calls.
struct Ticking {
    timer: Timer,
    handler: &'static mut Handler<'static>,
    /// Steps until the interrupt, and those of the background before.
    armed: u32,
    passed: u32,
}

// Sound: there is one core. The interrupt calls the handler while the background, which lent it, has nothing of it; the
// timer is used with interrupts masked.
unsafe impl Send for Ticking {}

static TICKING: Mutex<RefCell<Option<Ticking>>> = Mutex::new(RefCell::new(None));

/// Runs `background` while interrupts call `handler`, first after `instructions`; returns what it returns.
pub fn with_ticks<T>(
    timer: &mut Option<Timer>,
    instructions: u32,
    handler: &mut Handler<'_>,
    background: impl FnOnce() -> T,
) -> T {
    // Sound: gone again below, before the handler's borrow ends. A panic ends the emulation.
    let handler = unsafe { mem::transmute::<&mut Handler<'_>, &'static mut Handler<'static>>(handler) };
    critical_section::with(|cs| {
        if let Some(mut timer) = timer.take() {
            timer.enable_interrupt();
            let armed = timer.arm(instructions);
            TICKING.replace(cs, Some(Ticking { timer, handler, armed, passed: 0 }));
        }
    });
    let result = background();
    critical_section::with(|cs| {
        if let Some(mut ticking) = TICKING.take(cs) {
            ticking.timer.stop();
            *timer = Some(ticking.timer);
        }
    });
    result
}

/// Instructions that the background has had while `work` ran, without those of ticks; and what it returns.
pub fn count<T>(work: impl FnOnce() -> T) -> (T, u32) {
    let before = passed();
    let result = work();
    (result, processor::instructions(passed().wrapping_sub(before)))
}

/// Steps that the background has had so far.
fn passed() -> u32 {
    critical_section::with(|cs| {
        let ticking = TICKING.borrow_ref(cs);
        ticking
            .as_ref()
            .map_or(0, |ticking| ticking.passed.wrapping_add(processor::since_armed(ticking.armed)))
    })
}

/// The interrupt.
pub fn tick() {
    critical_section::with(|cs| {
        if let Some(ticking) = TICKING.borrow_ref_mut(cs).as_mut() {
            ticking.passed = ticking.passed.wrapping_add(ticking.timer.interrupted(ticking.armed));
            let next = (ticking.handler)();
            ticking.armed = ticking.timer.arm(next);
        }
    });
}
