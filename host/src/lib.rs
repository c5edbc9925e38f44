//! The PC side of the motion kernel.

pub mod gcode;
pub mod machine;
pub mod planning;
pub mod record;
pub mod report;
pub mod simulate;
pub mod toolpath;
