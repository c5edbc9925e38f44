//! The involute of a circle: flanks of gears, scrolls, and spiral paths that open a hole. S3 names it among
//! its blocks.
//!
//! With the base circle's radius r and the angle of unwinding φ, in a frame (e₁, e₂) of the plane about the
//! circle's centre,
//!
//! ```text
//! T = e₁·cos φ + e₂·sin φ     N = e₂·cos φ − e₁·sin φ
//! point = r·(T − φ·N)         d/dφ = r·φ·T
//! length from 0 = r·φ²/2      curvature = 1/(r·φ)
//! ```
//!
//! On the base circle itself, at φ = 0, curvature is infinite: an involute has to stay off it. At a distance
//! d from an involute lies the same involute, rotated by −d/r and traversed at angles that are greater by d/r
//! ([`Involute::offset_by`]), so that a cutter's radius needs nothing new.

use motion_kernel::num::Root;
use motion_kernel::plan::Bend;

use super::curve::{Curve, in_plane};
use super::greatest::Greatest;
use super::{Vector, add, dot, norm, scale, subtract};

/// The least angle that an involute may reach \[rad\]: a radius of curvature of a thousandth of its base
/// circle's.
pub const ANGLE_RAD_MIN: f64 = 1.0e-3;
/// The greatest \[rad\]: some 159 turns.
pub const ANGLE_RAD_MAX: f64 = 1.0e3;
/// How far vectors of the frame may be from unit length, and from a right angle.
const FRAME_TOLERANCE: f64 = 1.0e-9;

/// Why there is no such involute. Displays as "…, expected …".
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvoluteError {
    /// The base circle is none.
    #[error("a base circle with a radius of {mm} mm, expected a finite number above 0")]
    Base {
        /// The base circle's radius \[mm\].
        mm: f64,
    },
    /// The frame is none.
    #[error("a frame that is not of two unit vectors at a right angle, expected one")]
    Frame,
    /// The involute touches its base circle, or is unwound too far.
    #[error(
        "an involute at an angle of {rad} rad, expected {ANGLE_RAD_MIN} to {ANGLE_RAD_MAX} rad: on the base circle, at 0, \
         curvature is infinite"
    )]
    Angle {
        /// The angle of unwinding \[rad\].
        rad: f64,
    },
    /// The involute ends where it starts.
    #[error("an involute from {rad} rad to the same angle, expected different ones")]
    Empty {
        /// Both angles \[rad\].
        rad: f64,
    },
}

/// A part of an involute. Its parameter is the angle run through, from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Involute<const N: usize = 3> {
    /// e₁: unit vector from the centre to where the involute leaves its base circle.
    outward: Vector<N>,
    /// e₂: unit vector a quarter turn on, in the direction of unwinding.
    onward: Vector<N>,
    base_mm: f64,
    /// Angles of unwinding at the start and at the end \[rad\]; from the greater to the smaller one it winds
    /// up.
    angles_rad: (f64, f64),
}

impl<const N: usize> Involute<N> {
    /// The part between two angles of unwinding, φ, in the order in which they are run through.
    ///
    /// # Errors
    /// The radius is not positive, the frame is none, or an angle is out of range.
    pub fn new(
        frame: (Vector<N>, Vector<N>),
        base_mm: f64,
        angles_rad: (f64, f64),
    ) -> Result<Self, InvoluteError> {
        let (outward, onward) = frame;
        if !(base_mm > 0.0 && base_mm.is_finite()) {
            return Err(InvoluteError::Base { mm: base_mm });
        }
        let is_unit = |vector: Vector<N>| (norm(vector) - 1.0).abs() <= FRAME_TOLERANCE;
        if !(is_unit(outward) && is_unit(onward) && dot(outward, onward).abs() <= FRAME_TOLERANCE) {
            return Err(InvoluteError::Frame);
        }
        for rad in [angles_rad.0, angles_rad.1] {
            if !(ANGLE_RAD_MIN..=ANGLE_RAD_MAX).contains(&rad) {
                return Err(InvoluteError::Angle { rad });
            }
        }
        if angles_rad.0 == angles_rad.1 {
            return Err(InvoluteError::Empty { rad: angles_rad.0 });
        }
        Ok(Self { outward, onward, base_mm, angles_rad })
    }

    /// The involute at a distance of `distance_mm` from this one, to the outside if positive.
    ///
    /// # Errors
    /// It would touch the base circle, or be unwound too far.
    pub fn offset_by(&self, distance_mm: f64) -> Result<Self, InvoluteError> {
        let rotation = distance_mm / self.base_mm;
        let (tangent, normal) = self.frame(-rotation);
        let (start, end) = self.angles_rad;
        Self::new((tangent, normal), self.base_mm, (start + rotation, end + rotation))
    }

    /// Angle that is run through \[rad\], > 0.
    #[must_use]
    pub fn sweep_rad(&self) -> f64 {
        (self.angles_rad.1 - self.angles_rad.0).abs()
    }

    /// Where it starts, from the base circle's centre \[mm\].
    #[must_use]
    pub fn start_mm(&self) -> Vector<N> {
        let (tangent, normal) = self.frame(self.angles_rad.0);
        scale(subtract(tangent, scale(normal, self.angles_rad.0)), self.base_mm)
    }

    /// How it bends at its tightest, which is its smallest angle: |r'''| = κ²·√(1 + φ⁻²) and
    /// |r''''| = κ³·√(1 + 3φ⁻² + 9φ⁻⁴), of which each falls as φ grows; and which axes take part.
    #[must_use]
    pub fn greatest(&self) -> Greatest<N> {
        let angle = self.angles_rad.0.min(self.angles_rad.1);
        let curvature = 1.0 / (self.base_mm * angle);
        let steep = 1.0 / (angle * angle);
        let bend = Bend {
            curvature_per_mm: curvature,
            third_root_per_mm: curvature * (1.0 + steep).sqrt().sqrt(),
            fourth_root_per_mm: curvature * Root::cbrt((1.0 + 3.0 * steep + 9.0 * steep * steep).sqrt()),
        };
        // Of all directions in the plane: conservative where it turns through a part of them only.
        let tangent = self.in_plane();
        Greatest { bend, tangent, curved: tangent.map(|component| component > 0.0) }
    }

    /// The same in a space where its frame is that of `map`, which keeps lengths and angles.
    pub(super) fn mapped<const M: usize>(&self, map: impl Fn(Vector<N>) -> Vector<M>) -> Involute<M> {
        let Self { outward, onward, base_mm, angles_rad } = *self;
        Involute { outward: map(outward), onward: map(onward), base_mm, angles_rad }
    }

    /// Greatest |component| of a unit vector in its plane on each axis.
    pub(super) fn in_plane(&self) -> Vector<N> {
        in_plane(&self.outward, &self.onward)
    }

    /// +1 as it unwinds, −1 as it winds up.
    fn sense(&self) -> f64 {
        (self.angles_rad.1 - self.angles_rad.0).signum()
    }

    /// φ where `parameter` has been run through.
    fn angle(&self, parameter: f64) -> f64 {
        self.angles_rad.0 + self.sense() * parameter
    }

    /// T and N.
    fn frame(&self, angle: f64) -> (Vector<N>, Vector<N>) {
        let (sine, cosine) = libm::sincos(angle);
        (
            add(scale(self.outward, cosine), scale(self.onward, sine)),
            subtract(scale(self.onward, cosine), scale(self.outward, sine)),
        )
    }
}

impl<const N: usize> Curve<N> for Involute<N> {
    fn offset(&self, origin: f64, u: f64) -> Vector<N> {
        let (start, end) = (self.angle(origin), self.angle(u));
        let (tangent, normal) = self.frame(start);
        // φ − φ₀ from the parameters, whose difference is exact; T − T₀ and N − N₀ without cancellation.
        let swept = self.sense() * (u - origin);
        let half = libm::sin(0.5 * swept);
        let (sine, versed) = (libm::sin(swept), 2.0 * half * half);
        let along = end * sine - versed;
        let across = (sine - swept) + end * versed;
        scale(add(scale(tangent, along), scale(normal, across)), self.base_mm)
    }

    fn derivatives(&self, u: f64) -> [Vector<N>; 3] {
        let (angle, sense) = (self.angle(u), self.sense());
        let (tangent, normal) = self.frame(angle);
        [
            scale(tangent, sense * self.base_mm * angle),
            scale(add(tangent, scale(normal, angle)), self.base_mm),
            scale(subtract(scale(normal, 2.0), scale(tangent, angle)), sense * self.base_mm),
        ]
    }

    fn length(&self, a: f64, b: f64) -> f64 {
        0.5 * self.base_mm * (b - a) * (self.angle(a) + self.angle(b))
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::{four_by_arc_length, gauss};
    use super::super::septic::{FEED_TOLERANCE, POSITION_TOLERANCE_MM, fit};
    use super::*;

    const PLANE: (Vector, Vector) = ([0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]);

    fn involute(base_mm: f64, from_rad: f64, to_rad: f64) -> Involute {
        Involute::new(PLANE, base_mm, (from_rad, to_rad)).expect("an involute")
    }

    /// The definition: the end of a taut string that leaves the circle where it touches it.
    fn end_of_string(base_mm: f64, angle: f64) -> Vector {
        let touch = add(scale(PLANE.0, angle.cos()), scale(PLANE.1, angle.sin()));
        let along = subtract(scale(PLANE.1, angle.cos()), scale(PLANE.0, angle.sin()));
        subtract(scale(touch, base_mm), scale(along, base_mm * angle))
    }

    #[test]
    fn it_is_the_end_of_a_string() {
        for (from, to) in [(0.001, 4.0), (7.0, 0.5)] {
            let involute = involute(12.0, from, to);
            assert!(norm(subtract(involute.start_mm(), end_of_string(12.0, from))) < 1e-12);
            for part in 0..=10 {
                let u = involute.sweep_rad() * f64::from(part) / 10.0;
                let found = add(involute.start_mm(), involute.offset(0.0, u));
                assert!(norm(subtract(found, end_of_string(12.0, involute.angle(u)))) < 1e-11, "{u}");
            }
        }
        // A short way keeps its digits.
        let (involute, step) = (involute(12.0, 2.0, 3.0), 1e-12);
        let taken = (0.5 + step) - 0.5;
        let (offset, slope) = (involute.offset(0.5, 0.5 + step), involute.derivatives(0.5)[0]);
        assert!(norm(subtract(offset, scale(slope, taken))) < 1e-11 * norm(offset));
    }

    #[test]
    fn derivatives_and_length() {
        for (from, to) in [(0.1, 4.0), (7.0, 0.5)] {
            let (involute, h) = (involute(12.0, from, to), 1e-5);
            for u in [0.3, 1.0, 3.1] {
                let [d1, d2, d3] = involute.derivatives(u);
                let (before, after) = (involute.derivatives(u - h), involute.derivatives(u + h));
                let slopes = [
                    scale(involute.offset(u - h, u + h), 0.5 / h),
                    scale(subtract(after[0], before[0]), 0.5 / h),
                    scale(subtract(after[1], before[1]), 0.5 / h),
                ];
                for (exact, slope) in [d1, d2, d3].into_iter().zip(slopes) {
                    assert!(norm(subtract(exact, slope)) < 1e-7, "{exact:?} {slope:?}");
                }
            }
            let quadrature = gauss(&involute, 0.2, 1.9);
            assert!((involute.length(0.2, 1.9) - quadrature).abs() < 1e-12);
        }
    }

    /// The bend is that of the smallest angle, and nowhere exceeded.
    #[test]
    fn the_bend_is_the_greatest() {
        for (from, to) in [(0.05, 4.0), (7.0, 0.5)] {
            let involute = involute(12.0, from, to);
            let bend = involute.greatest().bend;
            let bounds =
                [bend.curvature_per_mm, bend.third_root_per_mm.powi(2), bend.fourth_root_per_mm.powi(3)];
            let mut greatest = [0.0_f64; 3];
            for part in 0..=1000 {
                let u = involute.sweep_rad() * f64::from(part) / 1000.0;
                let [d1, d2, d3] = involute.derivatives(u);
                // The fourth derivative by φ is r·(−3T − φN).
                let (tangent, normal) = involute.frame(involute.angle(u));
                let d4 = scale(add(scale(tangent, 3.0), scale(normal, involute.angle(u))), -12.0);
                let [_, second, third, fourth] = four_by_arc_length([d1, d2, d3, d4]);
                for (greatest, vector) in greatest.iter_mut().zip([second, third, fourth]) {
                    *greatest = greatest.max(norm(vector));
                }
            }
            for (bound, greatest) in bounds.into_iter().zip(greatest) {
                assert!((greatest / bound - 1.0).abs() < 1e-9, "{bound} {greatest}");
            }
        }
    }

    /// Every point of the offset is at that distance, square to the tangent.
    #[test]
    fn offsets_are_involutes() {
        let (near, distance_mm) = (involute(12.0, 1.0, 4.0), 3.0);
        let far = near.offset_by(distance_mm).expect("an involute");
        for part in 0..=10 {
            let u = near.sweep_rad() * f64::from(part) / 10.0;
            let beside =
                subtract(add(far.start_mm(), far.offset(0.0, u)), add(near.start_mm(), near.offset(0.0, u)));
            assert!((norm(beside) - distance_mm).abs() < 1e-12);
            assert!(dot(beside, near.derivatives(u)[0]).abs() < 1e-9);
        }
        assert!(matches!(near.offset_by(-12.0), Err(InvoluteError::Angle { rad }) if rad == 0.0));
    }

    #[test]
    fn pieces_follow_it_to_its_base_circle_and_not_onto_it() {
        for (from, to) in [(ANGLE_RAD_MIN, 0.5), (0.5, ANGLE_RAD_MIN), (1.0, 20.0)] {
            let involute = involute(10.0, from, to);
            let sweep = involute.sweep_rad();
            let pieces = fit(&involute, 0.0, sweep, core::f64::consts::FRAC_PI_4, 16.0).expect("pieces");
            let length: f64 = pieces.iter().map(|piece| piece.length_mm).sum();
            assert!((length - involute.length(0.0, sweep)).abs() < 1e-9);
            for piece in &pieces {
                assert!(piece.deviation.position_mm <= POSITION_TOLERANCE_MM);
                assert!(piece.deviation.feed <= FEED_TOLERANCE);
            }
            assert!(pieces.len() < 60 + (length / 8.0) as usize, "{} over {length} mm", pieces.len());
        }
        for (from, to) in [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (f64::NAN, 1.0), (1.0, 1e9)] {
            let refused = Involute::new(PLANE, 10.0, (from, to)).expect_err("off the range");
            assert!(refused.to_string().contains("expected 0.001 to 1000 rad"), "{refused}");
        }
        assert_eq!(Involute::new(PLANE, 0.0, (1.0, 2.0)), Err(InvoluteError::Base { mm: 0.0 }));
        assert_eq!(Involute::new((PLANE.0, PLANE.0), 1.0, (1.0, 2.0)), Err(InvoluteError::Frame));
        assert_eq!(Involute::new(PLANE, 1.0, (1.0, 1.0)), Err(InvoluteError::Empty { rad: 1.0 }));
    }
}
