//! What a program needs of a machine, how long it takes, and why.
//!
//! **Consumes** a [`Program`] and a [`Machine`]. **Produces** a [`Check`]: length, time, extent, tools and outputs, time by
//! reason, and advice where another path mode would save time. **Runs** in the background: up to three plans.
//! **Fails** where there is no plan.
//!
//! - [`time`]: the plan's time, by what holds the feed down;
//! - [`needs`]: what the machine and its operator have to have ready;
//! - [`advice`]: path modes that are faster.

pub mod advice;
pub mod needs;
pub mod time;

pub use needs::Needs;
pub use time::{Reason, Times, traced};

use crate::gcode::Program;
use crate::machine::Machine;
use crate::planning::{Mode, Plan, PlanningError, plan_program};

/// A program that was checked.
#[derive(Clone, Debug)]
pub struct Check<const N: usize = 3> {
    /// Its plan.
    pub plan: Plan<N>,
    /// What it needs.
    pub needs: Needs,
    /// Where its time goes.
    pub times: Times,
    /// What would save time, a sentence each.
    pub advice: Vec<String>,
}

/// Checks a program that was read.
///
/// # Errors
/// Those of [`plan_program`].
pub fn check<const N: usize>(
    source_name: &str,
    program: &Program,
    machine: &Machine<N>,
) -> Result<Check<N>, PlanningError> {
    let plan = plan_program(source_name, program, machine, Mode::Spanning)?;
    let times = Times::of(&plan);
    let advice = advice::advice(source_name, program, machine, &plan, &times);
    Ok(Check { needs: Needs::of(program), times, advice, plan })
}
