//! Elements to pieces.
//!
//! Positions along the path are rounded once, cumulatively, so that both streams measure the same
//! length whatever the number of pieces.

use motion_kernel::num::Real;
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::units::Position;

use super::element::Element;
use super::septic::{FitError, fit};
use super::{Vector, add, scale, subtract};

/// Widest piece of an arc \[rad\]: 45°, where septic pieces are 1.4·10⁻⁸ of the radius off.
const WIDEST_RAD: f64 = core::f64::consts::FRAC_PI_4;

/// Why an element can't be made into pieces.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CompileError {
    /// It is too short or too far out for the path's positions.
    #[error("a move of {length_mm} mm to ({}, {}, {}) mm: expected at least 1e-9 mm, within ±1e6 mm", at_mm[0], at_mm[1], at_mm[2])]
    OutOfRange {
        /// Its length \[mm\].
        length_mm: f64,
        /// Its end \[mm\].
        at_mm: Vector,
    },
    /// It is not smooth.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The kernel would not take the piece.
    #[error("a piece the kernel can't execute: {0}")]
    Piece(#[from] PieceError),
}

/// Appends the pieces of `element`, which starts at `start_mm` of the stretch, to `pieces`; returns
/// where it ends on the path. `line` is the program line.
///
/// # Errors
/// The element is out of range, not smooth, or makes a piece that the kernel refuses.
pub fn compile<R: Real>(
    element: &Element,
    line: u32,
    start_mm: f64,
    pieces: &mut Vec<Piece<R, 3>>,
) -> Result<f64, CompileError> {
    let length_mm = element.length_mm();
    let end_mm = start_mm + length_mm;
    let (from, to) = element.ends_mm();
    let out_of_range = CompileError::OutOfRange { length_mm, at_mm: to };
    let on_path = |mm: f64| Position::from_mm(mm).ok_or(out_of_range);
    let point = |at: Vector| -> Result<[Position; 3], CompileError> {
        Ok([on_path(at[0])?, on_path(at[1])?, on_path(at[2])?])
    };
    let longest_mm = R::PIECE_MM_MAX * (1.0 - 1e-9);
    let mut here = on_path(start_mm)?;
    let mut length_to = |mm: f64| -> Result<Position, CompileError> {
        let next = on_path(mm)?;
        let length = next - here;
        here = next;
        if length > Position::ZERO { Ok(length) } else { Err(out_of_range) }
    };
    match element {
        Element::Line { .. } => {
            let direction = scale(subtract(to, from), 1.0 / length_mm);
            let parts = (length_mm / longest_mm).ceil().max(1.0) as u64;
            for part in 0..parts {
                let (a, b) = (part as f64 / parts as f64, (part + 1) as f64 / parts as f64);
                let start = point(add(from, scale(subtract(to, from), a)))?;
                let length = length_to(if part + 1 == parts { end_mm } else { start_mm + length_mm * b })?;
                pieces.push(Piece::line(line, start, direction, length)?);
            }
        }
        Element::Arc { shape, sweep_rad, .. } => {
            use super::curve::Curve;
            let septics = fit(shape, 0.0, *sweep_rad, WIDEST_RAD, longest_mm)?;
            let (mut gone_mm, count) = (0.0, septics.len());
            for (index, septic) in septics.iter().enumerate() {
                let start = point(add(from, shape.offset(0.0, septic.span.0)))?;
                gone_mm += septic.length_mm;
                let length = length_to(if index + 1 == count { end_mm } else { start_mm + gone_mm })?;
                pieces.push(Piece::septic(line, start, septic.coefficients, length)?);
            }
        }
    }
    Ok(end_mm)
}
