//! Real-time motion for boards that drive ±10 V velocity servos.
#![cfg_attr(not(test), no_std)]

pub mod axis;
pub mod exec;
pub mod hal;
pub mod kernel;
pub mod law;
pub mod num;
pub mod path;
pub mod plan;
pub mod queue;
pub mod trace;
pub mod units;
