//! Curves to pieces of degree seven in arc length.
//!
//! Each piece matches position and the first three derivatives by arc length at both ends; it is
//! halved until position and feed agree with the curve between them too.

use super::Vector;
use super::curve::{Curve, by_arc_length};
use super::{norm, subtract};

/// Greatest distance of a piece from its curve \[mm\]: a hundredth of a 0.1 µm count.
pub const POSITION_TOLERANCE_MM: f64 = 1.0e-6;
/// Greatest deviation of a piece's |r'| from 1, which is the relative error of the feed.
pub const FEED_TOLERANCE: f64 = 1.0e-6;
/// The greatest sum of k(k−1)(k−2)·|cₖ| as a part of the length, so that every number type's unit (below 4) holds
/// the third derivative, and with it the lower ones.
const STEEPNESS_MAX: f64 = 3.9;
/// Halvings after which a curve is given up: 2¹⁶ pieces of it.
pub const HALVINGS_MAX: u32 = 16;

/// One piece: its span of the parameter, its length and its polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Septic {
    /// Parameter at the start and at the end.
    pub span: (f64, f64),
    /// Its start minus the curve's \[mm\].
    pub start: Vector,
    /// Arc length \[mm\].
    pub length_mm: f64,
    /// c₁ … c₇ per axis \[mm\] over u = s/length.
    pub coefficients: [[f64; 7]; 3],
}

/// A curve that no reasonable number of pieces follows.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a curve that {HALVINGS_MAX} halvings miss by {error_mm:.2e} mm between {} and {} of its parameter, expected at \
     most {POSITION_TOLERANCE_MM:e} mm and a feed within a millionth",
    span.0, span.1
)]
pub struct FitError {
    /// The span that failed.
    pub span: (f64, f64),
    /// Its deviation \[mm\].
    pub error_mm: f64,
}

/// The pieces of `curve` from parameter `from` to `to`, none longer than `longest_mm` and none wider
/// in the parameter than `widest`.
///
/// # Errors
/// The curve needs more than 2^[`HALVINGS_MAX`] pieces.
pub fn fit(
    curve: &impl Curve,
    from: f64,
    to: f64,
    widest: f64,
    longest_mm: f64,
) -> Result<Vec<Septic>, FitError> {
    let mut pieces = Vec::new();
    let parts = ((to - from) / widest).ceil().max(1.0) as u64;
    let at = |part: u64| if part == parts { to } else { from + (to - from) * (part as f64 / parts as f64) };
    // Spans still to do, the next one last.
    let mut spans: Vec<(f64, f64, u32)> = (0..parts).rev().map(|part| (at(part), at(part + 1), 0)).collect();
    while let Some((a, b, halvings)) = spans.pop() {
        let piece = hermite(curve, from, a, b);
        let (error_mm, feed_error) = deviation(curve, &piece);
        let good = error_mm <= POSITION_TOLERANCE_MM
            && feed_error <= FEED_TOLERANCE
            && piece.steepness() <= STEEPNESS_MAX;
        if good && piece.length_mm <= longest_mm {
            pieces.push(piece);
        } else if halvings == HALVINGS_MAX {
            return Err(FitError { span: (a, b), error_mm });
        } else {
            let middle = 0.5 * (a + b);
            spans.push((middle, b, halvings + 1));
            spans.push((a, middle, halvings + 1));
        }
    }
    Ok(pieces)
}

/// The piece over one span of a curve that starts at `from`.
fn hermite(curve: &impl Curve, from: f64, a: f64, b: f64) -> Septic {
    let length_mm = curve.length(a, b);
    let (start, end) = (by_arc_length(curve.derivatives(a)), by_arc_length(curve.derivatives(b)));
    let chord = curve.offset(a, b);
    let powers = [length_mm, length_mm * length_mm, length_mm * length_mm * length_mm];
    let coefficients = core::array::from_fn(|axis| {
        let derivative = |of: &[Vector; 3], order: usize| of[order][axis] * powers[order];
        let c1 = derivative(&start, 0);
        let c2 = derivative(&start, 1) / 2.0;
        let c3 = derivative(&start, 2) / 6.0;
        // What the upper four must add at the end: position and three derivatives.
        let d0 = chord[axis] - (c1 + c2 + c3);
        let d1 = derivative(&end, 0) - (c1 + 2.0 * c2 + 3.0 * c3);
        let d2 = derivative(&end, 1) - (2.0 * c2 + 6.0 * c3);
        let d3 = derivative(&end, 2) - 6.0 * c3;
        [
            c1,
            c2,
            c3,
            35.0 * d0 - 15.0 * d1 + 2.5 * d2 - d3 / 6.0,
            -84.0 * d0 + 39.0 * d1 - 7.0 * d2 + 0.5 * d3,
            70.0 * d0 - 34.0 * d1 + 6.5 * d2 - 0.5 * d3,
            -20.0 * d0 + 10.0 * d1 - 2.0 * d2 + d3 / 6.0,
        ]
    });
    Septic { span: (a, b), start: curve.offset(from, a), length_mm, coefficients }
}

/// Greatest distance between piece and curve, and greatest error of |r'|, at seven inner points.
fn deviation(curve: &impl Curve, piece: &Septic) -> (f64, f64) {
    let (a, b) = piece.span;
    let (mut position, mut feed) = (0.0_f64, 0.0_f64);
    for part in 1..8 {
        let parameter = a + (b - a) * f64::from(part) / 8.0;
        let u = curve.length(a, parameter) / piece.length_mm;
        let (point, slope) = piece.at(u);
        position = position.max(norm(subtract(point, curve.offset(a, parameter))));
        feed = feed.max((norm(slope) - 1.0).abs());
    }
    // What is not a number must not pass as good.
    if position.is_nan() || feed.is_nan() { (f64::INFINITY, f64::INFINITY) } else { (position, feed) }
}

impl Septic {
    /// The greatest sum over an axis of |third derivative|'s terms, in parts of the length.
    fn steepness(&self) -> f64 {
        const FACTORS: [f64; 7] = [0.0, 0.0, 6.0, 24.0, 60.0, 120.0, 210.0];
        let of_axis =
            |axis: &[f64; 7]| axis.iter().zip(FACTORS).map(|(c, factor)| factor * c.abs()).sum::<f64>();
        self.coefficients.iter().map(of_axis).fold(0.0, f64::max) / self.length_mm
    }

    /// Offset from the start and derivative by arc length at u = s/length.
    #[must_use]
    pub fn at(&self, u: f64) -> (Vector, Vector) {
        let horner = |axis: usize| {
            let (mut value, mut slope) = (0.0, 0.0);
            for c in self.coefficients[axis].iter().rev() {
                slope = slope * u + value;
                value = value * u + c;
            }
            (value * u, slope * u + value)
        };
        let both: [(f64, f64); 3] = core::array::from_fn(horner);
        (both.map(|(value, _)| value), both.map(|(_, slope)| slope / self.length_mm))
    }
}
