//! The tick's side: what a tick consumed and what it put out, for the background.
//!
//! In the tick: some words are copied, without a loop but that over the axes, without failure. A tick for which there is no
//! room is left out whole; the numbers of the ticks tell so.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::Vec;
use heapless::spsc::Producer;

use super::ring::TicksIn;
use super::tick_record::{TickRecord, TripCount};
use crate::fault::FaultKind;
use crate::hal::{DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use crate::num::Real;
use crate::trace::Trace;
use crate::units::{Counts, DacCode};

/// What failed in a tick, a bit each.
pub(super) mod failed {
    pub(crate) const ENCODER: u8 = 1;
    pub(crate) const INPUTS: u8 = 1 << 1;
    pub(crate) const OUTPUT: u8 = 1 << 2;
    pub(crate) const ENABLE: u8 = 1 << 3;
    pub(crate) const ALL: u8 = (1 << 4) - 1;
}

/// The most faults that a board finds by itself before one tick.
pub(super) const TRIPS_MAX: usize = 4;

/// Faults that a board found before a tick.
pub(super) type Trips<R> = Vec<FaultKind<R>, TRIPS_MAX>;

/// A check of all ticks so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Check(u32);

impl Check {
    /// Adds a tick: its state, counts, set positions and codes; the byte that both ends compare. Every step is a
    /// bijection, so that a tick that differs in a word is found, but for one chance in 256 in each of the ticks that follow.
    pub(super) fn add<const AXES: usize>(&mut self, record: &TickRecord<AXES>) -> u8 {
        let TickRecord { counts, set, codes, state, .. } = record;
        self.word(u32::from(*state));
        for ((counts, set), DacCode(code)) in counts.iter().zip(set).zip(codes) {
            self.word(*counts);
            self.word(*set);
            self.word(u32::from(code.cast_unsigned()));
        }
        // Each bit has a part in the uppermost ones.
        (self.0.wrapping_mul(0x9E37_79B1) >> 24) as u8
    }

    fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ word).rotate_left(13).wrapping_mul(0x0100_0193);
    }
}

/// The tick's end of a scope.
pub struct Recorder<'a, R, const AXES: usize> {
    ticks: TicksIn<'a, AXES>,
    /// The number of the words that the background has written.
    generation: &'a AtomicU32,
    /// Each with the number of the tick that it came before.
    trips: Producer<'a, (u32, FaultKind<R>)>,
    /// Before the tick to come, and before the last one.
    tripped: Trips<R>,
    before: Trips<R>,
    is_overfull: bool,
    /// One of them is not as at the beginning.
    has_tripped: bool,
}

impl<'a, R: Real, const AXES: usize> Recorder<'a, R, AXES> {
    pub(super) fn new(
        ticks: TicksIn<'a, AXES>,
        trips: Producer<'a, (u32, FaultKind<R>)>,
        generation: &'a AtomicU32,
    ) -> Self {
        let (tripped, before) = (Vec::new(), Vec::new());
        Self { ticks, generation, trips, tripped, before, is_overfull: false, has_tripped: false }
    }

    /// What the board had found before the last tick.
    pub(super) fn trips(&self) -> [Option<FaultKind<R>>; TRIPS_MAX] {
        let mut kinds = self.before.iter().copied();
        [(); TRIPS_MAX].map(|()| kinds.next())
    }

    /// Notes a fault that the board has told the kernel before a tick.
    #[cold]
    pub fn trip(&mut self, kind: FaultKind<R>) {
        self.is_overfull |= self.tripped.push(kind).is_err();
        self.has_tripped = true;
    }

    /// Notes a tick that has just come to its end.
    #[inline]
    pub fn tick(&mut self, trace: &Trace<R, AXES>, failures: Failures) {
        let mut trips = 0;
        if self.has_tripped {
            let Some(noted) = self.note_trips(trace.tick as u32) else { return self.ticks.leave_out() };
            trips = noted;
        }
        // What there is no room for is missing.
        // What the tick saw: the background has had no turn since.
        let generation = self.generation.load(Ordering::Relaxed);
        self.ticks.enter(trace, generation, failures.0, trips);
    }

    /// Hands on what the board has found before a tick; none if there is no room for it.
    #[cold]
    fn note_trips(&mut self, tick: u32) -> Option<u8> {
        let is_same = self.tripped == self.before;
        let tripped = core::mem::take(&mut self.tripped);
        let is_overfull = core::mem::take(&mut self.is_overfull);
        let mut count = TripCount::SAME;
        if !is_same {
            count = tripped.len() as u8;
            // Without all of them the tick is left out, and who reads begins anew.
            self.before.clear();
            for &kind in &tripped {
                enter(&mut self.trips, (tick, kind)).ok()?;
            }
        }
        self.has_tripped = !tripped.is_empty();
        self.before = tripped;
        (!is_overfull).then_some(count)
    }
}

/// Enters an item, or gives it back. The queue divides by its number of places: a compiler that does not know that it is not 0
/// links a panic.
#[inline]
fn enter<T>(queue: &mut Producer<'_, T>, item: T) -> Result<(), T> {
    if queue.capacity() == usize::MAX { Err(item) } else { queue.enqueue(item) }
}

/// What failed in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Failures(u8);

/// Hardware that notes what fails in a tick.
pub struct Noting<'h, H> {
    hal: &'h mut H,
    failures: Failures,
}

impl<'h, H> Noting<'h, H> {
    /// Of `hal`, before a tick.
    #[inline]
    pub fn new(hal: &'h mut H) -> Self {
        Self { hal, failures: Failures(0) }
    }

    /// What failed.
    #[inline]
    pub fn failures(&self) -> Failures {
        self.failures
    }

    #[inline]
    fn note<T, E>(&mut self, result: Result<T, E>, bit: u8) -> Result<T, E> {
        if result.is_err() {
            self.failures.0 |= bit;
        }
        result
    }
}

impl<H: Encoder<AXES>, const AXES: usize> Encoder<AXES> for Noting<'_, H> {
    type Error = H::Error;

    #[inline]
    fn latch(&mut self) -> Result<[Counts; AXES], H::Error> {
        let latched = self.hal.latch();
        self.note(latched, failed::ENCODER)
    }
}

impl<H: Inputs<AXES>, const AXES: usize> Inputs<AXES> for Noting<'_, H> {
    type Error = H::Error;

    #[inline]
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, H::Error> {
        let read = self.hal.read_inputs();
        self.note(read, failed::INPUTS)
    }
}

impl<H: VelocityChannel<AXES>, const AXES: usize> VelocityChannel<AXES> for Noting<'_, H> {
    type Error = H::Error;

    #[inline]
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), H::Error> {
        let written = self.hal.write(codes);
        self.note(written, failed::OUTPUT)
    }
}

impl<H: DriveEnable<AXES>, const AXES: usize> DriveEnable<AXES> for Noting<'_, H> {
    type Error = H::Error;

    #[inline]
    fn set_enabled(&mut self, enabled: bool) -> Result<(), H::Error> {
        let taken = self.hal.set_enabled(enabled);
        self.note(taken, failed::ENABLE)
    }
}

/// Hardware that answers as it was noted.
pub(super) struct Answers<const AXES: usize> {
    pub(super) counts: [Counts; AXES],
    pub(super) inputs: MachineInputs<AXES>,
    pub(super) failures: u8,
}

/// As noted.
pub(super) struct Failed;

impl<const AXES: usize> Answers<AXES> {
    fn unless<T>(&self, bit: u8, answer: T) -> Result<T, Failed> {
        if self.failures & bit == 0 { Ok(answer) } else { Err(Failed) }
    }
}

impl<const AXES: usize> Encoder<AXES> for Answers<AXES> {
    type Error = Failed;

    fn latch(&mut self) -> Result<[Counts; AXES], Failed> {
        self.unless(failed::ENCODER, self.counts)
    }
}

impl<const AXES: usize> Inputs<AXES> for Answers<AXES> {
    type Error = Failed;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Failed> {
        self.unless(failed::INPUTS, self.inputs)
    }
}

impl<const AXES: usize> VelocityChannel<AXES> for Answers<AXES> {
    type Error = Failed;

    fn write(&mut self, _: &[DacCode; AXES]) -> Result<(), Failed> {
        self.unless(failed::OUTPUT, ())
    }
}

impl<const AXES: usize> DriveEnable<AXES> for Answers<AXES> {
    type Error = Failed;

    fn set_enabled(&mut self, _: bool) -> Result<(), Failed> {
        self.unless(failed::ENABLE, ())
    }
}
