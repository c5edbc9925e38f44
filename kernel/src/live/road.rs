//! What is known of the path ahead: blocks with what holds their feed.
//!
//! Consumes [`PathBlock`]s as they are read; answers what a ramp may do on them. Background.

use heapless::Deque;

use crate::law::{Law, Limits, Ramp};
use crate::program::PathBlock;
use crate::units::Position;

/// A place where a plan may begin: on the path of a stretch, at a feed that does not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Splice {
    /// The stretch, from 0.
    pub(super) stretch: u32,
    /// Path position from its start.
    pub(super) at: Position,
    /// Feed \[mm/s\].
    pub(super) feed_mm_s: f64,
}

/// A block on the path of its stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoadBlock {
    stretch: u32,
    pub(super) start: Position,
    pub(super) end: Position,
    block: PathBlock,
}

/// Rounding that is no violation, a part of a feed and a length \[mm\].
const FEED_ROUNDING: f64 = 1.0e-9;
pub(super) const LENGTH_ROUNDING_MM: f64 = 4.0e-9;
/// What is shorter is no path to plan on but rounding: a ramp over it would have no length in position steps. Less than
/// what a segment's length may be off.
pub(super) const SLIVER: Position = Position::from_bits(32);
/// How often a ramp is made anew because it crosses blocks with other limits: as often as there are limits to lower.
const LIMITS_STEPS: usize = 8;

impl RoadBlock {
    /// The ceiling under a feed override, and the limits of ramps below it. Rapids are not faster for it.
    pub(super) fn allowed(&self, feed_override: f64) -> (f64, Limits<f64>) {
        let (feed_mm_s, most_mm_s) = (self.block.feed_mm_s(), self.block.greatest().cap_mm_s);
        let wanted_mm_s = if feed_mm_s.is_finite() {
            feed_mm_s * feed_override
        } else {
            most_mm_s * f64::min(feed_override, 1.0)
        };
        let cap_mm_s = f64::min(wanted_mm_s, most_mm_s);
        (cap_mm_s, self.limits_at(cap_mm_s))
    }

    fn limits_at(&self, feed_mm_s: f64) -> Limits<f64> {
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

/// The blocks ahead, of the stretch under way and of what follows.
#[derive(Debug, Default)]
pub(super) struct Road<const BLOCKS: usize> {
    blocks: Deque<RoadBlock, BLOCKS>,
    /// The stretch and the end of the last block that was appended, which may have been passed since.
    last: (u32, Position),
}

impl<const BLOCKS: usize> Road<BLOCKS> {
    pub(super) const fn new() -> Self {
        Self { blocks: Deque::new(), last: (0, Position::ZERO) }
    }

    pub(super) fn is_full(&self) -> bool {
        self.blocks.is_full()
    }

    /// Appends a block of `stretch`. One without a length holds nothing.
    pub(super) fn push(&mut self, stretch: u32, block: PathBlock) {
        if block.length <= Position::ZERO {
            return;
        }
        let (last, end) = self.last;
        let start = if last == stretch { end } else { Position::ZERO };
        self.last = (stretch, start + block.length);
        // There was room.
        let _ = self.blocks.push_back(RoadBlock { stretch, start, end: start + block.length, block });
    }

    /// Forgets what lies before `at` on `stretch`.
    pub(super) fn pass(&mut self, stretch: u32, at: Position) {
        while let Some(first) = self.blocks.front()
            && (is_before(first.stretch, stretch) || first.stretch == stretch && first.end <= at)
        {
            self.blocks.pop_front();
        }
    }

    /// The blocks of its stretch from a splice on, the first one cut there.
    pub(super) fn from(&self, splice: &Splice) -> impl Iterator<Item = RoadBlock> + '_ {
        let &Splice { stretch, at, .. } = splice;
        let ahead = self.blocks.iter().filter(move |block| block.stretch == stretch && block.end > at);
        ahead.map(move |block| RoadBlock { start: block.start.max(at), ..*block })
    }

    /// Where the blocks of `stretch` end, as far as they are known.
    pub(super) fn end_of(&self, stretch: u32) -> Option<Position> {
        let (last, end) = self.last;
        if last == stretch {
            return Some(end);
        }
        self.blocks.iter().rev().find(|block| block.stretch == stretch).map(|block| block.end)
    }

    /// The greatest feed \[mm/s\] on the path of `stretch` from `start` to `end`; `None` if there are no blocks as far as
    /// that.
    pub(super) fn fastest_mm_s(&self, stretch: u32, start: Position, end: Position) -> Option<f64> {
        let known = self.end_of(stretch).is_some_and(|known| known + SLIVER >= end);
        let here = |block: &&RoadBlock| {
            block.stretch == stretch && block.start + SLIVER < end && start + SLIVER < block.end
        };
        let caps = self.blocks.iter().filter(here).map(|block| block.block.greatest().cap_mm_s);
        known.then(|| caps.fold(0.0, f64::max))
    }

    /// The fastest braking from a splice of motion under `feed_override` to `to_mm_s` that keeps the ceilings, junctions
    /// and limits of all the blocks that it crosses, before `end`, with the length it is driven over; `None` if there is
    /// none.
    pub(super) fn brake(
        &self,
        from: &Splice,
        to_mm_s: f64,
        end: Position,
        feed_override: f64,
    ) -> Option<(Ramp<f64>, Position)> {
        let mut limits = self.from(from).next()?.limits_at(from.feed_mm_s);
        for _ in 0..LIMITS_STEPS {
            let ramp = Ramp::new(&Law::new(limits).ok()?, from.feed_mm_s, to_mm_s);
            let length_mm = ramp.length_mm();
            let mut length = Position::from_mm(length_mm)?;
            let left = end - (from.at + length);
            if left <= SLIVER && -left <= SLIVER {
                length = end - from.at;
            } else if left < Position::ZERO {
                return None;
            }
            let crossed = |block: &RoadBlock| (block.start - from.at).to_mm() < length_mm;
            let least = self
                .from(from)
                .take_while(crossed)
                .fold(limits, |least, block| least.least(&block.limits_at(from.feed_mm_s)));
            if least == limits {
                return self.is_below_ceilings(from, &ramp, feed_override).then_some((ramp, length));
            }
            limits = least;
        }
        None
    }

    /// Whether the feed of a splice may be kept as far as `end` under `feed_override`.
    pub(super) fn may_keep(&self, from: &Splice, end: Position, feed_override: f64) -> bool {
        let mut junction_mm_s = f64::INFINITY;
        self.from(from).take_while(|block| block.start < end).all(|block| {
            let most_mm_s = f64::min(block.allowed(feed_override).0, junction_mm_s);
            junction_mm_s = block.junction_mm_s();
            from.feed_mm_s <= most_mm_s * (1.0 + FEED_ROUNDING)
        })
    }

    /// Whether a braking ramp is slow enough wherever a block begins.
    fn is_below_ceilings(&self, from: &Splice, ramp: &Ramp<f64>, feed_override: f64) -> bool {
        let rising = ramp.reversed();
        let length_mm = ramp.length_mm();
        let mut junction_mm_s = f64::INFINITY;
        for block in self.from(from) {
            let at_mm = (block.start - from.at).to_mm();
            // Where it begins the feed is what it is; it only falls from there.
            let cap_mm_s = if at_mm > 0.0 { block.allowed(feed_override).0 } else { f64::INFINITY };
            let most_mm_s = f64::min(cap_mm_s, junction_mm_s) * (1.0 + FEED_ROUNDING);
            let is_slow = ramp.from_mm_s <= most_mm_s
                || length_mm - rising.length_to_feed_mm(most_mm_s) <= at_mm + LENGTH_ROUNDING_MM;
            if at_mm > length_mm {
                break;
            }
            if !is_slow {
                return false;
            }
            junction_mm_s = block.junction_mm_s();
        }
        true
    }
}

/// Counts of stretches wrap.
pub(super) fn is_before(stretch: u32, other: u32) -> bool {
    stretch.wrapping_sub(other).cast_signed() < 0
}
