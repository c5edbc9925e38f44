//! The figures logged once per second, and the flight recorder's rows after a fault; one line per poll.

use motion_kernel::num::Real;
use rtic_core::Mutex;

use crate::control::Control;
use crate::log::LogLine;
use crate::parameters::BoardParameters;

/// Reads out the flight recorder, one row at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FlightDump {
    rows: usize,
    last_ticks: u32,
}

impl FlightDump {
    /// The next row, if one is due at tick `now`.
    pub(crate) fn line<'a, R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize>(
        &mut self,
        now: u32,
        board: &BoardParameters,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        if now.wrapping_sub(self.last_ticks) < board.flight_line_ticks() {
            return None;
        }
        self.last_ticks = now;
        let row = control.lock(|control| {
            let flight = &control.flight;
            if flight.is_frozen() { flight.row(self.rows).copied() } else { None }
        })?;
        self.rows += 1;
        Some(LogLine::Flight(row))
    }
}

/// The lines of a report, in their order.
#[derive(Clone, Copy, Debug, Default)]
enum Next {
    #[default]
    Ticks,
    FollowingErrors,
    Background,
}

/// The figures since the last report.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Report {
    due_ticks: u32,
    next: Next,
    overruns: u32,
    longest_poll_cycles: u32,
}

impl Report {
    /// Notes the duration of a poll of the background.
    pub(crate) fn note_poll(&mut self, cycles: u32) {
        self.longest_poll_cycles = self.longest_poll_cycles.max(cycles);
    }

    /// The next line, if a report is due at tick `now` or under way.
    pub(crate) fn line<'a, R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize>(
        &mut self,
        now: u32,
        board: &BoardParameters,
        [starvations, bytes_lost]: [u32; 2],
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        match self.next {
            Next::Ticks => {
                // Also across the wrap of the counter.
                if self.due_ticks.wrapping_sub(now).wrapping_sub(1) < board.report_ticks() {
                    return None;
                }
                self.due_ticks = now.wrapping_add(board.report_ticks());
                self.next = Next::FollowingErrors;
                let timing = control.lock(|control| control.timing.take());
                self.overruns = self.overruns.saturating_add(timing.overruns);
                Some(LogLine::Ticks { timing, overruns: self.overruns })
            }
            Next::FollowingErrors => {
                self.next = Next::Background;
                let peaks_mm = control.lock(|control| control.kernel.take_peak_following_error_mm());
                Some(LogLine::FollowingErrors(peaks_mm))
            }
            Next::Background => {
                self.next = Next::Ticks;
                let cycles_per_us = board.cycles_hz / 1_000_000;
                let longest = core::mem::take(&mut self.longest_poll_cycles);
                let longest_poll_us = longest.checked_div(cycles_per_us).unwrap_or(longest);
                Some(LogLine::Background { longest_poll_us, starvations, bytes_lost })
            }
        }
    }
}
