//! AD5754-class quad 16-bit ±10 V converter on an SPI bus, as velocity output.
//!
//! Consumes [`DacCode`]s, once per tick; produces 24-bit frames through the `ad57xx` driver. A tick costs
//! `AXES + 1` frames, each its own chip-select cycle: with three axes 96 bits, 3.2 µs at 30 MHz plus the
//! chip-select gaps. [`Ad5754Output::setup`] runs in the background, before the first tick.
//!
//! # Wiring this relies on
//!
//! | pin | level | why |
//! |---|---|---|
//! | BIN/2sCOMP | low | bipolar codes are two's complement, so code 0 is 0 V |
//! | LDAC | high | codes wait in the input registers until the load command |
//! | CLR | high, or the emergency chain | a low level puts all outputs to 0 V without the processor |
//!
//! With LDAC tied low every frame would reach its output when its chip select rises and the axes
//! would step one after the other. A board that pulses LDAC low by a timer gets the outputs on the
//! timer's edge, free of bus jitter; the load command then finds nothing left to do.
//!
//! Channels are used from A upwards: axis 0 is channel A.
//!
//! # Failure
//!
//! The chip acknowledges nothing, so only the bus itself can report an error. Readback is not used.

use ad57xx::ad57x4::{ChannelQuad, PowerConfigQuad};
use ad57xx::marker::Ad57x4;
use ad57xx::{Ad57xx, Ad57xxShared, Config, OutputRange};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

use super::VelocityChannel;
use crate::units::DacCode;

/// Channels in the order of the axes.
const CHANNELS: [ChannelQuad; 4] =
    [ChannelQuad::DacA, ChannelQuad::DacB, ChannelQuad::DacC, ChannelQuad::DacD];

/// Time from power-up of a channel until its output register may be loaded \[µs\] (AD5754 data sheet,
/// power control register).
const POWER_UP_TIME_US: u32 = 10;

/// The frame that could not be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Ad5754Frame {
    /// The configuration in the control register.
    Configuration,
    /// The command that puts every output to 0 V.
    Clear,
    /// The code 0 for all channels.
    ZeroCodes,
    /// The ±10 V range of an axis.
    Range {
        /// The axis, from 0.
        axis: usize,
    },
    /// The power control register.
    PowerUp,
    /// The code of an axis.
    Code {
        /// The axis, from 0.
        axis: usize,
    },
    /// The command that moves all codes to the outputs.
    Load,
}

/// The converter could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Ad5754Error<E> {
    /// The bus failed in `frame`.
    ///
    /// Before [`Ad5754Frame::Load`] the outputs hold their last value. In the load frame itself it is
    /// unknown whether they changed, but then all of them did or none.
    Bus {
        /// The frame on the bus.
        frame: Ad5754Frame,
        /// What the bus reported.
        cause: E,
    },
    /// The driver crate refused `frame` without using the bus. No frame of this adapter is known to
    /// cause it; it exists because the driver's error type has these cases.
    Refused {
        /// The frame that was not sent.
        frame: Ad5754Frame,
    },
}

impl<E: core::fmt::Debug> core::fmt::Display for Ad5754Error<E> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Bus { frame, cause } => {
                write!(formatter, "converter: the bus failed in {frame:?}: {cause:?}")
            }
            Self::Refused { frame } => write!(formatter, "converter: the driver refused {frame:?}"),
        }
    }
}

impl<E: core::fmt::Debug> core::error::Error for Ad5754Error<E> {}

/// Attaches the frame's name to the driver's error.
fn in_frame<E>(frame: Ad5754Frame) -> impl FnOnce(ad57xx::Error<E>) -> Ad5754Error<E> {
    move |error| match error {
        ad57xx::Error::Spi(cause) => Ad5754Error::Bus { frame, cause },
        ad57xx::Error::InvalidArgument | ad57xx::Error::ReadError => Ad5754Error::Refused { frame },
    }
}

/// The outputs of 1 to 4 axes on one AD5754. More than four axes do not compile.
pub struct Ad5754Output<SPI, const AXES: usize> {
    chip: Ad57xxShared<SPI, Ad57x4>,
}

impl<SPI: SpiDevice, const AXES: usize> Ad5754Output<SPI, AXES> {
    /// Checked when the type is used; a wrong number of axes is a compile error.
    const AXES_FIT: () = assert!(AXES >= 1 && AXES <= CHANNELS.len(), "an AD5754 has four channels");
    /// PU_A … PU_D of the used channels, and none of the alert bits.
    const POWER_UP_MASK: u16 = (1 << AXES) - 1;

    /// Brings the chip to 0 V on all used channels in the ±10 V range, from any state it may be in.
    ///
    /// The processor may have restarted while the chip kept its supply, its codes and its power. So
    /// the clear command comes first: it puts every output register to 0 V, of channels that are on and
    /// of channels that are about to be. There is no load before the power-up, because the chip ignores
    /// codes for channels that are off: a load would then bring back what an earlier run left in their
    /// input registers, and the axis would jump when its channel comes on. So the codes are zeroed twice,
    /// for the channels that were on and for those that are on now, and loaded only then. Unused channels
    /// are switched off.
    ///
    /// Takes `AXES + 6` frames and 10 µs. A timer that pulses LDAC must not run yet. On
    /// overcurrent the chip clamps to 20 mA (it does not switch the channel off); thermal shutdown is off.
    ///
    /// # Errors
    /// [`Ad5754Error`] with the frame that failed; the chip is then partly configured and `setup` must
    /// be run again. Lend the bus (`&mut spi`) to keep it in that case.
    pub fn setup<D: DelayNs>(spi: SPI, delay: &mut D) -> Result<Self, Ad5754Error<SPI::Error>> {
        let () = Self::AXES_FIT;
        let mut chip = Ad57xxShared::new_ad57x4(spi);
        // Clear code 0 V; With CLR_SELECT it would be the negative end of the range.
        let configuration =
            Config::new().with_sdo_disable(false).with_clr_select(false).with_clamp_enable(true);
        chip.set_config(configuration).map_err(in_frame(Ad5754Frame::Configuration))?;
        chip.clear_dacs().map_err(in_frame(Ad5754Frame::Clear))?;
        chip.set_dac_output(ChannelQuad::AllDacs, DacCode::ZERO.0.cast_unsigned())
            .map_err(in_frame(Ad5754Frame::ZeroCodes))?;
        for (axis, channel) in CHANNELS.into_iter().enumerate().take(AXES) {
            chip.set_output_range(channel, OutputRange::Bipolar10V)
                .map_err(in_frame(Ad5754Frame::Range { axis }))?;
        }
        chip.set_power_config(PowerConfigQuad::from(Self::POWER_UP_MASK))
            .map_err(in_frame(Ad5754Frame::PowerUp))?;
        delay.delay_us(POWER_UP_TIME_US);
        chip.set_dac_output(ChannelQuad::AllDacs, DacCode::ZERO.0.cast_unsigned())
            .map_err(in_frame(Ad5754Frame::ZeroCodes))?;
        chip.load_dacs().map_err(in_frame(Ad5754Frame::Load))?;
        Ok(Self { chip })
    }

    /// Gives the bus back; the outputs keep their last value.
    pub fn release(self) -> SPI {
        self.chip.destroy()
    }
}

impl<SPI: SpiDevice, const AXES: usize> VelocityChannel<AXES> for Ad5754Output<SPI, AXES> {
    type Error = Ad5754Error<SPI::Error>;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        for (axis, (channel, code)) in CHANNELS.into_iter().zip(codes).enumerate() {
            self.chip
                .set_dac_output(channel, code.0.cast_unsigned())
                .map_err(in_frame(Ad5754Frame::Code { axis }))?;
        }
        self.chip.load_dacs().map_err(in_frame(Ad5754Frame::Load))
    }
}
