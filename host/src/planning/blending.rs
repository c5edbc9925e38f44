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
//! it, and once as a curve like any other. They are compared by the time that look-ahead takes over both
//! moves and one more on either side, with the choices for the neighbouring junctions. The shortest is taken,
//! but a junction without a blend has to gain a five-hundredth of it: G64 asks for smooth motion. Looking at
//! one junction after the other does not find the best of all; in the end the run is planned with every blend
//! at its longest and as it was programmed, too, and the best of these is taken. So blends and merged lines
//! cost at most that part of the time that the exact path takes without its kinks.
//!
//! **Tangent junctions** whose curvature jumps are treated alike: passed without a blend they fall under the
//! acceleration-step limit as under G61, because a path of bounded jerk through them can take longer (on the
//! arcs of a few millimetres that a corner is rounded with, by a seventh). If no such step is wanted, the
//! machine's limit says so: with a small one only the blend pays.
//!
//! **Kinks** are not passed, however small they are: velocity does not step. Where G61 would pass one, it has a blend or an
//! [easement](crate::toolpath::easement), or is a part of what a curve or a merged line stands for; where none fits the
//! tolerance, a stop.

use std::rc::Rc;

use motion_kernel::law::Limits;
use motion_kernel::plan::{
    BLEND_FEED_SHARE, Block, BlockPlan, Ceiling, Node, PlanError, nodes_for, plan, plan_spanning,
};

use super::Mode;
use super::ceilings::{Ceilings, along, ceilings, in_any_direction, junction_feed};
use super::crossing::{By, Crossing, Driven, Eased, Rounding};
use super::error::AtLine;
use super::lookahead::lookahead;
use super::stretch::StretchBlock;
use crate::machine::Machine;
use crate::toolpath::blend::Blend;
use crate::toolpath::easement::Easement;
use crate::toolpath::smooth::{Move, Run};
use crate::toolpath::{Element, Greatest, SpeedRatios, norm, subtract};

/// Part of the time that a junction without a blend has to gain over the best one.
const EXACT_GAIN_MIN: f64 = 0.002;

/// A second, smaller bound of the corners that curves through dense moves are led past \[rad\], beside the machine's: a stop
/// on a corner may take less time.
const FLAT_CORNER_RAD: f64 = 75.0 * core::f64::consts::PI / 180.0;

/// Lengths of blends that are tried, as parts of the longest one.
const SIZES: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Lengths of easements that are tried, as parts of what there is room for.
const EASEMENT_SIZES: [f64; 2] = [1.0, 0.25];
/// How much longer than the best found the longest blends may take for others to be tried: these gain up to
/// an eighth.
const PROMISING: f64 = 1.15;
/// How often a junction is looked at at most.
const SWEEPS: usize = 4;
/// How many more moves are looked at on either side of those at a junction.
const BESIDE: usize = 1;
/// Blocks of that many moves and of what rounds the junctions between them.
const BLOCKS: usize = 3 * (2 * BESIDE + 2) - 2;
/// How often the feeds at the ends of a comparison are lowered until every variant can be planned.
const LOWERINGS: usize = 8;
/// Feeds that a plan has named as just possible, made a little less.
const LESS: f64 = 1.0 - 1.0e-9;

/// The blocks of a run that starts and ends at rest; the junction feed of the last one is 0. An error comes
/// with the program line.
pub(super) fn blocks<const N: usize>(
    moves: &[Move<N>],
    machine: &Machine<N>,
) -> AtLine<Vec<StretchBlock<N>>> {
    let mut candidates = curved(moves, machine);
    let fastest_s = candidates.iter().map(|timed| timed.time_s).fold(f64::INFINITY, f64::min);
    let junctions = Junctions::new(Run::new(moves), machine)?;
    let is_merged = junctions.run.moves().len() < moves.len();
    let chosen = junctions.choose(fastest_s)?;
    if chosen.is_empty() && (is_merged || candidates.is_empty()) {
        candidates.push(junctions.timed(&junctions.exact()?));
    }
    candidates.extend(chosen);
    let as_programmed = if is_merged { Junctions::new(Run::exact(moves), machine)? } else { junctions };
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
fn curved<const N: usize>(moves: &[Move<N>], machine: &Machine<N>) -> Vec<Timed<N>> {
    let limits = in_any_direction(moves, machine);
    let corners_rad = [machine.path.corner_angle_rad, machine.path.corner_angle_rad.min(FLAT_CORNER_RAD)];
    let (mut candidates, mut most_s) = (Vec::new(), f64::INFINITY);
    for run in Run::faired(moves, &corners_rad, &limits, machine.path.feed_mm_s, &machine.letters_by_place())
    {
        // Nobody has programmed a curve: one that has no ceilings is no candidate.
        let Ok(junctions) = Junctions::new(run, machine) else { continue };
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
    /// The ceilings of the moves.
    ceilings: Vec<Ceilings>,
    machine: &'a Machine<N>,
    /// Limits of the path in any direction.
    limits: Limits<f64>,
}

impl<'a, const N: usize> Junctions<'a, N> {
    fn new(run: Run<N>, machine: &'a Machine<N>) -> AtLine<Self> {
        Ok(Self {
            ceilings: along(&run, machine)?,
            limits: in_any_direction(run.moves(), machine),
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
        let alone: Vec<Option<Blend<N>>> = junctions.map(|junction| self.longest(junction)).collect();
        if alone.iter().all(Option::is_none) {
            return Ok(Vec::new());
        }
        if self.least_s(&alone) > PROMISING * most_s {
            return Ok(Vec::new());
        }
        let alone_mm: Vec<Option<f64>> = alone.iter().map(|blend| blend.map(|blend| blend.trim_mm)).collect();
        let mut exact: Vec<Option<Crossing<N>>> = vec![None; alone.len()];
        for (junction, exact) in
            exact.iter_mut().enumerate().filter(|&(junction, _)| alone[junction].is_none())
        {
            *exact = Some(self.exact_at(junction)?);
        }
        let trims_mm = |junction: usize| match &exact[junction] {
            Some(exact) => exact.trims_mm(),
            None => [alone_mm[junction].unwrap_or(0.0); 2],
        };
        let mut chosen = Vec::with_capacity(alone.len());
        for (junction, blend) in alone.into_iter().enumerate() {
            let room_mm = least(self.rooms_mm(junction, trims_mm)).min(trims_mm(junction)[0]);
            let blend = match blend {
                Some(blend) if blend.trim_mm > room_mm => self.run.blend(junction, room_mm, &self.limits),
                blend => blend,
            };
            chosen.push(match (blend, &exact[junction]) {
                (Some(blend), _) => self.rounded(junction, blend, (room_mm, SIZES[0]))?.into(),
                (None, Some(exact)) => exact.clone(),
                (None, None) => self.exact_at(junction)?,
            });
        }
        for junction in 0..chosen.len() {
            if let Some(longest) = chosen[junction].blend().cloned() {
                let shares = self.shared(junction, &longest)?;
                chosen[junction] = self.best(junction, &chosen, &shares);
            }
        }
        let longest = self.timed(&chosen);
        if longest.time_s > PROMISING * most_s {
            return Ok(vec![longest]);
        }
        self.settle(&mut chosen, |junction, chosen| match alone_mm[junction] {
            Some(alone_mm) => self.variants(junction, alone_mm, chosen),
            None => Ok(Vec::new()),
        })?;
        Ok(vec![longest, self.timed(&chosen)])
    }

    /// Takes the best of the variants of each junction, until nothing changes or each was looked at so many times.
    fn settle(
        &self,
        chosen: &mut [Crossing<N>],
        variants: impl Fn(usize, &[Crossing<N>]) -> AtLine<Vec<Crossing<N>>>,
    ) -> AtLine<()> {
        // Junctions next to a change are looked at again.
        let mut is_open = vec![true; chosen.len()];
        for _ in 0..SWEEPS {
            for junction in 0..chosen.len() {
                if !std::mem::take(&mut is_open[junction]) {
                    continue;
                }
                let best = self.best(junction, chosen, &variants(junction, chosen)?);
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
    fn longest(&self, junction: usize) -> Option<Blend<N>> {
        let room_mm = self.run.taken_mm_max(junction).min(self.run.taken_mm_max(junction + 1));
        self.run.blend(junction, room_mm, &self.limits)
    }

    /// About the least time that the run takes with blends, of which these are the longest \[s\]: each takes that
    /// of its chord at its feed, two that overlap half of it. What is between them takes none.
    fn least_s(&self, alone: &[Option<Blend<N>>]) -> f64 {
        let of_blend = |blend: &Blend<N>| {
            let (from, to) = blend.element.ends_mm();
            0.5 * norm(subtract(to, from)) / blend.feed_mm_s
        };
        alone.iter().flatten().map(of_blend).sum()
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
        self.settle(&mut settled, |junction, settled| match settled[junction].by {
            By::Easement(_) => self.easements(junction, settled),
            By::Itself | By::Blend(_) => Ok(Vec::new()),
        })?;
        Ok(if self.timed(&settled).time_s < self.timed(&exact).time_s { settled } else { exact })
    }

    /// The time that the moves take at least without blends, as if kinks that are eased were none \[s\].
    fn least_exact_s(&self) -> f64 {
        let passed = Crossing { by: By::Itself, feed_mm_s: f64::INFINITY };
        let mut blocks = self.blocks(&vec![passed; self.run.junctions()]);
        for junction in (0..self.run.junctions()).filter(|&junction| self.is_eased(junction)) {
            blocks[junction].junction_mm_s = f64::INFINITY;
        }
        run_time_s(&blocks, self.machine.tick_s)
    }

    /// A junction without a blend; a kink that might be passed, but for the step of velocity, with the fastest of its easements
    /// within half of its moves.
    fn exact_at(&self, junction: usize) -> AtLine<Crossing<N>> {
        if self.is_eased(junction) {
            let eased = self.eased(junction, self.halves_mm(junction, |_| [0.0; 2]))?.into_iter();
            let fastest = eased.max_by(|one, other| one.feed_mm_s.total_cmp(&other.feed_mm_s));
            if let Some(fastest) = fastest {
                return Ok(fastest);
            }
        }
        let [before, after] = [junction, junction + 1]
            .map(|index| (&self.run.moves()[index], &self.ceilings[index].programmed));
        let elements = [&before.0.element, &after.0.element];
        let feed_mm_s = junction_feed(elements, self.run.kink_rad(junction).is_some(), self.machine);
        let feed_mm_s = feed_mm_s.min(before.1.feed_mm_s).min(after.1.feed_mm_s);
        Ok(Crossing { by: By::Itself, feed_mm_s })
    }

    /// Whether a junction is a kink that might be passed under G61, but is to be smooth.
    fn is_eased(&self, junction: usize) -> bool {
        self.run.kink_rad(junction).is_some_and(|kink_rad| kink_rad <= self.machine.path.junction_angle_rad)
    }

    /// A junction with each of its easements within `rooms_mm`.
    fn eased(&self, junction: usize, rooms_mm: [f64; 2]) -> AtLine<Vec<Crossing<N>>> {
        let easements = self.run.easements(junction, rooms_mm);
        easements.into_iter().map(|easement| self.eased_by(junction, easement)).collect()
    }

    /// A junction with an easement.
    fn eased_by(&self, junction: usize, easement: Easement<N>) -> AtLine<Crossing<N>> {
        let share = self.machine.path.curve_feed_share;
        let sides = easement.elements.iter().map(|&element| self.driven(junction, element, share));
        let mut sides = sides.collect::<AtLine<Vec<_>>>()?;
        // What meets there.
        let [before, after] = [junction, junction + 1].map(|index| &self.run.moves()[index].element);
        let met = match (&easement.elements[..], easement.trims_mm) {
            ([first, second], _) => [first, second],
            ([only], [_, 0.0]) => [only, after],
            ([only], _) => [before, only],
            _ => [before, after],
        };
        let junction_mm_s = junction_feed(met, true, self.machine);
        // Ramps have more of the limits below what they can reach from the junction.
        let most = [&self.ceilings[junction], &self.ceilings[junction + 1]].into_iter();
        let most = most.chain(sides.iter().map(|side| &side.ceilings)).map(|of| of.greatest.feed_mm_s);
        let most_mm_s = most.fold(junction_mm_s, f64::min);
        let trims_mm = easement.trims_mm[0] + easement.trims_mm[1];
        let reach_mm_s = (most_mm_s.powi(2) + 2.0 * self.limits.accel_mm_s2 * trims_mm).sqrt();
        for side in &mut sides {
            if side.ceilings.programmed.feed_mm_s > reach_mm_s {
                let reason = side.ceilings.programmed.reason;
                let lowered = ceilings(reach_mm_s, &side.greatest, &side.ratios, share, self.machine);
                let lowered = lowered.map_err(|error| (self.run.moves()[junction].line, error.into()))?;
                let lowered = Ceiling { reason, ..lowered.programmed };
                side.ceilings = Ceilings { programmed: lowered, greatest: lowered, ..side.ceilings };
            }
        }
        if easement.trims_mm[0] > 0.0
            && let Some(first) = sides.first_mut()
        {
            first.end_mm_s = junction_mm_s;
        }
        let feeds = sides.iter().map(|side| side.ceilings.programmed.feed_mm_s);
        let feed_mm_s = feeds.fold(junction_mm_s, f64::min);
        Ok(Crossing { feed_mm_s, by: By::Easement(Rc::new(Eased { easement, sides })) })
    }

    /// A junction with a blend that is a part of what `room_mm` allows, driven at the greatest share.
    fn rounded(&self, junction: usize, blend: Blend<N>, (room_mm, size): (f64, f64)) -> AtLine<Rounding<N>> {
        let share = BLEND_FEED_SHARE;
        let driven = self.driven(junction, blend.element, share)?;
        Ok(Rounding { blend, room_mm, size, share, driven })
    }

    /// What is put in the place of a junction, driven at a share.
    fn driven(&self, junction: usize, element: Element<N>, share: f64) -> AtLine<Driven<N>> {
        // How a curve bends takes a search along it: once, whatever share it is then given.
        let greatest = element.greatest();
        let ratios = SpeedRatios::of(&element, &self.machine.letters_by_place());
        let ceilings = self.ceilings_of(junction, &greatest, &ratios, share)?;
        let length_mm = element.length_mm();
        Ok(Driven { element, length_mm, greatest, ratios, ceilings, end_mm_s: f64::INFINITY })
    }

    fn ceilings_of(
        &self,
        junction: usize,
        greatest: &Greatest<N>,
        ratios: &SpeedRatios,
        share: f64,
    ) -> AtLine<Ceilings> {
        let [before, after] = [junction, junction + 1].map(|index| &self.run.moves()[index]);
        let feed_mm_s = before.feeds.least(after.feeds).along(ratios);
        ceilings(feed_mm_s, greatest, ratios, share, self.machine)
            .map_err(|error| (before.line, error.into()))
    }

    /// A junction with the same blend, once driven at each of the two shares.
    fn shared(&self, junction: usize, rounding: &Rounding<N>) -> AtLine<[Crossing<N>; 2]> {
        let at = |share: f64| {
            let mut rounding = Rounding { share, ..rounding.clone() };
            let Driven { greatest, ratios, .. } = &rounding.driven;
            rounding.driven.ceilings = self.ceilings_of(junction, greatest, ratios, share)?;
            Ok(Crossing::from(rounding))
        };
        Ok([at(BLEND_FEED_SHARE)?, at(self.machine.path.curve_feed_share)?])
    }

    /// The crossings of a junction to choose from, whose longest blend alone trims `alone_mm`, the others being crossed as
    /// `chosen` says.
    fn variants(&self, junction: usize, alone_mm: f64, chosen: &[Crossing<N>]) -> AtLine<Vec<Crossing<N>>> {
        let rooms_mm = self.rooms_mm(junction, |junction| chosen[junction].trims_mm());
        let room_mm = least(rooms_mm).min(alone_mm);
        let is_known = |rounding: &Rounding<N>| rounding.size == SIZES[0] && rounding.room_mm == room_mm;
        let longest = match chosen[junction].blend() {
            Some(rounding) if is_known(rounding) => Some(Rounding::clone(rounding)),
            _ => match self.run.blend(junction, room_mm, &self.limits) {
                Some(blend) => Some(self.rounded(junction, blend, (room_mm, SIZES[0]))?),
                None => None,
            },
        };
        let mut variants = Vec::with_capacity(2 * SIZES.len() + 3 * EASEMENT_SIZES.len());
        if let Some(longest) = longest {
            variants.extend(self.shared(junction, &longest)?);
            for &size in &SIZES[1..] {
                variants.extend(self.shorter(junction, &longest, size)?);
            }
        }
        let eased = self.easements(junction, chosen)?;
        if eased.is_empty() {
            variants.push(self.exact_at(junction)?);
        }
        variants.extend(eased);
        Ok(variants)
    }

    /// A kink that might be passed under G61 with easements of some lengths, in the room that the others, crossed as `chosen`
    /// says, leave it, but at most half of either move: one that takes more leaves the next kink next to nothing.
    fn easements(&self, junction: usize, chosen: &[Crossing<N>]) -> AtLine<Vec<Crossing<N>>> {
        if !self.is_eased(junction) {
            return Ok(Vec::new());
        }
        let rooms_mm = self.halves_mm(junction, |junction| chosen[junction].trims_mm());
        let mut all = Vec::with_capacity(3 * EASEMENT_SIZES.len());
        for part in EASEMENT_SIZES {
            all.extend(self.eased(junction, rooms_mm.map(|room_mm| part * room_mm))?);
        }
        Ok(all)
    }

    /// A junction with a part of its longest blend, at each of the two shares; nothing if there is none.
    fn shorter(&self, junction: usize, longest: &Rounding<N>, size: f64) -> AtLine<Vec<Crossing<N>>> {
        let Some(blend) = self.run.blend(junction, size * longest.room_mm, &self.limits) else {
            return Ok(Vec::new());
        };
        let rounding = self.rounded(junction, blend, (longest.room_mm, size))?;
        Ok(self.shared(junction, &rounding)?.into())
    }

    /// The best of some crossings of a junction, the others being crossed as `chosen` says.
    fn best(&self, junction: usize, chosen: &[Crossing<N>], variants: &[Crossing<N>]) -> Crossing<N> {
        if variants.is_empty() {
            return chosen[junction].clone();
        }
        let windows: Vec<Vec<Block<f64>>> =
            variants.iter().map(|variant| self.window(junction, variant, chosen)).collect();
        let (first, last) = self.beside(junction);
        let feed = |junction: Option<usize>| {
            junction.and_then(|junction| chosen.get(junction)).map_or(0.0, |c| c.feed_mm_s)
        };
        let feeds = common_feeds(&windows, [feed(first.checked_sub(1)), feed(Some(last))]);
        let mut best = (&chosen[junction], f64::INFINITY);
        for (variant, blocks) in variants.iter().zip(&windows) {
            let gain = if variant.blend().is_none() { EXACT_GAIN_MIN } else { 0.0 };
            let time_s = window_time_s(blocks, feeds);
            if time_s < (1.0 - gain) * best.1 {
                best = (variant, time_s);
            }
        }
        best.0.clone()
    }

    /// The first and the last move that are looked at for a junction.
    fn beside(&self, junction: usize) -> (usize, usize) {
        (junction.saturating_sub(BESIDE), (junction + 1 + BESIDE).min(self.ceilings.len() - 1))
    }

    /// The neighbourhood of a junction, which is crossed as `variant` says.
    fn window(&self, changed: usize, variant: &Crossing<N>, chosen: &[Crossing<N>]) -> Vec<Block<f64>> {
        let crossing =
            |junction: usize| if junction == changed { Some(variant) } else { chosen.get(junction) };
        let trims_mm =
            |junction: Option<usize>| junction.and_then(crossing).map_or([0.0; 2], Crossing::trims_mm);
        let (first, last) = self.beside(changed);
        let mut blocks = Vec::with_capacity(BLOCKS);
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
            let driven = after.map_or(&[][..], Crossing::driven);
            blocks.extend(
                driven
                    .iter()
                    .map(|driven| block(driven.length_mm, &driven.ceilings.programmed, driven.end_mm_s)),
            );
        }
        blocks
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
            let element = if is_whole { step.element } else { step.element.trimmed(first_mm, last_mm) };
            let block = |element, ceilings: Ceilings, is_smoothed, tolerance_share| StretchBlock {
                line: step.line,
                element,
                ceiling: ceilings.programmed,
                greatest: ceilings.greatest,
                feed_mm_s: ceilings.feed_mm_s,
                junction_mm_s: 0.0,
                is_smoothed,
                tolerance_share,
            };
            blocks.push(block(element, ceilings, step.tolerance_mm > 0.0, self.run.tolerance_share(index)));
            if let Some(crossing) = crossings.get(index) {
                let of = |driven: &Driven<N>| {
                    let share = self.run.tolerance_share_of(index, crossing.distance_mm());
                    block(driven.element, driven.ceilings, true, share)
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

/// Feeds at both ends that all windows can be planned with, at most `feeds` \[mm/s\].
fn common_feeds(windows: &[Vec<Block<f64>>], mut feeds: [f64; 2]) -> [f64; 2] {
    for _ in 0..LOWERINGS {
        let before = feeds;
        for blocks in windows.iter().filter(|blocks| blocks.iter().all(|block| block.length_mm > 0.0)) {
            let mut plans = [BlockPlan::default(); BLOCKS];
            match plan(blocks, feeds[0], feeds[1], &mut plans[..blocks.len()]) {
                Ok(()) => {}
                Err(PlanError::TooShortToBrake { greatest_mm_s, .. }) => feeds[0] = LESS * greatest_mm_s,
                Err(PlanError::TooShortToAccelerate { greatest_mm_s, .. }) => feeds[1] = LESS * greatest_mm_s,
                Err(PlanError::EndFeed { quantity, greatest_mm_s, .. }) => {
                    feeds[usize::from(quantity == "end feed")] = greatest_mm_s;
                }
                Err(_) => return [0.0; 2],
            }
        }
        if feeds == before {
            return feeds;
        }
    }
    [0.0; 2]
}

/// The time over some blocks, infinite if there is no plan \[s\].
fn window_time_s(blocks: &[Block<f64>], [start_mm_s, end_mm_s]: [f64; 2]) -> f64 {
    let mut nodes = [Node::EMPTY; nodes_for(BLOCKS)];
    let spanning = plan_spanning(blocks, start_mm_s, end_mm_s, &mut nodes, &mut |_, _| ());
    spanning.ok().flatten().unwrap_or(f64::INFINITY)
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
    use super::*;
    use crate::toolpath::smooth::tests::path;
    use crate::toolpath::{Feeds, add, angle, scale};

    fn blocks_of(moves: &[Move]) -> Vec<StretchBlock> {
        blocks(moves, &Machine::reference()).expect("a machine's limits")
    }

    /// Blends alone, without curves and exact corners to compare them with.
    fn blended(moves: &[Move]) -> Vec<StretchBlock> {
        let machine = Machine::reference();
        let junctions = Junctions::new(Run::new(moves), &machine).expect("a machine's limits");
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
            curved(&moves, &machine).into_iter().map(|timed| timed.blocks).collect()
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
