//! What the two ends say to each other.

use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64::hash_ty_path;
use serde::{Deserialize, Serialize};

use crate::fault::Fault;
use crate::hal::BoardOutputs;
use crate::homing::{Homed, HomingError, HomingStage};
use crate::units::Position;

/// The version of this protocol. Raised where a message means something else, in the same form or another one.
const PROTOCOL: u16 = 7;

/// What an end of the link is built from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Build {
    /// The version of its protocol. A PC refuses a board of another one.
    pub protocol: u16,
    /// A number that differs where any message has another form: FNV-1a over their description.
    pub schema: u32,
    /// The version of the kernel: major, minor, patch.
    pub kernel: [u16; 3],
}

impl Build {
    /// Of this end.
    pub const THIS: Self = Self {
        protocol: PROTOCOL,
        schema: schema(),
        kernel: [
            decimal(env!("CARGO_PKG_VERSION_MAJOR")),
            decimal(env!("CARGO_PKG_VERSION_MINOR")),
            decimal(env!("CARGO_PKG_VERSION_PATCH")),
        ],
    };

    /// Whether both ends read each other's messages.
    #[must_use]
    pub fn understands(&self, other: &Self) -> bool {
        (self.protocol, self.schema) == (other.protocol, other.schema)
    }
}

/// The first four bytes of the hash. Arrays are as long as there are axes; the greeting tells how many there are.
const fn schema() -> u32 {
    let [a, b, c, d, ..] = hash_ty_path::<(Request, Reply<1>, Welcome)>("motion-kernel/link");
    u32::from_le_bytes([a, b, c, d])
}

/// The number that `digits` are.
const fn decimal(digits: &str) -> u16 {
    let mut rest = digits.as_bytes();
    let mut number: u16 = 0;
    while let [digit, after @ ..] = rest {
        number = number.wrapping_mul(10).wrapping_add((*digit - b'0') as u16);
        rest = after;
    }
    number
}

/// From the PC.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub(super) enum Request {
    /// Who is there? The answer has the same number.
    Hello { asker: u32 },
    /// What the operator wants. As all that follows, by who asked last.
    Controls { session: u32, asker: u32, controls: Controls },
    /// Compact items follow, to the payload's end, and after them the program's end, if it comes then; that has a number, too.
    /// They are of the program after so many aborts; the first one has this number in it, from 0.
    Items { session: u32, asker: u32, aborts: u16, first: u32, is_last: bool },
    /// Asks for the board's parameters from this byte on.
    Read { session: u32, asker: u32, offset: u32 },
    /// Bytes of new parameters follow, to the payload's end, from this one on; what they are as a whole.
    Write { session: u32, asker: u32, record: Record, offset: u32 },
    /// Switches the scope on, with another snapshot if `after` is not answered yet: the number of the last snapshot that is of
    /// no use any more. None switches it off.
    Scope { session: u32, asker: u32, after: Option<u32> },
    /// Asks for a row of the flight recorder, from 0.
    Flight { session: u32, asker: u32, row: u16 },
}

/// Parameters on their way: how many bytes, their checksum, and which attempt it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub(super) struct Record {
    pub(super) length: u32,
    pub(super) sum: u32,
    pub(super) attempt: u32,
}

/// Most bytes of parameters in a message.
pub(super) const PIECE_MAX: usize = 256;

/// Some bytes of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    bytes: [u8; PIECE_MAX],
    count: u16,
}

impl Piece {
    /// The first of `bytes`, as many as a message has.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let mut piece = Self { bytes: [0; PIECE_MAX], count: 0 };
        for (place, byte) in piece.bytes.iter_mut().zip(bytes) {
            *place = *byte;
            piece.count += 1;
        }
        piece
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.count.into()).unwrap_or_default()
    }
}

/// Why a board does not take parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum WriteError {
    /// The drives are on.
    DrivesOn,
    /// They are longer than the board has room for.
    Length {
        /// The room \[bytes\].
        room: u32,
    },
    /// They are damaged, or not for this board: another number of axes, another tick, a count rate that its inputs do not
    /// pass, a figure out of its range.
    Unsuitable,
    /// The board could not store them.
    Storage,
}

/// From the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub(super) enum Reply<const AXES: usize> {
    /// The answer to a hello, and to what is of another session. [`Welcome`] follows, to the payload's end, in a form that only
    /// an end with the same messages reads: this much any two ends understand.
    Welcome { session: u32, asker: u32, build: Build },
    /// What has come.
    Taken(Taken),
    /// What the machine does.
    Status { session: u32, status: Status<AXES> },
    /// Bytes of the board's parameters follow, from this one on, of so many.
    Parameters { session: u32, offset: u32, length: u32 },
    /// What has come of new parameters: bytes, or why they are not taken.
    Written { session: u32, record: Record, bytes: u32, error: Option<WriteError> },
    /// Of the scope: what follows, to the payload's end, is to be read in order. The number of the snapshot before it, and
    /// which frame since that it is.
    Scope { session: u32, epoch: u32, number: u32 },
    /// A row of the flight recorder follows, as a frame, to the payload's end; of so many. Without one nothing follows: there was
    /// no fault since the start, or since the last one was cleared, or it is too young.
    Flight { session: u32, row: u16, rows: u16 },
}

/// What follows on [`Reply::Welcome`]: what the board is, and the controls that are obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct Welcome {
    pub(super) identity: Identity,
    pub(super) controls: Controls,
}

/// What has come to the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(super) struct Taken {
    pub(super) session: u32,
    /// Who asked last: what was said to somebody before may still be in a wire.
    pub(super) asker: u32,
    /// How many programs were given up: items of those before are dropped.
    pub(super) aborts: u16,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Controls {
    /// Counts the changes; the newest controls replace all others.
    pub number: u32,
    /// Whether the program is to be driven.
    pub mode: Mode,
    /// Counts what was pressed to get there: the same mode pressed again is a command again.
    pub presses: u16,
    /// Counts commands to come to rest and give up the rest of the program: of the items that were sent before, too.
    pub aborts: u16,
    /// The PC's name for the program whose items follow; 0 if it has none.
    pub program: u32,
    /// The feed override \[0.1 %\], at most 2000; controls with more are not obeyed.
    pub override_permille: u16,
    /// Rest at the end of every program block.
    pub is_single_block: bool,
    /// After so long a silence of the PC the board holds by itself \[ms\]; 0: it does not. What is begun has 0 until it is set.
    pub dead_man_ms: u16,
    /// Whether the drives are to be on.
    pub is_enabled: bool,
    /// Counts what was pressed to get there: enabled again after a fault is a command again.
    pub power_presses: u16,
    /// Counts commands to clear a fault.
    pub fault_resets: u16,
    /// The axes to be homed, the lowest bit is the first one's.
    pub home_axes: u16,
    /// Counts commands to home them, one after the other: as long as the mode is [`Mode::Run`].
    pub homings: u16,
}

impl Controls {
    /// Held, as programmed: before the operator's first command.
    pub const NONE: Self = Self {
        number: 0,
        mode: Mode::Hold,
        presses: 0,
        aborts: 0,
        program: 0,
        override_permille: 1000,
        is_single_block: false,
        dead_man_ms: 0,
        is_enabled: false,
        power_presses: 0,
        fault_resets: 0,
        home_axes: 0,
        homings: 0,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Mode {
    /// Driven as items come.
    Run,
    /// At rest on the path.
    Hold,
}

/// What a board is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// What it is built from.
    pub build: Build,
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
    /// What there is for spindle and coolant.
    pub outputs: BoardOutputs,
    /// Checksum of the machine's parameters.
    pub machine: u32,
}

/// What the machine does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
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
    /// How many programs were given up before the one that is driven, as in [`Controls::aborts`].
    pub aborts: u16,
    /// The number of the first item that was not taken into the streams: motion is somewhere before it.
    pub taken: u32,
    /// How many pieces of path and ends of stretches of it are driven to their end: motion is on the next one, or at rest
    /// before it.
    pub driven: u32,
    /// The end of the program has come.
    pub is_ended: bool,
    /// Stops on the path because items came too late.
    pub starvations: u32,
    /// The inputs allow the drives to be enabled.
    pub is_ready: bool,
    /// What went wrong, until it is cleared.
    pub fault: Option<Fault<f64>>,
    /// What has become of homing, of the last command.
    pub homing: HomingProgress,
    /// The reference of every axis that is homed.
    #[serde(with = "crate::array")]
    pub homed: [Option<Homed>; AXES],
}

/// What has become of homing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub enum HomingProgress {
    /// Nothing was to be homed.
    #[default]
    None,
    /// An axis is being homed; or the machine comes to rest for it.
    UnderWay {
        /// The axis, from 0.
        axis: u16,
        /// What it is doing.
        stage: HomingStage,
    },
    /// All axes are homed that were to be.
    Done,
    /// It has ended early, at rest unless the drives are off. The axes before this one are homed.
    Failed {
        /// The axis, from 0.
        axis: u16,
        /// Why.
        failure: HomingFailure,
    },
}

/// Why a board has not homed an axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum HomingFailure {
    /// It has no settings for that, or there is no such axis.
    NoSettings,
    /// The drives are off, or were switched off.
    DrivesOff,
    /// It is in a fault.
    Fault,
    /// It was held or aborted.
    Aborted,
    /// It heard nothing for the dead man's time.
    Silent,
    /// A move is refused: a feed or a length is out of range.
    Refused,
    /// A move could not be executed.
    Failed,
    /// See [`HomingError::NoSwitch`].
    NoSwitch {
        /// Within this length \[mm\].
        travel_mm: f64,
    },
    /// See [`HomingError::StuckSwitch`].
    StuckSwitch {
        /// Within this length \[mm\].
        back_off_mm: f64,
    },
    /// See [`HomingError::LostSwitch`].
    LostSwitch {
        /// Within this length \[mm\].
        back_off_mm: f64,
    },
    /// See [`HomingError::NoIndex`].
    NoIndex {
        /// Within this length beyond the switch \[mm\].
        index_mm: f64,
    },
    /// See [`HomingError::NoLatch`].
    NoLatch,
}

impl From<HomingError> for HomingFailure {
    fn from(error: HomingError) -> Self {
        match error {
            HomingError::Move(_) => Self::Refused,
            HomingError::NoSwitch { travel_mm } => Self::NoSwitch { travel_mm },
            HomingError::StuckSwitch { back_off_mm } => Self::StuckSwitch { back_off_mm },
            HomingError::LostSwitch { back_off_mm } => Self::LostSwitch { back_off_mm },
            HomingError::NoIndex { index_mm } => Self::NoIndex { index_mm },
            HomingError::NoLatch => Self::NoLatch,
            HomingError::Aborted => Self::Aborted,
            HomingError::Failed => Self::Failed,
        }
    }
}

impl core::fmt::Display for HomingFailure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let of_kernel = match *self {
            Self::NoSettings => return f.write_str("no settings on the board: expected [axis.homing]"),
            Self::DrivesOff => return f.write_str("the drives are off: expected them on until it is homed"),
            Self::Fault => return f.write_str("the board is in a fault: expected none"),
            Self::Silent => {
                return f.write_str(
                    "the board heard nothing for the dead man's time: expected to be told to go on",
                );
            }
            Self::Refused => {
                return f.write_str("a move is refused: expected feeds and lengths that the axis has");
            }
            Self::NoSwitch { travel_mm } => HomingError::NoSwitch { travel_mm },
            Self::StuckSwitch { back_off_mm } => HomingError::StuckSwitch { back_off_mm },
            Self::LostSwitch { back_off_mm } => HomingError::LostSwitch { back_off_mm },
            Self::NoIndex { index_mm } => HomingError::NoIndex { index_mm },
            Self::NoLatch => HomingError::NoLatch,
            Self::Aborted => HomingError::Aborted,
            Self::Failed => HomingError::Failed,
        };
        of_kernel.fmt(f)
    }
}

impl core::error::Error for HomingFailure {}

/// A machine's state. Whether it is in a fault, [`Status::fault`] tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum State {
    /// The drives are off.
    Off,
    /// At rest: everything that came is driven.
    Idle,
    /// A program is under way.
    Moving,
    /// At rest for a programmed time.
    Dwell,
    /// At a program stop.
    Stopped,
    /// At rest in the middle of a program: the items that follow have not come.
    Starved,
    /// Held, at rest.
    Held,
    /// An item can't be executed; at rest after those before it.
    Refused,
    /// An axis is being homed.
    Homing,
}
