//! A recorded run once more, from the recording alone.

use std::fmt;

use motion_kernel::hal::{
    DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs, VelocityChannel,
};
use motion_kernel::num::Scalar;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use super::Recording;
use super::answers::{AnswerReader, Answers, Checks};
use crate::simulate::{self, Hardware, Job, Observer, RunError, RunSummary};

/// A run that was made again.
#[derive(Clone, Debug)]
pub struct Replay {
    /// As of any run; up to the difference, if there is one.
    pub summary: RunSummary,
    /// Ticks that were made again, those in which the machine settled included.
    pub ticks: u64,
    /// Where it went another way.
    pub difference: Option<Difference>,
}

/// How a replay is not what was recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// The kernel set, put out or told the drives something else, or spindle or coolant were switched otherwise.
    Tick {
        /// The tick, from 0.
        tick: u64,
    },
    /// The replay continues after the recording's last tick.
    Longer {
        /// Ticks of the recording.
        ticks: u64,
    },
    /// The replay ends earlier than the recording.
    Shorter {
        /// Ticks that were made again.
        ticks: u64,
        /// Ticks of the recording.
        expected: u64,
    },
    /// All ticks seem the same and the digests at the end are not.
    Digest {
        /// Of the replay.
        found: u64,
        /// Of the recording.
        expected: u64,
    },
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tick { tick } => write!(f, "differs in tick {tick}"),
            Self::Longer { ticks } => write!(f, "goes on after {ticks} ticks, where the recording ends"),
            Self::Shorter { ticks, expected } => write!(f, "ends after {ticks} of {expected} ticks"),
            Self::Digest { found, expected } => {
                write!(f, "differs somewhere: digest {found:016x}, expected {expected:016x}")
            }
        }
    }
}

/// Runs `job`, which is `recording`'s, as it was recorded.
///
/// # Errors
/// The job can't be executed.
pub fn replay<const N: usize>(
    recording: &Recording<N>,
    job: &Job<N>,
    observe: &mut Observer<'_, N>,
) -> Result<Replay, RunError> {
    let mut player = Player::new(recording);
    let summary = simulate::run_on(job, &mut player, observe)?;
    let (ticks, expected) = (player.ticks, recording.ticks());
    let digest = player.checks.digest();
    let at_end = || {
        if ticks < expected {
            Some(Difference::Shorter { ticks, expected })
        } else {
            (digest != recording.digest())
                .then_some(Difference::Digest { found: digest, expected: recording.digest() })
        }
    };
    let difference = player.difference.or_else(at_end);
    Ok(Replay { summary, ticks, difference })
}

/// Hardware that answers from a recording, until what it is asked differs.
#[derive(Debug)]
pub struct Player<'a, const N: usize = 3> {
    start: [Counts; N],
    reader: AnswerReader<'a, N>,
    /// Of the tick under way, with its check byte.
    answers: Option<(Answers<N>, u8)>,
    told: Option<bool>,
    checks: Checks,
    ticks: u64,
    difference: Option<Difference>,
}

/// As recorded: that which failed fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedFailure;

impl<'a, const N: usize> Player<'a, N> {
    fn new(recording: &'a Recording<N>) -> Self {
        Self {
            start: recording.start,
            reader: recording.answers.read(recording.start),
            answers: None,
            told: None,
            checks: Checks::default(),
            ticks: 0,
            difference: None,
        }
    }
}

impl<const N: usize> Hardware<N> for Player<'_, N> {
    fn start_counts(&mut self) -> [Counts; N] {
        self.start
    }

    fn advance<R: Scalar>(&mut self, trace: &Trace<R, N>) -> bool {
        let told = self.told.take();
        self.difference = match self.answers.take() {
            None => Some(Difference::Longer { ticks: self.ticks }),
            Some((answers, check)) => {
                let agrees = self.checks.add(trace) == check;
                let is_told_the_same = told == answers.told.map(|(enable, _)| enable);
                (!(agrees && is_told_the_same)).then_some(Difference::Tick { tick: self.ticks })
            }
        };
        self.ticks += u64::from(!matches!(self.difference, Some(Difference::Longer { .. })));
        self.difference.is_none()
    }
}

impl<const N: usize> Outputs for Player<'_, N> {
    fn switch(&mut self, to: &OutputState) {
        self.checks.switch(to);
    }
}

impl<const N: usize> Encoder<N> for Player<'_, N> {
    type Error = RecordedFailure;

    // The first thing that a tick asks for.
    fn latch(&mut self) -> Result<[Counts; N], RecordedFailure> {
        self.answers = self.reader.next();
        self.answers.and_then(|(answers, _)| answers.counts).ok_or(RecordedFailure)
    }
}

impl<const N: usize> Inputs<N> for Player<'_, N> {
    type Error = RecordedFailure;

    fn read_inputs(&mut self) -> Result<MachineInputs<N>, RecordedFailure> {
        self.answers.and_then(|(answers, _)| answers.inputs).ok_or(RecordedFailure)
    }
}

impl<const N: usize> VelocityChannel<N> for Player<'_, N> {
    type Error = RecordedFailure;

    fn write(&mut self, _: &[DacCode; N]) -> Result<(), RecordedFailure> {
        match self.answers {
            Some((Answers { is_written: false, .. }, _)) => Err(RecordedFailure),
            _ => Ok(()),
        }
    }
}

impl<const N: usize> DriveEnable<N> for Player<'_, N> {
    type Error = RecordedFailure;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), RecordedFailure> {
        self.told = Some(enabled);
        match self.answers {
            Some((Answers { told: Some((_, false)), .. }, _)) => Err(RecordedFailure),
            _ => Ok(()),
        }
    }
}
