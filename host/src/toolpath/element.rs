//! Blocks of path with one geometry: lines, arcs with all that goes by that name in G-code, polynomials and
//! involutes.

use motion_kernel::plan::Bend;

use super::curve::{Curve, Spiral, by_arc_length};
use super::greatest::Greatest;
use super::involute::Involute;
use super::polynomial::Polynomial;
use super::septic::{FitError, Septic, fit};
use super::{Vector, add, cross, dot, norm, scale, subtract};
use crate::gcode::{ArcMove, Axis, LineMove, turn_sin_cos, xyz_mm};
use crate::machine::Machine;

/// Widest piece of an arc or an involute \[rad\]: 45°, where septic pieces are 1.4·10⁻⁸ of the radius off,
/// and their third derivative 2·10⁻⁵ of itself.
const WIDEST_RAD: f64 = core::f64::consts::FRAC_PI_4;

/// A block's geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element<const N: usize = 3> {
    /// A straight line.
    Line {
        /// Start \[mm\].
        from: Vector<N>,
        /// End \[mm\].
        to: Vector<N>,
    },
    /// An arc, helix or spiral.
    Arc {
        /// Start \[mm\].
        from: Vector<N>,
        /// End \[mm\].
        to: Vector<N>,
        /// The arc's shape; the angle counts from the start.
        shape: Spiral<N>,
        /// The angle run through \[rad\], > 0.
        sweep_rad: f64,
    },
    /// A polynomial.
    Polynomial {
        /// Start \[mm\].
        from: Vector<N>,
        /// End \[mm\].
        to: Vector<N>,
        /// The polynomial's shape, from the start.
        shape: Polynomial<N>,
        /// The purpose.
        role: Role,
    },
    /// A part of an involute.
    Involute {
        /// Start \[mm\].
        from: Vector<N>,
        /// End \[mm\].
        to: Vector<N>,
        /// The involute's shape.
        shape: Involute<N>,
    },
}

/// The purpose of a polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The polynomial rounds a corner.
    Blend,
    /// The polynomial was programmed.
    Spline,
    /// The polynomial stands for short lines and arcs.
    Curve,
}

/// Tangent and curvature vector at an end of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End<const N: usize = 3> {
    /// Unit tangent.
    pub tangent: Vector<N>,
    /// κN \[1/mm\].
    pub curvature: Vector<N>,
}

impl<const N: usize> End<N> {
    fn of(curve: &impl Curve<N>, parameter: f64) -> Self {
        let [tangent, curvature, _] = by_arc_length(curve.derivatives(parameter));
        Self { tangent, curvature }
    }
}

/// The machine lacks an axis that a curve needs. Displays as "…, expected …".
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a curve in a plane of {0}, expected a plane whose axes the machine has")]
pub struct NoAxis(pub Axis);

/// A vector of X, Y and Z in a machine's space.
pub(crate) fn from_xyz<const N: usize>(xyz: Vector, machine: &Machine<N>) -> Result<Vector<N>, NoAxis> {
    let mut vector = [0.0; N];
    for (letter, component) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(xyz) {
        match machine.place_of(letter) {
            Some(place) => vector[place] = component,
            None if component == 0.0 => {}
            None => return Err(NoAxis(letter)),
        }
    }
    Ok(vector)
}

impl<const N: usize> Element<N> {
    /// The line of a move of a machine.
    #[must_use]
    pub fn line(step: &LineMove, machine: &Machine<N>) -> Self {
        Self::Line { from: machine.coordinates(step.from), to: machine.coordinates(step.to) }
    }

    /// The arc of a move of a machine. Axes besides the plane's go linearly with the angle.
    ///
    /// # Errors
    /// The machine has no such plane.
    pub fn arc(step: &ArcMove, machine: &Machine<N>) -> Result<Self, NoAxis> {
        // In X, Y and Z first, whatever the order of the machine's axes.
        let (start, end) = (xyz_mm(step.from), xyz_mm(step.to));
        let [first, second, normal] = step.plane.axes();
        let (sine, cosine) = turn_sin_cos(step.turn_deg);
        let axis = |index: usize| match index {
            0 => [cosine, sine, 0.0],
            1 => [-sine, cosine, 0.0],
            _ => [0.0, 0.0, 1.0],
        };
        let radius_mm = step.start_radius_mm;
        let (x, y) = (
            (dot(start, axis(first)) - step.centre_mm[0]) / radius_mm,
            (dot(start, axis(second)) - step.centre_mm[1]) / radius_mm,
        );
        let outward = add(scale(axis(first), x), scale(axis(second), y));
        let along = cross(axis(normal), outward);
        let sweep_rad = step.sweep_rad.abs();
        let height_per_rad = dot(subtract(end, start), axis(normal)) / sweep_rad;
        let (from, to) = (machine.coordinates(step.from), machine.coordinates(step.to));
        let mut across_per_rad = from_xyz(scale(axis(normal), height_per_rad), machine)?;
        for (place, axis) in machine.axes.iter().enumerate() {
            if !matches!(axis.letter, Some(Axis::X | Axis::Y | Axis::Z)) {
                across_per_rad[place] = (to[place] - from[place]) / sweep_rad;
            }
        }
        let shape = Spiral {
            outward: from_xyz(outward, machine)?,
            onward: from_xyz(if step.sweep_rad < 0.0 { scale(along, -1.0) } else { along }, machine)?,
            radius_mm,
            radius_per_rad: (step.end_radius_mm - radius_mm) / sweep_rad,
            across_per_rad,
        };
        Ok(Self::Arc { from, to, shape, sweep_rad })
    }

    /// The polynomial `shape` from `from`.
    #[must_use]
    pub fn polynomial(from: Vector<N>, shape: Polynomial<N>, role: Role) -> Self {
        Self::Polynomial { from, to: add(from, shape.chord()), shape, role }
    }

    /// `shape` about a base circle with its centre in `centre`.
    #[must_use]
    pub fn involute(centre: Vector<N>, shape: Involute<N>) -> Self {
        let from = add(centre, shape.start_mm());
        Self::Involute { from, to: add(from, shape.offset(0.0, shape.sweep_rad())), shape }
    }

    /// "line", "arc", "helix", "blend", "curve", "spline" or "involute".
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Line { .. } => "line",
            Self::Arc { shape, .. } if shape.across_per_rad == [0.0; N] => "arc",
            Self::Arc { .. } => "helix",
            Self::Polynomial { role: Role::Blend, .. } => "blend",
            Self::Polynomial { role: Role::Spline, .. } => "spline",
            Self::Polynomial { role: Role::Curve, .. } => "curve",
            Self::Involute { .. } => "involute",
        }
    }

    /// The element's curve and the parameter at its end, 0 at its start; nothing for a line.
    #[must_use]
    pub fn curve(&self) -> Option<(&dyn Curve<N>, f64)> {
        match self {
            Self::Line { .. } => None,
            Self::Arc { shape, sweep_rad, .. } => Some((shape, *sweep_rad)),
            Self::Polynomial { shape, .. } => Some((shape, 1.0)),
            Self::Involute { shape, .. } => Some((shape, shape.sweep_rad())),
        }
    }

    /// What is left of a line or an arc without the first and the last millimetres, on an arc by the speed at
    /// its start and end. Polynomials and involutes stay whole.
    #[must_use]
    pub fn trimmed(&self, first_mm: f64, last_mm: f64) -> Self {
        match *self {
            Self::Line { from, to } => {
                let tangent = self.ends()[0].tangent;
                Self::Line {
                    from: add(from, scale(tangent, first_mm)),
                    to: add(to, scale(scale(tangent, -1.0), last_mm)),
                }
            }
            Self::Arc { from, to, shape, sweep_rad } => {
                let rad_per_mm = |angle| 1.0 / norm(shape.derivatives(angle)[0]);
                let first = rad_per_mm(0.0) * first_mm;
                let last = sweep_rad - rad_per_mm(sweep_rad) * last_mm;
                Self::Arc {
                    from: add(from, shape.offset(0.0, first)),
                    to: add(to, shape.offset(sweep_rad, last)),
                    shape: shape.rotated(first),
                    sweep_rad: last - first,
                }
            }
            Self::Polynomial { .. } | Self::Involute { .. } => *self,
        }
    }

    /// A line or an arc in two, which meet in one point, the first of them `share` of it. Polynomials and
    /// involutes stay whole, twice.
    pub(crate) fn split(&self, share: f64) -> [Self; 2] {
        match *self {
            Self::Line { from, to } => {
                let middle = add(from, scale(subtract(to, from), share));
                [Self::Line { from, to: middle }, Self::Line { from: middle, to }]
            }
            Self::Arc { from, to, shape, sweep_rad } => {
                let angle = sweep_rad * share;
                let middle = add(from, shape.offset(0.0, angle));
                let rest = shape.rotated(angle);
                [
                    Self::Arc { from, to: middle, shape, sweep_rad: angle },
                    Self::Arc { from: middle, to, shape: rest, sweep_rad: sweep_rad - angle },
                ]
            }
            Self::Polynomial { .. } | Self::Involute { .. } => [*self, *self],
        }
    }

    /// The element's start and end \[mm\].
    #[must_use]
    pub fn ends_mm(&self) -> (Vector<N>, Vector<N>) {
        match *self {
            Self::Line { from, to }
            | Self::Arc { from, to, .. }
            | Self::Polynomial { from, to, .. }
            | Self::Involute { from, to, .. } => (from, to),
        }
    }

    /// Arc length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        match self {
            Self::Line { from, to } => norm(subtract(*to, *from)),
            Self::Arc { shape, sweep_rad, .. } => {
                // In eighths of a circle, which the quadrature resolves.
                let parts = (sweep_rad / core::f64::consts::FRAC_PI_4).ceil().max(1.0);
                let at = |part: f64| sweep_rad * part / parts;
                (0..parts as u32).map(|part| shape.length(at(f64::from(part)), at(f64::from(part + 1)))).sum()
            }
            Self::Polynomial { shape, .. } => shape.length(0.0, 1.0),
            Self::Involute { shape, .. } => shape.length(0.0, shape.sweep_rad()),
        }
    }

    /// Which axes move.
    #[must_use]
    pub fn moves(&self) -> [bool; N] {
        match self {
            Self::Line { from, to } => core::array::from_fn(|axis| from[axis] != to[axis]),
            Self::Arc { shape, .. } => {
                let in_plane = shape.in_plane();
                core::array::from_fn(|axis| in_plane[axis] > 0.0 || shape.across_per_rad[axis] != 0.0)
            }
            Self::Polynomial { shape, .. } => {
                core::array::from_fn(|axis| shape.coefficients().iter().any(|of| of[axis] != 0.0))
            }
            Self::Involute { shape, .. } => shape.in_plane().map(|part| part > 0.0),
        }
    }

    /// Tangent and curvature at the start and at the end.
    #[must_use]
    pub fn ends(&self) -> [End<N>; 2] {
        match self {
            Self::Line { from, to } => {
                let tangent = scale(subtract(*to, *from), 1.0 / self.length_mm());
                [End { tangent, curvature: [0.0; N] }; 2]
            }
            Self::Arc { shape, sweep_rad, .. } => [0.0, *sweep_rad].map(|angle| End::of(shape, angle)),
            Self::Polynomial { shape, .. } => [0.0, 1.0].map(|u| End::of(shape, u)),
            Self::Involute { shape, .. } => [0.0, shape.sweep_rad()].map(|u| End::of(shape, u)),
        }
    }

    /// The curved pieces that it is driven as, none longer than `longest_mm`, with how far each is from the
    /// curve; none of a line.
    ///
    /// # Errors
    /// The element is not smooth.
    pub fn septics(&self, longest_mm: f64) -> Result<Vec<Septic<N>>, FitError> {
        let Some((curve, end)) = self.curve() else {
            return Ok(Vec::new());
        };
        let widest = match self {
            Self::Polynomial { .. } => end,
            _ => WIDEST_RAD,
        };
        fit(curve, 0.0, end, widest, longest_mm)
    }

    /// How it bends at its tightest, itself and the pieces that it is driven as, and which axes take part. What
    /// can't be made into pieces is refused elsewhere.
    #[must_use]
    pub fn greatest(&self) -> Greatest<N> {
        self.greatest_driven().unwrap_or_else(|_| self.greatest_itself())
    }

    /// The same; an error if it can't be made into pieces.
    pub(super) fn greatest_driven(&self) -> Result<Greatest<N>, FitError> {
        let itself = self.greatest_itself();
        Ok(match self {
            Self::Line { .. } | Self::Arc { .. } => itself,
            // Its pieces where they are longest.
            _ => itself.driven_as(&self.septics(f64::INFINITY)?),
        })
    }

    /// How it bends at its tightest without regard to the pieces that it is driven as.
    fn greatest_itself(&self) -> Greatest<N> {
        match self {
            Self::Line { .. } => Greatest {
                bend: Bend::default(),
                tangent: self.ends()[0].tangent.map(f64::abs),
                curved: [false; N],
            },
            Self::Arc { shape, sweep_rad, .. } => {
                let radius = shape.radius_mm.min(shape.radius_mm + shape.radius_per_rad * sweep_rad);
                let across = norm(shape.across_per_rad);
                let planar = shape.radius_mm / libm::hypot(shape.radius_mm, across);
                // Conservative for arcs that never run along one of their axes.
                let axial = (1.0 - planar * planar).max(0.0).sqrt();
                let part = shape.in_plane();
                let beside =
                    |axis: usize| if across > 0.0 { shape.across_per_rad[axis].abs() / across } else { 0.0 };
                let of_axis = |axis: usize| planar * part[axis] + axial * beside(axis);
                Greatest {
                    bend: Bend::circle(radius, planar),
                    tangent: core::array::from_fn(|axis| of_axis(axis).min(1.0)),
                    curved: part.map(|part| part > 0.0),
                }
            }
            Self::Polynomial { shape, .. } => shape.greatest(),
            Self::Involute { shape, .. } => shape.greatest(),
        }
    }
}
