//! The PC's end.
//!
//! Consumes the items of a program and the operator's commands; produces bytes for the board, and again what got lost;
//! consumes its answers and produces [`Event`]s. Keeps the items that the board has not confirmed, in places of its own.

use heapless::Deque;

use super::frame::{Deframer, PAYLOAD_MAX, Payload};
use super::message::{
    Build, Controls, Identity, Mode, Piece, Record, Reply, Request, Status, Taken, Welcome, WriteError,
};
use crate::flight::FlightRow;
use crate::program::compact::Encoder;
use crate::program::{Checksum, Item, take};

/// What was not answered is said again after this time \[ms\].
const REPEAT_MS: u32 = 100;
/// And at the latest after this time, however slow the wire is \[ms\].
const REPEAT_MAX_MS: u32 = 2000;
/// Controls are said again after this time until they are confirmed \[ms\].
const CONTROLS_MS: u32 = 20;
/// Items are sent again at once where the board says that some are missing, but not more often than this \[ms\].
const AGAIN_MS: u32 = 10;

/// No more items are sent while more than this is not confirmed \[bytes\]: what a hold has to wait for on a slow wire, and
/// enough to keep it busy while an answer comes.
const UNDER_WAY_MAX: usize = PAYLOAD_MAX;

/// What the board says.
// There is no heap to put the bytes on.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<const AXES: usize> {
    /// It is there.
    Welcome(Identity),
    /// It is there, and speaks another protocol or has other messages. Nothing is sent to it.
    Foreign(Build),
    /// It is there, and has another number of axes. Nothing is sent to it.
    Refused(Identity),
    /// It takes items: those of [`Controls::program`], after a greeting, or of the program that was begun or none, after
    /// another one was given up.
    Ready {
        /// The number in the program of the next item that it expects: not 0 if another run of the PC's side has begun it.
        next: u32,
    },
    /// It has started anew, and knows nothing of the items before: [`HostLink::accept`] goes on with it.
    Restarted {
        /// The number of the first item that it had not confirmed.
        confirmed: u32,
    },
    /// Somebody else has asked it since, and has it now. Nothing more is sent.
    Replaced,
    /// What the machine does.
    Status(Status<AXES>),
    /// Bytes of its parameters that were [asked for](HostLink::read_parameters).
    Parameters {
        /// The first one's place.
        offset: u32,
        /// How many there are altogether.
        length: u32,
        /// The bytes.
        piece: Piece,
    },
    /// It has so many bytes of new parameters, or does not take them. Once it has all of them and finds them good, it starts
    /// anew.
    Written {
        /// Bytes.
        bytes: u32,
        /// Why they are not taken.
        error: Option<WriteError>,
    },
    /// A frame of the scope, in order; see [`HostLink::set_scope`].
    Scope {
        /// The first one of a snapshot: those after the one before it are missing.
        is_first: bool,
        /// What [`Replay::take`](crate::scope::Replay::take) takes.
        body: Piece,
    },
    /// A row of its flight recorder, which was [asked for](HostLink::read_flight).
    Flight {
        /// Its number.
        row: u16,
        /// How many there are.
        rows: u16,
        /// The row; none where there is no such row.
        kept: Option<FlightRow<f64, AXES>>,
    },
    /// It can't read an item. Nothing more is sent.
    Unreadable {
        /// The item's number.
        item: u32,
    },
}

/// How far the two ends know each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Session {
    /// Nothing is known of the board.
    Unknown,
    /// The board is known, and what it has is not.
    Greeted(u32),
    /// Items may be sent.
    Ready(u32),
    /// It is another one now; the caller has to begin anew.
    Lost(u32),
    /// Somebody else has it.
    Replaced,
}

/// What is asked for until it is answered.
// There is no heap to put the bytes on.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ask {
    Read { offset: u32 },
    Write { record: Record, offset: u32, piece: Piece },
    Flight { row: u16 },
}

/// The scope as far as it has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ScopeStream {
    /// The snapshot under way, and the number of the frame that is to come next.
    epoch: u32,
    next: u32,
    /// A frame is missing: nothing behind it is of use.
    is_lost: bool,
}

/// The PC's end of the link to a board of `AXES` axes, with room for `ITEMS` items in `BYTES` bytes that are not confirmed.
#[derive(Debug)]
pub struct HostLink<const AXES: usize, const ITEMS: usize, const BYTES: usize> {
    deframer: Deframer,
    session: Session,
    /// The number of the present hello, and of the first: an answer to one before is old.
    asker: u32,
    first_asker: u32,
    controls: Controls,
    /// The number of the controls that the board has confirmed.
    confirmed_controls: u32,
    /// The items that are not confirmed: their bytes, and the length of each; the end of a program has none.
    bytes: Deque<u8, BYTES>,
    lengths: Deque<u16, ITEMS>,
    /// What items are written with, and the number of the next one it writes.
    encoder: Encoder<AXES>,
    encoded: u32,
    /// The number of the first of them, of the next to be sent, and of the first that the board has no room for.
    first: u32,
    next: u32,
    limit: u32,
    /// The board can't read the first of them.
    is_unreadable: bool,
    /// A board says that it is another one than before.
    is_asking: bool,
    ask: Option<Ask>,
    /// What the scope has come to, if it is on; and what is to be asked for it, at which time it was last.
    scope: Option<ScopeStream>,
    is_scope_asked: bool,
    scope_ms: Option<u32>,
    /// The number of the hello after which it was.
    scope_asker: u32,
    /// Counts the parameters written: answers about those before are old.
    attempt: u32,
    hello_ms: Option<u32>,
    controls_ms: Option<u32>,
    ask_ms: Option<u32>,
    /// When something was confirmed last, or sent while nothing was under way; and after what time it is sent again: a slow
    /// wire has no room for repeats that come too early.
    progress_ms: u32,
    repeat_ms: u32,
    again_ms: u32,
}

impl<const AXES: usize, const ITEMS: usize, const BYTES: usize> HostLink<AXES, ITEMS, BYTES> {
    /// Before the first byte; `asker` is a number that other starts of the PC's side do not have, such as the time.
    #[must_use]
    pub const fn new(asker: u32) -> Self {
        Self {
            deframer: Deframer::new(),
            session: Session::Unknown,
            asker,
            first_asker: asker,
            controls: Controls::NONE,
            confirmed_controls: 0,
            bytes: Deque::new(),
            lengths: Deque::new(),
            encoder: Encoder::new(),
            encoded: 0,
            first: 0,
            next: 0,
            limit: 0,
            is_unreadable: false,
            is_asking: false,
            ask: None,
            scope: None,
            is_scope_asked: false,
            scope_ms: None,
            scope_asker: asker,
            attempt: asker,
            hello_ms: None,
            controls_ms: None,
            ask_ms: None,
            progress_ms: 0,
            repeat_ms: REPEAT_MS,
            again_ms: 0,
        }
    }

    /// The operator's controls as they are now.
    #[must_use]
    pub const fn controls(&self) -> &Controls {
        &self.controls
    }

    /// Changes the operator's controls. False, and nothing is changed, before the board has answered: what it obeys is not
    /// known yet.
    #[must_use]
    pub fn control(&mut self, change: impl FnOnce(&mut Controls)) -> bool {
        if !matches!(self.session, Session::Greeted(_) | Session::Ready(_)) {
            return false;
        }
        let number = self.controls.number.wrapping_add(1);
        change(&mut self.controls);
        (self.controls.number, self.controls_ms) = (number, None);
        true
    }

    /// Presses a mode, a resume or a hold; see [`Self::control`].
    #[must_use]
    pub fn press(&mut self, mode: Mode) -> bool {
        self.control(|controls| (controls.mode, controls.presses) = (mode, controls.presses.wrapping_add(1)))
    }

    /// Gives up the rest of the program: all items that were pushed and not driven. [`Event::Ready`] tells that another
    /// one may follow, which is driven only after another resume. See [`Self::control`].
    #[must_use]
    pub fn abort(&mut self) -> bool {
        self.give_up(0, |_| {})
    }

    /// Begins `program`, a name that is not 0, whose items are to be pushed after [`Event::Ready`]; what there was before is
    /// given up. See [`Self::abort`].
    #[must_use]
    pub fn begin(&mut self, program: u32) -> bool {
        self.give_up(program, |_| {})
    }

    /// Enables the drives where the machine stands, or disables them; what there was before is given up. See
    /// [`Self::abort`].
    #[must_use]
    pub fn enable(&mut self, is_enabled: bool) -> bool {
        self.give_up(0, |controls| {
            (controls.is_enabled, controls.power_presses) =
                (is_enabled, controls.power_presses.wrapping_add(1));
        })
    }

    /// Has `axes` homed, the lowest bit is the first one's, one after the other; what there was before is given up. A hold or an
    /// abort ends it, and a silence of `dead_man_ms`. See [`Self::abort`].
    #[must_use]
    pub fn home(&mut self, axes: u16, dead_man_ms: u16) -> bool {
        self.give_up(0, |controls| {
            (controls.mode, controls.presses) = (Mode::Run, controls.presses.wrapping_add(1));
            (controls.home_axes, controls.homings) = (axes, controls.homings.wrapping_add(1));
            controls.dead_man_ms = dead_man_ms;
        })
    }

    /// Clears the board's fault. See [`Self::control`].
    #[must_use]
    pub fn clear_fault(&mut self) -> bool {
        self.control(|controls| controls.fault_resets = controls.fault_resets.wrapping_add(1))
    }

    fn give_up(&mut self, program: u32, change: impl FnOnce(&mut Controls)) -> bool {
        let is_taken = self.control(|controls| {
            (controls.mode, controls.aborts) = (Mode::Hold, controls.aborts.wrapping_add(1));
            (controls.program, controls.dead_man_ms) = (program, 0);
            change(controls);
        });
        if is_taken {
            self.drop_items();
            if let Session::Ready(session) = self.session {
                self.session = Session::Greeted(session);
            }
        }
        is_taken
    }

    fn drop_items(&mut self) {
        (self.encoder, self.encoded) = (Encoder::new(), 0);
        self.bytes.clear();
        self.lengths.clear();
        self.is_unreadable = false;
    }

    /// The number of the board's start, once it has answered.
    #[must_use]
    pub const fn session(&self) -> Option<u32> {
        match self.session {
            Session::Greeted(session) | Session::Ready(session) => Some(session),
            Session::Unknown | Session::Lost(_) | Session::Replaced => None,
        }
    }

    /// Whether the board has confirmed the controls.
    #[must_use]
    pub const fn is_controlled(&self) -> bool {
        self.confirmed_controls == self.controls.number
    }

    /// The number of the first item that the board has not confirmed.
    #[must_use]
    pub const fn confirmed(&self) -> u32 {
        self.first
    }

    /// The number in the program of the next item to be pushed; `None` while the board takes none.
    #[must_use]
    pub fn next(&self) -> Option<u32> {
        let is_ready = matches!(self.session, Session::Ready(_));
        is_ready.then(|| self.first.wrapping_add(self.lengths.len() as u32))
    }

    /// Number of items that the board has not confirmed.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.lengths.len()
    }

    /// Number of frames that came damaged.
    #[must_use]
    pub const fn damaged(&self) -> u32 {
        self.deframer.damaged()
    }

    /// Goes on with a board that has started anew, without the items that it had not confirmed before.
    pub fn accept(&mut self) {
        if let Session::Lost(session) = self.session {
            self.session = Session::Greeted(session);
        }
    }

    /// An item that the board has already, of a program that another run of the PC's side has begun: those before
    /// [`HostLink::next`], all of them and in their order.
    pub fn skip(&mut self, item: &Item<AXES>) {
        // One that is too long for a frame was never sent.
        let _ = self.encoder.encode(item, &mut [0; PAYLOAD_MAX]);
        self.encoded = self.encoded.wrapping_add(1);
    }

    /// Takes the next item of a program, or its end. False if there is no room for it now, or the board does not take any
    /// yet.
    ///
    /// # Errors
    /// It is longer than a frame, or items before it were not [skipped](HostLink::skip).
    pub fn push(&mut self, item: Option<&Item<AXES>>) -> Result<bool, PushError> {
        let Some(next) = self.next() else { return Ok(false) };
        if next != self.encoded {
            return Err(PushError::Skipped { expected: self.encoded, found: next });
        }
        // A frame has room for the message before it.
        let mut entry = [0; PAYLOAD_MAX - HEAD_MAX];
        let (mut encoder, mut length) = (self.encoder, 0);
        if let Some(item) = item {
            length = encoder.encode(item, &mut entry).ok_or(PushError::Long)?;
        }
        if self.lengths.is_full() || BYTES - self.bytes.len() < length {
            return Ok(false);
        }
        // Both have room.
        let _ = self.lengths.push_back(length as u16);
        self.bytes.extend(entry.iter().copied().take(length));
        (self.encoder, self.encoded) = (encoder, next.wrapping_add(1));
        Ok(true)
    }

    /// Asks for the board's parameters from byte `offset` on, until [`Event::Parameters`] comes.
    pub fn read_parameters(&mut self, offset: u32) {
        (self.ask, self.ask_ms) = (Some(Ask::Read { offset }), None);
    }

    /// Writes new parameters, which are a [compiled program](crate::program::write) without items: a piece of them from byte
    /// `offset` on, until [`Event::Written`] comes.
    pub fn write_parameters(&mut self, parameters: &[u8], offset: u32) {
        if offset == 0 {
            self.attempt = self.attempt.wrapping_add(1);
        }
        let (length, sum) = (parameters.len() as u32, Checksum::of(parameters));
        let record = Record { length, sum, attempt: self.attempt };
        let piece = Piece::of(parameters.get(offset as usize..).unwrap_or_default());
        (self.ask, self.ask_ms) = (Some(Ask::Write { record, offset, piece }), None);
    }

    /// Asks for a row of the flight recorder, from 0, until [`Event::Flight`] comes.
    pub fn read_flight(&mut self, row: u16) {
        (self.ask, self.ask_ms) = (Some(Ask::Flight { row }), None);
    }

    /// Switches the scope on, or off. Its frames come as [`Event::Scope`]s; where one is missing, a snapshot is asked for.
    pub fn set_scope(&mut self, is_on: bool) {
        let was_on = core::mem::replace(&mut self.scope, is_on.then(ScopeStream::default)).is_some();
        (self.is_scope_asked, self.scope_ms) = (is_on || was_on, None);
    }

    /// Asks for another snapshot.
    pub fn renew_scope(&mut self) {
        if let Some(scope) = &mut self.scope {
            scope.is_lost = true;
            (self.is_scope_asked, self.scope_ms) = (true, None);
        }
    }

    /// Takes a frame of the scope; whether it follows what came before, and whether it is the first of a snapshot.
    fn take_scope(&mut self, epoch: u32, number: u32) -> Option<bool> {
        let scope = self.scope.as_mut()?;
        let is_first = number == 0 && epoch != scope.epoch;
        if is_first || epoch == scope.epoch && number == scope.next && !scope.is_lost {
            *scope = ScopeStream { epoch, next: number.wrapping_add(1), is_lost: false };
            self.is_scope_asked &= !is_first;
            return Some(is_first);
        }
        if epoch != scope.epoch || !scope.is_lost {
            *scope = ScopeStream { epoch, next: 0, is_lost: true };
            (self.is_scope_asked, self.scope_ms) = (true, None);
        }
        None
    }

    /// Takes what came in at the time `now_ms`, which may wrap.
    pub fn receive(&mut self, bytes: &[u8], now_ms: u32, on_event: &mut impl FnMut(Event<AXES>)) {
        for &byte in bytes {
            if !self.deframer.push(byte) {
                continue;
            }
            let Some((reply, rest)) = take::<Reply<AXES>>(self.deframer.payload()) else { continue };
            match reply {
                Reply::Parameters { session, offset, length } if self.is_of(session) => {
                    let piece = Piece::of(rest);
                    if self.ask == Some(Ask::Read { offset }) {
                        self.ask = None;
                        on_event(Event::Parameters { offset, length, piece });
                    }
                }
                Reply::Written { session, record, bytes, error } if self.is_of(session) => {
                    if let Some(Ask::Write { record: asked, offset, piece }) = self.ask
                        && asked == record
                        && (error.is_some() || bytes > offset || piece.bytes().is_empty())
                    {
                        self.ask = None;
                        on_event(Event::Written { bytes, error });
                    }
                }
                Reply::Scope { session, epoch, number } if self.is_of(session) => {
                    let body = Piece::of(rest);
                    if let Some(is_first) = self.take_scope(epoch, number) {
                        on_event(Event::Scope { is_first, body });
                    }
                }
                Reply::Flight { session, row, rows } if self.is_of(session) => {
                    if self.ask == Some(Ask::Flight { row }) {
                        let kept = FlightRow::from_frame(rest).ok();
                        if kept.is_some() || rest.is_empty() {
                            self.ask = None;
                            on_event(Event::Flight { row, rows, kept });
                        }
                    }
                }
                Reply::Parameters { .. }
                | Reply::Written { .. }
                | Reply::Scope { .. }
                | Reply::Flight { .. } => {}
                Reply::Welcome { session, asker, build } => {
                    let welcome = if Build::THIS.understands(&build) { take::<Welcome>(rest) } else { None };
                    if asker == self.asker {
                        if let Some((welcome, [])) = welcome {
                            self.greeted(session, &welcome, on_event);
                        } else if !Build::THIS.understands(&build) {
                            self.not_greeted();
                            on_event(Event::Foreign(build));
                        }
                    } else if self.is_of(session) {
                        let is_own =
                            asker.wrapping_sub(self.first_asker) <= self.asker.wrapping_sub(self.first_asker);
                        if !is_own {
                            self.session = Session::Replaced;
                            self.drop_items();
                            on_event(Event::Replaced);
                        }
                    } else if ![Session::Unknown, Session::Replaced].contains(&self.session) {
                        // Old, or of a board that has started anew: ask.
                        self.asker = self.asker.wrapping_add(1);
                        self.is_asking = true;
                    }
                }
                _ if !rest.is_empty() => {}
                Reply::Taken(taken) => self.taken(&taken, now_ms, on_event),
                Reply::Status { session, status } if self.is_of(session) => on_event(Event::Status(status)),
                Reply::Status { .. } => {}
            }
        }
    }

    /// Whether a message is of the board's present session.
    fn is_of(&self, session: u32) -> bool {
        match self.session {
            Session::Greeted(known) | Session::Ready(known) => known == session,
            Session::Unknown | Session::Lost(_) | Session::Replaced => false,
        }
    }

    /// The board is none for this end. Asked again, as seldom as one that does not answer.
    fn not_greeted(&mut self) {
        (self.is_asking, self.session) = (false, Session::Unknown);
    }

    fn greeted(
        &mut self,
        session: u32,
        &Welcome { identity, controls }: &Welcome,
        on_event: &mut impl FnMut(Event<AXES>),
    ) {
        self.is_asking = false;
        // The board forgets who asked before.
        if self.scope.is_some() && self.scope_asker != self.asker {
            self.set_scope(true);
        }
        if self.is_of(session) || [Session::Lost(session), Session::Replaced].contains(&self.session) {
            return;
        }
        if usize::from(identity.axes) != AXES {
            self.not_greeted();
            return on_event(Event::Refused(identity));
        }
        // What was pressed before is no command for this board: only what is pressed from now on.
        (self.controls, self.confirmed_controls) = (controls, controls.number);
        on_event(Event::Welcome(identity));
        if self.scope.is_some() {
            self.set_scope(true);
        }
        if self.session == Session::Unknown {
            self.session = Session::Greeted(session);
            return;
        }
        let confirmed = self.first;
        self.session = Session::Lost(session);
        self.drop_items();
        on_event(Event::Restarted { confirmed });
    }

    fn taken(&mut self, taken: &Taken, now_ms: u32, on_event: &mut impl FnMut(Event<AXES>)) {
        if !self.is_of(taken.session) || taken.asker != self.asker {
            return;
        }
        self.confirmed_controls = taken.controls;
        // Of a program that was given up.
        if taken.aborts != self.controls.aborts {
            return;
        }
        if let Session::Greeted(session) = self.session {
            self.session = Session::Ready(session);
            (self.first, self.next, self.limit) = (taken.next, taken.next, taken.limit);
            return on_event(Event::Ready { next: taken.next });
        }
        let confirmed = taken.next.wrapping_sub(self.first);
        // An answer that was overtaken by a later one, or that is of items that were never sent.
        if confirmed as usize > self.lengths.len() {
            return;
        }
        for _ in 0..confirmed {
            let length = self.lengths.pop_front().unwrap_or_default();
            for _ in 0..length {
                self.bytes.pop_front();
            }
        }
        self.first = taken.next;
        if is_before(self.next, self.first) {
            self.next = self.first;
        }
        // Room never gets less.
        if is_before(self.limit, taken.limit) {
            self.limit = taken.limit;
        }
        if confirmed > 0 {
            let took_ms = now_ms.wrapping_sub(self.progress_ms);
            self.repeat_ms = took_ms.saturating_mul(3).clamp(REPEAT_MS, REPEAT_MAX_MS);
            self.progress_ms = now_ms;
        }
        if taken.is_missing && now_ms.wrapping_sub(self.again_ms) >= AGAIN_MS {
            (self.next, self.again_ms, self.progress_ms) = (self.first, now_ms, now_ms);
        }
        if taken.is_unreadable && !core::mem::replace(&mut self.is_unreadable, true) {
            on_event(Event::Unreadable { item: self.first });
        }
    }

    /// Writes the next frame to `out`, which needs [`FRAME_MAX`](super::FRAME_MAX) bytes, at the time `now_ms`; returns its
    /// length, 0 if there is nothing to say.
    pub fn transmit(&mut self, now_ms: u32, out: &mut [u8]) -> usize {
        let is_due = |since_ms: Option<u32>, after_ms: u32| {
            since_ms.is_none_or(|since_ms| now_ms.wrapping_sub(since_ms) >= after_ms)
        };
        if (self.session == Session::Unknown || self.is_asking) && is_due(self.hello_ms, REPEAT_MS) {
            self.hello_ms = Some(now_ms);
            return frame(&Request::Hello { asker: self.asker }, out);
        }
        let (session, is_ready) = match self.session {
            Session::Unknown | Session::Lost(_) | Session::Replaced => return 0,
            Session::Greeted(session) => (session, false),
            Session::Ready(session) => (session, true),
        };
        // Urgent before everything else. What is confirmed is said again, too: the board answers, so both ends know that
        // the other one is there.
        let after_ms = if self.is_controlled() { REPEAT_MS } else { CONTROLS_MS };
        if is_due(self.controls_ms, after_ms) {
            self.controls_ms = Some(now_ms);
            return frame(&Request::Controls { session, asker: self.asker, controls: self.controls }, out);
        }
        if let Some(ask) = self.ask
            && is_due(self.ask_ms, REPEAT_MS)
        {
            self.ask_ms = Some(now_ms);
            return match ask {
                Ask::Flight { row } => frame(&Request::Flight { session, asker: self.asker, row }, out),
                Ask::Read { offset } => frame(&Request::Read { session, asker: self.asker, offset }, out),
                Ask::Write { record, offset, piece } => {
                    let request = Request::Write { session, asker: self.asker, record, offset };
                    let Some(mut payload) = Payload::of(&request) else {
                        return 0;
                    };
                    // There is room for a piece.
                    if payload.push_all(piece.bytes().iter().copied()) { payload.frame(out) } else { 0 }
                }
            };
        }
        if self.is_scope_asked && is_due(self.scope_ms, REPEAT_MS) {
            // Off is said once: what comes in spite of it is not taken.
            (self.scope_ms, self.is_scope_asked) = (Some(now_ms), self.scope.is_some());
            self.scope_asker = self.asker;
            let after = self.scope.map(|scope| scope.epoch);
            return frame(&Request::Scope { session, asker: self.asker, after }, out);
        }
        if is_ready { self.items(session, now_ms, out) } else { 0 }
    }

    /// A frame of as many items as it has room for.
    fn items(&mut self, session: u32, now_ms: u32, out: &mut [u8]) -> usize {
        if self.is_unreadable {
            return 0;
        }
        let under_way = self.next.wrapping_sub(self.first);
        if under_way == 0 {
            self.progress_ms = now_ms;
        } else if now_ms.wrapping_sub(self.progress_ms) >= self.repeat_ms {
            (self.next, self.progress_ms) = (self.first, now_ms);
            self.repeat_ms = (2 * self.repeat_ms).min(REPEAT_MAX_MS);
        }
        let sent = self.next.wrapping_sub(self.first) as usize;
        let skipped: usize = self.lengths.iter().take(sent).map(|&length| usize::from(length)).sum();
        if skipped > UNDER_WAY_MAX {
            return 0;
        }
        let (mut count, mut length, mut is_last) = (0, 0, false);
        for &of_entry in self.lengths.iter().skip(sent) {
            let of_entry = usize::from(of_entry);
            let has_room = length + of_entry <= PAYLOAD_MAX - HEAD_MAX;
            if is_last || !is_before(self.next.wrapping_add(count), self.limit) || !has_room {
                break;
            }
            (count, length, is_last) = (count + 1, length + of_entry, of_entry == 0);
        }
        if count == 0 {
            return 0;
        }
        let (asker, aborts, first) = (self.asker, self.controls.aborts, self.next);
        let Some(mut payload) = Payload::of(&Request::Items { session, asker, aborts, first, is_last })
        else {
            return 0;
        };
        if !payload.push_all(self.bytes.iter().copied().skip(skipped).take(length)) {
            return 0;
        }
        self.next = self.next.wrapping_add(count);
        payload.frame(out)
    }
}

/// Why an item can't be pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PushError {
    /// It is longer than a frame.
    Long,
    /// It is not the one behind those that were pushed or skipped.
    Skipped {
        /// Number of the item that would follow these.
        expected: u32,
        /// Number of the item that the board expects.
        found: u32,
    },
}

impl core::fmt::Display for PushError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Long => f.write_str("an item is longer than a frame"),
            Self::Skipped { expected, found } => {
                write!(f, "item {found} is next, expected {expected}: items before it were not skipped")
            }
        }
    }
}

impl core::error::Error for PushError {}

/// The longest message before items \[bytes\]: a variant, four numbers and a flag.
const HEAD_MAX: usize = 20;

/// Whether a number comes before another one. They wrap.
fn is_before(number: u32, other: u32) -> bool {
    number.wrapping_sub(other).cast_signed() < 0
}

fn frame(request: &Request, out: &mut [u8]) -> usize {
    Payload::of(request).map_or(0, |payload| payload.frame(out))
}
