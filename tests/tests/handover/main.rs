//! The hand-over between background and tick, in the interleavings of up to three changes that docs/PROMISES.md lists.
//!
//! Mailbox and lists are the kernel's own files, compiled with words that a checker controls. The queue of a list and the
//! two that use all that are models of theirs (`ring`, `model`).
//!
//! - `one_core` runs whole ticks before any access of the background, in every distribution. This is the promise: the
//!   tick is an interrupt. A change can be taken back, and what is read of the tick's place belongs to one tick.
//! - `two_cores` runs the tick as a thread, with loom's weak memory. It shows which orderings matter. Nothing is taken back
//!   there but what was refused, and the tick's place is one word.
//!
//! In both, a list that takes over is complete, its items are done in their order, items are dropped only of a list that was
//! given up and all of those in the end, and the change that was asked for last is followed or refused.
//!
//! `scope_one_core` and `scope_two_cores` do the same with the ring through which ticks reach the link (`scope_model`).

#![allow(clippy::duplicate_mod, reason = "the same files with the words of each check")]
#![allow(dead_code, unreachable_pub, reason = "the kernel's files hold more than the checks use")]

mod interleavings;
mod interrupts;
mod one_core;
mod scope_one_core;
mod scope_two_cores;
mod two_cores;

/// What the kernel's files find at the crate's root.
mod law {
    pub(crate) use motion_kernel::internals::Phase;
    pub(crate) use motion_kernel::law::Ticks;
}
mod num {
    pub(crate) use motion_kernel::num::Real;
}
mod hal {
    pub(crate) use motion_kernel::hal::AxisInputs;
}
mod trace {
    pub(crate) use motion_kernel::trace::Trace;
}
mod units {
    pub(crate) use motion_kernel::units::DacCode;
}
