//! The kernel and a machine, driven by bytes: what a fuzzer needs, and a test that reads its corpus.
//!
//! Any bytes are a program with some of its items broken, a machine that answers as it should or as it likes, times at
//! which items, the background and commands come. [`drive()`] runs them and panics where the kernel breaks a promise:
//!
//! - nothing panics, overflows or goes on for ever;
//! - along the path feed, acceleration, jerk and snap keep the limits at every tick, and nothing jumps;
//! - a fault is latched, and stays until it is cleared; its end only grows more urgent, a ramp only falls, and the drives
//!   are off in time;
//! - a whole program on a machine that follows is driven to its exact end.
//!
//! ```text
//! bytes ─► items ─► runs: streams, or live control ─► kernel ─► test axes
//!                                                       └─► judge
//! ```

mod items;
mod judge;
mod machine;
mod runs;

use arbitrary::{Result, Unstructured};
use motion_kernel::num::Fixed;

/// Runs what `bytes` say. Whether they were enough to say anything.
///
/// # Panics
/// The kernel breaks a promise.
pub fn drive(bytes: &[u8]) -> bool {
    let mut input = Unstructured::new(bytes);
    run(&mut input).is_ok()
}

fn run(input: &mut Unstructured<'_>) -> Result<()> {
    let is_live = input.ratio(1, 2)?;
    match (input.int_in_range(0..=2)?, is_live) {
        (0, false) => runs::of_streams::<f32>(input),
        (1, false) => runs::of_streams::<f64>(input),
        (_, false) => runs::of_streams::<Fixed>(input),
        (0, true) => runs::under_live_control::<f32>(input),
        (1, true) => runs::under_live_control::<f64>(input),
        (_, true) => runs::under_live_control::<Fixed>(input),
    }
}
