//! What boards on the link say of themselves, for tests that need one.

use motion_kernel::hal::BoardOutputs;
use motion_kernel::link::{Build, HomingProgress, Identity, State, Status};
use motion_kernel::program::FORMAT;
use motion_kernel::units::Position;

/// Of a board with three axes, in f32, without outputs. Its room for items is the test's.
pub const IDENTITY: Identity = Identity {
    build: Build::THIS,
    format: FORMAT as u16,
    axes: 3,
    is_fixed_point: false,
    tick_s: 5e-4,
    items: 0,
    outputs: BoardOutputs::None,
    machine: 1,
};

/// Of such a board at rest, before it was told anything.
pub const STATUS: Status<3> = Status {
    tick: 0,
    state: State::Idle,
    set: [Position::ZERO; 3],
    actual: [Position::ZERO; 3],
    feed_mm_s: 0.0,
    line: 0,
    aborts: 0,
    taken: 0,
    driven: 0,
    is_ended: false,
    starvations: 0,
    is_ready: true,
    fault: None,
    homing: HomingProgress::None,
    homed: [None; 3],
};
