//! The tick's end of the streams, with the learnt correction of one of their stretches.
//!
//! [`Kernel::tick_corrected`](super::Kernel::tick_corrected) takes it where
//! [`Kernel::tick`](super::Kernel::tick) takes the bare [`Intake`].

use crate::axis::{Correction, CorrectionError};
use crate::num::Real;
use crate::queue::Intake;

/// An [`Intake`] and the correction of a coming stretch, if there is one.
pub struct CorrectedIntake<'a, R: Real, const AXES: usize> {
    pub(super) intake: Intake<'a, R, AXES>,
    pub(super) correction: Option<Correction<'a, R, AXES>>,
}

impl<'a, R: Real, const AXES: usize> CorrectedIntake<'a, R, AXES> {
    /// Sets the learnt correction of a coming stretch, replacing any earlier one. To clear it, set one
    /// without knots.
    ///
    /// # Errors
    /// The streams are under live control, where motion does not keep the learnt times. Never fails
    /// otherwise.
    #[inline]
    pub fn correct(&mut self, correction: Correction<'a, R, AXES>) -> Result<(), CorrectionError> {
        if self.intake.is_live() {
            return Err(CorrectionError::LiveControl);
        }
        self.correction = Some(correction);
        Ok(())
    }

    /// The bare streams, for a tick that adds no correction.
    #[inline]
    pub fn bare(&mut self) -> &mut Intake<'a, R, AXES> {
        &mut self.intake
    }
}

impl<'a, R: Real, const AXES: usize> From<Intake<'a, R, AXES>> for CorrectedIntake<'a, R, AXES> {
    fn from(intake: Intake<'a, R, AXES>) -> Self {
        Self { intake, correction: None }
    }
}
