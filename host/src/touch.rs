//! What a probe touches: boxes where the axes may be while it does.
//!
//! Consumes boxes from the machine file and positions of the axes in machine coordinates; produces whether the probe
//! touches, and where along a straight move that changes. In time linear in the boxes, but for a move that leaves many
//! of them one behind the other. Cannot fail.
//!
//! The reader of G-code and the simulated machine ask the same boxes: the one where the program will find the surface, the
//! other whether the axes touch it now.

use serde::{Deserialize, Serialize};

/// The surfaces of a machine: all of its boxes together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// They may overlap.
    pub boxes: Vec<TouchBox>,
}

/// A box along the axes. Its faces belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TouchBox {
    /// X Y Z of its least corner \[mm\], in machine coordinates.
    pub low_mm: [f64; 3],
    /// X Y Z of its greatest corner \[mm\].
    pub high_mm: [f64; 3],
}

/// The part of a straight move that lies in a box: from 0, its start, to 1, its end, or beyond.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    enters: Face,
    leaves: Face,
}

/// Where a straight move meets the plane of a face.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Share of the move.
    share: f64,
    axis: usize,
    at_mm: f64,
}

impl Face {
    /// The point on the plane: exactly on it along its axis.
    fn point_mm(&self, from_mm: [f64; 3], to_mm: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| match axis == self.axis {
            true => self.at_mm,
            false => from_mm[axis] + self.share * (to_mm[axis] - from_mm[axis]),
        })
    }
}

impl TouchBox {
    fn contains(&self, at_mm: [f64; 3]) -> bool {
        (0..3).all(|axis| self.low_mm[axis] <= at_mm[axis] && at_mm[axis] <= self.high_mm[axis])
    }

    /// The part of the line through two different points that lies in the box.
    fn crossing(&self, from_mm: [f64; 3], to_mm: [f64; 3]) -> Option<Crossing> {
        let mut crossing: Option<Crossing> = None;
        for axis in 0..3 {
            let (low_mm, high_mm, way_mm) =
                (self.low_mm[axis], self.high_mm[axis], to_mm[axis] - from_mm[axis]);
            if way_mm == 0.0 {
                if from_mm[axis] < low_mm || from_mm[axis] > high_mm {
                    return None;
                }
                continue;
            }
            let face = |at_mm: f64| Face { share: (at_mm - from_mm[axis]) / way_mm, axis, at_mm };
            let (near_mm, far_mm) = if way_mm > 0.0 { (low_mm, high_mm) } else { (high_mm, low_mm) };
            let (enters, leaves) = (face(near_mm), face(far_mm));
            crossing = Some(match crossing {
                None => Crossing { enters, leaves },
                Some(so_far) => Crossing {
                    enters: if enters.share > so_far.enters.share { enters } else { so_far.enters },
                    leaves: if leaves.share < so_far.leaves.share { leaves } else { so_far.leaves },
                },
            });
        }
        crossing.filter(|crossing| crossing.enters.share <= crossing.leaves.share)
    }
}

impl Surface {
    /// Whether the probe touches at a position of the axes \[mm\].
    #[must_use]
    pub fn is_touched(&self, at_mm: [f64; 3]) -> bool {
        self.boxes.iter().any(|touch| touch.contains(at_mm))
    }

    /// Where a straight move from a point that does not touch meets the surface first.
    #[must_use]
    pub fn touched_at_mm(&self, from_mm: [f64; 3], to_mm: [f64; 3]) -> Option<[f64; 3]> {
        let crossings = self.boxes.iter().filter_map(|touch| touch.crossing(from_mm, to_mm));
        let met = crossings.filter(|crossing| crossing.leaves.share >= 0.0 && crossing.enters.share <= 1.0);
        let first = met.min_by(|a, b| a.enters.share.total_cmp(&b.enters.share))?;
        Some(first.enters.point_mm(from_mm, to_mm))
    }

    /// Where a straight move from a point that touches leaves the surface first: the boxes that it passes from one into the
    /// next are one surface.
    #[must_use]
    pub fn left_at_mm(&self, from_mm: [f64; 3], to_mm: [f64; 3]) -> Option<[f64; 3]> {
        let crossings = self.boxes.iter().filter_map(|touch| touch.crossing(from_mm, to_mm));
        let crossings: Vec<Crossing> = crossings.collect();
        let mut last: Option<Face> = None;
        loop {
            // Every turn comes farther, so there are at most as many as boxes.
            let so_far = last.map_or(0.0, |face| face.share);
            let in_touch = crossings.iter().filter(|crossing| crossing.enters.share <= so_far);
            let next = in_touch.map(|crossing| crossing.leaves).max_by(|a, b| a.share.total_cmp(&b.share));
            match next {
                Some(face) if last.is_none_or(|last| face.share > last.share) => last = Some(face),
                _ => break,
            }
        }
        let last = last.filter(|face| (0.0..1.0).contains(&face.share))?;
        Some(last.point_mm(from_mm, to_mm))
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "faces are met exactly")]
mod tests {
    use super::*;

    fn surface(boxes: &[[[f64; 3]; 2]]) -> Surface {
        Surface { boxes: boxes.iter().map(|&[low_mm, high_mm]| TouchBox { low_mm, high_mm }).collect() }
    }

    #[test]
    fn a_plate_is_met_from_above_and_from_the_side() {
        let plate = surface(&[[[0.0, 0.0, -20.0], [100.0, 50.0, -10.1]]]);
        assert_eq!(plate.touched_at_mm([5.0, 5.0, 0.0], [5.0, 5.0, -30.0]), Some([5.0, 5.0, -10.1]));
        assert_eq!(plate.touched_at_mm([5.0, 5.0, 0.0], [5.0, 5.0, -10.0]), None);
        assert_eq!(plate.touched_at_mm([-5.0, 5.0, -15.0], [15.0, 9.0, -15.0]), Some([0.0, 6.0, -15.0]));
        // The move's end is on the face; the other way, beside it, and behind the start.
        assert_eq!(plate.touched_at_mm([5.0, 5.0, 0.0], [5.0, 5.0, -10.1]), Some([5.0, 5.0, -10.1]));
        assert_eq!(plate.touched_at_mm([5.0, 5.0, 0.0], [5.0, 5.0, 9.0]), None);
        assert_eq!(plate.touched_at_mm([-5.0, 5.0, 0.0], [-5.0, 5.0, -30.0]), None);
        assert!(plate.is_touched([0.0, 50.0, -10.1]) && !plate.is_touched([0.0, 50.0, -10.099]));
    }

    #[test]
    fn the_nearest_box_counts() {
        let bore = surface(&[[[3.0, -9.0, -9.0], [5.0, 9.0, 9.0]], [[-5.0, -9.0, -9.0], [-3.5, 9.0, 9.0]]]);
        assert_eq!(bore.touched_at_mm([0.0; 3], [9.0, 0.0, 0.0]), Some([3.0, 0.0, 0.0]));
        assert_eq!(bore.touched_at_mm([0.0; 3], [-9.0, 0.0, 0.0]), Some([-3.5, 0.0, 0.0]));
        assert_eq!(bore.touched_at_mm([0.0; 3], [0.0, 9.0, 0.0]), None);
        // Behind the first box there is another.
        assert_eq!(bore.touched_at_mm([9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]), Some([5.0, 0.0, 0.0]));
    }

    #[test]
    fn boxes_side_by_side_are_left_together() {
        let stairs = surface(&[
            [[4.0, 0.0, 0.0], [9.0, 1.0, 1.0]],
            [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]],
            [[2.0, 0.0, 0.0], [5.0, 1.0, 1.0]],
        ]);
        let from = [1.0, 0.5, 0.5];
        assert_eq!(stairs.left_at_mm(from, [20.0, 0.5, 0.5]), Some([9.0, 0.5, 0.5]));
        assert_eq!(stairs.left_at_mm(from, [-1.0, 0.5, 0.5]), Some([0.0, 0.5, 0.5]));
        // An end on the face still touches, as does one within.
        assert_eq!(stairs.left_at_mm(from, [9.0, 0.5, 0.5]), None);
        assert_eq!(stairs.left_at_mm(from, [8.0, 0.5, 0.5]), None);
        // From the face outwards it is left at once.
        assert_eq!(stairs.left_at_mm([1.0, 0.5, 1.0], [1.0, 0.5, 5.0]), Some([1.0, 0.5, 1.0]));
    }
}
