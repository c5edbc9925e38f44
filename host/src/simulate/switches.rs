//! Spindle and coolant of a run: put out, and noted.
//!
//! The program switches them at rest, in its order. An abort switches all off once motion rests; a fault switches all
//! off right after the tick that finds it, whatever the axes do then. A hold, single block and a program stop leave them
//! as they are.

use motion_kernel::hal::{OutputState, Outputs};

use crate::trace::TracedSwitch;

/// The outputs so far.
pub(super) struct Switches<'a> {
    /// The lines of the program's switches still to come.
    lines: std::slice::Iter<'a, u32>,
    now: OutputState,
    /// All are off for good.
    is_over: bool,
    noted: Vec<TracedSwitch>,
}

impl<'a> Switches<'a> {
    /// All off; the program switches in these lines.
    pub(super) fn new(lines: &'a [u32]) -> Self {
        Self { lines: lines.iter(), now: OutputState::OFF, is_over: false, noted: Vec::new() }
    }

    /// Whether the program switches no more: after a fault its items may still come to an end.
    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

    /// The program's next switch, before `tick`.
    pub(super) fn by_program(&mut self, tick: u64, to: OutputState, hardware: &mut impl Outputs) {
        let line = self.lines.next().copied();
        self.put_out(TracedSwitch { tick, line, to }, hardware);
    }

    /// Nothing turns or flows from `tick` on.
    pub(super) fn off(&mut self, tick: u64, hardware: &mut impl Outputs) {
        self.is_over = true;
        if self.now != OutputState::OFF {
            self.put_out(TracedSwitch { tick, line: None, to: OutputState::OFF }, hardware);
        }
    }

    /// All switches, in order.
    pub(super) fn noted(self) -> Vec<TracedSwitch> {
        self.noted
    }

    fn put_out(&mut self, switch: TracedSwitch, hardware: &mut impl Outputs) {
        hardware.switch(&switch.to);
        self.now = switch.to;
        self.noted.push(switch);
    }
}
