//! The traits that a board implements: a velocity output, an encoder, digital inputs and a drive enable, for
//! all axes at once; and [`Outputs`] for spindle and coolant, where it has them.
//!
//! All axes at once, because they have to be sampled and latched in the same instant: a circle is only round
//! if both its axes are read at the same time. The tick's interrupt calls these traits, so each call must
//! have a bounded duration.

mod ad5754;
mod extend;
mod index;
mod inputs;
mod outputs;

pub use ad5754::{Ad5754Error, Ad5754Frame, Ad5754Output};
pub use extend::{CountExtender, TimerWidth};
pub use index::IndexLatch;
pub use inputs::{AxisInputs, Inputs, MachineInputs};
pub use outputs::{BoardOutputs, OutputState, Outputs, Spindle};

use crate::units::{Counts, DacCode};

/// The ±10 V velocity commands of all axes.
pub trait VelocityChannel<const AXES: usize> {
    /// What can go wrong when the converter is written.
    type Error;

    /// Puts out all codes together (one latch for all axes).
    ///
    /// # Errors
    /// The converter could not be written; the outputs hold their last value.
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error>;
}

/// The position feedback of all axes.
pub trait Encoder<const AXES: usize> {
    /// What can go wrong when the counters are read.
    type Error;

    /// Counts of all axes, latched together. 16- and 32-bit timers extend their counts with
    /// [`CountExtender`].
    ///
    /// # Errors
    /// The counters could not be read.
    fn latch(&mut self) -> Result<[Counts; AXES], Self::Error>;
}

/// The enable inputs of all drives.
pub trait DriveEnable<const AXES: usize> {
    /// What can go wrong when the outputs are switched.
    type Error;

    /// Enables or disables every drive.
    ///
    /// # Errors
    /// The outputs could not be switched.
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Self::Error>;
}
