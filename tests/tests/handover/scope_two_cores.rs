//! The scope's ring, with the tick as a thread on another core: what is written is seen late and in any order that the
//! orderings allow.

#[path = "../../../kernel/src/scope/ring.rs"]
mod ring;
#[path = "scope_model.rs"]
mod model;
#[path = "../../../kernel/src/scope/tick_record.rs"]
mod tick_record;

use model::{Background, PLACES, Tick};
use ring::Ring;

use crate::interleavings::{in_interleavings, words};

/// So many ticks and reads at the same time, with so many preemptions at most; without a bound in every interleaving.
fn check(ticks: u32, reads: u32, preemptions: Option<usize>) {
    in_interleavings(preemptions, move || {
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
