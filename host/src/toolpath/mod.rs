//! Geometry of the programmed path: from moves to pieces of arc length.
//!
//! Consumes lines and arcs as the G-code reader gives them; produces [`Piece`](motion_kernel::path::Piece)s
//! and what planning needs to know of each block's geometry. Background, f64; angles by libm and roots by the
//! standard library, so that every host computes the same bits.
//!
//! - [`element`]: lines, arcs, helices, spirals, polynomials, involutes: length, tangents, curvature, bend;
//! - [`polynomial`]: curves of degree seven, which blends and splines are;
//! - [`involute`]: involutes of circles and their offsets;
//! - [`spline`]: splines through points, or close to them;
//! - [`rational`]: NURBS, span by span;
//! - [`curve`]: derivatives of a curve by its parameter and by arc length;
//! - [`smooth`]: a run of elements with the blend of each of its junctions, by
//!   [`blend`]: one corner's septic blend, [`merge`]: short lines to fewer lines and arcs, and `dense`: runs
//!   of short lines and arcs to curves, by
//!   [`fairing`]: the curve that bends least within a tolerance;
//! - [`septic`]: curves to pieces of degree seven in arc length, with checked error;
//! - [`greatest`]: how curves and their pieces bend at their tightest;
//! - [`mod@compile`]: elements to pieces over exact path positions.

pub mod blend;
pub mod compile;
pub mod curve;
mod dense;
pub mod element;
pub mod fairing;
pub mod greatest;
pub mod involute;
pub mod merge;
pub mod polynomial;
pub mod rational;
pub mod septic;
pub mod smooth;
pub mod spline;

pub use compile::{CompileError, Placed, compile, exact, on_path, septics};
pub use element::{Element, Role};
pub use greatest::Greatest;
pub use involute::Involute;
pub use polynomial::Polynomial;

/// A point or a vector, X Y Z \[mm\].
pub type Vector = [f64; 3];

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|component| component * factor)
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The angle between two directions \[rad\], precise for small ones too.
pub(crate) fn angle(a: Vector, b: Vector) -> f64 {
    libm::atan2(norm(cross(a, b)), dot(a, b))
}
