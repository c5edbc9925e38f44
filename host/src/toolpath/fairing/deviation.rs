//! How far a curve is from the path that it stands for, and the path from it.
//!
//! Both are walked together: each point of the curve is held against the nearest point of the path that is
//! not behind the one before. What the walk passes of the path between two points, its joints, is held
//! against the curve. So every point of either has a partner on the other.

use super::super::curve::Curve as _;
use super::super::{Vector, add, dot, norm, scale, subtract};
use super::guide::Guide;
use crate::toolpath::Polynomial;

/// Points of the curve for each span.
const POINTS: u32 = 8;

/// How far along the path a partner may be from the place of the same length, in tolerances.
const REACH: f64 = 4.0;

/// A bound on the distance of each span from the path and of the path from it \[mm\].
pub(super) fn distances_mm(guide: &Guide, breaks: &[f64], shapes: &[(Vector, Polynomial)]) -> Vec<f64> {
    let reach_mm = REACH * guide.parts.iter().map(|part| part.tolerance_mm).fold(0.0, f64::max);
    let mut distances = Vec::with_capacity(shapes.len());
    let mut before: Option<Vector> = None;
    let (mut foot_mm, mut foot_part) = (0.0_f64, 0);
    for ((start, shape), ends) in shapes.iter().zip(breaks.windows(2)) {
        let mut greatest = 0.0_f64;
        for index in 0..=POINTS {
            let share = f64::from(index) / f64::from(POINTS);
            let point = add(*start, shape.offset(0.0, share));
            let mm = ends[0] + (ends[1] - ends[0]) * share;
            let (least_mm, most_mm) = ((mm - reach_mm).max(foot_mm), mm + reach_mm);
            let mut best = (f64::INFINITY, foot_mm, foot_part);
            let mut part = foot_part;
            loop {
                let (part_start_mm, part_end_mm) = guide.range_mm(part);
                let (nearest_mm, _) = guide.nearest(part, point);
                let nearest_mm = nearest_mm.max(least_mm).clamp(part_start_mm, part_end_mm);
                let distance_mm = norm(subtract(point, guide.at(part, nearest_mm).0));
                if distance_mm < best.0 {
                    best = (distance_mm, nearest_mm, part);
                }
                if part_end_mm >= most_mm || part + 1 == guide.parts.len() {
                    break;
                }
                part += 1;
            }
            let (mut distance_mm, next_mm, next_part) = best;
            if let Some(before) = before {
                // The joints that were passed, and the bulge of arcs between the feet.
                for passed in foot_part..next_part {
                    let (joint, _) = guide.at(passed, guide.range_mm(passed).1);
                    distance_mm = distance_mm.max(from_line(joint, before, point));
                }
                let curvature = guide.curvature_per_mm(foot_part).max(guide.curvature_per_mm(next_part));
                let feet_mm = next_mm - foot_mm;
                distance_mm += 0.125 * curvature * feet_mm * feet_mm;
            }
            let [_, second, _] = shape.derivatives(share);
            let bulge_mm = 0.125 * norm(second) / f64::from(POINTS * POINTS);
            greatest = greatest.max(distance_mm + bulge_mm);
            (foot_mm, foot_part) = (next_mm, next_part);
            before = Some(point);
        }
        distances.push(greatest);
    }
    distances
}

/// The distance of a point from the line between two others.
fn from_line(point: Vector, from: Vector, to: Vector) -> f64 {
    let (along, offset) = (subtract(to, from), subtract(point, from));
    let square = dot(along, along);
    let share = if square > 0.0 { (dot(offset, along) / square).clamp(0.0, 1.0) } else { 0.0 };
    norm(subtract(offset, scale(along, share)))
}
