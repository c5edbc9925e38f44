//! Where program blocks end, as far as the path is queued: what single block comes to rest at.
//!
//! Consumes the program lines of pieces as they are queued; a block ends where the next piece is of another line, and
//! where the stretch ends. Background; bounded by its places.

use heapless::Deque;

use super::road::{SLIVER, Splice, is_before};
use crate::units::Position;

/// The end of a program block: a path position of its stretch, or the start of the next stretch for one that ends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockEnd {
    pub(super) stretch: u32,
    pub(super) at: Position,
}

impl BlockEnd {
    /// Whether a place is there but for rounding: no nearer path can be driven over.
    pub(super) fn is_at(&self, place: &Splice) -> bool {
        let gap = self.at - place.at;
        self.stretch == place.stretch && gap <= SLIVER && -gap <= SLIVER
    }
}

impl From<Splice> for BlockEnd {
    fn from(Splice { stretch, at, .. }: Splice) -> Self {
        Self { stretch, at }
    }
}

/// Block ends on path that is queued and not driven yet. With as many places as the path's queue has it is never full.
#[derive(Debug)]
pub(super) struct BlockEnds<const PLACES: usize> {
    /// Each with the number of the piece before it.
    ends: Deque<(BlockEnd, u32), PLACES>,
    /// The program line of the last piece, within a stretch.
    line: Option<u32>,
    /// Items of path that were queued.
    queued: u32,
}

impl<const PLACES: usize> BlockEnds<PLACES> {
    pub(super) const fn new() -> Self {
        Self { ends: Deque::new(), line: None, queued: 0 }
    }

    pub(super) fn is_full(&self) -> bool {
        self.ends.is_full()
    }

    /// A piece of `line` was queued that begins at `start` of its stretch.
    pub(super) fn piece(&mut self, stretch: u32, start: Position, line: u32) {
        if self.line.replace(line).is_some_and(|last| last != line) {
            // There was room.
            let _ = self.ends.push_back((BlockEnd { stretch, at: start }, self.queued));
        }
        self.queued = self.queued.wrapping_add(1);
    }

    /// The end of a stretch's path was queued.
    pub(super) fn end_of_stretch(&mut self) {
        self.line = None;
        self.queued = self.queued.wrapping_add(1);
    }

    /// Forgets the ends of pieces that are not among the last `in_queue` items.
    pub(super) fn pass(&mut self, in_queue: usize) {
        let gone = self.queued.wrapping_sub(in_queue as u32);
        while self.ends.front().is_some_and(|&(_, number)| is_before(number, gone.wrapping_add(1))) {
            self.ends.pop_front();
        }
    }

    /// Those of a stretch.
    pub(super) fn of(&self, stretch: u32) -> impl Iterator<Item = BlockEnd> + '_ {
        self.ends.iter().map(|&(end, _)| end).filter(move |end| end.stretch == stretch)
    }
}
