//! A program under live control, in closed loop with the simulated machine, tick by tick.

use hal_sim::SimMachine;
use hal_sim::closed_loop::live::{LiveProducer, close};
use hal_sim::closed_loop::{ClosedLoop, reference_machine};
use motion_kernel::program::Reader;
use motion_kernel::queue::LiveStreams;
use motion_kernel::trace::Trace;

use crate::{AXES, LINE, Number, PIECES, SUBSTEPS, fail};

/// Capacity of a feed list.
pub const SEGMENTS: usize = 16;
/// Blocks and ramps that live control knows ahead.
pub const PLACES: usize = 64;

/// The background.
pub type Producer<'a> = LiveProducer<'a, Number, AXES, PLACES>;
/// The interrupt's part.
pub type Closed<'a> = ClosedLoop<'a, Number, AXES, LINE>;
/// The memory of path and feed lists.
pub type Streams = LiveStreams<Number, AXES, PIECES, SEGMENTS>;

/// Runs `bytes` under the commands of `seed`; `tick` has the background's poll and the kernel's tick done.
/// Whether it ended in a fault.
pub fn run(
    bytes: &[u8],
    seed: u64,
    mut tick: impl FnMut(&mut Producer<'_>, &mut Closed<'_>) -> Trace<Number, AXES>,
) -> bool {
    let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
    let machine = SimMachine::<AXES, LINE>::new(&reference_machine(program.header(), SUBSTEPS))
        .unwrap_or_else(|error| fail(&error));
    let mut streams = Streams::new();
    let (mut producer, mut closed) =
        close(&program, &mut streams, &machine, seed).unwrap_or_else(|error| fail(&error));
    loop {
        let trace = tick(&mut producer, &mut closed);
        if trace.fault.is_some() || producer.is_over(trace.executed.state) {
            return trace.fault.is_some();
        }
    }
}
