//! A piece of path: geometry over a length, for all axes.
//!
//! Every curve is made of pieces that are polynomials **of arc length**, so walking along them needs
//! no root, no division and no sine, and the axes' velocity, acceleration and jerk follow from the
//! feed by the chain rule:
//!
//! ```text
//! V = x'·v        A = x''·v² + x'·a        J = x'''·v³ + 3·x''·v·a + x'·j
//! ```
//!
//! A piece starts at a fixed-point position; only the offset from there is a `Real`. Pieces are short
//! ([`Real::PIECE_MM_MAX`]), so f32 offsets stay good to a hundredth of a 0.1 µm count.

use serde::{Deserialize, Serialize};

use crate::law::PathMotion;
use crate::num::{Real, Scalar, Unit, is_finite, rolled};
use crate::units::Position;

/// The motion of one axis in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Setpoint<R> {
    /// Position.
    pub position: Position,
    /// Velocity \[mm/s\].
    pub velocity_mm_s: R,
    /// Acceleration \[mm/s²\].
    pub accel_mm_s2: R,
    /// Jerk \[mm/s³\].
    pub jerk_mm_s3: R,
}

/// The geometry of a piece, relative to its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Geometry<R: Real, const AXES: usize> {
    /// A straight line along a unit vector.
    Line {
        /// The unit vector, per axis.
        direction: [R::Unit; AXES],
    },
    /// length·Σ qₖ·uᵏ, k = 1 … 7, with u = s/length.
    Septic {
        /// q₁ … q₇ of every axis: parts of the length, so that |Σ k·qₖ·uᵏ⁻¹| over the axes is 1.
        coefficients: [[R::Unit; 7]; AXES],
        /// 1/length \[1/mm\].
        per_mm: R,
        /// length \[mm\].
        length_mm: R,
    },
}

/// An item of the path stream. Immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece<R: Real, const AXES: usize> {
    line: u32,
    length: Position,
    start: [Position; AXES],
    geometry: Geometry<R, AXES>,
}

/// Why a piece can't be made.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PieceError {
    /// A direction is not finite.
    NotFinite {
        /// The axis, from 0.
        axis: usize,
    },
    /// A coefficient is not finite, or not below 2.
    OutOfRange {
        /// The axis, from 0.
        axis: usize,
        /// The coefficient, as a part of the length.
        coefficient: f64,
    },
    /// The length is not positive, or longer than the number type resolves.
    Length {
        /// The length \[mm\].
        length_mm: f64,
        /// The longest allowed \[mm\].
        longest_mm: f64,
    },
    /// Its derivatives could outgrow the number type.
    Bent {
        /// The axis, from 0.
        axis: usize,
        /// The greatest of Σ|qₖ|, Σ k·|qₖ|, Σ k(k−1)·|qₖ| and Σ k(k−1)(k−2)·|qₖ|.
        sum: f64,
    },
    /// The derivative by arc length is not a unit vector.
    NotArcLength {
        /// Its magnitude.
        magnitude: f64,
    },
}

impl core::fmt::Display for PieceError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite { axis } => write!(f, "a direction of axis {axis} that is not a number"),
            Self::OutOfRange { axis, coefficient } => {
                write!(f, "coefficient {coefficient} of axis {axis}: expected a magnitude below 2")
            }
            Self::Length { length_mm, longest_mm } => {
                write!(f, "length {length_mm} mm: expected more than 0 and at most {longest_mm} mm")
            }
            Self::Bent { axis, sum } => {
                write!(f, "derivatives of axis {axis} up to {sum} parts of the length: expected less than 4")
            }
            Self::NotArcLength { magnitude } => {
                write!(f, "tangent of magnitude {magnitude}: expected 1, a polynomial of arc length")
            }
        }
    }
}

impl core::error::Error for PieceError {}

/// Number of parts of a piece whose ends are checked for their tangents.
const TANGENT_CHECKS: u8 = 13;
/// Greatest difference of the tangent's magnitude from 1: 10⁻⁵ of the feed.
const TANGENT_TOLERANCE: f64 = 1.0e-5;
/// Room for rounding in a derivative of a septic in fixed point: 512 steps of 2⁻²⁹, of which [`derivatives`]
/// needs some 300.
const ROUNDING: f64 = 1.0 / 1_048_576.0;

impl<R: Real, const AXES: usize> Piece<R, AXES> {
    /// A line of `length` from `start` along the unit vector `direction`; `line` is the program line
    /// it came from.
    ///
    /// # Errors
    /// The direction is not a finite unit vector, or the length is out of range.
    pub fn line(
        line: u32,
        start: [Position; AXES],
        direction: [f64; AXES],
        length: Position,
    ) -> Result<Self, PieceError> {
        let mut unit = [R::Unit::ZERO; AXES];
        let (places, parts) = rolled((unit.as_mut_slice(), direction.as_slice()));
        for (axis, (unit, &d)) in places.iter_mut().zip(parts).enumerate() {
            if !is_finite(d) {
                return Err(PieceError::NotFinite { axis });
            }
            // A component beyond 1 is refused with the tangent's magnitude; it must fit for that.
            *unit = R::Unit::from_f64(d).max(R::Unit::from_f64(-2.0)).min(R::Unit::from_f64(2.0));
        }
        Self::new(line, start, length, Geometry::Line { direction: unit })
    }

    /// A polynomial piece of `length` from `start`; `coefficients` are q₁ … q₇ per axis over
    /// u = s/length, as parts of the length.
    ///
    /// # Errors
    /// A coefficient is not finite, the length is out of range, a derivative could outgrow the number type,
    /// or a tangent is not a unit vector.
    pub fn septic(
        line: u32,
        start: [Position; AXES],
        coefficients: [[f64; 7]; AXES],
        length: Position,
    ) -> Result<Self, PieceError> {
        let length_mm = length.to_mm();
        let out_of_range = PieceError::Length { length_mm, longest_mm: R::PIECE_MM_MAX };
        let per_mm = R::checked_from_f64(1.0 / length_mm).ok_or(out_of_range)?;
        let mut unit = [[R::Unit::ZERO; 7]; AXES];
        let (places, parts) = rolled((unit.as_flattened_mut(), coefficients.as_flattened()));
        for (index, (unit, c)) in places.iter_mut().zip(parts).enumerate() {
            let c = *rolled(c);
            if !(libm::fabs(c) < 2.0) {
                return Err(PieceError::OutOfRange { axis: index / 7, coefficient: c });
            }
            *unit = R::Unit::from_f64(c);
        }
        if R::Unit::LIMIT.is_finite() {
            for (axis, coefficients) in coefficients.iter().enumerate() {
                // With all coefficients positive, every partial sum of Horner's scheme is at most its end,
                // and greatest at u = 1.
                let sum = derivatives(&coefficients.map(libm::fabs), 1.0).into_iter().fold(0.0, f64::max);
                if !(sum < R::Unit::LIMIT - ROUNDING) {
                    return Err(PieceError::Bent { axis, sum });
                }
            }
        }
        let geometry = Geometry::Septic { coefficients: unit, per_mm, length_mm: R::from_f64(length_mm) };
        Self::new(line, start, length, geometry)
    }

    fn new(
        line: u32,
        start: [Position; AXES],
        length: Position,
        geometry: Geometry<R, AXES>,
    ) -> Result<Self, PieceError> {
        let longest_mm = R::PIECE_MM_MAX;
        if length <= Position::ZERO || length.to_mm() > longest_mm {
            return Err(PieceError::Length { length_mm: length.to_mm(), longest_mm });
        }
        let piece = Self { line, length, start, geometry };
        // |r'| is a polynomial of degree 12: checked at the ends and in between, so no bulge is missed.
        for part in 0..=TANGENT_CHECKS {
            let s_mm = length.to_mm() * f64::from(part) / f64::from(TANGENT_CHECKS);
            let tangent = piece.tangent_at(R::from_f64(s_mm));
            let magnitude = magnitude(&tangent.map(Scalar::to_f64));
            if !(libm::fabs(magnitude - 1.0) <= TANGENT_TOLERANCE) {
                return Err(PieceError::NotArcLength { magnitude });
            }
        }
        Ok(piece)
    }

    /// The program line it came from.
    pub(crate) fn program_line(&self) -> u32 {
        self.line
    }

    /// The length of path.
    #[doc(hidden)]
    pub fn length(&self) -> Position {
        self.length
    }

    /// Where it starts.
    pub(crate) fn start(&self) -> [Position; AXES] {
        self.start
    }

    /// Where it ends, as far as the number type resolves it.
    pub fn end(&self) -> [Position; AXES] {
        let still = PathMotion::default();
        self.at(self.length.to_offset(), &still).map(|setpoint| setpoint.position)
    }

    /// The unit tangent at `s_mm` from the start.
    pub(crate) fn tangent_at(&self, s_mm: R) -> [R; AXES] {
        // Without the chain rule: on a piece too short for its feed, its products may not fit.
        match &self.geometry {
            Geometry::Line { direction } => direction.map(|d| R::ONE.scaled(d)),
            Geometry::Septic { coefficients, per_mm, .. } => {
                let u = (s_mm * *per_mm).to_unit();
                coefficients.map(|q| {
                    let [_, q1, ..] = derivatives(&q, u);
                    R::ONE.scaled(q1)
                })
            }
        }
    }

    /// Bounds of its derivatives.
    pub(crate) fn steepness(&self) -> Steepness {
        let Geometry::Septic { coefficients, per_mm, .. } = &self.geometry else {
            return Steepness::STRAIGHT;
        };
        let per_mm = per_mm.to_f64();
        let mut sums = [0.0; 4];
        for q in coefficients {
            let of_axis = derivatives(&q.map(Scalar::abs), R::Unit::ONE);
            for (sum, of_axis) in sums.iter_mut().zip(of_axis) {
                *sum = f64::max(*sum, of_axis.to_f64() + ROUNDING);
            }
        }
        let [_, slope, bend, twist] = sums;
        Steepness { per_mm, slope, bend_per_mm: bend * per_mm, twist_per_mm2: twist * per_mm * per_mm }
    }

    /// The set-points of all axes at `s_mm` from the piece's start, for the motion along the path.
    #[doc(hidden)]
    #[must_use]
    pub fn at(&self, s_mm: R, motion: &PathMotion<R>) -> [Setpoint<R>; AXES] {
        let mut setpoints = [Setpoint::default(); AXES];
        self.set(s_mm, motion, &mut setpoints);
        setpoints
    }

    /// [`Piece::at`] into `setpoints`. In the tick: no division, no loop but those over axes and
    /// coefficients.
    #[doc(hidden)]
    #[inline]
    pub fn set(&self, s_mm: R, motion: &PathMotion<R>, setpoints: &mut [Setpoint<R>; AXES]) {
        let (v, a, j) = (motion.v_mm_s, motion.a_mm_s2, motion.j_mm_s3);
        match &self.geometry {
            Geometry::Line { direction } => {
                for ((setpoint, &start), &d) in setpoints.iter_mut().zip(&self.start).zip(direction) {
                    *setpoint = Setpoint {
                        position: start + Position::from_offset(s_mm.scaled(d)),
                        velocity_mm_s: v.scaled(d),
                        accel_mm_s2: a.scaled(d),
                        jerk_mm_s3: j.scaled(d),
                    };
                }
            }
            Geometry::Septic { coefficients, per_mm, length_mm } => {
                let u = (s_mm * *per_mm).to_unit();
                // Multiplied one by one, every intermediate result is of the size of what it is for,
                // however short the piece: κ·v, κ'·v².
                let w = v * *per_mm;
                let three_a = a + a + a;
                for ((setpoint, &start), q) in setpoints.iter_mut().zip(&self.start).zip(coefficients) {
                    let [q0, q1, q2, q3] = derivatives(q, u);
                    let (bend, twist) = (w.scaled(q2), w.scaled(q3) * w);
                    *setpoint = Setpoint {
                        position: start + Position::from_offset(length_mm.scaled(q0)),
                        velocity_mm_s: v.scaled(q1),
                        accel_mm_s2: bend * v + a.scaled(q1),
                        jerk_mm_s3: twist * v + bend * three_a + j.scaled(q1),
                    };
                }
            }
        }
    }
}

/// Corruption of a piece in memory.
#[cfg(test)]
impl<const AXES: usize> Piece<f32, AXES> {
    /// Flips one bit of a line's start, length or direction.
    pub(crate) fn with_flipped_bit(mut self, bit: u32) -> Self {
        let Geometry::Line { direction } = &mut self.geometry else { return self };
        let axis = (bit >> 16) as usize % AXES;
        match bit % 160 {
            bit @ 0..64 => self.start[axis] = Position::from_bits(self.start[axis].to_bits() ^ 1 << bit),
            bit @ 64..128 => self.length = Position::from_bits(self.length.to_bits() ^ 1 << (bit - 64)),
            bit => direction[axis] = f32::from_bits(direction[axis].to_bits() ^ 1 << (bit - 128)),
        }
        self
    }

    /// Replaces one component of a line's direction.
    pub(crate) fn with_direction(mut self, axis: usize, value: f32) -> Self {
        if let Geometry::Line { direction } = &mut self.geometry {
            direction[axis] = value;
        }
        self
    }
}

/// The magnitude of a vector.
#[inline(never)]
pub(crate) fn magnitude<const AXES: usize>(vector: &[f64; AXES]) -> f64 {
    libm::sqrt(vector.iter().map(|part| part * part).sum())
}

/// Bounds of the factors that [`Piece::set`] multiplies a motion with, for any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steepness {
    /// 1/length.
    per_mm: f64,
    /// Bounds of |x'|, |x''|, |x'''| by arc length.
    slope: f64,
    bend_per_mm: f64,
    twist_per_mm2: f64,
}

impl Steepness {
    /// The bounds of a line.
    pub(crate) const STRAIGHT: Self = Self { per_mm: 0.0, slope: 1.0, bend_per_mm: 0.0, twist_per_mm2: 0.0 };

    /// The bound of |x''| by arc length \[1/mm\].
    pub(crate) fn bend_per_mm(&self) -> f64 {
        self.bend_per_mm
    }

    /// The bounds of two pieces together.
    pub(crate) fn max(&self, other: &Self) -> Self {
        Self {
            per_mm: f64::max(self.per_mm, other.per_mm),
            slope: f64::max(self.slope, other.slope),
            bend_per_mm: f64::max(self.bend_per_mm, other.bend_per_mm),
            twist_per_mm2: f64::max(self.twist_per_mm2, other.twist_per_mm2),
        }
    }

    /// The greatest velocity, acceleration and jerk of any axis under a motion of at most `v`, `a`, `j`
    /// \[mm/s, mm/s², mm/s³\]. The last also bounds every other product on the way, whatever its unit.
    pub(crate) fn setpoint_max(&self, v: f64, a: f64, j: f64) -> [f64; 3] {
        // In the same order as `set`.
        let w = v * self.per_mm;
        let bend = v * self.bend_per_mm;
        let twist = v * v * self.twist_per_mm2;
        let jerk = twist * v + bend * 3.0 * a + self.slope * j;
        // `set` takes one factor at a time: w times a unit, below 4, is on its way to the twist.
        let greatest = [4.0 * w, bend, twist, 3.0 * a].into_iter().fold(jerk, f64::max);
        [v * self.slope, bend * v + a * self.slope, greatest]
    }
}

/// Σ qₖ·uᵏ, k = 1 … 7, and its first three derivatives by u: Horner's scheme on all four at once, each as far
/// as it has terms.
#[inline]
fn derivatives<U: Unit>(&[q1, q2, q3, q4, q5, q6, q7]: &[U; 7], u: U) -> [U; 4] {
    // The sum, its derivative, a half of its second and a sixth of its third.
    let (mut p, mut p1, mut p2, mut p3) = (q7, q7, q7, q7);
    for q in [q6, q5, q4, q3] {
        p = p * u + q;
        p1 = p1 * u + p;
        p2 = p2 * u + p1;
        p3 = p3 * u + p2;
    }
    p = p * u + q2;
    p1 = p1 * u + p;
    p2 = p2 * u + p1;
    p = p * u + q1;
    p1 = p1 * u + p;
    p = p * u;
    let twice = p3 + p3;
    [p, p1, p2 + p2, twice + twice + twice]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_polynomial() {
        let c = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0];
        for u in [0.0, 0.3, 0.77, 1.0_f64] {
            let mut expected = [0.0; 4];
            for (k, c) in (1..).zip(c) {
                let mut factor = c;
                for (order, sum) in (0..).zip(&mut expected) {
                    if k >= order {
                        *sum += factor * u.powi(k - order);
                        factor *= f64::from(k - order);
                    }
                }
            }
            for (found, expected) in derivatives(&c, u).iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-12 * (1.0 + expected.abs()), "{found} {expected}");
            }
        }
    }

    #[test]
    fn refuses_what_is_not_a_unit_speed_piece() {
        let start = [Position::ZERO; 2];
        let one = Position::from_mm(1.0).expect("in range");
        let make = |direction, length| Piece::<f32, 2>::line(1, start, direction, length);
        assert!(make([0.6, 0.8], one).is_ok());
        assert!(matches!(make([1.0, 0.1], one), Err(PieceError::NotArcLength { .. })));
        assert!(matches!(make([f64::NAN, 1.0], one), Err(PieceError::NotFinite { axis: 0 })));
        assert!(matches!(make([0.6, 0.8], Position::ZERO), Err(PieceError::Length { .. })));
        assert!(matches!(make([0.6, 0.8], -one), Err(PieceError::Length { .. })));
        let long = Position::from_mm(16.1).expect("in range");
        assert!(matches!(make([0.6, 0.8], long), Err(PieceError::Length { .. })));
    }
}
