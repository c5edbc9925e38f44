//! The part of the firmware that all boards share: everything except pins, peripherals and interrupts.
//!
//! ```text
//! tick    drives, encoders ─► Control::tick ─► converter      feeds the watchdog while Liveness allows
//!                                  │
//!                              rtic_core::Mutex
//!                                  │
//! idle    Panel: button, console ─► Background::poll ─► LogLine ─► log
//!                                   Background::plan ─► streams of the tick
//! ```
//!
//! A board implements the kernel's `hal` traits and [`Panel`], states its [`BoardParameters`], calls
//! [`Control::tick`] in the interrupt of a timer and [`Background`] in its idle loop. `boards/README.md` has
//! the steps.
//!
//! Modules in the order the data travels:
//!
//! - [`parameters`]: the figures that differ from board to board;
//! - [`machine`]: the program in flash and its axes;
//! - [`runs`]: the runs that the start button begins, under live control;
//! - [`streamed`]: a program that comes over the link, under live control;
//! - [`linked`]: the background of a board that a PC drives over the link;
//! - [`stored`]: parameters that flash keeps;
//! - [`panel`]: the start button and the console's bytes;
//! - [`console`]: the commands of the console;
//! - [`operator`]: the effect of a press or a command in every phase;
//! - [`control`]: what tick and background share, and the tick;
//! - [`background`]: one poll after another;
//! - [`report`]: figures of the last second;
//! - [`log`]: the lines of the log;
//! - [`tick_timing`] and [`liveness`]: the tick's figures about itself and about the background.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
// No panic path in code that runs on a board; tests may panic.
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod parameters;
pub mod machine;
pub mod runs;
pub mod streamed;
pub mod linked;
mod homing;
pub mod stored;
pub mod panel;
pub mod console;
pub mod operator;
pub mod control;
pub mod background;
pub mod report;
pub mod log;
pub mod tick_timing;
pub mod liveness;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod scoped;

pub use background::Background;
pub use control::Control;
pub use linked::Linked;
pub use liveness::Liveness;
pub use log::{LogLine, Origin};
pub use machine::Machine;
pub use motion_kernel::hal::BoardOutputs;
pub use panel::Panel;
pub use parameters::BoardParameters;
pub use runs::Run;
pub use streamed::Streamed;
pub use tick_timing::TickTiming;
