//! The programmed path that a curve stands for, by its length.

use super::super::curve::{Curve as _, by_arc_length};
use super::super::{Vector, add, dot, norm, scale, subtract};
use super::Part;
use crate::toolpath::Element;

/// Lines and arcs that follow each other.
pub(super) struct Guide<'a, const N: usize> {
    pub(super) parts: &'a [Part<N>],
    /// Where each part starts, and where the last one ends \[mm\].
    starts_mm: Vec<f64>,
}

impl<'a, const N: usize> Guide<'a, N> {
    /// Nothing if a part is neither a line nor an arc, or has no length.
    pub(super) fn new(parts: &'a [Part<N>]) -> Option<Self> {
        let mut starts_mm = Vec::with_capacity(parts.len() + 1);
        let mut end_mm = 0.0;
        starts_mm.push(end_mm);
        for part in parts {
            if !matches!(part.element, Element::Line { .. } | Element::Arc { .. }) {
                return None;
            }
            let start_mm = end_mm;
            end_mm += part.element.length_mm();
            if !(end_mm > start_mm && end_mm.is_finite()) {
                return None;
            }
            starts_mm.push(end_mm);
        }
        (!parts.is_empty()).then_some(Self { parts, starts_mm })
    }

    pub(super) fn length_mm(&self) -> f64 {
        self.starts_mm[self.parts.len()]
    }

    /// From where to where a part goes \[mm\].
    pub(super) fn range_mm(&self, part: usize) -> (f64, f64) {
        (self.starts_mm[part], self.starts_mm[part + 1])
    }

    /// The part at `mm`.
    pub(super) fn part_at(&self, mm: f64) -> usize {
        self.starts_mm[1..self.parts.len()].partition_point(|&end| end <= mm)
    }

    /// Point and tangent of a part at `mm` of the path.
    pub(super) fn at(&self, part: usize, mm: f64) -> (Vector<N>, Vector<N>) {
        let (start_mm, end_mm) = self.range_mm(part);
        let share = ((mm - start_mm) / (end_mm - start_mm)).clamp(0.0, 1.0);
        match self.parts[part].element {
            Element::Arc { from, shape, sweep_rad, .. } => {
                let angle = sweep_rad * share;
                let [tangent, ..] = by_arc_length(shape.derivatives(angle));
                (add(from, shape.offset(0.0, angle)), tangent)
            }
            ref element => {
                let (from, to) = element.ends_mm();
                let along = subtract(to, from);
                (add(from, scale(along, share)), scale(along, 1.0 / norm(along)))
            }
        }
    }

    /// Point and first to third derivative by the length at the start or the end.
    pub(super) fn end(&self, is_end: bool) -> [Vector<N>; 4] {
        let part = if is_end { self.parts.len() - 1 } else { 0 };
        let (point, tangent) = self.at(part, if is_end { self.length_mm() } else { 0.0 });
        match self.parts[part].element {
            Element::Arc { shape, sweep_rad, .. } => {
                let angle = if is_end { sweep_rad } else { 0.0 };
                let [first, second, third] = by_arc_length(shape.derivatives(angle));
                [point, first, second, third]
            }
            _ => [point, tangent, [0.0; N], [0.0; N]],
        }
    }

    /// Where a part is nearest to `point` \[mm\].
    pub(super) fn nearest_mm(&self, part: usize, point: Vector<N>) -> f64 {
        let (start_mm, end_mm) = self.range_mm(part);
        match self.parts[part].element {
            Element::Arc { from, shape, sweep_rad, .. } => {
                let length_mm = end_mm - start_mm;
                let offset = subtract(point, from);
                // From the angle about the axis, which is right for a circle, and by Newton for what is not.
                let spoke = add(offset, scale(shape.outward, shape.radius_mm));
                let angle = libm::atan2(dot(spoke, shape.onward), dot(spoke, shape.outward));
                let turn = core::f64::consts::TAU;
                // Of the angles that differ by turns, the one nearest to the arc.
                let past = (0.5 * sweep_rad - angle) / turn;
                let mut angle = (angle + turn * past.round()).clamp(0.0, sweep_rad);
                for _ in 0..2 {
                    let [d1, ..] = shape.derivatives(angle);
                    let gap = subtract(offset, shape.offset(0.0, angle));
                    angle = (angle + dot(gap, d1) / dot(d1, d1)).clamp(0.0, sweep_rad);
                }
                start_mm + length_mm * (angle / sweep_rad)
            }
            ref element => {
                let (from, to) = element.ends_mm();
                let along = subtract(to, from);
                let share = dot(subtract(point, from), along) / dot(along, along);
                start_mm + (end_mm - start_mm) * share.clamp(0.0, 1.0)
            }
        }
    }

    /// The curvature of a part \[1/mm\].
    pub(super) fn curvature_per_mm(&self, part: usize) -> f64 {
        let [start, end] = self.parts[part].element.ends();
        norm(start.curvature).max(norm(end.curvature))
    }
}
