//! The scope's ring, with the tick as a thread on another core: what is written is seen late and in any order that the
//! orderings allow.

#[path = "../../../kernel/src/scope/ring.rs"]
mod ring;
#[path = "scope_model.rs"]
mod model;
#[path = "scope_record.rs"]
mod record;

use model::{Background, PLACES, Tick};
use ring::Ring;

/// Loom's words.
mod words {
    use std::sync::{Mutex, OnceLock};

    pub(super) use loom::sync::atomic::Ordering;
    use loom::thread::{ThreadId, current};

    /// Loom can't make words in a constant: this one is made where it is first touched, before the threads begin. What its
    /// writer reads is what it wrote last, and loom does not hear of it: `handover` of `two_cores` says why.
    macro_rules! word {
        ($($name:ident: $of:ty),*) => {$(
            #[derive(Debug)]
            pub(super) struct $name {
                initial: $of,
                word: OnceLock<loom::sync::atomic::$name>,
                written: Mutex<Option<(ThreadId, $of)>>,
            }

            impl $name {
                pub(super) const fn new(initial: $of) -> Self {
                    Self { initial, word: OnceLock::new(), written: Mutex::new(None) }
                }

                fn word(&self) -> &loom::sync::atomic::$name {
                    self.word.get_or_init(|| loom::sync::atomic::$name::new(self.initial))
                }

                pub(super) fn load(&self, ordering: Ordering) -> $of {
                    let written = *self.written.lock().expect("no panic before");
                    match written {
                        Some((writer, value)) if writer == current().id() => value,
                        _ => self.word().load(ordering),
                    }
                }

                pub(super) fn store(&self, value: $of, ordering: Ordering) {
                    *self.written.lock().expect("no panic before") = Some((current().id(), value));
                    self.word().store(value, ordering);
                }
            }
        )*};
    }
    word!(AtomicBool: bool, AtomicU8: u8, AtomicU16: u16, AtomicU32: u32, AtomicUsize: usize);
}

/// So many ticks and reads at the same time, with so many preemptions at most; without a bound in every interleaving.
fn check(ticks: u32, reads: u32, preemptions: Option<usize>) {
    let mut builder = loom::model::Builder::new();
    builder.max_branches = 10_000;
    builder.preemption_bound = preemptions;
    builder.check(move || {
        let ring = Box::leak(Box::new(Ring::<1, PLACES>::new()));
        let (enters, leaves) = ring.split();
        let mut background = Background { ticks: leaves, last: None, latest: 0 };
        let mut tick = Tick { ticks: enters, count: 0 };
        // Every word is touched before the threads begin.
        for _ in 0..PLACES {
            tick.tick();
            background.read();
        }
        let ticking = loom::thread::spawn(move || {
            (0..ticks).for_each(|_| tick.tick());
        });
        for _ in 0..reads {
            // Nothing is read any more once one is missing: what begins anew has locked the tick out.
            background.read();
        }
        ticking.join().expect("the ticks end");
    });
}

#[test]
fn two_ticks_while_two_are_read() {
    check(2, 2, None);
}

#[test]
fn four_ticks_while_three_are_read() {
    check(4, 3, Some(3));
}
