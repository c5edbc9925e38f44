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

/// What `motion run` would show of the program. None where it is too long, or can't be simulated.
fn of_program<const N: usize>(source: &Source, machine: &Machine<N>) -> Option<PageRun> {
    // It was read and planned for the board: what fails now has been told.
    let program = gcode::read_with(&source.name, &source.text, &source.options).ok()?;
    let plan = plan_program(&source.name, &program, machine, Mode::Spanning).ok()?;
    let job = Job::new(&RunOptions::default(), &plan, machine).ok()?;
    if job.info.planned_time_s > LONGEST_S {
        return None;
    }
    let mut ticks = Vec::new();
    let summary = simulate::on_simulated(machine, None, |hardware| {
        simulate::run_on(&job, hardware, &mut |tick| ticks.push(*tick))
    });
    let traced = check::traced(&source.text, &plan);
    let trace = RunTrace { source: Some(traced), ..job.trace(&summary.ok()?, ticks) };
    PageRun::of(&trace).ok()
}
