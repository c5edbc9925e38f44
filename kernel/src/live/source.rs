//! Where items come from, perhaps later.

use core::task::Poll;

use crate::program::Item;

/// What the items of a program are read from. A sender that is late says so, and is asked again in the next poll of the
/// background; every iterator is a source whose items are all there.
pub trait Source<const AXES: usize> {
    /// Why an item can't be had.
    type Error;

    /// The next item: [`Poll::Pending`] where there is none for now, `None` behind the last one, after which it is not
    /// asked any more. Does not wait.
    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, Self::Error>>>;
}

impl<const AXES: usize, E, I: Iterator<Item = Result<Item<AXES>, E>>> Source<AXES> for I {
    type Error = E;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, E>>> {
        Poll::Ready(self.next())
    }
}
