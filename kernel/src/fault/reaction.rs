//! The reactions to faults, and a machine's choice of them. Data only.

use serde::{Deserialize, Serialize};

/// How a fault ends. The greater reaction is the more urgent one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reaction {
    /// A stop on the path, regulated, then drives off. If nothing can stop the motion, or it does not come to
    /// rest in time, the outputs are ramped.
    Stop,
    /// Outputs to 0 V over some time, then drives off. Nothing is regulated.
    Ramp,
    /// Outputs at 0 V and drives off in the same tick. Every fault ends so before the drives have been told
    /// to be on.
    Immediate,
}

/// A machine's reactions; without the feature `guards` they are all immediate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reactions {
    /// Ticks in which the outputs go to 0 V; 0 makes every reaction immediate.
    pub ramp_ticks: u16,
    /// Ticks after which a stop on the path is given up.
    pub stop_ticks: u32,
    /// The reaction to the emergency stop.
    pub emergency_stop: Reaction,
}

impl Reactions {
    /// Every reaction is immediate.
    pub(crate) const IMMEDIATE: Self =
        Self { ramp_ticks: 0, stop_ticks: 0, emergency_stop: Reaction::Immediate };
}
