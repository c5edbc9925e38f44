//! The kinks that a run passes: where the path turns at once, velocity steps within a tick.
//!
//! No set value of a tick tells such a step: the axes' set acceleration is that of the path on either side. Over the tick it is
//! an acceleration of v·Δt/τ, with the change Δt of the tangent, which the machine has to make.

use motion_kernel::program::Item;
use motion_kernel::units::Position;

use crate::toolpath::smooth::direction_rounding_rad;

/// A kink.
#[derive(Clone, Copy, Debug)]
struct Kink<const N: usize> {
    stretch: u64,
    /// Where it is from the start of its stretch.
    at: Position,
    /// The change of the unit tangent.
    turn: [f64; N],
}

/// The kinks of a path that are still to come.
#[derive(Clone, Debug)]
pub(crate) struct Kinks<const N: usize> {
    /// In the order in which they come, the first one last.
    ahead: Vec<Kink<N>>,
}

impl<const N: usize> Kinks<N> {
    /// Those of the path of some items.
    pub(crate) fn of(items: &[Item<N>]) -> Self {
        let mut ahead = Vec::new();
        let (mut stretch, mut at) = (0, Position::ZERO);
        // Tangent at the end and length of the piece before.
        let mut before: Option<([f64; N], Position)> = None;
        for item in items {
            let (start, end, length) = match item {
                Item::Line { direction, length, .. } => (*direction, *direction, *length),
                Item::Septic { coefficients, length, .. } => {
                    let slope =
                        |powers: &[f64; 7]| (1..).zip(powers).map(|(k, c)| f64::from(k) * c).sum::<f64>();
                    (coefficients.map(|powers| powers[0]), coefficients.each_ref().map(slope), *length)
                }
                Item::EndOfStretch(_) => {
                    (stretch, at, before) = (stretch + 1, Position::ZERO, None);
                    continue;
                }
                _ => continue,
            };
            if let Some((tangent, length_before)) = before {
                let turn: [f64; N] = core::array::from_fn(|axis| start[axis] - tangent[axis]);
                let shorter_mm = length.min(length_before).to_mm();
                let angle_rad = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
                if angle_rad > direction_rounding_rad(shorter_mm) {
                    ahead.push(Kink { stretch, at, turn });
                }
            }
            at = at + length;
            before = Some((end, length));
        }
        ahead.reverse();
        Self { ahead }
    }

    /// What those that are passed in a tick add to the acceleration of the axes, at this feed and up to this place \[mm/s²\].
    pub(crate) fn passed(&mut self, (stretch, at): (u64, Position), feed_mm_s: f64, tick_s: f64) -> [f64; N] {
        let mut accel = [0.0; N];
        while let Some(kink) = self.ahead.pop_if(|kink| (kink.stretch, kink.at) < (stretch, at)) {
            // What was skipped with an aborted stretch was not passed.
            if kink.stretch == stretch {
                for (accel, turn) in accel.iter_mut().zip(kink.turn) {
                    *accel += feed_mm_s * turn / tick_s;
                }
            }
        }
        accel
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lines and a curve that goes on in the second's direction: one kink, which tells its place and its turn once.
    #[test]
    fn a_kink_is_told_in_the_tick_that_passes_it() {
        let [sine, cosine] = [libm::sin(0.004), libm::cos(0.004)];
        let mm = |mm: f64| Position::from_mm(mm).expect("in range");
        let line =
            |direction| Item::Line { line: 1, start: [Position::ZERO; 2], direction, length: mm(10.0) };
        let curved = [[cosine, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [sine, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0]];
        let curve =
            Item::Septic { line: 2, start: [Position::ZERO; 2], coefficients: curved, length: mm(1.0) };
        let end = Item::EndOfStretch([Position::ZERO; 2]);
        let items =
            [line([1.0, 0.0]), line([cosine, sine]), curve, end, line([0.0, 1.0]), line([1.0, 0.0]), end];
        let mut kinks = Kinks::of(&items);
        assert_eq!(kinks.ahead.len(), 2);
        assert_eq!(kinks.passed((0, mm(9.999)), 50.0, 0.0005), [0.0; 2]);
        // Where it is reached the piece before still counts.
        assert_eq!(kinks.passed((0, mm(10.0)), 50.0, 0.0005), [0.0; 2]);
        let [x, y] = kinks.passed((0, mm(10.02)), 50.0, 0.0005);
        assert!((y - 50.0 * sine / 0.0005).abs() < 1e-9 && (x + 50.0 * (1.0 - cosine) / 0.0005).abs() < 1e-9);
        assert_eq!(kinks.passed((0, mm(21.0)), 50.0, 0.0005), [0.0; 2]);
        // The second stretch was given up on its first line.
        assert_eq!(kinks.passed((1, mm(9.0)), 50.0, 0.0005), [0.0; 2]);
        assert_eq!(kinks.passed((2, mm(0.0)), 50.0, 0.0005), [0.0; 2]);
        assert!(kinks.ahead.is_empty());
    }
}
