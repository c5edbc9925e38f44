//! Derivatives of a curve: by its parameter, and by arc length.

use super::lanes::LANES;
use super::{Lanes, Vector, add, dot, norm, scale, subtract};

/// A smooth curve with a parameter.
pub trait Curve<const N: usize = 3> {
    /// The point at `u` minus the point at `origin` \[mm\], without the cancellation of computing both.
    fn offset(&self, origin: f64, u: f64) -> Vector<N>;

    /// First to third derivative by the parameter at `u`.
    fn derivatives(&self, u: f64) -> [Vector<N>; 3];

    /// |r'| at `u`.
    fn speed(&self, u: f64) -> f64 {
        norm(self.derivatives(u)[0])
    }

    /// |r'| at four places.
    fn speeds(&self, places: [f64; LANES]) -> [f64; LANES] {
        places.map(|u| self.speed(u))
    }

    /// Arc length from `a` to `b` \[mm\], `b` ≥ `a`. The default integrates |r'| by 16 Gauss points, which
    /// resolves a turn of up to an eighth of a circle to the last place.
    fn length(&self, a: f64, b: f64) -> f64 {
        gauss(self, a, b)
    }
}

/// Arc length from `a` to `b` by 16 Gauss points \[mm\].
pub(super) fn gauss<const N: usize>(curve: &(impl Curve<N> + ?Sized), a: f64, b: f64) -> f64 {
    by_points(curve, a, b, &GAUSS_16)
}

/// The same by 4 points.
pub(super) fn gauss_4<const N: usize>(curve: &(impl Curve<N> + ?Sized), a: f64, b: f64) -> f64 {
    by_points(curve, a, b, &GAUSS_4)
}

/// The same by points on either side of the middle: abscissae and weights, two and two.
fn by_points<const N: usize>(
    curve: &(impl Curve<N> + ?Sized),
    a: f64,
    b: f64,
    points: &[[(f64, f64); LANES / 2]],
) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let mut sum = 0.0;
    for &[(x, w), (next_x, next_w)] in points {
        let places = [-x, x, -next_x, next_x].map(|x| middle + half * x);
        let [low, high, next_low, next_high] = curve.speeds(places);
        sum += w * (low + high);
        sum += next_w * (next_low + next_high);
    }
    half * sum
}

/// The integral of |r'| from `a` to `b` \[mm\], halved until both halves say what the whole, `whole_mm`, says, or so
/// many times. `agree` takes both halves together and the whole.
pub(super) fn refined_length<const N: usize>(
    curve: &impl Curve<N>,
    [a, b]: [f64; 2],
    whole_mm: f64,
    halvings: u32,
    agree: &impl Fn(f64, f64) -> bool,
) -> f64 {
    let middle = 0.5 * (a + b);
    let length = |a, b| gauss(curve, a, b);
    let (left, right) = (length(a, middle), length(middle, b));
    let both = left + right;
    if halvings == 0 || agree(both, whole_mm) || !both.is_finite() {
        return both;
    }
    refined_length(curve, [a, middle], left, halvings - 1, agree)
        + refined_length(curve, [middle, b], right, halvings - 1, agree)
}

/// First to third derivative by arc length, from those by a parameter.
///
/// With σ = |r'|: t = r'/σ, κn = (r'' − t·(t·r''))/σ², and the third from the derivative of that.
#[must_use]
pub(crate) fn by_arc_length<T: Lanes, const N: usize>([d1, d2, d3]: [[T; N]; 3]) -> [[T; N]; 3] {
    let one = T::of(1.0);
    let speed = norm(d1);
    let tangent = scale(d1, one / speed);
    // s' = σ, s'' = t·r'', s''' = t·r''' + |r''⊥|²/σ
    let s2 = dot(tangent, d2);
    let across = subtract(d2, scale(tangent, s2));
    let s3 = dot(tangent, d3) + dot(across, across) / speed;
    // r'' = x''σ² + x's'',  r''' = x'''σ³ + 3x''σs'' + x's'''
    let second = scale(across, one / (speed * speed));
    let third = scale(
        subtract(subtract(d3, scale(second, T::of(3.0) * speed * s2)), scale(tangent, s3)),
        one / (speed * speed * speed),
    );
    [tangent, second, third]
}

/// First to fourth derivative by arc length, from those by a parameter.
///
/// With σ, s2, s3, s4 the derivatives of the arc length: r4 = x4·σ⁴ + 6x3·σ²·s2 + x2·(4σ·s3 + 3s2²) + t·s4,
/// and t·x4 = −3x2·x3 because |t| = 1.
#[must_use]
pub(crate) fn four_by_arc_length<T: Lanes, const N: usize>([d1, d2, d3, d4]: [[T; N]; 4]) -> [[T; N]; 4] {
    let speed = norm(d1);
    let [tangent, second, third] = by_arc_length([d1, d2, d3]);
    let square = speed * speed;
    let s2 = dot(tangent, d2);
    let s3 = dot(tangent, d3) + dot(second, second) * square * speed;
    let rest = subtract(
        subtract(d4, scale(third, T::of(6.0) * square * s2)),
        scale(second, T::of(4.0) * speed * s3 + T::of(3.0) * s2 * s2),
    );
    let across = subtract(rest, scale(tangent, dot(tangent, rest)));
    let fourth =
        add(scale(across, T::of(1.0) / (square * square)), scale(tangent, T::of(-3.0) * dot(second, third)));
    [tangent, second, third, fourth]
}

/// Positive abscissae and weights of the 4-point Gauss–Legendre rule.
const GAUSS_4: [[(f64, f64); LANES / 2]; 1] = [[
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
]];

/// Positive abscissae and weights of the 16-point Gauss–Legendre rule.
const GAUSS_16: [[(f64, f64); LANES / 2]; 4] = [
    [(0.095_012_509_837_637_44, 0.189_450_610_455_068_5), (0.281_603_550_779_258_9, 0.182_603_415_044_923_6)],
    [
        (0.458_016_777_657_227_4, 0.169_156_519_395_002_54),
        (0.617_876_244_402_643_7, 0.149_595_988_816_576_73),
    ],
    [(0.755_404_408_355_003, 0.124_628_971_255_533_87), (0.865_631_202_387_831_7, 0.095_158_511_682_492_78)],
    [
        (0.944_575_023_073_232_6, 0.062_253_523_938_647_89),
        (0.989_400_934_991_649_9, 0.027_152_459_411_754_095),
    ],
];

/// An arc, helix or spiral: the angle is the parameter; radius, height and all axes besides go linearly with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral<const N: usize = 3> {
    /// Unit vector from the centre to the start, in the plane.
    pub outward: Vector<N>,
    /// Unit vector a quarter turn on, in the direction of travel.
    pub onward: Vector<N>,
    /// Radius at the start \[mm\], > 0.
    pub radius_mm: f64,
    /// Change of the radius \[mm/rad\].
    pub radius_per_rad: f64,
    /// Change of what is across the plane \[mm/rad\]: of the height along its normal, and of the axes besides; at right
    /// angles to the plane.
    pub across_per_rad: Vector<N>,
}

impl<const N: usize> Spiral<N> {
    /// Greatest |component| of a unit vector in the plane on each axis; exactly 0 or 1 where it is so but for
    /// rounding.
    #[must_use]
    pub fn in_plane(&self) -> Vector<N> {
        in_plane(&self.outward, &self.onward)
    }

    /// The same spiral, its angle counted from `angle` on.
    #[must_use]
    pub fn rotated(&self, angle: f64) -> Self {
        let (outward, onward) = self.frame(angle);
        let radius_mm = self.radius_mm + self.radius_per_rad * angle;
        Self { outward, onward, radius_mm, ..*self }
    }

    /// Direction from the centre at `angle`, and a quarter turn on.
    fn frame(&self, angle: f64) -> (Vector<N>, Vector<N>) {
        let (sine, cosine) = libm::sincos(angle);
        (
            add(scale(self.outward, cosine), scale(self.onward, sine)),
            subtract(scale(self.onward, cosine), scale(self.outward, sine)),
        )
    }
}

/// Greatest |component| of a unit vector in the plane of two at right angles; exactly 0 or 1 where it is so but for
/// rounding.
pub(super) fn in_plane<const N: usize>(outward: &Vector<N>, onward: &Vector<N>) -> Vector<N> {
    core::array::from_fn(|axis| {
        let part = libm::hypot(outward[axis], onward[axis]);
        if (part - part.round()).abs() < 1e-9 { part.round() } else { part }
    })
}

impl<const N: usize> Curve<N> for Spiral<N> {
    fn offset(&self, origin: f64, angle: f64) -> Vector<N> {
        let swept = angle - origin;
        let (outward, onward) = self.frame(origin);
        let (here, _) = self.frame(angle);
        let radius = self.radius_mm + self.radius_per_rad * origin;
        let half = libm::sin(0.5 * swept);
        // radius·(e(angle) − e(origin)) without cancellation, and what the radius grew by.
        let round =
            add(scale(onward, radius * libm::sin(swept)), scale(outward, -2.0 * radius * half * half));
        let grown = scale(here, self.radius_per_rad * swept);
        add(add(round, grown), scale(self.across_per_rad, swept))
    }

    fn derivatives(&self, angle: f64) -> [Vector<N>; 3] {
        let (outward, onward) = self.frame(angle);
        let (radius, rate) = (self.radius_mm + self.radius_per_rad * angle, self.radius_per_rad);
        [
            add(add(scale(onward, radius), scale(outward, rate)), self.across_per_rad),
            subtract(scale(onward, 2.0 * rate), scale(outward, radius)),
            subtract(scale(onward, -radius), scale(outward, 3.0 * rate)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spiral() -> Spiral {
        Spiral {
            outward: [0.6, 0.8, 0.0],
            onward: [-0.8, 0.6, 0.0],
            radius_mm: 7.0,
            radius_per_rad: 0.3,
            across_per_rad: [0.0, 0.0, -1.1],
        }
    }

    /// Each derivative against the central difference of the one before.
    #[test]
    fn derivatives_by_the_angle() {
        let (curve, h) = (spiral(), 1e-5);
        for angle in [0.0, 0.7, 3.0, 6.2] {
            let exact = curve.derivatives(angle);
            let (before, after) = (curve.derivatives(angle - h), curve.derivatives(angle + h));
            let chord = subtract(curve.offset(0.3, angle + h), curve.offset(0.3, angle - h));
            let found = [
                scale(chord, 0.5 / h),
                scale(subtract(after[0], before[0]), 0.5 / h),
                scale(subtract(after[1], before[1]), 0.5 / h),
            ];
            for (exact, found) in exact.iter().zip(found) {
                assert!(norm(subtract(*exact, found)) < 1e-8, "{exact:?} {found:?}");
            }
        }
    }

    /// The same by arc length, the parameter moved by what makes the length grow by h.
    #[test]
    fn derivatives_by_arc_length() {
        let (curve, h) = (spiral(), 1e-4);
        for angle in [0.1, 2.0, 5.0] {
            let exact = by_arc_length(curve.derivatives(angle));
            let at = |length: f64| {
                let mut u = angle;
                for _ in 0..50 {
                    let gone = if u >= angle { curve.length(angle, u) } else { -curve.length(u, angle) };
                    u -= (gone - length) / norm(curve.derivatives(u)[0]);
                }
                by_arc_length(curve.derivatives(u))
            };
            let (before, after) = (at(-h), at(h));
            for order in 0..2 {
                let found = scale(subtract(after[order], before[order]), 0.5 / h);
                assert!(norm(subtract(exact[order + 1], found)) < 1e-8, "{order} {exact:?} {found:?}");
            }
            assert!((norm(exact[0]) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_circles_length_is_exact() {
        let circle = Spiral { radius_per_rad: 0.0, across_per_rad: [0.0; 3], ..spiral() };
        let quarter = circle.length(0.2, 0.2 + core::f64::consts::FRAC_PI_4);
        assert!((quarter - 7.0 * core::f64::consts::FRAC_PI_4).abs() < 1e-14);
    }
}
