//! What differs from board to board, as numbers.

/// A board's figures; all others follow from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardParameters {
    /// Control ticks a second \[Hz\]. A program is compiled for it.
    pub tick_hz: u32,
    /// Clock of the counter that times the background's polls \[Hz\], a multiple of 1 MHz.
    pub cycles_hz: u32,
    /// Counts a second that every encoder input is sure to pass \[1/s\].
    pub counts_per_s_max: u32,
    /// So far ahead of what it saw the background changes a ramp \[ticks\]: what an ordinary poll with a plan takes.
    /// Where that was too late, live control tries again, a tick further ahead each time, and stays there.
    pub lead_ticks: u32,
}

impl BoardParameters {
    /// Control tick \[s\].
    #[must_use]
    pub const fn tick_s(&self) -> f64 {
        1.0 / self.tick_hz as f64
    }

    /// The machine is held still for so long after the drives are enabled \[ticks\]: 0.2 s for their relays and brakes.
    #[must_use]
    pub const fn settle_ticks(&self) -> u32 {
        self.tick_hz / 5
    }

    /// The button must be held for so long to count \[ticks\]: 20 ms, longer than its contacts bounce.
    #[must_use]
    pub const fn button_ticks(&self) -> u32 {
        self.tick_hz / 50
    }

    /// From one report in the log to the next \[ticks\]: 1 s.
    #[must_use]
    pub const fn report_ticks(&self) -> u32 {
        self.tick_hz
    }

    /// From one row of the flight recorder in the log to the next \[ticks\]: 10 ms, for some 250 bytes that the probe has
    /// to read.
    #[must_use]
    pub const fn flight_line_ticks(&self) -> u32 {
        self.tick_hz / 100
    }

    /// The background may be silent for so long before the tick stops feeding the watchdog \[ticks\]: 0.1 s.
    #[must_use]
    pub const fn silent_ticks_max(&self) -> u32 {
        self.tick_hz / 10
    }
}
