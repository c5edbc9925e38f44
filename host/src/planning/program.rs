//! Steps of a program to stretches: where the motion must stop, and what each joint allows.

use motion_kernel::plan::{Ceiling, Joint, joint};

use super::error::{PlanningError, Problem};
use super::executable::Executable;
use super::stretch::{Stretch, StretchBlock};
use super::{Item, Mode, Plan};
use crate::gcode::{Feed, Program, StepKind};
use crate::machine::Machine;
use crate::toolpath::{Element, angle, norm, subtract};

/// Plans a whole program for a machine.
///
/// # Errors
/// A move can't be executed by the kernel, or the plan would exceed what a tick can do; the error
/// names the line.
pub fn plan_program(
    source_name: &str,
    program: &Program,
    machine: &Machine,
    mode: Mode,
) -> Result<Plan, PlanningError> {
    let at = |line: u32| {
        move |problem: Problem| PlanningError {
            source_name: source_name.to_owned(),
            place: line.into(),
            problem,
        }
    };
    let mut plan = Plan::empty(source_name, machine.tick_s);
    plan.notices = program.notices.iter().map(ToString::to_string).collect();
    let mut open: Vec<StretchBlock> = Vec::new();
    for step in &program.steps {
        let (element, feed) = match &step.kind {
            StepKind::Line(line) => (Element::line(line), line.feed),
            StepKind::Arc(arc) => (Element::arc(arc), arc.feed),
            StepKind::Dwell { .. } | StepKind::Stop | StepKind::End => {
                close(&mut open, &mut plan, mode).map_err(|(line, problem)| at(line)(problem))?;
                match step.kind {
                    // A dwell of no time changes nothing but the stop it makes.
                    StepKind::Dwell { seconds } if seconds > 0.0 => {
                        plan.time_s += seconds;
                        plan.items.push(Item::Dwell { line: step.line, seconds });
                    }
                    StepKind::Stop => plan.items.push(Item::Stop { line: step.line }),
                    _ => {}
                }
                continue;
            }
        };
        let feed_mm_s = match feed {
            Feed::Rapid => f64::INFINITY,
            Feed::MmPerMin(feed) => feed / 60.0,
        };
        let step = Move { line: step.line, element, feed_mm_s };
        append(&step, &mut open, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
    }
    close(&mut open, &mut plan, mode).map_err(|(line, problem)| at(line)(problem))?;
    // What the tick can't do is to be refused here, not on the machine.
    Executable::new::<f32>(&plan)?;
    Ok(plan)
}

/// A block of path that is to be driven.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    /// Program line.
    pub line: u32,
    /// Geometry.
    pub element: Element,
    /// Feed \[mm/s\]; infinite for a rapid.
    pub feed_mm_s: f64,
}

/// Plans moves that follow each other, from rest to rest.
///
/// # Errors
/// As [`plan_program`].
pub fn plan_moves(
    source_name: &str,
    moves: &[Move],
    machine: &Machine,
    mode: Mode,
) -> Result<Plan, PlanningError> {
    let at = |(line, problem): (u32, Problem)| PlanningError {
        source_name: source_name.to_owned(),
        place: line.into(),
        problem,
    };
    let mut plan = Plan::empty(source_name, machine.tick_s);
    let mut open: Vec<StretchBlock> = Vec::new();
    for step in moves {
        append(step, &mut open, &mut plan, machine, mode).map_err(at)?;
    }
    close(&mut open, &mut plan, mode).map_err(at)?;
    // What the tick can't do is to be refused here, not on the machine.
    Executable::new::<f32>(&plan)?;
    Ok(plan)
}

/// Appends a move to the open stretch, which is closed before if the machine has to stop there.
fn append(
    step: &Move,
    open: &mut Vec<StretchBlock>,
    plan: &mut Plan,
    machine: &Machine,
    mode: Mode,
) -> Result<(), (u32, Problem)> {
    let block =
        block(&step.element, step.line, step.feed_mm_s, machine).map_err(|problem| (step.line, problem))?;
    if let Some(last) = open.last_mut() {
        last.joint_mm_s = joint_feed(&last.element, &step.element, machine);
        if last.joint_mm_s <= 0.0 {
            close(open, plan, mode)?;
        }
    }
    open.push(block);
    Ok(())
}

fn block(element: &Element, line: u32, feed_mm_s: f64, machine: &Machine) -> Result<StretchBlock, Problem> {
    let ceiling = Ceiling::new(
        &machine.limits(),
        feed_mm_s,
        &element.tangent_max(),
        &element.curved(),
        &element.bend(),
    )?;
    Ok(StretchBlock { line, element: *element, ceiling, joint_mm_s: 0.0 })
}

/// Directions computed from coordinates that are exact to 10⁻¹⁰ mm agree to this where they are meant to.
const TANGENT_ROUNDING_RAD: f64 = 1.0e-9;

/// The greatest feed from one element to the next \[mm/s\]; 0 where the machine has to stop.
fn joint_feed(before: &Element, after: &Element, machine: &Machine) -> f64 {
    let ([_, end], [start, _]) = (before.ends(), after.ends());
    let angle_rad = angle(end.tangent, start.tangent);
    let steps = Joint { angle_rad, curvature_step_per_mm: norm(subtract(start.curvature, end.curvature)) };
    joint(
        &steps,
        machine.path.joint_angle_rad.max(TANGENT_ROUNDING_RAD),
        machine.path.accel_step_mm_s2,
        machine.tick_s,
    )
}

/// Plans the open stretch and appends it.
fn close(open: &mut Vec<StretchBlock>, plan: &mut Plan, mode: Mode) -> Result<(), (u32, Problem)> {
    if open.is_empty() {
        return Ok(());
    }
    let stretch = Stretch::new(std::mem::take(open), plan.length_mm, mode, plan.tick_s)?;
    plan.blocks.extend(stretch.block_records());
    plan.feed.extend(stretch.feed_records());
    plan.time_s += stretch.profile.time_s();
    plan.length_mm += stretch.length_mm();
    plan.items.push(Item::Stretch(stretch));
    Ok(())
}
