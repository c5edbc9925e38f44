//! The tick as an interrupt: whole ticks before any access of the background, in every distribution over its accesses.

use std::cell::RefCell;
use std::rc::Rc;

/// Words before whose access a tick may come.
pub(crate) mod words {
    use std::cell::Cell;

    macro_rules! word {
        ($($name:ident: $of:ty),*) => {$(
            #[derive(Debug)]
            pub(crate) struct $name(Cell<$of>);

            impl $name {
                pub(crate) const fn new(value: $of) -> Self {
                    Self(Cell::new(value))
                }

                pub(crate) fn load(&self, _: Ordering) -> $of {
                    super::interrupt();
                    self.0.get()
                }

                pub(crate) fn store(&self, value: $of, _: Ordering) {
                    super::interrupt();
                    self.0.set(value);
                }
            }
        )*};
    }
    word!(AtomicBool: bool, AtomicU8: u8, AtomicU16: u16, AtomicU32: u32, AtomicUsize: usize);

    pub(crate) use std::sync::atomic::Ordering;
}

/// When ticks come in a run.
struct Interrupts {
    tick: Box<dyn FnMut()>,
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
        (interrupts.tick)();
    }
    interrupts.accesses += 1;
    INTERRUPTS.set(Some(interrupts));
}

/// The background does something with the tick locked out.
pub(crate) fn locked_out(does: impl FnOnce()) {
    let locked = INTERRUPTS.take();
    does();
    INTERRUPTS.set(locked);
}

/// A run of `background`, in which `tick` comes as `before` has it; the tick's state, and `before` with all accesses there were.
pub(crate) fn interrupted<T: 'static>(
    state: T,
    tick: fn(&mut T),
    before: Vec<u32>,
    background: impl FnOnce(),
) -> (T, Vec<u32>) {
    let state = Rc::new(RefCell::new(state));
    let of_tick = Rc::clone(&state);
    let tick = Box::new(move || tick(&mut of_tick.borrow_mut()));
    INTERRUPTS.set(Some(Interrupts { tick, before, accesses: 0 }));
    background();
    let Interrupts { tick, before, .. } = INTERRUPTS.take().expect("a run is under way");
    drop(tick);
    (Rc::into_inner(state).expect("its tick is gone").into_inner(), before)
}

/// Every distribution of up to `ticks` ticks: `run` is told when they come, and tells all accesses there were.
pub(crate) fn in_every_distribution(ticks: u32, mut run: impl FnMut(Vec<u32>) -> Vec<u32>) {
    let mut before = Some(Vec::new());
    while let Some(distribution) = before {
        before = next(run(distribution), ticks);
    }
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
