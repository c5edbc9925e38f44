//! The state of a kernel, apart from its configuration: what its next ticks follow from, besides what they consume.

use serde::{Deserialize, Serialize};

use super::{Guards, Kernel, Power};
use crate::axis::{AxisState, Preview};
use crate::exec::Executor;
use crate::num::Real;
use crate::trace::Trace;

/// The state of a kernel between two ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct KernelState<R: Real, const AXES: usize> {
    power: Power,
    told: Option<bool>,
    executor: Executor<R, AXES>,
    /// Of the last tick.
    pub(crate) trace: Trace<R, AXES>,
    #[serde(with = "crate::array")]
    axes: [AxisState<R>; AXES],
    preview: Preview<AXES>,
    guards: Guards<AXES>,
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// Whether no stretch is under way.
    pub(crate) fn is_between_stretches(&self) -> bool {
        self.executor.is_at_rest()
    }

    /// The state between two ticks.
    pub(crate) fn state(&self) -> KernelState<R, AXES> {
        let &Self { power, told, executor, trace, axes, preview, guards, .. } = self;
        KernelState { power, told, executor, trace, axes, preview, guards }
    }

    /// Goes on from the state of a kernel with the same configuration.
    pub(crate) fn restore(&mut self, state: &KernelState<R, AXES>) {
        let KernelState { power, told, executor, trace, axes, preview, guards } = *state;
        (self.power, self.told, self.executor, self.trace) = (power, told, executor, trace);
        (self.axes, self.preview, self.guards) = (axes, preview, guards);
    }
}
