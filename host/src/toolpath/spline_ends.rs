//! Programmed curves that meet their neighbours at a kink: their ends are turned, so that the path goes on in one direction.
//!
//! Consumes two moves in their order, before anything is made of them; changes the curves among them. A program rounds the
//! control points of G5 or of a NURBS as it rounds everything. Lines, arcs and involutes stay: an
//! [easement](super::easement) turns the path where two of these meet.
//!
//! **Shape.** A part h(u)·c is added, with h(u) = −15u⁴ + 39u⁵ − 34u⁶ + 10u⁷ towards the end that is turned. h, h', h''
//! and h''' are 0 at both ends of the curve, but h' is 1 at this one: all else stays as it was there. c is the change of
//! the tangent times the speed by the parameter; the curve is at most 0.228·|c| off.

use super::blend::TOLERANCE_USED;
use super::curve::Curve;
use super::element::{Element, Role};
use super::polynomial::{DEGREE, Polynomial};
use super::smooth::{Move, kink_rad};
use super::{Vector, add, norm, scale, subtract};

/// h by powers of u, and its greatest.
const TURN: ([f64; DEGREE], f64) = ([0.0, 0.0, 0.0, -15.0, 39.0, -34.0, 10.0], 0.228);

/// Turns the ends of programmed curves at a kink of at most `kink_max_rad`, if the path may be changed and the tolerances
/// allow it.
pub(crate) fn meet<const N: usize>(before: &mut Move<N>, after: &mut Move<N>, kink_max_rad: f64) {
    // Most moves are lines and arcs, and nothing of them is computed.
    let are_curves = [&before.element, &after.element].map(is_curve);
    if are_curves == [false; 2] || before.tolerance_mm.min(after.tolerance_mm) <= 0.0 {
        return;
    }
    if kink_rad([&before.element, &after.element]).is_none_or(|kink_rad| kink_rad > kink_max_rad) {
        return;
    }
    let (end, start) = (before.element.ends()[1].tangent, after.element.ends()[0].tangent);
    let common = match are_curves {
        [true, true] => scale(add(end, start), 1.0 / norm(add(end, start))),
        [true, false] => start,
        [false, _] => end,
    };
    if let (Some(one), Some(other)) = (turned(before, 1.0, common), turned(after, 0.0, common)) {
        (*before, *after) = (one, other);
    }
}

fn is_curve<const N: usize>(element: &Element<N>) -> bool {
    matches!(element, Element::Polynomial { role: Role::Spline, .. })
}

/// A move whose tangent at `u`, 0 or 1, is `tangent`, if that is a programmed curve; none if it would leave its tolerance.
fn turned<const N: usize>(step: &Move<N>, u: f64, tangent: Vector<N>) -> Option<Move<N>> {
    let Element::Polynomial { from, to, shape, role: Role::Spline } = step.element else {
        return Some(*step);
    };
    let first = shape.derivatives(u)[0];
    let change = subtract(scale(tangent, norm(first)), first);
    let distance_mm = step.distance_mm + TURN.1 * norm(change);
    // Backwards from the start, where its slope is the other way round.
    let at = |change: Vector<N>| Polynomial::new(TURN.0.map(|power| scale(change, power)));
    let turn = if u == 0.0 { at(scale(change, -1.0)).part(1.0, 0.0) } else { at(change) };
    let element = Element::Polynomial { from, to, shape: shape.plus(&turn), role: Role::Spline };
    (distance_mm <= TOLERANCE_USED * step.tolerance_mm).then_some(Move { element, distance_mm, ..*step })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::Feeds;
    use motion_tests::random::Random;

    fn step(element: Element, tolerance_mm: f64) -> Move {
        let feeds = Feeds::xyz(50.0);
        Move { line: 1, element, feeds, tolerance_mm, merging_mm: None, distance_mm: 0.0 }
    }

    /// A cubic from the origin, whose start and end have these directions in the plane.
    fn cubic(from: Vector, start_rad: f64, end_rad: f64) -> Element {
        let unit = |rad: f64| [libm::cos(rad), libm::sin(rad), 0.0];
        let (first, chord) = (scale(unit(start_rad), 9.0), [10.0, 2.0, 0.0]);
        let last = scale(unit(end_rad), 12.0);
        let none = [0.0; 3];
        let second = subtract(subtract(scale(chord, 3.0), scale(first, 2.0)), last);
        let third = subtract(add(first, last), scale(chord, 2.0));
        Element::polynomial(
            from,
            Polynomial::new([first, second, third, none, none, none, none]),
            Role::Spline,
        )
    }

    /// Curves and lines that meet at kinks: within the tolerance they go on in one direction, and nothing else of a curve changes
    /// at its ends; it stays as near as is said. Beyond the tolerance, or where the path is to be exact, all stays.
    #[test]
    fn curves_are_turned_at_kinks() {
        let line = |from: Vector, rad: f64| Element::Line {
            from,
            to: add(from, [5.0 * libm::cos(rad), 5.0 * libm::sin(rad), 0.0]),
        };
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let (rad, kink_rad) = (random.between(-0.5, 0.5), random.sign() * random.log(1e-8, 8e-3));
            let first = match seed % 3 {
                0 => line([0.0; 3], rad),
                _ => cubic([0.0; 3], random.between(-1.0, 1.0), rad),
            };
            let joint = first.ends_mm().1;
            let second = match seed % 3 {
                1 => line(joint, rad + kink_rad),
                _ => cubic(joint, rad + kink_rad, random.between(-1.0, 1.0)),
            };
            let asked = [step(first, 0.05), step(second, 0.05)];
            let [mut before, mut after] = asked;
            meet(&mut before, &mut after, 8.7e-3);
            assert_eq!(kink_rad_of(&before, &after), None, "seed {seed}");
            for (asked, is) in asked.iter().zip([before, after]) {
                let (Some((curve, _)), Some((turned, _))) = (asked.element.curve(), is.element.curve())
                else {
                    assert_eq!(asked.element, is.element);
                    continue;
                };
                assert_eq!(asked.element.ends_mm(), is.element.ends_mm());
                let offsets = (0..=100).map(|part| f64::from(part) / 100.0);
                let distances = offsets.map(|u| norm(subtract(curve.offset(0.0, u), turned.offset(0.0, u))));
                let farthest_mm = distances.fold(0.0, f64::max);
                assert!(
                    farthest_mm <= is.distance_mm && is.distance_mm < 1.02 * farthest_mm + 1e-12,
                    "seed {seed}"
                );
                for u in [0.0, 1.0] {
                    let (a, b) = (curve.derivatives(u), turned.derivatives(u));
                    let changed = [1, 2].map(|order| norm(subtract(a[order], b[order])));
                    assert!(changed[0].max(changed[1]) < 1e-9, "seed {seed}: {changed:?}");
                }
            }
            // Exact path, too little tolerance, too sharp.
            for (tolerance_mm, kink_max_rad) in [(0.0, 8.7e-3), (1e-12, 8.7e-3), (0.05, 1e-9)] {
                let [mut before, mut after] = asked.map(|asked| Move { tolerance_mm, ..asked });
                meet(&mut before, &mut after, kink_max_rad);
                assert_eq!((before.element, after.element), (first, second), "seed {seed}");
            }
        }
    }

    fn kink_rad_of(before: &Move, after: &Move) -> Option<f64> {
        kink_rad([&before.element, &after.element])
    }
}
