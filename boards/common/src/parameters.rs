//! The figures that differ from board to board.

use motion_kernel::hal::BoardOutputs;
use motion_kernel::live::Leads;

/// A board's figures; all others follow from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardParameters {
    /// Control ticks a second \[Hz\]. A program is compiled for it.
    pub tick_hz: u32,
    /// Clock of the counter that times the background's polls \[Hz\], a multiple of 1 MHz.
    pub cycles_hz: u32,
    /// Count rate that every encoder input passes for certain \[1/s\].
    pub counts_per_s_max: u32,
    /// How far ahead of the progress last seen the background changes a ramp: the duration of an ordinary poll with a
    /// stop or a plan. If that was too late, live control tries again, one tick further ahead each time, and keeps that
    /// lead.
    pub leads: Leads,
    /// What there is for spindle and coolant.
    pub outputs: BoardOutputs,
}

impl BoardParameters {
    /// Control tick \[s\].
    #[must_use]
    pub const fn tick_s(&self) -> f64 {
        1.0 / self.tick_hz as f64
    }

    /// Time that the machine is held still after the drives are enabled \[ticks\]: 0.2 s, for their relays
    /// and brakes.
    #[must_use]
    pub const fn settle_ticks(&self) -> u32 {
        self.tick_hz / 5
    }

    /// Time that the button must be held to count \[ticks\]: 20 ms, longer than its contacts bounce.
    #[must_use]
    pub const fn button_ticks(&self) -> u32 {
        self.tick_hz / 50
    }

    /// Time between reports in the log \[ticks\]: 1 s.
    #[must_use]
    pub const fn report_ticks(&self) -> u32 {
        self.tick_hz
    }

    /// Time between rows of the flight recorder in the log \[ticks\]: 10 ms, for some 250 bytes that the
    /// probe has to read.
    #[must_use]
    pub const fn flight_line_ticks(&self) -> u32 {
        self.tick_hz / 100
    }

    /// Time that the background may be silent before the tick stops feeding the watchdog \[ticks\]: 0.1 s.
    #[must_use]
    pub const fn silent_ticks_max(&self) -> u32 {
        self.tick_hz / 10
    }
}
