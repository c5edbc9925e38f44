//! The speeds of the axes on an element, and the feed that a program allows along it.
//!
//! A program's F is the speed of some axes, not of all: where X, Y or Z moves, that of X, Y and Z together; else, where
//! U, V or W moves, that of these; else that of A, B and C, in degrees per minute. The others go along. So an element is
//! driven at F times its length over the length in the coordinates that count, which is one over the part that they have
//! of its unit tangent. Where that part changes along an element, its greatest value holds: nothing is driven faster
//! than it was programmed.
//!
//! Consumes elements, and the letters of a machine's axes by their places; produces parts of the tangent and feeds along
//! the path.

use super::curve::Curve;
use super::element::Element;
use super::greatest::Peak;
use super::{Vector, dot, norm};
use crate::gcode::{Axis, AxisGroup};

/// The number of parts that a polynomial is cut into to find the greatest part of its tangent.
const PARTS: usize = 64;

/// The greatest speeds of some axes together over the speed along the path, on one element: 1 where nothing else moves,
/// 0 where none of them does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedRatios {
    /// X, Y and Z.
    pub xyz: f64,
    /// U, V and W.
    pub uvw: f64,
    /// A, B and C \[°/mm\].
    pub abc: f64,
    /// All linear axes: X, Y, Z, U, V and W.
    pub linear: f64,
}

impl SpeedRatios {
    /// Those of an element that moves X, Y and Z alone.
    pub const XYZ: Self = Self { xyz: 1.0, uvw: 0.0, abc: 0.0, linear: 1.0 };

    /// Those of an element of a machine with these axes.
    #[must_use]
    pub fn of<const N: usize>(element: &Element<N>, axes: &[Option<Axis>; N]) -> Self {
        let moves = element.moves();
        let groups = axes.map(|axis| axis.map(Axis::group));
        if groups.iter().zip(moves).all(|(&group, moves)| !moves || group == Some(AxisGroup::Xyz)) {
            return Self::XYZ;
        }
        let of = |is_counted: &dyn Fn(AxisGroup) -> bool| {
            let counts = groups.map(|group| group.is_some_and(is_counted));
            greatest_part(element, &moves, &counts)
        };
        Self {
            xyz: of(&|group| group == AxisGroup::Xyz),
            uvw: of(&|group| group == AxisGroup::Uvw),
            abc: of(&|group| group == AxisGroup::Abc),
            linear: of(&|group| group != AxisGroup::Abc),
        }
    }
}

/// The greatest norm of the part of the unit tangent in the coordinates that count.
fn greatest_part<const N: usize>(element: &Element<N>, moves: &[bool; N], counts: &[bool; N]) -> f64 {
    let is_any = |counted: bool| moves.iter().zip(counts).any(|(&moves, &counts)| moves && counts == counted);
    if !is_any(true) {
        return 0.0;
    }
    if !is_any(false) {
        return 1.0;
    }
    let part = |vector: Vector<N>| -> Vector<N> {
        core::array::from_fn(|axis| if counts[axis] { vector[axis] } else { 0.0 })
    };
    let of_tangent = |tangent: Vector<N>| norm(part(tangent)) / norm(tangent);
    let ratio = match element {
        Element::Line { .. } => of_tangent(element.ends()[0].tangent),
        Element::Arc { shape, sweep_rad, .. } => {
            // In the plane the tangent turns through every direction; what is across it stays.
            let in_plane = norm(part(shape.in_plane())).min(1.0);
            let across = norm(part(shape.across_per_rad));
            let at = |radius_mm: f64| {
                let round = radius_mm * radius_mm + shape.radius_per_rad * shape.radius_per_rad;
                let whole = round + dot(shape.across_per_rad, shape.across_per_rad);
                ((round * in_plane * in_plane + across * across) / whole).sqrt()
            };
            at(shape.radius_mm).max(at(shape.radius_mm + shape.radius_per_rad * sweep_rad))
        }
        Element::Polynomial { shape, .. } => {
            let mut peak = Peak::default();
            for index in 0..=PARTS {
                peak.next(of_tangent(shape.derivatives(index as f64 / PARTS as f64)[0]));
            }
            peak.greatest()
        }
        Element::Involute { shape, .. } => norm(part(shape.in_plane())),
    };
    // What is not a number has no ceiling either.
    ratio.min(1.0)
}

/// The greatest speeds of the axes that a program asks for; infinite where it asks for none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feeds {
    /// Of X, Y and Z together \[mm/s\].
    pub xyz_mm_s: f64,
    /// Of U, V and W together \[mm/s\].
    pub uvw_mm_s: f64,
    /// Of A, B and C together \[°/s\].
    pub abc_deg_s: f64,
    /// Of all axes together along the path \[mm/s\]: the axes that do not count go along no faster than on the moves that
    /// were programmed, where what stands for these hardly moves those that count.
    pub path_mm_s: f64,
}

impl Feeds {
    /// Those of a rapid.
    pub const RAPID: Self = Self::xyz(f64::INFINITY);

    /// Of X, Y and Z \[mm/s\].
    #[must_use]
    pub const fn xyz(feed_mm_s: f64) -> Self {
        Self {
            xyz_mm_s: feed_mm_s,
            uvw_mm_s: f64::INFINITY,
            abc_deg_s: f64::INFINITY,
            path_mm_s: f64::INFINITY,
        }
    }

    /// What F means for a move along `element`, of a machine with these axes; `feed_mm_s` in degrees per second where
    /// rotary axes alone move.
    #[must_use]
    pub fn programmed<const N: usize>(
        feed_mm_s: f64,
        element: &Element<N>,
        axes: &[Option<Axis>; N],
    ) -> Self {
        let moves = element.moves();
        let is_moved = |group: AxisGroup| {
            axes.iter().zip(moves).any(|(axis, moves)| moves && axis.map(Axis::group) == Some(group))
        };
        let counted = if is_moved(AxisGroup::Uvw) && !is_moved(AxisGroup::Xyz) {
            Self { uvw_mm_s: feed_mm_s, ..Self::RAPID }
        } else if is_moved(AxisGroup::Abc) && !is_moved(AxisGroup::Xyz) {
            Self { abc_deg_s: feed_mm_s, ..Self::RAPID }
        } else {
            Self::xyz(feed_mm_s)
        };
        Self { path_mm_s: counted.along(&SpeedRatios::of(element, axes)), ..counted }
    }

    /// Whether both ask for the same speeds of the axes that count.
    #[must_use]
    pub fn ask_alike(self, other: Self) -> bool {
        let path_mm_s = self.path_mm_s;
        self == Self { path_mm_s, ..other }
    }

    /// What holds for what stands for both: the smaller speed of each group, and along the path the greater.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        Self {
            xyz_mm_s: self.xyz_mm_s.min(other.xyz_mm_s),
            uvw_mm_s: self.uvw_mm_s.min(other.uvw_mm_s),
            abc_deg_s: self.abc_deg_s.min(other.abc_deg_s),
            path_mm_s: self.path_mm_s.max(other.path_mm_s),
        }
    }

    /// The greatest feed along an element with these ratios at which none of them is exceeded \[mm/s\].
    #[must_use]
    pub fn along(self, ratios: &SpeedRatios) -> f64 {
        let by_xyz = self.xyz_mm_s / ratios.xyz;
        by_xyz.min(self.uvw_mm_s / ratios.uvw).min(self.abc_deg_s / ratios.abc).min(self.path_mm_s)
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::Spiral;
    use super::super::{Polynomial, Role};
    use super::*;

    const AXES: [Option<Axis>; 5] = [Some(Axis::X), Some(Axis::A), Some(Axis::Y), Some(Axis::U), None];

    fn along(feed_mm_s: f64, element: &Element<5>) -> f64 {
        Feeds::programmed(feed_mm_s, element, &AXES).along(&SpeedRatios::of(element, &AXES))
    }

    fn line(to: Vector<5>) -> Element<5> {
        Element::Line { from: [0.0; 5], to }
    }

    /// F times the length over the length that counts.
    #[test]
    fn a_feed_counts_x_y_z_or_else_u_v_w_or_else_degrees() {
        for (to, expected) in [
            ([3.0, 0.0, 4.0, 0.0, 0.0], 10.0),
            ([3.0, 12.0, 4.0, 0.0, 0.0], 10.0 * 13.0 / 5.0),
            ([0.0, 12.0, 5.0, 0.0, 0.0], 10.0 * 13.0 / 5.0),
            ([0.0, 12.0, 0.0, 5.0, 0.0], 10.0 * 13.0 / 5.0),
            ([4.0, 0.0, 0.0, 3.0, 0.0], 10.0 * 5.0 / 4.0),
            ([0.0, 7.0, 0.0, 0.0, 0.0], 10.0),
            ([0.0, 0.0, 0.0, 7.0, 0.0], 10.0),
        ] {
            let found = along(10.0, &line(to));
            assert!((found - expected).abs() < 1e-13 * expected, "{to:?}: {found}, expected {expected}");
            assert_eq!(along(f64::INFINITY, &line(to)), f64::INFINITY);
        }
        // To the last bit where nothing else moves.
        assert_eq!(along(10.0, &line([0.1, 0.0, 0.7, 0.0, 0.0])), 10.0);
        assert_eq!(SpeedRatios::of(&line([0.1, 0.0, 0.7, 0.0, 0.0]), &AXES), SpeedRatios::XYZ);
    }

    /// A helix of 2 mm radius with an A that turns 40° per turn and more: constant along it.
    #[test]
    fn a_helix_with_a_rotary_axis_has_one_ratio() {
        let shape = Spiral {
            outward: [1.0, 0.0, 0.0, 0.0, 0.0],
            onward: [0.0, 0.0, 1.0, 0.0, 0.0],
            radius_mm: 3.0,
            radius_per_rad: 0.0,
            across_per_rad: [0.0, 4.0, 0.0, 0.0, 0.0],
        };
        let helix = Element::Arc { from: [0.0; 5], to: [0.0; 5], shape, sweep_rad: 6.0 };
        let ratios = SpeedRatios::of(&helix, &AXES);
        assert!((ratios.xyz - 0.6).abs() < 1e-15 && (ratios.abc - 0.8).abs() < 1e-15, "{ratios:?}");
        assert_eq!((ratios.linear, ratios.uvw), (ratios.xyz, 0.0));
        assert!((along(6.0, &helix) - 10.0).abs() < 1e-13);
    }

    /// Where the part of what counts changes, the greatest holds.
    #[test]
    fn a_curve_is_nowhere_driven_faster_than_programmed() {
        let mut coefficients = [[0.0; 5]; 7];
        coefficients[0] = [1.0, 5.0, 0.0, 0.0, 0.0];
        coefficients[1] = [0.5, -3.0, 1.0, 0.0, 0.0];
        coefficients[2] = [0.0, 0.2, 0.0, 0.0, 0.0];
        let shape = Polynomial::new(coefficients);
        let ratios = SpeedRatios::of(&Element::polynomial([0.0; 5], shape, Role::Spline), &AXES);
        let mut most = 0.0_f64;
        for index in 0..=1000 {
            let [d1, ..] = shape.derivatives(f64::from(index) / 1000.0);
            most = most.max(libm::hypot(d1[0], d1[2]) / norm(d1));
        }
        assert!(ratios.xyz >= most && ratios.xyz < 1.01 * most, "{} {most}", ratios.xyz);
    }

    #[test]
    fn what_stands_for_two_moves_keeps_the_feeds_of_both() {
        let x = Feeds::programmed(10.0, &line([1.0, 0.0, 0.0, 0.0, 0.0]), &AXES);
        let a = Feeds::programmed(30.0, &line([0.0, 1.0, 0.0, 0.0, 0.0]), &AXES);
        let both = x.least(a);
        assert_eq!(both, Feeds { xyz_mm_s: 10.0, uvw_mm_s: f64::INFINITY, abc_deg_s: 30.0, path_mm_s: 30.0 });
        let ratios = SpeedRatios { xyz: 0.6, uvw: 0.0, abc: 0.8, linear: 0.6 };
        assert!((both.along(&ratios) - 10.0 / 0.6).abs() < 1e-13);
        // A alone turned at 30 °/s.
        assert_eq!(a.along(&ratios), 30.0);
        assert_eq!(both.least(Feeds::RAPID).path_mm_s, f64::INFINITY);
        // What moves X hardly at all is no faster than the moves that it stands for.
        let slanted = Feeds::programmed(10.0, &line([3.0, 4.0, 0.0, 0.0, 0.0]), &AXES);
        assert!((slanted.along(&SpeedRatios { xyz: 1e-9, ..ratios }) - 50.0 / 3.0).abs() < 1e-13);
        assert!(slanted.ask_alike(x) && !slanted.ask_alike(a));
    }
}
