//! Checks whether an axis' figures can be used.
//!
//! Background. An axis has some thirty figures, each with a range. The configuration is always computed to
//! its end, and the first refused figure is kept: an early return at each figure would take more flash than
//! the computation.

use super::ScaleError;
use crate::num::{Real, is_within};

/// The checks so far.
#[derive(Debug, Default)]
pub(super) struct Check {
    /// The first figure that was out of its range.
    pub(super) refused: Option<ScaleError>,
}

impl Check {
    /// Returns what `make` computes, or the first figure that it refuses.
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

    /// Refuses a value that is not from `least` to `most`, or not a number.
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
