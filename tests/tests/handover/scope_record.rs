//! What the ring's file needs of the kernel's records.

use motion_kernel::hal::AxisInputs;
use motion_kernel::units::DacCode;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TickRecord<const AXES: usize> {
    pub(super) generation: u32,
    pub(super) counts: [u32; AXES],
    pub(super) set: [u32; AXES],
    pub(super) codes: [DacCode; AXES],
    pub(super) inputs: [AxisInputs; AXES],
    pub(super) is_stopped: bool,
    pub(super) state: u8,
    pub(super) failures: u8,
    pub(super) trips: TripCount,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TripCount(u8);

impl TripCount {
    pub(super) fn of(byte: u8) -> Self {
        Self(byte)
    }
}
