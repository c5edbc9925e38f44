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
use crate::trace::AXES;

/// What the hardware answered in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answers {
    /// What the encoders read; none if they could not be read.
    pub counts: Option<[Counts; AXES]>,
    /// The digital inputs; none if they could not be read.
    pub inputs: Option<MachineInputs<AXES>>,
    /// Whether the converter took its codes.
    pub is_written: bool,
    /// Whether the drives were told to be enabled, if they were told, and whether they took it.
    pub told: Option<(bool, bool)>,
}

impl Answers {
    /// Before anything was asked.
    pub(super) const NONE: Self = Self { counts: None, inputs: None, is_written: true, told: None };
}

/// An entry of the recorded answers.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Entry {
    flags: u8,
    /// Of every encoder since it was last read \[counts\]; 0 if it could not be.
    moved: [i64; AXES],
    check: u8,
}

/// No entry is longer: two bytes, and ten for a number of 64 bits.
const ENTRY_MAX: usize = 2 + 10 * AXES;

/// Bits of the flags.
const UNREAD: u8 = 1 << 0;
const UNWRITTEN: u8 = 1 << 1;
const TOLD: u8 = 1 << 2;
const TOLD_ENABLE: u8 = 1 << 3;
const TOLD_IN_VAIN: u8 = 1 << 4;
const INPUTS_UNREAD: u8 = 1 << 5;
const INPUTS_FOLLOW: u8 = 1 << 6;
const KNOWN: u8 = (1 << 7) - 1;

/// Inputs as they are kept: a byte for each axis, and one for the machine.
type InputBytes = [u8; AXES + 1];
const EMERGENCY_STOP: u8 = 1;

fn input_bytes(inputs: &MachineInputs<AXES>) -> InputBytes {
    let [x, y, z] = inputs.axes.map(AxisInputs::to_bits);
    [x, y, z, if inputs.emergency_stop { EMERGENCY_STOP } else { 0 }]
}

fn inputs_of(&[x, y, z, machine]: &InputBytes) -> MachineInputs<AXES> {
    let axes = [x, y, z].map(AxisInputs::from_bits);
    MachineInputs { axes, emergency_stop: machine & EMERGENCY_STOP != 0 }
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
    pub(super) fn add<R: Scalar>(&mut self, trace: &Trace<R, AXES>) -> u8 {
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
pub(super) struct AnswerWriter {
    recorded: RecordedAnswers,
    /// As read last.
    counts: [Counts; AXES],
    inputs: MachineInputs<AXES>,
}

impl AnswerWriter {
    /// From what the encoders read before the first tick.
    pub(super) fn new(start: [Counts; AXES]) -> Self {
        Self { recorded: RecordedAnswers::default(), counts: start, inputs: MachineInputs::HEALTHY }
    }

    pub(super) fn add(&mut self, answers: &Answers, check: u8) {
        let mut moved = [0; AXES];
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
        let mut buffer = [0; ENTRY_MAX];
        let entry = postcard::to_slice(&Entry { flags, moved, check }, &mut buffer);
        self.recorded.entries.extend_from_slice(entry.expect("room for the longest"));
        if let Some(inputs) = changed {
            self.recorded.entries.extend_from_slice(&input_bytes(&inputs));
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
    pub(super) fn check(&self) -> Result<(), RecordingError> {
        let mut reader = self.read([Counts(0); AXES]);
        while reader.next().is_some() {}
        if reader.ticks == self.ticks && reader.left.is_empty() {
            Ok(())
        } else {
            let found = format!("an entry is none behind tick {}, of {} ticks", reader.ticks, self.ticks);
            Err(RecordingError::Malformed(found))
        }
    }

    /// From the start.
    pub(super) fn read(&self, start: [Counts; AXES]) -> AnswerReader<'_> {
        AnswerReader { left: &self.entries, counts: start, inputs: MachineInputs::HEALTHY, ticks: 0 }
    }
}

/// Recorded answers being read: the answers of each tick, and the check byte after them.
#[derive(Clone, Debug)]
pub(super) struct AnswerReader<'a> {
    left: &'a [u8],
    counts: [Counts; AXES],
    inputs: MachineInputs<AXES>,
    ticks: u64,
}

impl Iterator for AnswerReader<'_> {
    type Item = (Answers, u8);

    fn next(&mut self) -> Option<Self::Item> {
        let (Entry { flags, moved, check }, mut left) = postcard::take_from_bytes(self.left).ok()?;
        if flags & !KNOWN != 0 {
            return None;
        }
        if flags & INPUTS_FOLLOW != 0 {
            let (bytes, behind) = left.split_first_chunk()?;
            (self.inputs, left) = (inputs_of(bytes), behind);
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
