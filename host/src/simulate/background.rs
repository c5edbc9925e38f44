//! The background's part of a run: keeps the streams filled, and obeys a script.

use core::convert::Infallible;

use motion_kernel::exec::ExecState;
use motion_kernel::hal::{OutputState, Outputs};
use motion_kernel::law::Pulse;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::path::Travel;
use motion_kernel::program::{Item, Supply, SupplyError, Switching};
use motion_kernel::queue::{Feeder, Intake, LiveFeeder, LiveStreams, PathRules, Streams};
use motion_kernel::units::Position;

use super::job::RunInfo;
use super::live::{Command, Due, Script};
use super::switches::Switches;
use crate::trace::{HeldBy, RunEnd};

/// Capacities of the two streams, as a board has them.
const PIECES: usize = 64;
const SEGMENTS: usize = 64;
/// Of a stream with live control: path enough to stop on, short feed lists, as many blocks ahead as pieces.
const LIVE_PIECES: usize = 1024;
const LIVE_SEGMENTS: usize = 16;
const PLACES: usize = LIVE_PIECES;

/// The memory of the streams.
pub(super) enum Storage<'script, R: Real, const N: usize> {
    Plain(Box<Streams<R, N, PIECES, SEGMENTS>>),
    Live(Box<LiveStreams<R, N, LIVE_PIECES, LIVE_SEGMENTS>>, &'script Script, Vec<Due>),
}

/// What fills them.
pub(super) enum Background<'a, R: Real, I, const N: usize> {
    Plain(Box<Plain<'a, R, I, N>>),
    Live(Box<Live<'a, R, I, N>>),
}

/// Without live control.
type Plain<'a, R, I, const N: usize> = (Feeder<'a, R, N>, Supply<R, N, Switching<I>, Infallible>);

/// Under live control.
pub(super) struct Live<'a, R: Real, I, const N: usize> {
    feeder: LiveFeeder<'a, R, N>,
    control: LiveControl<R, N, Switching<I>, Infallible, PLACES>,
    script: &'a Script,
    /// When its commands are due.
    due: Vec<Due>,
    /// Commands given so far.
    given: usize,
    /// Whether the latest of hold and resume was a hold.
    is_on_hold: bool,
}

impl<'script, R: Real, const N: usize> Storage<'script, R, N> {
    /// For a run under live control, if there is a script.
    pub(super) fn new(script: Option<&'script Script>, info: &RunInfo) -> Self {
        match script {
            None => Self::Plain(Box::default()),
            Some(script) => Self::Live(Box::default(), script, script.due(info)),
        }
    }

    /// The two ends, at `start` and within the travel.
    pub(super) fn split<'a, I: Iterator<Item = Result<Item<N>, Infallible>>>(
        &'a mut self,
        rules: PathRules,
        (start, travel): ([Position; N], Travel<N>),
        items: I,
        (pulse, tick_s): (Pulse, f64),
    ) -> (Background<'a, R, I, N>, Intake<'a, R, N>) {
        let items = Switching::new(items);
        match self {
            Self::Plain(streams) => {
                let (mut feeder, intake) = streams.split(rules, start);
                feeder.bound(travel);
                (Background::Plain(Box::new((feeder, Supply::new(items, tick_s)))), intake)
            }
            Self::Live(streams, script, due) => {
                let (mut feeder, intake) = streams.split(rules, start);
                feeder.bound(travel);
                let control = LiveControl::new(items, pulse, tick_s, Leads::NONE);
                let due = due.clone();
                let live = Live { feeder, control, script, due, given: 0, is_on_hold: false };
                (Background::Live(Box::new(live)), intake)
            }
        }
    }
}

impl<R: Real, I: Iterator<Item = Result<Item<N>, Infallible>>, const N: usize> Background<'_, R, I, N> {
    /// Before a tick; the one before ended in `state`, so far along the path \[mm\].
    pub(super) fn poll(
        &mut self,
        (tick, s_mm): (u64, f64),
        state: ExecState,
        (switches, hardware): (&mut Switches<'_>, &mut impl Outputs),
    ) -> Result<(), SupplyError<Infallible>> {
        match self {
            Self::Plain(plain) => {
                let (feeder, supply) = &mut **plain;
                if !switches.is_over()
                    && supply.is_waiting()
                    && state == ExecState::Idle
                    && let Some(to) = supply.source_mut().due()
                {
                    switches.by_program(tick, to, hardware);
                    supply.source_mut().switched();
                }
                supply.fill(feeder)
            }
            Self::Live(live) => {
                let Live { feeder, control, script, due, given, is_on_hold } = &mut **live;
                while let Some(timed) = script.commands().get(*given)
                    && due.get(*given).is_some_and(|due| due.is_reached(tick, s_mm))
                {
                    match timed.command {
                        Command::Hold => *is_on_hold = true,
                        Command::Resume => *is_on_hold = false,
                        _ => {}
                    }
                    match timed.command {
                        Command::Hold => control.hold(),
                        Command::Resume => control.resume(),
                        Command::Abort => control.abort(),
                        // A script holds none beyond the range.
                        Command::Override(share) => control.set_override(share).unwrap_or_default(),
                        Command::SingleBlock(is_single) => control.set_single_block(is_single),
                    }
                    *given += 1;
                    // Each by itself, as if time passed between them.
                    control.poll(feeder)?;
                }
                control.poll(feeder)?;
                while !switches.is_over()
                    && control.state(feeder) == State::Waiting
                    && let Some(to) = control.source_mut().due()
                {
                    switches.by_program(tick, to, hardware);
                    control.source_mut().switched();
                    control.poll(feeder)?;
                }
                Ok(())
            }
        }
    }

    /// How many commands of the script were given.
    pub(super) fn given(&self) -> usize {
        match self {
            Self::Plain(_) => 0,
            Self::Live(live) => live.given,
        }
    }

    /// How the run ends with a tick that ended in `state`, if it does: no item is left, or no command to
    /// resume.
    pub(super) fn ended(&self, state: ExecState) -> Option<RunEnd> {
        match self {
            Self::Plain(plain) => {
                (plain.1.is_empty() && state == ExecState::Idle).then_some(RunEnd::Finished)
            }
            Self::Live(live) => {
                let is_last = live.given == live.script.commands().len();
                match live.control.state(&live.feeder) {
                    State::Done if state == ExecState::Idle => Some(RunEnd::Finished),
                    State::Aborted => Some(RunEnd::Aborted),
                    State::Held if is_last => {
                        Some(RunEnd::Held(if live.is_on_hold { HeldBy::Hold } else { HeldBy::SingleBlock }))
                    }
                    State::Running if is_last && live.control.is_stopped_by_override(&live.feeder) => {
                        Some(RunEnd::Held(HeldBy::Override))
                    }
                    _ => None,
                }
            }
        }
    }

    /// What is to be switched once the items before are done.
    pub(super) fn due(&mut self) -> Option<OutputState> {
        match self {
            Self::Plain(plain) => plain.1.source_mut().due(),
            Self::Live(live) => live.control.source_mut().due(),
        }
    }

    /// How often motion had to stop because data came too late.
    pub(super) fn starvations(&self) -> u32 {
        match self {
            Self::Plain(_) => 0,
            Self::Live(live) => live.control.starvations(),
        }
    }
}
