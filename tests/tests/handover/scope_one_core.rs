//! The scope's ring, with the tick as an interrupt: whole ticks before any access of the background.

#[path = "../../../kernel/src/scope/ring.rs"]
mod ring;
#[path = "scope_model.rs"]
mod model;
#[path = "scope_record.rs"]
mod record;

use std::cell::RefCell;

use model::{Background, PLACES, Tick};
use ring::Ring;

/// Words before whose access a tick may come.
mod words {
    use std::cell::Cell;

    pub(super) use std::sync::atomic::Ordering;

    macro_rules! word {
        ($($name:ident: $of:ty),*) => {$(
            #[derive(Debug)]
            pub(super) struct $name(Cell<$of>);

            impl $name {
                pub(super) const fn new(value: $of) -> Self {
                    Self(Cell::new(value))
                }

                pub(super) fn load(&self, _: Ordering) -> $of {
                    super::interrupt();
                    self.0.get()
                }

                pub(super) fn store(&self, value: $of, _: Ordering) {
                    super::interrupt();
                    self.0.set(value);
                }
            }
        )*};
    }
    word!(AtomicBool: bool, AtomicU8: u8, AtomicU16: u16, AtomicU32: u32, AtomicUsize: usize);
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
    /// None outside of a run, while a tick is under way, and while the background has locked it out.
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

/// Up to four ticks in every distribution over the accesses of a background that reads so often, and begins anew where one is
/// missing. How many distributions there are, and in how many of them one was missing.
fn check(reads: u32) -> (u32, u32) {
    let (mut runs, mut missing) = (0, 0);
    let mut before = Some(Vec::new());
    while let Some(distribution) = before {
        let ring = Box::leak(Box::new(Ring::<1, PLACES>::new()));
        let (enters, leaves) = ring.split();
        let mut background = Background { ticks: leaves, last: None, latest: 0 };
        let tick = Tick { ticks: enters, count: 0 };
        INTERRUPTS.set(Some(Interrupts { tick, before: distribution, accesses: 0 }));
        for _ in 0..reads {
            background.read();
            if background.ticks.is_missing() {
                missing += 1;
                // The tick is locked out.
                let locked = INTERRUPTS.take();
                background.begin_anew();
                INTERRUPTS.set(locked);
            }
        }
        let mut run = INTERRUPTS.take().expect("a run is under way");
        // Those that still wait; then the next one.
        (0..PLACES).for_each(|_| background.read());
        if background.ticks.is_missing() {
            background.begin_anew();
        }
        run.tick.tick();
        background.read();
        assert_eq!(background.latest, u32::from(run.tick.count), "the last tick is lost");
        runs += 1;
        before = next(run.before, 4);
    }
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
