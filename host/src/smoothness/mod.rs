//! S2's experiment: what the degree of a path's curves does to the axes.
//!
//! Two quarter circles, radius 10 and then 8 mm, S2 (6), are run through at 56.5 mm/s; the axes' acceleration
//! steps where the radius does. Ten points of them (S2's table 1) are then interpolated by a cubic and by a
//! quintic spline. With the cubic one the jerk steps at the knots, with the quintic one it is continuous.
//!
//! All is computed here, off-line and in f64: arc length by quadrature, derivatives by arc length from those
//! by the parameter, and the differences over ticks that S2 (7) plots. The ends of the splines are clamped to
//! the arcs' derivatives by u, which S2 does not say; free ends change the figures a little and the
//! conclusion not at all.
//!
//! The honest statement is "a continuous third derivative": a quartic spline has one too, and the quintic is
//! the practical odd degree.
//!
//! - [`mod@course`]: a path at constant feed, tick by tick;
//! - [`figures`]: what is read off it;
//! - [`mod@evaluators`]: how constant the feed is that a control makes of a curve over u.

pub mod course;
pub mod evaluators;
pub mod figures;

pub use course::{AxisTicks, Course, JunctionStep};
pub use evaluators::{Evaluator, evaluators};
pub use figures::Figures;

use core::f64::consts::{FRAC_PI_2, PI};

use crate::toolpath::curve::Spiral;
use crate::toolpath::spline::{Degree, Derivatives, Ends, Spline, SplineError, interpolate};
use crate::toolpath::{Element, Vector};

/// The feed, F \[mm/s\].
pub const FEED_MM_S: f64 = 56.5;
/// The control tick, τ \[s\].
pub const TICK_S: f64 = 0.001;
/// Radii of the two arcs \[mm\].
pub const RADII_MM: [f64; 2] = [10.0, 8.0];
/// The height at which the second arc has its centre \[mm\]; the first one has it in the origin.
pub const SECOND_CENTRE_Y_MM: f64 = 2.0;

/// Table 1: u, X and Y \[mm\], as printed. The last u is missing there; 1 is where the arcs end.
pub const TABLE_1: [(f64, f64, f64); 10] = [
    (0.0, -10.0, 0.0),
    (0.1, -9.511, 3.09),
    (0.2, -8.09, 5.878),
    (0.3, -5.878, 8.09),
    (0.4, -3.09, 9.511),
    (0.5, 0.0, 10.0),
    (0.625, 3.062, 9.391),
    (0.75, 5.657, 7.657),
    (0.875, 7.391, 5.062),
    (1.0, 8.0, 2.0),
];

/// Table 2: when the inner points are passed, as printed \[s\]. No curve through the points that is run
/// through at constant feed passes all of them then: five equal chords from the start take equal times, 55.6
/// ms each, to 0.278 s.
pub const TABLE_2_S: [f64; 8] = [0.055, 0.11, 0.165, 0.222, 0.279, 0.336, 0.393, 0.448];

/// The two arcs.
#[must_use]
pub fn arcs() -> Course {
    let arc = |radius_mm: f64, centre_y_mm: f64, outward: Vector, onward: Vector| {
        let at = |direction: Vector| [direction[0] * radius_mm, direction[1] * radius_mm + centre_y_mm, 0.0];
        let shape = Spiral { outward, onward, radius_mm, radius_per_rad: 0.0, across_per_rad: [0.0; 3] };
        Element::Arc { from: at(outward), to: at(onward), shape, sweep_rad: FRAC_PI_2 }
    };
    let (left, up, right) = ([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    Course::new("arcs", [arc(RADII_MM[0], 0.0, left, up), arc(RADII_MM[1], SECOND_CENTRE_Y_MM, up, right)])
}

/// The spline through table 1.
///
/// # Errors
/// None: the table has a spline.
pub fn spline(degree: Degree) -> Result<Spline, SplineError> {
    let points = TABLE_1.map(|(_, x, y)| [x, y, 0.0]);
    let parameters = TABLE_1.map(|(u, _, _)| u);
    interpolate(&points, &parameters, degree, &Ends::Clamped(end_derivatives()))
}

/// Splines that evaluators are compared on: the quintic one, and one through the same points over a u that
/// grows by steps of four and five in turn, which is run through at a speed that goes up and down.
///
/// # Errors
/// None: the points have both.
pub fn well_and_badly_parametrised() -> Result<[Course; 2], SplineError> {
    let points = TABLE_1.map(|(_, x, y)| [x, y, 0.0]);
    let uneven: Vec<f64> = (0..TABLE_1.len()).map(|index| (9 * index / 2) as f64).collect();
    // The same tangents and curvatures at the ends, by the new parameter: its first and its last step are
    // four.
    let [first, last] = end_derivatives();
    let over = |Derivatives { first, second }: Derivatives, rate: f64| Derivatives {
        first: first.map(|mm| mm * rate),
        second: second.map(|mm| mm * rate * rate),
    };
    let ends = Ends::Clamped([over(first, 0.1 / 4.0), over(last, 0.125 / 4.0)]);
    let bad = interpolate(&points, &uneven, Degree::Quintic, &ends)?;
    Ok([course(&spline(Degree::Quintic)?), course(&bad)])
}

/// The arcs' derivatives by u at their ends: the angle is π·u.
fn end_derivatives() -> [Derivatives; 2] {
    let [first_mm, last_mm] = RADII_MM;
    [
        Derivatives { first: [0.0, PI * first_mm, 0.0], second: [PI * PI * first_mm, 0.0, 0.0] },
        Derivatives { first: [0.0, -PI * last_mm, 0.0], second: [-PI * PI * last_mm, 0.0, 0.0] },
    ]
}

/// The spline's path.
#[must_use]
pub fn course(spline: &Spline) -> Course {
    let name = match spline.degree() {
        Degree::Cubic => "cubic spline",
        Degree::Quintic => "quintic spline",
    };
    Course::new(name, spline.elements().map(|(_, element)| element))
}

/// Arcs, cubic and quintic spline.
///
/// # Errors
/// None: the table has both splines.
pub fn courses() -> Result<[Course; 3], SplineError> {
    Ok([arcs(), course(&spline(Degree::Cubic)?), course(&spline(Degree::Quintic)?)])
}

/// Distance of a point from the arcs \[mm\].
#[must_use]
pub fn deviation_mm(point: Vector) -> f64 {
    let [x, y, _] = point;
    if x < 0.0 {
        (libm::hypot(x, y) - RADII_MM[0]).abs()
    } else {
        (libm::hypot(x, y - SECOND_CENTRE_Y_MM) - RADII_MM[1]).abs()
    }
}
