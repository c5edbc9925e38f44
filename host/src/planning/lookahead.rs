//! The kernel's planner over a list of blocks, in the host's memory.

use motion_kernel::law::PlannedRamp;
use motion_kernel::plan::{Block, BlockPlan, Effort, Memory, Node, Path, PlanError, nodes_for, plan_ramps};
use motion_kernel::units::Position;

use super::Mode;
use super::error::Problem;
use crate::toolpath::on_path;

/// Halvings of the feed at an end between one that is reached and one that is not: to 10⁻⁹ of their difference.
const HALVINGS: usize = 30;

/// Plans blocks that end at `ends_mm`, from one feed to another. An error comes with the index of the block.
pub(super) fn lookahead(
    blocks: &[Block<f64>],
    ends_mm: &[f64],
    feeds_mm_s: [f64; 2],
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedRamp>, (usize, Problem)> {
    let mut ends = Vec::with_capacity(blocks.len());
    for (index, &end_mm) in ends_mm.iter().enumerate() {
        ends.push(on_path(end_mm).map_err(|error| (index, error.into()))?);
    }
    let plan = |feeds_mm_s| planned(blocks, &ends, feeds_mm_s, mode, tick_s);
    plan(feeds_mm_s).map_err(|error| match error {
        PlanError::Ramp { start, error } => (block_at(&ends, start), Problem::Segment { error, tick_s }),
        PlanError::Block { block, .. } => (block, error.into()),
        _ => (0, greatest(error, feeds_mm_s, |feeds_mm_s| plan(feeds_mm_s).is_ok()).into()),
    })
}

fn planned(
    blocks: &[Block<f64>],
    ends: &[Position],
    feeds_mm_s: [f64; 2],
    mode: Mode,
    tick_s: f64,
) -> Result<Vec<PlannedRamp>, PlanError> {
    let (effort, nodes) = match mode {
        Mode::Spanning => (Effort::Spanning, nodes_for(blocks.len())),
        Mode::PerBlock => (Effort::PerBlock, 0),
    };
    let path = Path {
        blocks: &mut blocks.to_vec(),
        ends: &mut ends.to_vec(),
        start: Position::ZERO,
        feeds_mm_s,
        tick_s,
    };
    let memory =
        Memory { plans: &mut vec![BlockPlan::default(); blocks.len()], nodes: &mut vec![Node::EMPTY; nodes] };
    let mut ramps: Vec<PlannedRamp> = Vec::new();
    plan_ramps(path, effort, memory, &mut |index, ramp| {
        ramps.truncate(index);
        ramps.push(ramp);
        true
    })
    .map(|_| ramps)
}

/// A refusal of the feed at an end with the greatest feed there that has a plan: the planner names the one that a pair of
/// ramps for each block has, which ramps over several blocks may exceed.
fn greatest(mut error: PlanError, feeds_mm_s: [f64; 2], has_plan: impl Fn([f64; 2]) -> bool) -> PlanError {
    let [start_mm_s, end_mm_s] = feeds_mm_s;
    let (greatest_mm_s, refused_mm_s, is_start) = match &mut error {
        PlanError::TooShortToBrake { greatest_mm_s, .. } => (greatest_mm_s, start_mm_s, true),
        PlanError::TooShortToAccelerate { greatest_mm_s, .. } => (greatest_mm_s, end_mm_s, false),
        _ => return error,
    };
    let mut refused_mm_s = refused_mm_s;
    for _ in 0..HALVINGS {
        let feed_mm_s = 0.5 * (*greatest_mm_s + refused_mm_s);
        if has_plan(if is_start { [feed_mm_s, end_mm_s] } else { [start_mm_s, feed_mm_s] }) {
            *greatest_mm_s = feed_mm_s;
        } else {
            refused_mm_s = feed_mm_s;
        }
    }
    error
}

/// The index of the block, of those that end at `ends`, on which a ramp starts at `start`.
pub(super) fn block_at(ends: &[Position], start: Position) -> usize {
    ends.partition_point(|&end| end <= start).min(ends.len().saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use motion_kernel::law::{Law, Limits, Pulse};

    use super::*;

    /// Blocks of no length have no ramps.
    #[test]
    fn a_ramp_belongs_to_the_block_on_which_it_starts() {
        let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
        let law = Law::new(Pulse::Plateau, limits).expect("positive limits");
        let block = |length_mm, cap_mm_s| Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law };
        let blocks = [block(0.0, 80.0), block(50.0, 80.0), block(0.0, 40.0), block(25.0, 40.0)];
        let ends_mm = [0.0, 50.0, 50.0, 75.0];
        let ends = ends_mm.map(|mm| on_path(mm).expect("in range"));
        for mode in [Mode::Spanning, Mode::PerBlock] {
            let planned = lookahead(&blocks, &ends_mm, [0.0; 2], mode, 0.0005).expect("a plan");
            let (mut at, mut found) = (Position::ZERO, Vec::new());
            for ramp in planned {
                found.push(block_at(&ends, at));
                at = at + ramp.length;
            }
            found.dedup();
            assert_eq!(found, [1, 3], "{mode:?}");
            assert!((at.to_mm() - 75.0).abs() < 1e-9);
        }
    }
}
