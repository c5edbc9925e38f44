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
//!   [`blend`]: one corner's septic blend, [`easement`]: a kink spread over the ends of both sides, [`merge`]: short
//!   lines to fewer lines and arcs, and `dense`: runs
//!   of short lines and arcs to curves, by
//!   [`fairing`]: the curve that bends least within a tolerance;
//! - `spline_ends`: programmed curves that meet at a kink;
//! - [`septic`]: curves to pieces of degree seven in arc length, with checked error;
//! - [`greatest`]: how curves and their pieces bend at their tightest;
//! - [`speeds`]: the speeds of the axes on an element, and what feed a program allows along it;
//! - `lanes`: numbers four at once;
//! - [`subspace`]: what moves in few coordinates, in these;
//! - [`mod@compile`]: elements to pieces over exact path positions.
//!
//! **Space.** All geometry is in the machine's space of `N` axes, in the order of the machine file. Rotary axes count
//! degrees there, and a degree is as long as a millimetre: in lengths along the path, in curvatures and in tolerances. So
//! a path that may be led 0.01 mm past a corner may turn 0.01° past it; all coordinates together keep the tolerance.

pub mod blend;
pub mod compile;
pub mod curve;
mod dense;
pub mod easement;
pub mod element;
pub mod fairing;
pub mod greatest;
pub mod involute;
mod lanes;
pub mod merge;
pub mod polynomial;
pub mod rational;
pub mod septic;
mod short;
pub mod smooth;
pub mod speeds;
pub mod spline;
pub(crate) mod spline_ends;
pub mod subspace;

pub use compile::{CompileError, Placed, compile, exact, on_path, septics};
pub(crate) use element::from_xyz;
pub use element::{Element, NoAxis, Role};
pub use greatest::Greatest;
pub use involute::Involute;
pub(crate) use lanes::Lanes;
pub use polynomial::Polynomial;
pub use speeds::{Feeds, SpeedRatios};

/// A point or a vector of a machine's space: a coordinate for each of its axes, in their order \[mm\].
pub type Vector<const N: usize = 3> = [f64; N];

// Loops, not `from_fn` and `map`: these are not inlined in a build without optimisation across units, and most of the time of
// planning goes into them then.

#[inline]
pub(crate) fn add<T: Lanes, const N: usize>(mut a: [T; N], b: [T; N]) -> [T; N] {
    for (a, &b) in a.iter_mut().zip(&b) {
        *a += b;
    }
    a
}

#[inline]
pub(crate) fn subtract<T: Lanes, const N: usize>(mut a: [T; N], b: [T; N]) -> [T; N] {
    for (a, &b) in a.iter_mut().zip(&b) {
        *a -= b;
    }
    a
}

#[inline]
pub(crate) fn scale<T: Lanes, const N: usize>(mut a: [T; N], factor: T) -> [T; N] {
    for component in &mut a {
        *component *= factor;
    }
    a
}

#[inline]
pub(crate) fn dot<T: Lanes, const N: usize>(a: [T; N], b: [T; N]) -> T {
    let mut sum = a[0] * b[0];
    for axis in 1..N {
        sum += a[axis] * b[axis];
    }
    sum
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub(crate) fn norm<T: Lanes, const N: usize>(a: [T; N]) -> T {
    dot(a, a).sqrt()
}

/// The area that two vectors span, |a|·|b|·sin of their angle: of three coordinates the norm of the cross product.
fn area<const N: usize>(a: Vector<N>, b: Vector<N>) -> f64 {
    let mut square = 0.0;
    for low in (0..N).rev() {
        for high in (low + 1..N).rev() {
            let part = a[low] * b[high] - a[high] * b[low];
            square += part * part;
        }
    }
    square.sqrt()
}

/// The angle between two directions \[rad\], precise for small ones too.
pub(crate) fn angle<const N: usize>(a: Vector<N>, b: Vector<N>) -> f64 {
    libm::atan2(area(a, b), dot(a, b))
}
