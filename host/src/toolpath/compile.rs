//! Elements to pieces.
//!
//! Positions along the path are rounded once, cumulatively, so that both streams measure the same
//! length whatever the number of pieces.

use motion_kernel::num::Real;
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::program::Item;
use motion_kernel::program::compact::{continued, direction, line_end, piece, turned};
use motion_kernel::units::Position;

use super::element::Element;
use super::septic::{FitError, Septic, between};
use super::{Vector, add, scale, subtract};

/// The shortest piece that is sure to advance the path position, which goes in steps of 2⁻³² mm and is
/// added up in f64 to a kilometre: two steps, rounded up \[mm\].
const PIECE_MM_MIN: f64 = 5.0e-10;

/// Why an element can't be made into pieces. Displays as "…, expected …".
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CompileError {
    /// A piece of it does not advance the path position.
    #[error(
        "a piece of {length_mm:.2e} mm, expected at least {PIECE_MM_MIN:e} mm: a short line is one piece, an arc \
         has one every 45°"
    )]
    TooShort {
        /// The piece's length \[mm\].
        length_mm: f64,
    },
    /// The element leaves the space that the kernel has positions for.
    #[error("a path through {mm} of axis {axis}, expected coordinates within ±{}", Position::LIMIT_MM)]
    Coordinate {
        /// The axis, by its place from 0.
        axis: usize,
        /// The coordinate \[mm, ° of a rotary axis\].
        mm: f64,
    },
    /// The stretch it ends is longer than path positions reach.
    #[error(
        "{length_mm} mm of path without a full stop, expected at most {} mm between two full stops",
        Position::LIMIT_MM
    )]
    StretchTooLong {
        /// The length from the stretch's start to the element's end \[mm\].
        length_mm: f64,
    },
    /// The element is not smooth.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The kernel would not take the piece.
    #[error("a piece with {}", unfit(.0))]
    Piece(#[from] PieceError),
}

/// The problem of a piece, and what was expected.
fn unfit(error: &PieceError) -> String {
    match error {
        PieceError::NotFinite { .. } => format!("{error}, expected a unit vector"),
        _ => error.to_string(),
    }
}

/// The path position of `mm` of a stretch.
///
/// # Errors
/// The stretch is too long.
pub fn on_path(mm: f64) -> Result<Position, CompileError> {
    Position::from_mm(mm).ok_or(CompileError::StretchTooLong { length_mm: mm })
}

/// `point` in the kernel's positions.
///
/// # Errors
/// A coordinate lies too far out.
pub fn exact<const N: usize>(point: Vector<N>) -> Result<[Position; N], CompileError> {
    let mut exact = [Position::ZERO; N];
    for (axis, (exact, mm)) in exact.iter_mut().zip(point).enumerate() {
        *exact = Position::from_mm(mm).ok_or(CompileError::Coordinate { axis, mm })?;
    }
    Ok(exact)
}

/// A piece of path with its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed<const N: usize = 3> {
    /// The piece's length.
    pub length: Position,
    /// The piece.
    pub item: Item<N>,
}

/// Longest piece that the number type `R` is sure to take \[mm\].
fn longest_mm<R: Real>() -> f64 {
    R::PIECE_MM_MAX * (1.0 - 1e-9)
}

/// The curved pieces of `element` for the number type `R`, with how far each is from the curve; none of a
/// line.
///
/// # Errors
/// The element is not smooth.
pub fn septics<R: Real, const N: usize>(element: &Element<N>) -> Result<Vec<Septic<N>>, FitError> {
    element.septics(longest_mm::<R>())
}

/// Appends the pieces of `element`, which starts at `start_mm` of the stretch, to `pieces`, cut for the
/// number type `R`; returns where it ends on the path. `line` is the program line.
///
/// # Errors
/// The element is too short, too far out, ends too far along the stretch, is not smooth, or makes a piece
/// that the kernel refuses.
pub fn compile<R: Real, const N: usize>(
    element: &Element<N>,
    line: u32,
    start_mm: f64,
    pieces: &mut Vec<Placed<N>>,
) -> Result<f64, CompileError> {
    let length_mm = element.length_mm();
    let end_mm = start_mm + length_mm;
    let (from, to) = element.ends_mm();
    let longest_mm = longest_mm::<R>();
    let mut here = on_path(start_mm)?;
    let mut length_to = |mm: f64, length_mm: f64| -> Result<Position, CompileError> {
        let next = on_path(mm)?;
        let length = next - here;
        here = next;
        if length > Position::ZERO { Ok(length) } else { Err(CompileError::TooShort { length_mm }) }
    };
    if matches!(element, Element::Line { .. }) {
        let parts = (length_mm / longest_mm).ceil().max(1.0) as u64;
        let along = |part: u64| exact(add(from, scale(subtract(to, from), part as f64 / parts as f64)));
        let mut start = along(0)?;
        let direction = line_direction(start, along(1)?, length_mm / parts as f64)
            .unwrap_or_else(|| scale(subtract(to, from), 1.0 / length_mm));
        for part in 0..parts {
            let part_end_mm = if part + 1 == parts {
                end_mm
            } else {
                start_mm + length_mm * ((part + 1) as f64 / parts as f64)
            };
            let length = length_to(part_end_mm, length_mm / parts as f64)?;
            // What the number type cannot hold is refused here.
            Piece::<R, N>::line(line, start, direction, length)?;
            pieces.push(Placed { length, item: Item::Line { line, start, direction, length } });
            start = near(line_end(start, &direction, length), along(part + 1)?);
        }
        return Ok(end_mm);
    }
    let septics = septics::<R, N>(element)?;
    let mut gone_mm = 0.0;
    for (index, septic) in septics.iter().enumerate() {
        gone_mm += septic.length_mm;
        let part_end_mm = if index + 1 == septics.len() { end_mm } else { start_mm + gone_mm };
        let length = length_to(part_end_mm, septic.length_mm)?;
        let start = exact(add(from, septic.start))?;
        let wanted = septic.coefficients.map(|axis| axis.map(|mm| mm / septic.length_mm));
        let (start, coefficients) = short(pieces.last(), start, wanted, length, index + 1 < septics.len());
        Piece::<R, N>::septic(line, start, coefficients, length)?;
        pieces.push(Placed { length, item: Item::Septic { line, start, coefficients, length } });
    }
    Ok(end_mm)
}

/// A piece starts where its predecessor ends, which takes fewest bytes, if that is this near to where it should start
/// \[mm\]; so gaps do not add up.
const NEAR_MM: f64 = 1.0e-9;
/// How far its end may be from where its length leads along the curve \[mm\].
const END_MM: f64 = 1.0e-9;

/// `end`, if that is near `start`.
fn near<const N: usize>(end: [Position; N], start: [Position; N]) -> [Position; N] {
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
    let more = (BENT / third).log2().max(0.0);
    (more <= f64::from(most - least)).then(|| least + 2 * (0.5 * more).ceil() as i32)
}

/// A piece near one with these coefficients from `start`, that takes fewer bytes after the one before.
fn short<const N: usize>(
    before: Option<&Placed<N>>,
    start: [Position; N],
    wanted: [[f64; 7]; N],
    length: Position,
    is_followed: bool,
) -> ([Position; N], [[f64; 7]; N]) {
    let Some(bits) = grid_bits(&wanted) else { return (start, wanted) };
    let near_part = f64::exp2(f64::from(GRID_BITS[0] - bits));
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
    let steps = f64::exp2(f64::from(bits));
    // Without the sign of a zero.
    (coefficient * steps).round() / steps + 0.0
}

/// Lines shorter than this have a direction of their own \[mm\].
const DIRECTION_MM_MIN: f64 = 1.0e-3;

fn line_direction<const N: usize>(
    start: [Position; N],
    end: [Position; N],
    length_mm: f64,
) -> Option<[f64; N]> {
    let mut offset = end;
    offset.iter_mut().zip(start).for_each(|(end, start)| *end = *end - start);
    (length_mm >= DIRECTION_MM_MIN).then(|| direction(offset).0)
}
