//! The 24-bit frames of the AD5754.
//!
//! Consumes the bytes between two edges of the chip select; produces a [`Frame`], or an error that says what
//! is wrong. Layout (AD5754 data sheet, input shift register): read bit, a zero, three register bits, three
//! address bits, sixteen data bits.

use crate::dac_chip::ChipError;

/// Output ranges with a 2.5 V reference (AD5754 data sheet, range select register).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputRange {
    /// 0 … 5 V, the range after power-on.
    Unipolar5V,
    /// 0 … 10 V.
    Unipolar10V,
    /// 0 … 10.8 V.
    Unipolar10V8,
    /// ±5 V.
    Bipolar5V,
    /// ±10 V.
    Bipolar10V,
    /// ±10.8 V.
    Bipolar10V8,
}

impl OutputRange {
    /// The voltage of a register's content \[V\]: straight binary in the unipolar ranges, two's
    /// complement in the bipolar ones (BIN/2sCOMP low).
    #[must_use]
    pub fn volts(self, register: u16) -> f64 {
        let unipolar = f64::from(register) / 65536.0;
        let bipolar = f64::from(register.cast_signed()) / 32768.0;
        match self {
            Self::Unipolar5V => 5.0 * unipolar,
            Self::Unipolar10V => 10.0 * unipolar,
            Self::Unipolar10V8 => 10.8 * unipolar,
            Self::Bipolar5V => 5.0 * bipolar,
            Self::Bipolar10V => 10.0 * bipolar,
            Self::Bipolar10V8 => 10.8 * bipolar,
        }
    }

    /// What a clear command writes: 0 V, or with CLR_SELECT mid-scale or the negative end.
    pub(crate) fn clear_code(self, clear_select: bool) -> u16 {
        if clear_select { 0x8000 } else { 0 }
    }
}

/// The channels that a frame addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    One(usize),
    All,
}

impl Target {
    pub(crate) fn contains(self, channel: usize) -> bool {
        match self {
            Self::One(one) => one == channel,
            Self::All => true,
        }
    }

    fn decode(address: u8) -> Option<Self> {
        match address {
            0..=3 => Some(Self::One(usize::from(address))),
            4 => Some(Self::All),
            _ => None,
        }
    }
}

/// The command in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frame {
    Code { target: Target, code: u16 },
    Range { target: Target, range: OutputRange },
    Power { on: [bool; 4] },
    Nothing,
    Configuration { clear_select: bool },
    Clear,
    Load,
}

impl Frame {
    /// Reads one frame, the most significant byte first.
    pub(crate) fn decode(frame: [u8; 3]) -> Result<Self, ChipError> {
        let [command, high, low] = frame;
        let data = u16::from_be_bytes([high, low]);
        let (register, address) = ((command >> 3) & 0b111, command & 0b111);
        if command & 0x80 != 0 {
            return Err(ChipError::Readback { frame });
        }
        if command & 0x40 != 0 {
            return Err(ChipError::ReservedBit { frame });
        }
        match (register, Target::decode(address)) {
            (0b000, Some(target)) => Ok(Self::Code { target, code: data }),
            (0b001, Some(target)) => {
                let range = match data & 0b111 {
                    0b000 => OutputRange::Unipolar5V,
                    0b001 => OutputRange::Unipolar10V,
                    0b010 => OutputRange::Unipolar10V8,
                    0b011 => OutputRange::Bipolar5V,
                    0b100 => OutputRange::Bipolar10V,
                    0b101 => OutputRange::Bipolar10V8,
                    _ => return Err(ChipError::UnknownRange { frame }),
                };
                Ok(Self::Range { target, range })
            }
            (0b010, _) if address == 0 => {
                Ok(Self::Power { on: [data & 1 != 0, data & 2 != 0, data & 4 != 0, data & 8 != 0] })
            }
            (0b011, _) => match address {
                0b000 => Ok(Self::Nothing),
                0b001 => Ok(Self::Configuration { clear_select: data & 0b10 != 0 }),
                0b100 => Ok(Self::Clear),
                0b101 => Ok(Self::Load),
                _ => Err(ChipError::UnknownAddress { frame }),
            },
            (0b000..=0b010, _) => Err(ChipError::UnknownAddress { frame }),
            _ => Err(ChipError::UnknownRegister { frame }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_and_addresses_are_where_the_data_sheet_puts_them() {
        let all = Target::All;
        assert_eq!(
            Frame::decode([0x02, 0x80, 0x01]),
            Ok(Frame::Code { target: Target::One(2), code: 0x8001 })
        );
        assert_eq!(Frame::decode([0x04, 0x12, 0x34]), Ok(Frame::Code { target: all, code: 0x1234 }));
        let range = OutputRange::Bipolar10V;
        assert_eq!(Frame::decode([0x0C, 0x00, 0x04]), Ok(Frame::Range { target: all, range }));
        assert_eq!(Frame::decode([0x10, 0x00, 0x05]), Ok(Frame::Power { on: [true, false, true, false] }));
        assert_eq!(Frame::decode([0x18, 0x00, 0x00]), Ok(Frame::Nothing));
        assert_eq!(Frame::decode([0x19, 0x00, 0x06]), Ok(Frame::Configuration { clear_select: true }));
        assert_eq!(Frame::decode([0x1C, 0x00, 0x00]), Ok(Frame::Clear));
        assert_eq!(Frame::decode([0x1D, 0x00, 0x00]), Ok(Frame::Load));
    }

    #[test]
    fn undefined_frames_are_refused() {
        for (frame, refusal) in [
            ([0x80, 0, 0], ChipError::Readback { frame: [0x80, 0, 0] }),
            ([0x40, 0, 0], ChipError::ReservedBit { frame: [0x40, 0, 0] }),
            ([0x05, 0, 0], ChipError::UnknownAddress { frame: [0x05, 0, 0] }),
            ([0x0F, 0, 0], ChipError::UnknownAddress { frame: [0x0F, 0, 0] }),
            ([0x11, 0, 0], ChipError::UnknownAddress { frame: [0x11, 0, 0] }),
            ([0x1A, 0, 0], ChipError::UnknownAddress { frame: [0x1A, 0, 0] }),
            ([0x20, 0, 0], ChipError::UnknownRegister { frame: [0x20, 0, 0] }),
            ([0x08, 0, 6], ChipError::UnknownRange { frame: [0x08, 0, 6] }),
        ] {
            assert_eq!(Frame::decode(frame), Err(refusal));
        }
    }
}
