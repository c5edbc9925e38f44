//! An easement: the turn of a kink, spread over the end of one element or of both.
//!
//! Consumes two elements that meet at a small angle, a tolerance and the room on either side; produces what takes the
//! place of their ends. A program rounded to three decimals has such kinks where a line was to run into an arc. Where one is
//! passed, velocity steps. A [`Blend`](super::blend::Blend) takes the jump of curvature away together with the kink, and may
//! need more time than the jump. An easement leaves the jump.
//!
//! **Shape.** An element is followed with a bulge b added, towards the inside of the turn φ or away from it. By arc length
//! tangent, curvature and its derivative begin as the element has them. With w the fraction of the easement's length d, 0
//! where it begins and 1 at the junction,
//!
//! ```text
//! both    b = φ·d·(w⁴/4 − w⁵/10)               b'''' ≤ 6·φ/d³      half of φ on either side
//! one     b = φ·d·(−1.7·w⁴ + 2.4·w⁵ − 0.7·w⁶)  b'''' ≤ 42·φ/d³     all of φ
//! ```
//!
//! On both sides it is equally long, bends by φ/d more at the junction on either, so that the jump of curvature stays what it
//! is, and is the farthest from the path there, 0.15·φ·d. On one side it ends where the elements meet, adds 6.6·φ/d to the
//! jump and is at most 0.095·φ·d off. It is for a long element beside a short one, and beside a curve, which stays.

use super::blend::{CLOSE, Side, TOLERANCE_USED};
use super::curve::Curve;
use super::element::{Element, Role};
use super::polynomial::{DEGREE, Polynomial};
use super::smooth::direction_rounding_rad;
use super::{Vector, add, norm, scale, subtract};

/// Powers of w in b over φ·d, of either kind, and the greatest |b| over φ·d.
const BOTH: ([f64; DEGREE], f64) = ([0.0, 0.0, 0.0, 0.25, -0.1, 0.0, 0.0], 0.15);
const ONE: ([f64; DEGREE], f64) = ([0.0, 0.0, 0.0, -1.7, 2.4, -0.7, 0.0], 0.095);
/// Where a curve of the derivatives at both ends is the farthest from the arc that it follows: its error is nearly u⁴·(1 − u)⁴
/// times a constant.
const FARTHEST: f64 = 0.5;
/// Parts of the longest one that are tried until one is within the tolerance.
const SHORTER: [f64; 3] = [1.0, 0.5, 0.25];

/// An easement, and the path that it replaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Easement<const N: usize = 3> {
    /// What takes the place of the ends, in their order.
    pub elements: Vec<Element<N>>,
    /// Length of path that it replaces before and after the junction \[mm\].
    pub trims_mm: [f64; 2],
    /// A bound on its distance from the path and the path's from it \[mm\].
    pub distance_mm: f64,
}

impl<const N: usize> Easement<N> {
    /// The longest easements between two elements within `tolerance_mm` and with at most `rooms_mm` of each: on both sides
    /// and on either, where that is a line or an arc.
    #[must_use]
    pub fn all(elements: [&Element<N>; 2], tolerance_mm: f64, rooms_mm: [f64; 2]) -> Vec<Self> {
        let tolerance_mm = TOLERANCE_USED * tolerance_mm;
        let turn = subtract(elements[1].ends()[0].tangent, elements[0].ends()[1].tangent);
        let point = elements[1].ends_mm().0;
        let sides = [Side::new(elements[0], true), Side::new(elements[1], false)];
        let room_mm = |index: usize| match &sides[index] {
            Some(side) => side.room_mm().min(rooms_mm[index]),
            None => 0.0,
        };
        let rooms_mm = [room_mm(0), room_mm(1)];
        let least_mm = rooms_mm[0].min(rooms_mm[1]);
        let kinds = [(BOTH, [least_mm; 2]), (ONE, [rooms_mm[0], 0.0]), (ONE, [0.0, rooms_mm[1]])];
        let made = kinds.into_iter().filter_map(|((powers, greatest), rooms_mm)| {
            let longest_mm = CLOSE * tolerance_mm / (greatest * norm(turn));
            let trims_mm = rooms_mm.map(|room_mm| room_mm.min(longest_mm));
            // What is off an arc by itself is less on less of it.
            SHORTER.into_iter().find_map(|part| {
                let trims_mm = trims_mm.map(|trim_mm| part * trim_mm);
                let found = Self::of(point, &sides, turn, trims_mm, (&powers, greatest))?;
                (found.distance_mm <= tolerance_mm).then_some(found)
            })
        });
        made.collect()
    }

    /// The easement of `turn` at a point that trims the sides by `trims_mm`, both alike or one by nothing.
    fn of(
        point: Vector<N>,
        sides: &[Option<Side<N>>; 2],
        turn: Vector<N>,
        trims_mm: [f64; 2],
        (powers, greatest): (&[f64; DEGREE], f64),
    ) -> Option<Self> {
        let trim_mm = trims_mm[0].max(trims_mm[1]);
        // Written so that what is not a number is none either. A turn that rounding could be is none.
        if !(trim_mm > 0.0 && trim_mm.is_finite() && norm(turn) > direction_rounding_rad(trim_mm)) {
            return None;
        }
        let off_mm = greatest * trim_mm * norm(turn);
        let middle = if trims_mm[0] == trims_mm[1] { scale(turn, greatest * trim_mm) } else { [0.0; N] };
        let mut elements = Vec::with_capacity(2);
        let mut follows_mm = 0.0_f64;
        for (index, side) in sides.iter().enumerate() {
            let (Some(side), true) = (side, trims_mm[index] > 0.0) else { continue };
            let bulge = Polynomial::new(powers.map(|power| scale(turn, power * trim_mm)));
            let away = side.at(trim_mm).0;
            let (start, followed, bulge, [from, to]) = match index {
                0 => (away, followed(side, [trim_mm, 0.0]), bulge, [away, middle]),
                _ => ([0.0; N], followed(side, [0.0, trim_mm]), bulge.part(1.0, 0.0), [middle, away]),
            };
            let farthest = add(start, followed.offset(0.0, FARTHEST));
            follows_mm = follows_mm.max(side.near(trim_mm).distance_mm(farthest));
            let ([from, to], shape) = ([from, to].map(|end| add(point, end)), followed.plus(&bulge));
            elements.push(Element::Polynomial { from, to, shape, role: Role::Blend });
        }
        (!elements.is_empty()).then_some(Self { elements, trims_mm, distance_mm: off_mm + follows_mm })
    }
}

/// A side from one distance from the junction to another, one of which is 0, as a curve of its derivatives at both.
fn followed<const N: usize>(side: &Side<N>, from_corner_mm: [f64; 2]) -> Polynomial<N> {
    let length_mm = from_corner_mm[0].max(from_corner_mm[1]);
    let [start, end] = from_corner_mm.map(|mm| {
        let (point, [tangent, second, third]) = side.at(mm);
        let by_parameter: [Vector<N>; 3] =
            [scale(tangent, length_mm), scale(second, length_mm.powi(2)), scale(third, length_mm.powi(3))];
        (point, by_parameter)
    });
    Polynomial::between(start, end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::curve::Spiral;
    use crate::toolpath::{angle, dot};
    use motion_tests::random::Random;

    /// A line or an arc that begins or ends in the origin with a direction in the plane.
    fn element(random: &mut Random, heading_rad: f64, is_before: bool) -> Element {
        let unit = |rad: f64| [libm::cos(rad), libm::sin(rad), 0.0];
        let quarter = core::f64::consts::FRAC_PI_2;
        let tangent = unit(heading_rad);
        if random.chance(0.4) {
            let length_mm = random.log(0.05, 20.0);
            return if is_before {
                Element::Line { from: scale(tangent, -length_mm), to: [0.0; 3] }
            } else {
                Element::Line { from: [0.0; 3], to: scale(tangent, length_mm) }
            };
        }
        let (sign, sweep_rad, radius_mm) = (random.sign(), random.between(0.1, 3.0), random.log(0.1, 20.0));
        // The angle about the centre where the arc begins.
        let turned_rad = if is_before { sweep_rad } else { 0.0 };
        let start_rad = heading_rad - sign * (quarter + turned_rad);
        let outward = unit(start_rad);
        let shape = Spiral {
            outward,
            onward: scale(unit(start_rad + quarter), sign),
            radius_mm,
            radius_per_rad: 0.0,
            across_per_rad: [0.0; 3],
        };
        let chord = shape.offset(0.0, sweep_rad);
        let from = if is_before { scale(chord, -1.0) } else { [0.0; 3] };
        Element::Arc { from, to: add(from, chord), shape, sweep_rad }
    }

    /// The distance of a point beside an element from its line or circle.
    fn measured_mm(element: &Element, point: Vector) -> f64 {
        match element {
            Element::Arc { from, shape, .. } => {
                let centre = subtract(*from, scale(shape.outward, shape.radius_mm));
                (norm(subtract(point, centre)) - shape.radius_mm).abs()
            }
            _ => {
                let tangent = element.ends()[0].tangent;
                let from_start = subtract(point, element.ends_mm().0);
                norm(subtract(from_start, scale(tangent, dot(from_start, tangent))))
            }
        }
    }

    /// Random lines and arcs at random kinks: what replaces their ends goes on in one direction throughout, with their curvature
    /// and its derivative where it begins, with no greater jump at the junction than is said, and is as near as it says.
    #[test]
    fn a_kink_is_spread_within_room_and_tolerance() {
        let (mut kinds, mut bound) = ([0; 2], 0.0_f64);
        for seed in 0..400 {
            let mut random = Random::new(seed);
            let (heading_rad, kink_rad) = (random.between(0.0, 6.0), random.sign() * random.log(1e-6, 9e-3));
            let before = element(&mut random, heading_rad, true);
            let after = element(&mut random, heading_rad + kink_rad, false);
            let tolerance_mm = random.log(1e-4, 0.1);
            let rooms_mm = [
                before.length_mm() * random.between(0.05, 0.9),
                after.length_mm() * random.between(0.05, 0.9),
            ];
            let jump = norm(subtract(after.ends()[0].curvature, before.ends()[1].curvature));
            let all = Easement::all([&before, &after], tolerance_mm, rooms_mm);
            assert_eq!(all.len(), 3, "seed {seed}");
            for Easement { elements, trims_mm, distance_mm } in all {
                assert!(
                    trims_mm[0] <= rooms_mm[0] && trims_mm[1] <= rooms_mm[1] && distance_mm <= tolerance_mm
                );
                kinds[elements.len() - 1] += 1;
                let [first_mm, last_mm] = trims_mm;
                let mut path = vec![before.trimmed(0.0, first_mm)];
                path.extend(elements.iter().copied());
                path.push(after.trimmed(last_mm, 0.0));
                let mut jumps = 0;
                for pair in path.windows(2) {
                    assert_eq!(pair[0].ends_mm().1, pair[1].ends_mm().0, "seed {seed}");
                    let ([_, end], [start, _]) = (pair[0].ends(), pair[1].ends());
                    let turn_rad = angle(end.tangent, start.tangent);
                    assert!(turn_rad < 1e-10, "seed {seed}: {turn_rad} rad");
                    let step = norm(subtract(start.curvature, end.curvature));
                    let most = jump + 6.61 * kink_rad.abs() / first_mm.max(last_mm);
                    assert!(step <= most * (1.0 + 1e-6) + 1e-9, "seed {seed}: {step}, {most} 1/mm");
                    jumps += usize::from(step > 1e-6 * (1.0 + jump));
                }
                assert!(jumps <= 1, "seed {seed}: {jumps} jumps of curvature");
                let mut farthest_mm = 0.0_f64;
                for (index, element) in elements.iter().enumerate() {
                    let side = if index > 0 || first_mm == 0.0 { &after } else { &before };
                    let Element::Polynomial { from, shape, .. } = element else { panic!("a polynomial") };
                    for part in 0..=20 {
                        let point = add(*from, shape.offset(0.0, f64::from(part) / 20.0));
                        let mm = measured_mm(side, point);
                        farthest_mm = farthest_mm.max(mm);
                    }
                    // Nearly by arc length.
                    let speed =
                        [0.0, 0.3, 0.7, 1.0].map(|u| norm(shape.derivatives(u)[0]) / element.length_mm());
                    assert!(speed.iter().all(|speed| (speed - 1.0).abs() < 0.02), "seed {seed}: {speed:?}");
                    assert!(dot(element.ends()[0].tangent, element.ends()[1].tangent) > 0.5);
                }
                assert!(
                    farthest_mm <= distance_mm * (1.0 + 1e-6) + 1e-12,
                    "seed {seed}: {farthest_mm} mm, said {distance_mm}"
                );
                bound = bound.max(farthest_mm / distance_mm);
            }
        }
        assert!(kinds == [800, 400] && bound > 0.99, "{kinds:?} {bound}");
    }

    #[test]
    fn without_room_or_tolerance_there_is_none() {
        let before = Element::Line { from: [-1.0, 0.0, 0.0], to: [0.0; 3] };
        let after = Element::Line { from: [0.0; 3], to: [1.0, 0.005, 0.0] };
        let count = |tolerance_mm: f64, rooms_mm: [f64; 2]| {
            Easement::all([&before, &after], tolerance_mm, rooms_mm).len()
        };
        assert_eq!(count(0.01, [0.5; 2]), 3);
        assert_eq!(count(0.01, [0.5, 0.0]), 1);
        assert_eq!(count(0.01, [0.0; 2]) + count(0.0, [0.5; 2]) + count(f64::NAN, [0.5; 2]), 0);
    }
}
