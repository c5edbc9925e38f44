//! Where the curve gets its knots: as close as the path needs them within its tolerance.
//!
//! How far a straight line can stand for the path, within a share of the tolerance, is the scale on which
//! a curve within it bends. Knots stand at a part of that, closer where one such line turns into the next,
//! and their distance changes gradually. Where they turn out to be too few, more are put between them.

use core::ops::Range;

use super::super::{Vector, dot, norm, scale, subtract};
use super::guide::Guide;
use crate::toolpath::Element;

/// Part of the tolerance within which straight lines give the scale.
const SCALE_SHARE: f64 = 0.6;
/// How many knots there are to the scale.
const PER_SCALE: f64 = 2.0;
/// Distance of knots where the direction turns, over the tolerance and one over the turn: between two lines,
/// and at an end, where the curve starts as the path does.
const ROOM: f64 = 4.5;
const END_ROOM: f64 = 2.0;
/// Greatest change of the distance of knots over a length.
const SLOPE: f64 = 0.3;
/// The fewest spans: with fewer the conditions at both ends leave nothing free.
const SPANS_MIN: usize = 10;
/// How many spans on either side of one that has too few knots get more, too.
const BESIDE: usize = 1;
/// The most chords that stand for an arc.
const CHORDS_MAX: f64 = 64.0;

/// The spans of a curve.
pub(super) struct Mesh {
    /// Their ends \[mm\].
    pub(super) breaks_mm: Vec<f64>,
    /// On what scale the path bends at each of them \[mm\].
    pub(super) scales_mm: Vec<f64>,
}

impl Mesh {
    pub(super) fn new<const N: usize>(guide: &Guide<N>) -> Self {
        let chords = chords(guide);
        let breaks_mm = breaks_mm(&chords, guide.length_mm());
        let mut first = 0;
        let scale_mm = |ends: &[f64]| {
            while first + 1 < chords.len() && chords[first].end_mm <= ends[0] {
                first += 1;
            }
            let over = chords[first..].iter().take_while(|chord| chord.start_mm < ends[1]);
            PER_SCALE * over.fold(f64::INFINITY, |least, chord| least.min(chord.alone_mm(ends)))
        };
        let scales_mm = breaks_mm.windows(2).map(scale_mm).collect();
        Self { breaks_mm, scales_mm }
    }

    /// How many spans it has.
    pub(super) fn len(&self) -> usize {
        self.scales_mm.len()
    }

    /// So many of its spans.
    pub(super) fn part(&self, spans: Range<usize>) -> Self {
        Self {
            breaks_mm: self.breaks_mm[spans.start..=spans.end].to_vec(),
            scales_mm: self.scales_mm[spans].to_vec(),
        }
    }

    /// The lengths of the spans \[mm\].
    pub(super) fn lengths_mm(&self) -> Vec<f64> {
        self.breaks_mm.windows(2).map(|ends| ends[1] - ends[0]).collect()
    }

    /// One knot more in the middle of each span named, in rising order, and of those beside it; nothing if
    /// none is named.
    pub(super) fn refined(&self, spans: &[usize]) -> Option<Self> {
        let mut breaks_mm = Vec::with_capacity(self.breaks_mm.len() + (2 * BESIDE + 1) * spans.len());
        let mut scales_mm = Vec::with_capacity(breaks_mm.capacity());
        let mut named = spans.iter().peekable();
        for (span, (ends, &scale_mm)) in self.breaks_mm.windows(2).zip(&self.scales_mm).enumerate() {
            breaks_mm.push(ends[0]);
            scales_mm.push(scale_mm);
            while named.next_if(|&&named| named + BESIDE < span).is_some() {}
            if named.peek().is_some_and(|&&named| named <= span + BESIDE) {
                breaks_mm.push(f64::midpoint(ends[0], ends[1]));
                scales_mm.push(scale_mm);
            }
        }
        breaks_mm.push(*self.breaks_mm.last()?);
        (!spans.is_empty()).then_some(Self { breaks_mm, scales_mm })
    }
}

/// A point of the path.
struct Point<const N: usize> {
    mm: f64,
    at: Vector<N>,
    tolerance_mm: f64,
}

/// A line that stands for the path.
struct Chord {
    start_mm: f64,
    end_mm: f64,
    /// The distance of knots that its length asks for, and what its turns at both ends do \[mm\].
    knots_mm: f64,
    turns_mm: [f64; 2],
    /// The distance of knots at its ends, with what the chords before and behind ask for \[mm\].
    before_mm: f64,
    behind_mm: f64,
}

impl Chord {
    /// The distance of knots.
    fn knots_mm(&self, mm: f64) -> f64 {
        let before_mm = self.before_mm + SLOPE * (mm - self.start_mm);
        let behind_mm = self.behind_mm + SLOPE * (self.end_mm - mm);
        self.knots_mm.min(before_mm).min(behind_mm)
    }

    /// The distance of knots that it asks for between `ends`.
    fn alone_mm(&self, ends: &[f64]) -> f64 {
        let before_mm = if self.start_mm >= ends[0] { self.turns_mm[0] } else { f64::INFINITY };
        let behind_mm = if self.end_mm <= ends[1] { self.turns_mm[1] } else { f64::INFINITY };
        self.knots_mm.min(before_mm).min(behind_mm)
    }
}

fn breaks_mm(chords: &[Chord], length_mm: f64) -> Vec<f64> {
    let mut breaks_mm = vec![0.0];
    let (mut mm, mut chord) = (0.0, 0);
    while mm < length_mm {
        let distance_at = |chord: &mut usize, mm: f64| {
            while *chord + 1 < chords.len() && chords[*chord].end_mm <= mm {
                *chord += 1;
            }
            chords[*chord].knots_mm(mm)
        };
        let here_mm = distance_at(&mut chord, mm);
        let there_mm = distance_at(&mut chord.clone(), (mm + here_mm).min(length_mm));
        mm += here_mm.min(1.5 * there_mm).max(1e-9 * length_mm);
        breaks_mm.push(mm);
    }
    if breaks_mm.len() <= SPANS_MIN {
        breaks_mm = (0..=SPANS_MIN).map(|knot| length_mm * knot as f64 / SPANS_MIN as f64).collect();
    } else {
        // The last one is beyond the end.
        let stretched = length_mm / mm;
        breaks_mm.iter_mut().for_each(|end_mm| *end_mm *= stretched);
    }
    // Not an ulp beyond the path.
    if let Some(last) = breaks_mm.last_mut() {
        *last = length_mm;
    }
    breaks_mm
}

fn points<const N: usize>(guide: &Guide<N>) -> Vec<Point<N>> {
    let mut points = Vec::with_capacity(guide.parts.len() + 1);
    for (index, part) in guide.parts.iter().enumerate() {
        let (start_mm, end_mm) = guide.range_mm(index);
        let tolerance_mm = SCALE_SHARE * part.tolerance_mm;
        if points.is_empty() {
            points.push(Point { mm: start_mm, at: guide.at(index, start_mm).0, tolerance_mm });
        }
        let chords = match part.element {
            Element::Arc { shape, sweep_rad, .. } => {
                let chord_rad = (2.0 * tolerance_mm / shape.radius_mm).sqrt();
                (sweep_rad / chord_rad).ceil().clamp(1.0, CHORDS_MAX)
            }
            _ => 1.0,
        };
        for chord in 1..=chords as u32 {
            let mm = start_mm + (end_mm - start_mm) * (f64::from(chord) / chords);
            points.push(Point { mm, at: guide.at(index, mm).0, tolerance_mm });
        }
    }
    points
}

/// The longest lines that stand for the path, one after the other.
fn chords<const N: usize>(guide: &Guide<N>) -> Vec<Chord> {
    let points = points(guide);
    let mut chords: Vec<Chord> = Vec::new();
    // By the length of the path: a line that stands for what goes to and fro is slower than it.
    let [mut velocity, end_velocity] = [false, true].map(|is_end| guide.end(is_end)[1]);
    let turn_mm = |room: f64, point: &Point<N>, before: Vector<N>, after: Vector<N>| {
        room * point.tolerance_mm / norm(subtract(after, before))
    };
    let mut first = 0;
    while first + 1 < points.len() {
        let fits = |count: usize| points.get(first..=first + count).is_some_and(is_straight);
        let (mut good, mut bad) = (1, 2);
        while fits(bad) {
            good = bad;
            bad *= 2;
        }
        while bad - good > 1 {
            let middle = usize::midpoint(good, bad);
            if fits(middle) { good = middle } else { bad = middle }
        }
        let [start, end] = [&points[first], &points[first + good]];
        let (start_mm, end_mm) = (start.mm, end.mm);
        let before = velocity;
        velocity = scale(subtract(end.at, start.at), 1.0 / (end_mm - start_mm));
        let room = if chords.is_empty() { END_ROOM } else { ROOM };
        let turns_mm =
            [turn_mm(room, start, before, velocity), turn_mm(END_ROOM, end, velocity, end_velocity)];
        if let Some(chord) = chords.last_mut() {
            chord.turns_mm[1] = turns_mm[0];
        }
        let knots_mm = (end_mm - start_mm) / PER_SCALE;
        chords.push(Chord { start_mm, end_mm, knots_mm, turns_mm, before_mm: 0.0, behind_mm: 0.0 });
        first += good;
    }
    let mut allowed_mm = f64::INFINITY;
    for chord in &mut chords {
        (chord.before_mm, chord.behind_mm) = (chord.turns_mm[0].min(allowed_mm), chord.turns_mm[1]);
        allowed_mm = chord.knots_mm(chord.end_mm);
    }
    allowed_mm = f64::INFINITY;
    for chord in chords.iter_mut().rev() {
        chord.behind_mm = chord.behind_mm.min(allowed_mm);
        allowed_mm = chord.knots_mm(chord.start_mm);
    }
    chords
}

/// Whether a line through the middle of the points, in the direction from the first to the last, is within
/// the tolerance of all.
fn is_straight<const N: usize>(points: &[Point<N>]) -> bool {
    let [first, .., last] = points else { return false };
    let chord = subtract(last.at, first.at);
    let direction = scale(chord, 1.0 / norm(chord));
    let across = |point: &Point<N>| {
        let offset = subtract(point.at, first.at);
        subtract(offset, scale(direction, dot(offset, direction)))
    };
    // The first point is at 0 across.
    let farther = |a: Vector<N>, b: Vector<N>| if norm(b) > norm(a) { b } else { a };
    let middle = scale(points.iter().map(across).fold([0.0; N], farther), 0.5);
    let mut before_mm = 0.0;
    points.iter().all(|point| {
        let along_mm = dot(subtract(point.at, first.at), direction);
        let is_on = along_mm >= before_mm && norm(subtract(across(point), middle)) <= point.tolerance_mm;
        before_mm = along_mm;
        is_on
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A span that is named is halved with its neighbours, and every half keeps its scale.
    #[test]
    fn what_is_named_gets_a_knot_with_its_neighbours() {
        let mesh =
            Mesh { breaks_mm: (0..=8).map(f64::from).collect(), scales_mm: (0..8).map(f64::from).collect() };
        let refined = mesh.refined(&[0, 4, 5]).expect("spans");
        let breaks = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 8.0];
        assert_eq!(refined.breaks_mm, breaks);
        let scales = [0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0, 4.0, 4.0, 5.0, 5.0, 6.0, 6.0, 7.0];
        assert_eq!(refined.scales_mm, scales);
        let at_the_end = mesh.refined(&[7]).expect("spans");
        assert_eq!(at_the_end.breaks_mm[6..], [6.0, 6.5, 7.0, 7.5, 8.0]);
        assert!(mesh.refined(&[]).is_none());
    }
}
