//! The board from reset to its first tick: pins, clocks, peripherals.
//!
//! Consumes the peripherals, once; produces what the tick and the background own. First of all the enables,
//! spindle and coolant become outputs at low, the level at which their pull-downs have held them since reset. Panics if the
//! hardware differs from `design_parameters.rs`; nothing is enabled then. Without the ST-LINK's clock, or with a supply
//! that is too low, it waits forever, with everything off.

use defmt::info;
use motion_kernel::hal::Ad5754Output;
use nucleo_f446re::design_parameters::{
    APB1_HZ, APB1_TIMER_HZ, APB2_HZ, APB2_TIMER_HZ, HSE_HZ, SPI_HZ, SYSCLK_HZ, WATCHDOG_MS,
};
use stm32f4xx_hal::gpio::{Alternate, AnyPin, Input, Output, PA3, PA10, PB12, PC13, Pull, Speed};
use stm32f4xx_hal::pac::rcc::csr;
use stm32f4xx_hal::pac::{self, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;
use stm32f4xx_hal::spi::{Spi, SpiExt};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::dac::{self, Device, Sender};
use crate::drives::Drives;
use crate::emergency_stop::EmergencyStop;
use crate::encoders::Encoders;
use crate::hal::Hardware;
use crate::spindle::SpindleAndCoolant;
use crate::supply;
use crate::switches::Switches;
use crate::tick_timer::TickTimer;

/// The wires that an emulated board has in another way.
pub(crate) type Bus = Sender;
pub(crate) type SyncPin = PB12<Output>;
pub(crate) type EnablePin = AnyPin<Output>;
pub(crate) type ScopePin = PA10<Output>;
pub(crate) type ButtonPin = PC13<Input>;
/// ST-LINK's serial port: the console, or the link.
#[cfg(not(feature = "link"))]
pub(crate) type Line = stm32f4xx_hal::serial::Rx<pac::USART2>;
#[cfg(feature = "link")]
pub(crate) type Line = crate::link_port::LinkPort;

/// Writes a line of the log.
pub(crate) use motion_board::log::write;

/// Passes time until an interrupt, or a part of it. (Not with `wfi`: in sleep the probe can't read the log.)
pub(crate) fn pause() {
    core::hint::spin_loop();
}

/// Writes why everything has ended.
pub(crate) fn write_end(why: core::fmt::Arguments<'_>) {
    defmt::error!("stopped for good: {}", defmt::Display2Format(&why));
}

/// Everything the firmware uses, ready to tick.
pub(crate) struct Board {
    /// Of its machine, as a compiled program, whose items are driven if there is no link.
    pub(crate) parameters: &'static [u8],
    pub(crate) hardware: Hardware,
    pub(crate) tick_timer: TickTimer,
    pub(crate) watchdog: IndependentWatchdog,
    /// High while the tick runs.
    pub(crate) scope: ScopePin,
    /// B1: low while it is pressed (the board has the pull-up).
    pub(crate) button: ButtonPin,
    /// ST-LINK's serial port.
    pub(crate) line: Line,
}

impl Board {
    /// Sets the board up. Takes a few milliseconds, or what new parameters take; the tick's timer and the watchdog do not run yet.
    pub(crate) fn new(device: pac::Peripherals, mut core: cortex_m::Peripherals) -> Self {
        let mut rcc = device.RCC.constrain();
        let gpioa = device.GPIOA.split(&mut rcc);
        let gpiob = device.GPIOB.split(&mut rcc);
        let gpioc = device.GPIOC.split(&mut rcc);
        let gpiod = device.GPIOD.split(&mut rcc);

        let enables = [
            gpioc.pc8.into_push_pull_output().erase(),
            gpioc.pc6.into_push_pull_output().erase(),
            gpioc.pc5.into_push_pull_output().erase(),
        ];
        let spindle_and_coolant = SpindleAndCoolant {
            spindle: gpiob.pb1.into_push_pull_output().erase(),
            coolant: gpiob.pb14.into_push_pull_output().erase(),
        };

        let cause = start_cause(&rcc.csr().read());
        rcc.csr().modify(|_, w| w.rmvf().set_bit());
        // Flash wait states, prefetch and both caches are set by the HAL on the way (RM0390 section 3.4).
        let mut rcc = rcc.freeze(
            Config::hse(HSE_HZ.Hz())
                .bypass_hse_oscillator()
                .sysclk(SYSCLK_HZ.Hz())
                .pclk1(APB1_HZ.Hz())
                .pclk2(APB2_HZ.Hz()),
        );
        let clocks = &rcc.clocks;
        defmt::assert_eq!(clocks.sysclk().raw(), SYSCLK_HZ);
        defmt::assert_eq!(clocks.pclk1().raw(), APB1_HZ);
        defmt::assert_eq!(clocks.pclk2().raw(), APB2_HZ);
        defmt::assert_eq!(clocks.timclk1().raw(), APB1_TIMER_HZ);
        defmt::assert_eq!(clocks.timclk2().raw(), APB2_TIMER_HZ);
        info!("nucleo-f446re: {=u32} MHz, {=str}", SYSCLK_HZ / 1_000_000, cause);
        let lines = device.EXTI;
        supply::watch(&device.FLASH, &device.PWR, &lines, &mut rcc);
        #[cfg(feature = "link")]
        let parameters = crate::flash::parameters(device.FLASH);
        #[cfg(not(feature = "link"))]
        let parameters = nucleo_f446re::machine::PROGRAM;

        let mut routing = device.SYSCFG.constrain(&mut rcc);
        let drives = Drives {
            enables,
            ready: [
                gpioc.pc10.into_pull_up_input().erase(),
                gpioc.pc11.into_pull_up_input().erase(),
                gpioc.pc12.into_pull_up_input().erase(),
            ],
            emergency_stop: EmergencyStop::new(gpiod.pd2.into_pull_up_input(), lines, &mut routing),
        };
        let switches = Switches {
            x: (
                gpioc.pc0.into_pull_up_input(),
                gpioc.pc1.into_pull_up_input(),
                gpioc.pc2.into_pull_up_input(),
            ),
            y: (
                gpioc.pc3.into_pull_up_input(),
                gpioc.pc4.into_pull_up_input(),
                gpioc.pc7.into_pull_up_input(),
            ),
            z: (
                gpioa.pa4.into_pull_up_input(),
                gpiob.pb0.into_pull_up_input(),
                gpioa.pa9.into_pull_up_input(),
            ),
        };

        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();

        let encoders = Encoders::new(
            (device.TIM5, gpioa.pa0.into(), gpioa.pa1.into()),
            (device.TIM2, gpiob.pb8.into(), gpiob.pb9.into(), gpiob.pb10.into()),
            (device.TIM3, gpioa.pa6.into(), gpioa.pa7.into(), gpioc.pc9.into()),
            &mut rcc,
        );

        // Edges of 21 MHz need the second fastest drive strength (DS10693, I/O AC characteristics).
        let clock = gpiob.pb13.into_alternate::<5>().speed(Speed::High);
        let data = gpiob.pb15.into_alternate::<5>().speed(Speed::High);
        let mut sync = gpiob.pb12.into_push_pull_output_in_state(stm32f4xx_hal::gpio::PinState::High);
        sync.set_speed(Speed::High);
        let bus =
            Spi::new(device.SPI2, (Some(clock), SPI2::NoMiso, Some(data)), dac::MODE, SPI_HZ.Hz(), &mut rcc);
        let spi = Device::new(Sender::new(bus), sync);
        let mut delay = core.SYST.delay(&rcc.clocks);
        let outputs = match Ad5754Output::setup(spi, &mut delay) {
            Ok(outputs) => outputs,
            Err(error) => defmt::panic!("converter: {}", defmt::Debug2Format(&error)),
        };

        // Pulled up: without ST-LINK's power nobody drives the line.
        let receive: PA3<Alternate<7>> = gpioa.pa3.into_alternate().internal_resistor(Pull::Up);
        #[cfg(not(feature = "link"))]
        let line = crate::console_port::open(device.USART2, receive, &mut rcc);
        #[cfg(feature = "link")]
        let line = {
            use nucleo_f446re::design_parameters::{LINK_BAUD, LINK_DIVIDER};
            use stm32f4xx_hal::serial::SerialExt;
            use stm32f4xx_hal::serial::config::{Config, DmaConfig};
            let config = Config::default().baudrate(LINK_BAUD.bps()).dma(DmaConfig::TxRx);
            let serial = match device.USART2.serial((gpioa.pa2, receive), config, &mut rcc) {
                Ok(serial) => serial,
                Err(_) => defmt::panic!("link: {=u32} baud can't be had", LINK_BAUD),
            };
            let line = Line::new(serial, device.DMA1, &mut rcc);
            defmt::assert_eq!(line.divider(), LINK_DIVIDER);
            line
        };

        let watchdog = IndependentWatchdog::new(device.IWDG);
        // Not even the debugger stops it: a halted processor with drives enabled is exactly its case.
        watchdog.stop_on_debug(&device.DBGMCU, false);

        Self {
            parameters,
            hardware: Hardware { encoders, outputs, drives, switches, spindle_and_coolant },
            tick_timer: TickTimer::new(device.TIM7, &mut rcc),
            watchdog,
            scope: gpioa.pa10.into_push_pull_output(),
            button: gpioc.pc13.into_input(),
            line,
        }
    }

    /// Starts the watchdog, then the tick, which has to feed it.
    pub(crate) fn start(tick_timer: &mut TickTimer, watchdog: &mut IndependentWatchdog) {
        watchdog.start(WATCHDOG_MS.millis());
        // Its registers take five periods of the LSI to take their values (RM0390, IWDG_SR): 0.3 ms at most.
        cortex_m::asm::delay(SYSCLK_HZ / 2000);
        defmt::assert_eq!(watchdog.interval().ticks(), WATCHDOG_MS);
        tick_timer.start();
    }
}

/// Why the processor was reset, from the flags that its clock control keeps.
fn start_cause(flags: &csr::R) -> &'static str {
    if flags.wdgrstf().bit_is_set() {
        "RESET BY THE WATCHDOG"
    } else if flags.borrstf().bit_is_set() && flags.porrstf().bit_is_clear() {
        "RESET BY A BROWN-OUT"
    } else {
        "started"
    }
}
