//! How far a curve is from the path that it stands for, and the path from it.
//!
//! Both are walked together: each point of the curve is held against the nearest point of the path that is
//! not behind the one before. What the walk passes of the path between two points, its joints, is held
//! against the curve. So every point of either has a partner on the other. Between two points both may bulge
//! by an eighth of their curvature times the square of the step, which is added.

use super::super::curve::Curve as _;
use super::super::{Vector, add, dot, norm, scale, subtract};
use super::guide::Guide;
use crate::toolpath::Polynomial;

/// Points of the curve for each span.
const POINTS: u32 = 8;
/// How far along the path a partner may be from the place of the same length, in tolerances.
const REACH: f64 = 4.0;

/// How far a span is from the path and the path from it.
#[derive(Clone, Copy, Default)]
pub(super) struct Deviation {
    pub(super) distance_mm: f64,
    /// As a part of the tolerance of the path there.
    pub(super) share: f64,
}

/// How far the walk has come.
#[derive(Clone, Copy)]
pub(super) struct Walk<const N: usize> {
    /// The partner on the path \[mm\], and its part.
    foot_mm: f64,
    foot_part: usize,
    /// The point of the curve.
    before: Option<Vector<N>>,
}

impl<const N: usize> Walk<N> {
    /// The start of the path.
    pub(super) const START: Self = Self { foot_mm: 0.0, foot_part: 0, before: None };
}

/// How far each span is from the path; the walk goes on to their end.
pub(super) fn deviations<const N: usize>(
    guide: &Guide<N>,
    breaks: &[f64],
    shapes: &[(Vector<N>, Polynomial<N>)],
    walk: &mut Walk<N>,
) -> Vec<Deviation> {
    let mut deviations = Vec::with_capacity(shapes.len());
    let Walk { mut foot_mm, mut foot_part, mut before } = *walk;
    for ((start, shape), ends) in shapes.iter().zip(breaks.windows(2)) {
        let mut greatest = Deviation::default();
        for index in 0..=POINTS {
            let share = f64::from(index) / f64::from(POINTS);
            let point = add(*start, shape.offset(0.0, share));
            let mm = ends[0] + (ends[1] - ends[0]) * share;
            let reach_mm = REACH * guide.parts[foot_part].tolerance_mm;
            let (mut distance_mm, next_mm, next_part) =
                partner(guide, point, foot_part, (mm - reach_mm).max(foot_mm), mm + reach_mm);
            let passed = foot_part..=next_part;
            if let Some(before) = before {
                let joints = passed.clone().take(next_part - foot_part);
                for joint in joints.map(|part| guide.at(part, guide.range_mm(part).1).0) {
                    distance_mm = distance_mm.max(from_line(joint, before, point));
                }
                let curvature = passed.clone().map(|part| guide.curvature_per_mm(part)).fold(0.0, f64::max);
                distance_mm += 0.125 * curvature * (next_mm - foot_mm) * (next_mm - foot_mm);
            }
            let [_, second, _] = shape.derivatives(share);
            distance_mm += 0.125 * norm(second) / f64::from(POINTS * POINTS);
            let tolerances = passed.map(|part| guide.parts[part].tolerance_mm);
            let deviation =
                Deviation { distance_mm, share: distance_mm / tolerances.fold(f64::INFINITY, f64::min) };
            // Written so that what is not a number stays.
            if !(deviation.share <= greatest.share) {
                greatest.share = deviation.share;
            }
            greatest.distance_mm = greatest.distance_mm.max(deviation.distance_mm);
            (foot_mm, foot_part) = (next_mm, next_part);
            before = Some(point);
        }
        deviations.push(greatest);
    }
    *walk = Walk { foot_mm, foot_part, before };
    deviations
}

/// The point of the path from `least_mm` to about `most_mm` that is nearest to `point`: how far it is, where,
/// and on which part, from `first` on.
fn partner<const N: usize>(
    guide: &Guide<N>,
    point: Vector<N>,
    first: usize,
    least_mm: f64,
    most_mm: f64,
) -> (f64, f64, usize) {
    let mut best = (f64::INFINITY, least_mm, first);
    for part in first..guide.parts.len() {
        let (start_mm, end_mm) = guide.range_mm(part);
        let at_mm = guide.nearest_mm(part, point).max(least_mm).clamp(start_mm, end_mm);
        let distance_mm = norm(subtract(point, guide.at(part, at_mm).0));
        if distance_mm < best.0 {
            best = (distance_mm, at_mm, part);
        }
        if end_mm >= most_mm {
            break;
        }
    }
    best
}

/// The distance of a point from the line between two others.
fn from_line<const N: usize>(point: Vector<N>, from: Vector<N>, to: Vector<N>) -> f64 {
    let (along, offset) = (subtract(to, from), subtract(point, from));
    let square = dot(along, along);
    let share = if square > 0.0 { (dot(offset, along) / square).clamp(0.0, 1.0) } else { 0.0 };
    norm(subtract(offset, scale(along, share)))
}
