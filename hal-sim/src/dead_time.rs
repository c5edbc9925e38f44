//! The dead time between the DAC and the drive's velocity controller.
//!
//! A ring of past commands, one cell per sub-step. A dead time between two cells is interpolated
//! linearly. Bound: two reads and one write per sub-step.

use crate::parameter::ParameterError;

/// A dead time counted in sub-steps (configuration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DeadTime {
    whole_steps: usize,
    fraction: f64,
}

impl DeadTime {
    /// Splits a checked dead time \[s\] into whole sub-steps and a remainder.
    pub(crate) fn new(dead_time_s: f64, step_s: f64) -> Self {
        // The cast cuts off; a ratio beyond the type's range saturates and no line is long enough.
        let whole_steps = (dead_time_s / step_s) as usize;
        Self { whole_steps, fraction: dead_time_s / step_s - whole_steps as f64 }
    }

    /// Cells for the newest command, the whole steps before it and one more to interpolate with.
    pub(crate) fn cells_needed(&self) -> usize {
        self.whole_steps.saturating_add(2)
    }
}

/// Past commands \[mm/s\] (state).
#[derive(Clone, Debug)]
pub(crate) struct DeadTimeLine<const LINE: usize> {
    cells: [f64; LINE],
    newest: usize,
}

impl<const LINE: usize> DeadTimeLine<LINE> {
    /// A line on which `command_mm_s` has been constant for at least the dead time.
    pub(crate) fn standing(dead_time: &DeadTime, command_mm_s: f64) -> Result<Self, ParameterError> {
        let cells_needed = dead_time.cells_needed();
        if cells_needed > LINE {
            return Err(ParameterError::LineTooShort { cells_needed, capacity: LINE });
        }
        Ok(Self { cells: [command_mm_s; LINE], newest: 0 })
    }

    /// Takes the command of this sub-step and returns the one that comes out of the dead time.
    pub(crate) fn pass(&mut self, dead_time: &DeadTime, command_mm_s: f64) -> f64 {
        self.newest = (self.newest + 1) % LINE;
        self.cells[self.newest] = command_mm_s;
        // whole_steps + 2 ≤ LINE was checked, so neither index goes below zero.
        let later = (self.newest + LINE - dead_time.whole_steps) % LINE;
        let earlier = (later + LINE - 1) % LINE;
        (1.0 - dead_time.fraction) * self.cells[later] + dead_time.fraction * self.cells[earlier]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_comes_out_late_by_the_dead_time() {
        // A ramp shows the interpolation: its delay is read off as a value.
        let dead_time = DeadTime::new(2.25, 1.0);
        let mut line = DeadTimeLine::<5>::standing(&dead_time, 0.0).unwrap();
        for step in 0..20 {
            let expected = (f64::from(step) - 2.25).max(0.0);
            let out = line.pass(&dead_time, f64::from(step));
            if step >= 3 {
                assert!((out - expected).abs() < 1e-12, "step {step}: {out}");
            }
        }
    }

    #[test]
    fn no_dead_time_passes_at_once() {
        let dead_time = DeadTime::new(0.0, 1.0);
        let mut line = DeadTimeLine::<2>::standing(&dead_time, 7.0).unwrap();
        assert_eq!(line.pass(&dead_time, -3.0).to_bits(), (-3.0_f64).to_bits());
    }

    #[test]
    fn a_short_line_is_refused() {
        let refusal = DeadTimeLine::<5>::standing(&DeadTime::new(4.0, 1.0), 0.0).unwrap_err();
        assert_eq!(refusal, ParameterError::LineTooShort { cells_needed: 6, capacity: 5 });
        assert!(DeadTimeLine::<5>::standing(&DeadTime::new(1e300, 1e-9), 0.0).is_err());
    }
}
