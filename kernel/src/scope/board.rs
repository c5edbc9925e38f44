//! The background's side: ticks and what was handed to them, as bytes for the PC.
//!
//! Consumes the records of the ticks and the log of the background; produces the bodies of frames, which have to be read in
//! order. Where one is missing the PC asks for a snapshot, after which it goes on; where ticks are missing, because there was
//! no room for their records, a snapshot follows without being asked for.

use heapless::spsc::{Consumer, Queue};

use super::log::{Handed, Log};
use super::record::Recorder;
use super::ring::{Ring, TicksOut};
use super::snapshot::Snapshot;
use super::tick_record::TripCount;
use super::wire::{Expected, HANDED, TRIP, Writer};
use crate::fault::FaultKind;
use crate::hal::MachineInputs;
use crate::kernel::Kernel;
use crate::num::Real;
use crate::queue::{Intake, LiveFeeder};
use crate::trace::Trace;

/// The most bytes of a frame: what an urgent one waits for at most.
pub const BODY_MAX: usize = 256;

/// The first byte of a body: a piece of a snapshot, the last piece of one, ticks.
pub(super) const PIECE: u8 = 0;
pub(super) const LAST_PIECE: u8 = 1;
pub(super) const TICKS: u8 = 2;

/// Faults of the board that wait, and ticks that make a frame worth while.
const TRIPS: usize = 16;
const TICKS_WORTH: usize = 40;

/// The memory of a scope, for `RECORDS` − 1 ticks: as many as pass during a long poll of the background.
#[derive(Debug)]
pub struct ScopeMemory<R, const AXES: usize, const RECORDS: usize> {
    ticks: Ring<AXES, RECORDS>,
    trips: Queue<(u32, FaultKind<R>), TRIPS>,
    log: Log<AXES>,
}

impl<R: Real, const AXES: usize, const RECORDS: usize> ScopeMemory<R, AXES, RECORDS> {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { ticks: Ring::new(), trips: Queue::new(), log: Log::new() }
    }

    /// Its parts: for the tick, for the background, and for `feeder`, the background's end of the tick's streams.
    pub fn split<'a>(
        &'a mut self,
        feeder: &LiveFeeder<'a, R, AXES>,
    ) -> (Recorder<'a, R, AXES>, BoardScope<'a, R, AXES>, &'a mut Log<AXES>) {
        let (ticks_in, ticks) = self.ticks.split();
        let (trips_in, trips) = self.trips.split();
        (Recorder::new(ticks_in, trips_in, feeder.generation()), BoardScope::new(ticks, trips), &mut self.log)
    }
}

impl<R: Real, const AXES: usize, const RECORDS: usize> Default for ScopeMemory<R, AXES, RECORDS> {
    fn default() -> Self {
        Self::new()
    }
}

/// The background's side.
pub struct BoardScope<'a, R: Real, const AXES: usize> {
    ticks: TicksOut<'a, AXES>,
    trips: Consumer<'a, (u32, FaultKind<R>)>,
    /// What was asked for last, and is obeyed.
    obeyed: Option<(u32, u32)>,
    /// How many snapshots were taken, and frames sent of the present one.
    epoch: u32,
    number: u32,
    snapshot: Option<(Snapshot<R, AXES>, usize)>,
    is_snapshot_due: bool,
    /// The next tick, and what is expected of it.
    next: u32,
    expected: Expected<AXES>,
    /// Faults of the board before it that were sent.
    trips_sent: u8,
}

/// The body of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// How many snapshots were taken before its ticks.
    pub epoch: u32,
    /// Which frame behind the last of these it is, from 0.
    pub number: u32,
    /// How many bytes.
    pub length: usize,
}

impl<'a, R: Real, const AXES: usize> BoardScope<'a, R, AXES> {
    fn new(ticks: TicksOut<'a, AXES>, trips: Consumer<'a, (u32, FaultKind<R>)>) -> Self {
        Self {
            ticks,
            trips,
            obeyed: None,
            epoch: 0,
            number: 0,
            snapshot: None,
            is_snapshot_due: false,
            next: 0,
            expected: Expected::after([0; AXES], &MachineInputs::HEALTHY),
            trips_sent: 0,
        }
    }

    /// Obeys what is asked for: who asks, and after which epoch he needs another one. None switches the scope off.
    pub fn obey(&mut self, asked: Option<(u32, u32)>, log: &mut Log<AXES>) {
        if asked != self.obeyed {
            (self.obeyed, self.is_snapshot_due) = (asked, asked.is_some());
            log.is_on = asked.is_some();
            if asked.is_none() {
                self.snapshot = None;
                log.clear();
            }
        }
        if asked.is_none() {
            self.drop_ticks();
        }
    }

    /// Whether [`Self::take_snapshot`] is due.
    #[must_use]
    pub fn is_snapshot_due(&self, log: &Log<AXES>) -> bool {
        self.obeyed.is_some() && (self.is_snapshot_due || log.is_lost || self.ticks.is_missing())
    }

    /// Takes a snapshot, between two ticks. What was handed over before is part of it, but for the lists, which are to be
    /// [kept](crate::live::LiveControl::tell_lists) behind it.
    pub fn take_snapshot(
        &mut self,
        kernel: &Kernel<R, AXES>,
        intake: &Intake<'_, R, AXES>,
        recorder: &Recorder<'_, R, AXES>,
        log: &mut Log<AXES>,
    ) {
        log.clear();
        self.drop_ticks();
        let Trace { tick, axes, inputs, .. } = kernel.trace();
        let counts = axes.each_ref().map(|axis| axis.counts.0 as u32);
        self.expected = Expected::after(counts, inputs);
        self.next = (*tick as u32).wrapping_add(1);
        self.snapshot = Some((Snapshot::of(kernel, intake, recorder, log.begun), 0));
        (self.epoch, self.number) = (self.epoch.wrapping_add(1), 0);
        (self.is_snapshot_due, self.trips_sent) = (false, 0);
    }

    /// Drops all ticks that wait, and the faults before them.
    fn drop_ticks(&mut self) {
        self.ticks.clear();
        // Bounded: no tick brings more than a few.
        while self.trips.dequeue().is_some() {}
    }

    /// The first fault that the board has found before `tick` and that was not sent yet.
    fn trip_before(&mut self, tick: u32) -> Option<&FaultKind<R>> {
        while self.trips.peek().is_some_and(|(before, _)| before.wrapping_sub(tick).cast_signed() < 0) {
            self.trips.dequeue();
        }
        self.trips.peek().filter(|(before, _)| *before == tick).map(|(_, kind)| kind)
    }

    /// Writes the next body to `out`; none if there is nothing worth a frame.
    pub fn body(&mut self, log: &mut Log<AXES>, out: &mut [u8; BODY_MAX]) -> Option<Body> {
        self.obeyed?;
        let length = match &mut self.snapshot {
            Some((snapshot, offset)) => {
                let (kind, rest) = out.split_first_mut()?;
                let (length, is_last) = snapshot.piece(*offset, rest);
                *kind = if is_last { LAST_PIECE } else { PIECE };
                *offset += length;
                if is_last {
                    self.snapshot = None;
                }
                1 + length
            }
            None => self.write_ticks(log, out)?,
        };
        let body = Body { epoch: self.epoch, number: self.number, length };
        self.number = self.number.wrapping_add(1);
        Some(body)
    }

    /// Writes ticks, as many as there is room for; none if a snapshot is to come before, or if there are few.
    fn write_ticks(&mut self, log: &mut Log<AXES>, out: &mut [u8; BODY_MAX]) -> Option<usize> {
        if self.ticks.len() < TICKS_WORTH && !log.is_filling() {
            return None;
        }
        let mut out = Writer::new(out);
        out.push(TICKS);
        // Bounded by the room: each round writes or drops something.
        while !(log.is_lost || self.is_snapshot_due) {
            let Some(record) = self.ticks.first() else { break };
            if let Some(handed) = log.before(self.next, record.generation) {
                if !out.all(|out| write_handed(handed, out)) {
                    break;
                }
                log.pop();
                continue;
            }
            if let TripCount::New(count) = record.trips
                && self.trips_sent < count
            {
                // All of them came before the record.
                let Some(kind) = self.trip_before(self.next) else {
                    self.is_snapshot_due = true;
                    break;
                };
                if !out.all(|out| write_trip(kind, out)) {
                    break;
                }
                self.trips.dequeue();
                self.trips_sent += 1;
                continue;
            }
            let mut expected = self.expected;
            if !out.all(|out| expected = self.expected.write(&record, out)) {
                break;
            }
            (self.expected, self.next) = (expected, self.next.wrapping_add(1));
            self.ticks.drop_first();
            self.trips_sent = 0;
        }
        let length = out.count;
        (length > 1).then_some(length)
    }
}

fn write_trip<R: Real>(kind: &FaultKind<R>, out: &mut Writer<'_>) {
    out.push(TRIP);
    out.value(kind);
}

fn write_handed<const AXES: usize>(handed: &Handed<AXES>, out: &mut Writer<'_>) {
    out.push(HANDED);
    out.value(handed);
}
