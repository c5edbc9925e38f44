//! The NUCLEO's board parameters and program, for the tests of this crate.

use motion_kernel::live::Leads;
use motion_kernel::units::Position;

use crate::parameters::{BoardOutputs, BoardParameters};

pub(crate) const AXES: usize = 3;

pub(crate) const BOARD: BoardParameters = BoardParameters {
    tick_hz: 2000,
    cycles_hz: 168_000_000,
    counts_per_s_max: 6_000_000,
    leads: Leads { stop_ticks: 3, plan_ticks: 8 },
    outputs: BoardOutputs::FixedSpeed,
};

pub(crate) const TICK_S: f64 = 0.0005;

/// Ticks of a long poll of the background: 33 ms. Only plans for another override take longer.
pub(crate) const POLL_TICKS_MAX: u32 = 66;

/// The stringer, 2.320 s long.
pub(crate) const PROGRAM: &[u8] = include_bytes!("../program/stringer.bin");

pub(crate) type Machine<'a> = crate::machine::Machine<'a, f32, AXES>;

pub(crate) fn machine() -> Machine<'static> {
    Machine::new(PROGRAM, &BOARD).expect("suits")
}

/// Where the stringer ends, as `motion compile` prints it.
pub(crate) fn end() -> [Position; AXES] {
    [102.045_923_136, 0.0, 0.0].map(|mm| Position::from_mm(mm).expect("in range"))
}
