//! [`Lists`] of a kernel without live control: there are none, and they take no memory.

use core::marker::PhantomData;

use heapless::spsc::Consumer;

use super::item::FeedItem;
use crate::law::{Phase, Ticks};
use crate::num::Real;

/// No lists.
pub(super) struct Lists<'a, R: Real>(PhantomData<&'a R>);

#[allow(clippy::unused_self, reason = "as the lists of live control")]
impl<R: Real> Lists<'_, R> {
    /// No lists: feed is one stream.
    pub(super) const NONE: Self = Self(PhantomData);

    #[inline]
    pub(super) fn is_live(&self) -> bool {
        false
    }

    pub(super) fn want_stop(&self) -> bool {
        false
    }

    #[inline]
    pub(super) fn poll(&mut self) {}

    #[inline]
    pub(super) fn item_done(&mut self, _: &mut Consumer<'_, FeedItem<R>>) {}

    #[inline]
    pub(super) fn is_change_due(&self) -> bool {
        false
    }

    pub(super) fn feed_after_change(&self) -> Option<&FeedItem<R>> {
        None
    }

    pub(super) fn takes_over_between_items(&self) -> bool {
        false
    }

    pub(super) fn take_over(&mut self, _: &mut Consumer<'_, FeedItem<R>>) {}

    pub(super) fn refuse(&mut self) {}

    #[inline]
    pub(super) fn publish(&self, _: Option<(Phase, Ticks)>, _: bool) {}
}
