//! The tick as an interrupt: whole ticks before any access of the background.

#[path = "../../../kernel/src/queue/change.rs"]
mod change;
#[path = "../../../kernel/src/queue/counter.rs"]
mod counter;
#[path = "../../../kernel/src/queue/lists.rs"]
mod lists;
#[path = "../../../kernel/src/queue/mailbox.rs"]
mod mailbox;
#[path = "../../../kernel/src/queue/progress.rs"]
mod progress;
mod item {
    pub(super) use motion_kernel::internals::FeedItem;
}
#[path = "model.rs"]
mod model;
#[path = "ring.rs"]
mod ring;

use mailbox::Mailbox;
use model::{Background, Tick};

use crate::interrupts::{in_every_distribution, interrupted};

/// Words before whose access a tick may come.
mod handover {
    pub(super) use super::ring::Consumer;
    pub(super) use crate::interrupts::words::{AtomicU32, Ordering};

    /// A tick is whole: memory is never read and written at a time.
    #[derive(Default)]
    pub(super) struct Memory(());

    #[allow(clippy::unused_self, reason = "as the memory of two cores")]
    impl Memory {
        pub(super) fn read(&self) {}

        pub(super) fn write(&self) {}
    }
}

/// Up to `ticks` ticks in every distribution over the accesses of `polls`.
fn check(ticks: u32, polls: impl Fn(&mut Background<'_>)) {
    let mailbox: &'static Mailbox = Box::leak(Box::new(Mailbox::new()));
    in_every_distribution(ticks, |before| {
        mailbox.reset();
        let rings = model::rings();
        let tick = Tick::new(mailbox, &rings, true);
        let mut background = Background { mailbox, rings: &rings, current: 0, next: None };
        let (tick, before) = interrupted(tick, Tick::tick, before, || polls(&mut background));
        model::finish(tick, mailbox, &rings);
        before
    });
}

#[test]
fn a_place_is_that_of_one_tick_if_up_to_four_come_while_it_is_read() {
    check(4, |background| background.read_progress());
}

#[test]
fn three_changes_are_followed_or_refused() {
    check(4, |background| (1..=3).for_each(|number| background.ask(number)));
}

#[test]
fn a_change_that_was_taken_back_is_not_followed() {
    check(3, |background| {
        for number in 1..=3 {
            background.ask(number);
            background.take_back();
        }
    });
}
