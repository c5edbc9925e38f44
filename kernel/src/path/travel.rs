//! The travel of the axes, and whether a piece stays within it.
//!
//! Background: a piece beyond it is refused before it is queued. A piece may leave the travel between its
//! ends, like an arc that bulges, so all of it is checked: in [`PARTS`] parts, each of which is close to its
//! chord.

use super::Piece;
use crate::law::PathMotion;
use crate::num::Real;
use crate::units::Position;

/// Parts of a piece. A part of the length h of a curve with |x''| ≤ κ leaves its chord by κ·h²/8 at most: 0.2
/// µm for 8 mm of an arc of 10 mm, 2 µm for the longest and most bent piece possible.
const PARTS: u8 = 64;
/// A piece farther out by less is not beyond \[mm\]: pieces are rounded. Less than the kernel's guard
/// tolerates.
const ROUNDING_MM: f64 = 1.0e-3;

/// Least and greatest position of every axis that has them.
pub type Travel<const AXES: usize> = [Option<[Position; 2]>; AXES];

impl<R: Real, const AXES: usize> Piece<R, AXES> {
    /// The first axis that a piece takes beyond its travel, and how far out \[mm\].
    #[must_use]
    pub fn beyond(&self, travel: &Travel<AXES>) -> Option<(usize, f64)> {
        if travel.iter().all(Option::is_none) {
            return None;
        }
        let length_mm = self.length().to_mm();
        let part_mm = length_mm / f64::from(PARTS);
        let bulge_mm = self.steepness().bend_per_mm() * part_mm * part_mm / 8.0;
        let still = PathMotion::default();
        for part in 0..=PARTS {
            let s_mm = R::from_f64(part_mm * f64::from(part)).min(self.length().to_offset());
            let at = self.at(s_mm, &still);
            for (axis, (setpoint, ends)) in at.iter().zip(travel).enumerate() {
                let Some([low, high]) = ends else { continue };
                let beyond_mm = (*low - setpoint.position).to_mm().max((setpoint.position - *high).to_mm());
                if beyond_mm + bulge_mm > ROUNDING_MM {
                    return Some((axis, setpoint.position.to_mm()));
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn at(mm: f64) -> Position {
        Position::from_mm(mm).expect("in range")
    }

    /// Random cubic-like pieces by arc length are hard to make by hand: arcs are not. Their top is known.
    #[test]
    fn an_arc_that_bulges_beyond_is_seen_between_its_ends() {
        let random = Random::new(7);
        let (mut refused, mut accepted) = (0, 0);
        for _ in 0..2000 {
            let radius_mm = 5.0 + 100.0 * random.unit();
            // Symmetric about its top: its angle is ±half, and its polynomial the sine's and cosine's series.
            let half = 0.02 + 0.15 * random.unit();
            let length_mm = 2.0 * half * radius_mm;
            if length_mm > 16.0 {
                continue;
            }
            // r(φ) = R·(sin φ, cos φ), φ = half·(2u − 1); by Taylor about u = 0, to the seventh power.
            let (s0, c0) = (-half).sin_cos();
            let mut coefficients = [[0.0; 7]; 2];
            let mut factorial = 1.0;
            for k in 1..=7_u32 {
                factorial *= f64::from(k);
                let power = (2.0 * half).powi(k as i32) / factorial;
                let (ds, dc) = match k % 4 {
                    1 => (c0, -s0),
                    2 => (-s0, -c0),
                    3 => (-c0, s0),
                    _ => (s0, c0),
                };
                let index = k as usize - 1;
                coefficients[0][index] = radius_mm * ds * power / length_mm;
                coefficients[1][index] = radius_mm * dc * power / length_mm;
            }
            let piece =
                Piece::<f64, 2>::septic(1, [at(0.0); 2], coefficients, at(length_mm)).expect("a piece");
            let top_mm = radius_mm * (1.0 - half.cos());
            // Around the top, on both sides, but for what is rounded.
            let limit_mm = top_mm + 0.02 * (random.unit() - 0.5);
            if (limit_mm - top_mm).abs() < 3e-3 {
                continue;
            }
            let found = piece.beyond(&[None, Some([at(-100.0), at(limit_mm)])]);
            assert_eq!(found.is_some(), limit_mm < top_mm, "{radius_mm} {half} {limit_mm} {top_mm}");
            if let Some((axis, mm)) = found {
                assert!(axis == 1 && mm <= top_mm + 1e-9);
                refused += 1;
            } else {
                accepted += 1;
            }
            // Its ends are within in any case.
            assert!(limit_mm > 0.0 || found.is_some());
            assert_eq!(piece.beyond(&[None, None]), None);
        }
        assert!(refused > 300 && accepted > 300, "{refused} {accepted}");
    }
}
