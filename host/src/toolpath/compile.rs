//! Elements to pieces.
//!
//! Positions along the path are rounded once, cumulatively, so that both streams measure the same
//! length whatever the number of pieces.

use motion_kernel::num::Real;
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::program::Item;
use motion_kernel::program::compact::line_end;
use motion_kernel::units::Position;

use super::element::Element;
use super::septic::{FitError, Septic};
use super::short::{line_direction, near, short};
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
