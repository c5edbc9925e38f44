//! What the two ends say to each other.

use serde::{Deserialize, Serialize};

use crate::exec::ExecState;
use crate::units::Position;

/// The version of this protocol. A PC refuses a board of another version.
pub const PROTOCOL: u16 = 1;

/// From the PC.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Request {
    /// Who is there? The answer has the same number.
    Hello { asker: u32 },
    /// What the operator wants.
    Controls { session: u32, controls: Controls },
    /// Items follow, to the payload's end: of each an `Option`, none for the end of the program. The first one has this
    /// number.
    Items { session: u32, first: u32 },
}

/// From the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Reply<const AXES: usize> {
    /// The answer to a hello, and to what is of another session; with the controls that are obeyed.
    Welcome { session: u32, asker: u32, identity: Identity, controls: Controls },
    /// What has come.
    Taken(Taken),
    /// What the machine does.
    Status { session: u32, status: Status<AXES> },
}

/// What has come to the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Taken {
    pub(super) session: u32,
    /// The number of the controls obeyed last.
    pub(super) controls: u32,
    /// The number of the next item: all before it are here.
    pub(super) next: u32,
    /// The number of the first item that there is no room for.
    pub(super) limit: u32,
    /// A later item came instead of the next one.
    pub(super) is_missing: bool,
    /// The next item came, and can't be read.
    pub(super) is_unreadable: bool,
}

/// The greatest feed override \[0.1 %\].
const OVERRIDE_PERMILLE_MAX: u16 = 2000;

/// What the operator wants, as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Controls {
    /// Counts the changes; the newest controls replace all others.
    pub number: u32,
    /// Whether the program is to be driven.
    pub mode: Mode,
    /// Counts what was pressed to get there: the same mode pressed again is a command again.
    pub presses: u16,
    /// Counts commands to come to rest and give up the rest of the program.
    pub aborts: u16,
    /// The feed override \[0.1 %\], at most 2000; controls with more are not obeyed.
    pub override_permille: u16,
    /// Rest at the end of every program block.
    pub is_single_block: bool,
    /// Counts commands to enable the drives.
    pub enables: u16,
    /// Counts commands to clear a fault.
    pub fault_resets: u16,
}

impl Controls {
    /// Held, as programmed: before the operator's first command.
    pub const NONE: Self = Self {
        number: 0,
        mode: Mode::Hold,
        presses: 0,
        aborts: 0,
        override_permille: 1000,
        is_single_block: false,
        enables: 0,
        fault_resets: 0,
    };

    /// Whether all of them are within their ranges.
    pub(super) fn are_within_range(&self) -> bool {
        self.override_permille <= OVERRIDE_PERMILLE_MAX
    }

    /// Whether these are newer than `other`. Numbers wrap.
    pub(super) fn is_newer_than(&self, other: &Self) -> bool {
        self.number.wrapping_sub(other.number).cast_signed() > 0
    }
}

/// Whether the program is to be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// Driven as items come.
    Run,
    /// At rest on the path.
    Hold,
}

/// What a board is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Its [`PROTOCOL`].
    pub protocol: u16,
    /// Version of the format of items.
    pub format: u16,
    /// Number of axes.
    pub axes: u16,
    /// Whether it computes in fixed point.
    pub is_fixed_point: bool,
    /// The control tick \[s\].
    pub tick_s: f64,
    /// Items that it has room for.
    pub items: u16,
    /// Checksum of the machine's parameters.
    pub machine: u32,
}

/// What the machine does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status<const AXES: usize> {
    /// The tick.
    pub tick: u32,
    /// The machine's state.
    pub state: State,
    /// Set positions.
    #[serde(with = "crate::array")]
    pub set: [Position; AXES],
    /// Actual positions.
    #[serde(with = "crate::array")]
    pub actual: [Position; AXES],
    /// The feed \[mm/s\].
    pub feed_mm_s: f64,
    /// The program line; 0 at rest.
    pub line: u32,
    /// The number of the first item that was not taken into the streams: motion is somewhere before it.
    pub taken: u32,
    /// The number of the fault, from 1; 0 for none.
    pub fault: u16,
}

/// A machine's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// The drives are off.
    Off,
    /// Nothing to do.
    Idle,
    /// Moving along the path.
    Moving,
    /// At rest for a programmed time.
    Dwell,
    /// At a program stop.
    Stopped,
    /// Held.
    Held,
    /// In a fault.
    Fault,
}

impl From<ExecState> for State {
    fn from(state: ExecState) -> Self {
        match state {
            ExecState::Idle => Self::Idle,
            ExecState::Moving => Self::Moving,
            ExecState::Dwell => Self::Dwell,
            ExecState::Stopped => Self::Stopped,
            ExecState::Held => Self::Held,
        }
    }
}
