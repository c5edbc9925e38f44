//! What tick and background share.
//!
//! The tick has the higher priority and takes it freely; the background takes it for some tens of
//! instructions, right behind a tick.

use motion_kernel::exec::ExecState;
use motion_kernel::flight::FlightRecorder;
use motion_kernel::kernel::Kernel;
use motion_kernel::queue::Intake;
use motion_kernel::units::Position;
use nucleo_f446re::design_parameters::{FLIGHT_AFTER, FLIGHT_ROWS};
use nucleo_f446re::machine::AXES;
use nucleo_f446re::tick_timing::TickTiming;

/// The streams: 63 pieces, and three lists of 15 ramps.
pub(crate) type Streams = motion_kernel::queue::LiveStreams<f32, AXES, 64, 16>;

/// The last ticks, and some behind a fault.
pub(crate) type Flight = FlightRecorder<f32, AXES, FLIGHT_ROWS, FLIGHT_AFTER>;

/// Shared by tick and background. `pub` because RTIC makes a public proxy of it.
pub struct Control {
    pub(crate) kernel: Kernel<f32, AXES>,
    /// Where the kernel takes its motion from: an empty stream until the first start.
    pub(crate) intake: Intake<'static, f32, AXES>,
    /// What the executor was doing at the end of the last tick.
    pub(crate) state: ExecState,
    /// The set position of that tick.
    pub(crate) position: [Position; AXES],
    /// The inputs allow a start.
    pub(crate) healthy: bool,
    pub(crate) log: TickTiming,
    pub(crate) flight: &'static mut Flight,
}
