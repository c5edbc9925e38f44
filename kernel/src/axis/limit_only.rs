//! Guards of an axis in a kernel without the feature: only the limit of its following error, without state.

use core::marker::PhantomData;

use serde::{Deserialize, Serialize};

use super::AxisConfig;
use crate::num::Real;
use crate::path::Setpoint;
use crate::units::Counts;

/// No figures apart from the axis' limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GuardConfig<R>(PhantomData<R>);

impl<R: Real> GuardConfig<R> {
    #[inline]
    pub(super) fn limit_only(_: f64) -> Self {
        Self(PhantomData)
    }

    /// The limit of the following error in a motion.
    pub(super) fn limit_mm(&self, most_mm: R, _: &Setpoint<R>) -> R {
        most_mm
    }
}

/// No state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Guard<R>(PhantomData<R>);

#[allow(clippy::unused_self, reason = "as the guard of the feature `guards`")]
impl<R: Real> Guard<R> {
    #[inline]
    pub(super) fn at(_: Counts) -> Self {
        Self(PhantomData)
    }

    #[inline]
    pub(super) fn stand_here(&mut self) {}

    #[inline]
    pub(super) fn restart(&mut self) {}

    #[inline]
    pub(super) fn watch(&mut self, _: R, _: Counts) {}

    /// Whether the axis may be regulated. Written so that NaN is a fault.
    #[inline]
    pub(super) fn allows(
        &mut self,
        config: &AxisConfig<R>,
        error_mm: R,
        _: R,
        _: Counts,
        _: &Setpoint<R>,
    ) -> bool {
        error_mm.abs() <= config.following_error_limit_mm
    }

    #[inline]
    pub(super) fn allows_command(&mut self, _: R, _: R) -> bool {
        true
    }
}
