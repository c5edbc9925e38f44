//! Where the curve gets its knots: as close as the path needs them within its tolerance.
//!
//! How far a straight line can stand for the path, within a share of the tolerance, is the scale on which
//! a curve within it bends. Knots stand at a part of that, and their distance changes gradually.

use super::super::{Vector, dot, norm, scale, subtract};
use super::guide::Guide;
use crate::toolpath::Element;

/// Part of the tolerance within which straight lines give the scale.
const SCALE_SHARE: f64 = 0.5;
/// Greatest change of the distance of knots over a length.
const SLOPE: f64 = 0.3;
/// The fewest spans: with fewer the conditions at both ends leave nothing free.
const SPANS_MIN: usize = 10;
/// The most chords that stand for an arc.
const CHORDS_MAX: f64 = 64.0;

/// A point of the path.
struct Point {
    mm: f64,
    at: Vector,
    tolerance_mm: f64,
}

/// A line that stands for the path.
struct Chord {
    start_mm: f64,
    end_mm: f64,
    /// The distance of knots on it, and what its neighbours before and behind allow at their ends \[mm\].
    knots_mm: f64,
    before_mm: f64,
    behind_mm: f64,
}

impl Chord {
    fn knots_mm(&self, mm: f64) -> f64 {
        let before_mm = self.before_mm + SLOPE * (mm - self.start_mm);
        let behind_mm = self.behind_mm + SLOPE * (self.end_mm - mm);
        self.knots_mm.min(before_mm).min(behind_mm)
    }
}

/// The knots, `per_scale` of them to the scale of the path \[mm\].
pub(super) fn knots(guide: &Guide, per_scale: f64) -> Vec<f64> {
    let chords = chords(&points(guide), per_scale);
    let length_mm = guide.length_mm();
    let mut knots = vec![0.0];
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
        knots.push(mm);
    }
    if knots.len() <= SPANS_MIN {
        return (0..=SPANS_MIN).map(|knot| length_mm * knot as f64 / SPANS_MIN as f64).collect();
    }
    // The last one is beyond the end.
    let stretched = length_mm / mm;
    knots.iter_mut().for_each(|knot| *knot *= stretched);
    if let Some(last) = knots.last_mut() {
        *last = length_mm;
    }
    knots
}

fn points(guide: &Guide) -> Vec<Point> {
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

fn chords(points: &[Point], per_scale: f64) -> Vec<Chord> {
    let mut chords: Vec<Chord> = Vec::new();
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
        let (start_mm, end_mm) = (points[first].mm, points[first + good].mm);
        let knots_mm = (end_mm - start_mm) / per_scale;
        chords.push(Chord { start_mm, end_mm, knots_mm, before_mm: f64::INFINITY, behind_mm: f64::INFINITY });
        first += good;
    }
    let mut allowed_mm = f64::INFINITY;
    for chord in &mut chords {
        chord.before_mm = allowed_mm;
        allowed_mm = chord.knots_mm(chord.end_mm);
    }
    allowed_mm = f64::INFINITY;
    for chord in chords.iter_mut().rev() {
        chord.behind_mm = allowed_mm;
        allowed_mm = chord.knots_mm(chord.start_mm);
    }
    chords
}

/// Whether the line from the first point to the last is within the tolerance of all.
fn is_straight(points: &[Point]) -> bool {
    let [first, between @ .., last] = points else { return false };
    let chord = subtract(last.at, first.at);
    let direction = scale(chord, 1.0 / norm(chord));
    let mut before_mm = 0.0;
    between.iter().chain([last]).all(|point| {
        let offset = subtract(point.at, first.at);
        let along_mm = dot(offset, direction);
        let across_mm = norm(subtract(offset, scale(direction, along_mm)));
        let is_on = along_mm >= before_mm && across_mm <= point.tolerance_mm;
        before_mm = along_mm;
        is_on
    })
}
