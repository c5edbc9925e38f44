//! Arcs: from words to centre, radii and sweep.
//!
//! Everything happens in the arc's plane, with exact integers \[10⁻¹⁰ mm\] relative to the start as long as
//! the result is an integer. So a full circle differs from an arc of next to no length without a tolerance.

use super::decimal::Length;
use super::error::Problem;
use super::program::Plane;
use std::f64::consts::{PI, SQRT_2};

/// Start and end radius of an arc may differ by this share of the start radius, or by [`RADIUS_MISMATCH_MM`] or
/// [`RADIUS_MISMATCH_INCH`] if that is more, but never by more than a hundred times that: programs round their
/// coordinates. LinuxCNC takes the same.
pub const RADIUS_MISMATCH_RATIO: f64 = 0.001;
/// The difference allowed in any case in programs in millimetres \[mm\]: a hundredth on each of four coordinates.
pub const RADIUS_MISMATCH_MM: f64 = 0.02 * SQRT_2;
/// The difference allowed in any case in programs in inches \[inch\].
pub const RADIUS_MISMATCH_INCH: f64 = 0.002 * SQRT_2;
/// What is never allowed, in differences that are allowed in any case.
const MISMATCH_MAX: f64 = 100.0;
/// How far a chord may exceed 2 R \[mm\].
const CHORD_EXCESS_MM: f64 = 0.005;

/// An arc is a half circle if 2 R exceeds its chord by less \[10⁻¹⁰ mm\].
const HALF_CIRCLE_UNITS: i128 = 3;

/// A point of the plane, relative to another \[10⁻¹⁰ mm\]; |coordinates| ≤ 4 [`Length::LIMIT`].
type Offset = [i64; 2];

/// An arc in its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resolved {
    /// Centre relative to the origin \[mm\].
    pub(super) centre_mm: [f64; 2],
    /// \[mm\].
    pub(super) start_radius_mm: f64,
    /// \[mm\].
    pub(super) end_radius_mm: f64,
    /// \[rad\], counter-clockwise positive.
    pub(super) sweep_rad: f64,
    /// The radius was enlarged to half the chord.
    pub(super) radius_enlarged: bool,
}

fn mm(units: i64) -> f64 {
    units as f64 / Length::UNITS_PER_MM as f64
}

fn mm_from_root(units_squared: i128) -> f64 {
    (units_squared as f64).sqrt() / Length::UNITS_PER_MM as f64
}

/// a · b; |…| ≤ 2 (4e16)², far inside 128 bits.
fn dot(a: Offset, b: Offset) -> i128 {
    i128::from(a[0]) * i128::from(b[0]) + i128::from(a[1]) * i128::from(b[1])
}

/// a × b, positive if b lies counter-clockwise of a.
fn cross(a: Offset, b: Offset) -> i128 {
    i128::from(a[0]) * i128::from(b[1]) - i128::from(a[1]) * i128::from(b[0])
}

fn difference(a: Offset, b: Offset) -> Offset {
    [a[0] - b[0], a[1] - b[1]]
}

/// An arc from `start` to `end` about `centre`; clockwise if `clockwise`. `mismatch_mm` is the difference of the
/// radii that is allowed in any case. Start and end in one direction from
/// the centre mean a full turn.
pub(super) fn about_centre(
    start: [Length; 2],
    end: [Length; 2],
    centre: Offset,
    clockwise: bool,
    mismatch_mm: f64,
) -> Result<Resolved, Problem> {
    let from = difference(start.map(Length::units), centre);
    let to = difference(end.map(Length::units), centre);
    if from == [0, 0] {
        return Err(Problem::ArcCentreOnPoint { point: "start" });
    }
    if to == [0, 0] {
        return Err(Problem::ArcCentreOnPoint { point: "end" });
    }
    let start_radius_mm = mm_from_root(dot(from, from));
    let end_radius_mm = mm_from_root(dot(to, to));
    let allowed_mm = (start_radius_mm * RADIUS_MISMATCH_RATIO).clamp(mismatch_mm, MISMATCH_MAX * mismatch_mm);
    if (start_radius_mm - end_radius_mm).abs() > allowed_mm {
        return Err(Problem::ArcRadiiDiffer { start_radius_mm, end_radius_mm, allowed_mm });
    }

    let (cross, dot) = (cross(from, to), dot(from, to));
    // atan2(|cross|, dot) in [0, π] is the angle between the radii; the exact sign of the cross product says
    // on which side. On neither it is 0 or π, and 2π less that is the full or the half turn meant.
    // libm, so that every host computes the same bits.
    let between_rad = libm::atan2(cross.unsigned_abs() as f64, dot as f64);
    let turns_with_arc = if clockwise { cross < 0 } else { cross > 0 };
    let angle_rad = if turns_with_arc { between_rad } else { 2.0 * PI - between_rad };
    Ok(Resolved {
        centre_mm: centre.map(mm),
        start_radius_mm,
        end_radius_mm,
        sweep_rad: if clockwise { -angle_rad } else { angle_rad },
        radius_enlarged: false,
    })
}

/// An arc from `start` to `end` of `radius`: the shorter of the two, or the longer if it is negative. `word`
/// is the R word, for errors.
pub(super) fn of_radius(
    start: [Length; 2],
    end: [Length; 2],
    radius: Length,
    clockwise: bool,
    plane: Plane,
    word: impl Fn() -> String,
) -> Result<Resolved, Problem> {
    let chord = difference(end.map(Length::units), start.map(Length::units));
    let chord_squared = dot(chord, chord);
    if chord_squared == 0 {
        return Err(Problem::ArcWithoutChord { word: word(), plane });
    }
    if radius == Length::ZERO {
        return Err(Problem::ArcRadiusZero { word: word() });
    }
    let chord_mm = mm_from_root(chord_squared);
    let diameter = 2 * i128::from(radius.units());
    // (2 R)² − chord² = (2 × distance of the centre from the chord)², exact, so that nothing cancels.
    let apothem_squared = diameter * diameter - chord_squared;
    let radius_enlarged = apothem_squared < 0;
    // Ends and radius are rounded. So near to a half circle that would move the centre by 10⁵ times as much.
    let is_half = apothem_squared <= 2 * HALF_CIRCLE_UNITS * diameter.abs();
    if radius_enlarged && chord_mm - 2.0 * radius.to_mm().abs() > CHORD_EXCESS_MM {
        return Err(Problem::ArcRadiusTooSmall { word: word(), chord_mm });
    }
    let apothem_mm = if is_half { 0.0 } else { mm_from_root(apothem_squared) / 2.0 };
    let radius_mm = if is_half { chord_mm / 2.0 } else { radius.to_mm().abs() };

    let shorter_rad = 2.0 * libm::atan2(chord_mm / 2.0, apothem_mm);
    let longer = radius < Length::ZERO;
    let angle_rad = if longer { 2.0 * PI - shorter_rad } else { shorter_rad };

    // Left of the chord lies the centre of the shorter counter-clockwise arc.
    let side = if clockwise == longer { apothem_mm } else { -apothem_mm };
    let left = [-mm(chord[1]) / chord_mm, mm(chord[0]) / chord_mm];
    // The middle of the chord: the sum of two coordinates is exact, and halved on the way to mm.
    let middle_mm = [0, 1].map(|i| mm(start[i].units() + end[i].units()) / 2.0);
    Ok(Resolved {
        centre_mm: [0, 1].map(|i| middle_mm[i] + side * left[i]),
        start_radius_mm: radius_mm,
        end_radius_mm: radius_mm,
        sweep_rad: if clockwise { -angle_rad } else { angle_rad },
        radius_enlarged,
    })
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    fn at(mm: [f64; 2]) -> [Length; 2] {
        mm.map(|mm| Length::from_units((mm * 1e10).round() as i64).unwrap())
    }

    fn centre(
        start: [f64; 2],
        end: [f64; 2],
        centre: [f64; 2],
        clockwise: bool,
    ) -> Result<Resolved, Problem> {
        about_centre(at(start), at(end), at(centre).map(Length::units), clockwise, 0.005)
    }

    fn radius(start: [f64; 2], end: [f64; 2], radius_mm: f64, clockwise: bool) -> Result<Resolved, Problem> {
        let [radius, _] = at([radius_mm, 0.0]);
        of_radius(at(start), at(end), radius, clockwise, Plane::Xy, || "R".to_owned())
    }

    #[test]
    fn quarters_halves_and_full_turns() {
        for (end, clockwise, quarters) in [
            ([0.0, 5.0], false, 1.0),
            ([0.0, 5.0], true, -3.0),
            ([-5.0, 0.0], false, 2.0),
            ([-5.0, 0.0], true, -2.0),
            ([5.0, 0.0], false, 4.0),
            ([5.0, 0.0], true, -4.0),
        ] {
            let arc = centre([5.0, 0.0], end, [0.0, 0.0], clockwise).unwrap();
            assert_eq!(arc.sweep_rad, quarters * PI / 2.0);
        }
    }

    #[test]
    fn a_unit_short_of_the_start_is_no_full_circle() {
        let end = [at([5.0, 0.0])[0], Length::from_units(-1).unwrap()];
        let arc = |clockwise| about_centre(at([5.0, 0.0]), end, [0, 0], clockwise, 0.005).unwrap().sweep_rad;
        assert_eq!(arc(true), -2e-11);
        assert_eq!(arc(false), 2.0 * PI - 2e-11);
    }

    #[test]
    fn radii_may_differ_within_the_tolerance() {
        // Below 5 mm radius the least tolerance holds, above 500 mm the greatest.
        for (start_mm, allowed_mm) in [(1.0, 0.005), (100.0, 0.1), (1000.0, 0.5)] {
            let arc = |end_mm| centre([start_mm, 0.0], [0.0, end_mm], [0.0, 0.0], false);
            let inside = arc(start_mm + allowed_mm - 1e-9).unwrap();
            assert!((inside.end_radius_mm - inside.start_radius_mm - allowed_mm + 1e-9).abs() < 1e-12);
            assert!(matches!(arc(start_mm + allowed_mm + 1e-6), Err(Problem::ArcRadiiDiffer { .. })));
        }
        let spiral = centre([10.0, 0.0], [10.004, 0.0], [0.0, 0.0], true).unwrap();
        assert_eq!(spiral.sweep_rad, -2.0 * PI);
    }

    #[test]
    fn a_radius_gives_four_arcs() {
        for (radius_mm, clockwise, centre_mm, sweep_deg) in [
            (5.0, false, [0.0, 5.0], 90.0),
            (5.0, true, [5.0, 0.0], -90.0),
            (-5.0, false, [5.0, 0.0], 270.0),
            (-5.0, true, [0.0, 5.0], -270.0),
        ] {
            let arc = radius([0.0, 0.0], [5.0, 5.0], radius_mm, clockwise).unwrap();
            assert!((arc.sweep_rad.to_degrees() - sweep_deg).abs() < 1e-12, "{arc:?}");
            assert!((0..2).all(|i| (arc.centre_mm[i] - centre_mm[i]).abs() < 1e-12), "{arc:?}");
            assert_eq!([arc.start_radius_mm, arc.end_radius_mm], [5.0, 5.0]);
        }
    }

    #[test]
    fn a_radius_may_fall_short_by_a_rounding_error() {
        let half = radius([0.0, 0.0], [10.004, 0.0], 5.0, true).unwrap();
        assert!(half.radius_enlarged);
        assert_eq!((half.sweep_rad, half.start_radius_mm, half.centre_mm), (-PI, 5.002, [5.002, 0.0]));
        let short = radius([0.0, 0.0], [10.006, 0.0], -5.0, true);
        assert!(matches!(short, Err(Problem::ArcRadiusTooSmall { .. })));
    }

    #[test]
    fn points_without_an_arc_are_refused() {
        let (a, b) = ([1.0, 1.0], [2.0, 1.0]);
        assert!(matches!(centre(a, b, a, false), Err(Problem::ArcCentreOnPoint { point: "start" })));
        assert!(matches!(
            centre(a, [1.001, 1.0], [1.001, 1.0], false),
            Err(Problem::ArcCentreOnPoint { .. })
        ));
        assert!(matches!(radius(a, a, 5.0, true), Err(Problem::ArcWithoutChord { .. })));
        assert!(matches!(radius(a, b, 0.0, true), Err(Problem::ArcRadiusZero { .. })));
    }

    #[test]
    fn the_largest_numbers_fit() {
        let arc = radius([-1e6, -1e6], [1e6, 1e6], 1e6, false);
        assert!(matches!(arc, Err(Problem::ArcRadiusTooSmall { .. })));
        let flat = radius([0.0, 0.0], [1e-10, 0.0], 1e6, false).unwrap();
        assert!((flat.sweep_rad / 1e-16 - 1.0).abs() < 1e-9);
        assert!(centre([1e6, 1e6], [-1e6, -1e6], [0.0, 0.0], false).is_ok());
    }
}
