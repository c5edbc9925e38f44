//! From work to machine coordinates and back.
//!
//! A point of the program is shifted by G92 or G52, turned about Z by the coordinate system's R, and shifted by
//! the system's origin and the tool's offset, in this order. Without a rotation all of it is exact.

use super::axis::{AXES_MAX, Point};
use super::decimal::Length;

/// The offsets in force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Frame {
    /// Of the coordinate system, in machine coordinates.
    pub(super) origin: Point,
    /// Of the coordinate system \[°\], counter-clockwise in XY.
    pub(super) rotation_deg: f64,
    /// G92 or G52, along the system's axes.
    pub(super) shift: Point,
    /// G43, in machine coordinates.
    pub(super) tool: Point,
}

impl Frame {
    /// Machine coordinates; `None` beyond the range.
    pub(super) fn machine(&self, work: Point) -> Option<Point> {
        let shifted = core::array::from_fn(|axis| work[axis].units() + self.shift[axis].units());
        let turned = self.turned(shifted);
        lengths(core::array::from_fn(|axis| {
            turned[axis] + self.origin[axis].units() + self.tool[axis].units()
        }))
    }

    /// Work coordinates; `None` beyond the range.
    pub(super) fn work(&self, machine: Point) -> Option<Point> {
        let offsets = |axis: usize| self.origin[axis].units() + self.tool[axis].units();
        let moved = core::array::from_fn(|axis| machine[axis].units() - offsets(axis));
        let turned = turn(moved, -self.rotation_deg);
        lengths(core::array::from_fn(|axis| turned[axis] - self.shift[axis].units()))
    }

    /// The program's zero, in machine coordinates \[10⁻¹⁰ mm\].
    pub(super) fn zero(&self) -> [i64; AXES_MAX] {
        let shift = self.turned(self.shift.map(Length::units));
        core::array::from_fn(|axis| shift[axis] + self.origin[axis].units() + self.tool[axis].units())
    }

    /// A vector \[10⁻¹⁰ mm\] of the program, in machine coordinates.
    pub(super) fn turned(&self, vector: [i64; AXES_MAX]) -> [i64; AXES_MAX] {
        turn(vector, self.rotation_deg)
    }

    /// A vector \[10⁻¹⁰ mm\] of the machine, along the program's axes.
    pub(super) fn turned_back(&self, vector: [i64; AXES_MAX]) -> [i64; AXES_MAX] {
        turn(vector, -self.rotation_deg)
    }
}

/// Lengths of so many units; `None` if one is beyond the range.
pub(super) fn lengths(units: [i64; AXES_MAX]) -> Option<Point> {
    let mut lengths = [Length::ZERO; AXES_MAX];
    for (length, units) in lengths.iter_mut().zip(units) {
        *length = Length::from_units(units)?;
    }
    Some(lengths)
}

/// A vector turned about Z; rounded, but by quarter turns.
pub(super) fn turn(vector: [i64; AXES_MAX], angle_deg: f64) -> [i64; AXES_MAX] {
    let mut turned = vector;
    [turned[0], turned[1]] = turn_xy([vector[0], vector[1]], angle_deg);
    turned
}

/// Sine and cosine of a turn \[°\]; of quarter turns exact.
pub(crate) fn turn_sin_cos(angle_deg: f64) -> (f64, f64) {
    match angle_deg % 360.0 {
        0.0 => (0.0, 1.0),
        90.0 | -270.0 => (1.0, 0.0),
        180.0 | -180.0 => (0.0, -1.0),
        270.0 | -90.0 => (-1.0, 0.0),
        angle_deg => libm::sincos(angle_deg.to_radians()),
    }
}

fn turn_xy([x, y]: [i64; 2], angle_deg: f64) -> [i64; 2] {
    match turn_sin_cos(angle_deg) {
        (0.0, 1.0) => [x, y],
        (1.0, 0.0) => [-y, x],
        (0.0, -1.0) => [-x, -y],
        (-1.0, 0.0) => [y, -x],
        (sin, cos) => {
            let (x, y) = (x as f64, y as f64);
            [(x * cos - y * sin).round() as i64, (x * sin + y * cos).round() as i64]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(mm: [f64; 3]) -> Point {
        let mut point = [Length::ZERO; AXES_MAX];
        for (length, mm) in point.iter_mut().zip(mm) {
            *length = Length::nearest(mm).unwrap();
        }
        point
    }

    #[test]
    fn there_and_back() {
        let mut frame = Frame {
            origin: at([100.0, 20.0, 3.0]),
            rotation_deg: 0.0,
            shift: at([1.0, 2.0, 0.5]),
            tool: at([0.0, 0.0, 50.0]),
        };
        assert_eq!(frame.machine(at([1.0, 1.0, 1.0])), Some(at([102.0, 23.0, 54.5])));
        for quarter in [90.0, 180.0, 270.0, -90.0, -180.0, -270.0, 360.0, 450.0] {
            frame.rotation_deg = quarter;
            let point = at([0.1, -7.3, 2.0]);
            assert_eq!(frame.work(frame.machine(point).unwrap()), Some(point), "{quarter}");
        }
        frame.rotation_deg = 90.0;
        assert_eq!(frame.machine(at([1.0, 1.0, 1.0])), Some(at([97.0, 22.0, 54.5])));
        frame.rotation_deg = 30.0;
        let back = frame.work(frame.machine(at([3.0, 4.0, 5.0])).unwrap()).unwrap();
        for (found, expected) in back.iter().zip(at([3.0, 4.0, 5.0])) {
            assert!((found.units() - expected.units()).abs() <= 2);
        }
    }

    #[test]
    fn beyond_the_range_is_nowhere() {
        let frame = Frame { origin: at([1e6, 0.0, 0.0]), ..Frame::default() };
        assert_eq!(frame.machine(at([1.0, 0.0, 0.0])), None);
        assert_eq!(frame.work(at([-1.0, 0.0, 0.0])), None);
    }
}
