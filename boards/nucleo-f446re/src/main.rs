//! Firmware: the motion kernel on an ST NUCLEO-F446RE, three axes.
//!
//! ```text
//! TIM7 ─► tick (the only interrupt)                      background (idle)
//!         drives: emergency stop, ready   ── Control ──  button, log
//!         console ── bytes ────────────────────────────  commands
//!         encoders ─► kernel ─► converter ◄─ streams ──  program
//!         watchdog ◄───────────────────────── polls ───
//! ```
//!
//! The tick is a hardware task with a static priority and nothing above it: it ends at the latest its own
//! longest time after the timer's event, plus the longest time for which the background masks interrupts.
//! `README.md` has wiring, bring-up and what to expect; `design_parameters.rs` has every number.
#![no_std]
#![no_main]
// No panic path in the tick.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

mod board;
mod encoders;
mod dac;
mod drives;
mod spindle;
mod hal;
mod tick_timer;
mod console_port;
mod background;

use core::sync::atomic::Ordering;

use defmt_rtt as _;
use panic_probe as _;

// The tick's number before every line of the log.
defmt::timestamp!("{=u32}", background::TICKS.load(Ordering::Relaxed));

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::sync::atomic::Ordering;

    use cortex_m::peripheral::DWT;
    use heapless::spsc::{Producer, Queue};
    use motion_board::Liveness;
    use motion_kernel::kernel::Kernel;
    use motion_kernel::tick_monitor::TickMonitor;
    use nucleo_f446re::design_parameters::{BOARD, CONSOLE_BYTES, TICK_CYCLES, TICK_PRIORITY};
    use nucleo_f446re::machine::{AXES, Control, Flight, Machine, Number, PROGRAM, Streams};
    use stm32f4xx_hal::gpio::{Output, PA10};
    use stm32f4xx_hal::pac::USART2;
    use stm32f4xx_hal::serial::Rx;
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    use crate::background::{self, POLLS, Panel, TICKS};
    use crate::board::Board;
    use crate::console_port;
    use crate::hal::Hardware;
    use crate::tick_timer::TickTimer;

    /// Shared by tick and background.
    #[shared]
    struct Shared {
        control: Control,
    }

    /// Owned by one of them.
    #[local]
    struct Local {
        hardware: Hardware,
        tick_timer: TickTimer,
        watchdog: IndependentWatchdog,
        liveness: Liveness,
        monitor: TickMonitor,
        scope: PA10<Output>,
        console: Rx<USART2>,
        received: Producer<'static, u8>,
        panel: Panel,
        streams: &'static mut Streams,
        machine: Machine,
    }

    #[init(local = [
        storage: Streams = Streams::new(),
        flight: Flight = Flight::new(),
        console_bytes: Queue<u8, CONSOLE_BYTES> = Queue::new(),
        // The kernel's streams until there is a program; nothing ever enters them.
        empty: motion_kernel::queue::Streams<Number, AXES, 2, 2> = motion_kernel::queue::Streams::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let Board { mut hardware, mut tick_timer, mut watchdog, scope, button, console } =
            Board::new(cx.device, cx.core);
        let machine = defmt::unwrap!(Machine::new(PROGRAM, &BOARD));
        // The machine's position becomes the program's start.
        let start = machine.header().start;
        let kernel = Kernel::new(&machine.axes, start, hardware.encoders.latch());
        let (_, intake) = cx.local.empty.split(machine.header().rules, start);
        let control = Control::new(kernel, intake, start, cx.local.flight);
        let (received, bytes) = cx.local.console_bytes.split();
        Board::start(&mut tick_timer, &mut watchdog);
        let local = Local {
            hardware,
            tick_timer,
            watchdog,
            liveness: Liveness::new(BOARD.silent_ticks_max()),
            monitor: defmt::unwrap!(TickMonitor::new(32, TICK_CYCLES)),
            scope,
            console,
            received,
            panel: Panel { button, bytes },
            streams: cx.local.storage,
            machine,
        };
        (Shared { control }, local)
    }

    const _: () = assert!(TICK_PRIORITY == 16, "repeated as a literal below");

    /// One control tick.
    #[task(
        binds = TIM7,
        priority = 16,
        local = [hardware, tick_timer, watchdog, liveness, monitor, scope, console, received],
        shared = [control]
    )]
    fn tick(mut cx: tick::Context) {
        let begin = DWT::cycle_count();
        let latency_cycles = cx.local.tick_timer.take();
        let hardware = cx.local.hardware;
        cx.local.scope.set_high();
        cx.shared.control.lock(|control| {
            let unhealthy = hardware.drives.check();
            control.tick(unhealthy, cx.local.monitor.began(begin), hardware);
            if cx.local.liveness.may_feed(POLLS.load(Ordering::Relaxed)) {
                cx.local.watchdog.feed();
            }
            console_port::receive(cx.local.console, cx.local.received);
            if let Some(kind) = cx.local.monitor.ended(DWT::cycle_count()) {
                control.trip(kind);
            }
            let overrun = cx.local.tick_timer.due_again();
            control.timing.add(DWT::cycle_count().wrapping_sub(begin), latency_cycles, overrun);
        });
        TICKS.store(TICKS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        cx.local.scope.set_low();
    }

    /// The background.
    #[idle(local = [streams, panel, machine], shared = [control])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { streams, panel, machine, .. } = cx.local;
        background::run(cx.shared.control, streams, machine, panel)
    }
}
