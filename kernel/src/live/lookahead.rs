//! Blocks and block ends ahead, in the stretch under way and the ones after it.
//!
//! Consumes [`PathBlock`]s as they are read, and the program lines of pieces as they are queued: a program
//! block ends where the next piece has another line, and where the stretch ends. Answers which feed the path
//! ahead allows, and where single block may come to rest. Background; bounded by its places.

use heapless::Deque;

use super::splice::{BlockEnd, SLIVER, Splice, is_before};
use crate::law::{Limits, Pulse};
use crate::program::PathBlock;
use crate::queue::Rejection;
use crate::units::Position;

/// Tolerated rounding of a feed, relative.
pub(super) const FEED_ROUNDING: f64 = 1.0e-9;

/// A block on the path of its stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct AheadBlock {
    stretch: u32,
    start: Position,
    end: Position,
    block: PathBlock,
}

impl AheadBlock {
    /// Where it begins.
    pub(super) fn start(&self) -> Position {
        self.start
    }

    /// Where it ends.
    pub(super) fn end(&self) -> Position {
        self.end
    }

    /// The ceiling under a feed override, and the limits of ramps below it. It does not make rapids faster.
    pub(super) fn allowed(&self, feed_override: f64) -> (f64, Limits<f64>) {
        let (feed_mm_s, most_mm_s) = (self.block.feed_mm_s(), self.block.greatest().cap_mm_s);
        let asked_mm_s = if feed_mm_s.is_finite() {
            feed_mm_s * feed_override
        } else {
            most_mm_s * f64::min(feed_override, 1.0)
        };
        let cap_mm_s = f64::min(asked_mm_s, most_mm_s);
        (cap_mm_s, self.limits_at(cap_mm_s))
    }

    /// The limits of ramps at a feed.
    pub(super) fn limits_at(&self, feed_mm_s: f64) -> Limits<f64> {
        let programmed = self.block.programmed();
        if feed_mm_s <= programmed.cap_mm_s * (1.0 + FEED_ROUNDING) {
            programmed.limits
        } else {
            self.block.greatest().limits
        }
    }

    /// Greatest feed through the junction at its end \[mm/s\].
    pub(super) fn junction_mm_s(&self) -> f64 {
        self.block.junction_mm_s()
    }
}

/// The known path ahead.
#[derive(Debug)]
pub(super) struct Lookahead<const PLACES: usize> {
    pulse: Pulse,
    blocks: Deque<AheadBlock, PLACES>,
    /// The stretch and end of the last block appended, which may have been passed since.
    last: (u32, Position),
    /// Ends of program blocks on queued path, each with the number of the piece after it. Never full if it
    /// has as many places as the path queue.
    ends: Deque<(BlockEnd, u32), PLACES>,
    /// The program line of the last piece, within a stretch.
    line: Option<u32>,
    /// Number of path items queued so far.
    queued: u32,
}

impl<const PLACES: usize> Lookahead<PLACES> {
    pub(super) const fn new(pulse: Pulse) -> Self {
        Self {
            pulse,
            blocks: Deque::new(),
            last: (0, Position::ZERO),
            ends: Deque::new(),
            line: None,
            queued: 0,
        }
    }

    /// Forgets everything but the pulse.
    pub(super) fn restart(&mut self) {
        self.blocks.clear();
        self.ends.clear();
        (self.last, self.line, self.queued) = ((0, Position::ZERO), None, 0);
    }

    /// The shape of the pulses of every ramp planned here.
    pub(super) fn pulse(&self) -> Pulse {
        self.pulse
    }

    /// Whether there is no place for another block or block end.
    pub(super) fn is_full(&self) -> bool {
        self.blocks.is_full() || self.ends.is_full()
    }

    /// Appends a block of `stretch`. Blocks without length are ignored.
    pub(super) fn push(&mut self, stretch: u32, block: PathBlock) -> Result<(), Rejection> {
        if block.length <= Position::ZERO {
            return Ok(());
        }
        let (last, end) = self.last;
        let start = if last == stretch { end } else { Position::ZERO };
        let end = start + block.length;
        self.last = (stretch, end);
        let pushed = self.blocks.push_back(AheadBlock { stretch, start, end, block });
        pushed.map_err(|_| Rejection::full("blocks ahead", PLACES))
    }

    /// Notes a queued piece of program line `line` that begins at `start` of its stretch.
    pub(super) fn queued_piece(&mut self, stretch: u32, start: Position, line: u32) -> Result<(), Rejection> {
        let number = self.queued;
        self.queued = number.wrapping_add(1);
        if self.line.replace(line).is_none_or(|last| last == line) {
            return Ok(());
        }
        let pushed = self.ends.push_back((BlockEnd { stretch, at: start }, number));
        pushed.map_err(|_| Rejection::full("block ends ahead", PLACES))
    }

    /// Number of pieces and ends of stretches queued so far.
    pub(super) fn queued(&self) -> u32 {
        self.queued
    }

    /// Notes that the end of a stretch's path was queued.
    pub(super) fn queued_end_of_stretch(&mut self) {
        self.line = None;
        self.queued = self.queued.wrapping_add(1);
    }

    /// Forgets the blocks before a place, and the block ends of pieces that are no longer among the last
    /// `in_queue` items.
    pub(super) fn pass(&mut self, place: &Splice, in_queue: usize) {
        let &Splice { stretch, at, .. } = place;
        while let Some(first) = self.blocks.front()
            && (is_before(first.stretch, stretch) || first.stretch == stretch && first.end <= at)
        {
            self.blocks.pop_front();
        }
        let gone = self.queued.wrapping_sub(in_queue as u32);
        while self.ends.front().is_some_and(|&(_, number)| is_before(number, gone.wrapping_add(1))) {
            self.ends.pop_front();
        }
    }

    /// The blocks of its stretch from a splice on; the first one is cut there.
    pub(super) fn from(&self, splice: &Splice) -> impl Iterator<Item = AheadBlock> + '_ {
        let &Splice { stretch, at, .. } = splice;
        let ahead = self.blocks.iter().filter(move |block| block.stretch == stretch && block.end > at);
        ahead.map(move |block| AheadBlock { start: block.start.max(at), ..*block })
    }

    /// The ends of program blocks on the queued path of a stretch.
    pub(super) fn block_ends(&self, stretch: u32) -> impl Iterator<Item = BlockEnd> + '_ {
        self.ends.iter().map(|&(end, _)| end).filter(move |end| end.stretch == stretch)
    }

    /// Where the known blocks of `stretch` end.
    pub(super) fn end_of(&self, stretch: u32) -> Option<Position> {
        let (last, end) = self.last;
        if last == stretch {
            return Some(end);
        }
        self.blocks.iter().rev().find(|block| block.stretch == stretch).map(|block| block.end)
    }

    /// The greatest feed \[mm/s\] on the path of `stretch` from `start` to `end`; `None` if the known blocks
    /// do not reach `end`.
    pub(super) fn fastest_mm_s(&self, stretch: u32, start: Position, end: Position) -> Option<f64> {
        let known = self.end_of(stretch).is_some_and(|known| known + SLIVER >= end);
        let here = |block: &&AheadBlock| {
            block.stretch == stretch && block.start + SLIVER < end && start + SLIVER < block.end
        };
        let caps = self.blocks.iter().filter(here).map(|block| block.block.greatest().cap_mm_s);
        known.then(|| caps.fold(0.0, f64::max))
    }
}
