//! [`Bounds`] of a kernel without guards: pieces may go anywhere, and it takes no memory.

use super::rejection::Rejection;
use crate::num::Real;
use crate::path::Piece;

/// No travel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<const AXES: usize>;

impl<const AXES: usize> Bounds<AXES> {
    /// Pieces may go anywhere.
    pub(super) const NONE: Self = Self;

    #[inline]
    pub(super) fn hold<R: Real>(&self, _: &Piece<R, AXES>) -> Result<(), Rejection> {
        Ok(())
    }
}
