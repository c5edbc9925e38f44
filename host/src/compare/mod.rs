//! The time of a program, in forms that can be compared.
//!
//! Consumes a program and a machine; produces, for a path mode, the time of the plan, of S3's plan per block,
//! the least time under the plan's ceilings and the time that acceleration alone would allow on the same path,
//! with what the path used of its tolerance and the executed ticks of the machine's limits. Background; two
//! plans and one pass over all ticks.
//!
//! - [`bound`]: the least time under the ceilings;
//! - [`acceleration`]: the time under acceleration alone;
//! - [`ticks`]: the executed ticks against the limits.

pub mod acceleration;
pub mod bound;
pub mod ticks;

use std::fmt;

use self::ticks::{Ratios, TicksError};
use crate::gcode::{PathMode, Program};
use crate::machine::Machine;
use crate::planning::{Item, Mode, Plan, PlanningError, plan_program};
use crate::trace::TracedBlock;

/// The path that is driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Path {
    /// The path mode that the program sets.
    Written,
    /// G61 all over.
    Exact,
    /// G64 all over, within a tolerance \[mm\].
    Blended(f64),
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Written => f.write_str("as written"),
            Self::Exact => f.write_str("G61"),
            Self::Blended(tolerance_mm) => write!(f, "G64 P{tolerance_mm}"),
        }
    }
}

/// The figures of a program on one path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Blocks, those of blends and curves among them.
    pub blocks: usize,
    /// Blends and curves.
    pub blends: usize,
    /// Length \[mm\].
    pub length_mm: f64,
    /// Time of the plan \[s\]; of all times, dwells are part and stops are not.
    pub time_s: f64,
    /// Time with one pair of sin² ramps per block, whatever the machine's law is \[s\].
    pub per_block_s: f64,
    /// The least time under the plan's ceilings \[s\]: [`bound::least_time_s`].
    pub least_s: f64,
    /// The time under acceleration alone \[s\]: [`acceleration::acceleration_time_s`].
    pub acceleration_s: f64,
    /// Greatest part of its tolerance that a block may use: the planner's bound, not a measurement.
    pub tolerance_share: f64,
    /// The executed ticks against the limits.
    pub ratios: Ratios,
}

/// Why there are no figures.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// There is no plan.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The plan can't be executed.
    #[error(transparent)]
    Ticks(#[from] TicksError),
}

/// Whether some move of the program may leave its path.
#[must_use]
pub fn is_blended(program: &Program) -> bool {
    program.steps.iter().any(|step| matches!(step.kind.mode(), Some(PathMode::Blend { .. })))
}

/// The figures of a program on a path.
///
/// # Errors
/// There is no plan, or the kernel can't execute it.
pub fn figures<const N: usize>(
    source_name: &str,
    program: &Program,
    path: Path,
    machine: &Machine<N>,
) -> Result<Figures, CompareError> {
    let program = on(program, path);
    let plan = plan_program(source_name, &program, machine, Mode::Spanning)?;
    let per_block = plan_program(source_name, &program, machine, Mode::PerBlock)?;
    Ok(Figures {
        blocks: plan.blocks.len(),
        blends: blends(&plan.blocks),
        length_mm: plan.length_mm,
        time_s: plan.time_s,
        per_block_s: per_block.time_s,
        least_s: bound::least_time_s(&plan),
        acceleration_s: acceleration::acceleration_time_s(&plan, machine),
        tolerance_share: tolerance_share(&plan),
        ratios: ticks::ratios(&plan, machine)?,
    })
}

/// The program on another path.
#[must_use]
pub fn on(program: &Program, path: Path) -> Program {
    match path {
        Path::Written => program.clone(),
        Path::Exact => in_mode(program, PathMode::ExactPath),
        Path::Blended(tolerance_mm) => {
            in_mode(program, PathMode::Blend { tolerance_mm: Some(tolerance_mm), merging_mm: None })
        }
    }
}

/// The program with one path mode for all of its moves.
#[must_use]
pub fn in_mode(program: &Program, mode: PathMode) -> Program {
    let mut program = program.clone();
    for step in &mut program.steps {
        if let Some(of_step) = step.kind.mode_mut() {
            *of_step = mode;
        }
    }
    program
}

fn tolerance_share<const N: usize>(plan: &Plan<N>) -> f64 {
    let stretches = plan.items.iter().filter_map(|item| match item {
        Item::Stretch(stretch) => Some(stretch),
        Item::Dwell { .. } | Item::Switch { .. } | Item::Stop { .. } => None,
    });
    stretches.flat_map(|stretch| &stretch.blocks).map(|block| block.tolerance_share).fold(0.0, f64::max)
}

/// The number of blends, and of curves: the spans of one follow each other.
fn blends(blocks: &[TracedBlock]) -> usize {
    let is_curve = |block: &TracedBlock| block.kind == "curve";
    let curves = blocks.chunk_by(|before, after| is_curve(before) && is_curve(after));
    curves.filter(|blocks| matches!(&*blocks[0].kind, "blend" | "curve")).count()
}
