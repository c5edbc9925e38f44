//! Programmed curves to moves: G5, G5.5 and NURBS.
//!
//! Consumes control points, or the points that a spline goes through; produces polynomials that the kernel's
//! pieces can follow within their stated errors. A curve that is not smooth, or that has no pieces, is
//! refused with its line.

use super::error::Problem;
use crate::gcode::{CubicMove, Nurbs, PathMode, xyz_mm};
use crate::machine::Machine;
use crate::toolpath::rational::spans;
use crate::toolpath::smooth::Move;
use crate::toolpath::spline::{Degree, Ends, chord_lengths, interpolate};
use crate::toolpath::{Element, Polynomial, Role, Vector, add, scale, septics, subtract};

/// A point of a spline, with feed and path mode of the move to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) line: u32,
    pub(super) at: Vector,
    pub(super) feed_mm_s: f64,
    pub(super) mode: PathMode,
}

/// The element of a G5. An error has no line yet.
pub(super) fn cubic(step: &CubicMove) -> Result<Element, Problem> {
    let (from, to) = (xyz_mm(step.from), xyz_mm(step.to));
    let [[i, j], [p, q]] = step.controls_mm;
    let chord = subtract(to, from);
    let (b1, b2) = ([i, j, 0.0], add(chord, [p, q, 0.0]));
    // Bézier's points 0, b1, b2, chord to powers of u.
    let c1 = scale(b1, 3.0);
    let c2 = scale(subtract(b2, scale(b1, 2.0)), 3.0);
    let c3 = subtract(chord, add(c1, c2));
    let none = [0.0; 3];
    let shape = Polynomial::new([c1, c2, c3, none, none, none, none]);
    checked(Element::Polynomial { from, to, shape, role: Role::Spline })
}

/// The elements of a NURBS. An error has no line yet.
pub(super) fn nurbs(curve: Option<&Nurbs>) -> Result<Vec<Element>, Problem> {
    let spans = curve.and_then(spans).ok_or(Problem::Nurbs)?;
    let mut elements = Vec::new();
    for span in spans {
        elements.extend(span.elements().map_err(|error| Problem::Geometry(error.into()))?);
    }
    elements.into_iter().map(checked).collect()
}

/// The spans of the quintic spline from `from` through all `points`, which are taken. An error comes with the
/// program line.
pub(super) fn through(
    from: Vector,
    points: &mut Vec<Point>,
    machine: &Machine,
) -> Result<Vec<Move>, (u32, Problem)> {
    let points = std::mem::take(points);
    let Some(first) = points.first() else { return Ok(Vec::new()) };
    let all: Vec<Vector> = std::iter::once(from).chain(points.iter().map(|point| point.at)).collect();
    let spline = chord_lengths(&all)
        .and_then(|parameters| interpolate(&all, &parameters, Degree::Quintic, &Ends::Free))
        .map_err(|error| {
            let point = error.point().and_then(|point| points.get(point.checked_sub(1)?));
            (point.unwrap_or(first).line, Problem::Spline(error))
        })?;
    let mut moves = Vec::new();
    let mut done = 0;
    for (last, element) in spline.elements() {
        // Its points, without the one that it starts in; a span ends in a point.
        let Some(passed @ [.., point]) = points.get(done..last) else { continue };
        let element = checked(element).map_err(|problem| (point.line, problem))?;
        // Where points of one span differ in feed, the slowest holds.
        let feed_mm_s = passed.iter().map(|point| point.feed_mm_s).fold(f64::INFINITY, f64::min);
        moves.push(super::program::path_move(point.line, element, feed_mm_s, point.mode, machine));
        done = last;
    }
    Ok(moves)
}

/// A cusp is a limit of 0 to the plan, and has a name here.
fn checked(element: Element) -> Result<Element, Problem> {
    septics::<f32>(&element).map_err(|error| Problem::Geometry(error.into()))?;
    Ok(element)
}
