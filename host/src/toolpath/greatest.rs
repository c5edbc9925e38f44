//! The greatest derivatives of a curve by arc length, from which ceilings are made.
//!
//! The machine drives the pieces of a curve. They are within a millionth of a millimetre of it, which says
//! little about the third and fourth derivative of a curve that is short: the third is up to a seventh
//! greater than the curve's on corner blends, the fourth up to two thirds. So both are examined, the curve
//! and its pieces.

use motion_kernel::num::Root;
use motion_kernel::plan::Bend;
use wide::f64x4;

use super::lanes::LANES;
use super::septic::Septic;
use super::{Vector, norm};

/// The number of parts that a piece is cut into: the square of its second derivative has eight extremes at
/// most.
const PIECE_PARTS: usize = 16;

/// The greatest derivatives by arc length, each where it is greatest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Greatest<const N: usize = 3> {
    /// The greatest κ, |r'''| and |r''''|.
    pub bend: Bend<f64>,
    /// |component| of the tangent on each axis, at most 1.
    pub tangent: Vector<N>,
    /// Whether the axis takes part in the bend.
    pub curved: [bool; N],
}

impl<const N: usize> Greatest<N> {
    /// The greatest derivatives of a curve with these figures that is driven as `pieces`. Their tangents are
    /// unit vectors to a millionth.
    #[must_use]
    pub fn driven_as(self, pieces: &[Septic<N>]) -> Self {
        let mut norms = [0.0_f64; 3];
        for piece in pieces {
            for (greatest, of_piece) in norms.iter_mut().zip(of_piece(piece)) {
                *greatest = greater(*greatest, of_piece);
            }
        }
        let (curve, pieces) = (self.bend, bend(norms));
        let bend = Bend {
            curvature_per_mm: greater(curve.curvature_per_mm, pieces.curvature_per_mm),
            third_root_per_mm: greater(curve.third_root_per_mm, pieces.third_root_per_mm),
            fourth_root_per_mm: greater(curve.fourth_root_per_mm, pieces.fourth_root_per_mm),
        };
        Self { bend, ..self }
    }
}

/// A value that is not a number is greater than any.
fn greater(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// |r''|, |r'''| and |r''''| of a piece, each where it is greatest.
fn of_piece<const N: usize>(piece: &Septic<N>) -> [f64; 3] {
    let mut peaks = [Peak::default(); 3];
    for first in (0..=PIECE_PARTS).step_by(LANES) {
        let places = core::array::from_fn(|lane| (first + lane).min(PIECE_PARTS) as f64 / PIECE_PARTS as f64);
        let derivatives = piece.second_to_fourth(f64x4::from(places));
        for (peak, derivative) in peaks.iter_mut().zip(derivatives) {
            let norms = norm(derivative).to_array();
            norms.iter().take(PIECE_PARTS + 1 - first).for_each(|&norm| peak.next(norm));
        }
    }
    peaks.map(Peak::greatest)
}

/// The bend of which |r''|, |r'''| and |r''''| are `norms` at their greatest.
pub(super) fn bend([second, third, fourth]: [f64; 3]) -> Bend<f64> {
    Bend { curvature_per_mm: second, third_root_per_mm: third.sqrt(), fourth_root_per_mm: Root::cbrt(fourth) }
}

/// The greatest value of a sampled function, between its samples too: between two of them a smooth function
/// rises above both by an eighth of its second difference; twice that is added.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Peak {
    greatest: f64,
    before: [Option<f64>; 2],
}

impl Peak {
    /// The next sample, at the same distance as those before.
    pub(super) fn next(&mut self, value: f64) {
        let bulge = match self.before {
            [Some(first), Some(second)] => 0.25 * (first - 2.0 * second + value).abs(),
            _ => 0.0,
        };
        let highest = self.before.iter().flatten().fold(value, |highest, &before| greater(highest, before));
        self.greatest = greater(self.greatest, highest + bulge);
        self.before = [self.before[1], Some(value)];
    }

    pub(super) fn greatest(self) -> f64 {
        self.greatest
    }
}
