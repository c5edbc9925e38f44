//! Programmed curves to moves: G5, G5.5 and NURBS.
//!
//! Consumes control points, or the points that a spline goes through; produces polynomials that the kernel's
//! pieces can follow within their stated errors. A curve that is not smooth, or that has no pieces, is
//! refused with its line.

use super::error::{AtLine, Problem};
use super::runs::move_at;
use crate::gcode::{Axis, CubicMove, Nurbs, NurbsMove, PathMode};
use crate::machine::Machine;
use crate::toolpath::rational::spans;
use crate::toolpath::smooth::Move;
use crate::toolpath::spline::{Degree, Ends, chord_lengths, interpolate};
use crate::toolpath::subspace::Subspace;
use crate::toolpath::{
    Element, Feeds, NoAxis, Polynomial, Role, Vector, add, from_xyz, scale, septics, subtract,
};

/// A point of a spline, with feed and path mode of the move to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point<const N: usize> {
    pub(super) line: u32,
    pub(super) at: Vector<N>,
    pub(super) feeds: Feeds,
    pub(super) mode: PathMode,
}

/// The element of a G5, which moves X and Y alone. An error has no line yet.
pub(super) fn cubic<const N: usize>(step: &CubicMove, machine: &Machine<N>) -> Result<Element<N>, Problem> {
    let (from, to) = (machine.coordinates(step.from), machine.coordinates(step.to));
    let [[i, j], [p, q]] = step.controls_mm;
    let chord = subtract(to, from);
    let b1 = from_xyz([i, j, 0.0], machine)?;
    let b2 = add(chord, from_xyz([p, q, 0.0], machine)?);
    // Bézier's points 0, b1, b2, chord to powers of u.
    let c1 = scale(b1, 3.0);
    let c2 = scale(subtract(b2, scale(b1, 2.0)), 3.0);
    let c3 = subtract(chord, add(c1, c2));
    let none = [0.0; N];
    let shape = Polynomial::new([c1, c2, c3, none, none, none, none]);
    checked(Element::Polynomial { from, to, shape, role: Role::Spline })
}

/// The elements of a NURBS. Axes besides X, Y and Z stand. An error has no line yet.
pub(super) fn nurbs<const N: usize>(
    step: &NurbsMove,
    curve: Option<&Nurbs>,
    machine: &Machine<N>,
) -> Result<Vec<Element<N>>, Problem> {
    let curve = curve.ok_or(Problem::Nurbs)?;
    let letters = [Axis::X, Axis::Y, Axis::Z];
    let places = letters.map(|letter| machine.place_of(letter));
    for (axis, (letter, place)) in letters.into_iter().zip(places).enumerate() {
        let mut coordinates = curve.points_mm.iter().map(|point| point[axis]);
        if place.is_none() && coordinates.any(|mm| mm != curve.points_mm[0][axis]) {
            return Err(NoAxis(letter).into());
        }
    }
    let (space, rest) = (Subspace::at(places), machine.coordinates(step.from));
    let mut elements = Vec::new();
    for span in spans(curve).ok_or(Problem::Nurbs)? {
        let of_span = span.elements().map_err(|error| Problem::Geometry(error.into()))?;
        elements.extend(of_span.iter().map(|element| space.widen_element(element, rest)));
    }
    elements.into_iter().map(checked).collect()
}

/// The spans of the quintic spline from `from` through all `points`, which are taken. An error comes with the
/// program line.
pub(super) fn through<const N: usize>(
    from: Vector<N>,
    points: &mut Vec<Point<N>>,
    machine: &Machine<N>,
) -> AtLine<Vec<Move<N>>> {
    let points = std::mem::take(points);
    let Some(first) = points.first() else { return Ok(Vec::new()) };
    let all: Vec<Vector<N>> = std::iter::once(from).chain(points.iter().map(|point| point.at)).collect();
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
        let feeds = passed.iter().map(|point| point.feeds).reduce(Feeds::least).unwrap_or(Feeds::RAPID);
        moves.push(move_at(point.line, element, feeds, point.mode, machine));
        done = last;
    }
    Ok(moves)
}

/// A cusp is a limit of 0 to the plan, and has a name here.
fn checked<const N: usize>(element: Element<N>) -> Result<Element<N>, Problem> {
    septics::<f32, _>(&element).map_err(|error| Problem::Geometry(error.into()))?;
    Ok(element)
}
