//! A progress bar on a terminal, nothing in a pipe.

use std::io::{self, IsTerminal};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::gcode::Program;
use crate::machine::Machine;
use crate::planning::{Mode, Plan, PlanningError, plan_program_in_view};

/// Ticks between two updates: a run makes millions per second.
const STRIDE: u64 = 4096;

/// Plans a program, and shows how far it is.
///
/// # Errors
/// Those of [`plan_program`](crate::planning::plan_program).
pub(super) fn plan<const N: usize>(
    name: &str,
    program: &Program,
    machine: &Machine<N>,
    mode: Mode,
) -> Result<Plan<N>, PlanningError> {
    let progress = Progress::of("planning", program.steps.len() as u64);
    let plan =
        plan_program_in_view(name, program, machine, mode, &mut |steps| progress.bar.inc(steps as u64));
    progress.finish();
    plan
}

/// Progress through a run of an expected number of ticks.
pub(super) struct Progress {
    bar: ProgressBar,
    ticks: u64,
}

impl Progress {
    pub(super) fn new(ticks_expected: u64) -> Self {
        Self::of("running", ticks_expected)
    }

    /// Through work of so many steps.
    fn of(what: &'static str, expected: u64) -> Self {
        let is_terminal = io::stderr().is_terminal();
        let target = if is_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(expected), target).with_message(what);
        // A template that does not parse would only change the look of the bar.
        if let Ok(style) =
            ProgressStyle::with_template("{msg} {bar:40} {percent:>3} %  {per_sec}  {eta} left")
        {
            bar.set_style(style);
        }
        Self { bar, ticks: 0 }
    }

    pub(super) fn tick(&mut self) {
        self.ticks += 1;
        if self.ticks.is_multiple_of(STRIDE) {
            self.bar.set_position(self.ticks);
        }
    }

    /// Advances by one step of a few.
    pub(super) fn step(&mut self) {
        self.ticks += 1;
        self.bar.set_position(self.ticks);
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
