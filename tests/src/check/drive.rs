//! Executes a generated program with the kernel's executor, checking every tick.

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode, Plan, Problem, plan_program};
use motion_host::toolpath::CompileError;
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::law::SegmentError;
use motion_kernel::path::PieceError;
use motion_kernel::program::Supply;
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;

use super::bounds::Number;
use super::motion::Checker;
use super::path::Path;
use super::program::Generated;
use super::totals::Totals;

/// Longer plans are not executed \[ticks\].
const TICKS_MAX: f64 = 150_000.0;
/// A board's capacities.
pub const PIECES: usize = 64;
pub const SEGMENTS: usize = 64;

/// Reads and plans; none if planning refuses it for its density.
pub fn plan(text: &str, machine: &Machine, mode: Mode, totals: &mut Totals) -> Result<Option<Plan>, String> {
    let program = gcode::read("random.ngc", text.as_bytes()).map_err(|error| error.to_string())?;
    match plan_program("random.ngc", &program, machine, mode) {
        Ok(plan) => Ok(Some(plan)),
        Err(error) => {
            let reason = match &error.problem {
                Problem::DensePieces { .. } => "dense pieces",
                Problem::DenseSegments { .. } => "dense segments",
                _ => return Err(error.to_string()),
            };
            *totals.refused.entry(reason.to_owned()).or_default() += 1;
            Ok(None)
        }
    }
}

/// Plans and executes a program; every tick is checked.
pub fn execute<R: Number>(
    program: &Generated,
    machine: &Machine,
    mode: Mode,
    seed: u64,
) -> Result<Totals, String> {
    let mut totals = Totals { programs: 1, ..Totals::default() };
    let path = Path::new(program, machine);
    if path.is_ambiguous {
        *totals.refused.entry("ambiguous corner, not executed".to_owned()).or_default() += 1;
        return Ok(totals);
    }
    let Some(plan) = plan(&program.text, machine, mode, &mut totals)? else { return Ok(totals) };
    totals.moves = plan.blocks.len() as u64;
    same_lengths(&plan, &path)?;
    let planned_ticks = plan.time_s / machine.tick_s;
    if planned_ticks > TICKS_MAX {
        *totals.refused.entry("long, not executed".to_owned()).or_default() += 1;
        return Ok(totals);
    }
    let executable = match Executable::new::<R>(&plan) {
        Ok(executable) => executable,
        // Planning has tried f32. Fixed point ends at 2³¹, also for snap, and does not resolve the curves
        // of a fraction of a micrometre.
        Err(error) if R::STEP > 0.0 && is_beyond_fixed_point(&error.problem) => {
            *totals.refused.entry("beyond fixed point".to_owned()).or_default() += 1;
            return Ok(totals);
        }
        Err(error) => return Err(error.to_string()),
    };
    let start = [Position::ZERO; 3];
    let mut streams = Streams::<R, 3, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut checker = Checker::new::<R>(machine, &plan, &path, seed);
    let (mut ticks, mut stops, mut stretches) = (0_u64, 0_u64, 0_usize);
    loop {
        supply.fill(&mut feeder).map_err(|rejection| format!("tick {ticks}: rejected: {rejection}"))?;
        let executed = executor.tick(&mut intake).map_err(|fault| format!("tick {ticks}: {fault:?}"))?;
        checker.tick(&executed).map_err(|error| format!("tick {ticks}: {error}"))?;
        ticks += 1;
        if executed.stretches as usize > stretches && executed.state != ExecState::Moving {
            at_end(&path, executed.stretches as usize - 1, &executed.setpoints.map(|axis| axis.position))?;
        }
        stretches = executed.stretches as usize;
        match executed.state {
            ExecState::Idle if supply.is_empty() => break,
            ExecState::Stopped => {
                stops += 1;
                executor.resume();
            }
            _ => {}
        }
        if ticks as f64 > planned_ticks + stops as f64 + 100.0 + path.stretches.len() as f64 {
            return Err(format!("{ticks} ticks and no end, planned {planned_ticks}, {stretches} stretches"));
        }
    }
    if stretches != path.stretches.len() || stops != path.stops {
        return Err(format!(
            "{stretches} stretches and {stops} stops, asked {} and {}",
            path.stretches.len(),
            path.stops
        ));
    }
    // The end falls into the last tick; every stop may spend up to a tick more.
    let more = ticks as f64 - planned_ticks;
    if !(more > -1e-3 && more < 1.0 + stops as f64 + 1e-3) {
        return Err(format!("{ticks} ticks, planned {planned_ticks}, {stops} stops, {stretches} stretches"));
    }
    totals.add(&checker.totals);
    Ok(totals)
}

pub fn is_beyond_fixed_point(problem: &Problem) -> bool {
    matches!(
        problem,
        Problem::Segment { error: SegmentError::OutOfRange { .. }, .. }
            | Problem::Geometry(CompileError::Piece(PieceError::NotArcLength { .. }))
    )
}

/// The plan has the program's moves.
pub fn same_lengths(plan: &Plan, path: &Path) -> Result<(), String> {
    let moves: Vec<_> = path.stretches.iter().flat_map(|stretch| &stretch.moves).collect();
    if moves.len() != plan.blocks.len() {
        return Err(format!("{} blocks planned, {} moves programmed", plan.blocks.len(), moves.len()));
    }
    for (block, placed) in plan.blocks.iter().zip(moves) {
        let (planned, exact) = (block.length_mm, placed.element.length_mm);
        if (planned - exact).abs() > 1e-9 + 1e-12 * exact {
            return Err(format!("line {}: {planned} mm planned, {exact} mm programmed", block.line));
        }
    }
    let whole = path.length_mm();
    if (plan.length_mm - whole).abs() > 1e-8 {
        Err(format!("{} mm planned, {whole} mm", plan.length_mm))
    } else {
        Ok(())
    }
}

/// The machine rests exactly where the program says, to a step of 2⁻³² mm.
pub fn at_end(path: &Path, stretch: usize, position: &[Position; 3]) -> Result<(), String> {
    let end =
        path.stretches.get(stretch).ok_or_else(|| format!("stretch {stretch} was not programmed"))?.end_bits;
    for (found, exact) in position.iter().zip(end) {
        if (found.to_bits() - exact).abs() > 1 {
            return Err(format!("stretch {stretch} ends at {} steps, programmed {exact}", found.to_bits()));
        }
    }
    Ok(())
}
