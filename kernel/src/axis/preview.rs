//! Preview: position set-points are delayed, feedforward is not, so it comes before the position.
//!
//! All axes are delayed alike, by the same whole number of ticks: the path stays the same and is driven a few
//! milliseconds later. In the tick; one place is read and written.

use serde::{Deserialize, Serialize};

use super::AxisFigures;
use super::scale::ScaleError;
use crate::num::{is_within, rolled, whole};
use crate::path::Setpoint;
use crate::units::Position;

/// Greatest delay \[ticks\].
pub const PREVIEW_TICKS_MAX: u8 = 24;
/// Tolerance \[ticks\], so that rounding does not turn a lead of whole ticks into one tick more or less.
pub const LEAD_ROUNDING_TICKS: f64 = 1e-6;

/// The delay that all axes share, in whole ticks: as many as the longest lead needs.
///
/// # Errors
/// A lead is not finite, negative, or longer than [`PREVIEW_TICKS_MAX`] ticks; returned with its axis,
/// from 0.
pub(super) fn preview_ticks(axes: &[AxisFigures], tick_s: f64) -> Result<u8, (usize, ScaleError)> {
    let mut most = 0;
    for (axis, figures) in rolled(axes).iter().enumerate() {
        let value = figures.feedforward.lead_s;
        let ticks = value / tick_s - LEAD_ROUNDING_TICKS;
        if !(is_within(value, 0.0, f64::MAX) && ticks <= f64::from(PREVIEW_TICKS_MAX)) {
            let expected = "a number from 0 to 24 ticks";
            return Err((axis, ScaleError { quantity: "feedforward lead [s]", value, expected }));
        }
        if ticks > 0.0 {
            let passed = whole(ticks) as u8;
            most = core::cmp::max(most, if f64::from(passed) < ticks { passed + 1 } else { passed });
        }
    }
    Ok(most)
}

/// The positions of the last ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Preview<const AXES: usize> {
    #[serde(with = "crate::array::rows")]
    past: [[Position; AXES]; PREVIEW_TICKS_MAX as usize],
    ticks: u8,
    next: u8,
}

impl<const AXES: usize> Preview<AXES> {
    /// The preview of a machine that has been at rest at `position`, delayed by `ticks`, at most
    /// [`PREVIEW_TICKS_MAX`].
    #[must_use]
    pub(crate) fn new(ticks: u8, position: [Position; AXES]) -> Self {
        let past = [[Position::ZERO; AXES]; PREVIEW_TICKS_MAX as usize];
        let mut preview = Self { past, ticks: ticks.min(PREVIEW_TICKS_MAX), next: 0 };
        preview.rest_at(position);
        preview
    }

    /// The delay \[ticks\].
    #[must_use]
    pub(crate) fn ticks(&self) -> u8 {
        self.ticks
    }

    /// Resets as if the machine had always been at `position`.
    #[inline(never)]
    pub(crate) fn rest_at(&mut self, position: [Position; AXES]) {
        for past in rolled(self.past.as_mut_slice()) {
            *past = position;
        }
        self.next = 0;
    }

    /// Moves all positions of an axis by `shift`.
    pub(crate) fn shift(&mut self, axis: usize, shift: Position) {
        for past in self.past.iter_mut().filter_map(|past| past.get_mut(axis)) {
            *past = *past + shift;
        }
    }

    /// Writes the positions of `ticks` ago to `set`; remembers the present ones.
    #[inline]
    pub(crate) fn delay<'a, R: 'a>(
        &mut self,
        setpoints: &[Setpoint<R>; AXES],
        set: impl Iterator<Item = &'a mut Position>,
    ) {
        if self.ticks == 0 {
            for (set, setpoint) in set.zip(setpoints) {
                *set = setpoint.position;
            }
            return;
        }
        // The ring is as long as the delay: the place read is the one written.
        if let Some(place) = self.past.get_mut(usize::from(self.next)) {
            for ((set, place), setpoint) in set.zip(place).zip(setpoints) {
                *set = *place;
                *place = setpoint.position;
            }
        }
        self.next = if self.next + 1 >= self.ticks { 0 } else { self.next + 1 };
    }
}
