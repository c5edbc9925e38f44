//! A whole program, or moves, to one plan.

use motion_kernel::law::PlannedRamp;

use super::error::{AtLine, PlanningError, Problem};
use super::executable::Executable;
use super::outputs::acts_on;
use super::pipeline::{Next, Pipeline};
use super::runs::Between;
use super::stretch::{Known, Stretch, StretchBlock};
use super::{Item, Mode, PlacedRamp, Plan, PlannedProbe, travel};
use crate::gcode::{PathMode, Program, Step};
use crate::machine::{DefaultPathMode, Machine, PathSettings};
use crate::toolpath::smooth::Move;

/// Plans a whole program for a machine.
///
/// # Errors
/// A move can't be executed by the kernel, or the plan would exceed what a tick can do; the error
/// names the line.
pub fn plan_program<const N: usize>(
    source_name: &str,
    program: &Program,
    machine: &Machine<N>,
    mode: Mode,
) -> Result<Plan<N>, PlanningError> {
    plan_program_in_view(source_name, program, machine, mode, &mut |_| {})
}

/// Steps of a program between two looks at how far it is: a second, at the slowest.
const STEPS_IN_VIEW: usize = 1000;

/// [`plan_program`], the same to the bit; `on_taken` is told how many steps are taken since it was told last.
///
/// # Errors
/// As [`plan_program`].
pub fn plan_program_in_view<const N: usize>(
    source_name: &str,
    program: &Program,
    machine: &Machine<N>,
    mode: Mode,
    on_taken: &mut dyn FnMut(usize),
) -> Result<Plan<N>, PlanningError> {
    let machine = &driven(machine, mode);
    let mut planner = Planner::with_mode(source_name, program, machine, mode);
    for steps in program.steps.chunks(STEPS_IN_VIEW) {
        planner.take(steps)?;
        on_taken(steps.len());
    }
    planner.finish()
}

/// A program on its way to its plan.
pub struct Planner<'m, const N: usize> {
    program: &'m Program,
    machine: &'m Machine<N>,
    pipeline: Pipeline<'m, N>,
    gathered: Gathered<N>,
}

impl<'m, const N: usize> Planner<'m, N> {
    /// Before the first step. Ramps may span blocks.
    #[must_use]
    pub fn new(source_name: &str, program: &'m Program, machine: &'m Machine<N>) -> Self {
        Self::with_mode(source_name, program, machine, Mode::Spanning)
    }

    /// `machine` has the pulses of jerk of `mode`.
    fn with_mode(source_name: &str, program: &'m Program, machine: &'m Machine<N>, mode: Mode) -> Self {
        let mut plan =
            Plan::empty(source_name, machine.path.pulse, machine.tick_s, machine.letters_by_place());
        plan.notices = notes(program, machine);
        plan.notices.extend(assumed_path(&program.steps, machine));
        Self { program, machine, pipeline: Pipeline::new(machine, mode), gathered: Gathered::new(plan) }
    }

    /// Takes the next of the program's steps.
    ///
    /// # Errors
    /// As [`plan_program`].
    pub fn take(&mut self, steps: &[Step]) -> Result<(), PlanningError> {
        let gathered = &mut self.gathered;
        let taken = self.pipeline.take((steps, &self.program.nurbs, &[]), &mut |next| gathered.take(next));
        taken.map_err(|problem| self.refused(problem))
    }

    /// The plan of what was taken, to rest.
    ///
    /// # Errors
    /// As [`plan_program`].
    pub fn finish(mut self) -> Result<Plan<N>, PlanningError> {
        let gathered = &mut self.gathered;
        let ended = self.pipeline.end(&mut |next| gathered.take(next));
        ended.map_err(|problem| self.refused(problem))?;
        self.gathered.checked(self.machine)
    }

    fn refused(&self, problem: (u32, Problem)) -> PlanningError {
        PlanningError::at_line(&self.gathered.plan.source, problem)
    }
}

/// Plans moves that follow each other, from rest to rest.
///
/// # Errors
/// Those of [`plan_program`].
pub fn plan_moves<const N: usize>(
    source_name: &str,
    moves: Vec<Move<N>>,
    machine: &Machine<N>,
    mode: Mode,
) -> Result<Plan<N>, PlanningError> {
    let machine = &driven(machine, mode);
    let plan = Plan::empty(source_name, machine.path.pulse, machine.tick_s, machine.letters_by_place());
    let (mut pipeline, mut gathered) = (Pipeline::new(machine, mode), Gathered::new(plan));
    let taken = pipeline.take_moves(moves, &mut |next| gathered.take(next));
    taken.map_err(|problem| PlanningError::at_line(source_name, problem))?;
    gathered.checked(machine)
}

/// A plan that is being gathered.
struct Gathered<const N: usize> {
    plan: Plan<N>,
    /// Of the stretch that is not at its end.
    blocks: Vec<StretchBlock<N>>,
    ramps: Vec<PlannedRamp>,
}

impl<const N: usize> Gathered<N> {
    fn new(plan: Plan<N>) -> Self {
        Self { plan, blocks: Vec::new(), ramps: Vec::new() }
    }

    fn take(&mut self, next: Next<N>) -> AtLine<()> {
        let plan = &mut self.plan;
        match next {
            Next::Path(Known::Block(block)) => self.blocks.push(block),
            Next::Path(Known::Ramp(ramp)) => self.ramps.push(ramp),
            Next::Path(Known::End) => self.close(),
            Next::Between(Between::Probe { line, probe }) => {
                plan.probes.push(PlannedProbe::new(line, plan.stretches, &probe));
            }
            Next::Between(Between::Dwell { line, seconds }) => {
                plan.time_s += seconds;
                plan.items.push(Item::Dwell { line, seconds });
            }
            Next::Between(Between::Switch { line, to }) => plan.items.push(Item::Switch { line, to }),
            Next::Between(Between::Stop { line, .. }) => plan.items.push(Item::Stop { line }),
        }
        Ok(())
    }

    fn close(&mut self) {
        let plan = &mut self.plan;
        let stretch = Stretch::new(plan.length_mm, std::mem::take(&mut self.blocks), &self.ramps);
        self.ramps.clear();
        plan.blocks.extend(stretch.block_records());
        let (length_mm, time_s) = (plan.length_mm, plan.time_s);
        plan.feed.extend(stretch.profile.ramps().iter().map(|&ramp| PlacedRamp {
            start_mm: length_mm + ramp.start_mm,
            start_s: time_s + ramp.start_s,
            ..ramp
        }));
        plan.time_s += stretch.profile.time_s();
        plan.length_mm += stretch.length_mm();
        plan.items.push(Item::Stretch(stretch));
        plan.stretches += 1;
    }

    /// The plan, if the tick can do it: what it can't is to be refused here, not on the machine.
    fn checked(self, machine: &Machine<N>) -> Result<Plan<N>, PlanningError> {
        let Self { mut plan, .. } = self;
        if plan.stretches == 0 {
            plan.notices.push("nothing moves: the program has no motion".to_owned());
        }
        for item in &Executable::new::<f32>(&plan)?.items {
            travel::check(item, machine).map_err(|problem| PlanningError::at_line(&plan.source, problem))?;
        }
        Ok(plan)
    }
}

/// What a program says, and what the machine does not act on.
pub(crate) fn notes<const N: usize>(program: &Program, machine: &Machine<N>) -> Vec<String> {
    program.notes(|kind| acts_on(machine, kind))
}

/// What is assumed of moves before any path mode is programmed, if there are such moves.
pub(crate) fn assumed_path<const N: usize>(steps: &[Step], machine: &Machine<N>) -> Option<String> {
    let is_assumed = |step: &&Step| step.kind.mode() == Some(PathMode::Unprogrammed);
    let line = steps.iter().find(is_assumed)?.line;
    let path = match machine.path.mode {
        DefaultPathMode::Exact => "exact path (G61)".to_owned(),
        DefaultPathMode::Blend => format!("G64 P{}", machine.path.blend_tolerance_mm),
    };
    Some(format!("line {line}: {path} is assumed until G61 or G64: path.mode of the machine"))
}

/// `machine` with the pulses of jerk of `mode`.
fn driven<const N: usize>(machine: &Machine<N>, mode: Mode) -> Machine<N> {
    let path = PathSettings { pulse: mode.pulse(machine.path.pulse), ..machine.path };
    Machine { path, ..machine.clone() }
}
