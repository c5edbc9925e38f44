//! What a tick records: everything S4 wants to see of a run.

use crate::axis::AxisOutput;
use crate::exec::Executed;
use crate::fault::Fault;

/// One tick of the whole kernel.
#[derive(Clone, Copy, Debug)]
pub struct Trace<R, const AXES: usize> {
    /// Tick number since the start.
    pub tick: u64,
    /// Set values along the path and per axis. In a fault the last ones before it.
    pub executed: Executed<R, AXES>,
    /// Actual values and outputs. In a fault the outputs are 0 V.
    pub axes: [AxisOutput<R>; AXES],
    /// The latched fault, if there is one.
    pub fault: Option<Fault<R>>,
}
