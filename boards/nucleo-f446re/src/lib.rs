//! What of the board's firmware can be tested without the board.
//!
//! - [`design_parameters`]: every number of the firmware with its derivation;
//! - [`pins`]: which signal is on which pin;
//! - [`machine`]: the program in flash and the axes it is for;
//! - [`console`]: what is commanded over the serial port;
//! - [`operator`]: what is done about that and the button, in every phase;
//! - [`program`]: what the start button runs;
//! - [`tick_timing`] and [`liveness`]: what the tick keeps about itself.
//!
//! The firmware itself is `main.rs` and the modules beside it. From the board's folder:
//!
//! ```console
//! cargo test --lib --target x86_64-unknown-linux-gnu
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
// No panic path in what runs on a board; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod design_parameters;
pub mod pins;
pub mod machine;
pub mod console;
pub mod operator;
pub mod program;
pub mod tick_timing;
pub mod liveness;
