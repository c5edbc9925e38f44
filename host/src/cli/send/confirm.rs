//! What the operator is told, and confirms, before a program is begun in its middle.

use std::io::Write;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use motion_kernel::hal::{OutputState, Spindle};
use motion_kernel::link::{Event, State, Status};
use motion_kernel::program::Item;
use motion_kernel::units::Position;

use super::Typed;
use super::shown::{Shown, at};
use crate::board::{BoardError, Connection, Heard, Job};
use crate::cli::error::{CliError, Outcome};
use crate::cli::port::PortArguments;
use crate::files::interrupt;

/// A start in the middle of a program.
pub(super) struct Middle {
    /// Where it is, in words.
    pub(super) place: String,
    /// The tool that the program has in the spindle there; 0: none that it knows of.
    pub(super) tool: u32,
    /// It is confirmed already.
    pub(super) is_confirmed: bool,
}

impl Middle {
    /// Tells what comes first, and waits for the operator. None once it is confirmed; else what became of it.
    pub(super) fn confirm<const M: usize>(
        &self,
        job: &Job<M>,
        (connection, port): (&mut Connection<M>, &PortArguments),
        keys: &Receiver<Typed>,
        shown: &Shown<'_>,
        out: &mut dyn Write,
    ) -> Result<Option<Outcome>, CliError> {
        // Where it was told that the machine stands.
        let mut told: Option<[Position; M]> = None;
        let mut is_waiting_told = false;
        loop {
            // What is confirmed is for this board, as it is now.
            let mut changed = None;
            connection.step(Duration::from_millis(2), &mut |heard| match heard {
                Heard::Lost(cause) => changed = Some(BoardError::Wire(std::io::Error::other(cause))),
                Heard::Board(Event::Replaced) => changed = Some(BoardError::Replaced),
                Heard::Board(Event::Restarted { .. }) => {
                    changed = Some(BoardError::Reset { confirmed: 0, at: String::new() });
                }
                Heard::Board(_) | Heard::Back => {}
            });
            if let Some(changed) = changed {
                return Err(port.refused(changed));
            }
            // After a crash of the PC a board still drives what it has.
            let rests = |status: &&Status<M>| !matches!(status.state, State::Moving | State::Dwell);
            let here = connection.status().filter(rests).map(|status| status.set);
            if connection.status().is_some() && here.is_none() && !is_waiting_told {
                is_waiting_told = true;
                shown.say(out, "the board still moves: this waits until it rests")?;
            }
            let has_moved = told.zip(here).is_some_and(|(told, here)| is_elsewhere(&told, &here));
            if let Some(here) = here
                && (told.is_none() || has_moved)
            {
                if has_moved {
                    shown.tell(out, "the machine has moved since")?;
                }
                told = Some(here);
                for line in self.lines(job, &here, shown.axes()) {
                    shown.tell(out, &line)?;
                }
                // What was typed before was about something else.
                if has_moved {
                    while matches!(keys.try_recv(), Ok(Typed::Key(_))) {}
                }
            }
            let is_told = told.is_some() && here.is_some();
            if is_told && self.is_confirmed {
                return Ok(None);
            }
            if interrupt::take_asked().is_some() {
                return shown.end(out, "ended: nothing was moved").map(|()| Some(Outcome::Held));
            }
            match keys.try_recv() {
                Ok(Typed::Key('r')) if is_told => return Ok(None),
                Ok(Typed::Key('a')) => {
                    return shown.end(out, "given up: nothing was moved").map(|()| Some(Outcome::Aborted));
                }
                Ok(Typed::Key(_)) => shown.say(out, "r confirms, a gives up")?,
                Ok(Typed::End) | Err(TryRecvError::Disconnected) if is_told && !self.is_confirmed => {
                    let told = "nobody confirms, and nothing was moved: --yes confirms";
                    return shown.end(out, told).map(|()| Some(Outcome::Held));
                }
                Ok(Typed::End) | Err(_) => {}
            }
        }
    }

    /// What comes first.
    fn lines<const M: usize>(&self, job: &Job<M>, here: &[Position; M], axes: &[String]) -> Vec<String> {
        let mut lines = vec![self.place.clone()];
        let outputs = job.begin.lead.iter().find_map(|item| match item {
            Item::Switch(to) => Some(*to),
            _ => None,
        });
        lines.push(format!(
            "at first, where the machine stands: {}",
            outputs_words(&outputs.unwrap_or(OutputState::OFF))
        ));
        let (from, to) = (at(axes, here), at(axes, &job.header.start));
        lines.push(if *here == job.header.start {
            format!("the machine stands at {from}, where the path begins")
        } else {
            format!("then it moves straight from {from} to {to}, slowly")
        });
        lines.push(match self.tool {
            0 => "tool: the program has changed none".to_owned(),
            tool => format!("tool in the spindle: {tool}"),
        });
        if !self.is_confirmed {
            lines.push("r with Enter confirms and begins, a gives up".to_owned());
        }
        lines
    }
}

/// Whether a machine has moved by more than drives that are off let it wander.
fn is_elsewhere<const M: usize>(told: &[Position; M], here: &[Position; M]) -> bool {
    const WANDERS_MM: f64 = 0.01;
    told.iter().zip(here).any(|(&told, &here)| (here - told).to_mm().abs() > WANDERS_MM)
}

/// What spindle and coolant do.
fn outputs_words(outputs: &OutputState) -> String {
    let spindle = match outputs.spindle {
        Spindle::Off => "spindle off".to_owned(),
        Spindle::Clockwise => format!("spindle clockwise at {} rev/min", outputs.speed_rpm),
        Spindle::Counterclockwise => format!("spindle counterclockwise at {} rev/min", outputs.speed_rpm),
    };
    let coolant = match (outputs.flood, outputs.mist) {
        (false, false) => "coolant off",
        (true, false) => "flood on",
        (false, true) => "mist on",
        (true, true) => "flood and mist on",
    };
    format!("{spindle}, {coolant}")
}
