//! Pieces with figures that take few bytes.
//!
//! A compiled program has a piece as what differs from what the piece before it lets expect
//! ([`compact`](motion_kernel::program::compact)). So figures that rounding leaves open are made as expected: where a piece starts,
//! how a curve goes on, the pieces of an arc. What is left is rounded as finely as its derivatives need.

use motion_kernel::program::compact::{continued, direction, piece, turned};
use motion_kernel::units::Position;

use super::compile::Placed;
use super::septic::between;

/// A piece starts where its predecessor ends, which takes fewest bytes, if that is this near to where it should start
/// \[mm\]; so gaps do not add up.
const NEAR_MM: f64 = 1.0e-9;
/// How far its end may be from where its length leads along the curve \[mm\].
const END_MM: f64 = 1.0e-9;

/// `end`, if that is near `start`.
pub(super) fn near<const N: usize>(end: [Position; N], start: [Position; N]) -> [Position; N] {
    let is_near = end.iter().zip(start).all(|(&end, start)| (end - start).to_mm().abs() <= NEAR_MM);
    if is_near { end } else { start }
}

/// Bits of coefficients after the point: at least, at most, and how many more for a piece that may be turned on, whose
/// rounding adds up. A piece that asks for more keeps its coefficients as they are.
const GRID_BITS: [i32; 2] = [36, 44];
const TURNED_GRID_BITS: i32 = 2;
/// The third derivative, as a part of the length, down to which the least bits do: coefficients are good to 10⁻⁸ of it.
const BENT: f64 = 1.5e-3;
/// How far a piece's q₁ … q₃ may be from the curve's, and those with which the next would go on, with the least bits.
const NEAR: [f64; 3] = [6.0e-10, 3.0e-10, 1.5e-9];

/// The bits for a piece: more for one that bends little, whose jerk is small.
fn grid_bits<const N: usize>(wanted: &[[f64; 7]; N]) -> Option<i32> {
    let thirds = wanted.iter().flat_map(|axis| [axis[2], at_end(axis)[3]]);
    let third = thirds.fold(0.0, |most, third| f64::max(most, 6.0 * third.abs()));
    let [least, most] = GRID_BITS;
    let more = libm::log2(BENT / third).max(0.0);
    (more <= f64::from(most - least)).then(|| least + 2 * (0.5 * more).ceil() as i32)
}

/// A piece near one with these coefficients from `start`, that takes fewer bytes after the one before.
pub(super) fn short<const N: usize>(
    before: Option<&Placed<N>>,
    start: [Position; N],
    wanted: [[f64; 7]; N],
    length: Position,
    is_followed: bool,
) -> ([Position; N], [[f64; 7]; N]) {
    let Some(bits) = grid_bits(&wanted) else { return (start, wanted) };
    let near_part = libm::exp2(f64::from(GRID_BITS[0] - bits));
    let first_bits = if is_followed { (bits + TURNED_GRID_BITS).min(GRID_BITS[1]) } else { bits };
    let Some((end, before, length_before)) = before.and_then(|before| piece(&before.item)) else {
        return (start, rounded(&wanted, first_bits));
    };
    let start = near(end, start);
    let turned = turned(&before);
    if is_near(&turned, &wanted, length, near_part) {
        return (start, turned);
    }
    let on = continued(&before, length_before, length);
    // Its end stays as far from its start, and so does how it goes on.
    let coefficients = core::array::from_fn(|axis| {
        let [q1, q2, q3] = on[axis];
        let [rise, first, second, third] = at_end(&wanted[axis]);
        let to = [first, 2.0 * second, 6.0 * third];
        let [_, _, _, upper @ ..] = between(rise, [q1, 2.0 * q2, 6.0 * q3], to);
        let [q4, q5, q6, q7] = upper.map(|coefficient| on_grid(coefficient, bits));
        [q1, q2, q3, q4, q5, q6, q7]
    });
    if is_near(&coefficients, &wanted, length, near_part) {
        return (start, coefficients);
    }
    (start, rounded(&wanted, first_bits))
}

/// Whether a piece starts and ends as `wanted`, within a part of [`NEAR`].
fn is_near<const N: usize>(
    found: &[[f64; 7]; N],
    wanted: &[[f64; 7]; N],
    length: Position,
    part: f64,
) -> bool {
    found.iter().zip(wanted).all(|(found, wanted)| {
        let [rise, ends @ ..] = at_end(found);
        let [wanted_rise, wanted_ends @ ..] = at_end(wanted);
        let is_near = |(found, wanted): (&[f64], &[f64])| {
            found
                .iter()
                .zip(wanted)
                .zip(NEAR)
                .all(|((found, wanted), most)| (found - wanted).abs() <= part * most)
        };
        (rise - wanted_rise).abs() <= (part * NEAR[0]).min(END_MM / length.to_mm())
            && [(&found[..3], &wanted[..3]), (&ends, &wanted_ends)].into_iter().all(is_near)
    })
}

fn rounded<const N: usize>(wanted: &[[f64; 7]; N], bits: i32) -> [[f64; 7]; N] {
    wanted.map(|axis| axis.map(|coefficient| on_grid(coefficient, bits)))
}

/// The value at 1, and q₁ … q₃ with which a polynomial goes on from there.
fn at_end(coefficients: &[f64; 7]) -> [f64; 4] {
    let mut at_end = [0.0; 4];
    for (k, coefficient) in (1_u8..).zip(coefficients) {
        // Binomial coefficients.
        let mut part = *coefficient;
        for (order, sum) in (0_u8..).zip(&mut at_end) {
            *sum += part;
            part *= (f64::from(k) - f64::from(order)) / f64::from(order + 1);
        }
    }
    at_end
}

fn on_grid(coefficient: f64, bits: i32) -> f64 {
    let steps = libm::exp2(f64::from(bits));
    // Without the sign of a zero.
    (coefficient * steps).round() / steps + 0.0
}

/// Lines shorter than this have a direction of their own \[mm\].
const DIRECTION_MM_MIN: f64 = 1.0e-3;

/// The direction of a line of `length_mm` from its ends in position steps; none of one that these turn too far.
pub(super) fn line_direction<const N: usize>(
    start: [Position; N],
    end: [Position; N],
    length_mm: f64,
) -> Option<[f64; N]> {
    let mut offset = end;
    offset.iter_mut().zip(start).for_each(|(end, start)| *end = *end - start);
    (length_mm >= DIRECTION_MM_MIN).then(|| direction(offset).0)
}
