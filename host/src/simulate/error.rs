//! Why a run could not be made.

use std::convert::Infallible;

use motion_kernel::axis::CorrectionError;
use motion_kernel::program::SupplyError;

use super::inject::InjectionError;
use crate::machine::AxisError;
use crate::planning::PlanningError;

/// Why a run could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The plan can't be executed.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The machine's parameters can't be used.
    #[error(transparent)]
    Machine(#[from] AxisError),
    /// The simulated machine can't be built.
    #[error("simulated machine: {0}")]
    Simulation(String),
    /// What is to break is not there.
    #[error(transparent)]
    Injection(#[from] InjectionError),
    /// The correction can't be used.
    #[error("correction: {0}")]
    Correction(#[from] CorrectionError),
    /// The kernel refused what the planner made.
    #[error("found motion that can't be executed: {0}")]
    Rejected(SupplyError<Infallible>),
}
