//! The time that a plan's path takes under acceleration alone.
//!
//! Consumes a plan and its machine; produces the time of the fastest motion over its path that keeps the
//! programmed feed, the feeds of path and axes and their accelerations, with no limit of jerk and snap and no
//! ceiling made by them. It stops where the plan has to stop at a corner. Between two points of a curve the
//! acceleration along the path is taken as constant, so on curves the time is good to some 10⁻³. The limits of the path
//! bind the linear axes.

use crate::machine::{AxisSettings, Machine};
use crate::planning::stretch::StretchBlock;
use crate::planning::{Item, Plan, Stretch};
use crate::toolpath::curve::by_arc_length;
use crate::toolpath::{Element, Vector, dot, norm};

/// The distance between two points of a curve \[mm\], and how many there are at least and at most.
const STEP_MM: f64 = 0.01;
const CELLS: [f64; 2] = [64.0, 16_384.0];

/// The time \[s\], dwells included, stops not.
#[must_use]
pub fn acceleration_time_s<const N: usize>(plan: &Plan<N>, machine: &Machine<N>) -> f64 {
    plan.items
        .iter()
        .map(|item| match item {
            Item::Stretch(stretch) => of_stretch_s(stretch, machine),
            &Item::Dwell { seconds, .. } => seconds,
            Item::Switch { .. } | Item::Stop { .. } => 0.0,
        })
        .sum()
}

/// A point of the path, as limits see it.
#[derive(Clone, Copy)]
struct Point<const N: usize> {
    tangent: Vector<N>,
    /// κN \[1/mm\].
    curvature: Vector<N>,
}

/// What linear axes have of a point's tangent t and curvature κN.
struct Linear {
    /// |t|.
    share: f64,
    /// |κN|.
    bend_per_mm: f64,
    /// t·κN, 0 where they have all of both.
    lean_per_mm: f64,
}

/// From one point to the next.
struct Cell<const N: usize> {
    ends: [Point<N>; 2],
    length_mm: f64,
    /// The programmed feed \[mm/s\].
    feed_mm_s: f64,
    /// Motion has to stop at its end.
    stops: bool,
}

impl<const N: usize> Point<N> {
    /// The greatest v² there.
    fn most(&self, feed_mm_s: f64, machine: &Machine<N>) -> f64 {
        let Linear { share, bend_per_mm, .. } = self.linear(machine);
        let feed_mm_s = feed_mm_s.min(machine.path.feed_mm_s / share);
        let path = (feed_mm_s * feed_mm_s).min(machine.path.accel_mm_s2 / bend_per_mm);
        self.axes(machine).fold(path, |most, (tangent, curvature, axis)| {
            let feed_mm_s = axis.feed_mm_s / tangent.abs();
            most.min(feed_mm_s * feed_mm_s).min(axis.accel_mm_s2 / curvature.abs())
        })
    }

    /// The greatest acceleration along the path at v², forwards (1) or backwards (−1) \[mm/s²\].
    fn accel(&self, square: f64, direction: f64, machine: &Machine<N>) -> f64 {
        let Linear { share, bend_per_mm, lean_per_mm } = self.linear(machine);
        let (across, lean) = (square * bend_per_mm, direction * square * lean_per_mm);
        let most = machine.path.accel_mm_s2;
        // |a·t + v²·κN| = most, of the linear axes; without any there is no such a.
        let rest = (most * most - across * across).max(0.0);
        let along = ((lean * lean + share * share * rest).sqrt() - lean) / (share * share);
        let along = if share > 0.0 { along } else { f64::INFINITY };
        let least = self.axes(machine).fold(along, |least, (tangent, curvature, axis)| {
            if tangent == 0.0 {
                return least;
            }
            let bent = square * curvature * (direction * tangent).signum();
            least.min((axis.accel_mm_s2 - bent) / tangent.abs())
        });
        least.max(0.0)
    }

    /// The part that the limits of the path bind.
    fn linear(&self, machine: &Machine<N>) -> Linear {
        let is_linear = machine.linear_places();
        let is_still = |axis: usize| self.tangent[axis] == 0.0 && self.curvature[axis] == 0.0;
        if (0..N).all(|axis| is_linear[axis] || is_still(axis)) {
            return Linear { share: 1.0, bend_per_mm: norm(self.curvature), lean_per_mm: 0.0 };
        }
        let linear = |vector: Vector<N>| -> Vector<N> {
            core::array::from_fn(|axis| if is_linear[axis] { vector[axis] } else { 0.0 })
        };
        let (tangent, curvature) = (linear(self.tangent), linear(self.curvature));
        Linear { share: norm(tangent), bend_per_mm: norm(curvature), lean_per_mm: dot(tangent, curvature) }
    }

    fn axes<'a>(&self, machine: &'a Machine<N>) -> impl Iterator<Item = (f64, f64, &'a AxisSettings)> {
        let of_axes = self.tangent.into_iter().zip(self.curvature).zip(&machine.axes);
        of_axes.map(|((tangent, curvature), axis)| (tangent, curvature, axis))
    }
}

fn of_stretch_s<const N: usize>(stretch: &Stretch<N>, machine: &Machine<N>) -> f64 {
    let cells: Vec<Cell<N>> = stretch.blocks.iter().flat_map(cells).collect();
    // v² at every point, at rest at both ends.
    let mut squares = vec![f64::INFINITY; cells.len() + 1];
    for (index, cell) in cells.iter().enumerate() {
        for (end, point) in cell.ends.iter().enumerate() {
            let square = &mut squares[index + end];
            *square = square.min(point.most(cell.feed_mm_s, machine));
        }
        if cell.stops {
            squares[index + 1] = 0.0;
        }
    }
    (squares[0], squares[cells.len()]) = (0.0, 0.0);
    for (index, Cell { ends: [start, _], length_mm, .. }) in cells.iter().enumerate() {
        let gained = 2.0 * length_mm * start.accel(squares[index], 1.0, machine);
        squares[index + 1] = squares[index + 1].min(squares[index] + gained);
    }
    for (index, Cell { ends: [_, end], length_mm, .. }) in cells.iter().enumerate().rev() {
        let gained = 2.0 * length_mm * end.accel(squares[index + 1], -1.0, machine);
        squares[index] = squares[index].min(squares[index + 1] + gained);
    }
    cells.iter().zip(squares.windows(2)).map(|(cell, ends)| cell.time_s(ends, machine)).sum()
}

impl<const N: usize> Cell<N> {
    /// From one v² to the other: up to a peak, a cruise, and down \[s\].
    fn time_s(&self, ends: &[f64], machine: &Machine<N>) -> f64 {
        let [enter, exit] = [ends[0], ends[1]].map(f64::sqrt);
        let [start, end] = &self.ends;
        if norm(start.curvature) > 0.0 || norm(end.curvature) > 0.0 {
            return 2.0 * self.length_mm / (enter + exit);
        }
        let accel = start.accel(0.0, 1.0, machine);
        let most = start.most(self.feed_mm_s, machine);
        let peak = (accel * self.length_mm + 0.5 * (ends[0] + ends[1])).min(most);
        let changing_mm = (2.0 * peak - ends[0] - ends[1]) / (2.0 * accel);
        let peak_mm_s = peak.sqrt();
        (2.0 * peak_mm_s - enter - exit) / accel + (self.length_mm - changing_mm).max(0.0) / peak_mm_s
    }
}

/// A line is a cell.
fn cells<const N: usize>(block: &StretchBlock<N>) -> Vec<Cell<N>> {
    let length_mm = block.element.length_mm();
    let count = match block.element {
        Element::Line { .. } => 1,
        _ => (length_mm / STEP_MM).ceil().clamp(CELLS[0], CELLS[1]) as usize,
    };
    let points: Vec<Point<N>> =
        (0..=count).map(|index| point(&block.element, index as f64 / count as f64)).collect();
    let length = |index: usize| match block.element.curve() {
        Some((curve, end)) => {
            let at = |index: usize| end * index as f64 / count as f64;
            curve.length(at(index), at(index + 1))
        }
        None => length_mm,
    };
    let cell = |(index, pair): (usize, &[Point<N>])| Cell {
        ends: [pair[0], pair[1]],
        length_mm: length(index),
        feed_mm_s: block.feed_mm_s,
        stops: index + 1 == count && block.junction_mm_s <= 0.0,
    };
    points.windows(2).enumerate().map(cell).collect()
}

/// The point at a share of an element's parameter.
fn point<const N: usize>(element: &Element<N>, share: f64) -> Point<N> {
    let (tangent, curvature) = match element.curve() {
        Some((curve, end)) => {
            let [tangent, curvature, _] = by_arc_length(curve.derivatives(share * end));
            (tangent, curvature)
        }
        None => (element.ends()[0].tangent, [0.0; N]),
    };
    Point { tangent, curvature }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode;
    use crate::planning::{Mode, plan_program};

    /// The time of a program on a machine of which only the path's acceleration and feed count.
    fn time_s(text: &str) -> f64 {
        let mut machine = Machine::reference();
        machine.path.feed_mm_s = 1e4;
        for axis in &mut machine.axes {
            (axis.feed_mm_s, axis.accel_mm_s2) = (1e4, 1e4);
        }
        let program = gcode::read("test.ngc", text.as_bytes()).expect("a program");
        let plan = plan_program("test.ngc", &program, &machine, Mode::Spanning).expect("a plan");
        acceleration_time_s(&plan, &machine)
    }

    fn is_near(found: f64, expected: f64, within: f64) {
        assert!((found / expected - 1.0).abs() < within, "{found}, expected {expected}");
    }

    #[test]
    fn a_line_takes_two_ramps_and_perhaps_a_cruise() {
        is_near(time_s("G1 X80 F600000\nM2\n"), 2.0 * (80.0_f64 / 500.0).sqrt(), 1e-12);
        is_near(time_s("G1 X80 F6000\nM2\n"), 80.0 / 100.0 + 100.0 / 500.0, 1e-12);
        is_near(
            time_s("G61\nG1 X20 F6000\nG1 Y20\nG4 P1\nM2\n"),
            1.0 + 4.0 * (20.0_f64 / 500.0).sqrt(),
            1e-12,
        );
    }

    /// On a circle of radius R from rest v² = R·A·sin(2s/R), up to √(A·R) at an eighth of it.
    #[test]
    fn a_circle_is_left_as_it_is_entered() {
        let (radius, accel) = (20.0, 500.0_f64);
        // ∫ du/√sin u from 0 to π/2.
        let quarter = 2.622_057_554_292_119;
        let ramps_s = (radius / accel).sqrt() * quarter;
        let rest_mm = (2.0 - 0.5) * std::f64::consts::PI * radius;
        let expected = ramps_s + rest_mm / (accel * radius).sqrt();
        is_near(time_s("G2 X0 Y0 I20 F600000\nM2\n"), expected, 2e-3);
    }
}
