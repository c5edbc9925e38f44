//! What tabs and panel say to each other: a text of JSON each.

use serde::{Deserialize, Serialize};

use crate::board::interface::{BoardInfo, BoardState};

/// From a tab: a command, and the state that it was given at.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Said {
    /// The number of the state that the tab has heard last.
    pub heard: u64,
    /// What it wants.
    pub command: Command,
}

/// What a tab wants.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// This tab commands from now on.
    Take,
    /// Load a program.
    Load {
        /// Its name.
        name: String,
        /// Its text.
        text: String,
    },
    /// Drive it from its start.
    Start,
    /// Come to rest on the path. Any tab may.
    Hold,
    /// Go on.
    Resume,
    /// Come to rest, and give up the rest. Any tab may.
    Abort,
    /// The feed override.
    Override {
        /// \[0.1 %\]
        permille: u16,
    },
    /// Rest after every block.
    SingleBlock {
        /// Or not.
        is_on: bool,
    },
    /// Switch the drives. Any tab may switch them off.
    Drives {
        /// On or off.
        are_on: bool,
    },
    /// Clear a fault.
    ClearFault,
    /// Press a jog key, such as `X+` or `Y-0.1`.
    Press {
        /// Axis, direction, and distance.
        key: String,
        /// \[mm/s\]; without it, the axis' greatest feed.
        feed_mm_s: Option<f64>,
        /// Until it is released, at the latest at the end of its distance. A key that is not held goes all of it.
        is_held: bool,
    },
    /// Home an axis; without it, all that can be homed.
    Home {
        /// Its name.
        axis: Option<String>,
    },
    /// The key is still held: to be said again before [`KEY_SILENCE`](super::desk::KEY_SILENCE) has passed.
    Keep,
    /// The key is released. Any tab may.
    Release,
    /// Keep the ticks around a trigger, or the next ones.
    Capture {
        /// Such as `err_um>50`.
        trigger: Option<String>,
        /// Ticks before it.
        before: usize,
        /// Ticks after it.
        after: usize,
    },
}

impl Command {
    /// Whether a tab may say so that does not command.
    #[must_use]
    pub fn is_for_all(&self) -> bool {
        matches!(
            self,
            Self::Take
                | Self::Hold
                | Self::Abort
                | Self::Release
                // Of a key that was refused, or taken away: nothing is to be said about it.
                | Self::Keep
                | Self::Drives { are_on: false }
        )
    }

    /// Whether something may move by it: it is not to come late.
    #[must_use]
    pub fn may_move(&self) -> bool {
        matches!(
            self,
            Self::Start
                | Self::Resume
                | Self::Press { .. }
                | Self::Home { .. }
                | Self::Drives { are_on: true }
        )
    }
}

/// To a tab.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Told<'t> {
    /// What the board is; first of all.
    Board {
        /// It.
        board: &'t BoardInfo,
    },
    /// What the board does.
    State {
        /// Counts the states that were told.
        number: u64,
        /// It.
        state: &'t BoardState,
        /// Who commands: this tab, another, or nobody.
        commander: Commander,
    },
    /// Something has happened.
    Event {
        /// In words.
        text: &'t str,
        /// Whether it is a failure.
        is_failure: bool,
    },
    /// This tab's command is refused.
    Refused {
        /// Why.
        text: &'t str,
    },
    /// A program is loaded.
    Program {
        /// Its name.
        name: &'t str,
    },
    /// There is a picture of this number, to be fetched: of the program as it would be driven, or of ticks that were captured.
    Picture {
        /// Of what.
        of: PictureOf,
        /// Counts pictures.
        number: u64,
    },
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureOf {
    /// The program, on the simulated machine.
    Program,
    /// Ticks of the board.
    Capture,
}

/// Who commands, as a tab is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Commander {
    /// The tab itself.
    You,
    /// Another tab.
    Another,
    /// The next tab that commands anything.
    Nobody,
}
