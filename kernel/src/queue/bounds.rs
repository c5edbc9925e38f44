//! Checks that pieces stay within the travel of the axes.

use super::rejection::Rejection;
use crate::num::Real;
use crate::path::{Piece, Travel};

/// The travel that pieces are checked against.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<const AXES: usize>(Travel<AXES>);

impl<const AXES: usize> Bounds<AXES> {
    /// Pieces may go anywhere.
    pub(super) const NONE: Self = Self([None; AXES]);

    pub(super) fn new(travel: Travel<AXES>) -> Self {
        Self(travel)
    }

    /// Refuses a piece that leaves the travel.
    pub(super) fn hold<R: Real>(&self, piece: &Piece<R, AXES>) -> Result<(), Rejection> {
        piece.beyond(&self.0).map_or(Ok(()), |(axis, mm)| Err(Rejection::Travel { axis, mm }))
    }
}
