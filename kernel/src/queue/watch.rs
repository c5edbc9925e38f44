//! Who watches the background's accesses to what it shares with the tick: tests that let ticks come between them, or that
//! repeat on a PC what an interrupt did on a board.

/// A side of an access of the background to what it shares with the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It is about to be made.
    Begins,
    /// It has been made.
    Ends,
}

/// Called at both sides of every access, if there is one.
pub(super) type Watcher<'a> = Option<&'a dyn Fn(Access)>;

/// An access under way.
pub(super) struct Watched<'a>(Watcher<'a>);

impl<'a> Watched<'a> {
    pub(super) fn begin(watcher: Watcher<'a>) -> Self {
        if let Some(watcher) = watcher {
            watcher(Access::Begins);
        }
        Self(watcher)
    }
}

impl Drop for Watched<'_> {
    fn drop(&mut self) {
        if let Some(watcher) = self.0 {
            watcher(Access::Ends);
        }
    }
}
