//! The parts of the board's firmware that can be tested without the board.
//!
//! - [`design_parameters`]: every number of the firmware with its derivation;
//! - [`pins`]: which signal is on which pin;
//! - [`receive_ring`]: where bytes that the DMA brings are read;
//! - [`machine`]: the number of axes, the program in flash, and the sizes that follow.
//!
//! The firmware itself is `main.rs` and its modules; the part shared with other boards is the crate
//! `motion_board`. From the board's folder:
//!
//! ```console
//! cargo test --lib --target x86_64-unknown-linux-gnu
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
// No panic path in code that runs on a board; tests may panic.
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod design_parameters;
pub mod pins;
pub mod receive_ring;
pub mod machine;
