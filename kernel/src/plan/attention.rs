//! Whether something more urgent waits than the plan that is being made.
//!
//! Long plans ask between their steps and are given up where it does. A step is a ramp and what it passes, the feeds of one
//! block, what becomes of one ceiling, or an item of a list.

use core::cell::Cell;

/// Asked between the steps of a plan. Once the answer was yes it stays, so that all callers see the same.
pub struct Attention<'a> {
    is_wanted: &'a dyn Fn() -> bool,
    was_wanted: Cell<bool>,
}

impl<'a> Attention<'a> {
    /// `is_wanted` says whether something more urgent waits. It is called often, so it should only look.
    #[must_use]
    pub fn new(is_wanted: &'a dyn Fn() -> bool) -> Self {
        Self { is_wanted, was_wanted: Cell::new(false) }
    }

    /// Nothing is more urgent.
    #[must_use]
    pub fn undivided() -> Self {
        Self::new(&|| false)
    }

    /// Whether the work under way is to be given up.
    #[must_use]
    pub fn is_wanted(&self) -> bool {
        if !self.was_wanted.get() {
            self.was_wanted.set((self.is_wanted)());
        }
        self.was_wanted.get()
    }
}

impl core::fmt::Debug for Attention<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Attention").field("was_wanted", &self.was_wanted).finish_non_exhaustive()
    }
}
