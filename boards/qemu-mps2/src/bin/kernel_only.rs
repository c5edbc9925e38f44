//! The kernel as a board links it, with nothing around it: the program's bytes read, the streams filled, the
//! tick in SysTick with all that a board may tell the kernel between ticks, and peripherals that are plain
//! memory. Its size is the kernel's, and its symbols tell whether any of it can panic. It is linked, not run.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use hal_sim::closed_loop::InMemory;
use motion_kernel::axis::AxesConfig;
use motion_kernel::fault::FaultKind;
use motion_kernel::kernel::Kernel;
use motion_kernel::num::Scalar;
use motion_kernel::program::{Header, Items, ProgramError, Reader};
use motion_kernel::units::{Counts, DacCode};
use qemu_boards::processor::{entry, wait};
use qemu_boards::programs::programs;
use qemu_boards::{AXES, Number, singleton};

#[cfg(feature = "live")]
use live::{Background, Feeder, Queues, TickIntake, background, correct, for_tick, poll, tick};
#[cfg(not(feature = "live"))]
use plain::{Background, Feeder, Queues, TickIntake, background, correct, for_tick, poll, tick};

/// The program's own plan fills the streams.
#[cfg(not(feature = "live"))]
mod plain {
    use motion_kernel::program::Supply;
    use motion_kernel::queue::{Intake, Streams};
    use qemu_boards::{PIECES, SEGMENTS};

    use super::{AXES, Header, InMemory, Items, Kernel, Number, ProgramError};

    pub(super) type Queues = Streams<Number, AXES, PIECES, SEGMENTS>;
    pub(super) type Feeder<'a> = motion_kernel::queue::Feeder<'a, Number, AXES>;
    pub(super) type Background<'a> = Supply<Number, AXES, Items<'a, AXES>, ProgramError>;

    pub(super) fn background<'a>(items: Items<'a, AXES>, header: &Header<AXES>) -> Background<'a> {
        Supply::new(items, header.tick_s)
    }

    pub(super) fn poll(supply: &mut Background<'_>, feeder: &mut Feeder<'_>) -> bool {
        supply.fill(feeder).is_ok()
    }

    pub(super) type TickIntake = Intake<'static, Number, AXES>;

    pub(super) fn for_tick(intake: Intake<'static, Number, AXES>) -> TickIntake {
        intake
    }

    /// Nothing is learnt.
    pub(super) fn correct(_: &mut TickIntake) {}

    pub(super) fn tick(
        kernel: &mut Kernel<Number, AXES>,
        intake: &mut TickIntake,
        memory: &mut InMemory<AXES>,
    ) {
        kernel.tick(intake, memory);
    }
}

/// Live control fills the streams.
#[cfg(feature = "live")]
mod live {
    use core::sync::atomic::Ordering;

    use motion_kernel::axis::Correction;
    use motion_kernel::kernel::CorrectedIntake;
    use motion_kernel::live::{Leads, LiveControl};
    use motion_kernel::num::Scalar;
    use motion_kernel::queue::{Intake, LiveFeeder};
    use qemu_boards::live::{PLACES, Streams};

    use super::{AXES, CODES, COMMAND, Header, InMemory, Items, Kernel, Number, ProgramError};

    pub(super) type Queues = Streams;
    pub(super) type Feeder<'a> = LiveFeeder<'a, Number, AXES>;
    pub(super) type Background<'a> = LiveControl<Number, AXES, Items<'a, AXES>, ProgramError, PLACES>;

    pub(super) fn background<'a>(items: Items<'a, AXES>, header: &Header<AXES>) -> Background<'a> {
        LiveControl::new(items, header.pulse, header.tick_s, Leads { stop_ticks: 2, plan_ticks: 2 })
    }

    pub(super) fn poll(control: &mut Background<'_>, feeder: &mut Feeder<'_>) -> bool {
        match COMMAND.load(Ordering::Relaxed) {
            20 => control.hold(),
            21 => control.resume(),
            22 => control.abort(),
            eighths @ 32..49 => {
                control.set_override(0.125 * f64::from(eighths - 32)).unwrap_or_default();
            }
            _ => {}
        }
        control.poll(feeder).is_ok()
    }

    /// The larger image holds learnt corrections as well, so that the search for panics covers them.
    pub(super) type TickIntake = CorrectedIntake<'static, Number, AXES>;

    pub(super) fn for_tick(intake: Intake<'static, Number, AXES>) -> TickIntake {
        intake.into()
    }

    pub(super) fn correct(intake: &mut TickIntake) {
        static KNOTS: [[Number; AXES]; 2] = [[Number::ZERO; AXES]; 2];
        if let Ok(correction) = Correction::new(0, &KNOTS, 2, 1.0) {
            // Live control refuses it, which the linker does not know.
            CODES.store(u32::from(intake.correct(correction).is_ok()), Ordering::Relaxed);
        }
    }

    pub(super) fn tick(
        kernel: &mut Kernel<Number, AXES>,
        intake: &mut TickIntake,
        memory: &mut InMemory<AXES>,
    ) {
        kernel.tick_corrected(intake, memory);
    }
}

/// What the tick owns.
struct Foreground {
    kernel: Kernel<Number, AXES>,
    intake: TickIntake,
    memory: InMemory<AXES>,
}

static FOREGROUND: Mutex<RefCell<Option<&'static mut Foreground>>> = Mutex::new(RefCell::new(None));
/// Read, so that nothing of a tick is left out of the image.
static CODES: AtomicU32 = AtomicU32::new(0);
/// What the board tells the kernel next; written from outside.
#[unsafe(no_mangle)]
static COMMAND: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    run();
    loop {
        wait();
    }
}

fn run() -> Option<()> {
    let program = Reader::<AXES>::new(programs().next()?).ok()?;
    let header = program.header();
    let streams = singleton!(Queues = Queues::new())?;
    let (mut feeder, intake) = streams.split(header.rules, header.start);
    let mut background: Background<'_> = background(program.items(), header);
    let config = AxesConfig::<Number, AXES>::new(&header.axes, header.tick_s).ok()?;
    let counts = [Counts(0); AXES];
    let mut kernel = Kernel::new(&config, header.start, counts);
    kernel.enable(100);
    let memory = InMemory { counts, codes: [DacCode::ZERO; AXES], enabled: None };
    let foreground = singleton!(Foreground = Foreground { kernel, intake: for_tick(intake), memory })?;
    critical_section::with(|cs| {
        *FOREGROUND.borrow(cs).try_borrow_mut().ok()? = Some(foreground);
        Some(())
    })?;
    go_on(&mut background, &mut feeder);
    None
}

fn go_on(background: &mut Background<'_>, feeder: &mut Feeder<'_>) {
    while poll(background, feeder) {
        wait();
    }
}

#[cfg_attr(target_arch = "arm", cortex_m_rt::exception)]
#[cfg_attr(target_arch = "riscv32", riscv_rt::core_interrupt(riscv::interrupt::Interrupt::MachineTimer))]
#[allow(non_snake_case)]
fn SysTick() {
    critical_section::with(|cs| {
        // A tick that comes while it is borrowed is a tick that comes inside itself: there is none.
        let Ok(mut foreground) = FOREGROUND.borrow(cs).try_borrow_mut() else { return };
        if let Some(Foreground { kernel, intake, memory }) = foreground.as_mut() {
            kernel_command(COMMAND.load(Ordering::Relaxed), kernel, intake);
            kernel_tick(kernel, intake, memory);
            let sum = memory.codes.iter().fold(0, |sum: u32, code| sum.wrapping_add(code.0 as u32));
            CODES.store(sum, Ordering::Relaxed);
        }
    });
}

/// The root of all that a board may call between two ticks.
#[unsafe(no_mangle)]
#[inline(never)]
fn kernel_command(command: u32, kernel: &mut Kernel<Number, AXES>, intake: &mut TickIntake) {
    match command {
        1 => kernel.trip(FaultKind::Encoder),
        2 => CODES.store(
            kernel.clear_fault().iter().flatten().fold(0, |sum, at| sum ^ at.to_bits() as u32),
            Ordering::Relaxed,
        ),
        3 => kernel.disable(),
        4 => kernel.resume(),
        5 => {
            let peaks = kernel.take_peak_following_error_mm();
            CODES.store(peaks.iter().fold(0, |sum, mm| sum ^ mm.to_bits64() as u32), Ordering::Relaxed);
        }
        6 => correct(intake),
        7 => kernel.enable(100),
        8 => CODES.store(u32::from(kernel.fault().is_some()), Ordering::Relaxed),
        _ => {}
    }
}

/// The root of all that a tick may call.
#[unsafe(no_mangle)]
#[inline(never)]
fn kernel_tick(kernel: &mut Kernel<Number, AXES>, intake: &mut TickIntake, memory: &mut InMemory<AXES>) {
    tick(kernel, intake, memory);
}
