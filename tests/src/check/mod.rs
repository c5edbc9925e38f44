//! Random programs and machines, and what is checked about their execution, shared by the tests.
//!
//! Nothing here uses the kernel's feed law, the toolpath's curves or the G-code reader's geometry: what
//! a program means is known from how it was generated, and motion is checked against itself.

pub mod bench;
pub mod bounds;
pub mod drive;
pub mod geometry;
pub mod live;
pub mod machine;
pub mod motion;
pub mod path;
pub mod program;
pub mod totals;

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, Plan, PlanningError, plan_program};

/// The plan of a program, in ramps that span blocks.
pub fn planned(text: &str, machine: &Machine) -> Result<Plan, PlanningError> {
    let program = gcode::read("test.ngc", text.as_bytes()).expect("G-code");
    plan_program("test.ngc", &program, machine, Mode::Spanning)
}
