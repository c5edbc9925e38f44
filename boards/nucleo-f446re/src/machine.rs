//! The board's number of axes and memory sizes, for the types of `motion_board`.

use crate::design_parameters::{FLIGHT_AFTER, FLIGHT_ROWS, LINK_ITEMS, PARAMETERS_MAX, PLACES};

/// Number of axes: X, Y, Z.
pub const AXES: usize = 3;

/// The program in flash: the host's `stringer.ngc` for the reference machine, or the file that
/// `MOTION_PROGRAM` named when this was built.
pub static PROGRAM: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/program.bin"));

/// The kernel's numbers: the processor has an FPU for them.
pub type Number = f32;

/// A program that suits the board, and its machine.
pub type Machine = motion_board::Machine<'static, Number, AXES>;

/// The streams: 63 pieces, and three lists of 15 ramps.
pub type Streams = motion_kernel::queue::LiveStreams<Number, AXES, 64, 16>;

/// The kernel's end of streams.
pub type Intake = motion_kernel::queue::Intake<'static, Number, AXES>;

/// The background's end of the streams.
pub type Feeder = motion_kernel::queue::LiveFeeder<'static, Number, AXES>;

/// The last ticks, and some after a fault.
pub type Flight = motion_kernel::flight::FlightRecorder<Number, AXES, FLIGHT_ROWS, FLIGHT_AFTER>;

/// Shared by tick and background.
pub type Control = motion_board::Control<'static, Number, AXES, FLIGHT_ROWS, FLIGHT_AFTER>;

/// The background of a board that a PC drives over the link.
pub type Linked = motion_board::Linked<'static, Number, AXES, LINK_ITEMS, PLACES, PARAMETERS_MAX>;

/// The background of a board on its own.
pub type Background = motion_board::Background<'static, Number, AXES, 64, 16, PLACES>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_parameters::BOARD;

    #[test]
    fn the_program_in_flash_suits() {
        assert!(Machine::new(PROGRAM, &BOARD).is_ok());
    }
}
