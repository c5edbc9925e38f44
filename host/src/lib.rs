//! The PC side of the motion kernel.

pub mod record;
