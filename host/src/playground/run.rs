//! A program through plan, kernel and simulated machine, in steps.

use serde::{Deserialize, Serialize};

use super::digest::Digest;
use super::sliders::{self, SliderJson};
use super::{Answer, Progress, Stage, Work};
use crate::check;
use crate::gcode::{self, Program};
use crate::machine::{AnyMachine, Machine, NumberEdit, with_numbers};
use crate::planning::{Plan, Planner};
use crate::report;
use crate::simulate::hardware::{SimulatedHardware, simulated};
use crate::simulate::run::{Execution, Memory};
use crate::simulate::{Job, RunError, RunOptions};
use crate::trace::{RunTrace, TraceRow, TracedProgram};

/// The kernel's number type: as on a board.
type Number = f32;

/// Steps of a program, and ticks, from one look at the progress to the next: some hundredths of a second.
const STEPS: usize = 200;
const TICKS: usize = 20_000;

/// What the ticks of a run may take \[bytes\]: a list of a module has 2 GiB at most, and one that is longer than was planned, by
/// program stops, doubles.
const TICKS_BYTES_MAX: usize = 900 << 20;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunRequest {
    /// The program's name.
    name: String,
    /// Its text.
    program: String,
    /// The name of the machine's file.
    machine_name: String,
    /// Its text.
    machine: String,
    /// What is to be changed in it.
    #[serde(default)]
    edits: Vec<NumberEdit>,
}

#[derive(Serialize)]
struct RunJson {
    /// The machine's file, changed.
    machine: String,
    sliders: Vec<SliderJson>,
    axes: Vec<String>,
    /// What the run came to, in HTML.
    headline: String,
    times: Vec<(&'static str, f64)>,
    digest: String,
}

/// Reads program and machine.
pub(super) fn begin(request: RunRequest) -> Result<Box<dyn Work>, String> {
    let RunRequest { name, program: text, machine_name, machine, edits } = request;
    let machine_text = with_numbers(&machine_name, &machine, &edits).map_err(|error| error.to_string())?;
    let machine = AnyMachine::from_toml(&machine_name, &machine_text).map_err(|error| error.to_string())?;
    let axes = match &machine {
        AnyMachine::Three(machine) => machine.axis_names(),
        AnyMachine::Nine(machine) => machine.axis_names(),
    };
    let program = match gcode::read_with(&name, text.as_bytes(), &machine.read_options()) {
        Ok(program) => program,
        Err(error) => return Ok(Box::new(Refusing(RefusedJson::new(&error, machine_text, axes)))),
    };
    let request = Read { name, text, program: Box::leak(Box::new(program)), machine_text };
    Ok(match machine {
        AnyMachine::Three(machine) => Box::new(Running::new(request, Box::leak(machine))),
        AnyMachine::Nine(machine) => Box::new(Running::new(request, Box::leak(machine))),
    })
}

/// A program that is refused, and the machine, which is not.
#[derive(Serialize)]
struct RefusedJson {
    error: String,
    machine: String,
    sliders: Vec<SliderJson>,
    axes: Vec<String>,
}

impl RefusedJson {
    fn new(error: &impl ToString, machine: String, axes: Vec<String>) -> Self {
        Self { error: error.to_string(), sliders: sliders::of_machine(&machine), machine, axes }
    }
}

/// The answer is there already.
struct Refusing(RefusedJson);

impl Work for Refusing {
    fn advance(&mut self) -> Result<Option<Answer>, String> {
        Answer::new(&self.0, Vec::new()).map(Some)
    }

    fn progress(&self) -> Progress {
        Progress { stage: Stage::Reading, part: 1.0 }
    }
}

/// What was read.
struct Read {
    name: String,
    text: String,
    program: &'static Program,
    machine_text: String,
}

/// A run on its way. What one part of it borrows of another lives as long as the module.
struct Running<const N: usize> {
    read: Read,
    machine: &'static Machine<N>,
    digest: Digest,
    phase: Phase<N>,
}

enum Phase<const N: usize> {
    Planning(Box<Planner<'static, N>>, usize),
    Executing(Box<Executing<N>>),
    Over,
}

struct Executing<const N: usize> {
    job: &'static Job<N>,
    execution: Execution<'static, Number, SimulatedHardware<'static, N>, N>,
    ticks: Vec<TraceRow<N>>,
    planned_ticks: f64,
    program: TracedProgram,
}

impl<const N: usize> Running<N> {
    fn new(read: Read, machine: &'static Machine<N>) -> Self {
        let planner = Planner::new(&read.name, read.program, machine);
        Self { read, machine, digest: Digest::new(), phase: Phase::Planning(Box::new(planner), 0) }
    }

    fn execute(&mut self, plan: &Plan<N>) -> Result<Phase<N>, String> {
        let refused = |error: RunError| error.to_string();
        let Self { read, machine, digest, .. } = self;
        digest.number(plan.time_s);
        digest.number(plan.length_mm);
        let job = Job::new(&RunOptions::default(), plan, machine).map_err(refused)?;
        let planned_ticks = plan.time_s / machine.tick_s;
        let bytes = planned_ticks * size_of::<TraceRow<N>>() as f64;
        if !(bytes <= TICKS_BYTES_MAX as f64) {
            let most_s = machine.tick_s * TICKS_BYTES_MAX as f64 / size_of::<TraceRow<N>>() as f64;
            return Err(format!(
                "{}: found {:.0} s of motion, expected {most_s:.0} s at most: a page has no memory for more ticks",
                read.name, plan.time_s
            ));
        }
        let job: &'static Job<N> = Box::leak(Box::new(job));
        let memory = Box::leak(Box::new(Memory::<Number, N>::new(job)));
        let simulated: &'static _ = Box::leak(Box::new(simulated(machine).map_err(refused)?));
        let hardware = Box::leak(Box::new(SimulatedHardware::new(simulated).map_err(refused)?));
        Ok(Phase::Executing(Box::new(Executing {
            job,
            execution: Execution::new(job, memory, hardware).map_err(refused)?,
            ticks: Vec::with_capacity(planned_ticks as usize + 1),
            planned_ticks,
            program: check::traced(read.text.as_bytes(), plan),
        })))
    }

    fn answer(&self, executing: Executing<N>) -> Result<Answer, String> {
        let Executing { job, execution, ticks, program, .. } = executing;
        let summary = execution.finish();
        let times = program.times;
        let trace: RunTrace<N> = job.trace(&summary, ticks);
        let (headline, page) = report::page_parts(&trace).map_err(|error| error.to_string())?;
        let header = RunJson {
            machine: self.read.machine_text.clone(),
            sliders: sliders::of_machine(&self.read.machine_text),
            axes: trace.axes.iter().map(|axis| axis.name.clone()).collect(),
            headline,
            times,
            digest: self.digest.words(),
        };
        Answer::new(&header, page.data().to_vec())
    }
}

impl<const N: usize> Running<N> {
    /// Does a part of it.
    fn step(&mut self) -> Result<Option<Answer>, String> {
        let all = &self.read.program.steps;
        match std::mem::replace(&mut self.phase, Phase::Over) {
            Phase::Planning(mut planner, done) if done < all.len() => {
                let end = all.len().min(done + STEPS);
                planner.take(&all[done..end]).map_err(|error| error.to_string())?;
                self.phase = Phase::Planning(planner, end);
            }
            Phase::Planning(planner, _) => {
                let plan = planner.finish().map_err(|error| error.to_string())?;
                self.phase = self.execute(&plan)?;
            }
            Phase::Executing(mut executing) => {
                let Executing { execution, ticks, .. } = &mut *executing;
                for _ in 0..TICKS {
                    let mut observe = |row: &TraceRow<N>| {
                        self.digest.row(row);
                        ticks.push(*row);
                    };
                    if !execution.tick(&mut observe).map_err(|error| error.to_string())? {
                        return self.answer(*executing).map(Some);
                    }
                }
                self.phase = Phase::Executing(executing);
            }
            Phase::Over => return Err("found a request that was answered, expected another one".to_owned()),
        }
        Ok(None)
    }
}

impl<const N: usize> Work for Running<N> {
    fn advance(&mut self) -> Result<Option<Answer>, String> {
        self.step().or_else(|error| {
            // The machine is as it was asked for, whatever becomes of the program.
            let refused = RefusedJson::new(&error, self.read.machine_text.clone(), self.machine.axis_names());
            Answer::new(&refused, Vec::new()).map(Some)
        })
    }

    fn progress(&self) -> Progress {
        let part = |done: f64, of: f64| if of > 0.0 { (done / of).min(1.0) } else { 1.0 };
        match &self.phase {
            Phase::Planning(_, done) => {
                let part = part(*done as f64, self.read.program.steps.len() as f64);
                Progress { stage: Stage::Planning, part }
            }
            Phase::Executing(executing) => {
                let part = part(executing.ticks.len() as f64, executing.planned_ticks);
                Progress { stage: Stage::Running, part }
            }
            Phase::Over => Progress { stage: Stage::Writing, part: 1.0 },
        }
    }
}
