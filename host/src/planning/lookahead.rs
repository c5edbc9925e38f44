//! The kernel's planner over a list of blocks, in the host's memory.
//!
//! [`LookAhead`] plans a path that grows. What is known of it is planned to rest at its end; then the ramps are settled up to
//! a place that more path does not change: where the feed is at a minimum, or level at a ceiling.

use motion_kernel::law::{PlannedRamp, Ramp};
use motion_kernel::plan::{Block, BlockPlan, Effort, Memory, Node, Path, PlanError, nodes_for, plan_ramps};
use motion_kernel::units::Position;

use super::Mode;
use super::error::{AtLine, Problem};
use crate::toolpath::on_path;

/// Halvings of the feed at an end between one that is reached and one that is not: to 10⁻⁹ of their difference.
const HALVINGS: usize = 30;

/// Plans blocks that end at `ends_mm`, from one feed to another. An error comes with the index of the block.
pub(super) fn lookahead(
    blocks: &[Block<f64>],
    ends_mm: &[f64],
    feeds_mm_s: [f64; 2],
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedRamp>, (usize, Problem)> {
    let mut ends = Vec::with_capacity(blocks.len());
    for (index, &end_mm) in ends_mm.iter().enumerate() {
        ends.push(on_path(end_mm).map_err(|error| (index, error.into()))?);
    }
    over(blocks, &ends, feeds_mm_s, mode, tick_s)
}

fn over(
    blocks: &[Block<f64>],
    ends: &[Position],
    feeds_mm_s: [f64; 2],
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedRamp>, (usize, Problem)> {
    let plan = |feeds_mm_s| planned(blocks, ends, feeds_mm_s, mode, tick_s);
    plan(feeds_mm_s).map_err(|error| match error {
        PlanError::Ramp { start, error } => (block_at(ends, start), Problem::Segment { error, tick_s }),
        PlanError::Block { block, .. } => (block, error.into()),
        _ => (0, greatest(error, feeds_mm_s, |feeds_mm_s| plan(feeds_mm_s).is_ok()).into()),
    })
}

/// A path from rest that grows.
pub(super) struct LookAhead {
    mode: Mode,
    tick_s: f64,
    /// Blocks that are not settled to their ends, where they end, and their program lines.
    blocks: Vec<Block<f64>>,
    ends: Vec<Position>,
    lines: Vec<u32>,
    /// Ramps are settled up to here; the feed there \[mm/s\].
    settled: Position,
    feed_mm_s: f64,
    /// The ramps behind that, to rest at the end of the path as it was known, and that end.
    rest: (Vec<PlannedRamp>, Position),
}

impl LookAhead {
    /// A path without blocks.
    pub(super) fn new(mode: Mode, tick_s: f64) -> Self {
        Self {
            mode,
            tick_s,
            blocks: Vec::new(),
            ends: Vec::new(),
            lines: Vec::new(),
            settled: Position::ZERO,
            feed_mm_s: 0.0,
            rest: (Vec::new(), Position::ZERO),
        }
    }

    /// The path goes on with a block of a program line, which ends at `end`.
    pub(super) fn push(&mut self, line: u32, block: Block<f64>, end: Position) {
        self.blocks.push(block);
        self.ends.push(end);
        self.lines.push(line);
    }

    /// The greatest feed from the last block to the one that is pushed next.
    pub(super) fn set_junction(&mut self, junction_mm_s: f64) {
        if let Some(last) = self.blocks.last_mut() {
            last.junction_mm_s = junction_mm_s;
        }
    }

    /// Appends the ramps that are settled; all, if the path ends here.
    pub(super) fn settle(&mut self, goes_on: bool, ramps: &mut Vec<PlannedRamp>) -> AtLine<()> {
        // S3's plan is one for the whole stretch.
        if self.blocks.is_empty() || goes_on && self.mode == Mode::PerBlock {
            return Ok(());
        }
        let mut planned = match self.planned() {
            Ok(planned) => planned,
            // Where it was planned to rest, it may.
            Err(_) if !self.rest.0.is_empty() => {
                let (rest, end) = std::mem::take(&mut self.rest);
                ramps.extend(rest);
                self.go_on(end, 0.0);
                self.planned()?
            }
            Err(error) => return Err(error),
        };
        if !goes_on {
            ramps.append(&mut planned);
            *self = Self::new(self.mode, self.tick_s);
            return Ok(());
        }
        let end = self.ends.last().copied().unwrap_or(self.settled);
        if let Some((count, within)) = self.settled_of(&planned) {
            let mut rest = planned.split_off(count);
            ramps.append(&mut planned);
            let start = planned_end(ramps, self.settled, count);
            if let (Some(within), Some(cruise)) = (within, rest.first_mut()) {
                let (done, left) = divided(*cruise, within - start);
                ramps.push(done);
                *cruise = left;
            }
            let feed_mm_s = rest.first().map_or(0.0, |next| next.ramp.from_mm_s);
            self.go_on(within.unwrap_or(start), feed_mm_s);
            planned = rest;
        }
        self.rest = (planned, end);
        Ok(())
    }

    fn go_on(&mut self, from: Position, feed_mm_s: f64) {
        (self.settled, self.feed_mm_s) = (from, feed_mm_s);
        let done = self.ends.partition_point(|&end| end <= from);
        self.blocks.drain(..done);
        self.ends.drain(..done);
        self.lines.drain(..done);
    }

    /// From the settled place to rest at the end of what is known.
    fn planned(&self) -> AtLine<Vec<PlannedRamp>> {
        let (mut blocks, mut ends) = (self.blocks.clone(), self.ends.clone());
        ends.iter_mut().for_each(|end| *end = *end - self.settled);
        if self.settled > Position::ZERO
            && let (Some(first), Some(end)) = (blocks.first_mut(), ends.first())
        {
            // The part of it that is left.
            first.length_mm = first.length_mm.min(end.to_mm());
        }
        let line = |block: usize| self.lines.get(block).copied().unwrap_or(0);
        over(&blocks, &ends, [self.feed_mm_s, 0.0], self.mode, self.tick_s)
            .map_err(|(block, problem)| (line(block), problem))
    }

    /// How many of these ramps more path does not change, and up to which place of the one behind, a cruise.
    fn settled_of(&self, planned: &[PlannedRamp]) -> Option<(usize, Option<Position>)> {
        let (mut start, mut found, mut fell) = (self.settled, None, false);
        for (index, PlannedRamp { ramp, length }) in planned.iter().enumerate() {
            let (end, is_rise) = (start + *length, ramp.to_mm_s > ramp.from_mm_s);
            let is_first = index == 0;
            if ramp.is_cruise() && self.is_ceiling(start, ramp.from_mm_s) {
                let within = self.level_to(start, end, ramp.from_mm_s);
                if !is_first || within.is_some() {
                    found = Some((index, within));
                }
            } else if is_rise && fell && !is_first {
                found = Some((index, None));
            }
            fell = !is_rise && (!ramp.is_cruise() || fell);
            start = end;
        }
        found
    }

    /// The last end of a block within a cruise up to which no block allows more.
    fn level_to(&self, start: Position, end: Position, feed_mm_s: f64) -> Option<Position> {
        let blocks = self.blocks.iter().zip(&self.ends).skip(block_at(&self.ends, start));
        let level = blocks.take_while(|&(block, &at)| at < end && feed_mm_s >= block.cap_mm_s * CEILING);
        level.map(|(_, &at)| at).last().filter(|&at| at > start)
    }

    /// Whether nothing on the block at a place is faster.
    fn is_ceiling(&self, at: Position, feed_mm_s: f64) -> bool {
        let block = self.blocks.get(block_at(&self.ends, at));
        block.is_some_and(|block| feed_mm_s >= block.cap_mm_s * CEILING)
    }
}

/// Feeds from this part of a ceiling on are at it.
const CEILING: f64 = 1.0 - 1.0e-9;

/// Where the last `count` of `ramps` end, which start at `start`.
fn planned_end(ramps: &[PlannedRamp], start: Position, count: usize) -> Position {
    ramps.iter().rev().take(count).fold(start, |end, planned| end + planned.length)
}

/// A cruise in two, the first of which is `length` long.
fn divided(PlannedRamp { ramp, length: all }: PlannedRamp, length: Position) -> (PlannedRamp, PlannedRamp) {
    let over = |length: Position| PlannedRamp {
        ramp: Ramp::cruise(ramp.from_mm_s, length.to_mm() / ramp.from_mm_s),
        length,
    };
    (over(length), over(all - length))
}

fn planned(
    blocks: &[Block<f64>],
    ends: &[Position],
    feeds_mm_s: [f64; 2],
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedRamp>, PlanError> {
    let (effort, nodes) = match mode {
        Mode::Spanning => (Effort::Spanning, nodes_for(blocks.len())),
        Mode::PerBlock => (Effort::PerBlock, 0),
    };
    let path = Path {
        blocks: &mut blocks.to_vec(),
        ends: &mut ends.to_vec(),
        start: Position::ZERO,
        feeds_mm_s,
        tick_s,
    };
    let memory =
        Memory { plans: &mut vec![BlockPlan::default(); blocks.len()], nodes: &mut vec![Node::EMPTY; nodes] };
    let mut ramps: Vec<PlannedRamp> = Vec::new();
    plan_ramps(path, effort, memory, &mut |index, ramp| {
        ramps.truncate(index);
        ramps.push(ramp);
        true
    })
    .map(|_| ramps)
}

/// A refusal of the feed at an end with the greatest feed there that has a plan: the planner names the one that a pair of
/// ramps for each block has, which ramps over several blocks may exceed.
fn greatest(mut error: PlanError, feeds_mm_s: [f64; 2], has_plan: impl Fn([f64; 2]) -> bool) -> PlanError {
    let [start_mm_s, end_mm_s] = feeds_mm_s;
    let (greatest_mm_s, refused_mm_s, is_start) = match &mut error {
        PlanError::TooShortToBrake { greatest_mm_s, .. } => (greatest_mm_s, start_mm_s, true),
        PlanError::TooShortToAccelerate { greatest_mm_s, .. } => (greatest_mm_s, end_mm_s, false),
        _ => return error,
    };
    let mut refused_mm_s = refused_mm_s;
    for _ in 0..HALVINGS {
        let feed_mm_s = 0.5 * (*greatest_mm_s + refused_mm_s);
        if has_plan(if is_start { [feed_mm_s, end_mm_s] } else { [start_mm_s, feed_mm_s] }) {
            *greatest_mm_s = feed_mm_s;
        } else {
            refused_mm_s = feed_mm_s;
        }
    }
    error
}

/// The index of the block, of those that end at `ends`, on which a ramp starts at `start`.
pub(super) fn block_at(ends: &[Position], start: Position) -> usize {
    ends.partition_point(|&end| end <= start).min(ends.len().saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use motion_kernel::law::{Law, Limits, Pulse};

    use super::*;

    /// Blocks of no length have no ramps.
    #[test]
    fn a_ramp_belongs_to_the_block_on_which_it_starts() {
        let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
        let law = Law::new(Pulse::Plateau, limits).expect("positive limits");
        let block = |length_mm, cap_mm_s| Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law };
        let blocks = [block(0.0, 80.0), block(50.0, 80.0), block(0.0, 40.0), block(25.0, 40.0)];
        let ends_mm = [0.0, 50.0, 50.0, 75.0];
        let ends = ends_mm.map(|mm| on_path(mm).expect("in range"));
        for mode in [Mode::Spanning, Mode::PerBlock] {
            let planned = lookahead(&blocks, &ends_mm, [0.0; 2], mode, 0.0005).expect("a plan");
            let (mut at, mut found) = (Position::ZERO, Vec::new());
            for ramp in planned {
                found.push(block_at(&ends, at));
                at = at + ramp.length;
            }
            found.dedup();
            assert_eq!(found, [1, 3], "{mode:?}");
            assert!((at.to_mm() - 75.0).abs() < 1e-9);
        }
    }
}
