//! Curves in place of moves that are dense.
//!
//! Consumes moves that follow each other without a stop; produces them with one curve, span by span, in place
//! of every run of lines and arcs that have no room for the blends at their ends. A curve begins and ends on
//! a long move, of which it takes a part, or where there is none.

use motion_kernel::law::Limits;

use super::blend::{ANGLE_MAX_RAD, trim_mm};
use super::element::Element;
use super::fairing::{Part, fair};
use super::smooth::{Move, TAKEN_MAX, TANGENT_ROUNDING_RAD};
use super::{angle, norm, subtract};

/// Distance of a blend from a jump of curvature over the jump and the square of its trim.
const JUMP: f64 = 0.03;
/// How often a long move has room for what the blends at its ends want.
const LONG: f64 = 2.0;
/// How much more of a long move a curve takes than a blend would.
const MARGIN: f64 = 4.0;

/// The moves with curves in place of what is dense, and how far each is from those it stands for \[mm\];
/// nothing if nothing is dense. See [`Run::faired`](super::smooth::Run::faired).
pub(super) fn faired(
    moves: &[Move],
    corner_rad: f64,
    limits: &Limits<f64>,
    feed_mm_s: f64,
) -> Option<(Vec<Move>, Vec<f64>)> {
    let run = Moves::new(moves, corner_rad);
    let mut made = Made::default();
    let (mut first, mut taken_mm, mut is_faired) = (0, 0.0, false);
    while first < moves.len() {
        let last = run.last_from(first);
        let is_dense = last > first && (first..=last).any(|index| run.is_short(index));
        let cuts = is_dense.then(|| run.cuts_mm(first, last));
        let spans = cuts.and_then(|cuts_mm| fair(&run.parts(first, last, cuts_mm, feed_mm_s), limits));
        let (Some(cuts_mm), Some(spans)) = (cuts, spans) else {
            // A run that has no curve is left as it is; its last move may begin another one.
            let next = last.max(first + 1);
            for step in &moves[first..next] {
                made.push(*step, step.element.trimmed(taken_mm, 0.0), 0.0);
                taken_mm = 0.0;
            }
            first = next;
            continue;
        };
        is_faired = true;
        if run.is_long(first) {
            made.push(moves[first], moves[first].element.trimmed(taken_mm, cuts_mm.0), 0.0);
        }
        for span in spans {
            let stands_for = &moves[first + span.parts.0..=first + span.parts.1];
            let feed_mm_s = stands_for.iter().map(|step| step.feed_mm_s).fold(f64::INFINITY, f64::min);
            let tolerance_mm = stands_for.iter().map(tolerance_mm).fold(f64::INFINITY, f64::min);
            let step = Move { feed_mm_s, tolerance_mm, merging_mm: None, ..stands_for[0] };
            made.push(step, span.element, span.distance_mm);
        }
        (first, taken_mm) = if run.is_long(last) { (last, cuts_mm.1) } else { (last + 1, 0.0) };
    }
    is_faired.then_some((made.moves, made.distances_mm))
}

#[derive(Default)]
struct Made {
    moves: Vec<Move>,
    distances_mm: Vec<f64>,
}

impl Made {
    fn push(&mut self, step: Move, element: Element, distance_mm: f64) {
        self.moves.push(Move { element, ..step });
        self.distances_mm.push(distance_mm);
    }
}

/// Moves with what the blends between them want.
struct Moves<'a> {
    moves: &'a [Move],
    lengths_mm: Vec<f64>,
    /// What the blend of each junction wants of either move \[mm\]; nothing where no curve goes through.
    wanted_mm: Vec<Option<f64>>,
}

impl<'a> Moves<'a> {
    fn new(moves: &'a [Move], corner_rad: f64) -> Self {
        let lengths_mm = moves.iter().map(|step| step.element.length_mm()).collect();
        let wanted_mm = moves.windows(2).map(|pair| wanted_mm(&pair[0], &pair[1], corner_rad)).collect();
        Self { moves, lengths_mm, wanted_mm }
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

    /// What the curve of a run takes of its first and its last move \[mm\]: all of one that is not long.
    fn cuts_mm(&self, first: usize, last: usize) -> (f64, f64) {
        let of = |index: usize, junction: usize| {
            let length_mm = self.lengths_mm[index];
            let wanted_mm = self.wanted_mm[junction].unwrap_or(0.0);
            if self.is_long(index) {
                (MARGIN * wanted_mm).min(0.5 * TAKEN_MAX * length_mm)
            } else {
                length_mm
            }
        };
        (of(first, first), of(last, last - 1))
    }

    fn parts(&self, first: usize, last: usize, cuts_mm: (f64, f64), feed_mm_s: f64) -> Vec<Part> {
        let part = |index: usize| {
            let step = &self.moves[index];
            let first_mm = if index == first { self.lengths_mm[index] - cuts_mm.0 } else { 0.0 };
            let last_mm = if index == last { self.lengths_mm[index] - cuts_mm.1 } else { 0.0 };
            let is_whole = first_mm == 0.0 && last_mm == 0.0;
            let element = if is_whole { step.element } else { step.element.trimmed(first_mm, last_mm) };
            Part { element, tolerance_mm: tolerance_mm(step), feed_mm_s: step.feed_mm_s.min(feed_mm_s) }
        };
        (first..=last).map(part).collect()
    }
}

/// What a blend between two moves wants of either \[mm\]; nothing where there is to be none.
fn wanted_mm(before: &Move, after: &Move, corner_rad: f64) -> Option<f64> {
    let is_bent = |step: &Move| matches!(step.element, Element::Line { .. } | Element::Arc { .. });
    let tolerance_mm = tolerance_mm(before).min(tolerance_mm(after));
    if !(is_bent(before) && is_bent(after) && tolerance_mm > 0.0) {
        return None;
    }
    let ([_, end], [start, _]) = (before.element.ends(), after.element.ends());
    let angle_rad = angle(end.tangent, start.tangent);
    if angle_rad > corner_rad.min(ANGLE_MAX_RAD) {
        return None;
    }
    let jump_per_mm = norm(subtract(start.curvature, end.curvature));
    let by_angle_mm =
        if angle_rad > TANGENT_ROUNDING_RAD { trim_mm(angle_rad, tolerance_mm) } else { f64::INFINITY };
    let wanted_mm = by_angle_mm.min((tolerance_mm / (JUMP * jump_per_mm)).sqrt());
    Some(if wanted_mm.is_finite() { wanted_mm } else { 0.0 })
}

/// How far a curve may be from a move \[mm\]: merging is for lines.
fn tolerance_mm(step: &Move) -> f64 {
    match step.element {
        Element::Line { .. } if step.tolerance_mm > 0.0 => step.tolerance_mm + step.merging_mm.unwrap_or(0.0),
        _ => step.tolerance_mm,
    }
}
