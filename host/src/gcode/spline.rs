//! Control points of G5, as LinuxCNC takes them.

use super::block::Block;
use super::error::{Located, Problem};
use super::modal::Modal;
use super::program::Plane;

/// The control points of a G5 \[mm\]: I J from the start, P Q from the end. Without I and J the first is what
/// continues the G5 before, whose P Q are `before_mm`. `offset` is where the line asks for the move.
pub(super) fn controls_mm(
    block: &Block<'_>,
    modal: &Modal,
    before_mm: Option<[f64; 2]>,
    offset: usize,
) -> Result<[[f64; 2]; 2], Located> {
    if modal.plane != Plane::Xy {
        return Err(Located::new(offset, Problem::SplinePlane { plane: modal.plane }));
    }
    if let Some(word) = block.letter(b'Z') {
        return Err(word.problem(|word| Problem::SplineOutsidePlane { word }));
    }
    let pair = |letters: [u8; 2]| -> Result<Option<[f64; 2]>, Located> {
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
    };
    let (start, end) = (pair([b'I', b'J'])?, pair([b'P', b'Q'])?);
    let end = end.ok_or(Located::new(offset, Problem::SplineWithoutEnd))?;
    let continued = before_mm.map(|before| before.map(|mm| -mm));
    let start = start.or(continued).ok_or(Located::new(offset, Problem::SplineWithoutStart))?;
    Ok([start, end])
}
