//! Steps of a program to stretches: where the motion must stop.

use super::blending::blocks;
use super::curves::{Point, cubic, nurbs, through};
use super::error::{PlanningError, Problem};
use super::executable::Executable;
use super::outputs::{Switches, acts_on};
use super::stretch::{Stretch, StretchBlock};
use super::{Item, Mode, PlacedRamp, Plan, PlannedProbe, travel};
use crate::gcode::{Feed, LineMove, PathMode, ProbeMove, Program, Step, StepKind};
use crate::machine::{DefaultPathMode, Machine, PathSettings};
use crate::toolpath::smooth::Move;
use crate::toolpath::{Element, Feeds};

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
    let at = |line: u32| {
        move |problem: Problem| PlanningError {
            source_name: source_name.to_owned(),
            place: line.into(),
            problem,
        }
    };
    let machine = &driven(machine, mode);
    let mut plan = Plan::empty(source_name, machine.path.pulse, machine.tick_s, machine.letters_by_place());
    plan.notices = program.notes(|kind| acts_on(machine, kind));
    plan.notices.extend(assumed_path(program, machine));
    let mut switches = Switches::new(machine);
    let mut run: Vec<Move<N>> = Vec::new();
    // Where the spline begins whose points are being collected.
    let (mut start, mut points) = ([0.0; N], Vec::<Point<N>>::new());
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
                run.push(path_move(step.line, Element::line(line, machine), line.feed, line.mode, machine));
            }
            StepKind::Arc(arc) => {
                let element = Element::arc(arc, machine).map_err(|error| at(step.line)(error.into()))?;
                run.push(path_move(step.line, element, arc.feed, arc.mode, machine));
            }
            StepKind::Cubic(curve) => {
                let element = cubic(curve, machine).map_err(at(step.line))?;
                run.push(path_move(step.line, element, curve.feed, curve.mode, machine));
            }
            StepKind::Nurbs(curve) => {
                let shape = program.nurbs.get(curve.curve);
                let elements = nurbs(curve, shape, machine).map_err(at(step.line))?;
                let moves = elements
                    .into_iter()
                    .map(|element| path_move(step.line, element, curve.feed, curve.mode, machine));
                run.extend(moves);
            }
            StepKind::Through(point) => {
                let (from, to) = (machine.coordinates(point.from), machine.coordinates(point.to));
                if points.is_empty() {
                    start = from;
                }
                let chord = Element::Line { from, to };
                let feeds = Feeds::programmed(point.feed.mm_s(), &chord, &machine.letters_by_place());
                points.push(Point { line: step.line, at: to, feeds, mode: point.mode });
            }
            StepKind::Probe(probe) => {
                append(&mut run, &mut plan, machine, mode).map_err(|(line, problem)| at(line)(problem))?;
                let ProbeMove { from, to, end, feed, .. } = *probe;
                travel::check_end(end, machine).map_err(at(step.line))?;
                plan.probes.push(PlannedProbe::new(step.line, plan.stretches, probe));
                if from != to {
                    let line = LineMove { from, to, feed, mode: PathMode::ExactStop };
                    let element = Element::line(&line, machine);
                    run.push(path_move(step.line, element, feed, line.mode, machine));
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
fn rest<const N: usize>(plan: &mut Plan<N>, line: u32, seconds: f64) {
    if seconds > 0.0 {
        plan.time_s += seconds;
        plan.items.push(Item::Dwell { line, seconds });
    }
}

/// Plans moves that follow each other, from rest to rest.
///
/// # Errors
/// Those of [`plan_program`].
pub fn plan_moves<const N: usize>(
    source_name: &str,
    mut moves: Vec<Move<N>>,
    machine: &Machine<N>,
    mode: Mode,
) -> Result<Plan<N>, PlanningError> {
    let machine = &driven(machine, mode);
    let mut plan = Plan::empty(source_name, machine.path.pulse, machine.tick_s, machine.letters_by_place());
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
fn assumed_path<const N: usize>(program: &Program, machine: &Machine<N>) -> Option<String> {
    let is_assumed = |step: &&Step| step.kind.mode() == Some(PathMode::Unprogrammed);
    let line = program.steps.iter().find(is_assumed)?.line;
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

fn path_move<const N: usize>(
    line: u32,
    element: Element<N>,
    feed: Feed,
    mode: PathMode,
    machine: &Machine<N>,
) -> Move<N> {
    let feeds = Feeds::programmed(feed.mm_s(), &element, &machine.letters_by_place());
    move_at(line, element, feeds, mode, machine)
}

pub(super) fn move_at<const N: usize>(
    line: u32,
    element: Element<N>,
    feeds: Feeds,
    mode: PathMode,
    machine: &Machine<N>,
) -> Move<N> {
    let merging_mm = match mode {
        PathMode::Blend { merging_mm, .. } => merging_mm,
        PathMode::Unprogrammed | PathMode::ExactPath | PathMode::ExactStop => None,
    };
    Move { line, element, feeds, tolerance_mm: machine.path.tolerance_mm(mode), merging_mm }
}

/// Appends the stretches of moves that follow each other, smoothed.
fn append<const N: usize>(
    run: &mut Vec<Move<N>>,
    plan: &mut Plan<N>,
    machine: &Machine<N>,
    mode: Mode,
) -> Result<(), (u32, Problem)> {
    let mut open: Vec<StretchBlock<N>> = Vec::new();
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
fn close<const N: usize>(
    open: &mut Vec<StretchBlock<N>>,
    plan: &mut Plan<N>,
    mode: Mode,
) -> Result<(), (u32, Problem)> {
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
