//! What a page in a browser asks for, and how it is answered: in steps, so that the page can tell how far it is.
//!
//! Consumes a request in JSON; produces an answer: its length in 4 bytes, little end first, JSON, and the data of a run as
//! [`report`](crate::report) has them. There are no files, no threads and no clock. Plans and ticks are those of `motion run`, to
//! the bit.
//!
//! What an answer is made from stays in memory: a page starts anew when its memory has grown.
//!
//! - `run`: a program through plan, kernel and simulated machine;
//! - `drive`: experiments with the drives, and their tuning;
//! - `ramp`: one ramp of the feed law;
//! - `sliders`: the numbers of a machine file that a page has sliders for;
//! - `digest`: a number for all bits of a run.

mod digest;
mod drive;
mod ramp;
mod run;
mod sliders;

use serde::{Deserialize, Serialize};

use self::drive::DriveRequest;
use self::ramp::RampRequest;
use self::run::RunRequest;

/// What is asked for.
#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum Request {
    /// A run of a program.
    Run(RunRequest),
    /// A ramp of the feed law.
    Ramp(RampRequest),
    /// An experiment with the drives.
    Drive(DriveRequest),
}

/// What an answer is being made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// A program is read.
    #[default]
    Reading,
    /// Its feed is planned.
    Planning,
    /// It is run tick by tick.
    Running,
    /// The answer is written.
    Writing,
}

/// How far the work is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// What is done.
    pub stage: Stage,
    /// The part of it that is done, 0 to 1.
    pub part: f64,
}

/// An answer: JSON, and a run's data.
struct Answer {
    header: Vec<u8>,
    data: Vec<u8>,
}

impl Answer {
    /// Fails for what JSON can't tell.
    fn new(header: &impl Serialize, data: Vec<u8>) -> Result<Self, String> {
        let header = serde_json::to_vec(header).map_err(|error| error.to_string())?;
        Ok(Self { header, data })
    }

    fn refused(error: &str) -> Self {
        Self { header: serde_json::json!({ "error": error }).to_string().into_bytes(), data: Vec::new() }
    }

    fn bytes(&self) -> Vec<u8> {
        let length = (self.header.len() as u32).to_le_bytes();
        [&length[..], &self.header, &self.data].concat()
    }
}

/// Work that takes several steps. An error is in words: file, line, what was found, what was expected.
trait Work {
    /// Does a part of it. None: there is more to do.
    fn advance(&mut self) -> Result<Option<Answer>, String>;

    fn progress(&self) -> Progress;
}

/// A request on its way to its answer.
pub struct Task(State);

enum State {
    Under(Box<dyn Work>),
    Answered(Vec<u8>),
}

impl Task {
    /// Takes a request.
    #[must_use]
    pub fn new(request: &[u8]) -> Self {
        let begun = match serde_json::from_slice(request) {
            Ok(Request::Run(request)) => run::begin(request).map(State::Under),
            Ok(Request::Drive(request)) => drive::begin(request).map(State::Under),
            Ok(Request::Ramp(request)) => request.answer().map(|answer| State::Answered(answer.bytes())),
            Err(error) => Err(format!("request: found {error}, expected what the page asks for")),
        };
        Self(begun.unwrap_or_else(|error| State::Answered(Answer::refused(&error).bytes())))
    }

    /// Does a part of the work. False: the answer is there.
    pub fn advance(&mut self) -> bool {
        let State::Under(work) = &mut self.0 else { return false };
        let answer = match work.advance() {
            Ok(None) => return true,
            Ok(Some(answer)) => answer,
            Err(error) => Answer::refused(&error),
        };
        self.0 = State::Answered(answer.bytes());
        false
    }

    /// How far it is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        match &self.0 {
            State::Under(work) => work.progress(),
            State::Answered(_) => Progress { stage: Stage::Writing, part: 1.0 },
        }
    }

    /// The answer; empty before it is there.
    #[must_use]
    pub fn answer(&self) -> &[u8] {
        match &self.0 {
            State::Under(_) => &[],
            State::Answered(answer) => answer,
        }
    }
}

#[cfg(test)]
mod tests;
