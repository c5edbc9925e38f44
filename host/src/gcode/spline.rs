//! Control points of G5 and G5.1, as LinuxCNC takes them.

use super::axis::{Axis, Point};
use super::block::Block;
use super::error::{Located, Problem};
use super::modal::{Modal, Motion};
use super::program::Plane;

/// The control points of a G5 \[mm\]: I J from the start, P Q from the end. Without I and J the first is what
/// continues the G5 before, whose P Q are `before_mm`. `offset` is where the line asks for the move.
pub(super) fn cubic_mm(
    block: &Block<'_>,
    modal: &Modal,
    before_mm: Option<[f64; 2]>,
    offset: usize,
) -> Result<[[f64; 2]; 2], Located> {
    refuse_other_planes(block, modal, Motion::Cubic, offset)?;
    let (start, end) = (pair(block, modal, [b'I', b'J'])?, pair(block, modal, [b'P', b'Q'])?);
    let end = end.ok_or(Located::new(offset, Problem::SplineWithoutEnd))?;
    let continued = before_mm.map(|before| before.map(|mm| -mm));
    let start = start.or(continued).ok_or(Located::new(offset, Problem::SplineWithoutStart))?;
    Ok([start, end])
}

/// The control points of the cubic curve that a G5.1 is \[mm\], as [`cubic_mm`] gives them. The quadratic curve has one
/// control point, I J from its start; a cubic has the same points where its control points lie two thirds of the way
/// from either end to that one. `ends` are the ends in the program's coordinates.
pub(super) fn quadratic_mm(
    block: &Block<'_>,
    modal: &Modal,
    ends: [Point; 2],
    offset: usize,
) -> Result<[[f64; 2]; 2], Located> {
    refuse_other_planes(block, modal, Motion::Quadratic, offset)?;
    let control = pair(block, modal, [b'I', b'J'])?;
    let control = control.ok_or(Located::new(offset, Problem::QuadraticWithoutControl))?;
    let [from, to] = ends;
    let from_end = [0, 1].map(|axis: usize| control[axis] - (to[axis].to_mm() - from[axis].to_mm()));
    Ok([control, from_end].map(|offset| offset.map(|mm| mm * 2.0 / 3.0)))
}

/// Both curves lie in XY.
fn refuse_other_planes(
    block: &Block<'_>,
    modal: &Modal,
    motion: Motion,
    offset: usize,
) -> Result<(), Located> {
    if modal.plane != Plane::Xy {
        let (motion, plane) = (motion.word(), modal.plane);
        return Err(Located::new(offset, Problem::SplinePlane { motion, plane }));
    }
    match block.axis_beside([Axis::X, Axis::Y].into_iter().collect()) {
        Some(word) => Err(word.problem(|word| Problem::SplineOutsidePlane { word })),
        None => Ok(()),
    }
}

/// The lengths of two letters that go together \[mm\].
fn pair(block: &Block<'_>, modal: &Modal, letters: [u8; 2]) -> Result<Option<[f64; 2]>, Located> {
    match letters.map(|letter| block.letter(letter)) {
        [None, None] => Ok(None),
        [Some(first), Some(second)] => {
            let mm = |word| modal.units.length(word).map(|length| length.to_mm());
            Ok(Some([mm(first)?, mm(second)?]))
        }
        [Some(word), None] | [None, Some(word)] => {
            let [first, second] = letters.map(char::from);
            Err(word.problem(|word| Problem::SplineControlIncomplete { word, first, second }))
        }
    }
}
