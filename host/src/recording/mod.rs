//! A run as bytes: everything that the kernel consumed, from which it runs again to the same bits.
//!
//! Consumes a [`Job`] and what the [`Recorder`] saw of the hardware; produces bytes, and from bytes the same
//! run again. It does not depend on the simulated machine: [`Player`] answers in the hardware's place.
//!
//! | bytes | content |
//! |---|---|
//! | 4 | `MREC` |
//! | 1 | version of this format, 6 |
//! | 1 | places for axes, 3 or 9: [`places`] |
//! | … | [`Recording`] in the [postcard](https://postcard.jamesmunns.com) wire format |
//! | 4 | CRC-32 (ISO-HDLC) of all before it, least significant byte first |
//!
//! A [`Recording`] holds, in this order: the [`Job`], which is the number type, machine, guards and compensation as the kernel knows them,
//! the program's items with the blocks of its path, the learnt correction and the commands as text, if there are any, and
//! what a report shows of the run, with the letters of the axes in the first places; the counts before the first tick; and
//! the answers of every tick, some eight bytes each on three places ([`answers`]).
//!
//! - [`answers`]: what the hardware answered, tick by tick;
//! - [`recorder`]: hardware that writes it down;
//! - [`replay`](mod@replay): hardware that answers from it, and the comparison;
//!
//! [`Player`]: replay::Player

pub mod recorder;
pub mod replay;
pub mod answers;

pub use recorder::Recorder;
pub use replay::{Difference, Replay, replay};

use std::convert::Infallible;

use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::{self, CheckError, Checksum};
use motion_kernel::units::Counts;
use serde::{Deserialize, Serialize};

use self::answers::RecordedAnswers;
use crate::simulate::{Job, Number};

const MAGIC: [u8; 4] = *b"MREC";
const VERSION: u8 = 6;

/// A recorded run of a machine with `N` places for axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recording<const N: usize = 3> {
    job: Job<N>,
    /// What the encoders read before the first tick.
    #[serde(with = "motion_kernel::array")]
    start: [Counts; N],
    answers: RecordedAnswers,
}

/// Why bytes are not a recording. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// They do not begin as one.
    #[error("found {found}, expected a recording, which begins with MREC")]
    NotARecording {
        /// What they begin with, for people.
        found: String,
    },
    /// They are of another version of the format.
    #[error("found a recording of format {found}, expected format {VERSION}")]
    Version {
        /// Theirs.
        found: u8,
    },
    /// They are of a machine with another number of places for axes.
    #[error("found a recording of {found} places for axes, expected {expected}")]
    Places {
        /// Theirs.
        found: u8,
        /// What was asked for.
        expected: usize,
    },
    /// They have been damaged, or end too early.
    #[error("found checksum {found:08x}, expected {expected:08x}: the recording is damaged or not whole")]
    Checksum {
        /// Of the bytes as they are.
        found: u32,
        /// As written.
        expected: u32,
    },
    /// Behind an intact checksum something is not as it is written.
    #[error("found no recording behind an intact checksum: {0}")]
    Malformed(String),
    /// The kernel does not accept the program in it.
    #[error("program in the recording: found {0}, expected what this kernel accepts")]
    Check(CheckError<Infallible>),
}

impl<const N: usize> Recording<N> {
    /// Of a job, with what a [`Recorder`] has seen of it.
    #[must_use]
    pub(self) fn new(job: &Job<N>, start: [Counts; N], answers: RecordedAnswers) -> Self {
        Self { job: job.clone(), start, answers }
    }

    /// The recording as bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = [&MAGIC[..], &[VERSION, N as u8]].concat();
        // Only what is endless, or of unknown length, can't be written.
        bytes.extend(postcard::to_stdvec(self).expect("figures, texts and lists"));
        bytes.extend(Checksum::of(&bytes).to_le_bytes());
        bytes
    }

    /// The recording in `bytes`, which end with it.
    ///
    /// # Errors
    /// Nothing but a whole, undamaged recording of a program that the kernel accepts.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RecordingError> {
        let (places, rest) = head(bytes)?;
        let Some((body, &sum)) = rest.split_last_chunk() else {
            return Err(RecordingError::Malformed(format!("{} bytes in all", bytes.len())));
        };
        let (found, expected) = (Checksum::of(&bytes[..bytes.len() - sum.len()]), u32::from_le_bytes(sum));
        if found != expected {
            return Err(RecordingError::Checksum { found, expected });
        }
        if usize::from(places) != N {
            return Err(RecordingError::Places { found: places, expected: N });
        }
        let (recording, left) = postcard::take_from_bytes::<Self>(body)
            .map_err(|error| RecordingError::Malformed(error.to_string()))?;
        if !left.is_empty() {
            return Err(RecordingError::Malformed(format!("{} bytes too many", left.len())));
        }
        recording.answers.check::<N>()?;
        if recording.job.info.axes.len() > N {
            let found = format!("{} axes on {N} places", recording.job.info.axes.len());
            return Err(RecordingError::Malformed(found));
        }
        match recording.job.number {
            Number::F32 => recording.check::<f32>(),
            Number::F64 => recording.check::<f64>(),
            Number::Fixed => recording.check::<Fixed>(),
        }?;
        Ok(recording)
    }

    fn check<R: Real>(&self) -> Result<(), RecordingError> {
        let items = program::switches_as_stops(self.job.items.iter().map(|&item| Ok(item)));
        program::check::<R, N, _>(&self.job.header, items).map_err(RecordingError::Check)
    }

    /// What was run.
    #[must_use]
    pub fn job(&self) -> &Job<N> {
        &self.job
    }

    /// Ticks in it, those included in which the machine settled after the program's end.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.answers.ticks
    }

    /// The digest of all its ticks.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.answers.digest
    }
}

/// How many places for axes the machine of a recording has: with as many its bytes can be read.
///
/// # Errors
/// The bytes do not begin as a recording of this version.
pub fn places(bytes: &[u8]) -> Result<usize, RecordingError> {
    head(bytes).map(|(places, _)| usize::from(places))
}

/// The places for axes, and what is behind the head.
fn head(bytes: &[u8]) -> Result<(u8, &[u8]), RecordingError> {
    let Some(rest) = bytes.strip_prefix(&MAGIC) else {
        return Err(RecordingError::NotARecording { found: beginning(bytes) });
    };
    match *rest {
        [] => Err(RecordingError::NotARecording { found: "its first four bytes alone".to_owned() }),
        [version, ..] if version != VERSION => Err(RecordingError::Version { found: version }),
        [_] => Err(RecordingError::Malformed(format!("{} bytes in all", bytes.len()))),
        [_, places, ref rest @ ..] => Ok((places, rest)),
    }
}

/// What a file begins with, so that its owner knows it again.
fn beginning(bytes: &[u8]) -> String {
    const SHOWN: usize = 16;
    let text: String = bytes.iter().take(SHOWN).map(|byte| byte.escape_ascii().to_string()).collect();
    if bytes.is_empty() { "nothing".to_owned() } else { format!("\"{text}\" at its start") }
}

#[cfg(test)]
mod tests;
