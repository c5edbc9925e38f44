//! NURBS: rational splines, span by span.
//!
//! Consumes degree, control points, weights and knots; produces the rational Bézier curve between every two
//! knots that differ, and the elements that are driven for it: a line where a span is straight, polynomials of
//! degree seven in arc length elsewhere. These follow the span within the tolerance of
//! [`septic`](super::septic) and are joined as smoothly as it is. What bends or turns at a knot does so between two spans.

use super::curve::{Curve, gauss, refined_length};
use super::element::{Element, Role};
use super::polynomial::Polynomial;
use super::septic::{FitError, POSITION_TOLERANCE_MM, fit};
use super::{Vector, add, dot, norm, scale, subtract};
use crate::gcode::Nurbs;

/// Relative error at which a length is good.
const LENGTH_TOLERANCE: f64 = 1.0e-13;
/// How often a length is halved before its quadrature is taken as it is.
const HALVINGS_MAX: u32 = 14;
/// Control points that are closer are one, and a line is straight to this \[mm\].
const ROUNDING_MM: f64 = 1.0e-9;

/// w·x, w·y, w·z \[mm\] and the weight w.
type Homogeneous = [f64; 4];

/// A rational Bézier curve, u from 0 to 1, relative to its start.
#[derive(Clone, Debug, PartialEq)]
pub struct Rational {
    start: Vector,
    /// Four at least.
    points: Vec<Homogeneous>,
}

/// The curves between the knots; none if the numbers of points, weights and knots do not fit the degree.
#[must_use]
pub fn spans(curve: &Nurbs) -> Option<Vec<Rational>> {
    let Nurbs { degree, points_mm, weights, knots } = curve;
    if *degree == 0 || weights.len() != points_mm.len() || knots.len() != points_mm.len() + degree + 1 {
        return None;
    }
    let origin = *points_mm.first()?;
    let weighted = points_mm.iter().zip(weights).map(|(&point, &weight)| {
        let [x, y, z] = scale(subtract(point, origin), weight);
        [x, y, z, weight]
    });
    let points: Vec<Homogeneous> = weighted.collect();
    let mut spans = Vec::new();
    for (first, points) in points.windows(degree + 1).enumerate() {
        // The knots that the points of the span depend on; it lies between the two in the middle.
        let knots = knots.get(first + 1..=first + 2 * degree)?;
        let (low, high) = (*knots.get(degree - 1)?, *knots.get(*degree)?);
        if low < high {
            let blossoms = (0..=*degree).map(|turns| blossom(points, knots, [low, high], turns));
            spans.push(Rational::new(origin, blossoms.collect::<Option<_>>()?));
        }
    }
    Some(spans)
}

/// The polar form of a span at its end `turns` times and at its start for the rest: a Bézier point.
fn blossom(
    points: &[Homogeneous],
    knots: &[f64],
    [low, high]: [f64; 2],
    turns: usize,
) -> Option<Homogeneous> {
    let degree = points.len() - 1;
    let mut points = points.to_vec();
    for pass in 1..=degree {
        let at = if pass <= turns { high } else { low };
        let pairs = points.windows(2).enumerate().map(|(index, pair)| {
            let (&from, &to) = (knots.get(pass - 1 + index)?, knots.get(degree + index)?);
            Some(between(pair.first()?, pair.last()?, (at - from) / (to - from)))
        });
        points = pairs.collect::<Option<_>>()?;
    }
    points.first().copied()
}

fn between(a: &Homogeneous, b: &Homogeneous, share: f64) -> Homogeneous {
    core::array::from_fn(|index| (1.0 - share) * a[index] + share * b[index])
}

/// Point and weight of homogeneous coordinates, apart.
fn apart([x, y, z, weight]: Homogeneous) -> (Vector, f64) {
    ([x, y, z], weight)
}

fn point([x, y, z, weight]: Homogeneous) -> Vector {
    scale([x, y, z], 1.0 / weight)
}

impl Rational {
    /// The curve with these control points, which are relative to `origin`.
    fn new(origin: Vector, points: Vec<Homogeneous>) -> Self {
        let start = points.first().map_or([0.0; 3], |&first| point(first));
        let relative = points.into_iter().map(|homogeneous| {
            let (at, weight) = apart(homogeneous);
            let [x, y, z] = subtract(at, scale(start, weight));
            [x, y, z, weight]
        });
        let mut points: Vec<Homogeneous> = relative.collect();
        // Three derivatives need degree three.
        while points.len() < 4 {
            points = elevated(&points);
        }
        Self { start: add(origin, start), points }
    }

    /// The start \[mm\].
    #[must_use]
    pub fn start_mm(&self) -> Vector {
        self.start
    }

    /// The point at `u`, from the start \[mm\].
    fn at(&self, u: f64) -> Vector {
        let mut points = self.points.clone();
        while points.len() > 1 {
            points = reduced(&points, u);
        }
        points.first().map_or([0.0; 3], |&last| point(last))
    }

    /// The elements that are driven for it.
    ///
    /// # Errors
    /// It is not smooth.
    pub fn elements(&self) -> Result<Vec<Element>, FitError> {
        let line = |from: f64, to: f64| Element::Line {
            from: add(self.start, self.at(from)),
            to: add(self.start, self.at(to)),
        };
        if self.is_straight() {
            return Ok(vec![line(0.0, 1.0)]);
        }
        let (first, last) = self.moving();
        let mut elements = Vec::new();
        if first > 0.0 {
            elements.push(line(0.0, first));
        }
        let base = add(self.start, self.at(first));
        for piece in fit(self, first, last, last - first, f64::INFINITY)? {
            let [x, y, z] = piece.coefficients;
            let mut coefficients = [[0.0; 3]; 7];
            for (coefficient, ((x, y), z)) in coefficients.iter_mut().zip(x.into_iter().zip(y).zip(z)) {
                *coefficient = [x, y, z];
            }
            let shape = Polynomial::new(coefficients);
            elements.push(Element::polynomial(add(base, piece.start), shape, Role::Spline));
        }
        if last < 1.0 {
            elements.push(line(last, 1.0));
        }
        Ok(elements)
    }

    /// Whether it runs straight from its start to its end: all control points do.
    fn is_straight(&self) -> bool {
        let chord = self.at(1.0);
        let length_mm = norm(chord);
        let direction = scale(chord, 1.0 / length_mm);
        let mut before_mm = 0.0;
        self.points.iter().all(|&homogeneous| {
            let at = point(homogeneous);
            let along_mm = dot(at, direction);
            let goes_on = along_mm >= before_mm - ROUNDING_MM;
            before_mm = along_mm;
            goes_on && norm(subtract(at, scale(direction, along_mm))) <= ROUNDING_MM
        })
    }

    /// Where it moves. Two control points in one at an end make it stand still there, and bend without bound;
    /// a chord stands for what is that close.
    fn moving(&self) -> (f64, f64) {
        let is_one = |a: Option<&Homogeneous>, b: Option<&Homogeneous>| match (a, b) {
            (Some(&a), Some(&b)) => norm(subtract(point(a), point(b))) <= ROUNDING_MM,
            _ => false,
        };
        let mut back = self.points.iter().rev();
        let first = is_one(self.points.first(), self.points.get(1));
        let last = is_one(back.next(), back.next());
        let cut = |end: f64, inward: f64| {
            let parts = (2..24).map(|halvings| end + inward * libm::exp2(-f64::from(halvings)));
            parts.into_iter().find(|&at| self.chord_error_mm(end, at) <= 0.5 * POSITION_TOLERANCE_MM)
        };
        (
            if first { cut(0.0, 1.0).unwrap_or(0.0) } else { 0.0 },
            if last { cut(1.0, -1.0).unwrap_or(1.0) } else { 1.0 },
        )
    }

    /// Greatest distance from its chord between two parameters, at 15 points.
    fn chord_error_mm(&self, a: f64, b: f64) -> f64 {
        let (from, to) = (self.at(a), self.at(b));
        let chord = subtract(to, from);
        let direction = scale(chord, 1.0 / norm(chord));
        let errors = (1..16).map(|part| {
            let at = subtract(self.at(a + (b - a) * f64::from(part) / 16.0), from);
            norm(subtract(at, scale(direction, dot(at, direction))))
        });
        errors.fold(0.0, f64::max)
    }
}

/// One step of de Casteljau's construction.
fn reduced(points: &[Homogeneous], u: f64) -> Vec<Homogeneous> {
    let pairs = points.iter().zip(points.iter().skip(1));
    pairs.map(|(a, b)| between(a, b, u)).collect()
}

/// The same curve with one control point more.
fn elevated(points: &[Homogeneous]) -> Vec<Homogeneous> {
    let count = points.len() as f64;
    let befores = points.first().into_iter().chain(points);
    let afters = points.iter().chain(points.last());
    let pairs = befores.zip(afters).enumerate();
    pairs.map(|(index, (before, after))| between(after, before, index as f64 / count)).collect()
}

impl Curve for Rational {
    fn offset(&self, origin: f64, u: f64) -> Vector {
        subtract(self.at(u), self.at(origin))
    }

    fn derivatives(&self, u: f64) -> [Vector; 3] {
        let mut points = self.points.clone();
        while points.len() > 4 {
            points = reduced(&points, u);
        }
        let degree = self.points.len() as f64 - 1.0;
        let difference = |a: Homogeneous, b: Homogeneous, factor: f64| -> Homogeneous {
            core::array::from_fn(|index| factor * (b[index] - a[index]))
        };
        let &[a, b, c, d] = &points[..] else { return [[f64::NAN; 3]; 3] };
        let seconds = |a, b, c| difference(difference(a, b, 1.0), difference(b, c, 1.0), 1.0);
        let third = difference(seconds(a, b, c), seconds(b, c, d), degree * (degree - 1.0) * (degree - 2.0));
        let (a, b, c) = (between(&a, &b, u), between(&b, &c, u), between(&c, &d, u));
        let second = seconds(a, b, c).map(|part| part * degree * (degree - 1.0));
        let (a, b) = (between(&a, &b, u), between(&b, &c, u));
        let first = difference(a, b, degree);
        let (r0, w0) = apart(between(&a, &b, u));
        let ((r1, w1), (r2, w2), (r3, w3)) = (apart(first), apart(second), apart(third));
        // Of w·r = a: w·r' = a' − w'·r, and so on.
        let less = |sum: Vector, part: Vector, factor: f64| subtract(sum, scale(part, factor));
        let at = scale(r0, 1.0 / w0);
        let d1 = scale(less(r1, at, w1), 1.0 / w0);
        let d2 = scale(less(less(r2, d1, 2.0 * w1), at, w2), 1.0 / w0);
        let d3 = scale(less(less(less(r3, d2, 3.0 * w1), d1, 3.0 * w2), at, w3), 1.0 / w0);
        [d1, d2, d3]
    }

    fn length(&self, a: f64, b: f64) -> f64 {
        let whole_mm = gauss(self, a, b);
        let error_mm = LENGTH_TOLERANCE * whole_mm;
        let agree = |both: f64, whole: f64| (both - whole).abs() <= error_mm;
        refined_length(self, [a, b], whole_mm, HALVINGS_MAX, &agree)
    }
}
