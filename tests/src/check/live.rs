//! Executes a generated program under live control, checking every tick.

use std::collections::VecDeque;

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Plan};
use motion_kernel::exec::{ExecState, Executed, Executor};
use motion_kernel::live::{Leads, LiveControl, Source, State};
use motion_kernel::queue::LiveStreams;
use motion_kernel::units::Position;

use super::bounds::Number;
use super::drive::at_end;
use super::motion::Checker;
use super::path::Path;
use super::totals::Totals;

pub const PIECES: usize = 64;
pub const SEGMENTS: usize = 16;
pub const PLACES: usize = 64;

/// What a script does between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    Hold,
    Resume,
    Override(f64),
    Abort,
    SingleBlock(bool),
    /// The background is not polled.
    Stall,
}

/// What a script is told of the latest tick.
pub struct TickView<'a, R: Number> {
    pub ticks: u64,
    pub state: State,
    pub executed: &'a Executed<R, 3>,
}

/// What is run.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    pub plan: &'a Plan,
    pub path: &'a Path,
    pub machine: &'a Machine,
    pub seed: u64,
    /// After so many ticks with a background the feed is that of no earlier override, where that is known; the greatest one
    /// otherwise.
    pub response_ticks: u64,
}

/// A run that came to its end.
#[derive(Debug)]
pub struct Run {
    pub totals: Totals,
    pub ticks: u64,
    pub state: State,
    pub starvations: u32,
    /// How often motion came to rest, at its end too.
    pub rests: u64,
    /// Commands given, without [`Command::Stall`].
    pub commands: u64,
    /// Where the machine stands \[mm\].
    pub s_mm: f64,
}

/// The greatest of the latest values.
struct Greatest {
    ticks: u64,
    /// Those that no later one is above, with the last tick with a background that each was in force.
    falling: VecDeque<(u64, f64)>,
}

impl Greatest {
    /// Of `value` from the tick `now` on and what was in force in the `ticks` before.
    fn of(&mut self, now: u64, value: f64) -> f64 {
        while self.falling.back().is_some_and(|&(_, last)| last <= value) {
            self.falling.pop_back();
        }
        self.falling.push_back((now, value));
        while self.falling.front().is_some_and(|&(last, _)| last.saturating_add(self.ticks) < now) {
            self.falling.pop_front();
        }
        self.falling.front().map_or(value, |&(_, greatest)| greatest)
    }
}

/// Executes a plan whose items are all there; `script` is asked for a command before every tick.
pub fn execute<R: Number>(
    setup: &Setup<'_>,
    script: &mut dyn FnMut(&TickView<'_, R>) -> Option<Command>,
) -> Result<Run, String> {
    let executable = Executable::new::<R>(setup.plan).map_err(|error| error.to_string())?;
    execute_from::<R, _>(setup, executable.supplied(), script)
}

/// Executes the items of a plan as they come from `source`.
pub fn execute_from<R: Number, S: Source<3>>(
    setup: &Setup<'_>,
    source: S,
    script: &mut dyn FnMut(&TickView<'_, R>) -> Option<Command>,
) -> Result<Run, String>
where
    S::Error: Clone + std::fmt::Display,
{
    let &Setup { plan, path, machine, seed, response_ticks } = setup;
    let start = [Position::ZERO; 3];
    let mut streams = LiveStreams::<R, 3, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut control =
        LiveControl::<R, 3, _, _, PLACES>::new(source, machine.path.pulse, machine.tick_s, Leads::NONE);
    let mut checker = Checker::new::<R>(machine, plan, path, seed).live(1.0);
    let mut greatest = Greatest { ticks: response_ticks, falling: VecDeque::new() };
    let (mut ticks, mut polls, mut stretches, mut feed_override) = (0_u64, 0_u64, 0_usize, 1.0);
    let (mut rests, mut commands, mut stops, mut dwelt) = (0_u64, 0_u64, 0_u64, 0_u64);
    let mut executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
    loop {
        let state = control.state(&feeder);
        let command = script(&TickView { ticks, state, executed: &executed });
        commands += u64::from(command.is_some_and(|command| command != Command::Stall));
        match command {
            None | Some(Command::Stall) => {}
            Some(Command::Hold) => control.hold(),
            Some(Command::Resume) => control.resume(),
            Some(Command::Override(share)) => {
                control.set_override(share).expect("within range");
                feed_override = share;
            }
            Some(Command::Abort) => control.abort(),
            Some(Command::SingleBlock(is_single)) => control.set_single_block(is_single),
        }
        if command != Some(Command::Stall) {
            control.poll(&mut feeder).map_err(|error| format!("tick {ticks}: rejected: {error}"))?;
            polls += 1;
        }
        let before = (executed.motion, executed.state);
        executed = executor.tick(&mut intake).map_err(|fault| {
            let length_mm = path.stretches.get(stretches).map(|stretch| stretch.length_mm);
            format!("tick {ticks}: {fault:?} after {before:?} on {length_mm:?} mm of stretch {stretches}")
        })?;
        // What was commanded just before the background was kept from its polls may be obeyed after them.
        checker.override_up_to(greatest.of(polls, feed_override));
        checker.tick(&executed).map_err(|error| format!("tick {ticks}: {error}"))?;
        ticks += 1;
        rests += u64::from(before.1 == ExecState::Moving && executed.state != ExecState::Moving);
        dwelt += u64::from(executed.state == ExecState::Dwell);
        if executed.stretches as usize > stretches && executed.state != ExecState::Moving {
            at_end(path, executed.stretches as usize - 1, &executed.setpoints.map(|axis| axis.position))?;
        }
        stretches = executed.stretches as usize;
        if executed.state == ExecState::Stopped {
            stops += 1;
            executor.resume();
        }
        let state = control.state(&feeder);
        if matches!(state, State::Done | State::Aborted) && executed.state != ExecState::Dwell {
            // Nothing is lost, nothing repeated: of a dwell a part of a tick at either end may not be seen.
            let dwell_ticks = path.dwell_s / machine.tick_s;
            let is_all = stretches == path.stretches.len()
                && stops == path.stops
                && (dwelt as f64 - dwell_ticks).abs() <= path.dwells as f64 + 1e-3;
            if state == State::Done && !is_all {
                return Err(format!(
                    "{stretches} stretches, {stops} stops, {dwelt} ticks of dwells, programmed {}, {}, {dwell_ticks}",
                    path.stretches.len(),
                    path.stops
                ));
            }
            return Ok(Run {
                s_mm: checker.s_mm(),
                totals: checker.totals,
                ticks,
                state,
                starvations: control.starvations(),
                rests,
                commands,
            });
        }
        if ticks as f64 > 60.0 * plan.time_s / machine.tick_s + 200_000.0 {
            return Err(format!("{ticks} ticks and no end, {state:?}, {:?}", executed.motion));
        }
    }
}
