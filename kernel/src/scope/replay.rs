//! The PC's side: every tick once more.
//!
//! Consumes the bodies of frames in their order, and the program's items; produces the trace of every tick, compared with what
//! the board's tick put out. What is missing is named.

use heapless::Vec;

use super::board::{LAST_PIECE, PIECE, TICKS};
use super::log::{Begun, Command, Handed};
use super::record::{Answers, Trips};
use super::snapshot::Snapshot;
use super::tick_record::{TickRecord, TripCount};
use super::wire::{Bytes, Consumed, Expected, HANDED, TRIP};
use crate::axis::AxesConfig;
use crate::fault::FaultKind;
use crate::hal::MachineInputs;
use crate::kernel::Kernel;
use crate::live::ListItem;
use crate::num::Real;
use crate::program::supply::Ready;
use crate::program::{Header, Item};
use crate::queue::{Change, Intake, IntakeState, LISTS, LiveFeeder, LiveStreams, PathItem};
use crate::trace::Trace;
use crate::units::{Counts, Position};

/// Room for a snapshot of nine axes in fixed point \[bytes\].
const SNAPSHOT_MAX: usize = 12 * 1024;

/// What is told of the ticks.
#[derive(Debug)]
pub enum Told<'t, R, const AXES: usize> {
    /// A tick, as the board's was.
    Tick(&'t Trace<R, AXES>),
    /// These ticks are missing.
    Gap {
        /// The first one.
        first: u64,
        /// The last one.
        last: u64,
    },
    /// Motion follows items that are not known: nothing can be told until there is another snapshot.
    UnknownItems,
}

/// Why ticks can't be run again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReplayError {
    /// A tick came to something else than the board's.
    Difference {
        /// The tick.
        tick: u64,
    },
    /// What came is none of this protocol, or of another machine.
    Malformed {
        /// The last tick before it, if there was one.
        after: Option<u64>,
    },
}

impl core::fmt::Display for ReplayError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Difference { tick } => {
                write!(
                    f,
                    "tick {tick} run again differs from the board's: expected the same outputs and positions"
                )
            }
            Self::Malformed { after: Some(tick) } => {
                write!(f, "found no tick behind tick {tick}, expected what a board of this version sends")
            }
            Self::Malformed { after: None } => {
                f.write_str("found no snapshot, expected what a board of this version sends")
            }
        }
    }
}

impl core::error::Error for ReplayError {}

/// Finds an item of a program: of the one after so many aborts, the one with this number. None inside for a program's end; none
/// outside if it is not known.
pub type Items<'i, const AXES: usize> = dyn FnMut(u16, u32) -> Option<Option<Item<AXES>>> + 'i;

/// How far the replay knows the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Not at all: until a snapshot comes.
    Lost,
    /// Pieces of a snapshot are coming.
    Collecting,
    /// Behind a snapshot, or a tick.
    Following,
}

/// A kernel that does what the board's did.
pub struct Replay<'a, R: Real, const AXES: usize> {
    kernel: Kernel<R, AXES>,
    feeder: LiveFeeder<'a, R, AXES>,
    intake: Intake<'a, R, AXES>,
    tick_s: f64,
    stage: Stage,
    snapshot: Vec<u8, SNAPSHOT_MAX>,
    /// The intake as of the snapshot.
    at: IntakeState,
    begun: Begun,
    /// The number of the next item of the program that is to be looked at.
    next_item: u32,
    expected: Expected<AXES>,
    /// Faults that the board found before the tick to come, and before the last one.
    tripped: Trips<R>,
    trips: Trips<R>,
    /// The last tick that was told, or named as missing.
    last: Option<u64>,
}

impl<'a, R: Real, const AXES: usize> Replay<'a, R, AXES> {
    /// Of a board with these axes, for whose machine `header` was made, in `streams` of its own.
    pub fn new<const PIECES: usize, const SEGMENTS: usize>(
        axes: &AxesConfig<R, AXES>,
        header: &Header<AXES>,
        streams: &'a mut LiveStreams<R, AXES, PIECES, SEGMENTS>,
    ) -> Self {
        let (feeder, intake) = streams.split(header.rules, header.start);
        Self {
            kernel: Kernel::new(axes, header.start, [Counts(0); AXES]),
            at: intake.state(),
            feeder,
            intake,
            tick_s: header.tick_s,
            stage: Stage::Lost,
            snapshot: Vec::new(),
            begun: Begun::default(),
            next_item: 0,
            expected: Expected::after([0; AXES], &MachineInputs::HEALTHY),
            tripped: Vec::new(),
            trips: Vec::new(),
            last: None,
        }
    }

    /// Takes the body of a frame; `is_first` behind a gap, or at the beginning. Bodies behind an error are ignored up to the
    /// next first one.
    ///
    /// # Errors
    /// See [`ReplayError`].
    pub fn take(
        &mut self,
        is_first: bool,
        body: &[u8],
        items: &mut Items<'_, AXES>,
        on_told: &mut dyn FnMut(Told<'_, R, AXES>),
    ) -> Result<(), ReplayError> {
        if is_first {
            self.stage = Stage::Collecting;
            self.snapshot.clear();
        }
        if self.stage == Stage::Lost {
            return Ok(());
        }
        let taken = self.take_body(body, items, on_told);
        if taken.is_err() {
            self.stage = Stage::Lost;
        }
        taken
    }

    fn malformed(&self) -> ReplayError {
        ReplayError::Malformed { after: self.last }
    }

    fn take_body(
        &mut self,
        body: &[u8],
        items: &mut Items<'_, AXES>,
        on_told: &mut dyn FnMut(Told<'_, R, AXES>),
    ) -> Result<(), ReplayError> {
        match (self.stage, body.split_first()) {
            (Stage::Collecting, Some((&kind @ (PIECE | LAST_PIECE), piece))) => {
                self.snapshot.extend_from_slice(piece).map_err(|_| self.malformed())?;
                if kind == LAST_PIECE {
                    self.begin(items, on_told)?;
                }
                Ok(())
            }
            (Stage::Following, Some((&TICKS, ticks))) => self.take_ticks(Bytes(ticks), items, on_told),
            _ => Err(self.malformed()),
        }
    }

    /// Goes on from the snapshot that has come.
    fn begin(
        &mut self,
        items: &mut Items<'_, AXES>,
        on_told: &mut dyn FnMut(Told<'_, R, AXES>),
    ) -> Result<(), ReplayError> {
        let snapshot: Snapshot<R, AXES> =
            postcard::from_bytes(&self.snapshot).map_err(|_| self.malformed())?;
        let Snapshot { kernel, intake, begun, trips } = snapshot;
        let Trace { tick, axes, inputs, .. } = &kernel.trace;
        if let Some(last) = self.last
            && last < *tick
        {
            on_told(Told::Gap { first: last + 1, last: *tick });
        }
        self.last = Some(*tick);
        let counts = axes.each_ref().map(|axis| axis.counts.0 as u32);
        self.expected = Expected::after(counts, inputs);
        self.kernel.restore(&kernel);
        self.restart([Position::ZERO; AXES], begun);
        self.intake.go_to(&intake);
        self.feeder.set_words(intake.change, intake.owned);
        self.at = intake;
        self.tripped.clear();
        self.trips = trips.into_iter().flatten().collect();
        self.stage = Stage::Following;
        if begun.is_own {
            self.lose_items(on_told);
            return Ok(());
        }
        // What the board's tick has passed already.
        for _ in 0..intake.path_taken.wrapping_sub(begun.path_entered) {
            if self.next_path_item(items)?.is_none() {
                if !self.kernel.is_between_stretches() {
                    self.lose_items(on_told);
                }
                break;
            }
        }
        Ok(())
    }

    /// The items that motion follows are not known.
    fn lose_items(&mut self, on_told: &mut dyn FnMut(Told<'_, R, AXES>)) {
        self.stage = Stage::Lost;
        on_told(Told::UnknownItems);
    }

    /// Begins with empty streams.
    fn restart(&mut self, position: [Position; AXES], begun: Begun) {
        // Both are ends of the same streams.
        let _ = self.feeder.restart(&mut self.intake, position);
        (self.begun, self.next_item) = (begun, begun.first);
    }

    /// The next item of path, if it is known.
    fn next_path_item(
        &mut self,
        items: &mut Items<'_, AXES>,
    ) -> Result<Option<PathItem<R, AXES>>, ReplayError> {
        // Bounded by the program.
        while let Some(item) = items(self.begun.aborts, self.next_item) {
            self.next_item = self.next_item.wrapping_add(1);
            let Some(item @ (Item::Line { .. } | Item::Septic { .. } | Item::EndOfStretch(_))) = item else {
                continue;
            };
            match item.ready::<R, core::convert::Infallible>(self.tick_s) {
                Ok(Ready::Piece(piece)) => return Ok(Some(PathItem::Piece(piece))),
                Ok(Ready::EndOfStretch(end)) => return Ok(Some(PathItem::EndOfStretch(end))),
                // The board did not take it either: nothing behind it is driven.
                Err(_) => return Ok(None),
                Ok(_) => {}
            }
        }
        Ok(None)
    }

    /// Fills the path, which the board's tick always has as far as it needs it.
    fn fill(&mut self, items: &mut Items<'_, AXES>) -> Result<(), ReplayError> {
        while self.feeder.has_path_room() {
            let Some(item) = self.next_path_item(items)? else { break };
            self.feeder.enter_again(item);
        }
        Ok(())
    }

    fn take_ticks(
        &mut self,
        mut bytes: Bytes<'_>,
        items: &mut Items<'_, AXES>,
        on_told: &mut dyn FnMut(Told<'_, R, AXES>),
    ) -> Result<(), ReplayError> {
        while self.stage == Stage::Following
            && let Some(flags) = bytes.next()
        {
            match flags {
                HANDED => {
                    let handed = bytes.value().ok_or_else(|| self.malformed())?;
                    self.hand(&handed)?;
                    if matches!(handed, Handed::Restart { program: Begun { is_own: true, .. }, .. }) {
                        self.lose_items(on_told);
                    }
                }
                TRIP => {
                    let kind: FaultKind<R> = bytes.value().ok_or_else(|| self.malformed())?;
                    self.tripped.push(kind).map_err(|_| self.malformed())?;
                }
                flags => {
                    let read = self.expected.read(flags, &mut bytes);
                    let consumed = read.ok_or_else(|| self.malformed())?;
                    self.fill(items)?;
                    self.tick(&consumed, on_told)?;
                }
            }
        }
        Ok(())
    }

    /// Does what the board's background did.
    fn hand(&mut self, handed: &Handed<AXES>) -> Result<(), ReplayError> {
        match *handed {
            Handed::Begin { list }
            | Handed::Item { list, .. }
            | Handed::Kept { list, .. }
            | Handed::GiveUp { list }
                if list >= LISTS =>
            {
                return Err(self.malformed());
            }
            Handed::Begin { list } => {
                // The board's tick has emptied it.
                self.intake.clear_list(list);
                self.feeder.own_again(list, true);
            }
            Handed::Item { list, ref item } => self.append(list, item)?,
            Handed::Kept { list, ref item } => self.keep(list, item)?,
            Handed::Change(word) => self.feeder.ask_again(word),
            Handed::GiveUp { list } => self.feeder.own_again(list, false),
            Handed::Restart { position, program } => self.restart(position, program),
            Handed::Command(command) => self.command(command),
        }
        Ok(())
    }

    fn command(&mut self, command: Command) {
        match command {
            Command::Enable { settle_ticks } => self.kernel.enable(settle_ticks),
            Command::StandHere => {
                self.kernel.stand_here();
            }
            Command::RestHere => {
                self.kernel.rest_here();
            }
            Command::ClearFault => {
                self.kernel.clear_fault();
            }
            Command::Resume => self.kernel.resume(),
            Command::Reference { axis, counts, position } => {
                self.kernel.reference(axis.into(), counts, position);
            }
        }
    }

    fn append(&mut self, list: u8, item: &ListItem) -> Result<(), ReplayError> {
        // What the number type does not hold the board did not take either, nor what there was no room for: it gives that
        // list up.
        if let Ok(item) = item.ready(self.tick_s) {
            self.feeder.append_again(list, item);
        }
        Ok(())
    }

    /// Appends an item of the list under way at the snapshot, if it was not done, or of the list that follows.
    fn keep(&mut self, list: u8, item: &ListItem) -> Result<(), ReplayError> {
        if list == self.at.list {
            if self.at.done > 0 {
                self.at.done -= 1;
                return Ok(());
            }
        } else if Change::from_word(self.at.change).is_none_or(|change| change.to != list) {
            return Ok(());
        }
        self.append(list, item)
    }

    fn tick(
        &mut self,
        consumed: &Consumed<AXES>,
        on_told: &mut dyn FnMut(Told<'_, R, AXES>),
    ) -> Result<(), ReplayError> {
        match consumed.trips {
            TripCount::None => self.trips.clear(),
            TripCount::Same => {}
            TripCount::New(_) => self.trips = core::mem::take(&mut self.tripped),
        }
        for &kind in &self.trips {
            self.kernel.trip(kind);
        }
        let mut counts = self.kernel.trace().axes.each_ref().map(|axis| axis.counts);
        for (counts, read) in counts.iter_mut().zip(consumed.counts) {
            let moved = read.wrapping_sub(counts.0 as u32).cast_signed();
            counts.0 = counts.0.wrapping_add(i64::from(moved));
        }
        let inputs = MachineInputs { axes: consumed.inputs, emergency_stop: consumed.is_stopped };
        let mut answers = Answers { counts, inputs, failures: consumed.failures };
        let trace = self.kernel.tick(&mut self.intake, &mut answers);
        let record = TickRecord::of(trace);
        let (tick, agrees) = (trace.tick, self.expected.agrees(&record, consumed.check));
        if self.intake.path().is_none() && !self.kernel.is_between_stretches() {
            // The board's tick always has the piece that it is on.
            self.lose_items(on_told);
            return Ok(());
        }
        if !agrees {
            return Err(ReplayError::Difference { tick });
        }
        self.last = Some(tick);
        on_told(Told::Tick(self.kernel.trace()));
        Ok(())
    }
}
