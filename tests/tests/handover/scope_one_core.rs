//! The scope's ring, with the tick as an interrupt: whole ticks before any access of the background.

#[path = "../../../kernel/src/scope/ring.rs"]
mod ring;
#[path = "scope_model.rs"]
mod model;
#[path = "../../../kernel/src/scope/tick_record.rs"]
mod tick_record;

use model::{Background, PLACES, Tick};
use ring::Ring;

use crate::interrupts::{in_every_distribution, interrupted, locked_out, words};

/// Up to four ticks in every distribution over the accesses of a background that reads so often, and begins anew where one is
/// missing. How many distributions there are, and in how many of them one was missing.
fn check(reads: u32) -> (u32, u32) {
    let (mut runs, mut missing) = (0, 0);
    in_every_distribution(4, |before| {
        let ring = Box::leak(Box::new(Ring::<1, PLACES>::new()));
        let (enters, leaves) = ring.split();
        let mut background = Background { ticks: leaves, last: None, latest: 0 };
        let tick = Tick { ticks: enters, count: 0 };
        let (mut tick, before) = interrupted(tick, Tick::tick, before, || {
            for _ in 0..reads {
                background.read();
                if background.ticks.is_missing() {
                    missing += 1;
                    locked_out(|| background.begin_anew());
                }
            }
        });
        // Those that still wait; then the next one.
        (0..PLACES).for_each(|_| background.read());
        if background.ticks.is_missing() {
            background.begin_anew();
        }
        tick.tick();
        background.read();
        assert_eq!(background.latest, u32::from(tick.count), "the last tick is lost");
        runs += 1;
        before
    });
    (runs, missing)
}

#[test]
fn ticks_that_reach_the_link_are_whole_and_follow_each_other_or_are_told_to_be_missing() {
    for reads in 1..=3 {
        let (runs, missing) = check(reads);
        println!("{reads} reads: {runs} distributions, missing in {missing}");
        assert!(runs > 100 && missing > 0);
    }
}
