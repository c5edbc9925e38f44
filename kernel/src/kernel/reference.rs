//! From one motion to the next without switching the drives: at rest inside an aborted stretch, and at a
//! place that gets another position. Background, between two ticks.

use super::Kernel;
use crate::exec::{ExecState, Executor};
use crate::fault::axis_bit;
use crate::num::Real;
use crate::units::{Counts, Position};

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// Drops the rest of the motion and of the streams, with the drives on: after an abort, or at a motion's
    /// end. Returns the set position: split the streams anew for it. `None` while the machine moves; then
    /// nothing is changed.
    pub fn rest_here(&mut self) -> Option<[Position; AXES]> {
        if self.trace.executed.state == ExecState::Moving {
            return None;
        }
        let position = self.trace.executed.setpoints.each_ref().map(|setpoint| setpoint.position);
        self.rest_at(position);
        Some(position)
    }

    /// Declares an axis to have been at `position` where its encoder read `counts`, at rest: set and actual
    /// position move together, so that no output changes. Returns the set position: split the streams anew
    /// for it. `None` while the machine moves, or if there is no such axis; then nothing is changed.
    pub fn reference(&mut self, axis: usize, counts: Counts, position: Position) -> Option<[Position; AXES]> {
        let (state, config) = (self.axes.get_mut(axis)?, self.config.get(axis)?);
        let mut set = self.trace.executed.setpoints.each_ref().map(|setpoint| setpoint.position);
        if self.trace.executed.state == ExecState::Moving {
            return None;
        }
        let before = state.offset;
        state.refer(config, counts, position);
        #[cfg(feature = "compensation")]
        if let Some(output) = self.trace.axes.get(axis) {
            state.find_load(config, output.counts);
        }
        let shift = state.offset - before;
        let (set_of_axis, output) = (set.get_mut(axis)?, self.trace.axes.get_mut(axis)?);
        *set_of_axis = *set_of_axis + shift;
        output.set = output.set + shift;
        output.actual = output.actual + shift;
        self.preview.shift(axis, shift);
        self.without_counts &= !axis_bit(axis);
        self.rest_at(set);
        Some(set)
    }

    fn rest_at(&mut self, position: [Position; AXES]) {
        self.executor = Executor::new(position);
        self.trace.executed = self.executor.resting();
    }
}
