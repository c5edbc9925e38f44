//! What is kept of a tick.

use crate::hal::AxisInputs;
use crate::num::Real;
use crate::trace::Trace;
use crate::units::DacCode;

/// One tick: what it consumed, and what of its results is compared. Halves are the lower ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TickRecord<const AXES: usize> {
    /// Which words of the background it saw.
    pub(super) generation: u32,
    pub(super) counts: [u32; AXES],
    pub(super) set: [u32; AXES],
    pub(super) codes: [DacCode; AXES],
    pub(super) inputs: [AxisInputs; AXES],
    pub(super) is_stopped: bool,
    pub(super) state: u8,
    pub(super) failures: u8,
    pub(super) trips: TripCount,
}

/// For who compares it.
impl<const AXES: usize> TickRecord<AXES> {
    pub(super) fn of<R: Real>(trace: &Trace<R, AXES>) -> Self {
        let Trace { executed, axes, inputs, .. } = trace;
        Self {
            generation: 0,
            counts: axes.each_ref().map(|axis| axis.counts.0 as u32),
            set: axes.each_ref().map(|axis| axis.set.to_bits() as u32),
            codes: axes.each_ref().map(|axis| axis.code),
            inputs: inputs.axes,
            is_stopped: inputs.emergency_stop,
            state: executed.state as u8,
            failures: 0,
            trips: TripCount::None,
        }
    }
}

/// Faults that the board found before the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TripCount {
    None,
    /// Others than before the last tick, which come separately.
    New(u8),
    /// Those of the tick before.
    Same,
}

impl TripCount {
    /// The byte of [`TripCount::Same`]; others are their number.
    pub(super) const SAME: u8 = u8::MAX;

    pub(super) fn of(byte: u8) -> Self {
        match byte {
            0 => Self::None,
            Self::SAME => Self::Same,
            count => Self::New(count),
        }
    }
}
