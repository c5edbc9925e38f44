//! Whether an axis' figures can be used.
//!
//! Background. An axis has some thirty figures, each with a range. Whatever is made of them is made to its end and the
//! first figure that was refused is kept: a way out at each of them would take more flash than all that is computed.

use super::ScaleError;
use crate::num::{Real, is_within};

/// Checks so far.
#[derive(Debug, Default)]
pub(super) struct Check {
    /// The first figure that was out of its range.
    pub(super) refused: Option<ScaleError>,
}

impl Check {
    /// What `make` makes of figures, if it refuses none.
    pub(super) fn all<T>(make: impl FnOnce(&mut Self) -> T) -> Result<T, ScaleError> {
        let mut check = Self::default();
        let made = make(&mut check);
        check.refused.map_or(Ok(made), Err)
    }

    /// Refuses `value` unless `holds`.
    #[inline(never)]
    pub(super) fn that(&mut self, holds: bool, quantity: &'static str, value: f64, expected: &'static str) {
        if !holds && self.refused.is_none() {
            self.refused = Some(ScaleError { quantity, value, expected });
        }
    }

    /// Refuses a value that is not a number from `least` to `most`.
    #[inline(never)]
    pub(super) fn within(
        &mut self,
        [least, most]: [f64; 2],
        quantity: &'static str,
        value: f64,
        expected: &'static str,
    ) {
        self.that(is_within(value, least, most), quantity, value, expected);
    }
}

/// Whether the number type holds `value`.
pub(super) fn fits<R: Real>(value: f64) -> bool {
    R::checked_from_f64(value).is_some()
}
