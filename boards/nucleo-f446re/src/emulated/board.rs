//! The emulated board from reset to its first tick.
//!
//! No clock to wait for, no watchdog that could be read back, no supply to watch.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::SCB;
use cortex_m_semihosting::hprintln;
use embedded_hal::delay::DelayNs;
use motion_board::LogLine;
use motion_kernel::hal::Ad5754Output;
use motion_kernel::program::Reader;
use nucleo_f446re::machine::{AXES, Number, PROGRAM};
use stm32f4xx_hal::gpio::{Alternate, PA3, PinState};
use stm32f4xx_hal::pac::{self, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::spi::Spi;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use super::emergency_stop::EmergencyStop;
use super::encoders::Encoders;
use super::tick_timer::TickTimer;
pub(crate) use super::wires::{Bus, ButtonPin, EnablePin, ScopePin, SyncPin};
use super::{model, script};
use crate::background::TICKS;
use crate::dac::{self, Device, Sender};
use crate::drives::Drives;
use crate::hal::Hardware;
use crate::spindle::SpindleAndCoolant;
use crate::switches::Switches;

/// The emulator's second serial port: the console, or the link.
#[cfg(not(feature = "link"))]
pub(crate) type Line = stm32f4xx_hal::serial::Rx<pac::USART2>;
#[cfg(feature = "link")]
pub(crate) type Line = crate::link_port::LinkPort;

/// Writes a line of the log, and lets the script go on.
pub(crate) fn write(line: &LogLine<Number, AXES>) {
    hprintln!("{} {:?}", TICKS.load(Ordering::Relaxed), line);
    if matches!(line, LogLine::Done) {
        model::report();
    }
    if script::follow(line) {
        model::report();
        hprintln!("model: reset");
        SCB::sys_reset();
    }
}

/// Sleeps until an interrupt: the emulator then skips the time. Not where a PC is at the other end of the link, which can't
/// skip it.
pub(crate) fn pause() {
    if cfg!(feature = "link") {
        core::hint::spin_loop();
    } else {
        cortex_m::asm::wfi();
    }
}

/// Writes why everything has ended, and ends the emulator.
pub(crate) fn write_end(why: core::fmt::Arguments<'_>) {
    model::fail(why)
}

/// Waits by letting the converter's time pass.
struct Delay;

impl DelayNs for Delay {
    fn delay_ns(&mut self, time_ns: u32) {
        model::elapse(time_ns.into());
    }
}

/// Everything the firmware uses, ready to tick.
pub(crate) struct Board {
    pub(crate) parameters: &'static [u8],
    pub(crate) hardware: Hardware,
    pub(crate) tick_timer: TickTimer,
    pub(crate) watchdog: IndependentWatchdog,
    pub(crate) scope: ScopePin,
    pub(crate) button: ButtonPin,
    pub(crate) line: Line,
}

impl Board {
    /// Sets the board up; the tick does not run yet.
    pub(crate) fn new(device: pac::Peripherals, core: cortex_m::Peripherals) -> Self {
        let tick_timer = TickTimer::new(core.SYST);
        // The machine stays the one that the firmware was built with.
        let program = defmt::unwrap!(Reader::new(PROGRAM));
        model::start(program.header());
        let mut rcc = device.RCC.constrain();
        let gpioa = device.GPIOA.split(&mut rcc);
        let gpiob = device.GPIOB.split(&mut rcc);
        let gpioc = device.GPIOC.split(&mut rcc);

        let [x, y, z] = [
            gpioc.pc8.into_push_pull_output().erase(),
            gpioc.pc6.into_push_pull_output().erase(),
            gpioc.pc5.into_push_pull_output().erase(),
        ];
        let drives = Drives {
            enables: [
                EnablePin { pin: x, axis: 0 },
                EnablePin { pin: y, axis: 1 },
                EnablePin { pin: z, axis: 2 },
            ],
            ready: [
                gpioc.pc10.into_pull_up_input().erase(),
                gpioc.pc11.into_pull_up_input().erase(),
                gpioc.pc12.into_pull_up_input().erase(),
            ],
            emergency_stop: EmergencyStop,
        };
        let spindle_and_coolant = SpindleAndCoolant {
            spindle: gpiob.pb1.into_push_pull_output().erase(),
            coolant: gpiob.pb14.into_push_pull_output().erase(),
        };
        let switches = Switches {
            x: (gpioc.pc0.into_input(), gpioc.pc1.into_input(), gpioc.pc2.into_input()),
            y: (gpioc.pc3.into_input(), gpioc.pc4.into_input(), gpioc.pc7.into_input()),
            z: (gpioa.pa4.into_input(), gpiob.pb0.into_input(), gpioa.pa9.into_input()),
        };

        let clock = gpiob.pb13.into_alternate::<5>();
        let data = gpiob.pb15.into_alternate::<5>();
        let sync = SyncPin(gpiob.pb12.into_push_pull_output_in_state(PinState::High));
        let pins = (Some(clock), SPI2::NoMiso, Some(data));
        // Half of the clock that the processor has without its PLL; the emulator's bus takes no time.
        let clock_hz = rcc.clocks.pclk1() / 2;
        let bus = Spi::new(device.SPI2, pins, dac::MODE, clock_hz, &mut rcc);
        let spi = Device::new(Bus::new(Sender::new(bus)), sync);
        let outputs = match Ad5754Output::setup(spi, &mut Delay) {
            Ok(outputs) => outputs,
            Err(error) => defmt::panic!("converter: {}", defmt::Debug2Format(&error)),
        };
        model::elapse(0);

        let receive: PA3<Alternate<7>> = gpioa.pa3.into_alternate();
        #[cfg(not(feature = "link"))]
        let line = crate::console_port::open(device.USART2, receive, &mut rcc);
        #[cfg(feature = "link")]
        let line = {
            use nucleo_f446re::design_parameters::LINK_BAUD;
            use stm32f4xx_hal::serial::SerialExt;
            match device.USART2.serial::<u8>((gpioa.pa2, receive), LINK_BAUD.bps(), &mut rcc) {
                Ok(serial) => Line::new(serial.release().0),
                Err(_) => defmt::panic!("link: {=u32} baud can't be had", LINK_BAUD),
            }
        };

        Self {
            #[cfg(feature = "link")]
            parameters: crate::stored::parameters(super::flash::Flash),
            #[cfg(not(feature = "link"))]
            parameters: PROGRAM,
            hardware: Hardware { encoders: Encoders::new(), outputs, drives, switches, spindle_and_coolant },
            tick_timer,
            watchdog: IndependentWatchdog::new(device.IWDG),
            scope: ScopePin(gpioa.pa10.into_push_pull_output()),
            button: ButtonPin,
            line,
        }
    }

    /// Starts the tick.
    pub(crate) fn start(tick_timer: &mut TickTimer, _: &mut IndependentWatchdog) {
        tick_timer.start();
    }
}
