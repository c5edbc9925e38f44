//! Firmware: the motion kernel on an ST NUCLEO-F446RE, three axes.
//!
//! ```text
//! TIM7 ─► tick                                           background (idle)
//!         drives: emergency stop, ready   ── Control ──  button, log
//!         console ── bytes ────────────────────────────  commands
//!         encoders ─► kernel ─► converter ◄─ streams ──  program
//!         watchdog ◄───────────────────────── steps ───
//!
//! EXTI2 ─► emergency_stop: enables off, outputs 0 V, without waiting for the tick
//! PVD ─► supply_falls, NMI (clock lost), hard fault, panic ─► stop: the same, then the watchdog resets
//! ```
//!
//! The tick is a hardware task with a static priority and nothing above it but the end of everything: it ends at
//! the latest its own longest time after the timer's event, plus the longest time for which the background masks
//! interrupts, plus one emergency stop.
//! `README.md` has wiring, bring-up and what to expect; `design_parameters.rs` has every number.
#![no_std]
#![no_main]
// No panic path in the tick.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

// What is the board's alone, or an emulated board's in its place; all else is the same.
#[cfg(not(feature = "emulated"))]
mod board;
#[cfg(not(feature = "emulated"))]
mod emergency_stop;
#[cfg(not(feature = "emulated"))]
mod encoders;
#[cfg(all(feature = "link", not(feature = "emulated")))]
mod flash;
#[cfg(all(feature = "link", not(feature = "emulated")))]
mod link_port;
#[cfg(not(feature = "emulated"))]
mod supply;
#[cfg(not(feature = "emulated"))]
mod tick_timer;
#[cfg(feature = "emulated")]
mod emulated;
#[cfg(all(feature = "link", feature = "emulated"))]
use emulated::link_port;
#[cfg(feature = "emulated")]
use emulated::{board, emergency_stop, encoders, tick_timer};

mod dac;
mod drives;
mod switches;
mod spindle;
mod hal;
#[cfg(feature = "link")]
mod stored;
#[cfg(not(feature = "link"))]
mod console_port;
mod background;
mod stop;

use core::sync::atomic::Ordering;

use armv7m_runtime as _;
use defmt_rtt as _;

// The tick's number before every line of the log.
defmt::timestamp!("{=u32}", background::TICKS.load(Ordering::Relaxed));

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;
    use core::sync::atomic::Ordering;

    use motion_board::Liveness;
    use motion_kernel::kernel::Kernel;
    use motion_kernel::tick_monitor::TickMonitor;
    use nucleo_f446re::design_parameters::{BOARD, TICK_CYCLES, TICK_PRIORITY};
    use nucleo_f446re::machine::{Control, Flight, Machine, Streams};
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    use crate::background::{Background, OfTick, Places, STEPS, TICKS};
    use crate::board::{Board, ScopePin};
    use crate::hal::Hardware;
    use crate::tick_timer::{TickTimer, cycles};

    /// Shared by tick and background, and by the interrupts of the tick's priority.
    #[shared]
    struct Shared {
        control: Control,
        #[lock_free]
        hardware: Hardware,
    }

    /// Owned by one of them.
    #[local]
    struct Local {
        tick_timer: TickTimer,
        watchdog: IndependentWatchdog,
        liveness: Liveness,
        monitor: TickMonitor,
        scope: ScopePin,
        of_background: OfTick,
        background: Background,
    }

    // Written at the start: an initial value that is not all zeros would lie in flash a second time, whole.
    #[init(local = [
        storage: MaybeUninit<Streams> = MaybeUninit::uninit(),
        flight: MaybeUninit<Flight> = MaybeUninit::uninit(),
        places: Places = Places::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let Board { parameters, mut hardware, mut tick_timer, mut watchdog, scope, button, line } =
            Board::new(cx.device, cx.core);
        let machine = defmt::unwrap!(if cfg!(feature = "link") {
            Machine::without_items(parameters, &BOARD)
        } else {
            Machine::new(parameters, &BOARD)
        });
        // The machine's position becomes the program's start.
        let kernel = Kernel::new(&machine.axes, machine.header().start, hardware.encoders.latch());
        let streams = cx.local.storage.write(Streams::new());
        let (background, intake, of_background) =
            Background::new(cx.local.places, streams, machine, parameters, button, line);
        let control = Control::new(kernel, intake, cx.local.flight.write(Flight::new()));
        Board::start(&mut tick_timer, &mut watchdog);
        let local = Local {
            tick_timer,
            watchdog,
            liveness: Liveness::new(BOARD.silent_ticks_max()),
            monitor: defmt::unwrap!(TickMonitor::new(32, TICK_CYCLES)),
            scope,
            of_background,
            background,
        };
        (Shared { control, hardware }, local)
    }

    const _: () = assert!(TICK_PRIORITY == 16, "repeated as a literal below");

    /// One control tick.
    #[task(
        binds = TIM7,
        priority = 16,
        local = [tick_timer, watchdog, liveness, monitor, scope, of_background],
        shared = [control, hardware]
    )]
    fn tick(mut cx: tick::Context) {
        let begin = cycles();
        let latency_cycles = cx.local.tick_timer.take();
        let hardware = cx.shared.hardware;
        cx.local.scope.set_high();
        cx.shared.control.lock(|control| {
            let unhealthy = hardware.drives.tick();
            control.tick(unhealthy, cx.local.monitor.began(begin), hardware);
            if cx.local.liveness.may_feed(STEPS.load(Ordering::Relaxed)) {
                cx.local.watchdog.feed();
            }
            cx.local.of_background.tick();
            if let Some(kind) = cx.local.monitor.ended(cycles()) {
                control.trip(kind);
            }
            let overrun = cx.local.tick_timer.due_again();
            control.timing.add(cycles().wrapping_sub(begin), latency_cycles, overrun);
        });
        TICKS.store(TICKS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        cx.local.scope.set_low();
    }

    /// The emergency stop has opened: what the next tick would do, now.
    #[task(binds = EXTI2, priority = 16, shared = [control, hardware])]
    fn emergency_stop(mut cx: emergency_stop::Context) {
        let hardware = cx.shared.hardware;
        if let Some(kind) = hardware.interrupt() {
            cx.shared.control.lock(|control| control.trip(kind));
        }
    }

    /// The supply falls. It takes part of a millisecond from here to the brown-out reset; it may also stay here.
    #[task(binds = PVD, priority = 16)]
    fn supply_falls(_: supply_falls::Context) {
        crate::stop::stop("the supply is below 2.9 V")
    }

    /// The background.
    #[idle(local = [background], shared = [control])]
    fn idle(cx: idle::Context) -> ! {
        cx.local.background.run(cx.shared.control)
    }
}
