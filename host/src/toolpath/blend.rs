//! A corner blend: the septic curve that leaves one element and enters the next with the same tangent,
//! curvature and derivative of curvature (G³), so that velocity, acceleration and jerk of every axis go
//! through it without a step.
//!
//! Consumes two lines or arcs that meet, a tolerance and the room on either side; produces the blend and its
//! trim of both, or none where the path has to stay unchanged: a corner sharper than [`ANGLE_MAX_RAD`], no
//! tolerance, no room. A tangent junction whose curvature jumps (a line meets an arc) is a corner of 0° and
//! is blended like the others. Background; a bounded number of steps per corner.
//!
//! **Shape.** Both ends give four control points each. On a line they stand at a₁, a₂, a₃ of the trim d
//! before the corner; on an arc the same speeds |r'|, s'', s''' by the parameter are used with the arc's own
//! derivatives by arc length. `SHAPES` holds the a's that allow the greatest feed at a given tolerance under
//! a limit of jerk alone and of snap alone, by corner angle; of these, three between them and an evenly
//! spaced one, that with the greatest feed under all limits is taken. They were found by searching all a₁ ≤
//! a₂ ≤ a₃ ≤ 1.
//!
//! **Tolerance.** The path before and after the corner and the blend are walked together: up to a place u* of
//! the blend each of its points is held against the nearest of the element before, from there on against that
//! of the element after, and u* itself against the corner. Over all pairs the walk is continuous on both
//! curves and leaves nothing out, so the greatest distance of a pair bounds that of any point of either curve
//! from the other. u* is the place nearest to the corner, or another where the bound is less. For two lines it
//! is the distance from the corner to the blend's middle. Shapes are compared by a walk of few steps, the best
//! one is walked in small ones.

use motion_kernel::internals::add_work;
use motion_kernel::law::Limits;
use motion_kernel::num::Root;

use super::curve::{Curve, Spiral, by_arc_length};
use super::element::{Element, Role};
use super::polynomial::Polynomial;
use super::{Vector, add, angle, dot, norm, scale, subtract};

/// The sharpest corner that is blended \[rad\]: a turn of 170°. The feed there is a hundredth of that at 10°.
pub const ANGLE_MAX_RAD: f64 = 170.0 * core::f64::consts::PI / 180.0;

/// The greatest part of an arc that one blend replaces \[rad\].
const ARC_RAD_MAX: f64 = core::f64::consts::FRAC_PI_4;

/// Corner angle \[°\], and a₁ a₂ a₃ for the greatest feed by jerk and by snap.
const SHAPES: [(f64, [f64; 3], [f64; 3]); 9] = [
    (0.0, [0.1833, 0.3738, 0.9679], [0.3504, 0.6370, 0.8443]),
    (15.0, [0.1945, 0.3823, 0.9593], [0.3502, 0.6326, 0.8424]),
    (30.0, [0.2303, 0.4005, 0.9417], [0.3444, 0.6118, 0.8413]),
    (60.0, [0.2421, 0.4583, 0.8542], [0.4248, 0.5470, 0.8514]),
    (90.0, [0.2482, 0.4826, 0.7500], [0.3310, 0.4838, 0.7658]),
    (120.0, [0.1868, 0.4070, 0.5993], [0.2719, 0.3848, 0.6498]),
    (150.0, [0.1115, 0.2411, 0.3864], [0.2000, 0.2398, 0.4500]),
    (160.0, [0.0945, 0.1689, 0.2941], [0.1287, 0.1694, 0.3275]),
    (170.0, [0.0883, 0.0985, 0.1883], [0.0756, 0.0915, 0.1881]),
];
/// The mixtures of the first and the second that are tried.
const BETWEEN: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Evenly spaced control points: the best for a jump of curvature without a corner.
const EVEN: [f64; 3] = [2.0 / 7.0, 4.0 / 7.0, 6.0 / 7.0];

/// The number of parts that a blend is cut into to compare shapes. Ceilings use more.
const COMPARED_PARTS: usize = 24;
/// The number of parts that each half of it is cut into to measure its distance from the path: to compare
/// shapes, and to bound it.
const COMPARED_STEPS: usize = 8;
const MEASURED_STEPS: usize = 32;
/// How often the place that is nearest to the corner is corrected.
const NEARER: usize = 3;
/// The squares of an arc's radius and of what is across it by the angle over that of its radius, below which the angle about
/// its axis tells where it is nearest.
const ROUND: f64 = 1.0e-6;
/// Distance of a blend from a jump of curvature over the jump and the square of its trim.
const JUMP: f64 = 0.03;
/// Corrections of the trim d until the distance fits the tolerance.
const CORRECTIONS_MAX: usize = 8;
/// Part of the tolerance at which it fits.
pub(super) const CLOSE: f64 = 0.998;
/// Part of the tolerance that is made use of: the pieces are a little off their curve, by 10⁻⁶ mm at most,
/// and a millionth of its length.
pub(super) const TOLERANCE_USED: f64 = 0.999;

/// A blend, and the path that it replaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend<const N: usize = 3> {
    /// The blend.
    pub element: Element<N>,
    /// Length of path that it replaces on either side of the corner \[mm\].
    pub trim_mm: f64,
    /// A bound on its distance from the path and the path's from it \[mm\].
    pub distance_mm: f64,
    /// About its greatest second to fourth derivative by arc length \[1/mm, 1/mm², 1/mm³\].
    pub derivatives: [f64; 3],
}

impl<const N: usize> Blend<N> {
    /// The blend of the corner between `before` and `after`, within `tolerance_mm` and with at most `room_mm`
    /// of either element, that allows the greatest feed under `limits`.
    #[must_use]
    pub fn new(
        before: &Element<N>,
        after: &Element<N>,
        tolerance_mm: f64,
        room_mm: f64,
        limits: &Limits<f64>,
    ) -> Option<Self> {
        let corner = Corner::new(before, after, room_mm)?;
        // Written so that what is not a number is no tolerance either.
        if !(tolerance_mm > 0.0 && corner.room_mm > 0.0) {
            return None;
        }
        let tolerance_mm = tolerance_mm * TOLERANCE_USED;
        let mut guess = corner.guess(tolerance_mm);
        let mut best: Option<(f64, [f64; 3], [f64; 3], Guess)> = None;
        for shape in shapes(corner.angle_rad) {
            let Some((found, curve, _)) = corner.within(tolerance_mm, &shape, guess, COMPARED_STEPS) else {
                continue;
            };
            guess = found;
            let derivatives = derivatives(&curve);
            let feed = feed_within(limits, derivatives);
            if best.is_none_or(|(most, ..)| feed > most) && feed.is_finite() && feed > 0.0 {
                best = Some((feed, derivatives, shape, found));
            }
        }
        let (_, derivatives, shape, guess) = best?;
        let (Guess { trim_mm, .. }, curve, distance_mm) =
            corner.within(tolerance_mm, &shape, guess, MEASURED_STEPS)?;
        let (start, _) = corner.before.at(trim_mm);
        let (end, _) = corner.after.at(trim_mm);
        let (from, to) = (add(corner.point, start), add(corner.point, end));
        let element = Element::Polynomial { from, to, shape: curve, role: Role::Blend };
        Some(Self { element, trim_mm, distance_mm, derivatives })
    }
}

/// Whether blends are made at the ends of an element.
#[must_use]
pub fn has_side<const N: usize>(element: &Element<N>) -> bool {
    matches!(element, Element::Line { .. } | Element::Arc { .. })
}

/// The trim that a jump of curvature without a corner wants within `tolerance_mm` \[mm\].
#[must_use]
pub fn trim_of_jump_mm(jump_per_mm: f64, tolerance_mm: f64) -> f64 {
    (tolerance_mm / (JUMP * jump_per_mm)).sqrt()
}

/// The trim of both lines at a corner of `angle_rad` within `tolerance_mm` \[mm\].
#[must_use]
pub fn trim_mm(angle_rad: f64, tolerance_mm: f64) -> f64 {
    let Some([a1, a2, a3]) = shapes(angle_rad).nth(BETWEEN.len() / 2) else { return 0.0 };
    // The middle of the blend, from the corner: control points on either line with the weights of u = 1/2.
    let part = (1.0 + 7.0 * (1.0 - a1) + 21.0 * (1.0 - a2) + 35.0 * (1.0 - a3)) / 128.0;
    tolerance_mm / (2.0 * part * libm::sin(0.5 * angle_rad))
}

/// About the greatest second to fourth derivative of a curve by arc length \[1/mm, 1/mm², 1/mm³\].
#[must_use]
pub(crate) fn derivatives<const N: usize>(curve: &Polynomial<N>) -> [f64; 3] {
    let bend = curve.bend_of(COMPARED_PARTS);
    let third = bend.third_root_per_mm * bend.third_root_per_mm;
    [bend.curvature_per_mm, third, bend.fourth_root_per_mm.powi(3)]
}

/// The greatest feed within the limits where the second to fourth derivative by arc length are so great
/// \[1/mm, 1/mm², 1/mm³\].
pub(crate) fn feed_within(limits: &Limits<f64>, [second, third, fourth]: [f64; 3]) -> f64 {
    let by_accel = (limits.accel_mm_s2 / second).sqrt();
    let by_jerk = Root::cbrt(limits.jerk_mm_s3 / third);
    let by_snap = (limits.snap_mm_s4 / fourth).sqrt().sqrt();
    // Not `min`, which would overlook what is not a number.
    [by_jerk, by_snap].into_iter().fold(by_accel, |least, feed| if feed >= least { least } else { feed })
}

/// The shapes to choose from.
fn shapes(angle_rad: f64) -> impl Iterator<Item = [f64; 3]> {
    let degrees = angle_rad.to_degrees();
    let above = SHAPES.iter().position(|&(angle, ..)| angle >= degrees).unwrap_or(SHAPES.len() - 1).max(1);
    let ((low, low_jerk, low_snap), (high, high_jerk, high_snap)) = (SHAPES[above - 1], SHAPES[above]);
    let part = (degrees - low) / (high - low);
    let (jerk, snap) = (mix(low_jerk, high_jerk, part), mix(low_snap, high_snap, part));
    BETWEEN.into_iter().map(move |part| mix(jerk, snap, part)).chain([EVEN])
}

fn mix(a: [f64; 3], b: [f64; 3], part: f64) -> [f64; 3] {
    core::array::from_fn(|index| a[index] + (b[index] - a[index]) * part)
}

/// Two elements, seen from the corner between them.
struct Corner<const N: usize> {
    point: Vector<N>,
    before: Side<N>,
    after: Side<N>,
    angle_rad: f64,
    room_mm: f64,
}

/// One element of a corner. Lengths along it count from the corner.
pub(super) enum Side<const N: usize> {
    /// Away from the corner, and the tangent of the path.
    Line { away: Vector<N>, tangent: Vector<N> },
    /// The angle at the corner, and how it changes with the length from it.
    Arc { shape: Spiral<N>, corner_rad: f64, rad_per_mm: f64 },
}

impl<const N: usize> Corner<N> {
    fn new(before: &Element<N>, after: &Element<N>, room_mm: f64) -> Option<Self> {
        let (before_side, after_side) = (Side::new(before, true)?, Side::new(after, false)?);
        let angle_rad = angle(before_side.at(0.0).1[0], after_side.at(0.0).1[0]);
        if !(angle_rad <= ANGLE_MAX_RAD) {
            return None;
        }
        let room_mm = room_mm.min(before_side.room_mm()).min(after_side.room_mm());
        Some(Self { point: after.ends_mm().0, before: before_side, after: after_side, angle_rad, room_mm })
    }

    /// The blend over `trim_mm` on either side.
    fn curve(&self, trim_mm: f64, [a1, a2, a3]: &[f64; 3]) -> (Vector<N>, Polynomial<N>) {
        let speed = 7.0 * a1 * trim_mm;
        let (s2, s3) = (42.0 * (a2 - 2.0 * a1) * trim_mm, 210.0 * (a3 - 3.0 * a2 + 3.0 * a1) * trim_mm);
        let ends = [(&self.before, s2), (&self.after, -s2)].map(|(side, s2)| {
            let (point, [tangent, second, third]) = side.at(trim_mm);
            let by_parameter = [
                scale(tangent, speed),
                add(scale(second, speed * speed), scale(tangent, s2)),
                add(
                    add(scale(third, speed * speed * speed), scale(second, 3.0 * speed * s2)),
                    scale(tangent, s3),
                ),
            ];
            (point, by_parameter)
        });
        let [start, end] = ends;
        (start.0, Polynomial::between(start, end))
    }

    /// A trim to begin with within a tolerance, and the power of it with which the distance grows: at a corner
    /// the first, at a jump of curvature the second.
    fn guess(&self, tolerance_mm: f64) -> Guess {
        let [before, after] = [&self.before, &self.after].map(|side| side.at(0.0).1[1]);
        let by_angle_mm = trim_mm(self.angle_rad, tolerance_mm);
        let by_jump_mm = trim_of_jump_mm(norm(subtract(after, before)), tolerance_mm);
        let power = if by_angle_mm < by_jump_mm { 1.0 } else { 2.0 };
        Guess { trim_mm: by_angle_mm.min(by_jump_mm).min(self.room_mm), power }
    }

    /// The longest blend of a shape within a tolerance: its trim, itself, its distance from the path, measured
    /// in so many steps on either side of its middle.
    fn within(
        &self,
        tolerance_mm: f64,
        shape: &[f64; 3],
        Guess { mut trim_mm, mut power }: Guess,
        steps: usize,
    ) -> Option<(Guess, Polynomial<N>, f64)> {
        let mut best: Option<(Guess, Polynomial<N>, f64)> = None;
        // The last two tries tell the power.
        let mut last: Option<(f64, f64)> = None;
        for _ in 0..CORRECTIONS_MAX {
            let (start, curve) = self.curve(trim_mm, shape);
            let distance_mm = self.distance_mm(start, &curve, trim_mm, steps);
            if let Some((last_trim_mm, last_distance_mm)) = last {
                let found = libm::log(distance_mm / last_distance_mm) / libm::log(trim_mm / last_trim_mm);
                if (0.5..=4.0).contains(&found) {
                    power = found;
                }
            }
            if distance_mm <= tolerance_mm {
                if best.is_none_or(|(longest, ..)| trim_mm > longest.trim_mm) {
                    best = Some((Guess { trim_mm, power }, curve, distance_mm));
                }
                if trim_mm >= self.room_mm || distance_mm >= CLOSE * tolerance_mm {
                    break;
                }
            }
            last = Some((trim_mm, distance_mm));
            let aimed_at = 0.5 * (1.0 + CLOSE) * tolerance_mm;
            trim_mm = (trim_mm * libm::pow(aimed_at / distance_mm, 1.0 / power)).min(self.room_mm);
            if !(trim_mm > 0.0) {
                break;
            }
        }
        best
    }

    fn is_straight(&self) -> bool {
        matches!((&self.before, &self.after), (Side::Line { .. }, Side::Line { .. }))
    }

    /// The greatest distance between the blend and what it stands for, measured in so many steps on either
    /// side of its middle.
    fn distance_mm(&self, start: Vector<N>, curve: &Polynomial<N>, trim_mm: f64, steps: usize) -> f64 {
        let point = |u: f64| add(start, curve.offset(0.0, u));
        if self.is_straight() {
            return norm(point(0.5));
        }
        add_work(2 * steps);
        let middle = nearest_to_corner(start, curve);
        let sides = [(&self.before, 0.0), (&self.after, 1.0)].map(|(side, end)| (side.near(trim_mm), end));
        let at = |end: f64, step: usize| point(end + (middle - end) * (step as f64 / steps as f64));
        // The greatest distance from each side, from its end up to each step.
        let mut greatest = [[0.0_f64; MEASURED_STEPS + 1]; 2];
        for ((near, end), greatest) in sides.iter().zip(&mut greatest) {
            for step in 1..=steps {
                greatest[step] = greatest[step - 1].max(near.distance_mm(at(*end, step)));
            }
        }
        let corner_mm = norm(point(middle));
        let (far, close) = if greatest[0][steps] > greatest[1][steps] { (0, 1) } else { (1, 0) };
        let mut least = greatest[far][steps].max(corner_mm);
        if greatest[far][steps] > corner_mm {
            // The other side takes over the last points of the farther one as long as that gains.
            let mut taken = greatest[close][steps];
            for step in (0..steps).rev() {
                let point = at(sides[far].1, step);
                taken = taken.max(sides[close].0.distance_mm(point));
                least = least.min(greatest[far][step].max(taken).max(norm(point)));
                if taken >= least {
                    break;
                }
            }
        }
        // Between two points the distance may rise above both by an eighth of its second difference, which is
        // below this part of the greatest for the curves made here: those of three and a half waves.
        let widest = middle.max(1.0 - middle) / steps as f64;
        least * (1.0 + 16.0 * widest * widest)
    }
}

/// Where a blend that begins `start` from the corner is nearest to it, or close to that; not near its ends.
fn nearest_to_corner<const N: usize>(start: Vector<N>, curve: &Polynomial<N>) -> f64 {
    let mut u = 0.5_f64;
    for _ in 0..NEARER {
        let [first, second, _] = curve.derivatives(u);
        let from_corner = add(start, curve.offset(0.0, u));
        let square = dot(first, first);
        let slope = (square + dot(from_corner, second)).max(0.5 * square);
        u = (u - dot(from_corner, first) / slope).clamp(0.25, 0.75);
    }
    u
}

/// A trim to try, and the power of it with which the distance grows.
#[derive(Clone, Copy, Debug)]
struct Guess {
    trim_mm: f64,
    power: f64,
}

impl<const N: usize> Side<N> {
    /// The side that `element` is, before or after the corner. None for a polynomial.
    pub(super) fn new(element: &Element<N>, is_before: bool) -> Option<Self> {
        match element {
            Element::Line { from, to } => {
                let [end, _] = element.ends();
                let away = if is_before { scale(end.tangent, -1.0) } else { end.tangent };
                (from != to).then_some(Self::Line { away, tangent: end.tangent })
            }
            Element::Arc { shape, sweep_rad, .. } => {
                let corner_rad = if is_before { *sweep_rad } else { 0.0 };
                let rad_per_mm = 1.0 / norm(shape.derivatives(corner_rad)[0]);
                let rad_per_mm = if is_before { -rad_per_mm } else { rad_per_mm };
                Some(Self::Arc { shape: *shape, corner_rad, rad_per_mm })
            }
            Element::Polynomial { .. } | Element::Involute { .. } => None,
        }
    }

    pub(super) fn room_mm(&self) -> f64 {
        match self {
            Self::Line { .. } => f64::INFINITY,
            Self::Arc { rad_per_mm, .. } => ARC_RAD_MAX / rad_per_mm.abs(),
        }
    }

    /// The point `trim_mm` from the corner, relative to it, and the path's derivatives by arc length there.
    pub(super) fn at(&self, trim_mm: f64) -> (Vector<N>, [Vector<N>; 3]) {
        match self {
            Self::Line { away, tangent } => (scale(*away, trim_mm), [*tangent, [0.0; N], [0.0; N]]),
            Self::Arc { shape, corner_rad, rad_per_mm } => {
                let angle = corner_rad + rad_per_mm * trim_mm;
                (shape.offset(*corner_rad, angle), by_arc_length(shape.derivatives(angle)))
            }
        }
    }

    /// Its first `trim_mm`, to measure distances from.
    pub(super) fn near(&self, trim_mm: f64) -> Near<N> {
        match self {
            Self::Line { away, .. } => Near::Line { away: *away, trim_mm },
            Self::Arc { shape, corner_rad, rad_per_mm } => {
                Near::Arc(NearArc::new(shape, *corner_rad, rad_per_mm * trim_mm))
            }
        }
    }
}

/// A side up to its trim, relative to the corner.
pub(super) enum Near<const N: usize> {
    Line { away: Vector<N>, trim_mm: f64 },
    Arc(NearArc<N>),
}

impl<const N: usize> Near<N> {
    pub(super) fn distance_mm(&self, point: Vector<N>) -> f64 {
        match self {
            Self::Line { away, trim_mm } => {
                let foot = dot(point, *away).clamp(0.0, *trim_mm);
                norm(subtract(point, scale(*away, foot)))
            }
            Self::Arc(arc) => arc.distance_mm(point),
        }
    }
}

/// Part of an arc, its angle counted from the corner.
pub(super) struct NearArc<const N: usize> {
    shape: Spiral<N>,
    /// The angle at its end, and its sine and cosine.
    end_rad: f64,
    end_sine: f64,
    end_cosine: f64,
    /// Its other end, relative to the corner.
    end: Vector<N>,
    /// Whether radius and what is across hardly change.
    is_round: bool,
}

impl<const N: usize> NearArc<N> {
    /// The part that runs through `swept_rad` from `corner_rad`, either way; less than half a turn.
    fn new(shape: &Spiral<N>, corner_rad: f64, swept_rad: f64) -> Self {
        let shape = shape.rotated(corner_rad);
        let (end_sine, end_cosine) = libm::sincos(swept_rad);
        let Spiral { radius_mm, radius_per_rad, across_per_rad, .. } = shape;
        let square = radius_per_rad * radius_per_rad + dot(across_per_rad, across_per_rad);
        Self {
            end_rad: swept_rad,
            end_sine,
            end_cosine,
            end: shape.offset(0.0, swept_rad),
            is_round: square <= ROUND * radius_mm * radius_mm,
            shape,
        }
    }

    /// How far `point`, relative to the corner, is from it; never less than that, and hardly more.
    fn distance_mm(&self, point: Vector<N>) -> f64 {
        let Spiral { outward, onward, radius_mm, radius_per_rad, across_per_rad } = self.shape;
        // In the arc's own axes, from its centre, and what is across them.
        let (out, y) = (dot(point, outward), dot(point, onward));
        let (x, beside) = (radius_mm + out, subtract(point, add(scale(outward, out), scale(onward, y))));
        let beside_mm = |angle: f64| norm(subtract(beside, scale(across_per_rad, angle)));
        let out_mm = (x * x + y * y).sqrt();
        if self.is_round {
            // The point of the arc at the same angle; no angle is needed where it is within the part.
            let past_end = y * self.end_cosine - x * self.end_sine;
            let is_within =
                if self.end_rad >= 0.0 { y >= 0.0 && past_end <= 0.0 } else { y <= 0.0 && past_end >= 0.0 };
            if is_within && x > -out_mm {
                if radius_per_rad == 0.0 && across_per_rad == [0.0; N] {
                    return length(out_mm - radius_mm, norm(beside));
                }
                let angle = libm::atan2(y, x);
                return length(out_mm - (radius_mm + radius_per_rad * angle), beside_mm(angle));
            }
            return norm(point).min(norm(subtract(point, self.end)));
        }
        // One step of Newton from there. Wherever it gets to is a point of the arc.
        let (least, most) = (self.end_rad.min(0.0), self.end_rad.max(0.0));
        let at_point = libm::atan2(y, x);
        let mut angle = at_point.clamp(least, most);
        for _ in 0..2 {
            let radius = radius_mm + radius_per_rad * angle;
            let ahead = at_point - angle;
            let (sine, cosine) = libm::sincos(ahead);
            let along = out_mm * sine * radius
                + (out_mm * cosine - radius) * radius_per_rad
                + dot(subtract(beside, scale(across_per_rad, angle)), across_per_rad);
            let square =
                radius * radius + radius_per_rad * radius_per_rad + dot(across_per_rad, across_per_rad);
            angle = (angle + along / square).clamp(least, most);
        }
        let radius = radius_mm + radius_per_rad * angle;
        let half = libm::sin(0.5 * (at_point - angle));
        // The chord between both in the plane, without cancellation.
        let flat = ((out_mm - radius) * (out_mm - radius) + 4.0 * out_mm * radius * half * half).sqrt();
        length(flat, beside_mm(angle))
    }
}

fn length(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

    fn corner(degrees: f64) -> [Element; 2] {
        let (sine, cosine) = libm::sincos(degrees.to_radians());
        [
            Element::Line { from: [-10.0, 0.0, 0.0], to: [0.0; 3] },
            Element::Line { from: [0.0; 3], to: [10.0 * cosine, 10.0 * sine, 0.0] },
        ]
    }

    /// Lines x < 0 along X, then a circle of 5 mm to the left that they touch.
    fn line_and_arc() -> [Element; 2] {
        let shape = Spiral {
            outward: [0.0, -1.0, 0.0],
            onward: [1.0, 0.0, 0.0],
            radius_mm: 5.0,
            radius_per_rad: 0.0,
            across_per_rad: [0.0; 3],
        };
        let sweep_rad = core::f64::consts::FRAC_PI_2;
        let line = Element::Line { from: [-10.0, 0.0, 0.0], to: [0.0; 3] };
        [line, Element::Arc { from: [0.0; 3], to: [5.0, 5.0, 0.0], shape, sweep_rad }]
    }

    fn blended([before, after]: &[Element; 2], tolerance_mm: f64, room_mm: f64) -> Option<Blend> {
        Blend::new(before, after, tolerance_mm, room_mm, &LIMITS)
    }

    /// By symmetry the middle is nearest to the corner, and it is as near as it may be.
    #[test]
    fn the_middle_of_a_corners_blend_uses_the_tolerance() {
        for degrees in [1.0, 15.0, 45.0, 90.0, 137.0, 165.0, 169.9] {
            let blend = blended(&corner(degrees), 0.02, 1e3).expect("a blend");
            let Element::Polynomial { from, shape, .. } = blend.element else { panic!("a polynomial") };
            let middle = norm(add(from, shape.offset(0.0, 0.5)));
            assert!(middle <= 0.02 && middle > 0.0199, "{degrees}°: {middle}");
            assert!((blend.distance_mm - middle).abs() < 1e-12);
            assert!((trim_mm(degrees.to_radians(), 0.02) / blend.trim_mm - 1.0).abs() < 0.3, "{degrees}°");
        }
    }

    #[test]
    fn room_and_tolerance_are_kept_and_needed() {
        let blend = blended(&corner(60.0), 1.0, 0.01).expect("a blend");
        assert!((blend.trim_mm - 0.01).abs() < 1e-15 && blend.distance_mm < 0.01);
        assert_eq!(blended(&corner(60.0), 0.0, 1.0), None);
        assert_eq!(blended(&corner(60.0), f64::NAN, 1.0), None);
        assert_eq!(blended(&corner(60.0), 1.0, 0.0), None);
        assert_eq!(blended(&corner(170.1), 1.0, 1.0), None);
        assert_eq!(blended(&corner(180.0), 1.0, 1.0), None);
    }

    /// Tangent, curvature and its derivative are those of the elements where they are left and entered.
    #[test]
    fn ends_are_continuous_to_the_third_derivative() {
        for pair in [corner(75.0), line_and_arc()] {
            let blend = blended(&pair, 0.01, 5.0).expect("a blend");
            let Element::Polynomial { from, to, shape, .. } = blend.element else { panic!("a polynomial") };
            let rests = [pair[0].trimmed(0.0, blend.trim_mm), pair[1].trimmed(blend.trim_mm, 0.0)];
            assert_eq!((rests[0].ends_mm().1, rests[1].ends_mm().0), (from, to));
            let third = |element: &Element, is_end: bool| match element {
                Element::Arc { shape, sweep_rad, .. } => {
                    by_arc_length(shape.derivatives(if is_end { *sweep_rad } else { 0.0 }))
                }
                _ => [element.ends()[0].tangent, [0.0; 3], [0.0; 3]],
            };
            for (rest, is_end, u) in [(&rests[0], true, 0.0), (&rests[1], false, 1.0)] {
                let of_blend = by_arc_length(shape.derivatives(u));
                for (order, (a, b)) in of_blend.into_iter().zip(third(rest, is_end)).enumerate() {
                    let step = norm(subtract(a, b));
                    assert!(
                        step < 1e-9 * 10.0_f64.powi(2 * order as i32),
                        "derivative {order} steps by {step}"
                    );
                }
            }
        }
    }

    /// A jump of curvature without a corner is ramped over a length that the tolerance allows.
    #[test]
    fn a_tangent_arc_is_entered_gradually() {
        let blend = blended(&line_and_arc(), 0.01, 5.0).expect("a blend");
        assert!(blend.distance_mm <= 0.01 && blend.distance_mm > 0.0099, "{blend:?}");
        assert!(blend.trim_mm > 0.5 && blend.trim_mm < 3.0, "{}", blend.trim_mm);
        let Element::Polynomial { shape, .. } = blend.element else { panic!("a polynomial") };
        // Faster than the curvature's step lets pass, 500 mm/s² · 5 mm: 50 mm/s; the arc itself allows 50.
        let feed_mm_s = feed_within(&LIMITS, derivatives(&shape));
        assert!(feed_mm_s > 20.0, "{feed_mm_s}");
    }

    /// Against the nearest of many points of the arc.
    #[test]
    fn the_distance_from_an_arc_is_that_of_its_nearest_point() {
        let [_, arc] = line_and_arc();
        let Element::Arc { shape, .. } = arc else { panic!("an arc") };
        let round = Spiral { radius_per_rad: 1e-3, across_per_rad: [0.0, 0.0, -3e-3], ..shape };
        let steep = Spiral { radius_per_rad: 0.3, across_per_rad: [0.0, 0.0, -2.0], ..shape };
        for (shape, off_mm) in [(shape, 3.0), (round, 3.0), (steep, 0.1)] {
            for angles in [[0.0, 0.6], [0.6, 0.0], [1.1, 0.4]] {
                let near = NearArc::new(&shape, angles[0], angles[1] - angles[0]);
                let at = |part: f64| shape.offset(angles[0], angles[0] + (angles[1] - angles[0]) * part);
                for index in 0..500_u32 {
                    let turn = f64::from(index);
                    let off = [0.3 * libm::sin(7.0 * turn), libm::sin(turn), 0.3 * libm::cos(3.0 * turn)];
                    let point = add(at(0.003 * turn - 0.25), scale(off, off_mm));
                    let found = near.distance_mm(point);
                    let nearest = (0..=4000).map(|part| norm(subtract(point, at(f64::from(part) / 4000.0))));
                    let nearest = nearest.fold(f64::INFINITY, f64::min);
                    // The nearest of them is up to half a step beside the foot.
                    let beside = nearest * nearest - found * found;
                    assert!(
                        found < nearest + 1e-5 * (1.0 + nearest) && beside < 3e-7 + 1e-5 * nearest,
                        "{shape:?} {angles:?} {point:?}: {found} {nearest}"
                    );
                }
            }
        }
    }

    /// Each of the shapes is there because it is the best somewhere.
    #[test]
    fn jerk_and_snap_choose_different_shapes() {
        let [before, after] = corner(90.0);
        let feed = |limits: &Limits<f64>, under: &Limits<f64>| {
            let blend = Blend::new(&before, &after, 0.05, 1e3, limits).expect("a blend");
            let Element::Polynomial { shape, .. } = blend.element else { panic!("a polynomial") };
            feed_within(under, derivatives(&shape))
        };
        let jerk = Limits { snap_mm_s4: 1e9, ..LIMITS };
        let snap = Limits { accel_mm_s2: 1e9, jerk_mm_s3: 1e9, ..LIMITS };
        assert!(feed(&jerk, &jerk) > 1.02 * feed(&snap, &jerk));
        assert!(feed(&snap, &snap) > 1.1 * feed(&jerk, &snap));
    }
}
