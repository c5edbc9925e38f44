//! The tick as a thread on another core: what is written is seen late and in any order that the orderings allow.

#[path = "../../../kernel/src/queue/change.rs"]
mod change;
#[path = "../../../kernel/src/queue/counter.rs"]
mod counter;
#[path = "../../../kernel/src/queue/lists.rs"]
mod lists;
#[path = "../../../kernel/src/queue/mailbox.rs"]
mod mailbox;
mod item {
    pub(super) use motion_kernel::internals::FeedItem;
}
/// Here the place is one word: that several belong to one tick is a promise for one core.
mod progress {
    use super::change::{ListPlace, Progress};
    use super::handover::{AtomicU32, Ordering};
    use crate::law::{Phase, Ticks};

    #[derive(Debug)]
    pub(super) struct ProgressWords(AtomicU32);

    impl ProgressWords {
        pub(super) const fn new() -> Self {
            Self(AtomicU32::new(0))
        }

        pub(super) fn reset(&self) {
            self.0.store(0, Ordering::Relaxed);
        }

        pub(super) fn progress(&self) -> Progress {
            let place = ListPlace(self.0.load(Ordering::Relaxed));
            Progress { tick: 0, list: place.list(), done: place.done(), inside: None, waits: false }
        }

        pub(super) fn publish(&self, place: ListPlace, _: Option<(Phase, Ticks)>, _: bool) {
            if self.0.load(Ordering::Relaxed) != place.0 {
                self.0.store(place.0, Ordering::Relaxed);
            }
        }
    }
}
#[path = "model.rs"]
mod model;
#[path = "ring.rs"]
mod ring;

use mailbox::Mailbox;
use model::{Background, Tick};

use crate::interleavings::in_interleavings;

/// Loom's words and memory.
mod handover {
    pub(super) use super::ring::Consumer;
    pub(super) use crate::interleavings::words::{AtomicU32, Ordering};

    /// Memory that must not be read and written at a time.
    #[derive(Default)]
    pub(super) struct Memory(loom::cell::UnsafeCell<()>);

    impl Memory {
        pub(super) fn read(&self) {
            self.0.with(|_| ());
        }

        pub(super) fn write(&self) {
            self.0.with_mut(|_| ());
        }
    }
}

loom::lazy_static! {
    static ref MAILBOX: Mailbox = Mailbox::new();
}

/// So many changes and ticks at the same time, with so many preemptions at most; without a bound in every interleaving.
fn check(changes: u32, ticks: u32, preemptions: Option<usize>) {
    in_interleavings(preemptions, move || {
        let mailbox: &'static Mailbox = &MAILBOX;
        let rings = model::rings();
        let mut background = Background { mailbox, rings: &rings, current: 0, next: None };
        background.start();
        let mut tick = Tick::new(mailbox, &rings, false);
        let ticking = loom::thread::spawn(move || {
            for _ in 0..ticks {
                tick.tick();
            }
            tick
        });
        for number in 1..=changes {
            background.ask(number);
        }
        model::finish(ticking.join().expect("the ticks end"), mailbox, &rings);
    });
}

#[test]
fn a_change_during_two_ticks() {
    check(1, 2, None);
}

#[test]
fn three_changes_during_a_tick() {
    check(3, 1, None);
}

#[test]
fn two_changes_during_two_ticks() {
    check(2, 2, Some(4));
}

#[test]
fn three_changes_during_three_ticks() {
    check(3, 3, Some(3));
}
