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

use std::cell::RefCell;

use mailbox::Mailbox;
use model::{Background, Tick};

/// Words before whose access a tick may come.
mod handover {
    use std::cell::Cell;

    pub(super) use super::ring::Consumer;
    pub(super) use std::sync::atomic::Ordering;

    #[derive(Debug)]
    pub(super) struct AtomicU32(Cell<u32>);

    impl AtomicU32 {
        pub(super) const fn new(value: u32) -> Self {
            Self(Cell::new(value))
        }

        pub(super) fn load(&self, _: Ordering) -> u32 {
            super::interrupt();
            self.0.get()
        }

        pub(super) fn store(&self, value: u32, _: Ordering) {
            super::interrupt();
            self.0.set(value);
        }
    }

    /// A tick is whole: memory is never read and written at a time.
    #[derive(Default)]
    pub(super) struct Memory(());

    #[allow(clippy::unused_self, reason = "as the memory of two cores")]
    impl Memory {
        pub(super) fn read(&self) {}

        pub(super) fn write(&self) {}
    }
}

/// When ticks come in a run.
struct Interrupts {
    tick: Tick<'static>,
    /// How many come before each access of the background.
    before: Vec<u32>,
    /// Accesses so far.
    accesses: usize,
}

thread_local! {
    /// None outside of a run, and while a tick is under way.
    static INTERRUPTS: RefCell<Option<Interrupts>> = const { RefCell::new(None) };
}

/// An access of the background is next.
fn interrupt() {
    let Some(mut interrupts) = INTERRUPTS.take() else { return };
    if interrupts.accesses == interrupts.before.len() {
        interrupts.before.push(0);
    }
    let ticks = interrupts.before[interrupts.accesses];
    for _ in 0..ticks {
        interrupts.tick.tick();
    }
    interrupts.accesses += 1;
    INTERRUPTS.set(Some(interrupts));
}

/// The next distribution of `ticks`: one more before the last access that can have it, none after.
fn next(mut before: Vec<u32>, ticks: u32) -> Option<Vec<u32>> {
    let mut so_far: u32 = before.iter().sum();
    while let Some(last) = before.pop() {
        if so_far < ticks {
            before.push(last + 1);
            return Some(before);
        }
        so_far -= last;
    }
    None
}

/// Up to `ticks` ticks in every distribution over the accesses of `polls`.
fn check(ticks: u32, polls: impl Fn(&mut Background<'_>)) {
    let mailbox: &'static Mailbox = Box::leak(Box::new(Mailbox::new()));
    let mut before = Some(Vec::new());
    while let Some(distribution) = before {
        mailbox.reset();
        let rings = model::rings();
        let tick = Tick::new(mailbox, &rings, true);
        let mut background = Background { mailbox, rings: &rings, current: 0, next: None };
        INTERRUPTS.set(Some(Interrupts { tick, before: distribution, accesses: 0 }));
        polls(&mut background);
        let run = INTERRUPTS.take().expect("a run is under way");
        model::finish(run.tick, mailbox, &rings);
        before = next(run.before, ticks);
    }
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
