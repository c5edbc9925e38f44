//! What is shown of a program on a board: lines for what changes, and on a terminal a bar; or JSON.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use motion_kernel::link::{State, Status};
use motion_kernel::units::Position;

use super::SendArguments;
use crate::board::interface::state_words;
use crate::board::stops::Stops;
use crate::board::{Connection, Step};
use crate::cli::error::CliError;

/// What is shown of it: lines for what changes, and on a terminal a bar.
pub(super) struct Shown<'a> {
    axes: &'a [String],
    is_json: bool,
    bar: ProgressBar,
    pub(super) stops: Stops,
    /// Items of the program, where that is known.
    items: Option<usize>,
    last: Option<(Step, Option<State>)>,
    told: Instant,
}

impl<'a> Shown<'a> {
    /// `of` is how many items and lines the program has.
    pub(super) fn new(
        arguments: &SendArguments,
        axes: &'a [String],
        stops: Stops,
        of: (Option<usize>, u64),
    ) -> Self {
        let (items, lines) = of;
        let is_shown = io::stderr().is_terminal() && !arguments.json;
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(lines), target);
        // A template that does not parse would only change the look of the bar.
        if let Ok(style) = ProgressStyle::with_template("{bar:24} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        Self { axes, is_json: arguments.json, bar, stops, items, last: None, told: Instant::now() }
    }

    /// A line.
    pub(super) fn say(&self, out: &mut dyn Write, text: &str) -> Result<(), CliError> {
        if self.is_json {
            return Ok(());
        }
        self.bar.suspend(|| writeln!(out, "{text}").and_then(|()| out.flush())).map_err(CliError::Output)
    }

    /// A line that scripts are to have, too.
    pub(super) fn tell(&self, out: &mut dyn Write, text: &str) -> Result<(), CliError> {
        if self.is_json {
            let line = serde_json::json!({ "step": "confirmation", "text": text });
            return writeln!(out, "{line}").and_then(|()| out.flush()).map_err(CliError::Output);
        }
        self.say(out, text)
    }

    /// The names of the machine's axes.
    pub(super) fn axes(&self) -> &'a [String] {
        self.axes
    }

    pub(super) fn end(&self, out: &mut dyn Write, text: &str) -> Result<(), CliError> {
        self.bar.finish_and_clear();
        self.say(out, text)
    }

    pub(super) fn show<const M: usize>(
        &mut self,
        out: &mut dyn Write,
        step: Step,
        connection: &Connection<M>,
    ) -> Result<(), CliError> {
        let status = connection.status();
        let now = (step, status.map(|status| status.state));
        let is_new = self.last != Some(now);
        let is_late = self.told.elapsed() > Duration::from_millis(if self.is_json { 500 } else { 100 });
        if !is_new && !is_late {
            return Ok(());
        }
        (self.last, self.told) = (Some(now), Instant::now());
        if self.is_json {
            let line = self.json(step, status, connection);
            return writeln!(out, "{line}").and_then(|()| out.flush()).map_err(CliError::Output);
        }
        let Some(status) = status else { return Ok(()) };
        if step == Step::Drives && status.line > 0 {
            self.bar.set_position(u64::from(status.line));
        }
        let position = at(self.axes, &status.set);
        let percent = f64::from(connection.controls().override_permille) * 0.1;
        let state = state_words(status.state);
        let text = format!(
            "{state}, line {}  {}  F {:.0} mm/min  {percent:.0} %",
            status.line,
            position,
            status.feed_mm_s * 60.0
        );
        self.bar.set_message(text);
        if is_new {
            let why = if status.state == State::Stopped {
                self.stops.at(&status.set[..self.axes.len()])
            } else {
                None
            };
            let why = why.map_or_else(String::new, |why| format!(": {why}; r goes on"));
            self.say(out, &format!("{}: {state} at {}{why}", step_words(step), position))?;
        }
        Ok(())
    }

    fn json<const M: usize>(
        &self,
        step: Step,
        status: Option<&Status<M>>,
        connection: &Connection<M>,
    ) -> serde_json::Value {
        let count = self.axes.len();
        let mm = |positions: &[Position; M]| -> Vec<f64> {
            positions.iter().take(count).map(|position| position.to_mm()).collect()
        };
        serde_json::json!({
            "step": step_words(step),
            "state": status.map(|status| state_words(status.state)),
            "line": status.map(|status| status.line),
            "set_mm": status.map(|status| mm(&status.set)),
            "actual_mm": status.map(|status| mm(&status.actual)),
            "feed_mm_s": status.map(|status| status.feed_mm_s),
            "override": f64::from(connection.controls().override_permille) * 1e-3,
            "taken": status.map(|status| status.taken),
            "items": self.items,
        })
    }
}

/// A position, with the names of the axes.
pub(super) fn at(axes: &[String], position: &[Position]) -> String {
    let of_axes = axes.iter().zip(position);
    let words: Vec<String> = of_axes.map(|(name, at)| format!("{name} {:.3}", at.to_mm())).collect();
    words.join(" ")
}

/// The word for a step.
fn step_words(step: Step) -> &'static str {
    match step {
        Step::Greets => "connecting",
        Step::Clears => "clearing the fault",
        Step::Enables => "enabling",
        Step::GivesUp => "giving up what the board has",
        Step::ToStart => "to the start",
        Step::Drives => "program",
        Step::Homes => "homing",
        Step::Disables => "switching the drives off",
        Step::Aborts => "aborting",
        Step::Done => "done",
        Step::Aborted => "aborted",
    }
}
