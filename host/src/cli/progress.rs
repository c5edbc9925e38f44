//! A progress bar on a terminal, nothing in a pipe.

use std::io::{self, IsTerminal};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Ticks between two updates: a run makes millions per second.
const STRIDE: u64 = 4096;

/// Progress through a run of an expected number of ticks.
pub(super) struct Progress {
    bar: ProgressBar,
    ticks: u64,
}

impl Progress {
    pub(super) fn new(ticks_expected: u64) -> Self {
        let is_terminal = io::stderr().is_terminal();
        let target = if is_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(ticks_expected), target);
        // A template that does not parse would only change the look of the bar.
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left") {
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
