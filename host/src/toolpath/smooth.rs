//! A run of moves made ready for blends.
//!
//! Consumes moves that follow each other without a stop, each with the tolerance that its ends may be rounded
//! within; produces fewer moves where lines are short, and the blend of any junction within any length. Which
//! junctions are blended is up to planning. Background, in time linear in the moves.
//!
//! **Short lines.** Where lines are shorter than the blends at their ends would be, three fifths of the
//! tolerance are spent on making fewer lines and arcs of them, the rest on blends between these. One that
//! stays alone among longer ones is made part of the line before it, if that can be led past their corner.
//! Where the program gives merging a tolerance of its own (Q of G64), all lines of one feed are merged within
//! it, and the whole tolerance of blends counts from what they became. [`Run::faired`] puts curves in place of
//! what is dense instead, within both tolerances together.
//!
//! **Who gets the room.** Blends take at most nine tenths of an element together, and where motion starts or
//! ends half of that. A blend gets what the one at the other end does not need; if both want more, each gets
//! half. A tenth stays, so that the rest of a short element still has a direction of its own.

use motion_kernel::law::Limits;

use super::blend::{Blend, has_side, trim_mm};
use super::dense::{Faired, faired};
use super::easement::Easement;
use super::element::Element;
use super::merge::{Merged, merge};
use super::{Feeds, Greatest, Vector, angle, norm, subtract};
use crate::gcode::Axis;

/// Part of an element that blends may take together.
pub(super) const TAKEN_MAX: f64 = 0.9;

/// Part of the tolerance that short lines are merged within.
const MERGED_SHARE: f64 = 0.6;

/// What blends and easements leave of an element, or take of it, is some part of it, more than this.
const LEFT_MIN: f64 = 0.1;

/// Directions computed from coordinates that are exact to 10⁻¹⁰ mm agree to this where they are meant to
/// \[rad\]; curvatures agree to the same part of themselves.
pub const TANGENT_ROUNDING_RAD: f64 = 1.0e-9;

/// An element of the path with what the program says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move<const N: usize = 3> {
    /// Program line.
    pub line: u32,
    /// Geometry.
    pub element: Element<N>,
    /// Programmed feed.
    pub feeds: Feeds,
    /// Greatest distance that the path may be led past the move and its ends \[mm\]; 0 for exact path. At a
    /// junction the smaller one of both moves holds.
    pub tolerance_mm: f64,
    /// How far a line may be from what stands for it and others \[mm\], on top of the tolerance; without it,
    /// a part of the tolerance.
    pub merging_mm: Option<f64>,
    /// How far the element is from the programmed one \[mm\].
    pub distance_mm: f64,
}

impl<const N: usize> Move<N> {
    /// What merging takes of the tolerance where it leaves the path by `distance_mm`.
    fn spent_mm(&self, distance_mm: f64) -> f64 {
        if self.merging_mm.is_some() { 0.0 } else { distance_mm }
    }
}

/// A run of moves, its short lines merged, ready to be blended junction by junction. Junction `i` is that
/// between the moves `i` and `i + 1`.
#[derive(Clone, Debug)]
pub struct Run<const N: usize = 3> {
    moves: Vec<Move<N>>,
    lengths_mm: Vec<f64>,
    /// How far each move is from those that it stands for \[mm\].
    distances_mm: Vec<f64>,
    /// How each move bends at its tightest where that is known already.
    greatest: Vec<Option<Greatest<N>>>,
}

impl<const N: usize> Run<N> {
    /// The run of `moves`, which follow each other without a stop.
    #[must_use]
    pub fn new(moves: &[Move<N>]) -> Self {
        let (moves, distances_mm) = merged(moves);
        Self::of(moves, distances_mm, Vec::new())
    }

    /// The runs of `moves` with curves in place of what is dense, made for `limits` and at most `feed_mm_s` on a machine
    /// with these `axes`: one for each of `corners_rad` that makes a difference. A turn of more than that stays a corner.
    #[must_use]
    pub fn faired(
        moves: &[Move<N>],
        corners_rad: &[f64],
        limits: &Limits<f64>,
        feed_mm_s: f64,
        axes: &[Option<Axis>; N],
    ) -> Vec<Self> {
        let made = faired(moves, corners_rad, limits, feed_mm_s, axes).into_iter();
        let mut runs: Vec<Self> = made
            .map(|Faired { moves, distances_mm, greatest }| Self::of(moves, distances_mm, greatest))
            .collect();
        runs.dedup_by(|run, before| run.moves == before.moves);
        runs
    }

    /// The run of `moves` as they are, nothing merged.
    #[must_use]
    pub fn exact(moves: &[Move<N>]) -> Self {
        Self::of(moves.to_vec(), vec![0.0; moves.len()], Vec::new())
    }

    fn of(moves: Vec<Move<N>>, distances_mm: Vec<f64>, greatest: Vec<Option<Greatest<N>>>) -> Self {
        let lengths_mm = moves.iter().map(|step| step.element.length_mm()).collect();
        Self { moves, lengths_mm, distances_mm, greatest }
    }

    /// How a move bends at its tightest.
    #[must_use]
    pub fn greatest(&self, index: usize) -> Greatest<N> {
        let known = self.greatest.get(index).copied().flatten();
        known.unwrap_or_else(|| self.moves[index].element.greatest())
    }

    /// The moves.
    #[must_use]
    pub fn moves(&self) -> &[Move<N>] {
        &self.moves
    }

    /// Length of a move \[mm\].
    #[must_use]
    pub fn length_mm(&self, index: usize) -> f64 {
        self.lengths_mm[index]
    }

    /// Number of junctions.
    #[must_use]
    pub fn junctions(&self) -> usize {
        self.moves.len().saturating_sub(1)
    }

    /// How far a move is from those that it stands for, over its tolerance.
    #[must_use]
    pub fn tolerance_share(&self, index: usize) -> f64 {
        let Move { tolerance_mm, merging_mm, distance_mm, .. } = self.moves[index];
        share(self.distances_mm[index], merging_mm.unwrap_or(tolerance_mm))
            .max(share(distance_mm, tolerance_mm))
    }

    /// The same of what rounds a junction and is so far from its moves: what they are off adds to it.
    #[must_use]
    pub fn tolerance_share_of(&self, junction: usize, off_mm: f64) -> f64 {
        let [before, after] = [junction, junction + 1].map(|index| &self.moves[index]);
        let merging_mm = before.merging_mm.unwrap_or(0.0).max(after.merging_mm.unwrap_or(0.0));
        let distance_mm = self.distances_mm[junction].max(self.distances_mm[junction + 1]);
        share(off_mm + distance_mm, before.tolerance_mm.min(after.tolerance_mm) + merging_mm)
    }

    /// Whether something steps at a junction of lines or arcs, so that there may be a blend.
    #[must_use]
    pub fn has_blend(&self, junction: usize) -> bool {
        let [before, after] = [junction, junction + 1].map(|index| &self.moves[index].element);
        has_side(before) && has_side(after) && !is_smooth([before, after])
    }

    /// The blend of a junction with at most `room_mm` of either move; none where nothing steps.
    #[must_use]
    pub fn blend(&self, junction: usize, room_mm: f64, limits: &Limits<f64>) -> Option<Blend<N>> {
        if !self.has_blend(junction) {
            return None;
        }
        let [before, after] = [junction, junction + 1].map(|index| &self.moves[index].element);
        Blend::new(before, after, self.left_mm(junction), room_mm, limits)
    }

    /// The easements of a junction with at most `rooms_mm` of the two moves.
    #[must_use]
    pub fn easements(&self, junction: usize, rooms_mm: [f64; 2]) -> Vec<Easement<N>> {
        let elements = [&self.moves[junction].element, &self.moves[junction + 1].element];
        Easement::all(elements, self.left_mm(junction), rooms_mm)
    }

    /// The angle of a junction \[rad\] where velocity would step at it and the path may be changed.
    #[must_use]
    pub fn kink_rad(&self, junction: usize) -> Option<f64> {
        let (before, after) = (&self.moves[junction], &self.moves[junction + 1]);
        let kink_rad = kink_rad([&before.element, &after.element])?;
        (before.tolerance_mm.min(after.tolerance_mm) > 0.0).then_some(kink_rad)
    }

    /// What is left of the tolerance of a junction \[mm\]. A move of exact path is cut at neither end.
    #[must_use]
    pub fn left_mm(&self, junction: usize) -> f64 {
        let (before, after) = (&self.moves[junction], &self.moves[junction + 1]);
        let spent_mm =
            before.spent_mm(self.distances_mm[junction]).max(after.spent_mm(self.distances_mm[junction + 1]));
        before.tolerance_mm.min(after.tolerance_mm) - spent_mm
    }

    /// What blends may take of a move together \[mm\]. At the start and the end of the run motion needs room
    /// of its own, to set out and to stop.
    #[must_use]
    pub fn taken_mm_max(&self, index: usize) -> f64 {
        let is_end = index == 0 || index + 1 == self.moves.len();
        self.lengths_mm[index] * if is_end { 0.5 * TAKEN_MAX } else { TAKEN_MAX }
    }

    /// What is left of the two moves of a junction where their other ends are trimmed by `trims_mm` \[mm\], at most half of what
    /// is there.
    #[must_use]
    pub fn halves_mm(&self, junction: usize, [before_mm, after_mm]: [f64; 2]) -> [f64; 2] {
        let half_mm = |index: usize, other_mm: f64| {
            let left_mm = self.taken_mm_max(index) - other_mm;
            left_mm.min(0.5 * TAKEN_MAX * self.lengths_mm[index]).max(0.0)
        };
        [half_mm(junction, before_mm), half_mm(junction + 1, after_mm)]
    }

    /// The greatest trims of the two moves of a junction where what is at their other ends trims them by
    /// `trims_mm` \[mm\], at least half of what is there.
    #[must_use]
    pub fn rooms_mm(&self, junction: usize, [before_mm, after_mm]: [f64; 2]) -> [f64; 2] {
        let left_mm = |index: usize, other_mm: f64| {
            (self.taken_mm_max(index) - other_mm).max(0.5 * TAKEN_MAX * self.lengths_mm[index])
        };
        [left_mm(junction, before_mm), left_mm(junction + 1, after_mm)]
    }
}

fn share(distance_mm: f64, tolerance_mm: f64) -> f64 {
    if distance_mm > 0.0 { distance_mm / tolerance_mm } else { 0.0 }
}

/// The moves, with fewer in place of runs of short lines, and each one's distance from the moves it stands
/// for.
fn merged<const N: usize>(moves: &[Move<N>]) -> (Vec<Move<N>>, Vec<f64>) {
    let (mut merged, mut distances_mm) = (Vec::with_capacity(moves.len()), Vec::with_capacity(moves.len()));
    let mut rest = moves;
    while let Some(first) = rest.first() {
        let count = rest.windows(2).take_while(|pair| is_same_run(&pair[0], &pair[1])).count() + 1;
        let (run, after) = rest.split_at(count);
        rest = after;
        let tolerance_mm = first.merging_mm.unwrap_or(MERGED_SHARE * first.tolerance_mm);
        let rooms: Vec<Room> = match first.merging_mm {
            None => (0..count).map(|index| Room::of(run, index)).collect(),
            // A move by itself, which may be an arc, stays.
            Some(_) => vec![if count > 1 { Room::TooLittle } else { Room::Unneeded }; count],
        };
        let mut done = 0;
        for same in rooms.chunk_by(|a, b| (*a == Room::Enough) == (*b == Room::Enough)) {
            let steps = &run[done..done + same.len()];
            let before = (done > 0).then(|| merged.last_mut().zip(distances_mm.last_mut())).flatten();
            done += same.len();
            if !same.contains(&Room::TooLittle) {
                merged.extend_from_slice(steps);
                distances_mm.resize(merged.len(), 0.0);
                continue;
            }
            let ends = steps.iter().map(|step| step.element.ends_mm());
            let points: Vec<Vector<N>> =
                core::iter::once(steps[0].element.ends_mm().0).chain(ends.map(|(_, to)| to)).collect();
            let parts = merge(&points, tolerance_mm);
            let feeds_of = |part: usize| {
                let end = parts.get(part + 1).map_or(steps.len(), |next| next.first);
                let feeds = steps[parts[part].first..end].iter().map(|step| step.feeds);
                feeds.reduce(Feeds::least).unwrap_or(steps[parts[part].first].feeds)
            };
            if let ([part], Some((before, distance_mm))) = (&parts[..], before)
                && let Some((line, straight_mm)) = straightened(before, *distance_mm, part, tolerance_mm)
            {
                before.feeds = before.feeds.least(feeds_of(0));
                (before.element, *distance_mm) = (line, straight_mm);
                continue;
            }
            for (index, part) in parts.iter().enumerate() {
                merged.push(Move { element: part.element, feeds: feeds_of(index), ..steps[part.first] });
                distances_mm.push(part.distance_mm);
            }
        }
    }
    (merged, distances_mm)
}

/// One line in place of two, the second of them alone between longer ones, and its distance from the path.
fn straightened<const N: usize>(
    before: &Move<N>,
    before_mm: f64,
    part: &Merged<N>,
    tolerance_mm: f64,
) -> Option<(Element<N>, f64)> {
    let (Element::Line { from, to: corner }, Element::Line { to, .. }) = (before.element, part.element)
    else {
        return None;
    };
    let spent_mm = before_mm.max(part.distance_mm);
    let [line] = merge(&[from, corner, to], tolerance_mm - spent_mm)[..] else { return None };
    Some((line.element, spent_mm + line.distance_mm))
}

/// Whether two moves may become one: lines with one feed and one tolerance. What becomes of them is driven at the feed of
/// its own direction.
pub(crate) fn is_same_run<const N: usize>(before: &Move<N>, after: &Move<N>) -> bool {
    let is_line = |step: &Move<N>| matches!(step.element, Element::Line { .. });
    is_line(before)
        && is_line(after)
        && before.feeds.ask_alike(after.feeds)
        && before.tolerance_mm == after.tolerance_mm
        && before.merging_mm == after.merging_mm
        && before.merging_mm.unwrap_or(before.tolerance_mm) > 0.0
}

/// What a line has for blends at its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Room {
    /// Both have the length they want.
    Enough,
    /// One of them would be shorter than the tolerance lets it be.
    TooLittle,
    /// There are none to be made: it goes straight on at both ends.
    Unneeded,
}

impl Room {
    fn of<const N: usize>(run: &[Move<N>], index: usize) -> Self {
        let trim_mm = |before: Option<&Move<N>>, after: Option<&Move<N>>| {
            let (before, after) = (before?, after?);
            let angle_rad = angle(before.element.ends()[1].tangent, after.element.ends()[0].tangent);
            (angle_rad > TANGENT_ROUNDING_RAD).then(|| trim_mm(angle_rad, before.tolerance_mm))
        };
        let step = &run[index];
        let before = trim_mm(index.checked_sub(1).map(|before| &run[before]), Some(step));
        let after = trim_mm(Some(step), run.get(index + 1));
        match before.into_iter().chain(after).reduce(f64::max) {
            None => Self::Unneeded,
            Some(longest_mm) if 0.5 * TAKEN_MAX * step.element.length_mm() < longest_mm => Self::TooLittle,
            Some(_) => Self::Enough,
        }
    }
}

/// The angle from one element to the next \[rad\], where it is more than rounding.
pub(crate) fn kink_rad<const N: usize>([before, after]: [&Element<N>; 2]) -> Option<f64> {
    let kink_rad = angle(before.ends()[1].tangent, after.ends()[0].tangent);
    // Lengths may take a quadrature.
    let shorter_mm = || before.length_mm().min(after.length_mm());
    let is_kink =
        kink_rad > TANGENT_ROUNDING_RAD && kink_rad > direction_rounding_rad(LEFT_MIN * shorter_mm());
    is_kink.then_some(kink_rad)
}

/// How well directions of pieces agree where they are meant to, the shorter of which has that length \[rad\]: the ends of
/// pieces are rounded to position steps.
pub(crate) fn direction_rounding_rad(length_mm: f64) -> f64 {
    2.0 * TANGENT_ROUNDING_RAD + 4.0e-10 / length_mm
}

/// Whether nothing steps from one element to the next.
pub(super) fn is_smooth<const N: usize>([before, after]: [&Element<N>; 2]) -> bool {
    let ([_, end], [start, _]) = (before.ends(), after.ends());
    let step = norm(subtract(start.curvature, end.curvature));
    angle(end.tangent, start.tangent) <= TANGENT_ROUNDING_RAD
        && step <= TANGENT_ROUNDING_RAD * norm(start.curvature).max(norm(end.curvature))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

    /// Lines between points, each with its feed.
    pub(crate) fn path(points: &[[f64; 2]], tolerance_mm: f64, feed_mm_s: impl Fn(u32) -> f64) -> Vec<Move> {
        let point = |[x, y]: [f64; 2]| [x, y, 0.0];
        points
            .windows(2)
            .zip(1..)
            .map(|(pair, line)| {
                let element = Element::Line { from: point(pair[0]), to: point(pair[1]) };
                let feeds = Feeds::xyz(feed_mm_s(line));
                Move { line, element, feeds, tolerance_mm, merging_mm: None, distance_mm: 0.0 }
            })
            .collect()
    }

    fn own_feed(line: u32) -> f64 {
        10.0 * f64::from(line)
    }

    fn kinds(moves: &[Move]) -> Vec<(u32, &'static str)> {
        moves.iter().map(|step| (step.line, step.element.kind())).collect()
    }

    #[test]
    fn without_a_tolerance_nothing_changes() {
        let moves = path(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]], 0.0, own_feed);
        let run = Run::new(&moves);
        assert_eq!(run.moves(), moves);
        assert_eq!(run.blend(0, 1.0, &LIMITS), None);
        assert_eq!(Run::<3>::new(&[]).junctions(), 0);
    }

    /// A corner that was cut off by a micrometre is one corner.
    #[test]
    fn a_tiny_line_among_long_ones_joins_the_one_before() {
        let mut moves = path(&[[0.0, 0.0], [10.0, 0.0], [10.0007, 0.0007], [10.0007, 10.0]], 0.05, own_feed);
        assert_eq!(Run::new(&moves).moves().len(), 3);
        moves.iter_mut().for_each(|step| step.feeds = Feeds::xyz(50.0));
        let run = Run::new(&moves);
        assert_eq!(kinds(run.moves()), [(1, "line"), (3, "line")]);
        assert_eq!(run.moves()[1].element.ends_mm().1, [10.0007, 10.0, 0.0]);
    }

    /// Merging is for lines of one feed, and spends part of the tolerance only.
    #[test]
    fn short_lines_are_merged_where_their_feed_is_one() {
        let points: Vec<[f64; 2]> = (0..=100)
            .map(|index| {
                let (sine, cosine) = libm::sincos(0.01 * f64::from(index));
                [10.0 * cosine, 10.0 * sine]
            })
            .collect();
        let mut moves = path(&points, 0.01, own_feed);
        moves.iter_mut().for_each(|step| step.feeds = Feeds::xyz(50.0));
        assert_eq!(kinds(Run::new(&moves).moves()), [(1, "arc")]);
        moves.iter_mut().for_each(|step| step.feeds = Feeds::xyz(if step.line <= 40 { 50.0 } else { 60.0 }));
        assert_eq!(kinds(Run::new(&moves).moves()), [(1, "arc"), (41, "arc")]);
        // The chords' sagitta, 0.125 µm, is more than a part of this tolerance.
        moves.iter_mut().for_each(|step| step.tolerance_mm = 1e-4);
        assert_eq!(Run::new(&moves).moves().len(), 100);
    }
}
