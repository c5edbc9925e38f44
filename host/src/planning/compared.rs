//! Crossings of one junction, compared by the time that look-ahead takes over its neighbourhood.
//!
//! Consumes the moves of a run with their ceilings, how the other junctions are crossed, and the crossings to choose from; tells
//! the best, and when those that are left are not expected to be better. Background: plans of at most ten blocks, one for each
//! crossing. They are made when times are asked for, and once more if a crossing that is added later lowers the feeds at the ends
//! of all, which two pairs of plans may do.

use motion_kernel::law::Ramp;
use motion_kernel::plan::{Block, BlockPlan, Ceiling, Node, PlanError, nodes_for, plan, plan_spanning};

use super::ceilings::Ceilings;
use super::crossing::Crossing;
use crate::toolpath::smooth::Run;

/// Part of the time that a junction without a blend has to gain over the best one.
pub(super) const EXACT_GAIN_MIN: f64 = 0.002;

/// How many more moves are looked at on either side of those at a junction.
pub(super) const BESIDE: usize = 1;
/// Blocks of that many moves and of what rounds the junctions between them.
const BLOCKS: usize = 3 * (2 * BESIDE + 2) - 2;
/// How often the feeds at the ends of a comparison are lowered until every crossing can be planned.
const LOWERINGS: usize = 8;
/// Feeds that a plan has named as just possible, made a little less.
const LESS: f64 = 1.0 - 1.0e-9;
/// How much longer than the best the shorter blends have to be expected to take, so that they are not tried.
const CLEAR: f64 = 1.01;
/// Lengths and feeds that differ by less than this part are alike.
const ALIKE: f64 = 1.0e-6;

/// Crossings of a junction that are compared.
pub(super) struct Compared<'a, const N: usize> {
    run: &'a Run<N>,
    /// The ceilings of the moves.
    ceilings: &'a [Ceilings],
    junction: usize,
    /// How the others are crossed.
    chosen: &'a [Crossing<N>],
    /// Feeds at both ends of the neighbourhood, with which all crossings can be planned \[mm/s\].
    feeds_mm_s: [f64; 2],
    crossings: Vec<(Crossing<N>, Window)>,
    /// The plans of the first crossings, in their order; `plan_all` makes those that are missing.
    plans: Vec<Planned>,
    /// Where those of one size end.
    ends: Vec<usize>,
}

/// The neighbourhood of a junction.
struct Window {
    blocks: Vec<Block<f64>>,
    /// Which block is the blend, if there is one.
    blend: Option<usize>,
}

/// How a neighbourhood is driven.
#[derive(Clone, Copy)]
struct Planned {
    /// Infinite if there is no plan \[s\].
    time_s: f64,
    /// There is a blend, and it is driven at its ceiling all along.
    is_level: bool,
}

impl<'a, const N: usize> Compared<'a, N> {
    pub(super) fn new(
        run: &'a Run<N>,
        ceilings: &'a [Ceilings],
        junction: usize,
        chosen: &'a [Crossing<N>],
    ) -> Self {
        let (first, last) = beside(run, junction);
        let feed = |junction: Option<usize>| {
            junction.and_then(|junction| chosen.get(junction)).map_or(0.0, |crossing| crossing.feed_mm_s)
        };
        let feeds_mm_s = [feed(first.checked_sub(1)), feed(Some(last))];
        let (crossings, plans, ends) = (Vec::new(), Vec::new(), Vec::new());
        Self { run, ceilings, junction, chosen, feeds_mm_s, crossings, plans, ends }
    }

    /// Adds a crossing; it is planned when a time is asked for.
    pub(super) fn add(&mut self, crossing: Crossing<N>) {
        let window = self.window(&crossing);
        self.crossings.push((crossing, window));
        let feeds_mm_s = self.common_feeds();
        if feeds_mm_s != self.feeds_mm_s {
            self.feeds_mm_s = feeds_mm_s;
            self.plans.clear();
        }
    }

    /// Makes the plans that are missing.
    fn plan_all(&mut self) {
        let new = self.crossings[self.plans.len()..].iter();
        self.plans.extend(new.map(|(_, window)| window.planned(self.feeds_mm_s)));
    }

    /// Whether the last is a blend that is no better than those before, though it is driven at its ceiling all along.
    pub(super) fn is_level_in_vain(&mut self) -> bool {
        self.plan_all();
        let Some((last, before)) = self.plans.split_last() else { return false };
        last.is_level && last.time_s >= self.best_s(before)
    }

    /// Feeds at both ends that all crossings, of which the last is new, can be planned with \[mm/s\]: at most those that the
    /// others can.
    fn common_feeds(&self) -> [f64; 2] {
        let Some(((_, new), others)) = self.crossings.split_last() else { return self.feeds_mm_s };
        let mut feeds_mm_s = lowered(&new.blocks, self.feeds_mm_s);
        if feeds_mm_s == self.feeds_mm_s {
            return feeds_mm_s;
        }
        for _ in 0..LOWERINGS {
            let before = feeds_mm_s;
            for (_, window) in others {
                feeds_mm_s = lowered(&window.blocks, feeds_mm_s);
            }
            feeds_mm_s = lowered(&new.blocks, feeds_mm_s);
            if feeds_mm_s == before {
                return feeds_mm_s;
            }
        }
        [0.0; 2]
    }

    /// The least time of the first crossings, whose plans these are; one without a blend counts for what it has to gain \[s\].
    fn best_s(&self, plans: &[Planned]) -> f64 {
        let time_s = |((crossing, _), plan): (&(Crossing<N>, Window), &Planned)| {
            if crossing.blend().is_some() { plan.time_s } else { plan.time_s / (1.0 - EXACT_GAIN_MIN) }
        };
        self.crossings.iter().zip(plans).map(time_s).fold(f64::INFINITY, f64::min)
    }

    /// Those that were added since this was said before are of one size; the first have no blend.
    pub(super) fn end_size(&mut self) {
        self.ends.push(self.crossings.len());
    }

    /// Whether blends of the `left` sizes that are to be added are not expected to be the best: each may gain as much as the
    /// last did. Ever shorter ones are added.
    pub(super) fn is_beyond(&mut self, left: usize) -> bool {
        let [.., start, before, last] = self.ends[..] else { return false };
        self.plan_all();
        let (before, last) = (&self.plans[start..before], &self.plans[before..last]);
        let is_known = before.iter().chain(last).all(|plan| plan.time_s.is_finite());
        let (best_s, before_s, last_s) = (self.best_s(&self.plans), least_s(before), least_s(last));
        let gain_s = (before_s - last_s).max(0.0);
        is_known && last_s - left as f64 * gain_s > CLEAR * best_s
    }

    /// The best: a blend, unless another way gains [`EXACT_GAIN_MIN`]; the one that is chosen if none has a plan.
    pub(super) fn best(mut self) -> Crossing<N> {
        self.plan_all();
        let mut best = (&self.chosen[self.junction], f64::INFINITY);
        for has_blend in [true, false] {
            let gain = if has_blend { 0.0 } else { EXACT_GAIN_MIN };
            for ((crossing, _), plan) in self.crossings.iter().zip(&self.plans) {
                if crossing.blend().is_some() == has_blend && plan.time_s < (1.0 - gain) * best.1 {
                    best = (crossing, plan.time_s);
                }
            }
        }
        best.0.clone()
    }

    /// The neighbourhood of the junction, which is crossed as `crossing` says.
    fn window(&self, crossing: &Crossing<N>) -> Window {
        let crossing = |junction: usize| {
            if junction == self.junction { Some(crossing) } else { self.chosen.get(junction) }
        };
        let trims_mm =
            |junction: Option<usize>| junction.and_then(crossing).map_or([0.0; 2], Crossing::trims_mm);
        let (first, last) = beside(self.run, self.junction);
        let mut blocks = Vec::with_capacity(BLOCKS);
        let mut blend = None;
        for index in first..=last {
            let ([_, first_mm], [last_mm, _]) = (trims_mm(index.checked_sub(1)), trims_mm(Some(index)));
            let length_mm = self.run.length_mm(index) - first_mm - last_mm;
            let after = crossing(index).filter(|_| index < last);
            let junction_mm_s = after.map_or(f64::INFINITY, Crossing::enter_mm_s);
            let block = |length_mm, ceiling: &Ceiling<f64>, junction_mm_s| Block {
                length_mm,
                cap_mm_s: ceiling.feed_mm_s,
                junction_mm_s,
                law: ceiling.law,
            };
            blocks.push(block(length_mm, &self.ceilings[index].programmed, junction_mm_s));
            if index == self.junction && after.is_some_and(|crossing| crossing.blend().is_some()) {
                blend = Some(blocks.len());
            }
            blocks.extend(
                after
                    .map_or(&[][..], Crossing::driven)
                    .iter()
                    .map(|driven| block(driven.bent.length_mm, &driven.ceilings.programmed, driven.end_mm_s)),
            );
        }
        Window { blocks, blend }
    }
}

impl Window {
    fn planned(&self, [start_mm_s, end_mm_s]: [f64; 2]) -> Planned {
        let before = &self.blocks[..self.blend.unwrap_or(0)];
        let start_mm: f64 = before.iter().map(|block| block.length_mm).sum();
        let (length_mm, cap_mm_s) = match self.blend.and_then(|blend| self.blocks.get(blend)) {
            Some(blend) => (blend.length_mm, blend.cap_mm_s),
            None => (0.0, f64::INFINITY),
        };
        let end_mm = start_mm + length_mm;
        let mut level_mm = 0.0;
        let mut add_level = |at_mm: f64, ramp: &Ramp<f64>| {
            if ramp.is_cruise() && ramp.from_mm_s >= (1.0 - ALIKE) * cap_mm_s && at_mm < end_mm {
                level_mm += ((at_mm + ramp.length_mm()).min(end_mm) - at_mm.max(start_mm)).max(0.0);
            }
        };
        let mut nodes = [Node::EMPTY; nodes_for(BLOCKS)];
        let time_s = plan_spanning(&self.blocks, start_mm_s, end_mm_s, &mut nodes, &mut add_level);
        let is_level = self.blend.is_some() && level_mm >= (1.0 - ALIKE) * length_mm;
        let time_s = time_s.ok().flatten().unwrap_or(f64::INFINITY);
        Planned { time_s, is_level: is_level && time_s.is_finite() }
    }
}

/// The first and the last move that are looked at for a junction.
fn beside<const N: usize>(run: &Run<N>, junction: usize) -> (usize, usize) {
    (junction.saturating_sub(BESIDE), (junction + 1 + BESIDE).min(run.junctions()))
}

fn least_s(plans: &[Planned]) -> f64 {
    plans.iter().map(|plan| plan.time_s).fold(f64::INFINITY, f64::min)
}

/// Feeds at both ends that blocks can be planned with, at most `feeds` \[mm/s\].
fn lowered(blocks: &[Block<f64>], mut feeds: [f64; 2]) -> [f64; 2] {
    if blocks.iter().any(|block| !(block.length_mm > 0.0)) {
        return feeds;
    }
    for _ in 0..LOWERINGS {
        let mut plans = [BlockPlan::default(); BLOCKS];
        match plan(blocks, feeds[0], feeds[1], &mut plans[..blocks.len()]) {
            Ok(()) => return feeds,
            Err(PlanError::TooShortToBrake { greatest_mm_s, .. }) => feeds[0] = LESS * greatest_mm_s,
            Err(PlanError::TooShortToAccelerate { greatest_mm_s, .. }) => feeds[1] = LESS * greatest_mm_s,
            Err(PlanError::EndFeed { quantity, greatest_mm_s, .. }) => {
                feeds[usize::from(quantity == "end feed")] = greatest_mm_s;
            }
            Err(_) => return [0.0; 2],
        }
    }
    [0.0; 2]
}

#[cfg(test)]
impl<const N: usize> Compared<'_, N> {
    /// The times of those that were added, in their order \[s\].
    pub(super) fn times_s(&mut self) -> Vec<f64> {
        self.plan_all();
        self.plans.iter().map(|plan| plan.time_s).collect()
    }
}
