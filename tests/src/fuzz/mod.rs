//! The kernel and a machine, driven by bytes: what a fuzzer needs, and a test that reads its corpus. [`gcode`] is the same for
//! the interpreter of G-code, [`link`] for the two ends of the link.
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

#[cfg(feature = "host")]
pub mod gcode;
mod items;
mod judge;
pub mod link;
mod machine;
mod runs;

use arbitrary::{Result, Unstructured};
use motion_kernel::law::Pulse;
use motion_kernel::num::Fixed;

/// The laws of a run.
#[derive(Clone, Copy, Debug)]
pub struct Laws {
    /// Of the program's own ramps.
    pub planned: Pulse,
    /// Of what is planned anew.
    pub live: Pulse,
}

impl Laws {
    /// The four that there are.
    pub const ALL: [Self; 4] = [
        Self { planned: Pulse::Sin2, live: Pulse::Sin2 },
        Self { planned: Pulse::Plateau, live: Pulse::Plateau },
        Self { planned: Pulse::Sin2, live: Pulse::Plateau },
        Self { planned: Pulse::Plateau, live: Pulse::Sin2 },
    ];

    /// Those that `bytes` say: by what the choice of the number type leaves over of its byte, the second. So
    /// no byte says something else than before there were two laws.
    fn of(bytes: &[u8]) -> Self {
        let [_, byte, ..] = *bytes else { return Self::ALL[0] };
        Self::ALL[usize::from(byte) / NUMBERS % Self::ALL.len()]
    }
}

/// Number types to choose from.
const NUMBERS: usize = 3;

/// Runs what `bytes` say. Whether they were enough to say anything.
///
/// # Panics
/// The kernel breaks a promise.
pub fn drive(bytes: &[u8]) -> bool {
    drive_with(Laws::of(bytes), bytes)
}

/// The same with these laws instead of what `bytes` say of them.
///
/// # Panics
/// The kernel breaks a promise.
pub fn drive_with(laws: Laws, bytes: &[u8]) -> bool {
    let mut input = Unstructured::new(bytes);
    run(laws, &mut input).is_ok()
}

fn run(laws: Laws, input: &mut Unstructured<'_>) -> Result<()> {
    let is_live = input.ratio(1, 2)?;
    match (input.int_in_range(0..=NUMBERS - 1)?, is_live) {
        (0, false) => runs::of_streams::<f32>(laws, input),
        (1, false) => runs::of_streams::<f64>(laws, input),
        (_, false) => runs::of_streams::<Fixed>(laws, input),
        (0, true) => runs::under_live_control::<f32>(laws, input),
        (1, true) => runs::under_live_control::<f64>(laws, input),
        (_, true) => runs::under_live_control::<Fixed>(laws, input),
    }
}
