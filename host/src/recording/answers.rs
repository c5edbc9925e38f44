//! What the hardware answered, tick by tick, and what the kernel made of it.
//!
//! Each tick is one entry in the postcard wire format: a byte of flags, for each axis by how many counts its
//! encoder moved since the tick before, and a byte of the digest of all ticks up to here; where the digital
//! inputs are not those of the tick before, a byte of them for each axis and one for the machine follow. A
//! replay that goes another way is found in the very tick, but for one chance in 256 in each of the ticks
//! that follow; the whole digest at the end leaves one in 2⁶⁴.

use motion_kernel::hal::{AxisInputs, MachineInputs, OutputState};
use motion_kernel::num::Scalar;
use motion_kernel::trace::{Digest, Trace};
use motion_kernel::units::Counts;
use serde::{Deserialize, Serialize};

use super::RecordingError;
use crate::gcode::AXES_MAX;

/// What the hardware answered in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answers<const N: usize = 3> {
    /// What the encoders read; none if they could not be read.
    pub counts: Option<[Counts; N]>,
    /// The digital inputs; none if they could not be read.
    pub inputs: Option<MachineInputs<N>>,
    /// Whether the converter took its codes.
    pub is_written: bool,
    /// Whether the drives were told to be enabled, if they were told, and whether they took it.
    pub told: Option<(bool, bool)>,
}

impl<const N: usize> Answers<N> {
    /// Before anything was asked.
    pub(super) const NONE: Self = Self { counts: None, inputs: None, is_written: true, told: None };
}

/// An entry of the recorded answers.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Entry<const N: usize> {
    flags: u8,
    /// Of every encoder since it was last read \[counts\]; 0 if it could not be.
    #[serde(with = "motion_kernel::array")]
    moved: [i64; N],
    check: u8,
}

/// No entry is longer: two bytes, and ten for a number of 64 bits.
const ENTRY_MAX: usize = 2 + 10 * AXES_MAX;

/// Bits of the flags.
const UNREAD: u8 = 1 << 0;
const UNWRITTEN: u8 = 1 << 1;
const TOLD: u8 = 1 << 2;
const TOLD_ENABLE: u8 = 1 << 3;
const TOLD_IN_VAIN: u8 = 1 << 4;
const INPUTS_UNREAD: u8 = 1 << 5;
const INPUTS_FOLLOW: u8 = 1 << 6;
const KNOWN: u8 = (1 << 7) - 1;

/// Bit of the machine's inputs.
const EMERGENCY_STOP: u8 = 1;

/// Appends inputs as they are kept: a byte for each axis, and one for the machine.
fn keep_inputs<const N: usize>(inputs: &MachineInputs<N>, bytes: &mut Vec<u8>) {
    bytes.extend(inputs.axes.map(AxisInputs::to_bits));
    bytes.push(if inputs.emergency_stop { EMERGENCY_STOP } else { 0 });
}

/// The inputs that `bytes` begin with, and what is behind them.
fn take_inputs<const N: usize>(bytes: &[u8]) -> Option<(MachineInputs<N>, &[u8])> {
    let (axes, bytes) = bytes.split_first_chunk::<N>()?;
    let (machine, bytes) = bytes.split_first()?;
    let axes = axes.map(AxisInputs::from_bits);
    Some((MachineInputs { axes, emergency_stop: machine & EMERGENCY_STOP != 0 }, bytes))
}

/// All ticks of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordedAnswers {
    pub(super) ticks: u64,
    /// Of all of them.
    pub(super) digest: u64,
    entries: Vec<u8>,
}

/// The digest of the ticks so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Checks(Digest);

impl Checks {
    /// Adds a tick: the byte that its entry keeps, of a product in which each bit of the digest has a part.
    pub(super) fn add<R: Scalar, const N: usize>(&mut self, trace: &Trace<R, N>) -> u8 {
        self.0.add(trace);
        (self.digest().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
    }

    /// Adds outputs that are switched before the next tick.
    pub(super) fn switch(&mut self, to: &OutputState) {
        self.0.switch(to);
    }

    pub(super) fn digest(&self) -> u64 {
        self.0.value()
    }
}

/// Recorded answers being written.
#[derive(Clone, Debug)]
pub(super) struct AnswerWriter<const N: usize> {
    recorded: RecordedAnswers,
    /// As read last.
    counts: [Counts; N],
    inputs: MachineInputs<N>,
}

impl<const N: usize> AnswerWriter<N> {
    /// From what the encoders read before the first tick.
    pub(super) fn new(start: [Counts; N]) -> Self {
        Self { recorded: RecordedAnswers::default(), counts: start, inputs: MachineInputs::HEALTHY }
    }

    pub(super) fn add(&mut self, answers: &Answers<N>, check: u8) {
        let mut moved = [0; N];
        let read = answers.counts.iter().flatten();
        for ((moved, before), now) in moved.iter_mut().zip(&mut self.counts).zip(read) {
            *moved = now.0.wrapping_sub(before.0);
            *before = *now;
        }
        let changed = answers.inputs.filter(|inputs| *inputs != self.inputs);
        let flag = |is_set: bool, flag: u8| if is_set { flag } else { 0 };
        let flags = flag(answers.counts.is_none(), UNREAD)
            | flag(!answers.is_written, UNWRITTEN)
            | flag(answers.told.is_some(), TOLD)
            | flag(answers.told.is_some_and(|(enable, _)| enable), TOLD_ENABLE)
            | flag(answers.told.is_some_and(|(_, is_taken)| !is_taken), TOLD_IN_VAIN)
            | flag(answers.inputs.is_none(), INPUTS_UNREAD)
            | flag(changed.is_some(), INPUTS_FOLLOW);
        const { assert!(N <= AXES_MAX, "no entry is longer") };
        let mut buffer = [0; ENTRY_MAX];
        let entry = postcard::to_slice(&Entry { flags, moved, check }, &mut buffer);
        self.recorded.entries.extend_from_slice(entry.expect("room for the longest"));
        if let Some(inputs) = changed {
            keep_inputs(&inputs, &mut self.recorded.entries);
            self.inputs = inputs;
        }
        self.recorded.ticks += 1;
    }

    /// All recorded answers; `digest` is that of all its ticks.
    pub(super) fn finish(self, digest: u64) -> RecordedAnswers {
        RecordedAnswers { digest, ..self.recorded }
    }
}

impl RecordedAnswers {
    /// Whether it holds as many entries as it says, and nothing else.
    pub(super) fn check<const N: usize>(&self) -> Result<(), RecordingError> {
        let mut reader = self.read([Counts(0); N]);
        while reader.next().is_some() {}
        if reader.ticks == self.ticks && reader.left.is_empty() {
            Ok(())
        } else {
            let found = format!("an entry is none behind tick {}, of {} ticks", reader.ticks, self.ticks);
            Err(RecordingError::Malformed(found))
        }
    }

    /// From the start.
    pub(super) fn read<const N: usize>(&self, start: [Counts; N]) -> AnswerReader<'_, N> {
        AnswerReader { left: &self.entries, counts: start, inputs: MachineInputs::HEALTHY, ticks: 0 }
    }
}

/// Recorded answers being read: the answers of each tick, and the check byte after them.
#[derive(Clone, Debug)]
pub(super) struct AnswerReader<'a, const N: usize> {
    left: &'a [u8],
    counts: [Counts; N],
    inputs: MachineInputs<N>,
    ticks: u64,
}

impl<const N: usize> Iterator for AnswerReader<'_, N> {
    type Item = (Answers<N>, u8);

    fn next(&mut self) -> Option<Self::Item> {
        let (Entry::<N> { flags, moved, check }, mut left) = postcard::take_from_bytes(self.left).ok()?;
        if flags & !KNOWN != 0 {
            return None;
        }
        if flags & INPUTS_FOLLOW != 0 {
            (self.inputs, left) = take_inputs(left)?;
        }
        self.left = left;
        self.ticks += 1;
        for (counts, moved) in self.counts.iter_mut().zip(moved) {
            counts.0 = counts.0.wrapping_add(moved);
        }
        let has = |flag: u8| flags & flag != 0;
        let answers = Answers {
            counts: (!has(UNREAD)).then_some(self.counts),
            inputs: (!has(INPUTS_UNREAD)).then_some(self.inputs),
            is_written: !has(UNWRITTEN),
            told: has(TOLD).then_some((has(TOLD_ENABLE), !has(TOLD_IN_VAIN))),
        };
        Some((answers, check))
    }
}
