//! An emulated AD5754: four ±10 V channels behind an SPI chip select.
//!
//! Consumes 24-bit frames as the real chip gets them; produces a voltage per channel. The firmware's
//! driver holds `&chip` as its `SpiDevice` while the simulation reads the voltages through the same
//! reference, so the registers are `Cell`s. One frame costs a constant number of operations.
//!
//! Follows the data sheet in everything that a velocity output uses:
//!
//! - Codes wait in input registers until a load command; outputs change only then (LDAC high).
//! - A channel starts switched off. Off, its output is clamped to 0 V and codes written to it are
//!   ignored.
//! - A clear command puts the output registers to their clear code and leaves the input registers alone. It
//!   is an assumption that a clear and a load reach the registers of channels that are off.
//! - A chip select around anything but 24 bits is no frame.
//!
//! Stricter than the chip, so that tests see a mistake: undefined frames, and a load during the 10 µs
//! after a power-up, are errors; the real chip would stay silent. Missing: readback, alert bits, settling
//! time of the outputs, the LDAC and CLR pins.

use core::cell::Cell;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};

use crate::dac_frame::{Frame, OutputRange};

/// Channels of the chip.
pub const CHANNELS: usize = 4;

/// Time from power-up until a channel may be loaded \[ns\] (AD5754 data sheet, power control register).
pub const POWER_UP_TIME_NS: u64 = 10_000;

/// An error of the chip or its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipError {
    /// The chip select enclosed another number of bytes than three.
    FrameLength {
        /// Bytes that were written.
        bytes: usize,
    },
    /// A read was asked for; readback is not emulated.
    Readback {
        /// The frame; zeros if the bus was read without one.
        frame: [u8; 3],
    },
    /// The second bit is set.
    ReservedBit {
        /// The frame.
        frame: [u8; 3],
    },
    /// There is no such register.
    UnknownRegister {
        /// The frame.
        frame: [u8; 3],
    },
    /// The register has no such address.
    UnknownAddress {
        /// The frame.
        frame: [u8; 3],
    },
    /// There is no such output range.
    UnknownRange {
        /// The frame.
        frame: [u8; 3],
    },
    /// A load came while a channel was powering up.
    LoadDuringPowerUp {
        /// Time that the channel would still have needed \[ns\].
        remaining_ns: u64,
    },
    /// The failure that [`Ad5754Chip::fail_bus_after`] asked for.
    InjectedBusFailure,
}

impl Error for ChipError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::FrameLength { .. } => ErrorKind::FrameFormat,
            _ => ErrorKind::Other,
        }
    }
}

impl core::fmt::Display for ChipError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "emulated AD5754: {self:?}")
    }
}

impl core::error::Error for ChipError {}

/// One channel's registers.
#[derive(Clone, Copy, Debug)]
struct Channel {
    input: u16,
    output: u16,
    range: OutputRange,
    is_on: bool,
    ready_at_ns: u64,
}

/// An AD5754 with its power supply and a 2.5 V reference.
#[derive(Debug)]
pub struct Ad5754Chip {
    channels: Cell<[Channel; CHANNELS]>,
    clear_select: Cell<bool>,
    frames_taken: Cell<u64>,
    frames_until_failure: Cell<Option<u64>>,
    now_ns: Cell<u64>,
}

impl Default for Ad5754Chip {
    fn default() -> Self {
        Self::new()
    }
}

impl Ad5754Chip {
    /// The chip after power-on: all channels off, all registers 0.
    #[must_use]
    pub const fn new() -> Self {
        let channel =
            Channel { input: 0, output: 0, range: OutputRange::Unipolar5V, is_on: false, ready_at_ns: 0 };
        Self {
            channels: Cell::new([channel; CHANNELS]),
            clear_select: Cell::new(false),
            frames_taken: Cell::new(0),
            frames_until_failure: Cell::new(None),
            now_ns: Cell::new(0),
        }
    }

    /// The voltages of channels A to D \[V\].
    #[must_use]
    pub fn volts(&self) -> [f64; CHANNELS] {
        self.channels.get().map(
            |channel| {
                if channel.is_on { channel.range.volts(channel.output) } else { 0.0 }
            },
        )
    }

    /// The output registers of channels A to D, loaded codes of two's-complement.
    #[must_use]
    pub fn output_codes(&self) -> [i16; CHANNELS] {
        self.channels.get().map(|channel| channel.output.cast_signed())
    }

    /// Frames that the chip has accepted.
    #[must_use]
    pub fn frames_taken(&self) -> u64 {
        self.frames_taken.get()
    }

    /// Lets time pass on the chip's clock.
    pub fn elapse_ns(&self, time_ns: u64) {
        self.now_ns.set(self.now_ns.get().saturating_add(time_ns));
    }

    /// Lets the bus fail once `frames` more transactions have passed, and from then on until this is
    /// called again. `None` repairs it.
    pub fn fail_bus_after(&self, frames: Option<u64>) {
        self.frames_until_failure.set(frames);
    }

    /// Takes the bytes sent while the chip select was low.
    fn take(&self, bytes: [u8; 3]) -> Result<(), ChipError> {
        let frame = Frame::decode(bytes)?;
        let mut channels = self.channels.get();
        match frame {
            Frame::Nothing => {}
            Frame::Configuration { clear_select } => self.clear_select.set(clear_select),
            Frame::Code { target, code } => {
                for (index, channel) in channels.iter_mut().enumerate() {
                    if target.contains(index) && channel.is_on {
                        channel.input = code;
                    }
                }
            }
            Frame::Range { target, range } => {
                for (index, channel) in channels.iter_mut().enumerate() {
                    if target.contains(index) {
                        channel.range = range;
                    }
                }
            }
            Frame::Power { on } => {
                for (channel, on) in channels.iter_mut().zip(on) {
                    if on && !channel.is_on {
                        channel.ready_at_ns = self.now_ns.get().saturating_add(POWER_UP_TIME_NS);
                    }
                    channel.is_on = on;
                }
            }
            Frame::Clear => {
                for channel in &mut channels {
                    channel.output = channel.range.clear_code(self.clear_select.get());
                }
            }
            Frame::Load => {
                for channel in &mut channels {
                    let remaining_ns = channel.ready_at_ns.saturating_sub(self.now_ns.get());
                    if channel.is_on && remaining_ns > 0 {
                        return Err(ChipError::LoadDuringPowerUp { remaining_ns });
                    }
                    channel.output = channel.input;
                }
            }
        }
        self.channels.set(channels);
        self.frames_taken.set(self.frames_taken.get() + 1);
        Ok(())
    }

    /// Counts a transaction down to an injected failure.
    fn pass_bus(&self) -> Result<(), ChipError> {
        match self.frames_until_failure.get() {
            Some(0) => Err(ChipError::InjectedBusFailure),
            Some(frames) => {
                self.frames_until_failure.set(Some(frames - 1));
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl ErrorType for &Ad5754Chip {
    type Error = ChipError;
}

impl SpiDevice for &Ad5754Chip {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ChipError> {
        self.pass_bus()?;
        let mut frame = [0; 3];
        let mut bytes = 0;
        let mut is_read = false;
        for operation in operations {
            let written: &[u8] = match operation {
                Operation::Write(written) => written,
                Operation::DelayNs(time_ns) => {
                    self.elapse_ns(u64::from(*time_ns));
                    &[]
                }
                Operation::Read(_) | Operation::Transfer(..) | Operation::TransferInPlace(_) => {
                    is_read = true;
                    &[]
                }
            };
            for &byte in written {
                if let Some(place) = frame.get_mut(bytes) {
                    *place = byte;
                }
                bytes += 1;
            }
        }
        if is_read {
            return Err(ChipError::Readback { frame });
        }
        if bytes != frame.len() {
            return Err(ChipError::FrameLength { bytes });
        }
        self.take(frame)
    }
}

/// The chip's own clock as a delay: waiting with it lets time pass on the chip.
impl DelayNs for &Ad5754Chip {
    fn delay_ns(&mut self, time_ns: u32) {
        self.elapse_ns(u64::from(time_ns));
    }
}
