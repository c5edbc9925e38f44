//! The effect of the button and the console.
//!
//! Consumes the machine's phase and a request; produces an [`Action`], or why there is none. Only the button
//! starts motion when the machine is ready or at a program stop, where hands may be in the machine: noise on
//! the console's line can't. The console ends holds, whoever asked for them.

use crate::console::{Command, FeedOverride, Step};

/// The machine's phase of operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Drives off, never started.
    Ready,
    /// The program is under way.
    Running {
        /// Held, or coming to rest for a hold.
        is_held: bool,
        /// At rest at a program stop.
        is_stopped: bool,
    },
    /// The program is done, the machine is held at its end.
    Done,
    /// An item of the program is refused, or there is no way to its start; motion comes to rest, and is held
    /// there until reset.
    Refused,
    /// In a fault: drives off until reset, or on the way there.
    Faulted,
}

/// A request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// A press of the button: to start, hold or resume, depending on the phase.
    Press,
    /// A command from the console.
    Command(Command),
}

/// The action to take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Start a run.
    Start,
    /// Come to rest on the path.
    Hold,
    /// Resume from a hold or a program stop.
    Resume,
    /// Change the feed override, for this run and later ones.
    Override(Step),
    /// Switch single block, for this run and later ones.
    SingleBlock(bool),
    /// Nothing, and why.
    Nothing(&'static str),
}

impl Action {
    /// The action for a request in a phase.
    #[must_use]
    pub fn of(phase: Phase, asked: Asked) -> Self {
        match (phase, asked) {
            (Phase::Refused | Phase::Faulted, _) => Self::Nothing("reset the board to go on"),
            (_, Asked::Command(Command::Override(step))) => Self::Override(step),
            (_, Asked::Command(Command::SingleBlock(is_single))) => Self::SingleBlock(is_single),
            (Phase::Ready | Phase::Done, Asked::Press) => Self::Start,
            (Phase::Ready | Phase::Done, Asked::Command(Command::Hold | Command::Resume)) => {
                Self::Nothing("nothing runs: the start button starts")
            }
            (Phase::Running { is_held, is_stopped }, Asked::Press) => {
                if is_held || is_stopped {
                    Self::Resume
                } else {
                    Self::Hold
                }
            }
            (Phase::Running { is_stopped: true, .. }, Asked::Command(Command::Hold | Command::Resume)) => {
                Self::Nothing("at rest at a program stop: the start button resumes")
            }
            (Phase::Running { is_held: false, .. }, Asked::Command(Command::Hold)) => Self::Hold,
            (Phase::Running { .. }, Asked::Command(Command::Hold)) => Self::Nothing("it is held"),
            (Phase::Running { is_held: true, .. }, Asked::Command(Command::Resume)) => Self::Resume,
            (Phase::Running { .. }, Asked::Command(Command::Resume)) => Self::Nothing("it is not held"),
        }
    }
}

/// The settings for this run and later ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The feed override.
    pub feed_override: FeedOverride,
    /// Rest after every program line.
    pub is_single: bool,
}

impl Settings {
    /// As programmed.
    pub const NONE: Self = Self { feed_override: FeedOverride::NONE, is_single: false };
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHASES: [Phase; 8] = [
        Phase::Ready,
        Phase::Running { is_held: false, is_stopped: false },
        Phase::Running { is_held: true, is_stopped: false },
        Phase::Running { is_held: false, is_stopped: true },
        Phase::Running { is_held: true, is_stopped: true },
        Phase::Done,
        Phase::Refused,
        Phase::Faulted,
    ];

    /// A row for what is asked for, a letter for each phase: s starts, h holds, g resumes, - does nothing.
    #[test]
    fn every_phase_and_all_that_is_asked_for() {
        for (asked, expected) in [
            (Asked::Press, "shgggs--"),
            (Asked::Command(Command::Hold), "-h------"),
            (Asked::Command(Command::Resume), "--g-----"),
        ] {
            let found = PHASES.map(|phase| match Action::of(phase, asked) {
                Action::Start => 's',
                Action::Hold => 'h',
                Action::Resume => 'g',
                Action::Nothing(_) => '-',
                Action::Override(_) | Action::SingleBlock(_) => '?',
            });
            assert_eq!(String::from_iter(found), expected, "{asked:?}");
        }
    }

    /// Also before the first start and between runs: they are for what follows.
    #[test]
    fn what_holds_for_all_runs_is_taken_until_nothing_runs_any_more() {
        for phase in PHASES {
            let is_over = matches!(phase, Phase::Refused | Phase::Faulted);
            let actions = [
                (Command::Override(Step::Up), Action::Override(Step::Up)),
                (Command::SingleBlock(true), Action::SingleBlock(true)),
            ];
            for (command, action) in actions {
                let found = Action::of(phase, Asked::Command(command));
                assert_eq!(found == action, !is_over, "{phase:?}: {found:?}");
                assert_eq!(matches!(found, Action::Nothing(_)), is_over, "{phase:?}: {found:?}");
            }
        }
    }
}
