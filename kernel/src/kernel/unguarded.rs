//! A kernel without guards: only the limit of the following error is watched, and every reaction is
//! immediate.

use serde::{Deserialize, Serialize};

use super::{Kernel, Power};
use crate::fault::{FaultKind, Reaction, Reactions};
use crate::num::Real;
use crate::queue::Intake;
use crate::units::DacCode;

/// A reaction that takes time: there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Ending {}

impl Ending {
    #[inline]
    pub(super) fn executes(self) -> bool {
        match self {}
    }

    #[inline]
    pub(super) fn regulates(self) -> bool {
        match self {}
    }
}

/// No state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guards<const AXES: usize>;

impl<const AXES: usize> Guards<AXES> {
    /// Keeping healthy inputs is not worth the instructions.
    pub(super) const KEEP_INPUTS: bool = false;

    pub(super) fn new(_: Reactions) -> Self {
        Self
    }

    /// Where the codes of a tick are written.
    #[inline]
    #[allow(clippy::unused_self, reason = "as with the feature `guards`")]
    pub(super) fn written<'a>(&'a mut self, local: &'a mut [DacCode; AXES]) -> &'a mut [DacCode; AXES] {
        local
    }
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// The reaction under way: drives off. `None` without a fault.
    pub fn reaction(&self) -> Option<Reaction> {
        self.trace.fault.map(|_| Reaction::Immediate)
    }

    #[inline]
    pub(super) fn sample(&mut self) {}

    /// Latches the fault of an axis that is lost.
    #[inline]
    pub(super) fn judge(&mut self, axis: usize, error_mm: R) {
        self.latch_fault(FaultKind::FollowingError { axis, error_mm });
    }

    #[inline]
    pub(super) fn react(&mut self, _: &FaultKind<R>) {
        self.power = Power::Off;
    }

    #[inline]
    pub(super) fn continue_stop(&mut self, _: &Intake<'_, R, AXES>) {}

    #[inline]
    pub(super) fn continue_ramp(&mut self) {}
}
