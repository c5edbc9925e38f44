//! Splines through points, or within a stated deviation of them.
//!
//! Consumes points \[mm\] over increasing parameters; produces one [`Polynomial`] for every span between two
//! knots. Cubic splines have continuous second derivatives by the parameter (C²), quintic ones continuous
//! fourth (C⁴), so that on a quintic path the jerk of every axis is continuous at constant feed, which S2
//! asks for. Background, f64; linear in the number of points but for the search for knots, which takes the
//! logarithm of it more.
//!
//! - `basis`: B-splines and their derivatives;
//! - `band`: the equations.
//!
//! At the ends the derivatives are given ([`Ends`]: S2's experiment), or the spline has no knot at the points
//! next to its ends, which keeps its order of accuracy where nothing is known ("not-a-knot").

mod band;
pub(in crate::toolpath) mod basis;

use self::band::Band;
use super::element::{Element, Role};
use super::polynomial::Polynomial;
use super::{Vector, add, norm, scale, subtract};

/// Highest degree.
const DEGREE_MAX: usize = 5;

/// An interpolating spline must not miss its points by more than this part of their greatest distance from
/// the first. It does where steps of the parameter differ so much that the equations have no digits left.
const ROUNDING: f64 = 1.0e-10;

/// Degree of a spline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Degree {
    /// 3: the jerk steps at the knots.
    Cubic,
    /// 5: the lowest odd degree with continuous jerk.
    #[default]
    Quintic,
}

impl Degree {
    /// 3 or 5.
    #[must_use]
    pub fn number(self) -> usize {
        match self {
            Self::Cubic => 3,
            Self::Quintic => 5,
        }
    }

    /// The least number of points: as many as one polynomial of this degree goes through.
    #[must_use]
    pub fn points_min(self) -> usize {
        self.number() + 1
    }
}

/// Derivatives by the parameter at one end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives<const N: usize = 3> {
    /// dr/du \[mm\].
    pub first: Vector<N>,
    /// d²r/du² \[mm\]; a cubic spline has no use for it.
    pub second: Vector<N>,
}

/// What is known of the ends of an interpolating spline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ends<const N: usize = 3> {
    /// Nothing: no knot next to them.
    #[default]
    Free,
    /// The derivatives at the start and at the end.
    Clamped([Derivatives<N>; 2]),
}

/// Why there is no spline. Points are counted from 0. Displays as "…, expected …".
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// There are not enough points.
    #[error("{points} points, expected at least {expected}")]
    TooFew {
        /// How many there are.
        points: usize,
        /// How many the degree needs.
        expected: usize,
    },
    /// A coordinate is not a number, or as great as none is used.
    #[error("a coordinate of {value}, expected a finite number")]
    NotFinite {
        /// The point.
        index: usize,
        /// The coordinate.
        value: f64,
    },
    /// A point is the one before.
    #[error("the point before once more, expected points that differ")]
    Repeated {
        /// The second of the two.
        index: usize,
    },
    /// The parameter does not grow.
    #[error("u = {u} after {before}, expected a finite number above")]
    Parameter {
        /// The point.
        index: usize,
        /// Its parameter.
        u: f64,
        /// The parameter of the point before.
        before: f64,
    },
    /// The number of parameters differs from that of points.
    #[error("{parameters} parameters of {points} points, expected one for each")]
    Parameters {
        /// How many points.
        points: usize,
        /// How many parameters.
        parameters: usize,
    },
    /// The tolerance is not one.
    #[error("a tolerance of {mm} mm, expected a finite number that is not below 0")]
    Tolerance {
        /// The tolerance \[mm\].
        mm: f64,
    },
    /// Steps of the parameter that differ by more than double precision can solve.
    #[error(
        "a spline that misses the point by {deviation_mm:.1e} mm, expected steps of the parameter that differ less"
    )]
    Uneven {
        /// The point that is missed most.
        index: usize,
        /// The deviation \[mm\].
        deviation_mm: f64,
    },
}

impl SplineError {
    /// The point it is about, from 0, if it is one.
    #[must_use]
    pub fn point(&self) -> Option<usize> {
        match *self {
            Self::NotFinite { index, .. }
            | Self::Repeated { index }
            | Self::Parameter { index, .. }
            | Self::Uneven { index, .. } => Some(index),
            Self::TooFew { .. } | Self::Parameters { .. } | Self::Tolerance { .. } => None,
        }
    }
}

/// Polynomials, one after the other, over a common parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline<const N: usize = 3> {
    degree: Degree,
    knots: Vec<f64>,
    /// Where each span starts \[mm\].
    starts: Vec<Vector<N>>,
    spans: Vec<Polynomial<N>>,
    deviation_mm: f64,
    /// How many points lie at or before the end of each span.
    points_to: Vec<usize>,
}

impl<const N: usize> Spline<N> {
    /// Its degree.
    #[must_use]
    pub fn degree(&self) -> Degree {
        self.degree
    }

    /// Where it starts \[mm\].
    #[must_use]
    pub fn start_mm(&self) -> Vector<N> {
        self.starts[0]
    }

    /// Parameters at the ends of the spans, one more than there are spans.
    #[must_use]
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Polynomials of the spans, each over 0 … 1.
    #[must_use]
    pub fn spans(&self) -> &[Polynomial<N>] {
        &self.spans
    }

    /// The greatest distance of a given point from the spline at that point's parameter \[mm\].
    #[must_use]
    pub fn deviation_mm(&self) -> f64 {
        self.deviation_mm
    }

    /// The spans as blocks of a path, each with the index, from 0, of the last given point on it.
    pub fn elements(&self) -> impl Iterator<Item = (usize, Element<N>)> + '_ {
        let spans = self.starts.iter().zip(&self.spans).zip(&self.points_to);
        spans.map(|((&start, &shape), &points)| {
            (points.saturating_sub(1), Element::polynomial(start, shape, Role::Spline))
        })
    }

    /// The span that `u` lies in; what lies beyond belongs to the first or the last one.
    fn span_at(&self, u: f64) -> usize {
        self.knots[1..self.knots.len() - 1].partition_point(|&knot| knot <= u)
    }

    /// The span that `u` lies in, and how far, from 0 to 1.
    #[must_use]
    pub fn local(&self, u: f64) -> (usize, f64) {
        let span = self.span_at(u);
        let (from, to) = (self.knots[span], self.knots[span + 1]);
        (span, (u - from) / (to - from))
    }

    /// The point at `u` \[mm\].
    #[must_use]
    pub fn at(&self, u: f64) -> Vector<N> {
        use super::curve::Curve;
        let (span, part) = self.local(u);
        add(self.starts[span], self.spans[span].offset(0.0, part))
    }
}

/// Parameters from 0 that grow by the distance from point to point \[mm\], so that the spline is run through
/// at about constant speed.
///
/// # Errors
/// A coordinate is not finite, or a point is the one before.
pub fn chord_lengths<const N: usize>(points: &[Vector<N>]) -> Result<Vec<f64>, SplineError> {
    check_points(points)?;
    let mut u = 0.0;
    let steps = points.windows(2).map(|pair| {
        u += norm(subtract(pair[1], pair[0]));
        u
    });
    Ok(std::iter::once(0.0).take(points.len()).chain(steps).collect())
}

fn check_points<const N: usize>(points: &[Vector<N>]) -> Result<(), SplineError> {
    for (index, point) in points.iter().enumerate() {
        if let Some(&value) = point.iter().find(|mm| !mm.is_finite()) {
            return Err(SplineError::NotFinite { index, value });
        }
        if index > 0 && norm(subtract(*point, points[index - 1])) <= 0.0 {
            return Err(SplineError::Repeated { index });
        }
    }
    Ok(())
}

fn check<const N: usize>(
    points: &[Vector<N>],
    parameters: &[f64],
    degree: Degree,
) -> Result<(), SplineError> {
    if points.len() != parameters.len() {
        return Err(SplineError::Parameters { points: points.len(), parameters: parameters.len() });
    }
    check_points(points)?;
    if let Some(&u) = parameters.first()
        && !u.is_finite()
    {
        return Err(SplineError::Parameter { index: 0, u, before: f64::NEG_INFINITY });
    }
    for (index, pair) in parameters.windows(2).enumerate() {
        let &[before, u] = pair else { continue };
        if !(u > before && (u - before).is_finite()) {
            return Err(SplineError::Parameter { index: index + 1, u, before });
        }
    }
    let expected = degree.points_min();
    if points.len() < expected {
        return Err(SplineError::TooFew { points: points.len(), expected });
    }
    Ok(())
}

/// The spline through all points, which lie at `parameters`.
///
/// # Errors
/// There are too few points (also for clamped ends), a number is not finite, a point is the one before, or
/// the parameters don't grow, or so unevenly that double precision can't solve for the spline.
pub fn interpolate<const N: usize>(
    points: &[Vector<N>],
    parameters: &[f64],
    degree: Degree,
    ends: &Ends<N>,
) -> Result<Spline<N>, SplineError> {
    check(points, parameters, degree)?;
    let last = points.len() - 1;
    let breaks: Vec<f64> = match ends {
        Ends::Clamped(_) => parameters.to_vec(),
        Ends::Free => {
            let near = (degree.number() - 1) / 2;
            let is_knot = |index: usize| index == 0 || index == last || (index > near && index + near < last);
            (0..=last).filter(|&index| is_knot(index)).map(|index| parameters[index]).collect()
        }
    };
    let reach_mm = points.iter().map(|&point| norm(subtract(point, points[0]))).fold(0.0, f64::max);
    let (index, deviation_mm, spline) = least_squares(points, parameters, degree, &breaks, ends)
        .ok_or(SplineError::Uneven { index: last, deviation_mm: reach_mm })?;
    if deviation_mm <= ROUNDING * reach_mm {
        Ok(spline)
    } else {
        Err(SplineError::Uneven { index, deviation_mm })
    }
}

/// A spline no farther than `tolerance_mm` from any point, with as few knots as halving finds: where a span
/// is too far from one of its points, it gets a knot at the point in its middle. Where that takes as many
/// knots as there are points, and with a tolerance of 0, the spline goes through all points. The first and
/// the last one are always met.
///
/// # Errors
/// Those of [`interpolate`]; the tolerance is negative or not finite.
pub fn fit<const N: usize>(
    points: &[Vector<N>],
    parameters: &[f64],
    degree: Degree,
    tolerance_mm: f64,
) -> Result<Spline<N>, SplineError> {
    if !(tolerance_mm >= 0.0 && tolerance_mm.is_finite()) {
        return Err(SplineError::Tolerance { mm: tolerance_mm });
    }
    check(points, parameters, degree)?;
    let through_all = || interpolate(points, parameters, degree, &Ends::Free);
    if tolerance_mm <= 0.0 {
        return through_all();
    }
    // Indices of the points that have a knot.
    let mut at = vec![0, points.len() - 1];
    while at.len() - 1 + degree.number() < points.len() {
        let breaks: Vec<f64> = at.iter().map(|&index| parameters[index]).collect();
        let Some((_, deviation_mm, spline)) = least_squares(points, parameters, degree, &breaks, &Ends::Free)
        else {
            break;
        };
        if deviation_mm <= tolerance_mm {
            return Ok(spline);
        }
        let is_far =
            |index: usize| norm(subtract(spline.at(parameters[index]), points[index])) > tolerance_mm;
        let splits =
            at.windows(2).filter(|span| (span[0]..=span[1]).any(is_far)).map(|span| (span[0] + span[1]) / 2);
        let mut next: Vec<usize> = at.iter().copied().chain(splits).collect();
        next.sort_unstable();
        next.dedup();
        if next.len() == at.len() {
            break;
        }
        at = next;
    }
    through_all()
}

/// The spline with knots at `breaks` that comes closest to the points and meets the first and the last one;
/// before it, the point it misses most, and by how much \[mm\]. Nothing if the points don't determine it.
fn least_squares<const N: usize>(
    points: &[Vector<N>],
    parameters: &[f64],
    degree: Degree,
    breaks: &[f64],
    ends: &Ends<N>,
) -> Option<(usize, f64, Spline<N>)> {
    let p = degree.number();
    let knots = basis::clamped(breaks, p);
    let unknowns = breaks.len() - 1 + p;
    // All is relative to the first point, so that the first control point is 0.
    let chord = subtract(points[points.len() - 1], points[0]);
    let mut band = Band::new(unknowns);
    let mut equation = |first: usize, mut row: basis::Row, side: Vector<N>| {
        if first == 0 {
            row[0] = 0.0;
        }
        let mut side = side;
        if first + p + 1 == unknowns {
            side = subtract(side, scale(chord, row[p]));
            row[p] = 0.0;
        }
        band.add(first, row, side);
    };
    let span_of = |u: f64| p + breaks[1..breaks.len() - 1].partition_point(|&knot| knot <= u);
    let clamp = |end: usize| match ends {
        Ends::Free => Vec::new(),
        Ends::Clamped(derivatives) => [derivatives[end].first, derivatives[end].second]
            .into_iter()
            .take((p - 1) / 2)
            .collect::<Vec<_>>(),
    };
    for (end, u) in [(0, parameters[0]), (1, parameters[points.len() - 1])] {
        let span = if end == 0 { p } else { unknowns - 1 };
        let mut unit = 1.0;
        for (index, derivative) in clamp(end).into_iter().enumerate() {
            // In units of the span, to be of the size of the other rows.
            unit *= knots[span + 1] - knots[span];
            let row = basis::row(&knots, p, span, u, index + 1).map(|factor| factor * unit);
            equation(span - p, row, scale(derivative, unit));
        }
    }
    for (&u, &point) in parameters.iter().zip(points).skip(1).take(points.len() - 2) {
        let span = span_of(u);
        equation(span - p, basis::row(&knots, p, span, u, 0), subtract(point, points[0]));
    }
    let mut alone = [0.0; DEGREE_MAX + 1];
    alone[0] = 1.0;
    band.add(0, alone, [0.0; N]);
    band.add(unknowns - 1, alone, chord);
    let control = band.solve()?;

    let mut spline = Spline {
        degree,
        knots: breaks.to_vec(),
        starts: Vec::new(),
        spans: Vec::new(),
        deviation_mm: 0.0,
        points_to: Vec::new(),
    };
    for (index, pair) in breaks.windows(2).enumerate() {
        let (offset, shape) = basis::polynomial(&knots, p, p + index, &control[index..]);
        spline.starts.push(add(points[0], offset));
        spline.spans.push(shape);
        spline.points_to.push(parameters.partition_point(|&u| u <= pair[1]));
    }
    let (mut farthest, mut deviation_mm) = (0, 0.0);
    for (index, (&u, &point)) in parameters.iter().zip(points).enumerate() {
        let distance_mm = norm(subtract(spline.at(u), point));
        if distance_mm.is_nan() {
            return None;
        }
        if distance_mm > deviation_mm {
            (farthest, deviation_mm) = (index, distance_mm);
        }
    }
    spline.deviation_mm = deviation_mm;
    Some((farthest, deviation_mm, spline))
}
