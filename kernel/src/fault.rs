//! What can go wrong on the machine: typed, with its tick and its figures.
//!
//! Rejections of bad input are another matter: [`crate::queue::Rejection`].

use crate::exec::ExecFault;

/// What went wrong, where and when.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Fault<R> {
    /// The tick in which it was found.
    pub tick: u64,
    /// What.
    pub kind: FaultKind<R>,
}

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultKind<R> {
    /// The executor could not go on.
    Executor(ExecFault),
    /// The following error of an axis is beyond its limit.
    FollowingError {
        /// The axis, from 0.
        axis: usize,
        /// Set-point − actual \[mm\].
        error_mm: R,
    },
    /// The encoders could not be read.
    Encoder,
    /// The digital inputs could not be read.
    Inputs,
    /// The converter could not be written.
    Output,
    /// The drives could not be enabled or disabled.
    Enable,
    /// The emergency stop is open.
    EmergencyStop,
    /// A drive reports a fault.
    Drive {
        /// The axis, from 0.
        axis: usize,
    },
}
