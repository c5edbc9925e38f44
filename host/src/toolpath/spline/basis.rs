//! B-spline basis functions over a knot vector, and their derivatives.

use super::DEGREE_MAX;
use crate::toolpath::polynomial::{self, Polynomial};
use crate::toolpath::{Vector, add, scale};

/// Factors of the control points that act on one span, the first one first; unused ones are 0.
pub(in crate::toolpath) type Row = [f64; DEGREE_MAX + 1];

/// The factors with which control points `span − degree` … `span` make the derivative of `order` ≤ `degree`
/// at `u`, which lies between `knots[span]` and `knots[span + 1]`, of which the second is the greater.
///
/// A derivative is a spline of a lower degree whose control points are differences of those of the spline,
/// P⁽ᵏ⁾ᵢ = (p − k + 1)·(P⁽ᵏ⁻¹⁾ᵢ₊₁ − P⁽ᵏ⁻¹⁾ᵢ)/(Uᵢ₊ₚ₊₁ − Uᵢ₊ₖ); here the differences are taken of the factors
/// instead.
pub(in crate::toolpath) fn row(knots: &[f64], degree: usize, span: usize, u: f64, order: usize) -> Row {
    let mut row = [0.0; DEGREE_MAX + 1];
    row[0] = 1.0;
    // Cox and de Boor's recursion, degree by degree; every term is positive.
    for lower in 1..=degree - order {
        let mut carried = 0.0;
        for index in 0..lower {
            let right = knots[span + index + 1] - u;
            let left = u - knots[span + 1 + index - lower];
            let share = row[index] / (right + left);
            row[index] = carried + right * share;
            carried = left * share;
        }
        row[lower] = carried;
    }
    for level in (1..=order).rev() {
        let mut below = [0.0; DEGREE_MAX + 1];
        for index in 0..=degree - level {
            let width = knots[span + index + 1] - knots[span + index + level - degree];
            let factor = row[index] * (degree - level + 1) as f64 / width;
            below[index] -= factor;
            below[index + 1] += factor;
        }
        row = below;
    }
    row
}

/// The start, and the polynomial from there, of the span between `knots[span]` and the knot behind it, on
/// which the control points `acting` act.
pub(in crate::toolpath) fn polynomial<const N: usize>(
    knots: &[f64],
    degree: usize,
    span: usize,
    acting: &[Vector<N>],
) -> (Vector<N>, Polynomial<N>) {
    let (u, width) = (knots[span], knots[span + 1] - knots[span]);
    let derivative = |order: usize| {
        let row = row(knots, degree, span, u, order);
        let terms = row.iter().zip(acting);
        terms.fold([0.0; N], |sum, (&factor, &point)| add(sum, scale(point, factor)))
    };
    let mut coefficients = [[0.0; N]; polynomial::DEGREE];
    let mut power = 1.0;
    for (order, coefficient) in (1..=degree).zip(&mut coefficients) {
        // hᵏ/k!
        power *= width / order as f64;
        *coefficient = scale(derivative(order), power);
    }
    (derivative(0), Polynomial::new(coefficients))
}

/// The knot vector of `breaks`, with the ends as often as a curve that starts and ends in its control points
/// needs.
pub(in crate::toolpath) fn clamped(breaks: &[f64], degree: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (breaks.first(), breaks.last()) else {
        return Vec::new();
    };
    let ends = |end| std::iter::repeat_n(end, degree);
    ends(first).chain(breaks.iter().copied()).chain(ends(last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The functions sum to 1, and each derivative is the slope of the one below.
    #[test]
    fn derivatives_are_slopes() {
        let breaks = [0.0, 0.3, 1.0, 1.2, 2.7];
        for degree in [3, 5] {
            let knots = clamped(&breaks, degree);
            for span in degree..degree + breaks.len() - 1 {
                let u = 0.4 * knots[span] + 0.6 * knots[span + 1];
                let sum: f64 = row(&knots, degree, span, u, 0).iter().sum();
                assert!((sum - 1.0).abs() < 1e-15);
                let h = 1e-6;
                for order in 1..=degree {
                    let exact = row(&knots, degree, span, u, order);
                    let before = row(&knots, degree, span, u - h, order - 1);
                    let after = row(&knots, degree, span, u + h, order - 1);
                    for ((exact, before), after) in exact.iter().zip(before).zip(after) {
                        let slope = (after - before) / (2.0 * h);
                        assert!(
                            (exact - slope).abs() < 1e-6 * (1.0 + exact.abs()),
                            "{order}: {exact} {slope}"
                        );
                    }
                }
            }
        }
    }

    /// On one span they are Bernstein's polynomials.
    #[test]
    fn one_span_is_bezier() {
        let found = row(&clamped(&[0.0, 1.0], 3), 3, 3, 0.25, 0);
        for (found, expected) in found.iter().zip([27.0, 27.0, 9.0, 1.0].map(|part| part / 64.0)) {
            assert!((found - expected).abs() < 1e-16);
        }
    }
}
