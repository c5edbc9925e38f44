//! Runs of short lines to fewer lines and arcs.
//!
//! A curve that was cut into chords has a corner at every one of them, and no room for blends that are worth
//! it. Consumes the points of such a run; produces the longest lines and arcs through some of them, first to
//! last, from which the run is nowhere farther than a tolerance, nor they from the run. Background; greedy,
//! with O(n log n) tests of a point.
//!
//! **Why both ways.** A segment of the run and the part of a line or arc that stands for it are walked
//! together, by their projection on the line or by the angle about the arc's centre, which have to grow along
//! the run. So every point of either has a partner on the other, and the greatest distance between partners
//! bounds both.
//!
//! **Arcs** are looked for in space only: where more than three coordinates move, lines alone stand for the run.

use super::curve::Spiral;
use super::element::Element;
use super::subspace::Subspace;
use super::{Vector, add, cross, dot, norm, scale, subtract};

/// The widest arc that stands for a run \[rad\]: three quarters of a turn, so that its ends stay apart.
const SWEEP_RAD_MAX: f64 = 1.5 * core::f64::consts::PI;
/// The fewest segments that an arc stands for: two always have one through their three points.
const ARC_SEGMENTS_MIN: usize = 3;
/// The greatest radius, over the chord: beyond, an arc is as good as straight, and its centre has no digits.
const RADIUS_RATIO_MAX: f64 = 1.0e5;

/// A line or arc for the segments from one point of a run to a later one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merged<const N: usize = 3> {
    /// Index of the segment it begins with.
    pub first: usize,
    /// The line or arc.
    pub element: Element<N>,
    /// A bound on the distance between it and the segments \[mm\]; 0 for a segment that stays.
    pub distance_mm: f64,
}

/// Lines and arcs for the run through `points`, at most `tolerance_mm` from it.
#[must_use]
pub fn merge<const N: usize>(points: &[Vector<N>], tolerance_mm: f64) -> Vec<Merged<N>> {
    let mut merged = Vec::new();
    let mut first = 0;
    while first + 1 < points.len() {
        let single = (Element::Line { from: points[first], to: points[first + 1] }, 0.0);
        let (mut segments, mut best) = (1, single);
        let mut accept = |count: usize| {
            let found = points.get(first..=first + count).and_then(|points| fit(points, tolerance_mm));
            if let Some(found) = found {
                (segments, best) = (count, found);
            }
            found.is_some()
        };
        // Twice as many as long as that goes (an arc has to be tried at its shortest), then as many as go.
        let (mut good, mut bad) = (1, 2);
        loop {
            if accept(bad) {
                good = bad;
            } else if bad >= ARC_SEGMENTS_MIN {
                break;
            }
            bad = (2 * good).max(bad + 1);
        }
        while bad - good > 1 {
            let middle = usize::midpoint(good, bad);
            if accept(middle) { good = middle } else { bad = middle }
        }
        let (element, distance_mm) = best;
        merged.push(Merged { first, element, distance_mm });
        first += segments;
    }
    merged
}

/// The line from the first point to the last, or the arc through one in the middle too, if it is close
/// enough.
fn fit<const N: usize>(points: &[Vector<N>], tolerance_mm: f64) -> Option<(Element<N>, f64)> {
    line(points, tolerance_mm).or_else(|| arc(points, tolerance_mm))
}

fn line<const N: usize>(points: &[Vector<N>], tolerance_mm: f64) -> Option<(Element<N>, f64)> {
    let (&from, &to) = (points.first()?, points.last()?);
    let chord = subtract(to, from);
    let length_mm = norm(chord);
    let direction = scale(chord, 1.0 / length_mm);
    let (mut before_mm, mut distance_mm) = (0.0, 0.0_f64);
    for &point in points {
        let offset = subtract(point, from);
        let along_mm = dot(offset, direction);
        let across_mm = norm(subtract(offset, scale(direction, along_mm)));
        // Not the other way round, which would accept what is not a number.
        if !(along_mm >= before_mm && across_mm <= tolerance_mm) {
            return None;
        }
        before_mm = along_mm;
        distance_mm = distance_mm.max(across_mm);
    }
    Some((Element::Line { from, to }, distance_mm))
}

fn arc<const N: usize>(points: &[Vector<N>], tolerance_mm: f64) -> Option<(Element<N>, f64)> {
    if points.len() <= ARC_SEGMENTS_MIN {
        return None;
    }
    let (&rest, last) = (points.first()?, points.last()?);
    let space = moving(points)?;
    let (from, to) = (space.narrow(rest), space.narrow(*last));
    let middle = space.narrow(*points.get(points.len() / 2)?);
    // The circle through three points, relative to the first.
    let (chord, part) = (subtract(to, from), subtract(middle, from));
    let normal = cross(part, chord);
    let square = dot(normal, normal);
    let to_centre = scale(
        add(scale(cross(normal, part), dot(chord, chord)), scale(cross(chord, normal), dot(part, part))),
        0.5 / square,
    );
    let radius_mm = norm(to_centre);
    if !(radius_mm <= RADIUS_RATIO_MAX * norm(chord)) || radius_mm <= 0.0 {
        return None;
    }
    let axis = scale(normal, 1.0 / square.sqrt());
    let outward = scale(to_centre, -1.0 / radius_mm);
    let onward = cross(axis, outward);
    let (mut sweep_rad, mut distance_mm) = (0.0, 0.0_f64);
    let mut before: Option<(Vector, f64)> = None;
    for &point in points {
        let point = space.narrow(point);
        let spoke = subtract(subtract(point, from), to_centre);
        let height_mm = dot(spoke, axis);
        let spoke = subtract(spoke, scale(axis, height_mm));
        let (mut off_mm, mut high_mm) = ((norm(spoke) - radius_mm).abs(), height_mm.abs());
        if let Some((before, before_high_mm)) = before {
            // Along a segment the distance from the axis has its greatest at the ends, and its least at the
            // foot.
            high_mm = high_mm.max(before_high_mm);
            let segment = subtract(spoke, before);
            let foot = -dot(before, segment) / dot(segment, segment);
            if foot > 0.0 && foot < 1.0 {
                off_mm = off_mm.max((norm(add(before, scale(segment, foot))) - radius_mm).abs());
            }
            let angle = libm::atan2(dot(cross(before, spoke), axis), dot(before, spoke));
            sweep_rad += angle;
            // A segment that reverses, or bends by a quarter of a circle at once, is no chord of this arc.
            if !(0.0..core::f64::consts::FRAC_PI_2).contains(&angle) || sweep_rad > SWEEP_RAD_MAX {
                return None;
            }
        }
        before = Some((spoke, height_mm.abs()));
        let point_mm = libm::hypot(off_mm, high_mm);
        if !(point_mm <= tolerance_mm) {
            return None;
        }
        distance_mm = distance_mm.max(point_mm);
    }
    let shape = Spiral { outward, onward, radius_mm, radius_per_rad: 0.0, across_per_rad: [0.0; 3] };
    Some((space.widen_element(&Element::Arc { from, to, shape, sweep_rad }, rest), distance_mm))
}

/// The coordinates that move from point to point, if they are three at most.
fn moving<const N: usize>(points: &[Vector<N>]) -> Option<Subspace> {
    let first = points.first()?;
    let moves: [bool; N] = core::array::from_fn(|axis| points.iter().any(|point| point[axis] != first[axis]));
    Subspace::of(moves)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(radius_mm: f64, segments: u32, of: u32) -> Vec<Vector> {
        (0..=segments)
            .map(|index| {
                let (sine, cosine) = libm::sincos(core::f64::consts::TAU * f64::from(index) / f64::from(of));
                // A plane that no axis lies in.
                [radius_mm * cosine, radius_mm * sine * 0.6, radius_mm * sine * 0.8]
            })
            .collect()
    }

    #[test]
    fn chords_of_a_circle_become_arcs() {
        let merged = merge(&circle(10.0, 400, 400), 1e-3);
        assert_eq!(merged.len(), 2);
        for part in &merged {
            let Element::Arc { shape, sweep_rad, .. } = part.element else { panic!("an arc: {part:?}") };
            assert!((shape.radius_mm - 10.0).abs() < 1e-9 && sweep_rad <= SWEEP_RAD_MAX);
            // The chords' sagitta.
            let sagitta_mm = 10.0 * (1.0 - libm::cos(core::f64::consts::PI / 400.0));
            assert!((part.distance_mm - sagitta_mm).abs() < 1e-9, "{} {sagitta_mm}", part.distance_mm);
        }
        assert_eq!((merged[0].first, merged[1].first), (0, 300));
        // Below the sagitta no arc is close enough, and a line even less.
        assert_eq!(merge(&circle(10.0, 400, 400), 1e-4).len(), 400);
    }

    #[test]
    fn straight_runs_become_lines_and_corners_stay() {
        let mut points: Vec<Vector> =
            (0..=50).map(|i| [f64::from(i), 1e-3 * f64::from(i % 2), 0.0]).collect();
        points.extend((1..=50).map(|i| [50.0, f64::from(i), 0.0]));
        let merged = merge(&points, 2e-3);
        let lines: Vec<_> =
            merged.iter().map(|part| (part.first, part.element.kind(), part.element.ends_mm())).collect();
        assert_eq!(
            lines,
            [(0, "line", ([0.0; 3], [50.0, 0.0, 0.0])), (50, "line", ([50.0, 0.0, 0.0], [50.0, 50.0, 0.0]))]
        );
        assert!((merged[0].distance_mm - 1e-3).abs() < 1e-15);
    }

    /// A reversal is not straight, however close: it was programmed.
    #[test]
    fn reversals_are_kept() {
        let points = [0.0, 1.0, 2.0, 1.5, 2.5, 3.5].map(|x| [x, 0.0, 0.0]);
        let firsts: Vec<_> = merge(&points, 0.1).iter().map(|part| part.first).collect();
        assert_eq!(firsts, [0, 2, 3]);
    }
}
