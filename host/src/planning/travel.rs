//! Refuses a program that leaves the travel of the axes.
//!
//! Consumes moves as they are programmed, so that motion can end at rest before the first one that leaves the travel, and
//! the items that would be executed; fails with the line of the first one that leaves it.

use motion_kernel::path::Piece;
use motion_kernel::program::Item;

use super::error::{AtLine, Problem, named};
use crate::axis_unit::AxisUnit;
use crate::machine::{AxisSettings, Machine};
use crate::toolpath::{Element, Vector, add, exact};

/// Refuses a piece that leaves the travel at its ends or between them. An error comes with the program line.
pub(super) fn check<const N: usize>(item: &Item<N>, machine: &Machine<N>) -> AtLine<()> {
    let (line, piece) = match *item {
        Item::Line { line, start, direction, length } => {
            (line, Piece::<f64, N>::line(line, start, direction, length))
        }
        Item::Septic { line, start, coefficients, length } => {
            (line, Piece::<f64, N>::septic(line, start, coefficients, length))
        }
        _ => return Ok(()),
    };
    // What is no piece was refused before.
    let Ok(piece) = piece else { return Ok(()) };
    let Some((axis, found_mm)) = piece.beyond(&machine.travel()) else { return Ok(()) };
    let axis = &machine.axes[axis];
    Err((line, beyond(axis, found_mm, axis.travel_mm.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]))))
}

/// Parts of a curve that are looked at before it is made into pieces, all of which are checked.
const PARTS: u8 = 32;
/// A programmed point farther out by less is not beyond \[mm\]: coordinates are sums of offsets.
const ROUNDING_MM: f64 = 1.0e-6;

/// Refuses a move whose programmed path leaves the travel, or the range of positions.
pub(super) fn check_move<const N: usize>(element: &Element<N>, machine: &Machine<N>) -> Result<(), Problem> {
    let (from, to) = element.ends_mm();
    check_end(to, machine)?;
    let Some((curve, end)) = element.curve() else { return Ok(()) };
    for part in 1..PARTS {
        let u = end * f64::from(part) / f64::from(PARTS);
        check_end(add(from, curve.offset(0.0, u)), machine)?;
    }
    Ok(())
}

/// Refuses a point beyond the travel, or the range of positions: the programmed end of a move, wherever the move ends.
pub(super) fn check_end<const N: usize>(end: Vector<N>, machine: &Machine<N>) -> Result<(), Problem> {
    exact(end).map_err(|error| named(error.into(), &machine.letters_by_place()))?;
    for (axis, found_mm) in machine.axes.iter().zip(end) {
        let Some([low_mm, high_mm]) = axis.travel_mm else { continue };
        if found_mm < low_mm - ROUNDING_MM || found_mm > high_mm + ROUNDING_MM {
            return Err(beyond(axis, found_mm, [low_mm, high_mm]));
        }
    }
    Ok(())
}

fn beyond(axis: &AxisSettings, found: f64, [low, high]: [f64; 2]) -> Problem {
    let unit = axis.letter.map_or("mm", |letter| AxisUnit::of(letter).symbol());
    Problem::Travel { axis: axis.name.clone(), found, low, high, unit }
}

#[cfg(test)]
mod tests {
    use crate::gcode;
    use crate::machine::Machine;
    use crate::planning::{Mode, plan_program};

    fn planned(text: &str, travel_mm: [Option<[f64; 2]>; 3]) -> Result<(), String> {
        let mut machine = Machine::reference();
        for (axis, travel_mm) in machine.axes.iter_mut().zip(travel_mm) {
            axis.travel_mm = travel_mm;
        }
        let program = gcode::read("part.ngc", text.as_bytes()).expect("a program");
        let plan = plan_program("part.ngc", &program, &machine, Mode::Spanning);
        plan.map(|_| ()).map_err(|error| error.to_string())
    }

    #[test]
    fn what_leaves_the_travel_is_refused_with_its_line_and_axis() {
        let box_mm = [Some([-5.0, 50.0]), Some([0.0, 30.0]), None];
        assert_eq!(planned("G21 G90 G61\nG1 X50 Y30 F1000\nX-5 Y0 Z-900\n", box_mm), Ok(()));
        let refused = planned("G21 G90 G61\nG1 X50 Y30 F1000\nX-5.01\n", box_mm).expect_err("beyond");
        assert!(refused.starts_with("part.ngc:3: found X at -5.01"), "{refused}");
        assert!(refused.ends_with("mm, expected its travel, -5 to 50 mm"), "{refused}");
        let refused = planned("G21 G90 G61\nG1 X1 Y-0.1 F1000\n", box_mm).expect_err("beyond");
        assert!(refused.starts_with("part.ngc:2: found Y at -0.1"), "{refused}");
    }

    /// An arc from within to within over the travel's end: its top is beyond, or just not.
    #[test]
    fn an_arc_that_bulges_beyond_is_refused() {
        let arc = "G21 G90 G61\nG1 Y10 F1000\nG2 X40 Y10 I20\n";
        let top = |mm: f64| planned(arc, [None, Some([-1.0, mm]), None]);
        assert_eq!(top(30.002), Ok(()));
        let refused = top(29.99).expect_err("its top is at 30 mm");
        assert!(refused.starts_with("part.ngc:3: found Y at 30.0000 mm"), "{refused}");
    }
}
