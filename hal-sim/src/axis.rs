//! One simulated axis: a voltage in, an encoder count out.
//!
//! Consumes the DAC's voltage and the drive enable, once per tick; produces the encoder's count and, for
//! tests and records, the true position, velocity and torque.

use motion_kernel::units::Counts;

use crate::drive::{DriveModel, DriveState};
use crate::drive_parameters::{DriveParameters, REFERENCE_X, REFERENCE_Y, REFERENCE_Z};
use crate::encoder::{EncoderParameters, REFERENCE_ENCODER, SimEncoder};
use crate::parameter::{ParameterError, finite};
#[cfg(feature = "screw")]
use crate::screw::{Screw, ScrewParameters};

/// Velocity of the reference axes per volt \[mm/s/V\]: 20 m/min at 10 V (S4).
pub const REFERENCE_MM_S_PER_VOLT: f64 = 20_000.0 / 60.0 / 10.0;

/// An axis. Immutable once given to a [`SimAxis`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisParameters {
    /// Drive and mechanics.
    pub drive: DriveParameters,
    /// The errors of the screw between motor and load (feature `screw`).
    #[cfg(feature = "screw")]
    pub screw: ScrewParameters,
    /// Position feedback, of the motor.
    pub encoder: EncoderParameters,
    /// Velocity of the drive per volt \[mm/s/V\], not 0; negative if it is wired the other way round.
    pub mm_s_per_volt: f64,
    /// True position of motor and load at the start \[mm\]; the axis is at rest there.
    pub start_position_mm: f64,
}

impl AxisParameters {
    /// The X axis of S4.
    pub const REFERENCE_X: Self = Self::reference(REFERENCE_X);
    /// The Y axis of S4.
    pub const REFERENCE_Y: Self = Self::reference(REFERENCE_Y);
    /// A Z axis like X.
    pub const REFERENCE_Z: Self = Self::reference(REFERENCE_Z);

    const fn reference(drive: DriveParameters) -> Self {
        Self {
            drive,
            #[cfg(feature = "screw")]
            screw: ScrewParameters { pitch_error: None, backlash_mm: 0.0 },
            encoder: REFERENCE_ENCODER,
            mm_s_per_volt: REFERENCE_MM_S_PER_VOLT,
            start_position_mm: 0.0,
        }
    }
}

/// An axis in motion. `LINE` is that of [`DriveState`].
#[derive(Clone, Debug)]
pub struct SimAxis<const LINE: usize> {
    model: DriveModel,
    state: DriveState<LINE>,
    #[cfg(feature = "screw")]
    screw: Screw,
    encoder: SimEncoder,
    mm_s_per_volt: f64,
}

impl<const LINE: usize> SimAxis<LINE> {
    /// An axis at rest, for ticks of `tick_s` in `substeps` parts.
    ///
    /// # Errors
    /// The first parameter that cannot be simulated.
    pub fn new(parameters: AxisParameters, tick_s: f64, substeps: u32) -> Result<Self, ParameterError> {
        let AxisParameters { drive, encoder, mm_s_per_volt, start_position_mm, .. } = parameters;
        finite("mm_s_per_volt", mm_s_per_volt)?;
        if mm_s_per_volt == 0.0 {
            return Err(ParameterError::OutOfRange { quantity: "mm_s_per_volt", value: mm_s_per_volt });
        }
        finite("start_position_mm", start_position_mm)?;
        let model = DriveModel::new(drive, tick_s, substeps)?;
        Ok(Self {
            model,
            state: DriveState::at_rest(&model, start_position_mm)?,
            #[cfg(feature = "screw")]
            screw: Screw::new(parameters.screw, start_position_mm)?,
            encoder: SimEncoder::new(encoder, start_position_mm)?,
            mm_s_per_volt,
        })
    }

    /// Advances by one tick with `output_v` held at the drive's input. A disabled drive takes the command 0
    /// instead: it brakes and holds, as a drive with a stop ramp and holding torque does; it does not coast.
    pub fn advance(&mut self, output_v: f64, is_enabled: bool) {
        let command_mm_s = if is_enabled { output_v * self.mm_s_per_volt } else { 0.0 };
        self.model.tick(&mut self.state, command_mm_s);
        #[cfg(feature = "screw")]
        self.screw.turn(self.state.position_mm());
    }

    /// See [`SimMachine::reverse_drive`](crate::SimMachine::reverse_drive).
    pub(crate) fn reverse_drive(&mut self) {
        self.mm_s_per_volt = -self.mm_s_per_volt;
    }

    /// See [`SimMachine::limit_drive`](crate::SimMachine::limit_drive).
    pub(crate) fn limit_drive(&mut self, accel_limit_mm_s2: f64) {
        self.model.limit(accel_limit_mm_s2);
    }

    /// Reads the encoder.
    pub fn latch(&mut self) -> Counts {
        self.encoder.latch(self.state.position_mm())
    }

    /// True position of the load \[mm\]: the motor's, without errors of the screw.
    #[must_use]
    pub fn load_mm(&self) -> f64 {
        #[cfg(feature = "screw")]
        return self.screw.load_mm();
        #[cfg(not(feature = "screw"))]
        self.state.position_mm()
    }

    /// The drive's state: the motor's true position, velocity, torque.
    #[must_use]
    pub fn drive(&self) -> &DriveState<LINE> {
        &self.state
    }
}
