//! A screw between motor and load, with an encoder on the motor.
//!
//! Consumes the motor's position, once per tick; produces the load's. The pitch error is a sine over the motor's position,
//! as of a screw that runs out of true. The play is of the first contact: the load stands still until the motor has gone
//! through it, and never runs ahead. Without errors the load's position is the motor's, to the bit.

use crate::parameter::{ParameterError, finite, not_negative, positive};

/// A screw's errors. The default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScrewParameters {
    /// The error that repeats with every turn, if there is one.
    pub pitch_error: Option<PitchErrorParameters>,
    /// Play between motor and load \[mm\], ≥ 0.
    pub backlash_mm: f64,
}

/// An error of load − motor that repeats with every turn of the screw: amplitude·sin(2π·motor/pitch + phase).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitchErrorParameters {
    /// Travel of a turn \[mm\], > 0.
    pub pitch_mm: f64,
    /// Greatest error in either direction \[mm\], ≥ 0.
    pub amplitude_mm: f64,
    /// Phase at the motor's position 0 \[rad\].
    pub phase_rad: f64,
}

impl PitchErrorParameters {
    /// Where the load is, over where the motor is \[mm\].
    #[must_use]
    pub fn error_mm(&self, motor_mm: f64) -> f64 {
        let turn_rad = 2.0 * core::f64::consts::PI * motor_mm / self.pitch_mm;
        self.amplitude_mm * libm::sin(turn_rad + self.phase_rad)
    }
}

impl ScrewParameters {
    /// Checks every value against its documented range.
    ///
    /// # Errors
    /// The first value that is not finite or out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        not_negative("backlash_mm", self.backlash_mm)?;
        let Some(error) = &self.pitch_error else { return Ok(()) };
        positive("pitch_mm", error.pitch_mm)?;
        not_negative("pitch_error_mm", error.amplitude_mm)?;
        finite("pitch_phase_rad", error.phase_rad)
    }
}

/// A screw that turns.
#[derive(Clone, Debug)]
pub(crate) struct Screw {
    parameters: ScrewParameters,
    /// The error where the screw began: there motor and load are said to be at the same position.
    error_at_start_mm: f64,
    load_mm: f64,
}

impl Screw {
    /// A screw with motor and load at `position_mm`, the play taken up as after a motion in positive direction.
    pub(crate) fn new(parameters: ScrewParameters, position_mm: f64) -> Result<Self, ParameterError> {
        parameters.check()?;
        let error_at_start_mm = parameters.pitch_error.map_or(0.0, |error| error.error_mm(position_mm));
        Ok(Self { parameters, error_at_start_mm, load_mm: position_mm })
    }

    /// The motor has come to `motor_mm`.
    pub(crate) fn turn(&mut self, motor_mm: f64) {
        let pushes_mm = match &self.parameters.pitch_error {
            Some(error) => motor_mm + (error.error_mm(motor_mm) - self.error_at_start_mm),
            None => motor_mm,
        };
        let holds_mm = pushes_mm + self.parameters.backlash_mm;
        if self.load_mm < pushes_mm {
            self.load_mm = pushes_mm;
        } else if self.load_mm > holds_mm {
            self.load_mm = holds_mm;
        }
    }

    /// Where the load is \[mm\].
    pub(crate) fn load_mm(&self) -> f64 {
        self.load_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_errors_the_load_is_where_the_motor_is() {
        let mut screw = Screw::new(ScrewParameters::default(), 0.3).unwrap();
        for motor_mm in [0.3, 0.1, -7.123_456_789, 1e-300, 0.1 + 0.2, -0.0] {
            screw.turn(motor_mm);
            assert_eq!(screw.load_mm(), motor_mm);
        }
    }

    #[test]
    fn the_load_stays_until_the_play_is_taken_up() {
        let mut screw = Screw::new(ScrewParameters { backlash_mm: 0.5, ..Default::default() }, 1.0).unwrap();
        for (motor_mm, load_mm) in
            [(2.0, 2.0), (1.75, 2.0), (1.5, 2.0), (1.0, 1.5), (1.25, 1.5), (1.5, 1.5), (1.75, 1.75)]
        {
            screw.turn(motor_mm);
            assert_eq!(screw.load_mm(), load_mm, "{motor_mm}");
        }
    }

    #[test]
    fn the_error_comes_again_with_every_turn() {
        let error = PitchErrorParameters { pitch_mm: 5.0, amplitude_mm: 0.01, phase_rad: 0.3 };
        let parameters = ScrewParameters { pitch_error: Some(error), backlash_mm: 0.0 };
        let mut screw = Screw::new(parameters, 2.0).unwrap();
        assert_eq!(screw.load_mm(), 2.0);
        screw.turn(42.0);
        assert!((screw.load_mm() - 42.0).abs() < 1e-12);
        screw.turn(44.5);
        // Half a turn: the error is that of the start, the other way round, and at the start it was none.
        let expected_mm = 44.5 - 2.0 * error.error_mm(2.0);
        assert!((screw.load_mm() - expected_mm).abs() < 1e-12);
    }

    #[test]
    fn a_refusal_names_the_quantity() {
        let of = |pitch_mm, amplitude_mm, backlash_mm| {
            let pitch_error = Some(PitchErrorParameters { pitch_mm, amplitude_mm, phase_rad: 0.0 });
            ScrewParameters { pitch_error, backlash_mm }.check()
        };
        assert_eq!(of(5.0, 0.01, 0.02), Ok(()));
        let refused = |quantity, value| Err(ParameterError::OutOfRange { quantity, value });
        assert_eq!(of(0.0, 0.01, 0.02), refused("pitch_mm", 0.0));
        assert_eq!(of(5.0, -0.01, 0.02), refused("pitch_error_mm", -0.01));
        assert_eq!(of(5.0, 0.01, -0.02), refused("backlash_mm", -0.02));
    }
}
