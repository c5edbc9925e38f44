//! A motion that can be repeated: anything that makes a recording with run options.

use std::ops::Range;

use crate::drive::circle;
use crate::drive::circle_motion::Circle;
use crate::drive::experiment::{DriveError, Recording};
use crate::machine::Machine;
use crate::simulate::RunOptions;

/// The stretch to be corrected, in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// The stretch's index in the program, from 0.
    pub index: u32,
    /// Its ticks, as indices into the recording. It moves in the first of them.
    pub ticks: Range<usize>,
}

/// A motion that starts from the same rest and takes the same ticks, every time.
///
/// A closure over run options and machine is one, if its program is one stretch.
pub trait Motion {
    /// Drives it.
    ///
    /// # Errors
    /// The motion can't be made, or a fault ended it.
    fn record(&self, options: &RunOptions<'_>, machine: &Machine) -> Result<Recording, DriveError>;

    /// The stretch to be corrected: by default the first one, which must be the only one or be followed by a
    /// tick at rest.
    fn stretch(&self, recording: &Recording) -> Stretch {
        let is_moving = |state: &str| state == "moving";
        let from = recording.ticks.iter().position(|tick| is_moving(tick.state)).unwrap_or(0);
        let length = recording.ticks[from..].iter().take_while(|tick| is_moving(tick.state)).count();
        Stretch { index: 0, ticks: from..from + length }
    }

    /// The distance of the machine from the path \[µm\]; by default the greatest over all ticks.
    ///
    /// # Errors
    /// There is nothing to measure.
    fn contour_um(&self, recording: &Recording) -> Result<f64, DriveError> {
        Ok(recording.ticks.iter().map(|tick| tick.contour_um).fold(0.0, f64::max))
    }
}

/// Measured like the circle test: at constant feed, after settling.
impl Motion for Circle {
    fn record(&self, options: &RunOptions<'_>, machine: &Machine) -> Result<Recording, DriveError> {
        self.record_with(options, machine)
    }

    fn contour_um(&self, recording: &Recording) -> Result<f64, DriveError> {
        Ok(circle::figures(recording, self)?.contour_um())
    }
}

impl<F> Motion for F
where
    F: Fn(&RunOptions<'_>, &Machine) -> Result<Recording, DriveError>,
{
    fn record(&self, options: &RunOptions<'_>, machine: &Machine) -> Result<Recording, DriveError> {
        self(options, machine)
    }
}
