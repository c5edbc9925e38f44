//! The source of items, which may be late.

use core::task::Poll;

use super::Item;

/// Source of a program's items. A source that has none for now is asked again in the next poll of the
/// background. Every iterator is a source that is never late.
pub trait Source<const AXES: usize> {
    /// Why an item can't be had.
    type Error;

    /// Returns the next item, [`Poll::Pending`] if there is none for now, or `None` after the last one; then
    /// it is not asked again. Does not wait.
    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, Self::Error>>>;
}

impl<const AXES: usize, E, I: Iterator<Item = Result<Item<AXES>, E>>> Source<AXES> for I {
    type Error = E;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, E>>> {
        Poll::Ready(self.next())
    }
}
