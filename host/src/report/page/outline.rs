//! The path as corners of a line, each with the coarsest picture that needs it.
//!
//! Consumes the set positions of all ticks; produces vertices. A picture of a tolerance takes the vertices whose rank is above
//! its level: the line through them is within the tolerance of the true path, and the path within it of the line, in space and
//! so in every view. Pictures share their vertices: what a finer one adds lies between those of the coarser ones.
//!
//! The rule is Douglas and Peucker's: between two vertices the point farthest from their chord is one, too, if it is farther
//! than the tolerance. It is applied once, to the finest tolerance; the distance at which a point was taken in is its rank.

use crate::toolpath::{dot, subtract};

/// Points that are looked at together: so a point is looked at a bounded number of times.
const CHUNK: usize = 1024;

/// The rank of vertices that every picture has.
pub(super) const RANK_MAX: u8 = 48;

/// A corner of the drawn path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    /// Its number among the points.
    pub(super) point: usize,
    /// It belongs to pictures of a level below this.
    pub(super) rank: u8,
}

/// The tolerance of a level, in the unit of the finest one.
pub(super) fn tolerance(finest: f64, level: u8) -> f64 {
    finest * libm::exp2(f64::from(level))
}

/// The vertices of a path through `points`, down to the tolerance `finest`.
pub(super) fn outline<const D: usize>(points: &[[f64; D]], finest: f64) -> Vec<Vertex> {
    let mut vertices = Vec::new();
    let Some(last) = points.len().checked_sub(1) else { return vertices };
    vertices.push(Vertex { point: 0, rank: RANK_MAX });
    for from in (0..last).step_by(CHUNK) {
        let to = (from + CHUNK).min(last);
        between(points, (from, to), finest, &mut vertices);
        vertices.push(Vertex { point: to, rank: RANK_MAX });
    }
    vertices
}

/// Adds the vertices between two, in their order.
fn between<const D: usize>(
    points: &[[f64; D]],
    (from, to): (usize, usize),
    finest: f64,
    vertices: &mut Vec<Vertex>,
) {
    // Stretches that are to be divided, the next one last, and vertices to be given out between them.
    enum Left {
        Stretch(usize, usize, u8),
        Vertex(Vertex),
    }
    let mut left = vec![Left::Stretch(from, to, RANK_MAX)];
    while let Some(next) = left.pop() {
        let (from, to, above) = match next {
            Left::Vertex(vertex) => {
                vertices.push(vertex);
                continue;
            }
            Left::Stretch(from, to, above) => (from, to, above),
        };
        let chord = Chord::new(points[from], points[to]);
        let (mut farthest, mut most) = (from, 0.0);
        for (index, &point) in points.iter().enumerate().take(to).skip(from + 1) {
            let squared = chord.distance_squared(point);
            if squared > most {
                (farthest, most) = (index, squared);
            }
        }
        let distance = most.sqrt();
        if distance > finest {
            // No finer than the stretch it divides, so that pictures share vertices.
            let level = libm::log2(distance / finest).ceil().min(f64::from(RANK_MAX)) as u8;
            let rank = level.clamp(1, above);
            left.push(Left::Stretch(farthest, to, rank));
            left.push(Left::Vertex(Vertex { point: farthest, rank }));
            left.push(Left::Stretch(from, farthest, rank));
        }
    }
}

/// A straight line between two points.
struct Chord<const D: usize> {
    from: [f64; D],
    along: [f64; D],
    length_squared: f64,
}

impl<const D: usize> Chord<D> {
    fn new(from: [f64; D], to: [f64; D]) -> Self {
        let along = subtract(to, from);
        Self { from, along, length_squared: dot(along, along) }
    }

    /// To the nearest point between its ends.
    fn distance_squared(&self, point: [f64; D]) -> f64 {
        let to = subtract(point, self.from);
        let part = if self.length_squared > 0.0 { dot(to, self.along) / self.length_squared } else { 0.0 };
        let away = subtract(to, self.along.map(|along| part.clamp(0.0, 1.0) * along));
        dot(away, away)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use motion_tests::random::Random;

    use super::*;

    /// A tool path: lines, arcs, dwells, there and back, drilling, noise.
    fn random_path(random: &mut Random) -> Vec<[f64; 3]> {
        let mut points = vec![[0.0; 3]];
        for _ in 0..1 + random.below(12) {
            let here = points[points.len() - 1];
            let ticks = 1 + random.below(900);
            let size = random.log(0.01, 100.0);
            let to = random.vector(size);
            let radius = random.log(0.05, 50.0);
            let turn = random.between(-TAU, TAU);
            let kind = random.below(5);
            for tick in 1..=ticks {
                let part = tick as f64 / ticks as f64;
                let place: [f64; 3] = match kind {
                    0 | 1 => std::array::from_fn(|axis| here[axis] + part * to[axis]),
                    2 => {
                        let (sine, cosine) = libm::sincos(turn * part);
                        [here[0] + radius * sine, here[1] + radius * (1.0 - cosine), here[2] + part * to[2]]
                    }
                    // Down and up again.
                    3 => [here[0], here[1], here[2] - radius * (1.0 - (2.0 * part - 1.0).abs())],
                    _ => here.map(|c| c + 1e-4 * random.unit()),
                };
                points.push(place);
            }
        }
        points
    }

    fn distance(point: [f64; 3], line: &[[f64; 3]]) -> f64 {
        let of = |pair: &[[f64; 3]]| Chord::new(pair[0], pair[1]).distance_squared(point);
        line.windows(2).map(of).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// The drawn line is within its tolerance of the path, and the path of it, at every level; no corner is thinned away.
    #[test]
    fn every_picture_is_within_its_tolerance() {
        let mut random = Random::of_stream(23);
        for _ in 0..25 {
            let points = random_path(&mut random);
            let finest = random.log(1e-4, 1e-2);
            let vertices = outline(&points, finest);
            assert!(vertices.windows(2).all(|pair| pair[0].point < pair[1].point));
            for level in [0, 1, 3, 6, 10, 14] {
                let kept: Vec<usize> =
                    vertices.iter().filter(|vertex| vertex.rank > level).map(|vertex| vertex.point).collect();
                let limit = tolerance(finest, level) * (1.0 + 1e-9);
                for pair in kept.windows(2) {
                    let line = [points[pair[0]], points[pair[1]]];
                    let passed = &points[pair[0]..=pair[1]];
                    for &point in passed {
                        assert!(distance(point, &line) <= limit, "level {level}");
                    }
                    for part in 0..=8 {
                        let part = f64::from(part) / 8.0;
                        let drawn = std::array::from_fn(|a| line[0][a] + part * (line[1][a] - line[0][a]));
                        let away = if passed.len() > 1 { distance(drawn, passed) } else { 0.0 };
                        assert!(away <= limit, "level {level}: {away} of {limit}");
                    }
                }
            }
        }
    }

    #[test]
    fn straight_lines_and_rests_cost_nothing_and_corners_stay() {
        let mut points: Vec<[f64; 3]> = (0..=500).map(|i| [f64::from(i) * 0.1, 0.0, 0.0]).collect();
        points.extend([[50.0, 0.0, 0.0]; 300]);
        points.extend((1..=200).map(|i| [50.0, f64::from(i) * 0.1, 0.0]));
        let vertices = outline(&points, 1e-3);
        assert_eq!(vertices.len(), 3, "{vertices:?}");
        assert_eq!(points[vertices[1].point], [50.0, 0.0, 0.0]);
        // The retract of a drilled hole stays upright.
        let drill: Vec<[f64; 3]> =
            (0..=100).map(|i| [0.0, 0.0, -f64::from(50 - (i - 50i32).abs())]).collect();
        assert_eq!(outline(&drill, 1e-3).iter().map(|v| v.point).collect::<Vec<_>>(), [0, 50, 100]);
        assert_eq!(outline::<2>(&[], 1e-3), []);
        assert_eq!(outline(&[[1.0, 2.0]], 1e-3), [Vertex { point: 0, rank: RANK_MAX }]);
    }
}
