//! The board's part of homing: the encoder's count at its index pulse.

use crate::units::Counts;

/// The index pulses of all axes, latched by the board: a timer's capture input, or an encoder interface that
/// has one. Called by the background.
pub trait IndexLatch {
    /// What can go wrong with the latch.
    type Error;

    /// Clears an axis' latch; it then takes the count at the next index, as
    /// [`Encoder::latch`](super::Encoder::latch) counts.
    ///
    /// # Errors
    /// The latch could not be armed, or there is none.
    fn arm(&mut self, axis: usize) -> Result<(), Self::Error>;

    /// The count that an axis' latch has taken since it was armed.
    ///
    /// # Errors
    /// The latch could not be read.
    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Self::Error>;
}
