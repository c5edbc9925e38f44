//! What homing asks of a board: the encoder's count at its index pulse.

use crate::units::Counts;

/// The index pulses of all axes, latched by the board: a timer's capture input, or an encoder interface that has one. Called
/// by the background.
pub trait IndexLatch {
    /// What can go wrong with the latch.
    type Error;

    /// Drops what an axis' latch holds; it then holds the count at the first index that comes, as
    /// [`Encoder::latch`](super::Encoder::latch) counts.
    ///
    /// # Errors
    /// The latch could not be armed, or there is none.
    fn arm(&mut self, axis: usize) -> Result<(), Self::Error>;

    /// What an axis' latch holds since it was armed.
    ///
    /// # Errors
    /// The latch could not be read.
    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Self::Error>;
}
