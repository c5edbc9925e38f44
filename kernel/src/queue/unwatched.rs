//! Nobody watches the background's accesses to what it shares with the tick.

/// An access under way.
pub(super) struct Watched;
