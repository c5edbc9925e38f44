//! Reads the program: path into the queue, blocks into the lookahead, feed into the program feed that lists
//! are made of.
//!
//! Consumes the items of a [`Source`]; keeps the items that are read but not handed over yet. The only part
//! of live control that talks to the path queue. Background; reads as long as it and the queue have places.

use core::task::Poll;

use super::list::Item as ListItem;
use super::lookahead::Lookahead;
use super::program_feed::ProgramFeed;
use super::splice::{BlockEnd, Extent, Splice};
use crate::law::Pulse;
use crate::num::Real;
use crate::program::supply::{Ready, is_taken};
use crate::program::{Item, Source, SupplyError};
use crate::queue::{LiveFeeder, Rejection};
use crate::units::Position;

/// The source's last answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    /// An item, or it has not been asked yet.
    Item,
    /// Nothing for now.
    Late,
    /// No more items.
    End,
}

/// The queued path of the stretch being read.
#[derive(Clone, Copy, Debug)]
pub(super) struct QueuedPath {
    stretch: u32,
    end: Position,
}

impl QueuedPath {
    /// Path queued up to `end` of `stretch`.
    pub(super) fn new(stretch: u32, end: Position) -> Self {
        Self { stretch, end }
    }

    /// How far a plan may use the path of `stretch`, at most to `block_end`.
    pub(super) fn extent_of<const PLACES: usize>(
        &self,
        stretch: u32,
        block_end: Option<BlockEnd>,
        lookahead: &Lookahead<PLACES>,
    ) -> Extent {
        match block_end {
            Some(end) if end.stretch == stretch => Extent::SoFar(end.at),
            _ if self.stretch == stretch => Extent::SoFar(self.end),
            _ => Extent::Whole(lookahead.end_of(stretch).unwrap_or(Position::ZERO)),
        }
    }
}

/// The items read, and the state of reading.
#[derive(Debug)]
pub(super) struct Reader<R: Real, const AXES: usize, I, const PLACES: usize> {
    source: I,
    tick_s: f64,
    answer: Answer,
    /// An item made ready but not yet taken by the path queue.
    pending: Option<Ready<R, AXES>>,
    /// There is no room for the next item.
    is_full: bool,
    path: QueuedPath,
    lookahead: Lookahead<PLACES>,
    feed: ProgramFeed<PLACES>,
}

impl<R: Real, const AXES: usize, I: Source<AXES>, const PLACES: usize> Reader<R, AXES, I, PLACES> {
    pub(super) fn new(source: I, pulse: Pulse, tick_s: f64) -> Self {
        Self {
            source,
            tick_s,
            answer: Answer::Item,
            pending: None,
            is_full: false,
            path: QueuedPath::new(0, Position::ZERO),
            lookahead: Lookahead::new(pulse),
            feed: ProgramFeed::new(),
        }
    }

    pub(super) fn source_mut(&mut self) -> &mut I {
        &mut self.source
    }

    pub(super) fn lookahead(&self) -> &Lookahead<PLACES> {
        &self.lookahead
    }

    pub(super) fn path(&self) -> QueuedPath {
        self.path
    }

    pub(super) fn feed_mut(&mut self) -> &mut ProgramFeed<PLACES> {
        &mut self.feed
    }

    /// As new, with the items that the source still has.
    pub(super) fn restart(&mut self) {
        (self.answer, self.pending, self.is_full) = (Answer::Item, None, false);
        self.path = QueuedPath::new(0, Position::ZERO);
        self.lookahead.restart();
        self.feed.restart();
    }

    /// The lookahead and the program's feed.
    pub(super) fn ahead(&mut self) -> (&Lookahead<PLACES>, &mut ProgramFeed<PLACES>) {
        (&self.lookahead, &mut self.feed)
    }

    /// Whether there is no room to read more.
    pub(super) fn is_full(&self) -> bool {
        self.is_full
    }

    /// Whether the program is read to its end and everything read is in lists.
    pub(super) fn is_read(&self) -> bool {
        self.answer == Answer::End && self.pending.is_none() && self.feed.is_empty()
    }

    /// Whether the source has nothing for now, and everything it gave is handed over, up to the end of a
    /// stretch.
    pub(super) fn is_waiting(&self) -> bool {
        self.answer == Answer::Late
            && self.pending.is_none()
            && self.feed.is_empty()
            && self.path.end == Position::ZERO
            && self.lookahead.end_of(self.path.stretch).is_none_or(|end| end == Position::ZERO)
    }

    /// Forgets the blocks before a place.
    pub(super) fn pass(&mut self, place: &Splice, feeder: &LiveFeeder<'_, R, AXES>) {
        self.lookahead.pass(place, feeder.path_queued());
    }

    /// Reads items while there is room and no stop is asked for; if the program is aborted, only the pending one is
    /// entered.
    pub(super) fn read(
        &mut self,
        is_given_up: bool,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<I::Error>> {
        loop {
            self.is_full = !self.enter(feeder).map_err(SupplyError::Rejected)?;
            if self.is_full {
                return Ok(());
            }
            self.pending = None;
            self.is_full = !self.feed.has_room() || self.lookahead.is_full();
            if self.is_full || is_given_up || self.answer == Answer::End || is_stop_asked() {
                return Ok(());
            }
            let polled = self.source.poll_next();
            self.answer = match &polled {
                Poll::Ready(Some(_)) => Answer::Item,
                Poll::Ready(None) => Answer::End,
                Poll::Pending => Answer::Late,
            };
            match polled {
                Poll::Ready(Some(item)) => self.take(item.map_err(SupplyError::Source)?)?,
                Poll::Ready(None) => {}
                Poll::Pending => return Ok(()),
            }
        }
    }

    /// Enters the pending item; returns whether the path queue had room for it.
    fn enter(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<bool, Rejection> {
        let QueuedPath { stretch, end: start } = self.path;
        match &self.pending {
            Some(Ready::Piece(piece)) => {
                let end = start + piece.length();
                let fastest_mm_s = self.lookahead.fastest_mm_s(stretch, start, end);
                let is_taken = is_taken(feeder.piece(*piece, fastest_mm_s.ok_or(Rejection::NoBlock)?))?;
                if is_taken {
                    self.lookahead.queued_piece(stretch, start, piece.program_line())?;
                    self.path.end = end;
                }
                Ok(is_taken)
            }
            Some(Ready::EndOfStretch(end)) => {
                let is_taken = is_taken(feeder.end_of_path(*end))?;
                if is_taken {
                    self.feed.push(ListItem::End)?;
                    self.lookahead.queued_end_of_stretch();
                    self.path = QueuedPath::new(stretch.wrapping_add(1), Position::ZERO);
                }
                Ok(is_taken)
            }
            Some(Ready::Segment(_) | Ready::Dwell(_) | Ready::Stop | Ready::Block) | None => Ok(true),
        }
    }

    fn take(&mut self, item: Item<AXES>) -> Result<(), SupplyError<I::Error>> {
        let taken = match item {
            Item::Block(block) => self.lookahead.push(self.path.stretch, block.within_range::<R>()),
            Item::Line { .. } | Item::Septic { .. } | Item::EndOfStretch(_) => {
                if let Item::EndOfStretch(_) = item {
                    self.check_blocks().map_err(SupplyError::Rejected)?;
                }
                self.pending = Some(item.ready(self.tick_s)?);
                Ok(())
            }
            Item::Feed(_) if self.feed.replans(self.path.stretch) => Ok(()),
            Item::Feed(ramp) => self.feed.push(ListItem::Feed(ramp)),
            Item::Dwell(duration) => self.feed.push(ListItem::Dwell(duration)),
            Item::Stop => self.feed.push(ListItem::Stop),
            Item::Switch(_) => return Err(SupplyError::NoOutputs),
        };
        taken.map_err(SupplyError::Rejected)
    }

    /// Checks that the blocks of the stretch just read end where its path does: plans are made for the
    /// blocks.
    fn check_blocks(&self) -> Result<(), Rejection> {
        let QueuedPath { stretch, end: path } = self.path;
        let blocks = self.lookahead.end_of(stretch).unwrap_or(Position::ZERO);
        if blocks == path {
            return Ok(());
        }
        Err(Rejection::Blocks { blocks_mm: blocks.to_mm(), path_mm: path.to_mm() })
    }
}
