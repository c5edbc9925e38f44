//! Executes the first program of the bundle as a board does: the tick in an interrupt, the streams filled in
//! the background, which the interrupt stops anywhere. The digest is that of the stepped run.
//!
//! The timer is set anew in every tick: after a short time that is never the same, so that the next tick
//! comes somewhere in the middle of a fill, and after that for long enough that the fill comes to its end.
//! How many ticks came in the middle of one is printed too.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::{entry, exception};
use cortex_m_semihosting::hprintln;
use critical_section::Mutex;
use hal_sim::SimMachine;
use hal_sim::closed_loop::{Closed, ClosedLoop, close, reference_machine};
use motion_kernel::exec::ExecState;
use motion_kernel::program::Reader;
use motion_kernel::queue::Streams;
use motion_kernel::trace::Digest;
use qemu_boards::programs::programs;
use qemu_boards::{AXES, LINE, Number, PIECES, SEGMENTS, SUBSTEPS, exit, fail};

/// Timer steps until a tick that the background is to have time for: several times what a fill takes.
const LONG_STEPS: u32 = 2_000_000;
/// Timer steps until a tick that is to come in the middle of a fill: from some instructions to some items.
const SHORT_STEPS: core::ops::Range<u32> = 200..40_000;

/// The background is filling the streams.
static FILLING: AtomicBool = AtomicBool::new(false);

/// What the interrupt owns.
struct Foreground {
    closed_loop: ClosedLoop<'static, Number, AXES, LINE>,
    timer: SYST,
    digest: Digest,
    ticks: u32,
    /// Ticks that came in the middle of a fill.
    inside: u32,
    random: u32,
    /// The state after the last tick, for the background.
    is_idle: bool,
    is_faulted: bool,
}

// Sound: the machine is behind a shared reference that only `closed_loop` keeps, so all of it moves into the
// interrupt together.
unsafe impl Send for Foreground {}

static FOREGROUND: Mutex<RefCell<Option<Foreground>>> = Mutex::new(RefCell::new(None));

#[entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().unwrap_or_else(|| fail(&"peripherals"));
    let bytes = programs().next().unwrap_or_else(|| fail(&"a bundle without a program"));
    let (mut producer, closed_loop) = closed(bytes);
    let mut is_all = producer.fill().unwrap_or_else(|error| fail(&error));
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(LONG_STEPS - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
    let foreground = Foreground {
        closed_loop,
        timer: core.SYST,
        digest: Digest::new(),
        ticks: 0,
        inside: 0,
        random: 1,
        is_idle: false,
        is_faulted: false,
    };
    critical_section::with(|cs| FOREGROUND.replace(cs, Some(foreground)));
    loop {
        if !is_all {
            FILLING.store(true, Ordering::Relaxed);
            is_all = producer.fill().unwrap_or_else(|error| fail(&error));
            FILLING.store(false, Ordering::Relaxed);
        }
        cortex_m::asm::wfi();
        let end = critical_section::with(|cs| {
            let mut foreground = FOREGROUND.borrow_ref_mut(cs);
            let foreground = foreground.as_mut()?;
            let is_over = foreground.is_faulted || (is_all && foreground.is_idle);
            if !is_over {
                return None;
            }
            foreground.timer.disable_interrupt();
            Some((foreground.ticks, foreground.digest, foreground.is_faulted, foreground.inside))
        });
        if let Some((ticks, digest, is_faulted, inside)) = end {
            hprintln!("{} ticks digest {:016x} fault {}", ticks, digest.value(), is_faulted);
            hprintln!("{} ticks inside a fill", inside);
            exit(true)
        }
    }
}

// Each made in a frame of its own, which is gone before the ticks begin.

#[inline(never)]
fn closed(bytes: &'static [u8]) -> Closed<'static, Number, AXES, LINE> {
    let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
    close(&program, streams(), machine(&program)).unwrap_or_else(|error| fail(&error))
}

#[inline(never)]
fn machine(program: &Reader<'_, AXES>) -> &'static SimMachine<AXES, LINE> {
    let parameters = reference_machine(program.header(), SUBSTEPS);
    cortex_m::singleton!(: SimMachine<AXES, LINE> =
        SimMachine::new(&parameters).unwrap_or_else(|error| fail(&error)))
    .unwrap_or_else(|| fail(&"machine"))
}

#[inline(never)]
fn streams() -> &'static mut Streams<Number, AXES, PIECES, SEGMENTS> {
    cortex_m::singleton!(: Streams<Number, AXES, PIECES, SEGMENTS> = Streams::new())
        .unwrap_or_else(|| fail(&"streams"))
}

#[exception]
fn SysTick() {
    critical_section::with(|cs| {
        if let Some(foreground) = FOREGROUND.borrow_ref_mut(cs).as_mut() {
            foreground.timer.disable_counter();
            foreground.inside += u32::from(FILLING.load(Ordering::Relaxed));
            let trace = foreground.closed_loop.tick();
            foreground.digest.add(&trace);
            foreground.ticks += 1;
            foreground.is_idle = trace.executed.state == ExecState::Idle;
            foreground.is_faulted = trace.fault.is_some();
            let steps = if foreground.ticks.is_multiple_of(2) {
                LONG_STEPS
            } else {
                foreground.random = foreground.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                SHORT_STEPS.start + (foreground.random >> 8) % (SHORT_STEPS.end - SHORT_STEPS.start)
            };
            foreground.timer.set_reload(steps - 1);
            foreground.timer.clear_current();
            foreground.timer.enable_counter();
        }
    });
}
