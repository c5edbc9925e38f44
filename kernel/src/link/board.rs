//! The board's end.
//!
//! Consumes bytes from the PC; produces [`Controls`] and the items of the program, which live control takes from the
//! [`ItemQueue`]; answers with what has come and with the machine's status. Background.

use core::convert::Infallible;
use core::task::Poll;

use heapless::Deque;

use super::frame::{Deframer, FRAME_MAX, Payload};
use super::message::{Controls, Identity, Mode, Piece, Reply, Request, Status, Taken, Welcome, WriteError};
use super::parameters::ParameterBuffer;
use crate::program::compact::Decoder;
use crate::program::{Item, Source, take};

/// An answer that was lost is repeated after this time \[ms\].
const REPEAT_MS: u32 = 50;

/// Items that have come, in order, with room for `ITEMS`. The source of live control.
#[derive(Debug)]
pub struct ItemQueue<const AXES: usize, const ITEMS: usize> {
    /// None for the end of a program.
    entries: Deque<Option<Item<AXES>>, ITEMS>,
    /// The number of the next item to come.
    next: u32,
    /// How many programs were given up before this one.
    aborts: u16,
    /// The end of the program has come.
    is_ended: bool,
    /// What the next item is read with.
    decoder: Decoder<AXES>,
}

impl<const AXES: usize, const ITEMS: usize> ItemQueue<AXES, ITEMS> {
    /// Before the first item.
    #[must_use]
    pub const fn new() -> Self {
        Self { entries: Deque::new(), next: 0, aborts: 0, is_ended: false, decoder: Decoder::new() }
    }

    /// Drops what is left of a program that was given up, if it is not the one after `aborts`; whether it is not.
    fn begin(&mut self, aborts: u16) -> bool {
        let is_new = core::mem::replace(&mut self.aborts, aborts) != aborts;
        if is_new {
            self.entries.clear();
            (self.next, self.is_ended, self.decoder) = (0, false, Decoder::new());
        }
        is_new
    }

    /// What has come of the program.
    #[must_use]
    pub fn came(&self) -> Came {
        Came { aborts: self.aborts, taken: self.taken(), is_ended: self.is_ended }
    }

    /// The number of the first item that was not taken from here.
    #[must_use]
    pub fn taken(&self) -> u32 {
        self.next.wrapping_sub(self.entries.len() as u32)
    }

    /// The number of the next item to come.
    #[must_use]
    pub const fn next(&self) -> u32 {
        self.next
    }

    /// The number of the first item that there is no room for.
    fn limit(&self) -> u32 {
        self.next.wrapping_add((ITEMS - self.entries.len()) as u32)
    }
}

impl<const AXES: usize, const ITEMS: usize> Default for ItemQueue<AXES, ITEMS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const AXES: usize, const ITEMS: usize> Source<AXES> for ItemQueue<AXES, ITEMS> {
    type Error = Infallible;

    /// Pending at the end of a program, too: another may follow.
    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, Infallible>>> {
        match self.entries.pop_front() {
            Some(Some(item)) => Poll::Ready(Some(Ok(item))),
            Some(None) | None => Poll::Pending,
        }
    }
}

/// What has come of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Came {
    /// How many programs were given up before it.
    pub aborts: u16,
    /// The number of the first item that was not taken into the streams.
    pub taken: u32,
    /// Its end has come.
    pub is_ended: bool,
}

/// The board's end of the link.
#[derive(Debug)]
pub struct BoardLink {
    session: u32,
    identity: Identity,
    deframer: Deframer,
    /// Items, or parameters, wait in the deframer.
    has_items: bool,
    has_parameters: bool,
    /// The byte from which on the parameters are asked for.
    read_from: Option<u32>,
    is_written_due: bool,
    /// The row of the flight recorder that is asked for.
    flight_row: Option<u16>,
    /// Who wants the scope, and after which snapshot he needs another one.
    scope: Option<(u32, u32)>,
    controls: Controls,
    /// They were not taken yet; how many aborts were.
    is_changed: bool,
    taken_aborts: u16,
    /// The number of the last hello.
    asker: u32,
    is_welcome_due: bool,
    is_taken_due: bool,
    is_missing: bool,
    is_unreadable: bool,
    /// What was said last about items, and when.
    said: Taken,
    said_ms: u32,
    /// The last frame was about items: a status that waits comes before the next one.
    is_status_next: bool,
    /// Who asked last has said something since the last frame was written; when that was, and whether it is too long ago.
    is_heard: bool,
    heard_ms: u32,
    is_silent: bool,
}

impl BoardLink {
    /// A board that has just started; `session` must not be that of a start before.
    #[must_use]
    pub const fn new(session: u32, identity: Identity) -> Self {
        let said = Taken {
            session,
            asker: 0,
            aborts: 0,
            controls: 0,
            next: 0,
            limit: 0,
            is_missing: false,
            is_unreadable: false,
        };
        Self {
            session,
            identity,
            deframer: Deframer::new(),
            has_items: false,
            has_parameters: false,
            read_from: None,
            is_written_due: false,
            flight_row: None,
            scope: None,
            controls: Controls::NONE,
            is_changed: false,
            taken_aborts: 0,
            asker: 0,
            is_welcome_due: false,
            is_taken_due: false,
            is_missing: false,
            is_unreadable: false,
            said,
            said_ms: 0,
            is_status_next: false,
            is_heard: false,
            heard_ms: 0,
            is_silent: false,
        }
    }

    /// Says again who it is.
    #[cfg(test)]
    pub(super) fn is_welcome_due_again(&mut self) {
        self.is_welcome_due = true;
    }

    /// Number of frames that came damaged.
    #[must_use]
    pub const fn damaged(&self) -> u32 {
        self.deframer.damaged()
    }

    /// Takes what came in, up to the first items that are to be [put](Self::put_items) away, and no more than two frames at a
    /// time. Controls are known at once.
    pub fn receive(&mut self, bytes: &mut impl Iterator<Item = u8>) {
        for _ in 0..2 * FRAME_MAX {
            if self.has_items || self.has_parameters {
                break;
            }
            let Some(byte) = bytes.next() else { break };
            if self.deframer.push(byte) {
                self.read();
            }
        }
    }

    /// [`Self::receive`] where there is no time to put items away: they are dropped, and come again.
    pub fn receive_controls(&mut self, bytes: &mut impl Iterator<Item = u8>) {
        self.drop_items();
        self.receive(bytes);
        self.drop_items();
    }

    fn drop_items(&mut self) {
        // They come again.
        self.has_parameters = false;
        if core::mem::take(&mut self.has_items) {
            (self.is_missing, self.is_taken_due) = (true, true);
        }
    }

    /// Reads the message that has come.
    fn read(&mut self) {
        // What has the right checksum and can't be read is of another protocol: a hello will tell.
        let Some((request, _)) = take::<Request>(self.deframer.payload()) else { return };
        match request {
            Request::Hello { asker } => {
                if asker != self.asker {
                    self.scope = None;
                    if self.controls.dead_man_ms > 0 {
                        // Who held the key is not there any more. The other one adopts the hold.
                        (self.controls.mode, self.is_changed) = (Mode::Hold, true);
                    }
                }
                (self.asker, self.is_welcome_due) = (asker, true);
            }
            // Of another start, or of somebody who was replaced: the answer tells.
            Request::Controls { session, asker, .. }
            | Request::Items { session, asker, .. }
            | Request::Read { session, asker, .. }
            | Request::Write { session, asker, .. }
            | Request::Scope { session, asker, .. }
            | Request::Flight { session, asker, .. }
                if (session, asker) != (self.session, self.asker) =>
            {
                self.is_welcome_due = true;
            }
            Request::Controls { controls, .. } => {
                self.is_heard = true;
                if controls.is_newer_than(&self.controls) && controls.are_within_range() {
                    (self.controls, self.is_changed) = (controls, true);
                }
                self.is_taken_due = true;
            }
            Request::Items { aborts, .. } if aborts != self.controls.aborts => {
                // Of a program that was given up, or of one that is known only with controls that are still to come.
                (self.is_missing, self.is_taken_due) = (true, true);
            }
            Request::Items { .. } => self.has_items = true,
            Request::Read { offset, .. } => self.read_from = Some(offset),
            Request::Write { .. } => self.has_parameters = true,
            Request::Scope { asker, after, .. } => self.scope = after.map(|after| (asker, after)),
            Request::Flight { row, .. } => self.flight_row = Some(row),
        }
    }

    /// Who wants the scope, and after which snapshot he needs another one; see
    /// [`BoardScope::obey`](crate::scope::BoardScope::obey).
    #[must_use]
    pub const fn scope(&self) -> Option<(u32, u32)> {
        self.scope
    }

    /// The row of the flight recorder that is asked for, from 0, until it was answered.
    #[must_use]
    pub const fn flight_row(&self) -> Option<u16> {
        self.flight_row
    }

    /// Writes a row of the flight recorder to `out`, of `rows`, as [`Self::transmit`] does about all else. `frame` is
    /// that of [`FlightRow::to_frame`](crate::flight::FlightRow::to_frame), or empty where there is no such row.
    pub fn transmit_flight(&mut self, rows: u16, frame: &[u8], out: &mut [u8]) -> usize {
        let Some(row) = self.flight_row.take() else { return 0 };
        let Some(mut payload) = Payload::of(&Reply::<1>::Flight { session: self.session, row, rows }) else {
            return 0;
        };
        // There is room for nine axes.
        if payload.push_all(frame.iter().copied()) { payload.frame(out) } else { 0 }
    }

    /// Writes a frame of the scope to `out`, as [`Self::transmit`] does about all else.
    pub fn transmit_scope(&self, (epoch, number): (u32, u32), body: &[u8], out: &mut [u8]) -> usize {
        let reply = Reply::<1>::Scope { session: self.session, epoch, number };
        let Some(mut payload) = Payload::of(&reply) else { return 0 };
        if payload.push_all(body.iter().copied()) { payload.frame(out) } else { 0 }
    }

    /// Puts away the items that came last; false if none did.
    pub fn put_items<const AXES: usize, const ITEMS: usize>(
        &mut self,
        items: &mut ItemQueue<AXES, ITEMS>,
    ) -> bool {
        if items.begin(self.controls.aborts) {
            self.is_unreadable = false;
        }
        if !core::mem::take(&mut self.has_items) {
            return false;
        }
        let Some((Request::Items { first, is_last, .. }, bytes)) = take::<Request>(self.deframer.payload())
        else {
            return false;
        };
        self.is_taken_due = true;
        let known = items.next.wrapping_sub(first).cast_signed();
        self.is_missing = known < 0;
        // Items are read from the next one on. Where some are known already the PC learns so, and begins there.
        if known == 0 && !self.is_unreadable {
            self.is_unreadable = !put(bytes, is_last, items);
        }
        true
    }

    /// Puts away the bytes of new parameters that came last; false if none did. They are refused unless the drives are off.
    pub fn put_parameters<const BYTES: usize>(
        &mut self,
        buffer: &mut ParameterBuffer<BYTES>,
        is_off: bool,
    ) -> bool {
        if !core::mem::take(&mut self.has_parameters) {
            return false;
        }
        if let Some((Request::Write { record, offset, .. }, bytes)) = take::<Request>(self.deframer.payload())
        {
            buffer.put(record, offset, bytes, is_off);
            self.is_written_due = true;
        }
        true
    }

    /// The new parameters were refused after they had come: says so.
    pub fn refuse_parameters<const BYTES: usize>(
        &mut self,
        buffer: &mut ParameterBuffer<BYTES>,
        error: WriteError,
    ) {
        buffer.refuse(error);
        self.is_written_due = true;
    }

    /// Writes the next frame about parameters to `out`, as [`Self::transmit`] does about all else: `parameters` are the
    /// present ones.
    pub fn transmit_parameters<const BYTES: usize>(
        &mut self,
        parameters: &[u8],
        buffer: &ParameterBuffer<BYTES>,
        out: &mut [u8],
    ) -> usize {
        let session = self.session;
        if core::mem::take(&mut self.is_written_due) {
            let (record, bytes, error) = buffer.written();
            let reply = Reply::<1>::Written { session, record, bytes, error };
            return Payload::of(&reply).map_or(0, |payload| payload.frame(out));
        }
        let Some(offset) = self.read_from.take() else { return 0 };
        let reply = Reply::<1>::Parameters { session, offset, length: parameters.len() as u32 };
        let piece = Piece::of(parameters.get(offset as usize..).unwrap_or_default());
        let Some(mut payload) = Payload::of(&reply) else { return 0 };
        // There is room for a piece.
        if payload.push_all(piece.bytes().iter().copied()) { payload.frame(out) } else { 0 }
    }

    /// Whether controls have come that ask motion to come to rest, and were not taken yet.
    #[must_use]
    pub fn is_stop_asked(&self) -> bool {
        let Controls { mode, override_permille, aborts, .. } = self.controls;
        self.is_changed && (mode == Mode::Hold || override_permille == 0 || aborts != self.taken_aborts)
    }

    /// Whether motion is to be held because who asked last says nothing any more, for the time that the controls tell.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.controls.dead_man_ms > 0 && self.is_silent && !self.is_heard
    }

    /// The controls, if they have changed since they were taken last.
    pub fn take_controls(&mut self) -> Option<Controls> {
        self.taken_aborts = self.controls.aborts;
        core::mem::take(&mut self.is_changed).then_some(self.controls)
    }

    /// Writes the next frame to `out`, which needs [`FRAME_MAX`] bytes, at the time `now_ms`, which may wrap; returns its
    /// length, 0 if there is nothing to say. A `status` is said if nothing else is, and in turn with the answers to items.
    pub fn transmit<const AXES: usize, const ITEMS: usize>(
        &mut self,
        now_ms: u32,
        items: &ItemQueue<AXES, ITEMS>,
        status: Option<Status<AXES>>,
        out: &mut [u8],
    ) -> usize {
        if core::mem::take(&mut self.is_heard) {
            (self.heard_ms, self.is_silent) = (now_ms, false);
        }
        self.is_silent |= now_ms.wrapping_sub(self.heard_ms) >= u32::from(self.controls.dead_man_ms);
        let (session, identity) = (self.session, self.identity);
        let reply = if core::mem::take(&mut self.is_welcome_due) {
            // What was said before may have been said to somebody else.
            self.is_taken_due = true;
            let reply = Reply::<1>::Welcome { session, asker: self.asker, build: identity.build };
            return Payload::of(&reply)
                .and_then(|payload| payload.then(&Welcome { identity, controls: self.controls }))
                .map_or(0, |payload| payload.frame(out));
        } else {
            let taken = Taken {
                session,
                asker: self.asker,
                aborts: items.aborts,
                controls: self.controls.number,
                next: items.next,
                limit: items.limit(),
                is_missing: self.is_missing,
                is_unreadable: self.is_unreadable,
            };
            let is_late = now_ms.wrapping_sub(self.said_ms) >= REPEAT_MS;
            let is_due = self.is_taken_due || taken != self.said || is_late;
            if is_due && !(self.is_status_next && status.is_some()) {
                self.is_status_next = true;
                (self.is_taken_due, self.is_missing) = (false, false);
                (self.said, self.said_ms) = (Taken { is_missing: false, ..taken }, now_ms);
                Reply::Taken(taken)
            } else if let Some(status) = status {
                self.is_status_next = false;
                Reply::Status { session, status }
            } else {
                return 0;
            }
        };
        Payload::of(&reply).map_or(0, |payload| payload.frame(out))
    }
}

/// Puts items into the queue, and the program's end, as far as there is room; false where one can't be read.
fn put<const AXES: usize, const ITEMS: usize>(
    mut bytes: &[u8],
    is_last: bool,
    items: &mut ItemQueue<AXES, ITEMS>,
) -> bool {
    // Bounded: an item has a byte at least.
    loop {
        // What there is no room for comes again.
        if items.entries.is_full() || bytes.is_empty() && !is_last {
            return true;
        }
        let entry = match bytes {
            [] => None,
            _ => {
                let Some((item, rest)) = items.decoder.take(bytes) else { return false };
                bytes = rest;
                Some(item)
            }
        };
        // There is room.
        let _ = items.entries.push_back(entry);
        (items.next, items.is_ended) = (items.next.wrapping_add(1), entry.is_none());
        if entry.is_none() {
            return true;
        }
    }
}
