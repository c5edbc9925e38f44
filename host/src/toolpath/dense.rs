//! Curves in place of moves that are dense.
//!
//! Consumes moves that follow each other without a stop; produces them with one curve, span by span, in place
//! of every run of lines and arcs that have no room for the blends at their ends. A curve begins and ends on
//! a long move, of which it takes a part, or where there is none. Each span keeps the feeds of all moves that it stands
//! for, whichever axes these count.

use std::collections::HashMap;
use std::rc::Rc;

use motion_kernel::law::Limits;

use super::blend::{ANGLE_MAX_RAD, trim_mm, trim_of_jump_mm};
use super::element::Element;
use super::fairing::{Part, Span, fair};
use super::smooth::{Move, TAKEN_MAX, TANGENT_ROUNDING_RAD, is_smooth};
use super::{Feeds, Greatest, SpeedRatios, angle, norm, subtract};
use crate::gcode::Axis;

/// How often a long move has room for what the blends at its ends want.
const LONG: f64 = 2.0;
/// How much more of a long move a curve takes than a blend would.
const MARGIN: f64 = 4.0;

/// Moves with curves in place of what is dense.
pub(super) struct Faired<const N: usize> {
    pub(super) moves: Vec<Move<N>>,
    /// How far each is from those that it stands for \[mm\].
    pub(super) distances_mm: Vec<f64>,
    /// How each bends at its tightest, of the spans of curves.
    pub(super) greatest: Vec<Option<Greatest<N>>>,
}

impl<const N: usize> Faired<N> {
    const NOTHING: Self = Self { moves: Vec::new(), distances_mm: Vec::new(), greatest: Vec::new() };

    fn push(&mut self, step: Move<N>, element: Element<N>, distance_mm: f64, greatest: Option<Greatest<N>>) {
        self.moves.push(Move { element, ..step });
        self.distances_mm.push(distance_mm);
        self.greatest.push(greatest);
    }
}

/// Curves that were made, by the first and the last of the moves that they stand for, with what is left of both.
type Known<const N: usize> = HashMap<(usize, usize), ([Part<N>; 2], Option<Rc<[Span<N>]>>)>;

/// The moves with curves in place of what is dense: once for each angle above which a corner stays one, if it
/// makes a difference; nothing if nothing is dense. See [`Run::faired`](super::smooth::Run::faired).
pub(super) fn faired<const N: usize>(
    moves: &[Move<N>],
    corners_rad: &[f64],
    limits: &Limits<f64>,
    feed_mm_s: f64,
    axes: &[Option<Axis>; N],
) -> Vec<Faired<N>> {
    let mut runs: Vec<Moves<N>> =
        corners_rad.iter().map(|&corner_rad| Moves::new(moves, corner_rad, axes)).collect();
    runs.dedup_by(|run, before| run.wanted_mm == before.wanted_mm);
    // Solving is slow: what the runs have in common is solved once.
    let mut known = Known::new();
    runs.iter().filter_map(|run| with_curves(run, limits, feed_mm_s, &mut known)).collect()
}

fn with_curves<const N: usize>(
    run: &Moves<N>,
    limits: &Limits<f64>,
    feed_mm_s: f64,
    known: &mut Known<N>,
) -> Option<Faired<N>> {
    let moves = run.moves;
    let mut made = Faired::NOTHING;
    let (mut first, mut is_faired) = (0, false);
    // What the curve before has left of the first move.
    let mut rest = moves.first()?.element;
    while first < moves.len() {
        let last = run.last_from(first);
        let is_dense = last > first && (first..=last).any(|index| run.is_short(index));
        let cut = is_dense.then(|| run.cut(first, rest, last, feed_mm_s));
        let curve = cut.and_then(|cut| {
            let ends = [cut.parts[0], cut.parts[last - first]];
            let spans = match known.get(&(first, last)) {
                Some((of_known, spans)) if *of_known == ends => spans.clone(),
                _ => {
                    let spans = fair(&cut.parts, limits).map(Rc::from);
                    known.insert((first, last), (ends, spans.clone()));
                    spans
                }
            };
            spans.map(|spans| (cut, spans))
        });
        let Some((cut, spans)) = curve else {
            // A run that has no curve is left as it is; its last move may begin another one.
            let next = last.max(first + 1);
            made.push(moves[first], rest, 0.0, None);
            moves[first + 1..next].iter().for_each(|step| made.push(*step, step.element, 0.0, None));
            first = next;
            rest = moves.get(first).map_or(rest, |step| step.element);
            continue;
        };
        is_faired = true;
        if let Some(before) = cut.before {
            made.push(moves[first], before, 0.0, None);
        }
        for span in spans.iter() {
            let stands_for = &moves[first + span.parts.0..=first + span.parts.1];
            let feeds = stands_for.iter().map(|step| step.feeds).reduce(Feeds::least).unwrap_or(Feeds::RAPID);
            let tolerance_mm = stands_for.iter().map(tolerance_mm).fold(f64::INFINITY, f64::min);
            let step = Move { feeds, tolerance_mm, merging_mm: None, ..stands_for[0] };
            made.push(step, span.element, span.distance_mm, Some(span.greatest));
        }
        (first, rest) = match (cut.behind, moves.get(last + 1)) {
            (Some(behind), _) => (last, behind),
            (None, next) => (last + 1, next.map_or(rest, |next| next.element)),
        };
    }
    is_faired.then_some(made)
}

/// Moves with what the blends between them want.
struct Moves<'a, const N: usize> {
    moves: &'a [Move<N>],
    axes: &'a [Option<Axis>; N],
    lengths_mm: Vec<f64>,
    /// What the blend of each junction wants of either move \[mm\]; nothing where no curve goes through.
    wanted_mm: Vec<Option<f64>>,
}

impl<'a, const N: usize> Moves<'a, N> {
    fn new(moves: &'a [Move<N>], corner_rad: f64, axes: &'a [Option<Axis>; N]) -> Self {
        let lengths_mm = moves.iter().map(|step| step.element.length_mm()).collect();
        let wanted_mm = moves.windows(2).map(|pair| wanted_mm(&pair[0], &pair[1], corner_rad)).collect();
        Self { moves, axes, lengths_mm, wanted_mm }
    }

    /// The most that the blends at a move's ends want \[mm\].
    fn most_mm(&self, index: usize) -> f64 {
        let ends = [index.checked_sub(1), Some(index)].into_iter().flatten();
        ends.filter_map(|junction| self.wanted_mm.get(junction).copied().flatten()).fold(0.0, f64::max)
    }

    fn is_short(&self, index: usize) -> bool {
        0.5 * TAKEN_MAX * self.lengths_mm[index] < self.most_mm(index)
    }

    fn is_long(&self, index: usize) -> bool {
        0.5 * TAKEN_MAX * self.lengths_mm[index] >= LONG * self.most_mm(index)
    }

    /// The last move of the run that begins with `first`: the next long one, or the last before a corner.
    fn last_from(&self, first: usize) -> usize {
        let mut last = first;
        while self.wanted_mm.get(last).is_some_and(Option::is_some) && (last == first || !self.is_long(last))
        {
            last += 1;
        }
        last
    }

    /// What a curve takes of a long move, as a part of `length_mm`: more than the blend with its neighbour
    /// wants, and something where that goes straight on.
    fn share(&self, length_mm: f64, junction: usize, neighbour: usize) -> f64 {
        let wanted_mm = MARGIN * self.wanted_mm[junction].unwrap_or(0.0);
        (wanted_mm.max(self.lengths_mm[neighbour]) / length_mm).min(0.5 * TAKEN_MAX)
    }

    /// Cuts a run, of whose first move `rest` is left, out of its long ends.
    fn cut(&self, first: usize, rest: Element<N>, last: usize, feed_mm_s: f64) -> Cut<N> {
        let (mut start, mut end) = (rest, self.moves[last].element);
        let (mut before, mut behind) = (None, None);
        if self.is_long(first) {
            let [kept, taken] = start.split(1.0 - self.share(start.length_mm(), first, first + 1));
            (before, start) = (Some(kept), taken);
        }
        if self.is_long(last) {
            let [taken, left] = end.split(self.share(self.lengths_mm[last], last - 1, last - 1));
            (end, behind) = (taken, Some(left));
        }
        let mut parts: Vec<Part<N>> = self.moves[first..=last]
            .iter()
            .map(|step| Part {
                element: step.element,
                tolerance_mm: tolerance_mm(step),
                feed_mm_s: step.feeds.along(&SpeedRatios::of(&step.element, self.axes)).min(feed_mm_s),
            })
            .collect();
        parts[0].element = start;
        parts[last - first].element = end;
        Cut { before, parts, behind }
    }
}

/// A run with what is left of its long ends before and behind.
struct Cut<const N: usize> {
    before: Option<Element<N>>,
    parts: Vec<Part<N>>,
    behind: Option<Element<N>>,
}

/// What a blend between two moves wants of either \[mm\]; nothing where there is to be none.
fn wanted_mm<const N: usize>(before: &Move<N>, after: &Move<N>, corner_rad: f64) -> Option<f64> {
    let is_bent = |step: &Move<N>| matches!(step.element, Element::Line { .. } | Element::Arc { .. });
    let tolerance_mm = tolerance_mm(before).min(tolerance_mm(after));
    if !(is_bent(before) && is_bent(after) && tolerance_mm > 0.0) {
        return None;
    }
    let ([_, end], [start, _]) = (before.element.ends(), after.element.ends());
    let angle_rad = angle(end.tangent, start.tangent);
    if angle_rad > corner_rad.min(ANGLE_MAX_RAD) {
        return None;
    }
    if is_smooth([&before.element, &after.element]) {
        return Some(0.0);
    }
    let jump_per_mm = norm(subtract(start.curvature, end.curvature));
    let by_angle_mm =
        if angle_rad > TANGENT_ROUNDING_RAD { trim_mm(angle_rad, tolerance_mm) } else { f64::INFINITY };
    Some(by_angle_mm.min(trim_of_jump_mm(jump_per_mm, tolerance_mm)))
}

/// How far a curve may be from a move \[mm\]: merging is for lines.
fn tolerance_mm<const N: usize>(step: &Move<N>) -> f64 {
    match step.element {
        Element::Line { .. } if step.tolerance_mm > 0.0 => step.tolerance_mm + step.merging_mm.unwrap_or(0.0),
        _ => step.tolerance_mm,
    }
}
