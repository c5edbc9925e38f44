//! The machine: the converter takes frames, its voltages move drives, and their encoders count.
//!
//! Consumes the frames of a tick and the enables, when the tick is over; produces the next tick's counts.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_semihosting::hprintln;
use critical_section::Mutex;
use embedded_hal::spi::SpiDevice;
use hal_sim::SimMachine;
use hal_sim::closed_loop::reference_machine;
use motion_kernel::hal::{DriveEnable, Encoder};
use motion_kernel::program::Header;
use motion_kernel::units::Counts;
use nucleo_f446re::machine::AXES;

use super::{script, tick_timer};

/// Sub-steps of a tick, and cells for the drives' dead time of 1.42 ms.
const SUBSTEPS: u32 = 1;
const LINE: usize = 4;
/// A frame of three bytes, as [`frame`] gets it.
const WHOLE: u32 = 1;

type Model = SimMachine<AXES, LINE>;

static MODEL: Mutex<RefCell<Option<Model>>> = Mutex::new(RefCell::new(None));
/// Frames that the model has not taken yet: those of the converter's setup are the most.
static FRAMES: [AtomicU32; 16] = [const { AtomicU32::new(0) }; 16];
static SENT: AtomicU32 = AtomicU32::new(0);
static COUNTERS: [AtomicU32; AXES] = [const { AtomicU32::new(0) }; AXES];
/// A bit for each axis.
static ENABLES: AtomicU32 = AtomicU32::new(0);
/// Cycles from the opening of the emergency stop until the last enable was off.
static OFF_AFTER: AtomicU32 = AtomicU32::new(u32::MAX);

/// The machine of a program, at rest.
pub(super) fn start(header: &Header<AXES>) {
    match SimMachine::new(&reference_machine(header, SUBSTEPS)) {
        Ok(machine) => critical_section::with(|cs| {
            MODEL.replace(cs, Some(machine));
        }),
        Err(error) => fail(format_args!("{error}")),
    }
}

/// The encoders' counters.
#[inline]
pub(super) fn counters() -> [u32; AXES] {
    let [x, y, z] = &COUNTERS;
    [x, y, z].map(|counter| counter.load(Ordering::Relaxed))
}

/// A frame has been sent: a 1 and its bytes.
#[inline]
pub(super) fn frame(frame: u32) {
    let sent = SENT.load(Ordering::Relaxed);
    if let Some(place) = FRAMES.get(sent as usize) {
        place.store(frame, Ordering::Relaxed);
    }
    SENT.store(sent + 1, Ordering::Relaxed);
}

/// An enable has been switched, so long after the emergency stop opened.
#[inline]
pub(super) fn enable(axis: usize, is_on: bool, since_opened: Option<u32>) {
    let (before, bit) = (ENABLES.load(Ordering::Relaxed), 1 << axis);
    let after = if is_on { before | bit } else { before & !bit };
    ENABLES.store(after, Ordering::Relaxed);
    const ALL: u32 = (1 << AXES) - 1;
    if after == ALL && before != ALL {
        script::enabled();
    }
    if let (0, true, Some(cycles)) = (after, before != 0, since_opened) {
        OFF_AFTER.store(cycles, Ordering::Relaxed);
    }
}

/// The converter takes the frames sent so far, and `time_ns` passes.
pub(super) fn elapse(time_ns: u64) {
    with(|model| {
        take_frames(model);
        model.chip().elapse_ns(time_ns);
    });
}

/// The tick is over: the machine moves on, and so does the script. Takes no time.
pub(super) fn end_of_tick() {
    let mut is_counted = false;
    let cycles = tick_timer::aside(|| {
        with(|mut model| {
            take_frames(model);
            let is_enabled = ENABLES.load(Ordering::Relaxed) == (1 << AXES) - 1;
            let Ok(()) = DriveEnable::<AXES>::set_enabled(&mut model, is_enabled);
            model.advance();
            let Ok(counts) = Encoder::<AXES>::latch(&mut model);
            for (counter, Counts(counts)) in COUNTERS.iter().zip(counts) {
                counter.store(counts as u32, Ordering::Relaxed);
            }
        });
        is_counted = script::tick();
    });
    if is_counted {
        tick_timer::aside(|| hprintln!("interrupt {}", cycles));
    }
}

/// What the machine has come to.
pub(super) fn report() {
    with(|model| {
        let at_mm = model.truth().map(|axis| axis.position_mm);
        let (codes, frames) = (model.chip().output_codes(), model.chip().frames_taken());
        let off_after = OFF_AFTER.load(Ordering::Relaxed);
        hprintln!("model: at {:?} mm", at_mm);
        hprintln!("model: {} frames in {} ticks, codes {:?}", frames, model.ticks(), codes);
        hprintln!("model: enabled {}, off after {} cycles", model.is_enabled(), off_after);
    });
}

fn take_frames(model: &Model) {
    let sent = SENT.swap(0, Ordering::Relaxed) as usize;
    let Some(frames) = FRAMES.get(..sent) else { fail(format_args!("{sent} frames at once")) };
    for frame in frames {
        let [length, bytes @ ..] = frame.load(Ordering::Relaxed).to_be_bytes();
        if u32::from(length) != WHOLE {
            fail(format_args!("a frame of other than three bytes: {bytes:02x?}"));
        }
        if let Err(error) = model.chip().write(&bytes) {
            fail(format_args!("{error}"));
        }
    }
}

fn with(work: impl FnOnce(&Model)) {
    critical_section::with(|cs| {
        if let Some(model) = MODEL.borrow_ref(cs).as_ref() {
            work(model);
        }
    });
}

/// The run is no good.
pub(super) fn fail(why: core::fmt::Arguments<'_>) -> ! {
    hprintln!("failed: {}", why);
    loop {
        cortex_m_semihosting::debug::exit(cortex_m_semihosting::debug::EXIT_FAILURE);
    }
}
