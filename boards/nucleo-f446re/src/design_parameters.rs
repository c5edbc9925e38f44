//! Every number of the firmware, with its derivation.
//!
//! Consumes the manuals: RM0390 (reference manual of the STM32F446), DS10693 (its data sheet), UM1724 (the
//! board), AD5754 (the converter's data sheet). Produces constants. Relations between constants are asserted
//! at compile time; the tests below check margins.
//!
//! To change the tick, change [`TICK_HZ`]: the rest follows or does not compile.

use motion_board::{BoardOutputs, BoardParameters};
use motion_kernel::live::Leads;

// --- Clock tree: RM0390 section 6.2, limits DS10693 section 6.3.1 ---------------------------------

/// Clock from the ST-LINK's MCO at OSC_IN, oscillator bypassed (UM1724, "OSC clock supply") \[Hz\].
pub const HSE_HZ: u32 = 8_000_000;
/// Core and AHB \[Hz\]: the fastest without over-drive (DS10693: 168 MHz at regulator scale 1).
pub const SYSCLK_HZ: u32 = 168_000_000;
/// APB1: SPI2 \[Hz\]. At most 45 MHz; AHB / 4.
pub const APB1_HZ: u32 = 42_000_000;
/// APB2 \[Hz\]. At most 90 MHz; AHB / 2. Nothing here uses it; it is set to a defined value.
pub const APB2_HZ: u32 = 84_000_000;
/// Timers on APB1: TIM2, TIM3, TIM5, TIM7 \[Hz\]. Twice the bus clock if its prescaler is not 1 (RM0390
/// section 6.2, TIMPRE = 0).
pub const APB1_TIMER_HZ: u32 = 2 * APB1_HZ;
/// Timers on APB2 \[Hz\].
pub const APB2_TIMER_HZ: u32 = 2 * APB2_HZ;

const _: () = assert!(SYSCLK_HZ == 4 * APB1_HZ && SYSCLK_HZ == 2 * APB2_HZ);
const _: () = assert!(APB1_HZ <= 45_000_000 && APB2_HZ <= 90_000_000);

// --- Tick ------------------------------------------------------------------------------------------

/// Control ticks per second \[Hz\]: the measured machine's 0.5 ms, a twentieth of its axis's time constant of
/// 9.83 ms (S4).
pub const TICK_HZ: u32 = 2_000;
/// The same as a duration \[s\].
pub const TICK_S: f64 = 1.0 / TICK_HZ as f64;
/// Prescaler register of the tick's timer, TIM7: counts at [`APB1_TIMER_HZ`], 11.9 ns, which is also the
/// resolution of the measured latency.
pub const TICK_TIMER_PRESCALER: u16 = 0;
/// Reload register: period − 1.
pub const TICK_TIMER_RELOAD: u16 = (APB1_TIMER_HZ / TICK_HZ - 1) as u16;
/// Core cycles per tick.
pub const TICK_CYCLES: u32 = SYSCLK_HZ / TICK_HZ;
/// Priority of the tick's interrupt as RTIC counts it: 16 is the highest of the processor's 16 levels, the
/// NVIC's 0 (DS10693: 4 bits). That of the emergency stop and of the voltage detector too, so none stops another;
/// `main.rs` repeats it where only a literal is allowed.
pub const TICK_PRIORITY: u8 = 16;

const _: () = assert!(APB1_TIMER_HZ.is_multiple_of(TICK_HZ), "the period would not be exact");
const _: () = assert!(APB1_TIMER_HZ / TICK_HZ <= 1 << 16, "the period does not fit the timer");

// --- Converter -------------------------------------------------------------------------------------

/// SPI clock \[Hz\]: APB1 / 2. AD5754, timing characteristics: at most 30 MHz (t1 at least 33 ns, t2 and
/// t3 at least 13 ns each). 21 MHz has 47.6 ns and 23.8 ns.
pub const SPI_HZ: u32 = APB1_HZ / 2;
/// The converter's greatest SPI clock \[Hz\].
pub const SPI_MAX_HZ: u32 = 30_000_000;
/// Frames per tick: one for each axis and the load command.
pub const DAC_FRAMES_PER_TICK: u32 = 3 + 1;
/// Bits of a frame.
pub const DAC_FRAME_BITS: u32 = 24;
/// Time the clock runs for the frames of one tick \[ns\]: 96 bits at 21 MHz, 4.57 µs. The processor feeds the
/// bytes and switches SYNC; with that the burst takes about twice as long (visible on SYNC with a scope).
pub const DAC_BURST_CLOCK_NS: u32 =
    (1_000_000_000_u64 * (DAC_FRAMES_PER_TICK * DAC_FRAME_BITS) as u64 / SPI_HZ as u64) as u32;
/// Least time that SYNC must be high between two frames \[ns\] (AD5754, t6 in write mode).
pub const SYNC_HIGH_NS: u32 = 100;
/// The same in core cycles, rounded up.
pub const SYNC_HIGH_CYCLES: u32 = (SYSCLK_HZ as u64 * SYNC_HIGH_NS as u64).div_ceil(1_000_000_000) as u32;

/// The frame that puts all outputs to 0 V at once, without a load (AD5754: control register, 011, clear, 100).
pub const DAC_CLEAR_FRAME: [u8; 3] = [0b0001_1100, 0, 0];
/// Turns of a loop in which a byte has left for certain: some ten cycles each, a byte takes 64.
pub const SPI_WAIT_TURNS: u32 = 100;

const _: () = assert!(SPI_HZ <= SPI_MAX_HZ);

// --- Supply ----------------------------------------------------------------------------------------

/// Option bits BOR_LEV of the highest level of the brown-out reset, 3, which holds the processor in reset below some 2.8 V:
/// 00 is level 3, 11 is off, as delivered (RM0390, FLASH_OPTCR; DS10693, embedded reset and power control block).
pub const BROWN_OUT_BITS: u8 = 0b00;
/// Level of the voltage detector (PWR_CR, PLS): its highest, some 2.9 V when the supply falls, above the reset.
pub const VOLTAGE_DETECTOR_LEVEL: u8 = 7;

// --- Encoders --------------------------------------------------------------------------------------

/// Samples that must agree before the input filter passes a level: ICxF = 0100 (RM0390, TIMx_CCMR1).
pub const ENCODER_FILTER_SAMPLES: u32 = 6;
/// The value of ICxF that says so.
pub const ENCODER_FILTER_BITS: u8 = 0b0100;
/// Sampling clock of that filter \[Hz\]: f_DTS / 2, where f_DTS is the timer's clock (CKD = 0).
pub const ENCODER_FILTER_HZ: u32 = APB1_TIMER_HZ / 2;
/// The longest pulse that the filter removes for certain \[ns\]: shorter than N − 1 sampling periods.
pub const ENCODER_FILTER_REMOVES_NS: u32 =
    ((ENCODER_FILTER_SAMPLES - 1) as u64 * 1_000_000_000 / ENCODER_FILTER_HZ as u64) as u32;
/// Count rate that passes for certain \[1/s\]: one count lasts N + 1 sampling periods, so A and B may be out
/// of step by any part of a count. An ideal encoder passes at twice that rate.
pub const ENCODER_COUNTS_PER_S_MAX: u32 = ENCODER_FILTER_HZ / (ENCODER_FILTER_SAMPLES + 1);
/// Bits of the narrowest counter: TIM3's.
pub const ENCODER_BITS_MIN: u32 = 16;

// --- Watchdog and background -----------------------------------------------------------------------

/// Nominal timeout of the independent watchdog \[ms\], at 32 kHz. Nothing else stops the outputs when the
/// processor stops, so it is short: a drive at full speed continues for at most [`WATCHDOG_MAX_NS`].
pub const WATCHDOG_MS: u32 = 5;
/// The watchdog's prescaler, as the HAL computes it.
pub const WATCHDOG_PRESCALER: u32 = 32;
/// Counts of the watchdog until it resets.
pub const WATCHDOG_COUNTS: u32 = 5;
/// Range of the LSI oscillator over parts and temperature \[Hz\] (DS10693, LSI characteristics).
pub const LSI_MIN_HZ: u32 = 17_000;
/// The upper end \[Hz\].
pub const LSI_MAX_HZ: u32 = 47_000;
/// Least time to the reset \[ns\]: the prescaler runs free, so the first count may be cut.
pub const WATCHDOG_MIN_NS: u32 =
    ((WATCHDOG_COUNTS - 1) as u64 * WATCHDOG_PRESCALER as u64 * 1_000_000_000 / LSI_MAX_HZ as u64) as u32;
/// Greatest time to the reset \[ns\].
pub const WATCHDOG_MAX_NS: u32 =
    (WATCHDOG_COUNTS as u64 * WATCHDOG_PRESCALER as u64 * 1_000_000_000 / LSI_MIN_HZ as u64) as u32;
/// Cycles that the background takes per item of a program: some 20 000, double precision in software.
/// Assumed, not measured; the log's "background poll" is the measurement.
pub const ITEM_CYCLES: u32 = 20_000;
/// Cycles that a tick takes from the background: twice the estimate for slow memory.
pub const TICK_CYCLES_TAKEN: u32 = 4_000;
/// Items that the background sustains \[1/s\]: 8000, four per tick. The streams accept at most 16 pieces and
/// 8 segments per tick, 48 000 per second; beyond the sustained rate motion brakes to rest on the path, and
/// continues when there is more.
pub const ITEMS_PER_S: u32 = (SYSCLK_HZ - TICK_HZ * TICK_CYCLES_TAKEN) / ITEM_CYCLES;
/// Number of blocks, and of ramps, that live control knows ahead.
pub const PLACES: usize = 64;
/// Greatest number of instructions counted for a poll of the background on an emulated Cortex-M4F, under
/// random commands, rounded up.
pub const POLL_INSTRUCTIONS_MAX: u32 = 4_000_000;
/// The longest poll of the background \[cycles\], at two per instruction: assumed, not measured, like the
/// items' above.
pub const POLL_CYCLES_MAX: u32 = 2 * POLL_INSTRUCTIONS_MAX;
/// The same in ticks, which take their share of the processor: some 50 ms.
pub const POLL_TICKS_MAX: u32 = ticks_of(POLL_CYCLES_MAX);
/// Greatest number of instructions counted for a step of a poll, rounded up: between two looks for a stop, each of which
/// tells the tick that the background is alive.
pub const STEP_INSTRUCTIONS_MAX: u32 = 100_000;
/// The longest step \[ticks\], estimated in the same way.
pub const STEP_TICKS_MAX: u32 = ticks_of(2 * STEP_INSTRUCTIONS_MAX);

/// Ticks that pass while the background computes for so many cycles.
const fn ticks_of(cycles: u32) -> u32 {
    (cycles as u64 * TICK_HZ as u64).div_ceil((SYSCLK_HZ - TICK_HZ * TICK_CYCLES_TAKEN) as u64) as u32
}

/// How far ahead of the progress last seen the background changes a ramp: 1.5 ms for a stop, 4 ms for an ordinary poll
/// with a plan.
pub const LEADS: Leads = Leads { stop_ticks: 3, plan_ticks: 8 };

const _: () = assert!(
    3 * STEP_TICKS_MAX < BOARD.silent_ticks_max(),
    "the longest step of a poll is close to what the watchdog takes for silence"
);

/// Bits per second of the serial console. A byte is ten bits, two ticks long, so the tick, which takes one
/// byte, never misses one, however late it is within its tolerance.
pub const CONSOLE_BAUD: u32 = 9600;
/// Places for bytes between tick and background: as many as may come in the longest poll, plus one that stays
/// empty.
pub const CONSOLE_BYTES: usize = 256;

const _: () = assert!(CONSOLE_BAUD <= 5 * TICK_HZ, "a byte may be lost between two ticks");
const _: () = assert!(
    (POLL_TICKS_MAX as u64 * CONSOLE_BAUD as u64).div_ceil(10 * TICK_HZ as u64) < CONSOLE_BYTES as u64,
    "more bytes may come in a poll of the background than there are places"
);

// --- Link ------------------------------------------------------------------------------------------

/// Bits per second of the link: what ports of PCs offer next to what ST-LINK's takes.
pub const LINK_BAUD: u32 = 921_600;
/// The divider that comes closest (RM0390, USART: fractional baud rate generation, 16 samples a bit).
pub const LINK_DIVIDER: u32 = (APB1_HZ + LINK_BAUD / 2) / LINK_BAUD;
/// What it makes \[1/s\].
pub const LINK_ACTUAL_BAUD: u32 = APB1_HZ / LINK_DIVIDER;
/// Its error \[0.01 %\], rounded away from 0. A receiver tolerates 3.33 % in all (RM0390, table of the USART receiver's
/// tolerance: 8 bits, 16 samples, a divider with a fraction, noise detected).
pub const LINK_ERROR_BASIS_POINTS: i32 =
    ((LINK_ACTUAL_BAUD as i64 - LINK_BAUD as i64) * 10_000 / LINK_BAUD as i64) as i32 - 1;
/// Places for bytes that the DMA has brought: twice what may come between two looks of the background at them, a step of a
/// plan.
pub const LINK_RING: usize = 4096;
/// Most bytes of parameters that the board keeps: three axes of the reference machine take 578, each that is homed less than
/// 110 more, each that is compensated less than 160.
pub const PARAMETERS_MAX: usize = 1408;
const _: () = assert!(PARAMETERS_MAX >= 578 + 3 * (110 + 160), "all axes may be homed and compensated");
/// Where it keeps them: sectors 1 and 2, 16 KiB each, between the vectors and the code (RM0390, table 5) \[bytes from the begin of
/// flash\]. The emulated board's are memory.
pub const PARAMETER_SECTORS: core::ops::Range<u32> =
    if cfg!(feature = "emulated") { 0..2 * 1088 } else { 0x4000..0xC000 };
/// Items that have room before live control takes them: what comes while an answer is under way.
pub const LINK_ITEMS: usize = 16;

const _: () = assert!(LINK_DIVIDER >= 16, "the divider has a whole part of 1 at least");
const _: () = assert!(
    STEP_TICKS_MAX as u64 * LINK_ACTUAL_BAUD as u64 / (10 * TICK_HZ as u64) < LINK_RING as u64 / 2,
    "more bytes may come in a step of a plan than half of the ring holds"
);
const _: () = assert!(TICK_HZ.is_multiple_of(1000), "the link counts whole milliseconds");

/// Ticks that the flight recorder keeps: 45 ms, 16 KB, what the stack leaves; with the link, which needs some of it, 40 ms.
pub const FLIGHT_ROWS: usize = TICK_HZ as usize / if cfg!(feature = "link") { 25 } else { 22 };
/// Ticks of these after the fault's: 25 ms, which show the axes coasting.
pub const FLIGHT_AFTER: usize = TICK_HZ as usize / 40;

// --- What the crate of all boards asks for -----------------------------------------------------------

/// The board, for `motion_board`.
pub const BOARD: BoardParameters = BoardParameters {
    tick_hz: TICK_HZ,
    cycles_hz: SYSCLK_HZ,
    counts_per_s_max: ENCODER_COUNTS_PER_S_MAX,
    leads: LEADS,
    // One pin each for spindle and coolant.
    outputs: BoardOutputs::FixedSpeed,
};

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use embedded_hal::delay::DelayNs;
    use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
    use motion_kernel::hal::Ad5754Output;

    use super::*;
    use crate::machine::{AXES, Machine, PROGRAM};

    fn machine() -> Machine {
        Machine::new(PROGRAM, &BOARD).expect("suits")
    }

    #[test]
    fn the_pll_makes_the_core_clock_within_its_ranges() {
        // What the HAL chooses: M = 4, N = 168, P = 2. RM0390, RCC_PLLCFGR: input 1 to 2 MHz, output of the
        // VCO 100 to 432 MHz.
        let (input_hz, vco_hz) = (HSE_HZ / 4, HSE_HZ / 4 * 168);
        assert!((1_000_000..=2_000_000).contains(&input_hz));
        assert!((100_000_000..=432_000_000).contains(&vco_hz));
        assert_eq!(vco_hz / 2, SYSCLK_HZ);
        assert_eq!((APB1_TIMER_HZ, APB2_TIMER_HZ), (84_000_000, 168_000_000));
    }

    #[test]
    fn the_tick_is_exact() {
        let period = u32::from(TICK_TIMER_RELOAD) + 1;
        assert_eq!(period * (u32::from(TICK_TIMER_PRESCALER) + 1) * TICK_HZ, APB1_TIMER_HZ);
        assert_eq!(TICK_CYCLES * TICK_HZ, SYSCLK_HZ);
        // As a number it is the measured machine's, to the bit.
        assert_eq!(TICK_S.to_bits(), 0.0005_f64.to_bits());
    }

    #[test]
    fn the_converter_burst_is_a_small_part_of_the_tick() {
        assert_eq!(DAC_BURST_CLOCK_NS, 4571);
        // Even at four times its clock time it is below a twentieth of the tick.
        const { assert!(4 * DAC_BURST_CLOCK_NS < 1_000_000_000 / TICK_HZ / 20) };
        assert_eq!(SYNC_HIGH_CYCLES, 17);
    }

    /// Frames that a driver sends.
    #[derive(Default)]
    struct Frames(Vec<Vec<u8>>);

    impl ErrorType for Frames {
        type Error = Infallible;
    }

    impl SpiDevice for Frames {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
            let written = operations.iter().flat_map(|operation| match operation {
                Operation::Write(bytes) => bytes.to_vec(),
                other => panic!("{other:?}"),
            });
            self.0.push(written.collect());
            Ok(())
        }
    }

    impl DelayNs for Frames {
        fn delay_ns(&mut self, _: u32) {}
    }

    /// The frame that ends everything is the one that the converter's driver clears with: the second of its setup.
    #[test]
    fn the_clear_frame_is_the_drivers() {
        let frames = Ad5754Output::<_, AXES>::setup(Frames::default(), &mut Frames::default());
        let Frames(frames) = frames.map(Ad5754Output::release).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(frames[1], DAC_CLEAR_FRAME);
    }

    #[test]
    fn encoders_count_twice_the_fastest_axis() {
        let header = *machine().header();
        let fastest_per_s = header.rules.feed_mm_s / header.axes[0].mm_per_count;
        assert!(f64::from(ENCODER_COUNTS_PER_S_MAX) >= 2.0 * fastest_per_s, "{fastest_per_s}");
        assert_eq!(ENCODER_COUNTS_PER_S_MAX, 6_000_000);
        assert_eq!(ENCODER_FILTER_REMOVES_NS, 119);
    }

    #[test]
    fn a_sixteen_bit_counter_never_wraps_unseen() {
        // Ten times in hand even at the rate that the filter passes at most.
        let counts_per_tick = ENCODER_COUNTS_PER_S_MAX / TICK_HZ;
        assert!(10 * counts_per_tick < 1 << (ENCODER_BITS_MIN - 1));
    }

    #[test]
    fn the_links_rate_is_close_enough() {
        assert_eq!((LINK_DIVIDER, LINK_ACTUAL_BAUD), (46, 913_043));
        // A quarter of the tolerance, so that the other side may have as much and more.
        assert_eq!(LINK_ERROR_BASIS_POINTS, -93);
        assert!(include_str!("../README.md").contains("921 600 baud; 42 MHz / 46 is 913 043, −0.93 %"));
    }

    #[test]
    fn the_readme_says_what_the_background_sustains() {
        assert_eq!(ITEMS_PER_S, 8000);
        let readme = include_str!("../README.md");
        assert!(readme.contains("8000 items a second"));
        assert_eq!((POLL_TICKS_MAX * 1000).div_ceil(TICK_HZ), 50);
        assert!(readme.contains("up to 50 ms"));
    }

    #[test]
    fn polls_and_steps_take_no_more_than_was_counted() {
        let stages = include_str!("../../../tests/expected/stages.md");
        let counted = |what: &str| {
            let begin = format!("| Cortex-M4F, M7 | f32 | {what} |");
            let row = stages.lines().find(|row| row.starts_with(&begin)).expect("counted");
            let counted = row.trim_end_matches(" |").rsplit(' ').next().expect("a figure");
            counted.parse::<u32>().expect("a number")
        };
        let polls = [
            "a poll of live control",
            "the poll that takes an override",
            "the poll that takes a resume",
            "the poll that begins or ends single block",
        ];
        let steps = ["the longest step of a poll between two looks for a stop"];
        for (whats, most) in [(&polls[..], POLL_INSTRUCTIONS_MAX), (&steps[..], STEP_INSTRUCTIONS_MAX)] {
            let counted = whats.iter().map(|what| counted(what)).max().expect("one at least");
            assert!((most / 2..=most).contains(&counted), "{whats:?}: {counted}");
        }
    }

    #[test]
    fn the_watchdog_spans_ticks_but_not_many() {
        let tick_ns = 1_000_000_000 / TICK_HZ;
        // It must live through a tick that overruns; it must reset before the machine has gone far.
        assert!(WATCHDOG_MIN_NS >= 5 * tick_ns, "{WATCHDOG_MIN_NS}");
        const { assert!(WATCHDOG_MAX_NS <= 10_000_000) };
        let path_mm = machine().header().rules.feed_mm_s * f64::from(WATCHDOG_MAX_NS) * 1e-9;
        assert!(path_mm < 3.0, "{path_mm}");
        // As the HAL computes them from the timeout.
        assert_eq!(WATCHDOG_COUNTS * WATCHDOG_PRESCALER / 32, WATCHDOG_MS);
    }
}
