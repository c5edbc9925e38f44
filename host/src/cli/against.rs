//! The run that a report shows beside another one.

use std::path::Path;

use super::error::CliError;
use super::input::{self, Source};
use crate::check;
use crate::gcode::{AXES_MAX, ReadOptions};
use crate::machine::Machine;
use crate::planning::{Mode, plan_program};
use crate::recording::{self, Recording};
use crate::report::PageRun;
use crate::simulate::{self, Job, Observer, RunError, RunOptions, RunSummary};
use crate::trace::{RunTrace, TracedProgram};

/// Runs a program on `machine`, or a recording again, for a report.
///
/// # Errors
/// The file is refused, there is no plan, or it can't be run.
pub(super) fn run<const N: usize>(
    path: &Path,
    options: &ReadOptions,
    machine: &Machine<N>,
) -> Result<PageRun, CliError> {
    let source = input::read(path)?;
    if let Ok(places) = recording::places(&source.text) {
        return match places {
            AXES_MAX => recorded::<AXES_MAX>(&source),
            _ => recorded::<3>(&source),
        };
    }
    let program = source.program(options)?;
    let plan = plan_program(&source.name, &program, machine, Mode::Spanning)?;
    let refused = |error: RunError| CliError::Run { program: plan.source.clone(), source: error };
    let job = Job::new(&RunOptions::default(), &plan, machine).map_err(refused)?;
    page(&job, Some(check::traced(&source.text, &plan)), |observe| {
        simulate::on_simulated(machine, None, |hardware| simulate::run_on(&job, hardware, observe))
    })
}

fn recorded<const N: usize>(source: &Source) -> Result<PageRun, CliError> {
    let refused = |error| CliError::Recording { path: source.name.clone(), source: error };
    let recording = Recording::<N>::from_bytes(&source.text).map_err(refused)?;
    let job = recording.job();
    page(job, None, |observe| Ok(recording::replay(&recording, job, observe)?.summary))
}

fn page<const N: usize>(
    job: &Job<N>,
    program: Option<TracedProgram>,
    run: impl FnOnce(&mut Observer<'_, N>) -> Result<RunSummary, RunError>,
) -> Result<PageRun, CliError> {
    let mut ticks = Vec::new();
    let summary = run(&mut |tick| ticks.push(*tick))
        .map_err(|source| CliError::Run { program: job.info.program.clone(), source })?;
    let trace = RunTrace { source: program, ..job.trace(&summary, ticks) };
    PageRun::of(&trace).map_err(CliError::Output)
}
