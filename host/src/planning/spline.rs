//! A spline to a plan: one stretch from its start to its end.

use super::error::{AtLine, PlanningError, Problem};
use super::program::plan_moves;
use super::{Mode, Plan};
use crate::machine::Machine;
use crate::toolpath::septic::Deviation;
use crate::toolpath::smooth::Move;
use crate::toolpath::spline::Spline;
use crate::toolpath::{Element, Feeds, norm, septics};

/// The pieces of a path, as f32 takes them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pieces {
    /// How many there are.
    pub count: usize,
    /// How far they are from the path at most.
    pub deviation: Deviation,
}

/// Plans a spline through points of a machine's space at a feed \[mm/s\], and states how far its pieces are from it.
/// `lines` are those of its points.
///
/// The machine comes from the origin by a rapid, unless the spline starts there.
///
/// # Errors
/// A span has no pieces (it has a cusp, for one), the kernel can't execute it, or the plan would exceed what
/// a tick can do; the error names the line of the span's last point.
pub fn plan_spline<const N: usize>(
    source_name: &str,
    spline: &Spline<N>,
    lines: &[u32],
    feed_mm_s: f64,
    machine: &Machine<N>,
) -> Result<(Plan<N>, Pieces), PlanningError> {
    let line = |point: usize| lines.get(point).copied().unwrap_or(0);
    let start = spline.start_mm();
    let approach = Move {
        line: line(0),
        element: Element::Line { from: [0.0; N], to: start },
        feeds: Feeds::RAPID,
        tolerance_mm: 0.0,
        merging_mm: None,
        distance_mm: 0.0,
    };
    let spans = spline.elements().map(|(point, element)| Move {
        line: line(point),
        feeds: Feeds::programmed(feed_mm_s, &element, &machine.letters_by_place()),
        element,
        tolerance_mm: 0.0,
        merging_mm: None,
        distance_mm: 0.0,
    });
    let moves: Vec<Move<N>> = (norm(start) > 0.0).then_some(approach).into_iter().chain(spans).collect();
    // Before the plan, which knows a cusp only as a limit of 0.
    let pieces = pieces(&moves).map_err(|problem| PlanningError::at_line(source_name, problem))?;
    Ok((plan_moves(source_name, moves, machine, Mode::default())?, pieces))
}

fn pieces<const N: usize>(moves: &[Move<N>]) -> AtLine<Pieces> {
    let mut pieces = Pieces::default();
    for Move { line, element, .. } in moves {
        let septics = septics::<f32, _>(element).map_err(|error| (*line, Problem::Geometry(error.into())))?;
        pieces.count += septics.len();
        let deviations = septics.iter().map(|septic| septic.deviation);
        pieces.deviation = deviations.fold(pieces.deviation, Deviation::or_greater);
    }
    pieces.deviation = pieces.deviation.bound();
    Ok(pieces)
}
