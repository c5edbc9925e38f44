//! Chooses the junctions that are blended, and the length of each blend.
//!
//! Consumes a run of moves with their tolerances; produces blocks with ceiling, law and junction feed, ready
//! for look-ahead. Background, a bounded number of blends and of plans of at most ten blocks for each
//! junction.
//!
//! **A blend has to pay.** Jerk and snap bound the motion round a corner: within a small tolerance it may
//! take longer than a stop on the corner, and between a slow and a fast move a blend keeps the fast one slow.
//! So every junction is tried as it is (a stop, or what the acceleration-step limit lets pass) and with
//! blends of some lengths, each once with [`BLEND_FEED_SHARE`], which leaves nothing for changing the feed on
//! it, and once as a curve like any other. They are [compared](super::compared) by the time that look-ahead takes over
//! both moves and one more on either side, with the choices for the neighbouring junctions. The shortest is taken,
//! but a junction without a blend has to gain a five-hundredth of it: G64 asks for smooth motion. Looking at
//! one junction after the other does not find the best of all; in the end the run is planned with every blend
//! at its longest and as it was programmed, too, and the best of these is taken. So blends and merged lines
//! cost at most that part of the time that the exact path takes without its kinks.
//!
//! **What is not expected to gain is left out**: shorter blends once they lose more than those that are left would gain back at
//! the last rate, ramps on a blend that is driven at its ceiling all along and is no better, and a whole run whose longest
//! blends would take too long even if they left all of the limits to ramps.
//!
//! **Tangent junctions** whose curvature jumps are treated alike: passed without a blend they fall under the
//! acceleration-step limit as under G61, because a path of bounded jerk through them can take longer (on the
//! arcs of a few millimetres that a corner is rounded with, by a seventh). If no such step is wanted, the
//! machine's limit says so: with a small one only the blend pays.
//!
//! **Kinks** are not passed, however small they are: velocity does not step. Where G61 would pass one, it has a blend or an
//! [easement](crate::toolpath::easement), or is a part of what a curve or a merged line stands for; where none fits the
//! tolerance, a stop.

mod unblended;

use std::cell::OnceCell;
use std::rc::Rc;

use motion_kernel::law::Law;
use motion_kernel::plan::{BLEND_FEED_SHARE, Block, Node, nodes_for, plan_spanning};

use super::Mode;
use super::ceilings::{Ceilings, along, ceilings, in_any_direction};
use super::compared::{BESIDE, Compared, EXACT_GAIN_MIN};
use super::crossing::{By, Crossing, Driven, Rounding};
use super::error::AtLine;
use super::lookahead::lookahead;
use super::shapes::{MeasuredBlend, MeasuredCurve, Shapes};
use super::stretch::StretchBlock;
use crate::machine::Machine;
use crate::toolpath::blend::feed_within;
use crate::toolpath::smooth::{Move, Run};
use crate::toolpath::{norm, subtract};

/// A second, smaller bound of the corners that curves through dense moves are led past \[rad\], beside the machine's: a stop
/// on a corner may take less time.
const FLAT_CORNER_RAD: f64 = 75.0 * core::f64::consts::PI / 180.0;

/// Lengths of blends that are tried, as parts of the longest one.
const SIZES: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// How much longer than the best found the longest blends may take for others to be tried: these gain up to
/// an eighth.
const PROMISING: f64 = 1.15;
/// How often a junction is looked at at most.
const SWEEPS: usize = 4;

/// The blocks of a run that starts and ends at rest; the junction feed of the last one is 0. An error comes
/// with the program line.
pub(super) fn blocks<const N: usize>(
    moves: &[Move<N>],
    machine: &Machine<N>,
) -> AtLine<Vec<StretchBlock<N>>> {
    let shapes = Shapes::new(in_any_direction(moves, machine), machine.letters_by_place());
    let mut candidates = curved(moves, &shapes, machine);
    let fastest_s = candidates.iter().map(|timed| timed.time_s).fold(f64::INFINITY, f64::min);
    let junctions = Junctions::new(Run::new(moves), &shapes, machine)?;
    let is_merged = junctions.run.moves().len() < moves.len();
    let chosen = junctions.choose(fastest_s)?;
    if chosen.is_empty() && (is_merged || candidates.is_empty()) {
        candidates.push(junctions.timed(&junctions.exact()?));
    }
    candidates.extend(chosen);
    let as_programmed =
        if is_merged { Junctions::new(Run::exact(moves), &shapes, machine)? } else { junctions };
    let most_s = candidates.iter().map(|timed| timed.time_s).fold(f64::INFINITY, f64::min);
    // Before all its kinks are eased: what it takes at least.
    let exact = if as_programmed.least_exact_s() < (1.0 - EXACT_GAIN_MIN) * most_s {
        Some(as_programmed.timed(&as_programmed.exact()?))
    } else {
        None
    };
    let mut most_s = exact.as_ref().map_or(f64::INFINITY, |exact| exact.time_s / (1.0 - EXACT_GAIN_MIN));
    let mut best = exact;
    for timed in candidates {
        if best.is_none() || timed.time_s < most_s {
            most_s = timed.time_s;
            best = Some(timed);
        }
    }
    Ok(best.map_or_else(Vec::new, |best| best.blocks))
}

/// The blocks of a run with curves in place of what is dense, once for each bound of corners that makes a difference.
fn curved<const N: usize>(moves: &[Move<N>], shapes: &Shapes<N>, machine: &Machine<N>) -> Vec<Timed<N>> {
    let limits = shapes.limits();
    let corners_rad = [machine.path.corner_angle_rad, machine.path.corner_angle_rad.min(FLAT_CORNER_RAD)];
    let (mut candidates, mut most_s) = (Vec::new(), f64::INFINITY);
    for run in Run::faired(moves, &corners_rad, limits, machine.path.feed_mm_s, &machine.letters_by_place()) {
        // Nobody has programmed a curve: one that has no ceilings is no candidate.
        let Ok(junctions) = Junctions::new(run, shapes, machine) else { continue };
        let Ok(mut chosen) = junctions.choose(most_s) else { continue };
        let exact = || junctions.exact().map(|exact| junctions.timed(&exact));
        let Ok(timed) = chosen.pop().map_or_else(exact, Ok) else { continue };
        most_s = most_s.min(timed.time_s);
        candidates.push(timed);
    }
    candidates
}

/// The blocks of a run, and the time that they take \[s\], infinite if there is no plan.
struct Timed<const N: usize> {
    blocks: Vec<StretchBlock<N>>,
    time_s: f64,
}

/// The junctions of a run.
struct Junctions<'a, const N: usize> {
    run: Run<N>,
    shapes: &'a Shapes<N>,
    /// The ceilings of the moves.
    ceilings: Vec<Ceilings>,
    /// Which junctions are kinks that might be passed under G61, but are to be smooth.
    are_eased: Vec<bool>,
    /// Each junction without a blend, once it was asked for.
    exact: Vec<OnceCell<Crossing<N>>>,
    machine: &'a Machine<N>,
}

impl<'a, const N: usize> Junctions<'a, N> {
    fn new(run: Run<N>, shapes: &'a Shapes<N>, machine: &'a Machine<N>) -> AtLine<Self> {
        let is_eased = |kink_rad: f64| kink_rad <= machine.path.junction_angle_rad;
        Ok(Self {
            ceilings: along(&run, machine)?,
            are_eased: (0..run.junctions())
                .map(|junction| run.kink_rad(junction).is_some_and(is_eased))
                .collect(),
            exact: vec![OnceCell::new(); run.junctions()],
            shapes,
            run,
            machine,
        })
    }

    /// The run with all blends at their longest, and with those that were found best one by one, unless the
    /// first takes so much longer than `most_s` that this would, too; none where there is nothing to blend, or
    /// where that is seen before.
    fn choose(&self, most_s: f64) -> AtLine<Vec<Timed<N>>> {
        // First as if each were alone, then those that touch within what the other leaves.
        let junctions = 0..self.run.junctions();
        let alone: Vec<Option<Rc<MeasuredBlend<N>>>> =
            junctions.map(|junction| self.longest(junction)).collect();
        if alone.iter().all(Option::is_none) {
            return Ok(Vec::new());
        }
        let mut alone_mm = Vec::with_capacity(alone.len());
        for (junction, blended) in alone.iter().enumerate() {
            alone_mm.push(match blended {
                Some(blended) => [blended.blend.trim_mm; 2],
                None => self.exact_at(junction)?.trims_mm(),
            });
        }
        let room_mm = |(junction, trims_mm): (usize, &[f64; 2])| {
            least(self.rooms_mm(junction, |junction| alone_mm[junction])).min(trims_mm[0])
        };
        let rooms_mm: Vec<f64> = alone_mm.iter().enumerate().map(room_mm).collect();
        if most_s.is_finite() && self.about_s(&alone, &rooms_mm)? > PROMISING * most_s {
            return Ok(Vec::new());
        }
        let mut chosen = Vec::with_capacity(alone.len());
        for (junction, blended) in alone.iter().enumerate() {
            let room_mm = rooms_mm[junction];
            let blended = match blended {
                Some(blended) if blended.blend.trim_mm > room_mm => {
                    self.shapes.blend(&self.run, junction, room_mm)
                }
                blended => blended.clone(),
            };
            chosen.push(match blended {
                Some(blended) => self.rounded(junction, &blended, BLEND_FEED_SHARE)?,
                None => self.exact_at(junction)?,
            });
        }
        for junction in 0..chosen.len() {
            if let Some(rounding) = chosen[junction].blend() {
                let shares = self.shared(junction, &rounding.blended)?;
                chosen[junction] = self.best_of(junction, shares, &chosen);
            }
        }
        let longest = self.timed(&chosen);
        if longest.time_s > PROMISING * most_s {
            return Ok(vec![longest]);
        }
        self.settle(&mut chosen, |junction, chosen| match &alone[junction] {
            Some(alone) => self.best(junction, alone, chosen),
            None => Ok(chosen[junction].clone()),
        })?;
        Ok(vec![longest, self.timed(&chosen)])
    }

    /// Takes what is `best` at each junction, until nothing changes or each was looked at so many times.
    fn settle(
        &self,
        chosen: &mut [Crossing<N>],
        mut best: impl FnMut(usize, &[Crossing<N>]) -> AtLine<Crossing<N>>,
    ) -> AtLine<()> {
        // Junctions next to a change are looked at again.
        let mut is_open = vec![true; chosen.len()];
        for _ in 0..SWEEPS {
            for junction in 0..chosen.len() {
                if !std::mem::take(&mut is_open[junction]) {
                    continue;
                }
                let best = best(junction, chosen)?;
                if best != chosen[junction] {
                    chosen[junction] = best;
                    let beside = junction.saturating_sub(BESIDE + 1)..chosen.len().min(junction + BESIDE + 2);
                    is_open[beside].iter_mut().for_each(|is_open| *is_open = true);
                    is_open[junction] = false;
                }
            }
        }
        Ok(())
    }

    /// The longest blend of a junction, as if it were alone.
    fn longest(&self, junction: usize) -> Option<Rc<MeasuredBlend<N>>> {
        let room_mm = self.run.taken_mm_max(junction).min(self.run.taken_mm_max(junction + 1));
        self.shapes.blend(&self.run, junction, room_mm)
    }

    /// About the time that the run takes with blends, of which those `alone` are the longest, cut to these rooms \[s\]: rather less,
    /// because each is as fast as the longest by itself within the limits of the path, whatever those of the axes are, and
    /// leaves all of the limits to ramps. Rotary axes may relax the limits of the path: then it is nothing.
    fn about_s(&self, alone: &[Option<Rc<MeasuredBlend<N>>>], rooms_mm: &[f64]) -> AtLine<f64> {
        let is_linear = self.machine.linear_places();
        let is_rotary = |step: &Move<N>| {
            step.element.moves().iter().zip(is_linear).any(|(&moves, linear)| moves && !linear)
        };
        let path = self.machine.limits().path.limits;
        let (Ok(all), false) =
            (Law::new(self.machine.path.pulse, path), self.run.moves().iter().any(is_rotary))
        else {
            return Ok(0.0);
        };
        let trim_mm = |junction: Option<usize>| {
            let blended = junction.filter(|&junction| alone.get(junction).is_some_and(Option::is_some));
            blended.map_or(0.0, |junction| rooms_mm[junction])
        };
        let (mut time_s, mut blocks) = (0.0, Vec::new());
        for (index, Ceilings { programmed, .. }) in self.ceilings.iter().enumerate() {
            let length_mm = self.run.length_mm(index) - trim_mm(index.checked_sub(1)) - trim_mm(Some(index));
            let after = alone.get(index);
            let junction_mm_s = match after {
                Some(Some(_)) => f64::INFINITY,
                Some(None) => self.exact_at(index)?.feed_mm_s,
                None => 0.0,
            };
            let (cap_mm_s, law) = (programmed.feed_mm_s, programmed.law);
            blocks.push(Block { length_mm, cap_mm_s, junction_mm_s, law });
            if let Some(Some(blended)) = after {
                let (from, to) = blended.blend.element.ends_mm();
                let length_mm = norm(subtract(to, from)) * (rooms_mm[index] / blended.blend.trim_mm);
                let next_mm_s = self.ceilings[index + 1].programmed.feed_mm_s;
                let cap_mm_s = feed_within(&path, blended.blend.derivatives).min(cap_mm_s).min(next_mm_s);
                blocks.push(Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law: all });
            }
            if junction_mm_s <= 0.0 {
                time_s += spanned_s(&blocks);
                blocks.clear();
            }
        }
        Ok(time_s)
    }

    /// The rooms of the moves of a junction where the others trim by `trims_mm`.
    fn rooms_mm(&self, junction: usize, trims_mm: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        self.run.rooms_mm(junction, self.other_trims_mm(junction, trims_mm))
    }

    /// The same, at most half of either move.
    fn halves_mm(&self, junction: usize, trims_mm: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        self.run.halves_mm(junction, self.other_trims_mm(junction, trims_mm))
    }

    /// What trims the moves of a junction at their other ends.
    fn other_trims_mm(&self, junction: usize, trims_mm: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        let after = junction + 1;
        let [after_mm, _] = if after < self.run.junctions() { trims_mm(after) } else { [0.0; 2] };
        let [_, before_mm] = junction.checked_sub(1).map_or([0.0; 2], trims_mm);
        [before_mm, after_mm]
    }

    /// All as they are, but that kinks are eased.
    fn exact(&self) -> AtLine<Vec<Crossing<N>>> {
        let all = (0..self.run.junctions()).map(|junction| self.exact_at(junction));
        let exact = all.collect::<AtLine<Vec<_>>>()?;
        if exact.iter().all(|crossing| crossing.by == By::Itself) {
            return Ok(exact);
        }
        let mut settled = exact.clone();
        self.settle(&mut settled, |junction, settled| {
            let mut compared = Compared::new(&self.run, &self.ceilings, junction, settled);
            if let By::Easement(_) = settled[junction].by {
                self.add_easements(&mut compared, junction, settled)?;
            }
            Ok(compared.best())
        })?;
        Ok(if self.timed(&settled).time_s < self.timed(&exact).time_s { settled } else { exact })
    }

    /// The time that the moves take at least without blends, as if kinks that are eased were none \[s\].
    fn least_exact_s(&self) -> f64 {
        let passed = Crossing { by: By::Itself, feed_mm_s: f64::INFINITY };
        let mut blocks = self.blocks(&vec![passed; self.run.junctions()]);
        for junction in (0..self.run.junctions()).filter(|&junction| self.are_eased[junction]) {
            blocks[junction].junction_mm_s = f64::INFINITY;
        }
        run_time_s(&blocks, self.machine.tick_s)
    }

    /// A junction with a blend, driven at a share.
    fn rounded(&self, junction: usize, blended: &Rc<MeasuredBlend<N>>, share: f64) -> AtLine<Crossing<N>> {
        let driven = self.driven(junction, &self.shapes.bent(blended), share)?;
        let feed_mm_s = driven.ceilings.programmed.feed_mm_s;
        let rounding = Rounding { blended: Rc::clone(blended), share, driven };
        Ok(Crossing { feed_mm_s, by: By::Blend(Rc::new(rounding)) })
    }

    /// The same at each of the two shares.
    fn shared(&self, junction: usize, blended: &Rc<MeasuredBlend<N>>) -> AtLine<[Crossing<N>; 2]> {
        let at = |share: f64| self.rounded(junction, blended, share);
        Ok([at(BLEND_FEED_SHARE)?, at(self.machine.path.curve_feed_share)?])
    }

    /// What is put in the place of a junction, driven at a share.
    fn driven(&self, junction: usize, bent: &Rc<MeasuredCurve<N>>, share: f64) -> AtLine<Driven<N>> {
        let [before, after] = [junction, junction + 1].map(|index| &self.run.moves()[index]);
        let feed_mm_s = before.feeds.least(after.feeds).along(&bent.ratios);
        let ceilings = ceilings(feed_mm_s, &bent.greatest, &bent.ratios, share, self.machine)
            .map_err(|error| (before.line, error.into()))?;
        Ok(Driven { bent: Rc::clone(bent), ceilings, end_mm_s: f64::INFINITY })
    }

    /// The best crossing of a junction, whose longest blend is `alone` if there is room for it, the others being crossed as
    /// `chosen` says.
    fn best(
        &self,
        junction: usize,
        alone: &Rc<MeasuredBlend<N>>,
        chosen: &[Crossing<N>],
    ) -> AtLine<Crossing<N>> {
        let rooms_mm = self.rooms_mm(junction, |junction| chosen[junction].trims_mm());
        let longest_mm = least(rooms_mm).min(alone.blend.trim_mm);
        let mut compared = Compared::new(&self.run, &self.ceilings, junction, chosen);
        if !self.add_easements(&mut compared, junction, chosen)? {
            compared.add(self.exact_at(junction)?);
        }
        compared.end_size();
        for (index, size) in SIZES.into_iter().enumerate() {
            let room_mm = size * longest_mm;
            let blended = if room_mm == alone.blend.trim_mm {
                Some(Rc::clone(alone))
            } else {
                self.shapes.blend(&self.run, junction, room_mm)
            };
            match blended {
                Some(blended) => {
                    compared.add(self.rounded(junction, &blended, BLEND_FEED_SHARE)?);
                    // What is as fast as its curvature allows all along, and no better, has no use for ramps on it.
                    if !compared.is_level_in_vain() {
                        let share = self.machine.path.curve_feed_share;
                        compared.add(self.rounded(junction, &blended, share)?);
                    }
                    compared.end_size();
                    if compared.is_beyond(SIZES.len() - 1 - index) {
                        break;
                    }
                }
                None if index == 0 => break,
                None => {}
            }
        }
        Ok(compared.best())
    }

    /// The best of some crossings of a junction, the others being crossed as `chosen` says.
    fn best_of(
        &self,
        junction: usize,
        crossings: impl IntoIterator<Item = Crossing<N>>,
        chosen: &[Crossing<N>],
    ) -> Crossing<N> {
        let mut compared = Compared::new(&self.run, &self.ceilings, junction, chosen);
        crossings.into_iter().for_each(|crossing| compared.add(crossing));
        compared.best()
    }

    /// The blocks of the run, with their time.
    fn timed(&self, crossings: &[Crossing<N>]) -> Timed<N> {
        let blocks = self.blocks(crossings);
        Timed { time_s: run_time_s(&blocks, self.machine.tick_s), blocks }
    }

    /// The blocks of the run.
    fn blocks(&self, crossings: &[Crossing<N>]) -> Vec<StretchBlock<N>> {
        let mut blocks: Vec<StretchBlock<N>> = Vec::with_capacity(2 * self.ceilings.len());
        let trims_mm = |junction: Option<usize>| {
            junction.and_then(|junction| crossings.get(junction)).map_or([0.0; 2], Crossing::trims_mm)
        };
        for (index, (step, &ceilings)) in self.run.moves().iter().zip(&self.ceilings).enumerate() {
            let ([_, first_mm], [last_mm, _]) = (trims_mm(index.checked_sub(1)), trims_mm(Some(index)));
            let is_whole = first_mm == 0.0 && last_mm == 0.0;
            let (element, length_mm) = if is_whole {
                (step.element, self.run.length_mm(index))
            } else {
                let trimmed = step.element.trimmed(first_mm, last_mm);
                (trimmed, trimmed.length_mm())
            };
            let block = |element, length_mm, ceilings: Ceilings, is_smoothed, tolerance_share| StretchBlock {
                line: step.line,
                element,
                length_mm,
                ceiling: ceilings.programmed,
                greatest: ceilings.greatest,
                feed_mm_s: ceilings.feed_mm_s,
                junction_mm_s: 0.0,
                is_smoothed,
                tolerance_share,
            };
            let share = self.run.tolerance_share(index);
            blocks.push(block(element, length_mm, ceilings, step.tolerance_mm > 0.0, share));
            if let Some(crossing) = crossings.get(index) {
                let of = |driven: &Driven<N>| {
                    let share = self.run.tolerance_share_of(index, crossing.distance_mm());
                    block(driven.bent.element, driven.bent.length_mm, driven.ceilings, true, share)
                };
                blocks.extend(crossing.driven().iter().map(of));
            }
        }
        for index in 1..blocks.len() {
            blocks[index - 1].junction_mm_s = blocks[index - 1].junction_feed(&blocks[index], self.machine);
        }
        blocks
    }
}

fn least([one, other]: [f64; 2]) -> f64 {
    one.min(other)
}

/// The time of ramps over some blocks from rest to rest, 0 if there are none \[s\].
fn spanned_s(blocks: &[Block<f64>]) -> f64 {
    let mut nodes = vec![Node::EMPTY; nodes_for(blocks.len())];
    plan_spanning(blocks, 0.0, 0.0, &mut nodes, &mut |_, _| ()).ok().flatten().unwrap_or(0.0)
}

/// The time of a run, infinite if there is no plan \[s\].
fn run_time_s<const N: usize>(blocks: &[StretchBlock<N>], tick_s: f64) -> f64 {
    let stretches = blocks.split_inclusive(|block| block.junction_mm_s <= 0.0);
    stretches.map(|stretch| stretch_time_s(stretch, tick_s).unwrap_or(f64::INFINITY)).sum()
}

fn stretch_time_s<const N: usize>(stretch: &[StretchBlock<N>], tick_s: f64) -> Option<f64> {
    let blocks: Vec<Block<f64>> = stretch.iter().map(StretchBlock::for_lookahead).collect();
    let mut end_mm = 0.0;
    let ends_mm: Vec<f64> = blocks
        .iter()
        .map(|block| {
            end_mm += block.length_mm;
            end_mm
        })
        .collect();
    let planned = lookahead(&blocks, &ends_mm, [0.0; 2], Mode::Spanning, tick_s).ok()?;
    Some(planned.iter().map(|planned| planned.ramp.duration_s()).sum())
}

#[cfg(test)]
mod tests {
    use motion_tests::random::Random;

    use super::*;
    use crate::toolpath::smooth::tests::path;
    use crate::toolpath::{Element, Feeds, add, angle, scale};

    fn blocks_of(moves: &[Move]) -> Vec<StretchBlock> {
        blocks(moves, &Machine::reference()).expect("a machine's limits")
    }

    fn shapes(moves: &[Move], machine: &Machine) -> Shapes<3> {
        Shapes::new(in_any_direction(moves, machine), machine.letters_by_place())
    }

    /// Blends alone, without curves and exact corners to compare them with.
    fn blended(moves: &[Move]) -> Vec<StretchBlock> {
        let machine = Machine::reference();
        let shapes = shapes(moves, &machine);
        let junctions = Junctions::new(Run::new(moves), &shapes, &machine).expect("a machine's limits");
        let mut chosen = junctions.choose(f64::INFINITY).expect("limits");
        chosen.pop().expect("corners").blocks
    }

    fn kinds(blocks: &[StretchBlock]) -> Vec<(u32, &'static str)> {
        blocks.iter().map(|block| (block.line, block.element.kind())).collect()
    }

    #[test]
    fn blends_take_the_slower_feed_and_the_first_line() {
        let moves = path(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [10.0, 20.0]], 0.05, f64::from);
        let blocks = blocks_of(&moves);
        assert_eq!(kinds(&blocks), [(1, "line"), (1, "blend"), (2, "line"), (3, "line")]);
        let feeds: Vec<_> = blocks.iter().map(|block| block.ceiling.feed_mm_s).collect();
        assert_eq!(feeds, [1.0, 1.0, 2.0, 3.0]);
        for pair in blocks.windows(2) {
            assert_eq!(pair[0].element.ends_mm().1, pair[1].element.ends_mm().0);
            assert!(pair[0].junction_mm_s > 1e6, "{}", pair[0].junction_mm_s);
        }
        assert!(blocks_of(&[]).is_empty());
    }

    /// Lines, curves and an involute that meet at kinks: within the tolerance each takes up the turn, and there is no stop. Where the
    /// tolerance is too small for that there is one.
    #[test]
    fn kinks_are_eased_whatever_meets_there() {
        let machine = Machine::reference();
        let unit = |rad: f64| [libm::cos(rad), libm::sin(rad), 0.0];
        let involute = crate::toolpath::Involute::new(([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), 5.0, (0.5, 1.5))
            .expect("a shape");
        for kink_rad in [1e-8, 1e-4, 8e-3] {
            // A line that runs into an involute, which runs into another line.
            let flank = Element::involute([0.0; 3], involute);
            let ([start, end], (from, to)) = (flank.ends(), flank.ends_mm());
            let heading_rad = |tangent: [f64; 3]| libm::atan2(tangent[1], tangent[0]);
            let before = scale(unit(heading_rad(start.tangent) - kink_rad), -10.0);
            let after = scale(unit(heading_rad(end.tangent) + kink_rad), 10.0);
            let elements = [
                Element::Line { from: add(from, before), to: from },
                flank,
                Element::Line { from: to, to: add(to, after) },
            ];
            let blocks = |tolerance_mm: f64| {
                let moves: Vec<Move> = (1..)
                    .zip(elements)
                    .map(|(line, element)| Move {
                        line,
                        element,
                        feeds: Feeds::xyz(20.0),
                        tolerance_mm,
                        merging_mm: None,
                        distance_mm: 0.0,
                    })
                    .collect();
                super::blocks(&moves, &machine).expect("limits")
            };
            let (eased, exact, tight) = (blocks(0.02), blocks(0.0), blocks(1e-13));
            assert_eq!(
                kinds(&eased),
                [(1, "line"), (1, "blend"), (2, "involute"), (2, "blend"), (3, "line")]
            );
            for pair in eased.windows(2) {
                let turn_rad = angle(pair[0].element.ends()[1].tangent, pair[1].element.ends()[0].tangent);
                assert!(
                    turn_rad < 1e-9 && pair[0].junction_mm_s > 5.0,
                    "{turn_rad} {}",
                    pair[0].junction_mm_s
                );
            }
            assert!(eased.iter().all(|block| block.tolerance_share <= 1.0));
            assert!(exact.len() == 3 && exact[..2].iter().all(|block| block.junction_mm_s > 5.0));
            assert!(tight.len() == 3 && tight[..2].iter().all(|block| block.junction_mm_s == 0.0));
        }
    }

    /// Between a small blend and a big one, the big one gets what the small one leaves; two big ones share.
    #[test]
    fn neighbours_share_a_short_element() {
        let slow = |_: u32| 0.5;
        let both = blended(&path(&[[0.0, 0.0], [10.0, 0.0], [10.0, 1.0], [20.0, 1.0]], 0.2, slow));
        assert_eq!(kinds(&both)[2], (2, "line"), "{:?}", kinds(&both));
        let rest_mm = both[2].element.length_mm();
        assert!((rest_mm - 0.1).abs() < 1e-12, "{rest_mm}");
        // 2° and 150°: the first wants more than the whole line, the second a third of it.
        // Lines of one feed would be merged.
        let (sine, cosine) = libm::sincos(2.0_f64.to_radians());
        let turn = libm::sincos(152.0_f64.to_radians());
        let corner = [10.0 + cosine, sine];
        let end = [corner[0] + 10.0 * turn.1, corner[1] + 10.0 * turn.0];
        let blocks = blended(&path(&[[0.0, 0.0], [10.0, 0.0], corner, end], 0.2, |line| {
            0.05 + 1e-9 * f64::from(line)
        }));
        assert_eq!(blocks.len(), 5, "{:?}", kinds(&blocks));
        let trim_mm = |index: usize, whole_mm: f64| whole_mm - blocks[index].element.length_mm();
        let (first, second) = (trim_mm(0, 10.0), trim_mm(4, 10.0));
        assert!(first > 0.5 && second > 0.2 && (first + second - 0.9).abs() < 1e-9, "{first} {second}");
    }

    /// Seven lines of random lengths, angles, feeds and tolerance.
    fn random_lines(random: &mut Random) -> Vec<Move> {
        let (mut at, mut heading_rad, mut points) = ([0.0, 0.0], 0.0, vec![[0.0, 0.0]]);
        for _ in 0..7 {
            let (sine, cosine) = libm::sincos(heading_rad);
            let length_mm = random.log(0.2, 20.0);
            at = [at[0] + length_mm * cosine, at[1] + length_mm * sine];
            points.push(at);
            heading_rad += (random.unit() - 0.5) * 5.0;
        }
        let feeds_mm_s: Vec<f64> = points.iter().map(|_| random.log(3.0, 100.0)).collect();
        path(&points, random.log(2e-3, 0.2), |line| feeds_mm_s[line as usize])
    }

    /// What is left out would hardly have been better, beside junctions that are blended or not.
    #[test]
    fn what_is_left_out_gains_hardly_anything() {
        let machine = Machine::reference();
        let mut random = Random::of_stream(71);
        let (mut looks, mut missed, mut worst, mut lost) = (0, 0, 0.0_f64, 0.0);
        for case in 0..400 {
            let moves = random_lines(&mut random);
            let shapes = shapes(&moves, &machine);
            let junctions = Junctions::new(Run::exact(&moves), &shapes, &machine).expect("limits");
            let mut beside = junctions.exact().expect("limits");
            for junction in (0..beside.len()).skip(case % 2).step_by(2) {
                let rooms_mm = junctions.rooms_mm(junction, |other| beside[other].trims_mm());
                if let Some(blended) = shapes.blend(&junctions.run, junction, 0.5 * least(rooms_mm)) {
                    beside[junction] =
                        junctions.rounded(junction, &blended, BLEND_FEED_SHARE).expect("limits");
                }
            }
            for junction in 0..beside.len() {
                let Some(alone) = junctions.longest(junction) else { continue };
                let best = junctions.best(junction, &alone, &beside).expect("limits");
                let mut all = Compared::new(&junctions.run, &junctions.ceilings, junction, &beside);
                all.add(best);
                all.add(junctions.exact_at(junction).expect("limits"));
                let rooms_mm = junctions.rooms_mm(junction, |other| beside[other].trims_mm());
                for size in SIZES {
                    let room_mm = size * least(rooms_mm).min(alone.blend.trim_mm);
                    let blended = shapes.blend(&junctions.run, junction, room_mm).expect("a blend");
                    for crossing in junctions.shared(junction, &blended).expect("limits") {
                        all.add(crossing);
                    }
                }
                let times_s = all.times_s();
                let least_s =
                    times_s[2..].iter().copied().fold(times_s[1] / (1.0 - EXACT_GAIN_MIN), f64::min);
                if !least_s.is_finite() {
                    continue;
                }
                let off = times_s[0] / least_s - 1.0;
                looks += 1;
                missed += u32::from(off > 1e-9);
                worst = worst.max(off);
                lost += off.max(0.0);
            }
        }
        let mean = lost / f64::from(looks);
        println!("{missed} of {looks} missed, {mean:.2e} lost in the mean, {worst:.4} at worst");
        assert!(looks > 2000 && missed * 150 < looks && mean < 2e-4 && worst < 0.18);
    }

    /// The estimate by which a run is left is hardly more than what its longest blends take, on a machine with a slow axis that
    /// is not in their plane, too.
    #[test]
    fn a_run_is_estimated_from_below() {
        let mut slow = Machine::reference();
        let z = &mut slow.axes[2];
        for limit in [&mut z.accel_mm_s2, &mut z.jerk_mm_s3, &mut z.snap_mm_s4] {
            *limit *= 0.1;
        }
        for machine in [Machine::reference(), slow] {
            let mut random = Random::of_stream(72);
            let (mut most, mut least_part) = (0.0_f64, f64::INFINITY);
            for _ in 0..300 {
                let moves = random_lines(&mut random);
                let shapes = shapes(&moves, &machine);
                let junctions = Junctions::new(Run::exact(&moves), &shapes, &machine).expect("limits");
                let count = junctions.run.junctions();
                let alone: Vec<_> = (0..count).map(|junction| junctions.longest(junction)).collect();
                let trims_mm: Vec<_> =
                    alone.iter().map(|alone| alone.as_ref().map_or(0.0, |of| of.blend.trim_mm)).collect();
                let room_mm = |junction: usize| {
                    least(junctions.rooms_mm(junction, |other| [trims_mm[other]; 2])).min(trims_mm[junction])
                };
                let rooms_mm: Vec<_> = (0..count).map(room_mm).collect();
                let about_s = junctions.about_s(&alone, &rooms_mm).expect("limits");
                let longest_s = junctions.choose(f64::INFINITY).expect("limits")[0].time_s;
                most = most.max(about_s / longest_s);
                least_part = least_part.min(about_s / longest_s);
            }
            println!("{least_part:.3} to {most:.3} of the time of the longest blends");
            assert!(most < 1.01 && least_part > 0.5);
        }
    }

    /// A right angle is rounded at a low feed. At a high feed stopping on it takes less time.
    #[test]
    fn a_corner_is_blended_where_that_is_faster() {
        let corner = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]];
        let blocks = |feed_mm_s: f64| blocks_of(&path(&corner, 0.01, |_| feed_mm_s));
        assert_eq!(kinds(&blocks(1.0)), [(1, "line"), (1, "blend"), (2, "line")]);
        assert_eq!(kinds(&blocks(50.0)), [(1, "line"), (2, "line")]);
        assert_eq!(blocks(50.0)[0].junction_mm_s, 0.0);
    }

    /// A slow move next to a fast one: the blend is at the slow one's feed, and shorter than the tolerance
    /// would allow.
    #[test]
    fn beside_a_fast_move_a_slow_blend_is_short() {
        let corner = [[0.0, 0.0], [10.0, 0.0], [19.8, 2.0]];
        let blend_mm = |feed_mm_s: [f64; 2]| {
            let blocks = blended(&path(&corner, 0.5, |line| feed_mm_s[line as usize - 1]));
            blocks.iter().find(|block| block.element.kind() == "blend").map(|block| block.element.length_mm())
        };
        let (even, uneven) = (blend_mm([5.0, 5.0]), blend_mm([5.0, 60.0]));
        assert!(even > Some(3.0) && uneven < even.map(|mm| 0.6 * mm), "{even:?} {uneven:?}");
    }

    /// Lines with no room for blends: a curve through all of them takes less time than merged lines and blends.
    #[test]
    fn dense_lines_become_a_curve() {
        let wave = |index: u32| {
            let x = 0.05 * f64::from(index);
            [x, 0.3 * libm::sin(2.0 * x) + 2e-3 * f64::from(index % 2)]
        };
        let points: Vec<_> = (0..200).map(wave).collect();
        let moves = path(&points, 0.02, |_| 50.0);
        let machine = Machine::reference();
        let time_s = |blocks: &[StretchBlock]| run_time_s(blocks, machine.tick_s);
        let blocks = blocks_of(&moves);
        assert!(blocks.iter().any(|block| block.element.kind() == "curve"), "{:?}", kinds(&blocks));
        assert!(blocks.windows(2).all(|pair| pair[0].junction_mm_s > 1e3), "a stop");
        assert!(
            time_s(&blocks) < 0.9 * time_s(&blended(&moves)),
            "{} {}",
            time_s(&blocks),
            time_s(&blended(&moves))
        );
        assert!(blocks.iter().all(|block| block.tolerance_share <= 1.0));
        // As far as they lead and no farther.
        assert_eq!(blocks[0].element.ends_mm().0, [points[0][0], points[0][1], 0.0]);
        assert_eq!(blocks[blocks.len() - 1].element.ends_mm().1, [points[199][0], points[199][1], 0.0]);
    }

    /// A long line that goes straight on into dense ones gives the curve a part of itself, and everything
    /// joins to the last bit.
    #[test]
    fn a_curve_joins_what_is_beside_it() {
        let mut points = vec![[13.37, -7.1], [43.37, -7.1], [43.47, -7.1]];
        points.extend((1..80).map(|index| {
            let u = 0.1 * f64::from(index);
            [43.47 + u, -7.1 + 0.4 * (1.0 - libm::cos(2.0 * u))]
        }));
        points.push([95.123, -30.3]);
        let moves = path(&points, 0.02, |_| 50.0);
        let blocks = blocks_of(&moves);
        let curve: Vec<_> = kinds(&blocks).iter().map(|&(_, kind)| kind == "curve").collect();
        assert!(!curve[0] && curve[1] && !curve[curve.len() - 1], "{:?}", kinds(&blocks));
        for pair in blocks.windows(2) {
            assert_eq!(pair[0].element.ends_mm().1, pair[1].element.ends_mm().0);
            assert!(pair[0].junction_mm_s > 1e3, "{}", pair[0].junction_mm_s);
        }
        let ends = (blocks[0].element.ends_mm().0, blocks[blocks.len() - 1].element.ends_mm().1);
        assert_eq!(ends, ([13.37, -7.1, 0.0], [95.123, -30.3, 0.0]));
    }

    /// Two quarter circles in chords of 1°, which meet in a right angle. A curve is led past it, or ends there, as the
    /// machine says; where every chord is a corner, there is none.
    #[test]
    fn a_curve_ends_at_what_the_machine_calls_a_corner() {
        let quarter = |centre: [f64; 2]| {
            (0..=90).map(move |degree: u32| {
                let (sine, cosine) = libm::sincos(f64::from(degree).to_radians());
                [centre[0] + 10.0 * sine, centre[1] - 10.0 * cosine]
            })
        };
        let points: Vec<_> = quarter([0.0, 10.0]).chain(quarter([10.0, 20.0]).skip(1)).collect();
        let moves = path(&points, 0.02, |_| 50.0);
        let curves = |corner_angle_deg: f64| -> Vec<Vec<StretchBlock>> {
            let mut machine = Machine::reference();
            machine.path.corner_angle_rad = corner_angle_deg.to_radians();
            let shapes = shapes(&moves, &machine);
            curved(&moves, &shapes, &machine).into_iter().map(|timed| timed.blocks).collect()
        };
        // The curve stops on it, or a blend rounds it.
        let is_a_corner = |blocks: &[StretchBlock]| {
            blocks.iter().any(|block| {
                let (_, end) = block.element.ends_mm();
                block.element.kind() == "blend" || norm(subtract(end, [10.0, 10.0, 0.0])) < 1e-9
            })
        };
        let (past, flat, to, none) = (curves(130.0), curves(75.0), curves(45.0), curves(0.5));
        assert_eq!((past.len(), flat.len(), to.len(), none.len()), (2, 1, 1, 0));
        assert!(!is_a_corner(&past[0]) && is_a_corner(&to[0]));
        assert_eq!(kinds(&past[1]), kinds(&to[0]));
        assert_eq!(kinds(&flat[0]), kinds(&to[0]));
    }
}
