//! A program as it would be driven, on the simulated machine.

use std::sync::Arc;

use super::desk::MakePicture;
use crate::board::items::Source;
use crate::check;
use crate::gcode;
use crate::machine::Machine;
use crate::planning::{Mode, plan_program};
use crate::report::PageRun;
use crate::simulate::{self, Job, RunOptions};
use crate::trace::RunTrace;

/// Longer programs have no picture: its ticks are in memory until it is made \[s\].
const LONGEST_S: f64 = 900.0;

/// Makes pictures for a machine.
#[must_use]
pub fn of_machine<const N: usize>(machine: &Machine<N>) -> MakePicture {
    let machine = machine.clone();
    Arc::new(move |source| of_program(source, &machine))
}

/// What `motion run` would show of the program; or why not: it is too long, or can't be simulated.
fn of_program<const N: usize>(source: &Source, machine: &Machine<N>) -> Result<PageRun, String> {
    fn told(error: impl std::fmt::Display) -> String {
        format!("no picture: {error}")
    }
    let program = gcode::read_with(&source.name, &source.text, &source.options).map_err(told)?;
    let plan = plan_program(&source.name, &program, machine, Mode::Spanning).map_err(told)?;
    let job = Job::new(&RunOptions::default(), &plan, machine).map_err(told)?;
    let time_s = job.info.planned_time_s;
    if time_s > LONGEST_S {
        return Err(told(format!("the program takes {time_s:.0} s, expected at most {LONGEST_S} s")));
    }
    let mut ticks = Vec::new();
    let summary = simulate::on_simulated(machine, None, |hardware| {
        simulate::run_on(&job, hardware, &mut |tick| ticks.push(*tick))
    });
    let traced = check::traced(&source.text, &plan);
    let trace = RunTrace { source: Some(traced), ..job.trace(&summary.map_err(told)?, ticks) };
    PageRun::of(&trace).map_err(told)
}
