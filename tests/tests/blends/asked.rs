//! Programmed moves: their points, distances and tangents in closed form, their text, and random ones.

use super::{Vector, along, dot, minus, norm, rounded};
use motion_tests::random::Random;

/// A programmed move.
#[derive(Clone, Copy, Debug)]
pub(super) enum Asked {
    Line {
        from: Vector,
        to: Vector,
    },
    /// Axes of the plane, the normal last; centre in the plane; the sweep is counter-clockwise if positive.
    Arc {
        from: Vector,
        to: Vector,
        axes: [usize; 3],
        centre: [f64; 2],
        sweep: f64,
    },
}

impl Asked {
    pub(super) fn to(&self) -> Vector {
        match *self {
            Self::Line { to, .. } | Self::Arc { to, .. } => to,
        }
    }

    /// The tangent at the end.
    pub(super) fn heading(&self) -> Vector {
        match *self {
            Self::Line { from, to } => {
                let chord = minus(to, from);
                chord.map(|c| c / norm(chord))
            }
            Self::Arc { to, axes: [first, second, _], centre, sweep, .. } => {
                let (x, y) = (to[first] - centre[0], to[second] - centre[1]);
                let mut heading = [0.0; 3];
                heading[first] = -y * sweep.signum() / x.hypot(y);
                heading[second] = x * sweep.signum() / x.hypot(y);
                heading
            }
        }
    }

    /// The point at a part of the sweep or the length.
    pub(super) fn at(&self, part: f64) -> Vector {
        match *self {
            Self::Line { from, to } => along(from, minus(to, from), part),
            Self::Arc { from, axes: [first, second, _], centre, sweep, .. } => {
                let (x, y) = (from[first] - centre[0], from[second] - centre[1]);
                let angle = y.atan2(x) + sweep * part;
                let mut point = from;
                point[first] = centre[0] + x.hypot(y) * angle.cos();
                point[second] = centre[1] + x.hypot(y) * angle.sin();
                point
            }
        }
    }

    pub(super) fn distance(&self, point: Vector) -> f64 {
        let to_ends = norm(minus(point, self.at(0.0))).min(norm(minus(point, self.to())));
        match *self {
            Self::Line { from, to } => {
                let chord = minus(to, from);
                let foot = dot(minus(point, from), chord) / dot(chord, chord);
                if (0.0..=1.0).contains(&foot) {
                    norm(minus(point, along(from, chord, foot)))
                } else {
                    to_ends
                }
            }
            Self::Arc { from, axes: [first, second, normal], centre, sweep, .. } => {
                let (x, y) = (point[first] - centre[0], point[second] - centre[1]);
                let (x0, y0) = (from[first] - centre[0], from[second] - centre[1]);
                let turned =
                    ((y.atan2(x) - y0.atan2(x0)) * sweep.signum()).rem_euclid(core::f64::consts::TAU);
                if turned <= sweep.abs() {
                    (x.hypot(y) - x0.hypot(y0)).hypot(point[normal] - from[normal])
                } else {
                    to_ends
                }
            }
        }
    }

    pub(super) fn text(&self) -> String {
        match *self {
            Self::Line { to, .. } => format!("G1 X{:.10} Y{:.10} Z{:.10}\n", to[0], to[1], to[2]),
            Self::Arc { from, to, axes: [first, second, normal], centre, sweep } => {
                let (plane, words) = [("G19", "XJK"), ("G18", "YKI"), ("G17", "ZIJ")][normal];
                let words: Vec<char> = words.chars().collect();
                let turn = if sweep < 0.0 { "G2" } else { "G3" };
                format!(
                    "{plane} {turn} X{:.10} Y{:.10} Z{:.10} {}{:.10} {}{:.10}\n",
                    to[0],
                    to[1],
                    to[2],
                    words[1],
                    centre[0] - from[first],
                    words[2],
                    centre[1] - from[second]
                )
            }
        }
    }
}

/// An arc from `from` with the tangent `heading`, which lies in the plane.
pub(super) fn arc(from: Vector, heading: Vector, normal: usize, radius: f64, sweep: f64) -> Asked {
    let axes = [(normal + 1) % 3, (normal + 2) % 3, normal];
    let (hx, hy) = (heading[axes[0]], heading[axes[1]]);
    // The centre lies to the left of a counter-clockwise arc.
    let (cx, cy) = (-hy * radius * sweep.signum(), hx * radius * sweep.signum());
    let centre = [rounded(from[axes[0]] + rounded(cx)), rounded(from[axes[1]] + rounded(cy))];
    let (sine, cosine) = sweep.sin_cos();
    let mut to = from;
    let (x, y) = (from[axes[0]] - centre[0], from[axes[1]] - centre[1]);
    to[axes[0]] = rounded(centre[0] + x * cosine - y * sine);
    to[axes[1]] = rounded(centre[1] + x * sine + y * cosine);
    Asked::Arc { from, to, axes, centre, sweep }
}

pub(super) fn line(from: Vector, heading: Vector, length: f64) -> Asked {
    Asked::Line { from, to: along(from, heading, length).map(rounded) }
}

/// `heading` turned by `angle`: in the plane of `normal`, or anywhere.
pub(super) fn turned(random: &mut Random, heading: Vector, normal: Option<usize>, angle: f64) -> Vector {
    let aside = loop {
        let other = match normal {
            Some(normal) => {
                let [first, second] = [(normal + 1) % 3, (normal + 2) % 3];
                let mut aside = [0.0; 3];
                let sign = random.sign();
                aside[first] = -heading[second] * sign;
                aside[second] = heading[first] * sign;
                aside
            }
            None => random.direction(),
        };
        let across = along(other, heading, -dot(other, heading));
        if norm(across) > 0.1 {
            break across.map(|c| c / norm(across));
        }
    };
    core::array::from_fn(|axis| heading[axis] * angle.cos() + aside[axis] * angle.sin())
}

/// The next move after a corner of `angle`.
pub(super) fn next(
    random: &mut Random,
    from: Vector,
    heading: Vector,
    angle: f64,
    length: f64,
    plane: Option<usize>,
) -> Asked {
    let heading = turned(random, heading, plane, angle);
    match plane {
        Some(normal) if random.chance(0.5) => {
            let sweep = random.between(5.0_f64, 300.0).to_radians();
            arc(from, heading, normal, length.max(1e-3) / sweep, sweep * random.sign())
        }
        _ => line(from, heading, length),
    }
}

/// Corners and lengths of every size, in a plane or in space.
pub(super) fn corners(
    random: &mut Random,
    moves: usize,
    length: (f64, f64),
    angle: (f64, f64),
) -> Vec<Asked> {
    let plane = random.chance(0.7).then(|| random.below(3));
    let mut heading = random.direction();
    if let Some(normal) = plane {
        heading = [0.0; 3];
        let direction = random.between(0.0, core::f64::consts::TAU);
        heading[(normal + 1) % 3] = direction.cos();
        heading[(normal + 2) % 3] = direction.sin();
    }
    let mut at = [0.0; 3];
    let mut asked = Vec::new();
    for index in 0..moves {
        let length = random.log(length.0, length.1);
        let is_tangent = index > 0 && random.chance(0.2);
        let corner = if index == 0 || is_tangent { 0.0 } else { random.between(angle.0, angle.1) };
        let step = next(random, at, heading, corner, length, plane);
        (at, heading) = (step.to(), step.heading());
        asked.push(step);
    }
    asked
}

pub(super) fn program(asked: &[Asked], tolerance: f64, feed_mm_min: f64) -> String {
    let moves: String = asked.iter().map(Asked::text).collect();
    format!("G64 P{tolerance:.10} F{feed_mm_min:.3}\n{moves}M2\n")
}
