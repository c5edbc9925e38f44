//! Real-time motion for boards that drive ±10 V velocity servos.
#![cfg_attr(not(test), no_std)]

pub mod hal;
pub mod num;
pub mod units;
