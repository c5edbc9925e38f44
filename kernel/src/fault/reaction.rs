//! How faults end: the reactions, and what a machine's file says of them. Data only.

use serde::{Deserialize, Serialize};

/// How a fault ends. The greater one is the more urgent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reaction {
    /// A stop on the path, regulated, then drives off. Where nothing can hold the motion, or it does not come to rest in
    /// time, the outputs are ramped.
    Stop,
    /// Outputs to 0 V over some time, then drives off. Nothing is regulated.
    Ramp,
    /// Outputs at 0 V and drives off in the same tick. So ends every fault before the drives have been told to be on.
    Immediate,
}

/// What a machine says of its reactions; without the feature `guards` they all are immediate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reactions {
    /// Ticks in which the outputs go to 0 V; 0 makes every reaction an immediate one.
    pub ramp_ticks: u16,
    /// Ticks after which a stop on the path is given up.
    pub stop_ticks: u32,
    /// The emergency stop's.
    pub emergency_stop: Reaction,
}

impl Reactions {
    /// Every reaction is an immediate one.
    pub const IMMEDIATE: Self = Self { ramp_ticks: 0, stop_ticks: 0, emergency_stop: Reaction::Immediate };
}
