//! The link to a board, over a wire that may break and come back.

use std::io;
use std::time::{Duration, Instant};

use motion_kernel::link::{Build, Controls, Event, FRAME_MAX, HostLink, Identity, Mode, PushError, Status};
use motion_kernel::program::Item;

use super::error::BoardError;
use super::numbers::Numbers;
use super::scope::{Scope, ScopeSummary};
use super::wire::Wire;

/// Items that wait for a board's confirmation, and their bytes.
const ITEMS: usize = 256;
const BYTES: usize = 64 * 1024;
/// The longest time for a board's first answer.
pub(super) const ANSWER: Duration = Duration::from_secs(10);
/// A broken wire is opened again after this time.
const REOPEN_AFTER: Duration = Duration::from_millis(500);
/// A board that has answered does so ten times a second and more: after this time it is not there.
const SILENT_AFTER: Duration = Duration::from_secs(3);
/// Where motion follows items that nobody here has sent, it is looked again after this time whether it has ended.
const LOOK_AFTER: Duration = Duration::from_millis(500);

/// What is heard of a board.
// As the link's events, which it hands on.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum Heard<const N: usize> {
    /// What the board's end of the link says.
    Board(Event<N>),
    /// The wire is broken, or nothing comes any more. What the board has is driven to its end; then it comes to rest on the
    /// path. It is told to hold as soon as the wire is back.
    Lost(String),
    /// The wire is back.
    Back,
}

/// Opens a wire anew.
pub type Open = Box<dyn FnMut() -> io::Result<Box<dyn Wire>> + Send>;

/// The link to a board of `N` axes.
pub struct Connection<const N: usize> {
    link: Box<HostLink<N, ITEMS, BYTES>>,
    open: Open,
    wire: Option<Box<dyn Wire>>,
    begin: Instant,
    /// When it was tried to open the wire last.
    opened: Instant,
    heard: Instant,
    /// When it was listened to last.
    stepped: Instant,
    is_lost: bool,
    identity: Option<Identity>,
    /// What answered is of another build.
    foreign: Option<Build>,
    status: Option<Status<N>>,
    scope: Option<Scope<N>>,
    /// When it was asked for a snapshot last.
    looked: Instant,
}

impl<const N: usize> Connection<N> {
    /// Opens a wire. `asker` is a number that other starts of this side do not have, such as a time.
    ///
    /// # Errors
    /// The wire can't be opened.
    pub fn open(mut open: Open, asker: u32) -> io::Result<Self> {
        let wire = open()?;
        let now = Instant::now();
        Ok(Self {
            link: Box::new(HostLink::new(asker)),
            open,
            wire: Some(wire),
            begin: now,
            opened: now,
            heard: now,
            stepped: now,
            is_lost: false,
            identity: None,
            foreign: None,
            status: None,
            scope: None,
            looked: now,
        })
    }

    /// Writes what there is to say, and reads what has come, for which it waits at most `wait`.
    pub fn step(&mut self, wait: Duration, on_heard: &mut dyn FnMut(Heard<N>)) {
        if let Err(cause) = self.exchange(wait, on_heard) {
            self.wire = None;
            self.lose(cause.to_string(), on_heard);
        }
    }

    /// Waits for the board's answer: what it is.
    ///
    /// # Errors
    /// It has not answered in 10 s, or the wire is broken.
    pub fn greet(&mut self) -> Result<(), BoardError> {
        let (begin, mut lost) = (Instant::now(), None);
        while self.identity.is_none() {
            if begin.elapsed() > ANSWER {
                return Err(BoardError::Silent);
            }
            self.step(Duration::from_millis(50), &mut |heard| {
                if let Heard::Lost(cause) = heard {
                    lost = Some(cause);
                }
            });
            if let Some(cause) = lost.take() {
                return Err(BoardError::Wire(io::Error::other(cause)));
            }
            if let Some(build) = self.foreign.take() {
                return Err(BoardError::foreign(&build));
            }
        }
        Ok(())
    }

    /// Until the board has confirmed what the operator wants, or for a second; whether it has.
    #[must_use]
    pub fn settle(&mut self) -> bool {
        let begin = Instant::now();
        while !self.is_settled() && begin.elapsed() < Duration::from_secs(1) {
            self.step(Duration::from_millis(10), &mut |_| {});
        }
        self.is_settled()
    }

    /// Whether the board has confirmed what the operator wants.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.link.next().is_some() && !self.is_lost && self.link.is_controlled()
    }

    fn exchange(&mut self, wait: Duration, on_heard: &mut dyn FnMut(Heard<N>)) -> io::Result<()> {
        let now_ms = self.now_ms();
        // While nobody listened, nothing could be heard.
        if std::mem::replace(&mut self.stepped, Instant::now()).elapsed() > Duration::from_secs(1) {
            self.heard = Instant::now();
        }
        let Some(wire) = &mut self.wire else {
            let waits = REOPEN_AFTER.saturating_sub(self.opened.elapsed());
            if !waits.is_zero() {
                std::thread::sleep(waits.min(wait));
                return Ok(());
            }
            self.opened = Instant::now();
            // Nobody there yet: tried again.
            self.wire = (self.open)().ok();
            return Ok(());
        };
        let mut frame = [0; FRAME_MAX];
        loop {
            let length = self.link.transmit(now_ms, &mut frame);
            if length == 0 {
                break;
            }
            wire.write(&frame[..length])?;
        }
        let mut bytes = [0; 4096];
        let count = wire.read(&mut bytes, wait)?;
        if self.identity.is_some() && self.heard.elapsed() > SILENT_AFTER {
            // Opened anew: a socket whose other end has vanished stays silent for ever.
            self.heard = Instant::now();
            return Err(io::Error::other("no answer"));
        }
        let Self { status, identity, foreign, .. } = self;
        let mut has_come = false;
        let scope = &self.scope;
        let mut events = Vec::new();
        self.link.receive(&bytes[..count], now_ms, &mut |event| {
            has_come = true;
            match event {
                Event::Scope { is_first, body } => {
                    if let Some(scope) = scope {
                        scope.frame(is_first, body);
                    }
                    return;
                }
                Event::Status(told) => *status = Some(told),
                Event::Welcome(told) | Event::Refused(told) => *identity = Some(told),
                Event::Foreign(build) => *foreign = Some(build),
                Event::Restarted { .. } => {
                    *status = None;
                    if let Some(scope) = scope {
                        scope.restarted();
                    }
                }
                _ => {}
            }
            events.push(event);
        });
        if let Some(scope) = &self.scope
            && scope.wants_snapshot()
            && self.looked.elapsed() > LOOK_AFTER
        {
            self.looked = Instant::now();
            scope.snapshot_asked();
            self.link.renew_scope();
        }
        if has_come {
            self.heard = Instant::now();
            if std::mem::take(&mut self.is_lost) {
                on_heard(Heard::Back);
            }
        }
        events.into_iter().for_each(|event| on_heard(Heard::Board(event)));
        Ok(())
    }

    /// The board is not there any more: it is to hold when it is.
    fn lose(&mut self, cause: String, on_heard: &mut dyn FnMut(Heard<N>)) {
        if !std::mem::replace(&mut self.is_lost, true) {
            // Before the greeting there is nothing to hold.
            let _ = self.link.press(Mode::Hold);
            on_heard(Heard::Lost(cause));
        }
    }

    fn now_ms(&self) -> u32 {
        // Times wrap.
        self.begin.elapsed().as_millis() as u32
    }

    /// Whether the wire is broken, or the board silent.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// What the board is, once it has answered.
    #[must_use]
    pub fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// The board's number type; before it has answered, that of most.
    #[must_use]
    pub fn numbers(&self) -> Numbers {
        self.identity().map_or(Numbers::F32, Numbers::of)
    }

    /// The number of its start, once it has answered: after another start it is another one.
    #[must_use]
    pub fn session(&self) -> Option<u32> {
        self.link.session()
    }

    /// What it told last, if that is of the program under way.
    #[must_use]
    pub fn status(&self) -> Option<&Status<N>> {
        self.status.as_ref().filter(|status| status.aborts == self.link.controls().aborts)
    }

    /// What the operator wants.
    #[must_use]
    pub fn controls(&self) -> &Controls {
        self.link.controls()
    }

    /// Changes what the operator wants, by one of the link's commands. False before the board has answered.
    pub fn command(&mut self, command: impl FnOnce(&mut HostLink<N, ITEMS, BYTES>) -> bool) -> bool {
        command(&mut self.link)
    }

    /// The number in the program of the next item to be pushed; `None` while the board takes none.
    #[must_use]
    pub fn next(&self) -> Option<u32> {
        self.link.next()
    }

    /// An item that the board has already, of a program that is gone on with; see [`HostLink::skip`].
    pub fn skip(&mut self, item: &Item<N>) {
        if let Some(scope) = &self.scope {
            scope.item(self.link.controls().aborts, Some(item));
        }
        self.link.skip(item);
    }

    /// Takes the next item of a program, or its end; false if there is no room now.
    ///
    /// # Errors
    /// See [`PushError`].
    pub fn push(&mut self, item: Option<&Item<N>>) -> Result<bool, PushError> {
        let is_taken = self.link.push(item)?;
        if is_taken && let Some(scope) = &self.scope {
            scope.item(self.link.controls().aborts, item);
        }
        Ok(is_taken)
    }

    /// From now on `scope` is told every tick, and the items that are pushed: it is to be there before the first of a program.
    pub fn set_scope(&mut self, scope: Scope<N>) {
        self.scope = Some(scope);
        self.link.set_scope(true);
    }

    /// The scope, if there is one.
    #[must_use]
    pub fn scope(&self) -> Option<&Scope<N>> {
        self.scope.as_ref()
    }

    /// Ends the scope: what it has come to, if there was one.
    pub fn end_scope(&mut self) -> Option<ScopeSummary> {
        let scope = self.scope.take()?;
        self.link.set_scope(false);
        Some(scope.finish())
    }

    /// Goes on with a board that has started anew.
    pub fn accept(&mut self) {
        self.link.accept();
    }

    /// Asks for the board's parameters; see [`HostLink::read_parameters`].
    pub fn read_parameters(&mut self, offset: u32) {
        self.link.read_parameters(offset);
    }

    /// Asks for a row of the flight recorder; see [`HostLink::read_flight`].
    pub fn read_flight(&mut self, row: u16) {
        self.link.read_flight(row);
    }

    /// Writes a piece of new parameters; see [`HostLink::write_parameters`].
    pub fn write_parameters(&mut self, parameters: &[u8], offset: u32) {
        self.link.write_parameters(parameters, offset);
    }

    /// Whether the board has confirmed and taken everything that was pushed.
    #[must_use]
    pub fn has_all(&self) -> bool {
        let taken = self.status().map(|status| status.taken);
        self.link.waiting() == 0 && taken == Some(self.link.confirmed())
    }

    /// Whether everything that was pushed is confirmed and taken into motion, and that has come to its end.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        use motion_kernel::link::State::Idle;
        let taken = self.status().map(|status| (status.state, status.taken));
        let runs = self.link.controls().mode == Mode::Run && self.link.is_controlled();
        runs && self.link.waiting() == 0 && taken == Some((Idle, self.link.confirmed()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use motion_kernel::link::{BoardLink, ItemQueue};
    use motion_tests::link::IDENTITY;

    use super::*;

    /// A board that still tells somebody else what it does, byte by byte, and answers after that.
    struct Talkative {
        board: BoardLink,
        items: ItemQueue<3, 4>,
        /// Bytes of before.
        old: usize,
        answers: VecDeque<u8>,
    }

    impl Wire for Talkative {
        fn read(&mut self, bytes: &mut [u8], _: Duration) -> io::Result<usize> {
            if self.old > 0 {
                self.old -= 1;
                bytes[0] = if self.old.is_multiple_of(60) { 0 } else { 7 };
                return Ok(1);
            }
            if self.answers.is_empty() {
                let mut frame = [0; FRAME_MAX];
                let length = self.board.transmit(0, &self.items, None, &mut frame);
                self.answers.extend(&frame[..length]);
            }
            bytes[0] = self.answers.pop_front().unwrap_or(0);
            Ok(1)
        }

        fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.board.receive(&mut bytes.iter().copied());
            Ok(())
        }
    }

    /// The answer is waited for by time, however many bytes come before it.
    #[test]
    fn an_answer_behind_many_bytes_is_found() {
        let identity = Identity { items: 4, ..IDENTITY };
        let board = BoardLink::new(1, identity);
        let wire = Talkative { board, items: ItemQueue::new(), old: 100_000, answers: VecDeque::new() };
        let mut wire = Some(Box::new(wire) as Box<dyn Wire>);
        let open = Box::new(move || wire.take().ok_or_else(|| io::ErrorKind::BrokenPipe.into()));
        let mut connection = Connection::<3>::open(open, 7).expect("a wire");
        assert!(connection.greet().is_ok());
        assert_eq!(connection.identity(), Some(&identity));
    }
}
