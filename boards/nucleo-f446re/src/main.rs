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
#[cfg(not(feature = "emulated"))]
mod supply;
#[cfg(not(feature = "emulated"))]
mod tick_timer;
#[cfg(feature = "emulated")]
mod emulated;
#[cfg(feature = "emulated")]
use emulated::{board, emergency_stop, encoders, tick_timer};

mod dac;
mod drives;
mod switches;
mod spindle;
mod hal;
mod console_port;
mod background;
mod stop;

use core::sync::atomic::Ordering;

use defmt_rtt as _;

// The tick's number before every line of the log.
defmt::timestamp!("{=u32}", background::TICKS.load(Ordering::Relaxed));

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;
    use core::sync::atomic::Ordering;

    use heapless::spsc::{Producer, Queue};
    use motion_board::Liveness;
    use motion_kernel::kernel::Kernel;
    use motion_kernel::tick_monitor::TickMonitor;
    use nucleo_f446re::design_parameters::{BOARD, CONSOLE_BYTES, TICK_CYCLES, TICK_PRIORITY};
    use nucleo_f446re::machine::{AXES, Control, Flight, Machine, Number, PROGRAM, Streams};
    use stm32f4xx_hal::pac::USART2;
    use stm32f4xx_hal::serial::Rx;
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    use crate::background::{self, Panel, STEPS, TICKS};
    use crate::board::{Board, ScopePin};
    use crate::console_port;
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
        console: Rx<USART2>,
        received: Producer<'static, u8>,
        panel: Panel,
        streams: &'static mut Streams,
        machine: Machine,
    }

    // Written at the start: an initial value that is not all zeros would lie in flash a second time, whole.
    #[init(local = [
        storage: MaybeUninit<Streams> = MaybeUninit::uninit(),
        flight: MaybeUninit<Flight> = MaybeUninit::uninit(),
        // The kernel's streams until there is a program; nothing ever enters them.
        empty: MaybeUninit<motion_kernel::queue::Streams<Number, AXES, 2, 2>> = MaybeUninit::uninit(),
        console_bytes: Queue<u8, CONSOLE_BYTES> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let Board { mut hardware, mut tick_timer, mut watchdog, scope, button, console } =
            Board::new(cx.device, cx.core);
        let machine = defmt::unwrap!(Machine::new(PROGRAM, &BOARD));
        // The machine's position becomes the program's start.
        let start = machine.header().start;
        let kernel = Kernel::new(&machine.axes, start, hardware.encoders.latch());
        let empty = cx.local.empty.write(motion_kernel::queue::Streams::new());
        let (_, intake) = empty.split(machine.header().rules, start);
        let control = Control::new(kernel, intake, cx.local.flight.write(Flight::new()));
        let (received, bytes) = cx.local.console_bytes.split();
        Board::start(&mut tick_timer, &mut watchdog);
        let local = Local {
            tick_timer,
            watchdog,
            liveness: Liveness::new(BOARD.silent_ticks_max()),
            monitor: defmt::unwrap!(TickMonitor::new(32, TICK_CYCLES)),
            scope,
            console,
            received,
            panel: Panel { button, bytes },
            streams: cx.local.storage.write(Streams::new()),
            machine,
        };
        (Shared { control, hardware }, local)
    }

    const _: () = assert!(TICK_PRIORITY == 16, "repeated as a literal below");

    /// One control tick.
    #[task(
        binds = TIM7,
        priority = 16,
        local = [tick_timer, watchdog, liveness, monitor, scope, console, received],
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
            console_port::receive(cx.local.console, cx.local.received);
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
    #[idle(local = [streams, panel, machine], shared = [control])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { streams, panel, machine, .. } = cx.local;
        background::run(cx.shared.control, streams, machine, panel)
    }
}
