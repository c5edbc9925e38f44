//! Which signal is on which pin: the wiring of the board.
//!
//! Produces a table; `README.md` shows the same rows, and `board.rs` takes the same pins, whose alternate
//! functions are checked by the HAL's types (a wrong one does not compile). Connector pins are UM1724's
//! tables of the ST morpho (CN7, CN10) and Arduino (CN5, CN8, CN9) connectors, alternate functions DS10693's
//! table.

/// One row of the wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// The signal.
    pub signal: &'static str,
    /// The processor's pin.
    pub pin: &'static str,
    /// Pin of a morpho connector.
    pub morpho: &'static str,
    /// Name and pin on an Arduino connector, if it has one.
    pub arduino: &'static str,
    /// Peripheral and alternate function, or how the pin is used.
    pub function: &'static str,
    /// What it connects to.
    pub connects: &'static str,
}

const fn pin(
    signal: &'static str,
    pin: &'static str,
    morpho: &'static str,
    arduino: &'static str,
    function: &'static str,
    connects: &'static str,
) -> Pin {
    Pin { signal, pin, morpho, arduino, function, connects }
}

/// The wiring, connector by connector.
pub const PINS: [Pin; 33] = [
    pin("drive ready X", "PC10", "CN7-1", "–", "input, pull-up", "optocoupler to GND: low is healthy"),
    pin("drive ready Y", "PC11", "CN7-2", "–", "input, pull-up", "optocoupler to GND: low is healthy"),
    pin("drive ready Z", "PC12", "CN7-3", "–", "input, pull-up", "optocoupler to GND: low is healthy"),
    pin("emergency stop", "PD2", "CN7-4", "–", "input, pull-up", "optocoupler to GND: low is run"),
    pin("start button", "PC13", "CN7-23", "–", "input", "B1 on the board (blue)"),
    pin("encoder X, A", "PA0", "CN7-28", "A0, CN8-1", "TIM5_CH1 AF2, 32 bit", "RS-422 receiver"),
    pin("encoder X, B", "PA1", "CN7-30", "A1, CN8-2", "TIM5_CH2 AF2, 32 bit", "RS-422 receiver"),
    pin("limit low Z", "PA4", "CN7-32", "A2, CN8-3", "input, pull-up", "contact to GND: low is not reached"),
    pin("limit high Z", "PB0", "CN7-34", "A3, CN8-4", "input, pull-up", "contact to GND: low is not reached"),
    pin("home X", "PC2", "CN7-35", "–", "input, pull-up", "contact to GND: low is not reached"),
    pin("limit high X", "PC1", "CN7-36", "A4, CN8-5", "input, pull-up", "contact to GND: low is not reached"),
    pin("limit low Y", "PC3", "CN7-37", "–", "input, pull-up", "contact to GND: low is not reached"),
    pin("limit low X", "PC0", "CN7-38", "A5, CN8-6", "input, pull-up", "contact to GND: low is not reached"),
    pin("index Z", "PC9", "CN10-1", "–", "TIM3_CH4 AF2", "RS-422 receiver"),
    pin("drive enable X", "PC8", "CN10-2", "–", "output, high is on", "10 kΩ to GND, optocoupler"),
    pin("encoder Y, A", "PB8", "CN10-3", "D15, CN5-10", "TIM2_CH1 AF1, 32 bit", "RS-422 receiver"),
    pin("drive enable Y", "PC6", "CN10-4", "–", "output, high is on", "10 kΩ to GND, optocoupler"),
    pin("encoder Y, B", "PB9", "CN10-5", "D14, CN5-9", "TIM2_CH2 AF1, 32 bit", "RS-422 receiver"),
    pin("drive enable Z", "PC5", "CN10-6", "–", "output, high is on", "10 kΩ to GND, optocoupler"),
    pin("encoder Z, A", "PA6", "CN10-13", "D12, CN5-5", "TIM3_CH1 AF2, 16 bit", "RS-422 receiver"),
    pin("encoder Z, B", "PA7", "CN10-15", "D11, CN5-4", "TIM3_CH2 AF2, 16 bit", "RS-422 receiver"),
    pin("converter SYNC", "PB12", "CN10-16", "–", "output, low is selected", "AD5754 SYNC, 10 kΩ to 3.3 V"),
    pin("home Y", "PC7", "CN10-19", "D9, CN5-2", "input, pull-up", "contact to GND: low is not reached"),
    pin("home Z", "PA9", "CN10-21", "D8, CN5-1", "input, pull-up", "contact to GND: low is not reached"),
    pin("spindle on", "PB1", "CN10-24", "–", "output, high is on", "10 kΩ to GND, optocoupler"),
    pin("index Y", "PB10", "CN10-25", "D6, CN9-7", "TIM2_CH3 AF1", "RS-422 receiver"),
    pin("converter SDIN", "PB15", "CN10-26", "–", "SPI2_MOSI AF5", "AD5754 SDIN"),
    pin("coolant on", "PB14", "CN10-28", "–", "output, high is on", "10 kΩ to GND, optocoupler"),
    pin("converter SCLK", "PB13", "CN10-30", "–", "SPI2_SCK AF5", "AD5754 SCLK"),
    pin("scope", "PA10", "CN10-33", "D2, CN9-3", "output, high in the tick", "oscilloscope"),
    pin("limit high Y", "PC4", "CN10-34", "–", "input, pull-up", "contact to GND: low is not reached"),
    pin(
        "link",
        "PA2",
        "CN10-35",
        "D1, CN9-2",
        "USART2_TX AF7",
        "ST-LINK's serial port; only with the feature link",
    ),
    pin(
        "console",
        "PA3",
        "CN10-37",
        "D0, CN9-1",
        "USART2_RX AF7, pull-up",
        "ST-LINK's serial port, by bridges SB13 and SB14",
    ),
];

/// Of port `port` (`b'A'` …), the outputs that switch something on when high: drives, spindle, coolant. A bit each.
#[must_use]
pub const fn switching_outputs(port: u8) -> u32 {
    bits(port, "output, high is on")
}

/// SYNC on port B. A bit.
pub const SYNC_MASK: u32 = bits(b'B', "output, low is selected");

/// Of port `port`, the pins that are used as `function`. A bit each.
const fn bits(port: u8, function: &str) -> u32 {
    let (mut mask, mut rows): (u32, &[Pin]) = (0, &PINS);
    while let [row, rest @ ..] = rows {
        rows = rest;
        if let [b'P', at, number @ ..] = row.pin.as_bytes()
            && *at == port
            && is_same(row.function.as_bytes(), function.as_bytes())
        {
            mask |= 1 << decimal(number);
        }
    }
    mask
}

const fn is_same(mut left: &[u8], mut right: &[u8]) -> bool {
    while let ([first, left_rest @ ..], [second, right_rest @ ..]) = (left, right) {
        if *first != *second {
            return false;
        }
        (left, right) = (left_rest, right_rest);
    }
    left.is_empty() && right.is_empty()
}

const fn decimal(mut digits: &[u8]) -> u32 {
    let mut number = 0;
    while let [digit, rest @ ..] = digits {
        number = 10 * number + (*digit - b'0') as u32;
        digits = rest;
    }
    number
}

/// Pins of the board that are already in use: the green LED, SWD and its trace output, clocks.
pub const RESERVED: [&str; 8] = ["PA5", "PA13", "PA14", "PB3", "PC14", "PC15", "PH0", "PH1"];

#[cfg(test)]
mod tests {
    use super::*;

    /// UM1724, "ST morpho connectors on NUCLEO-F446RE": the processor's pins.
    const MORPHO: [(&str, u8, &str); 53] = [
        ("CN7", 1, "PC10"),
        ("CN7", 2, "PC11"),
        ("CN7", 3, "PC12"),
        ("CN7", 4, "PD2"),
        ("CN7", 13, "PA13"),
        ("CN7", 15, "PA14"),
        ("CN7", 17, "PA15"),
        ("CN7", 21, "PB7"),
        ("CN7", 23, "PC13"),
        ("CN7", 25, "PC14"),
        ("CN7", 27, "PC15"),
        ("CN7", 28, "PA0"),
        ("CN7", 29, "PH0"),
        ("CN7", 30, "PA1"),
        ("CN7", 31, "PH1"),
        ("CN7", 32, "PA4"),
        ("CN7", 34, "PB0"),
        ("CN7", 35, "PC2"),
        ("CN7", 36, "PC1"),
        ("CN7", 37, "PC3"),
        ("CN7", 38, "PC0"),
        ("CN10", 1, "PC9"),
        ("CN10", 2, "PC8"),
        ("CN10", 3, "PB8"),
        ("CN10", 4, "PC6"),
        ("CN10", 5, "PB9"),
        ("CN10", 6, "PC5"),
        ("CN10", 11, "PA5"),
        ("CN10", 12, "PA12"),
        ("CN10", 13, "PA6"),
        ("CN10", 14, "PA11"),
        ("CN10", 15, "PA7"),
        ("CN10", 16, "PB12"),
        ("CN10", 17, "PB6"),
        ("CN10", 19, "PC7"),
        ("CN10", 21, "PA9"),
        ("CN10", 22, "PB2"),
        ("CN10", 23, "PA8"),
        ("CN10", 24, "PB1"),
        ("CN10", 25, "PB10"),
        ("CN10", 26, "PB15"),
        ("CN10", 27, "PB4"),
        ("CN10", 28, "PB14"),
        ("CN10", 29, "PB5"),
        ("CN10", 30, "PB13"),
        ("CN10", 31, "PB3"),
        ("CN10", 33, "PA10"),
        ("CN10", 34, "PC4"),
        ("CN10", 35, "PA2"),
        ("CN10", 37, "PA3"),
        // Not processor pins, but they are wired to.
        ("CN7", 8, "GND"),
        ("CN7", 16, "+3V3"),
        ("CN10", 20, "GND"),
    ];

    /// UM1724, the Arduino connectors: name, connector and pin, processor's pin.
    const ARDUINO: [(&str, &str); 22] = [
        ("A0, CN8-1", "PA0"),
        ("A1, CN8-2", "PA1"),
        ("A2, CN8-3", "PA4"),
        ("A3, CN8-4", "PB0"),
        ("A4, CN8-5", "PC1"),
        ("A5, CN8-6", "PC0"),
        ("D0, CN9-1", "PA3"),
        ("D1, CN9-2", "PA2"),
        ("D2, CN9-3", "PA10"),
        ("D3, CN9-4", "PB3"),
        ("D4, CN9-5", "PB5"),
        ("D5, CN9-6", "PB4"),
        ("D6, CN9-7", "PB10"),
        ("D7, CN9-8", "PA8"),
        ("D8, CN5-1", "PA9"),
        ("D9, CN5-2", "PC7"),
        ("D10, CN5-3", "PB6"),
        ("D11, CN5-4", "PA7"),
        ("D12, CN5-5", "PA6"),
        ("D13, CN5-6", "PA5"),
        ("D14, CN5-9", "PB9"),
        ("D15, CN5-10", "PB8"),
    ];

    /// DS10693, "Alternate function": the rows of the pins that use one here.
    const FUNCTIONS: [(&str, &str, u8); 12] = [
        ("PA0", "TIM5_CH1", 2),
        ("PA1", "TIM5_CH2", 2),
        ("PB8", "TIM2_CH1", 1),
        ("PB9", "TIM2_CH2", 1),
        ("PA6", "TIM3_CH1", 2),
        ("PA7", "TIM3_CH2", 2),
        ("PB13", "SPI2_SCK", 5),
        ("PB15", "SPI2_MOSI", 5),
        ("PA2", "USART2_TX", 7),
        ("PA3", "USART2_RX", 7),
        ("PB10", "TIM2_CH3", 1),
        ("PC9", "TIM3_CH4", 2),
    ];

    #[test]
    fn no_pin_or_signal_is_used_twice_and_none_is_taken() {
        for (index, row) in PINS.iter().enumerate() {
            for other in &PINS[index + 1..] {
                assert_ne!(row.pin, other.pin);
                assert_ne!(row.signal, other.signal);
            }
            assert!(!RESERVED.contains(&row.pin), "{}", row.pin);
        }
    }

    /// What a panic drops is every output that switches something on, and nothing else.
    #[test]
    fn the_stop_knows_every_switching_output() {
        assert_eq!(switching_outputs(b'C'), 1 << 8 | 1 << 6 | 1 << 5);
        assert_eq!(switching_outputs(b'B'), 1 << 1 | 1 << 14);
        assert_eq!(switching_outputs(b'A') | switching_outputs(b'D'), 0);
        assert_eq!(SYNC_MASK, 1 << 12);
        let switching = ["enable", " on"];
        for row in &PINS {
            let port = row.pin.as_bytes()[1];
            let number: u32 = row.pin[2..].parse().expect("a number");
            let switches = switching.iter().any(|what| row.signal.contains(what));
            assert_eq!(switching_outputs(port) >> number & 1 == 1, switches, "{}", row.signal);
        }
    }

    #[test]
    fn connectors_are_those_of_the_board() {
        for row in &PINS {
            let morpho = MORPHO.iter().find(|(_, _, pin)| *pin == row.pin).expect(row.pin);
            assert_eq!(row.morpho, format!("{}-{}", morpho.0, morpho.1), "{}", row.pin);
            match ARDUINO.iter().find(|(_, pin)| *pin == row.pin) {
                Some((name, _)) => assert_eq!(row.arduino, *name),
                None => assert_eq!(row.arduino, "–", "{}", row.pin),
            }
        }
        // Connectors have two rows of 19 pins, each once.
        for (index, (connector, number, _)) in MORPHO.iter().enumerate() {
            assert!((1..=38).contains(number));
            assert!(MORPHO[index + 1..].iter().all(|(c, n, _)| (c, n) != (connector, number)));
        }
    }

    #[test]
    fn alternate_functions_are_those_of_the_data_sheet() {
        for row in &PINS {
            let given = row.function.split(", ").next().expect("not empty");
            match FUNCTIONS.iter().find(|(pin, _, _)| *pin == row.pin) {
                Some((_, name, number)) => assert_eq!(given, format!("{name} AF{number}"), "{}", row.pin),
                None => assert!(given == "input" || given == "output", "{}", row.pin),
            }
        }
    }

    #[test]
    fn the_readme_shows_this_table() {
        let readme = include_str!("../README.md");
        let mut last = 0;
        for row in &PINS {
            let Pin { signal, pin, morpho, arduino, function, connects } = row;
            let line = format!("| {morpho} | {arduino} | {pin} | {signal} | {function} | {connects} |\n");
            let at = readme.find(&line).unwrap_or_else(|| panic!("README.md lacks: {line}"));
            assert!(at > last, "in the table's order: {line}");
            last = at;
        }
    }

    #[test]
    fn the_firmware_takes_these_pins() {
        let board = include_str!("board.rs");
        for row in &PINS {
            let port = row.pin[1..2].to_lowercase();
            let name = format!("gpio{port}.{}", row.pin.to_lowercase());
            let uses = board.match_indices(&name).filter(|(at, _)| {
                // pc1 is not pc13.
                !board[at + name.len()..].starts_with(|next: char| next.is_ascii_digit())
            });
            assert_eq!(uses.count(), 1, "{name} in board.rs");
        }
        let taken = board.matches("gpioa.p").count()
            + board.matches("gpiob.p").count()
            + board.matches("gpioc.p").count()
            + board.matches("gpiod.p").count();
        assert_eq!(taken, PINS.len(), "board.rs takes a pin that the table does not have");
    }
}
