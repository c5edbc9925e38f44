//! Polynomial curves, of which corner blends and splines are made.
//!
//! A curve of degree seven at most in a parameter u from 0 to 1, kept relative to its start, so that a blend
//! of a micrometre a kilometre out is as precise as one at the origin. Consumes control points or
//! coefficients \[mm\]; produces what every [`Curve`] has, parts of itself, and its greatest derivatives by
//! arc length. Any finite coefficients are accepted; a curve that stands still somewhere (|r'| = 0) has no
//! tangent there and is refused when it is made into pieces.

use motion_kernel::internals::add_work;
use motion_kernel::plan::Bend;
use wide::f64x4;

use super::curve::{Curve, four_by_arc_length, gauss, refined_length};
use super::greatest::{Greatest, Peak, bend};
use super::lanes::LANES;
use super::{Lanes, Vector, add, norm, scale, subtract};

/// Highest power.
pub const DEGREE: usize = 7;

/// How often a length is halved before its quadrature is taken as it is.
const HALVINGS_MAX: u32 = 20;
/// Relative error at which a quadrature is good.
const LENGTH_TOLERANCE: f64 = 1.0e-13;

/// The number of parts that a curve is cut into to search its greatest derivatives.
const BEND_PARTS: usize = 64;

/// A component of curvature below this part of the greatest is rounding.
const STRAIGHT: f64 = 1.0e-9;

/// Σ cₖ·uᵏ, k = 1 … 7, u from 0 to 1: a curve relative to its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial<const N: usize = 3> {
    /// c₁ … c₇ \[mm\].
    coefficients: [Vector<N>; DEGREE],
}

impl<const N: usize> Polynomial<N> {
    /// The curve with c₁ … c₇ \[mm\].
    #[must_use]
    pub const fn new(coefficients: [Vector<N>; DEGREE]) -> Self {
        Self { coefficients }
    }

    /// The Bézier curve of degree seven with these control points \[mm\], relative to the first one or not.
    #[must_use]
    pub fn bezier(points: [Vector<N>; DEGREE + 1]) -> Self {
        // cₖ = C(7, k)·Δᵏb₀, the k-th forward difference of the control points.
        const BINOMIALS: [f64; DEGREE] = [7.0, 21.0, 35.0, 35.0, 21.0, 7.0, 1.0];
        let mut differences = points;
        let coefficients = core::array::from_fn(|index| {
            for i in 0..DEGREE - index {
                differences[i] = add(differences[i + 1], scale(differences[i], -1.0));
            }
            scale(differences[0], BINOMIALS[index])
        });
        Self { coefficients }
    }

    /// The curve between two points, each with the first to third derivative by the parameter that the curve has there \[mm\].
    pub(super) fn between(
        (start, [d1, d2, d3]): (Vector<N>, [Vector<N>; 3]),
        (end, [e1, e2, e3]): (Vector<N>, [Vector<N>; 3]),
    ) -> Self {
        // From the derivatives at an end, the control points next to it.
        let near = |point, d1, d2, d3| {
            let first = add(point, scale(d1, 1.0 / 7.0));
            let second = add(subtract(scale(first, 2.0), point), scale(d2, 1.0 / 42.0));
            let third = add(add(scale(subtract(second, first), 3.0), point), scale(d3, 1.0 / 210.0));
            [first, second, third]
        };
        let [b1, b2, b3] = near(start, d1, d2, d3);
        let [b6, b5, b4] = near(end, scale(e1, -1.0), e2, scale(e3, -1.0));
        Self::bezier([start, b1, b2, b3, b4, b5, b6, end])
    }

    /// The sum of two curves, offset by offset.
    pub(super) fn plus(&self, other: &Self) -> Self {
        let sum = |power: usize| add(self.coefficients[power], other.coefficients[power]);
        Self { coefficients: core::array::from_fn(sum) }
    }

    /// c₁ … c₇ \[mm\].
    #[must_use]
    pub fn coefficients(&self) -> &[Vector<N>; DEGREE] {
        &self.coefficients
    }

    /// The vector from the start to the end \[mm\].
    #[must_use]
    pub fn chord(&self) -> Vector<N> {
        self.offset(0.0, 1.0)
    }

    /// The part from `a` to `b`, as a curve with a parameter from 0 to 1, relative to its own start.
    #[must_use]
    pub fn part(&self, a: f64, b: f64) -> Self {
        let mut power = 1.0;
        let coefficients = self.about(a).map(|coefficient| {
            power *= b - a;
            scale(coefficient, power)
        });
        Self { coefficients }
    }

    /// First to fourth derivative by the parameter at `u`.
    #[must_use]
    pub fn four_derivatives(&self, u: f64) -> [Vector<N>; 4] {
        if u == 0.0 { four(self.coefficients) } else { four(first_about(self.coefficients, u, 4)) }
    }

    /// The same at several places.
    fn four_derivatives_at(&self, places: [f64; LANES]) -> [[f64x4; N]; 4] {
        let coefficients = self.coefficients.map(|coefficient| coefficient.map(f64x4::of));
        four(first_about(coefficients, f64x4::from(places), 4))
    }

    /// The greatest derivatives by arc length of the curve itself, from 64 parts.
    #[must_use]
    pub fn greatest(&self) -> Greatest<N> {
        let mut tangents = [Peak::default(); N];
        let mut curvatures = [0.0_f64; N];
        let norms = self.norms(BEND_PARTS, |tangent, second| {
            for axis in 0..N {
                tangents[axis].next(tangent[axis].abs());
                curvatures[axis] = curvatures[axis].max(second[axis].abs());
            }
        });
        let tangent = tangents.map(|peak| peak.greatest().min(1.0));
        Greatest {
            bend: bend(norms),
            tangent,
            curved: curvatures.map(|curvature| curvature > STRAIGHT * norms[0]),
        }
    }

    /// How it bends at its tightest, from so many parts.
    pub(super) fn bend_of(&self, parts: usize) -> Bend<f64> {
        bend(self.norms(parts, |_, _| ()))
    }

    /// The greatest second to fourth derivative by arc length, from so many parts; calls `each` with tangent
    /// and curvature where they are taken.
    fn norms(&self, parts: usize, mut each: impl FnMut(Vector<N>, Vector<N>)) -> [f64; 3] {
        add_work(parts);
        let mut norms = [Peak::default(); 3];
        for first in (0..=parts).step_by(LANES) {
            let places = core::array::from_fn(|lane| (first + lane).min(parts) as f64 / parts as f64);
            let [tangent, second, third, fourth] = four_by_arc_length(self.four_derivatives_at(places));
            let of_these = [second, third, fourth].map(|derivative| norm(derivative).to_array());
            let (tangent, second) = (tangent.map(f64x4::to_array), second.map(f64x4::to_array));
            for lane in 0..LANES.min(parts + 1 - first) {
                for (peak, norms) in norms.iter_mut().zip(&of_these) {
                    peak.next(norms[lane]);
                }
                each(tangent.map(|lanes| lanes[lane]), second.map(|lanes| lanes[lane]));
            }
        }
        norms.map(Peak::greatest)
    }

    /// The coefficients of the same curve in u − `origin`, relative to the point at `origin`.
    fn about(&self, origin: f64) -> [Vector<N>; DEGREE] {
        if origin == 0.0 { self.coefficients } else { first_about(self.coefficients, origin, DEGREE) }
    }
}

/// Of a curve with these coefficients, the first `count` in u − `origin`; the others mean nothing.
fn first_about<T: Lanes, const N: usize>(
    mut coefficients: [[T; N]; DEGREE],
    origin: T,
    count: usize,
) -> [[T; N]; DEGREE] {
    // Horner's scheme, applied to its own results. Its first pass makes the point itself, which is left
    // out, and the second c₁ at index 0.
    for pass in 0..DEGREE.min(count + 1) {
        for index in (pass.saturating_sub(1)..DEGREE - 1).rev() {
            coefficients[index] = add(coefficients[index], scale(coefficients[index + 1], origin));
        }
    }
    coefficients
}

/// First derivative at `u` of a curve with these coefficients.
fn slope<T: Lanes, const N: usize>(coefficients: &[Vector<N>; DEGREE], u: T) -> [T; N] {
    let mut slope = [T::of(0.0); N];
    for (index, &coefficient) in coefficients.iter().enumerate().rev() {
        slope = add(scale(slope, u), scale(coefficient, (index + 1) as f64).map(T::of));
    }
    slope
}

/// First to fourth derivative where the curve has these coefficients.
fn four<T: Lanes, const N: usize>([c1, c2, c3, c4, ..]: [[T; N]; DEGREE]) -> [[T; N]; 4] {
    [c1, scale(c2, T::of(2.0)), scale(c3, T::of(6.0)), scale(c4, T::of(24.0))]
}

impl<const N: usize> Curve<N> for Polynomial<N> {
    fn offset(&self, origin: f64, u: f64) -> Vector<N> {
        let step = u - origin;
        self.about(origin).iter().rev().fold([0.0; N], |sum, &c| scale(add(sum, c), step))
    }

    fn derivatives(&self, u: f64) -> [Vector<N>; 3] {
        let [first, second, third, _] = self.four_derivatives(u);
        [first, second, third]
    }

    fn speed(&self, u: f64) -> f64 {
        norm(slope(&self.coefficients, u))
    }

    fn speeds(&self, places: [f64; LANES]) -> [f64; LANES] {
        norm(slope(&self.coefficients, f64x4::from(places))).to_array()
    }

    fn length(&self, a: f64, b: f64) -> f64 {
        let whole_mm = gauss(self, a, b);
        let agree = |both: f64, whole: f64| (both - whole).abs() <= LENGTH_TOLERANCE * both;
        refined_length(self, [a, b], whole_mm, HALVINGS_MAX, &agree)
    }
}

#[cfg(test)]
mod tests {
    use super::super::subtract;
    use super::*;

    fn curve() -> Polynomial {
        Polynomial::bezier([
            [3.0, 1.0, 0.0],
            [4.0, 1.0, 0.2],
            [5.0, 1.5, 0.1],
            [6.0, 2.0, -0.3],
            [6.5, 3.0, 0.0],
            [6.0, 4.0, 0.5],
            [6.0, 5.0, 1.0],
            [6.5, 6.0, 1.0],
        ])
    }

    /// De Casteljau's construction is the independent evaluation.
    #[test]
    fn control_points_make_their_bezier_curve() {
        let points =
            [[0.0, 1.0], [2.0, -1.0], [3.0, 0.5], [3.5, 2.0], [4.0, 2.5], [5.0, 1.0], [7.0, 0.0], [8.0, 1.0]];
        let curve = Polynomial::bezier(points.map(|[x, y]| [x, y, x * y]));
        for part in 0..=10 {
            let u = f64::from(part) / 10.0;
            let mut row = points.map(|[x, y]| [x, y, x * y]).to_vec();
            while row.len() > 1 {
                row = row.windows(2).map(|pair| add(scale(pair[0], 1.0 - u), scale(pair[1], u))).collect();
            }
            let expected = subtract(row[0], [0.0, 1.0, 0.0]);
            assert!(norm(subtract(curve.offset(0.0, u), expected)) < 1e-13, "{u}");
        }
    }

    /// Each derivative against the central difference of the one before, the fourth by arc length too.
    #[test]
    fn derivatives_are_those_of_the_curve() {
        let (curve, h) = (curve(), 1e-5);
        for u in [0.1, 0.5, 0.83] {
            let [d1, d2, d3, d4] = curve.four_derivatives(u);
            let (before, after) = (curve.four_derivatives(u - h), curve.four_derivatives(u + h));
            let slope = scale(curve.offset(u - h, u + h), 0.5 / h);
            assert!(norm(subtract(d1, slope)) < 1e-7, "{d1:?} {slope:?}");
            for (order, exact) in [d2, d3, d4].into_iter().enumerate() {
                let found = scale(subtract(after[order], before[order]), 0.5 / h);
                assert!(norm(subtract(exact, found)) < 1e-5, "{order}: {exact:?} {found:?}");
            }
            let third = |derivatives| four_by_arc_length(derivatives)[2];
            let found = scale(subtract(third(after), third(before)), 1.0 / curve.length(u - h, u + h));
            let [.., exact] = four_by_arc_length([d1, d2, d3, d4]);
            assert!(norm(subtract(exact, found)) < 1e-6 * (1.0 + norm(exact)), "{exact:?} {found:?}");
        }
    }

    /// Four places at once have the bits that each has by itself.
    #[test]
    fn lanes_have_the_bits_of_one() {
        let curve = curve();
        for first in 0..50 {
            let places: [f64; LANES] =
                core::array::from_fn(|lane| 0.019 * f64::from(first) + 0.011 * lane as f64);
            let (speeds, four) = (curve.speeds(places), curve.four_derivatives_at(places));
            let by_length = four_by_arc_length(four);
            for (lane, &u) in places.iter().enumerate() {
                let alone = curve.four_derivatives(u);
                let alone_by_length = four_by_arc_length(alone);
                assert_eq!(speeds[lane].to_bits(), curve.speed(u).to_bits());
                for (order, axis) in (0..4).flat_map(|order| (0..3).map(move |axis| (order, axis))) {
                    let bits = |of: &[[f64x4; 3]; 4]| of[order][axis].to_array()[lane].to_bits();
                    assert_eq!(bits(&four), alone[order][axis].to_bits(), "{u}");
                    assert_eq!(bits(&by_length), alone_by_length[order][axis].to_bits(), "{u}");
                }
            }
        }
    }

    #[test]
    fn offsets_do_not_cancel() {
        let (curve, step) = (curve(), 1e-13);
        let offset = curve.offset(0.4, 0.4 + step);
        let taken = (0.4 + step) - 0.4;
        let expected = scale(curve.four_derivatives(0.4)[0], taken);
        assert!(norm(subtract(offset, expected)) < 1e-12 * norm(expected));
    }

    #[test]
    fn a_part_is_the_curve_over_its_range() {
        let (curve, part) = (curve(), curve().part(0.3, 0.7));
        for u in [0.0, 0.25, 1.0] {
            let expected = curve.offset(0.3, 0.3 + 0.4 * u);
            assert!(norm(subtract(part.offset(0.0, u), expected)) < 1e-14);
        }
        let whole = curve.length(0.0, 0.3) + part.length(0.0, 1.0) + curve.length(0.7, 1.0);
        assert!((whole - curve.length(0.0, 1.0)).abs() < 1e-12);
    }

    /// A parabola of known length, and one so sharp that a single quadrature misses it.
    #[test]
    fn lengths_have_twelve_digits() {
        for slope in [1.0, 1e4_f64] {
            let mut coefficients = [[0.0; 3]; DEGREE];
            coefficients[0] = [1.0, -slope, 0.0];
            coefficients[1] = [0.0, slope, 0.0];
            // y = slope·(u² − u): half of it is the arc of w = slope·(2u − 1) from 0 to slope.
            let half = (slope * slope.hypot(1.0) + slope.asinh()) / (4.0 * slope);
            let length = Polynomial::new(coefficients).length(0.0, 1.0);
            assert!((length / (2.0 * half) - 1.0).abs() < 1e-12, "{slope}: {length} {half}");
        }
    }

    /// No point of a fine grid lies above, and none of the figures is far above them all.
    #[test]
    fn greatest_derivatives_are_bounds_and_close() {
        let curve = curve();
        let Greatest { bend, tangent, curved } = curve.greatest();
        let mut found = [0.0_f64; 3];
        let mut found_tangent = [0.0_f64; 3];
        for part in 0..=10_007 {
            let [t, second, third, fourth] =
                four_by_arc_length(curve.four_derivatives(f64::from(part) / 10_007.0));
            for (found, vector) in found.iter_mut().zip([second, third, fourth]) {
                *found = found.max(norm(vector));
            }
            found_tangent = core::array::from_fn(|axis| found_tangent[axis].max(t[axis].abs()));
        }
        let bound = [bend.curvature_per_mm, bend.third_root_per_mm.powi(2), bend.fourth_root_per_mm.powi(3)];
        for (bound, found) in bound.into_iter().chain(tangent).zip(found.into_iter().chain(found_tangent)) {
            assert!(bound >= found * (1.0 - 1e-15) && bound < 1.02 * found, "{bound} {found}");
        }
        assert_eq!(curved, [true; 3]);
    }
}
