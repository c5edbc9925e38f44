//! Curves to pieces of degree seven in arc length.
//!
//! Each piece matches position and the first three derivatives by arc length at both ends; it is
//! halved until position and feed agree with the curve between them too, and says how well they do. A
//! curve that no reasonable number of pieces follows is refused, and its cusp named if that is why.

use super::curve::{Curve, by_arc_length, gauss_4};
use super::{Lanes, Vector};
use super::{norm, subtract};

/// Greatest distance of a piece from its curve \[mm\]: a hundredth of a 0.1 µm count.
pub const POSITION_TOLERANCE_MM: f64 = 1.0e-6;
/// Greatest deviation of a piece's |r'| from 1, which is the relative error of the feed.
pub const FEED_TOLERANCE: f64 = 1.0e-6;
/// The greatest sum of k(k−1)(k−2)·|cₖ| as a part of the length, so that every number type's unit (below 4)
/// holds the third derivative, and with it the lower ones.
const STEEPNESS_MAX: f64 = 3.9;
/// Factors of the k-th power in the second to fourth derivative: k·(k − 1), then times k − 2, then times k
/// − 3.
const FACTORS: [[f64; 7]; 3] = [
    [0.0, 2.0, 6.0, 12.0, 20.0, 30.0, 42.0],
    [0.0, 0.0, 6.0, 24.0, 60.0, 120.0, 210.0],
    [0.0, 0.0, 0.0, 24.0, 120.0, 360.0, 840.0],
];
/// Halvings of one part after which a curve is given up.
pub const HALVINGS_MAX: u32 = 16;
/// Halvings of one part for the sake of the deviation, not of the length, after which a curve is given up.
pub const REFINEMENTS_MAX: usize = 4096;
/// What lies between the points at which a deviation is measured may exceed it by this factor: 1.14 was found
/// over 8566 pieces of random splines.
const BETWEEN: f64 = 1.25;
/// A failed span is that of a cusp if the curve is slower there than this part of its greatest speed: on a
/// cusp, where the speed grows linearly, it is some 2⁻¹⁶.
const STILL: f64 = 1.0e-3;
/// The number of parts of a curve at which its greatest speed is searched.
const SPEEDS: u32 = 64;

/// One piece: its span of the parameter, its length and its polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Septic<const N: usize = 3> {
    /// Parameter at the start and at the end.
    pub span: (f64, f64),
    /// Its start minus the curve's \[mm\].
    pub start: Vector<N>,
    /// Arc length \[mm\].
    pub length_mm: f64,
    /// c₁ … c₇ per axis \[mm\] over u = s/length.
    pub coefficients: [[f64; 7]; N],
    /// How far it is from the curve.
    pub deviation: Deviation,
}

/// How far a piece is from its curve: the greatest of what was measured at seven inner points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Distance at equal path length \[mm\].
    pub position_mm: f64,
    /// Deviation of |r'| from 1, the relative error of the feed.
    pub feed: f64,
}

impl Deviation {
    /// The greater of each.
    #[must_use]
    pub fn or_greater(self, other: Self) -> Self {
        Self { position_mm: self.position_mm.max(other.position_mm), feed: self.feed.max(other.feed) }
    }

    /// A quarter more than measured, for what lies between the points.
    #[must_use]
    pub fn bound(self) -> Self {
        Self { position_mm: BETWEEN * self.position_mm, feed: BETWEEN * self.feed }
    }

    fn is_tolerable(&self) -> bool {
        self.position_mm <= POSITION_TOLERANCE_MM && self.feed <= FEED_TOLERANCE
    }
}

/// A curve that no reasonable number of pieces follows. Displays as "…, expected …".
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// It has no finite length or derivatives.
    #[error("a curve that is not finite between {} and {} of its parameter, expected finite coordinates", span.0, span.1)]
    NotFinite {
        /// A span without them.
        span: (f64, f64),
    },
    /// It has a cusp, or a point only: there is no tangent where |r'| is 0.
    #[error(
        "a curve that stands still at {parameter} of its parameter, expected one that moves on everywhere, without a cusp"
    )]
    StandsStill {
        /// Where, to a part of 2⁻¹⁶.
        parameter: f64,
    },
    /// It is longer than its pieces can be made to reach.
    #[error(
        "a curve of {length_mm:.0} mm, expected one whose parts by halving it {HALVINGS_MAX} times are not longer than \
         {longest_mm:.0} mm"
    )]
    TooLong {
        /// Its length \[mm\].
        length_mm: f64,
        /// The longest piece that is allowed \[mm\].
        longest_mm: f64,
    },
    /// It bends too sharply, or too often.
    #[error(
        "a curve that {pieces} pieces and more miss by {error_mm:.2e} mm between {} and {} of its parameter, expected at \
         most {POSITION_TOLERANCE_MM:e} mm and a feed within a millionth",
        span.0, span.1
    )]
    TooManyPieces {
        /// The span that failed.
        span: (f64, f64),
        /// Its deviation \[mm\].
        error_mm: f64,
        /// The number of pieces up to there.
        pieces: usize,
    },
}

/// The pieces of `curve` from parameter `from` to `to`, none longer than `longest_mm` and none wider
/// in the parameter than `widest`.
///
/// # Errors
/// The curve is not finite, too long, stands still somewhere, or is missed after [`HALVINGS_MAX`] halvings or
/// with [`REFINEMENTS_MAX`] pieces more than its length asks for.
pub fn fit<const N: usize>(
    curve: &(impl Curve<N> + ?Sized),
    from: f64,
    to: f64,
    widest: f64,
    longest_mm: f64,
) -> Result<Vec<Septic<N>>, FitError> {
    let mut pieces = Vec::new();
    let parts = ((to - from) / widest).ceil().max(1.0) as u64;
    let at = |part: u64| if part == parts { to } else { from + (to - from) * (part as f64 / parts as f64) };
    // Spans still to do, the next one last.
    let mut spans: Vec<(f64, f64, u32)> = (0..parts).rev().map(|part| (at(part), at(part + 1), 0)).collect();
    let mut refinements = 0;
    while let Some((a, b, halvings)) = spans.pop() {
        let piece = hermite(curve, from, a, b);
        if !piece.length_mm.is_finite() {
            return Err(FitError::NotFinite { span: (a, b) });
        }
        let good = piece.deviation.is_tolerable() && piece.steepness() <= STEEPNESS_MAX;
        if halvings == 0 {
            refinements = 0;
        }
        if good && piece.length_mm <= longest_mm {
            pieces.push(piece);
        } else if halvings == HALVINGS_MAX || (!good && refinements == REFINEMENTS_MAX) {
            if good {
                return Err(FitError::TooLong { length_mm: curve.length(from, to), longest_mm });
            }
            return Err(still(curve, from, to, &piece).unwrap_or(FitError::TooManyPieces {
                span: (a, b),
                error_mm: piece.deviation.position_mm,
                pieces: pieces.len() + spans.len() + 1,
            }));
        } else {
            refinements += usize::from(!good);
            let middle = 0.5 * (a + b);
            spans.push((middle, b, halvings + 1));
            spans.push((a, middle, halvings + 1));
        }
    }
    Ok(pieces)
}

/// Whether `curve` stands still where a piece failed, compared with its speed elsewhere.
fn still<const N: usize>(
    curve: &(impl Curve<N> + ?Sized),
    from: f64,
    to: f64,
    failed: &Septic<N>,
) -> Option<FitError> {
    let speed = |u: f64| norm(curve.derivatives(u)[0]);
    let everywhere = (0..=SPEEDS).map(|part| from + (to - from) * f64::from(part) / f64::from(SPEEDS));
    let fastest = everywhere.map(speed).fold(0.0, f64::max);
    let (a, b) = failed.span;
    let parameter = [a, 0.5 * (a + b), b].into_iter().min_by(|&a, &b| speed(a).total_cmp(&speed(b)))?;
    (speed(parameter) <= STILL * fastest).then_some(FitError::StandsStill { parameter })
}

/// The piece over one span of a curve that starts at `from`.
fn hermite<const N: usize>(curve: &(impl Curve<N> + ?Sized), from: f64, a: f64, b: f64) -> Septic<N> {
    let length_mm = curve.length(a, b);
    let (start, end) = (by_arc_length(curve.derivatives(a)), by_arc_length(curve.derivatives(b)));
    let chord = curve.offset(a, b);
    let powers = [length_mm, length_mm * length_mm, length_mm * length_mm * length_mm];
    let coefficients = core::array::from_fn(|axis| {
        let scaled = |of: &[Vector<N>; 3]| core::array::from_fn(|order| of[order][axis] * powers[order]);
        between(chord[axis], scaled(&start), scaled(&end))
    });
    let start = curve.offset(from, a);
    let mut piece = Septic { span: (a, b), start, length_mm, coefficients, deviation: Deviation::default() };
    piece.deviation = deviation(curve, &piece);
    piece
}

/// c₁ … c₇ over 0 … 1 of the septic that rises by `rise` and has these first to third derivatives at its
/// ends.
pub(crate) fn between(rise: f64, start: [f64; 3], end: [f64; 3]) -> [f64; 7] {
    let (c1, c2, c3) = (start[0], start[1] / 2.0, start[2] / 6.0);
    // What the upper four must add at the end: position and three derivatives.
    let d0 = rise - (c1 + c2 + c3);
    let d1 = end[0] - (c1 + 2.0 * c2 + 3.0 * c3);
    let d2 = end[1] - (2.0 * c2 + 6.0 * c3);
    let d3 = end[2] - 6.0 * c3;
    [
        c1,
        c2,
        c3,
        35.0 * d0 - 15.0 * d1 + 2.5 * d2 - d3 / 6.0,
        -84.0 * d0 + 39.0 * d1 - 7.0 * d2 + 0.5 * d3,
        70.0 * d0 - 34.0 * d1 + 6.5 * d2 - 0.5 * d3,
        -20.0 * d0 + 10.0 * d1 - 2.0 * d2 + d3 / 6.0,
    ]
}

/// Greatest distance between piece and curve, and greatest error of |r'|, at seven inner points.
fn deviation<const N: usize>(curve: &(impl Curve<N> + ?Sized), piece: &Septic<N>) -> Deviation {
    let (a, b) = piece.span;
    let mut greatest = Deviation::default();
    let (mut before, mut gone_mm) = (a, 0.0);
    for part in 1..8 {
        let parameter = a + (b - a) * f64::from(part) / 8.0;
        // An eighth is so smooth that few points are better than the deviations that are looked for.
        gone_mm += gauss_4(curve, before, parameter);
        before = parameter;
        let u = gone_mm / piece.length_mm;
        let (point, slope) = piece.at(u);
        let position_mm = norm(subtract(point, curve.offset(a, parameter)));
        let feed = (norm(slope) - 1.0).abs();
        // What is not a number must not pass as good, and a maximum would leave it out.
        if position_mm.is_nan() || feed.is_nan() {
            return Deviation { position_mm: f64::INFINITY, feed: f64::INFINITY };
        }
        greatest = greatest.or_greater(Deviation { position_mm, feed });
    }
    greatest
}

impl<const N: usize> Septic<N> {
    /// The greatest sum over an axis of |third derivative|'s terms, in parts of the length.
    fn steepness(&self) -> f64 {
        let [_, factors, _] = FACTORS;
        let of_axis =
            |axis: &[f64; 7]| axis.iter().zip(factors).map(|(c, factor)| factor * c.abs()).sum::<f64>();
        self.coefficients.iter().map(of_axis).fold(0.0, f64::max) / self.length_mm
    }

    /// Offset from the start and derivative by arc length at u = s/length.
    #[must_use]
    pub fn at(&self, u: f64) -> (Vector<N>, Vector<N>) {
        let (mut offset, mut tangent) = ([0.0; N], [0.0; N]);
        for ((offset, tangent), coefficients) in offset.iter_mut().zip(&mut tangent).zip(&self.coefficients) {
            let (mut value, mut slope) = (0.0, 0.0);
            for c in coefficients.iter().rev() {
                slope = slope * u + value;
                value = value * u + c;
            }
            (*offset, *tangent) = (value * u, (slope * u + value) / self.length_mm);
        }
        (offset, tangent)
    }

    /// Second to fourth derivative by arc length at u = s/length.
    pub(crate) fn second_to_fourth<T: Lanes>(&self, u: T) -> [[T; N]; 3] {
        let per_mm = 1.0 / self.length_mm;
        let mut derivatives = [[T::of(0.0); N]; 3];
        let mut per_power = per_mm;
        for (index, (derivative, factors)) in derivatives.iter_mut().zip(&FACTORS).enumerate() {
            per_power *= per_mm;
            for (component, coefficients) in derivative.iter_mut().zip(&self.coefficients) {
                let mut sum = T::of(0.0);
                for power in (index + 1..coefficients.len()).rev() {
                    sum = sum * u + T::of(coefficients[power] * factors[power]);
                }
                *component = sum * T::of(per_power);
            }
        }
        derivatives
    }
}
