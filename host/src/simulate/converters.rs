//! The converters of the simulated machine: each four axes have one, as on a board. A channel without an axis stays at
//! 0 V.

use hal_sim::{Ad5754Chip, CHANNELS, ChipError};
use motion_kernel::hal::{Ad5754Error, Ad5754Output, VelocityChannel};
use motion_kernel::units::DacCode;

/// The adapters that talk to the chips.
pub(super) struct Converters<'a>(Vec<Ad5754Output<&'a Ad5754Chip, CHANNELS>>);

impl<'a> Converters<'a> {
    /// Sets up the chips.
    pub(super) fn setup(chips: &'a [Ad5754Chip]) -> Result<Self, Ad5754Error<ChipError>> {
        chips.iter().map(|chip| Ad5754Output::setup(chip, &mut &*chip)).collect::<Result<_, _>>().map(Self)
    }
}

impl<const N: usize> VelocityChannel<N> for Converters<'_> {
    type Error = Ad5754Error<ChipError>;

    fn write(&mut self, codes: &[DacCode; N]) -> Result<(), Self::Error> {
        for (output, codes) in self.0.iter_mut().zip(codes.chunks(CHANNELS)) {
            let mut of_chip = [DacCode::ZERO; CHANNELS];
            of_chip[..codes.len()].copy_from_slice(codes);
            output.write(&of_chip)?;
        }
        Ok(())
    }
}
