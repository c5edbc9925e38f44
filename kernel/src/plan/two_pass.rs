//! Stages 1 and 2: a feed for every junction of a stretch.
//!
//! Forward, each block's exit feed is the greatest that its ceiling, the next one's, their junction and the
//! length allow; backward from the stop, each block's entry feed is the greatest from which it can brake
//! ("block 9" of S3). Then each block gets the peak that its length allows ("block 12").
//!
//! One pass each way, constant work per block. The result is feasible, and Pareto-maximal: no feasible plan
//! has every junction feed at least as high and one higher. It is *not* always the fastest, because a ramp's
//! length is not monotone in its lower feed.

use super::attention::Attention;
use super::ceiling::Reason;
use crate::law::{Law, SegmentError, peak, reach};
use crate::num::Root;
use crate::units::Position;

/// A block as the look-ahead sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block<R> {
    /// Length \[mm\], from [`Root::LENGTH_MIN_MM`] to [`Position::LIMIT_MM`], or 0.
    pub length_mm: R,
    /// Ceiling of the feed \[mm/s\], > 0 and within [`Root::FEEDS_MM_S`].
    pub cap_mm_s: R,
    /// Greatest feed through the junction at its end \[mm/s\], ≥ 0; infinite for none, in fixed point the
    /// greatest value. Below the least of [`Root::FEEDS_MM_S`] it is a stop.
    pub junction_mm_s: R,
    /// The law its ramps follow.
    pub law: Law<R>,
}

/// The planned feeds of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockPlan<R> {
    /// Feed at its start \[mm/s\].
    pub enter_mm_s: R,
    /// Greatest feed inside \[mm/s\]; it cruises at this feed if there is length left.
    pub peak_mm_s: R,
    /// Feed at its end \[mm/s\].
    pub exit_mm_s: R,
}

impl<R: Root> BlockPlan<R> {
    /// What limits a block whose ceiling has the reason `ceiling`: that, or its length.
    pub fn reason(&self, block: &Block<R>, ceiling: Reason) -> Reason {
        let reached = self.peak_mm_s >= block.cap_mm_s * (R::ONE - R::from_f64(1.0e-9));
        match (reached, self.peak_mm_s > self.exit_mm_s) {
            (true, _) => ceiling,
            (false, true) => Reason::Braking,
            (false, false) => Reason::Accelerating,
        }
    }
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PlanError {
    /// A figure of a block is not a number, is negative, or is beyond the range of the number type.
    Block {
        /// The block, from 0.
        block: usize,
        /// The figure, with its unit.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Least and greatest value accepted; a length may also be 0.
        range: (f64, f64),
    },
    /// The start or end feed is negative, above the ceiling of its block, or not 0 and below the least of
    /// [`Root::FEEDS_MM_S`].
    EndFeed {
        /// "start feed" or "end feed".
        quantity: &'static str,
        /// Its value \[mm/s\].
        feed_mm_s: f64,
        /// The greatest possible \[mm/s\].
        greatest_mm_s: f64,
    },
    /// The stretch is too short to brake from its start feed.
    TooShortToBrake {
        /// The start feed \[mm/s\].
        start_mm_s: f64,
        /// The greatest feed from which a pair of ramps for each block brakes \[mm/s\]. Ramps over several blocks
        /// may brake from more.
        greatest_mm_s: f64,
    },
    /// The stretch is too short to accelerate to its end feed.
    TooShortToAccelerate {
        /// The end feed \[mm/s\].
        end_mm_s: f64,
        /// The greatest feed that a pair of ramps for each block reaches \[mm/s\]. Ramps over several blocks may
        /// reach more.
        greatest_mm_s: f64,
    },
    /// The ramps of a block are beyond the tick's range.
    Ramp {
        /// Where the block starts on the path.
        start: Position,
        /// Why.
        error: SegmentError,
    },
    /// The caller's memory has the wrong number of places.
    Room {
        /// What they are for.
        of: &'static str,
        /// Number needed.
        needed: usize,
        /// Number there.
        places: usize,
    },
    /// It was given up for something more urgent.
    GivenUp,
}

impl core::fmt::Display for PlanError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Block { block, quantity, value, range: (least, greatest) } => {
                write!(
                    f,
                    "block {block}: {quantity} {value}: expected a length of 0 or more, a ceiling above 0, \
                     a junction feed not below 0; here from {least} to {greatest}"
                )
            }
            Self::EndFeed { quantity, feed_mm_s, greatest_mm_s } => {
                write!(
                    f,
                    "{quantity} {feed_mm_s} mm/s: expected from 0 to {greatest_mm_s} mm/s, and none too small \
                     for the number type"
                )
            }
            Self::TooShortToBrake { start_mm_s, greatest_mm_s } => {
                write!(f, "too short to brake from {start_mm_s} mm/s: at most {greatest_mm_s} mm/s")
            }
            Self::TooShortToAccelerate { end_mm_s, greatest_mm_s } => {
                write!(f, "too short to reach {end_mm_s} mm/s: at most {greatest_mm_s} mm/s")
            }
            Self::Ramp { start, error } => write!(f, "block from {} mm: {error}", start.to_mm()),
            Self::Room { of, needed, places } => write!(f, "room for {places} {of}, expected {needed}"),
            Self::GivenUp => f.write_str("given up for something more urgent"),
        }
    }
}

impl core::error::Error for PlanError {}

/// Plans a stretch from `start_mm_s` to `end_mm_s` into `plans`, one for each block. The junction at the end
/// of the last block is ignored.
///
/// # Errors
/// A figure is out of range, or the stretch is too short for its start or end feed.
pub fn plan<R: Root>(
    blocks: &[Block<R>],
    start_mm_s: R,
    end_mm_s: R,
    plans: &mut [BlockPlan<R>],
) -> Result<(), PlanError> {
    plan_unless(&Attention::undivided(), blocks, start_mm_s, end_mm_s, plans)
}

/// [`plan`], given up where something more urgent waits.
pub(super) fn plan_unless<R: Root>(
    attention: &Attention<'_>,
    blocks: &[Block<R>],
    start_mm_s: R,
    end_mm_s: R,
    plans: &mut [BlockPlan<R>],
) -> Result<(), PlanError> {
    if blocks.len() != plans.len() {
        return Err(PlanError::Room { of: "plans", needed: blocks.len(), places: plans.len() });
    }
    check(blocks, start_mm_s, end_mm_s)?;
    forward(attention, blocks, [start_mm_s, end_mm_s], plans)?;
    backward(attention, blocks, start_mm_s, plans)?;
    for (block, plan) in blocks.iter().zip(plans) {
        go_on(attention)?;
        // The junctions' feeds are below the ceiling already. Most often there is room to reach the ceiling,
        // or the block is passed at it; checking that is cheaper than solving.
        let (enter, exit, cap) = (plan.enter_mm_s, plan.exit_mm_s, block.cap_mm_s);
        // Subtracted, because the sum may be beyond fixed point.
        let left = block.length_mm - block.law.ramp_length_mm(cap, exit);
        plan.peak_mm_s = if block.law.ramp_length_mm(enter, cap) <= left {
            cap
        } else {
            peak(&block.law, enter, exit, block.length_mm).min(cap)
        };
    }
    Ok(())
}

pub(super) fn check<R: Root>(blocks: &[Block<R>], start: R, end: R) -> Result<(), PlanError> {
    let (slowest, fastest) = R::FEEDS_MM_S;
    for (index, block) in blocks.iter().enumerate() {
        let (length, cap, junction) = (block.length_mm, block.cap_mm_s, block.junction_mm_s);
        // A length of 0 is accepted, a ceiling of 0 is not.
        for (quantity, value, least, greatest, good) in [
            ("length [mm]", length, R::LENGTH_MIN_MM, Position::LIMIT_MM, length == R::ZERO),
            ("ceiling [mm/s]", cap, slowest, fastest, false),
            ("junction feed [mm/s]", junction, 0.0, f64::INFINITY, junction >= R::ZERO),
        ] {
            let value = value.to_f64();
            let within = value > 0.0 && value.is_finite() && value >= least && value <= greatest;
            if !(good || within) {
                return Err(PlanError::Block { block: index, quantity, value, range: (least, greatest) });
            }
        }
    }
    for (quantity, feed, block) in [("start feed", start, blocks.first()), ("end feed", end, blocks.last())] {
        let greatest = block.map_or(R::ZERO, |block| block.cap_mm_s);
        let is_resolved = feed == R::ZERO || feed.to_f64() >= slowest;
        if !(feed >= R::ZERO && feed <= greatest && is_resolved) {
            return Err(PlanError::EndFeed {
                quantity,
                feed_mm_s: feed.to_f64(),
                greatest_mm_s: greatest.to_f64(),
            });
        }
    }
    Ok(())
}

fn go_on(attention: &Attention<'_>) -> Result<(), PlanError> {
    if attention.is_wanted() { Err(PlanError::GivenUp) } else { Ok(()) }
}

fn forward<R: Root>(
    attention: &Attention<'_>,
    blocks: &[Block<R>],
    [start, end]: [R; 2],
    plans: &mut [BlockPlan<R>],
) -> Result<(), PlanError> {
    let mut feed = start;
    let mut rest = blocks;
    for plan in plans {
        let [block, after @ ..] = rest else { break };
        go_on(attention)?;
        let allowed = match after.first() {
            Some(_) if block.junction_mm_s.to_f64() < R::FEEDS_MM_S.0 => R::ZERO,
            Some(next) => block.cap_mm_s.min(block.junction_mm_s).min(next.cap_mm_s),
            None => end,
        };
        // Looking whether there is room is cheaper than solving.
        let exit = if allowed > feed && block.law.ramp_length_mm(feed, allowed) > block.length_mm {
            let reached = allowed.min(reach(&block.law, feed, block.length_mm));
            if after.is_empty() && reached < end {
                return Err(PlanError::TooShortToAccelerate {
                    end_mm_s: end.to_f64(),
                    greatest_mm_s: reached.to_f64(),
                });
            }
            reached
        } else {
            allowed
        };
        *plan = BlockPlan { enter_mm_s: feed, peak_mm_s: feed, exit_mm_s: exit };
        feed = exit;
        rest = after;
    }
    Ok(())
}

fn backward<R: Root>(
    attention: &Attention<'_>,
    blocks: &[Block<R>],
    start: R,
    plans: &mut [BlockPlan<R>],
) -> Result<(), PlanError> {
    let mut exit = match plans.last() {
        Some(last) => last.exit_mm_s,
        None => return Ok(()),
    };
    for (block, plan) in blocks.iter().zip(plans.iter_mut()).rev() {
        go_on(attention)?;
        plan.exit_mm_s = exit;
        if plan.enter_mm_s > exit && block.law.ramp_length_mm(exit, plan.enter_mm_s) > block.length_mm {
            // Never above what the forward stage allowed, whatever the rounding.
            plan.enter_mm_s = plan.enter_mm_s.min(reach(&block.law, exit, block.length_mm));
        }
        exit = plan.enter_mm_s;
    }
    match plans.first() {
        Some(first) if first.enter_mm_s < start => Err(PlanError::TooShortToBrake {
            start_mm_s: start.to_f64(),
            greatest_mm_s: first.enter_mm_s.to_f64(),
        }),
        _ => Ok(()),
    }
}

/// Merges neighbours that are like one block: same ceiling, same law, and a junction that does not slow them.
/// This hardly ever makes the plan slower (by 1.4·10⁻³ in two of 20 000 random lists: a higher feed at one
/// junction can mean a lower one at the next). The merged blocks are at the front of the slice; returns their
/// number.
#[must_use]
pub fn merge_equal<R: Root>(blocks: &mut [Block<R>]) -> usize {
    merge_each(blocks, |_, _| ())
}

/// As [`merge_equal`]; calls `moved` for every block with its old index and the index of its merged block.
pub(super) fn merge_each<R: Root>(blocks: &mut [Block<R>], mut moved: impl FnMut(usize, usize)) -> usize {
    let mut merged: usize = 0;
    let longest = R::from_f64(Position::LIMIT_MM);
    for index in 0..blocks.len() {
        let Some(&next) = blocks.get(index) else { break };
        let last = merged.checked_sub(1).and_then(|last| blocks.get_mut(last));
        match last {
            Some(last)
                if last.cap_mm_s == next.cap_mm_s
                    && last.law == next.law
                    && last.junction_mm_s >= next.cap_mm_s
                    // Neither length is checked yet, and merging must not make a sum that is refused.
                    && next.length_mm <= longest
                    && last.length_mm <= longest - next.length_mm =>
            {
                last.length_mm = last.length_mm + next.length_mm;
                last.junction_mm_s = next.junction_mm_s;
            }
            _ => {
                if let Some(place) = blocks.get_mut(merged) {
                    *place = next;
                }
                merged += 1;
            }
        }
        moved(index, merged - 1);
    }
    merged
}
