//! Executes a generated program under live control, checking every tick.

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Plan};
use motion_kernel::exec::{ExecState, Executed, Executor};
use motion_kernel::live::{Director, State};
use motion_kernel::queue::LiveStreams;
use motion_kernel::units::Position;

use super::bounds::Number;
use super::drive::at_end;
use super::motion::Checker;
use super::path::Path;
use super::totals::Totals;

pub(crate) const PIECES: usize = 64;
pub(crate) const SEGMENTS: usize = 16;
pub(crate) const PLACES: usize = 64;

/// What a script does between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Command {
    Hold,
    Resume,
    Override(f64),
    Abort,
    SingleBlock(bool),
    /// The background does not get its turn.
    Stall,
}

/// What a script sees of the tick that was.
pub(crate) struct Seen<'a, R: Number> {
    pub(crate) ticks: u64,
    pub(crate) state: State,
    pub(crate) executed: &'a Executed<R, 3>,
}

/// A run that came to its end.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) totals: Totals,
    pub(crate) ticks: u64,
    pub(crate) state: State,
    pub(crate) starvations: u32,
    /// Where the machine stands [mm].
    pub(crate) s_mm: f64,
}

/// Executes a plan; `script` is asked for commands before every tick, `background` whether the background gets its turn.
pub(crate) fn execute<R: Number>(
    plan: &Plan,
    path: &Path,
    machine: &Machine,
    most_override: f64,
    seed: u64,
    script: &mut dyn FnMut(&Seen<'_, R>) -> Option<Command>,
) -> Result<Run, String> {
    let executable = Executable::new::<R>(plan).map_err(|error| error.to_string())?;
    let start = [Position::ZERO; 3];
    let mut streams = LiveStreams::<R, 3, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut director = Director::<R, 3, _, _, PLACES>::new(executable.supplied(), executable.tick_s, 0);
    let mut checker = Checker::new::<R>(machine, plan, path, seed).live(most_override);
    let (mut ticks, mut stretches) = (0_u64, 0_usize);
    let mut executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
    loop {
        let state = director.state(&feeder);
        let command = script(&Seen { ticks, state, executed: &executed });
        match command {
            None | Some(Command::Stall) => {}
            Some(Command::Hold) => director.hold(),
            Some(Command::Resume) => director.resume(),
            Some(Command::Override(share)) => director.set_override(share).expect("within range"),
            Some(Command::Abort) => director.abort(),
            Some(Command::SingleBlock(is_single)) => director.set_single_block(is_single),
        }
        if command != Some(Command::Stall) {
            director.turn(&mut feeder).map_err(|error| format!("tick {ticks}: rejected: {error}"))?;
        }
        let before = executed.motion;
        executed = executor.tick(&mut intake).map_err(|fault| {
            let length_mm = path.stretches.get(stretches).map(|stretch| stretch.length_mm);
            format!("tick {ticks}: {fault:?} after {before:?} on {length_mm:?} mm of stretch {stretches}")
        })?;
        checker.tick(&executed).map_err(|error| format!("tick {ticks}: {error}"))?;
        ticks += 1;
        if executed.stretches as usize > stretches && executed.state != ExecState::Moving {
            at_end(path, executed.stretches as usize - 1, &executed.setpoints.map(|axis| axis.position))?;
        }
        stretches = executed.stretches as usize;
        if executed.state == ExecState::Stopped {
            executor.resume();
        }
        let state = director.state(&feeder);
        if matches!(state, State::Done | State::Aborted) && executed.state != ExecState::Dwell {
            return Ok(Run {
                s_mm: checker.s_mm(),
                totals: checker.totals,
                ticks,
                state,
                starvations: director.starvations(),
            });
        }
        if ticks as f64 > 60.0 * plan.time_s / machine.tick_s + 200_000.0 {
            return Err(format!("{ticks} ticks and no end, {state:?}, {:?}", executed.motion));
        }
    }
}
