//! The converters of the simulated machine: each four axes have one, as on a board. Channels without an axis are off.

use hal_sim::{Ad5754Chip, CHANNELS, ChipError};
use motion_kernel::hal::{Ad5754Error, Ad5754Output, VelocityChannel};
use motion_kernel::units::DacCode;

/// The adapter that talks to a chip, with as many channels as the chip has axes.
trait Converter {
    fn write(&mut self, codes: &[DacCode]) -> Result<(), Ad5754Error<ChipError>>;
}

impl<const AXES: usize> Converter for Ad5754Output<&Ad5754Chip, AXES> {
    fn write(&mut self, codes: &[DacCode]) -> Result<(), Ad5754Error<ChipError>> {
        let code = |channel: usize| codes.get(channel).copied().unwrap_or(DacCode::ZERO);
        VelocityChannel::write(self, &core::array::from_fn(code))
    }
}

/// The adapters of all chips.
pub(super) struct Converters<'a>(Vec<Box<dyn Converter + 'a>>);

impl<'a> Converters<'a> {
    /// Sets up the chips of `axes` axes.
    pub(super) fn setup(chips: &'a [Ad5754Chip], axes: usize) -> Result<Self, Ad5754Error<ChipError>> {
        let converter = |(index, chip): (usize, &'a Ad5754Chip)| {
            Ok(match axes.saturating_sub(index * CHANNELS) {
                0 | 1 => on_channels::<1>(chip)?,
                2 => on_channels::<2>(chip)?,
                3 => on_channels::<3>(chip)?,
                _ => on_channels::<CHANNELS>(chip)?,
            })
        };
        chips.iter().enumerate().map(converter).collect::<Result<_, _>>().map(Self)
    }
}

fn on_channels<const AXES: usize>(
    chip: &Ad5754Chip,
) -> Result<Box<dyn Converter + '_>, Ad5754Error<ChipError>> {
    let output: Ad5754Output<_, AXES> = Ad5754Output::setup(chip, &mut &*chip)?;
    Ok(Box::new(output))
}

impl<const N: usize> VelocityChannel<N> for Converters<'_> {
    type Error = Ad5754Error<ChipError>;

    fn write(&mut self, codes: &[DacCode; N]) -> Result<(), Self::Error> {
        self.0.iter_mut().zip(codes.chunks(CHANNELS)).try_for_each(|(chip, codes)| chip.write(codes))
    }
}
