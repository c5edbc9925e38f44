//! Steps of a program to stretches: where the motion must stop.

use super::blending::blocks;
use super::curves::{Point, cubic, nurbs, through};
use super::error::{PlanningError, Problem};
use super::executable::Executable;
use super::outputs::{Switches, acts_on};
use super::stretch::{Stretch, StretchBlock};
use super::{Item, Mode, PlacedRamp, Plan, PlannedProbe, travel};
use crate::gcode::{LineMove, PathMode, ProbeMove, Program, Step, StepKind, xyz_mm};
use crate::machine::{DefaultPathMode, Machine, PathSettings};
use crate::toolpath::Element;
use crate::toolpath::smooth::Move;

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
    let machine = &driven(machine, mode);
    let mut plan = Plan::empty(source_name, machine.path.pulse, machine.tick_s);
    plan.notices = program.notes(|kind| acts_on(machine, kind));
    plan.notices.extend(assumed_path(program, machine));
    let mut switches = Switches::new(machine);
    let mut run: Vec<Move> = Vec::new();
    // Where the spline begins whose points are being collected.
    let (mut start, mut points) = ([0.0; 3], Vec::<Point>::new());
    for step in &program.steps {
        let switch = match &step.kind {
            StepKind::Switch(to) => match switches.next(to).map_err(at(step.line))? {
                // For this machine it is no step.
                None => continue,
                switch => switch,
            },
            _ => None,
        };
        if !matches!(&step.kind, StepKind::Through(point) if !point.begins) {
            let stops = points.last().is_some_and(|point| point.mode == PathMode::ExactStop);
            let moves = through(start, &mut points, machine);
            run.extend(moves.map_err(|(line, problem)| at(line)(problem))?);
            if stops {
                append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
            }
        }
        match &step.kind {
            StepKind::Line(line) => {
                run.push(path_move(step.line, Element::line(line), line.feed.mm_s(), line.mode, machine));
            }
            StepKind::Arc(arc) => {
                run.push(path_move(step.line, Element::arc(arc), arc.feed.mm_s(), arc.mode, machine));
            }
            StepKind::Cubic(curve) => {
                let element = cubic(curve).map_err(at(step.line))?;
                run.push(path_move(step.line, element, curve.feed.mm_s(), curve.mode, machine));
            }
            StepKind::Nurbs(curve) => {
                let elements = nurbs(program.nurbs.get(curve.curve)).map_err(at(step.line))?;
                let moves = elements
                    .into_iter()
                    .map(|element| path_move(step.line, element, curve.feed.mm_s(), curve.mode, machine));
                run.extend(moves);
            }
            StepKind::Through(point) => {
                if points.is_empty() {
                    start = xyz_mm(point.from);
                }
                let (feed_mm_s, mode) = (point.feed.mm_s(), point.mode);
                points.push(Point { line: step.line, at: xyz_mm(point.to), feed_mm_s, mode });
            }
            StepKind::Probe(probe) => {
                append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
                let ProbeMove { from, to, end, feed, .. } = *probe;
                travel::check_end(end, machine).map_err(at(step.line))?;
                plan.probes.push(PlannedProbe::new(step.line, plan.stretches, probe));
                if from != to {
                    let line = LineMove { from, to, feed, mode: PathMode::ExactStop };
                    run.push(path_move(step.line, Element::line(&line), feed.mm_s(), line.mode, machine));
                }
                append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
            }
            StepKind::Dwell { .. }
            | StepKind::ToolChange { .. }
            | StepKind::Switch(_)
            | StepKind::Stop
            | StepKind::End => {
                append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
                let line = step.line;
                match step.kind {
                    StepKind::Dwell { seconds } => rest(&mut plan, line, seconds),
                    StepKind::Switch(_) => {
                        if let Some((to, wait_s)) = switch {
                            plan.items.push(Item::Switch { line, to });
                            rest(&mut plan, line, wait_s);
                        }
                    }
                    StepKind::ToolChange { .. } | StepKind::Stop => {
                        plan.items.push(Item::Stop { line });
                    }
                    _ => {}
                }
            }
        }
        // The points of a spline are not moves yet; the stop behind the last is made above.
        let is_point = matches!(step.kind, StepKind::Through(_));
        let stops = step.kind.mode() == Some(PathMode::ExactStop) && !is_point;
        if stops {
            append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
        }
    }
    let moves = through(start, &mut points, machine);
    run.extend(moves.map_err(|(line, problem)| at(line)(problem))?);
    append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
    // What the tick can't do is to be refused here, not on the machine.
    travel::check(source_name, &Executable::new::<f32>(&plan)?, machine)?;
    Ok(plan)
}

/// A dwell; one of no time changes nothing but the stop it makes.
fn rest(plan: &mut Plan, line: u32, seconds: f64) {
    if seconds > 0.0 {
        plan.time_s += seconds;
        plan.items.push(Item::Dwell { line, seconds });
    }
}

/// Plans moves that follow each other, from rest to rest.
///
/// # Errors
/// Those of [`plan_program`].
pub fn plan_moves(
    source_name: &str,
    mut moves: Vec<Move>,
    machine: &Machine,
    mode: Mode,
) -> Result<Plan, PlanningError> {
    let machine = &driven(machine, mode);
    let mut plan = Plan::empty(source_name, machine.path.pulse, machine.tick_s);
    append(&mut moves, &mut plan, machine, mode).map_err(|(line, problem)| PlanningError {
        source_name: source_name.to_owned(),
        place: line.into(),
        problem,
    })?;
    // As for a program.
    travel::check(source_name, &Executable::new::<f32>(&plan)?, machine)?;
    Ok(plan)
}

/// What is assumed of moves before any path mode is programmed, if there are such moves.
fn assumed_path(program: &Program, machine: &Machine) -> Option<String> {
    let is_assumed = |step: &&Step| step.kind.mode() == Some(PathMode::Unprogrammed);
    let line = program.steps.iter().find(is_assumed)?.line;
    let path = match machine.path.mode {
        DefaultPathMode::Exact => "exact path (G61)".to_owned(),
        DefaultPathMode::Blend => format!("G64 P{}", machine.path.blend_tolerance_mm),
    };
    Some(format!("line {line}: {path} is assumed until G61 or G64: path.mode of the machine"))
}

/// `machine` with the pulses of jerk of `mode`.
fn driven(machine: &Machine, mode: Mode) -> Machine {
    let path = PathSettings { pulse: mode.pulse(machine.path.pulse), ..machine.path };
    Machine { path, ..machine.clone() }
}

pub(super) fn path_move(
    line: u32,
    element: Element,
    feed_mm_s: f64,
    mode: PathMode,
    machine: &Machine,
) -> Move {
    let merging_mm = match mode {
        PathMode::Blend { merging_mm, .. } => merging_mm,
        PathMode::Unprogrammed | PathMode::ExactPath | PathMode::ExactStop => None,
    };
    Move { line, element, feed_mm_s, tolerance_mm: machine.path.tolerance_mm(mode), merging_mm }
}

/// Appends the stretches of moves that follow each other, smoothed.
fn append(run: &mut Vec<Move>, plan: &mut Plan, machine: &Machine, mode: Mode) -> Result<(), (u32, Problem)> {
    let mut open: Vec<StretchBlock> = Vec::new();
    for block in blocks(run, machine)? {
        open.push(block);
        // Also after the last.
        if block.junction_mm_s <= 0.0 {
            close(&mut open, plan, mode)?;
        }
    }
    run.clear();
    Ok(())
}

/// Plans the open stretch and appends it.
fn close(open: &mut Vec<StretchBlock>, plan: &mut Plan, mode: Mode) -> Result<(), (u32, Problem)> {
    let stretch = Stretch::new(std::mem::take(open), plan.length_mm, mode, plan.tick_s)?;
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
    Ok(())
}
