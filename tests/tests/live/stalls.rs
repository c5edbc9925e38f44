//! A producer that is late: its polls, and its items.

use core::task::Poll;
use std::cell::{Cell, RefCell};
use std::convert::Infallible;

use motion_host::planning::Executable;
use motion_kernel::exec::ExecState;
use motion_kernel::live::Source;
use motion_kernel::num::Fixed;
use motion_kernel::program::Item;

use super::{Case, Runs, seeds};
use motion_tests::check::bounds::Number;
use motion_tests::check::live::{Command, Run, execute_from};
use motion_tests::random::Random;

/// A background that is late at random: every stall that outlasts what is queued ends in a stop on the path, and motion
/// continues after it; nothing is lost, nothing repeated.
#[test]
fn a_late_background_is_waited_for_at_rest() {
    let (mut runs, mut stalls) = (Runs::default(), 0_u64);
    for seed in seeds(450) {
        let Some(case) = Case::random(seed, 6_000.0) else { continue };
        let mut random = Random::new(seed ^ 0x57A11);
        let often = random.log(1e-3, 0.3);
        let mut left = 0;
        let mut script = || {
            if left == 0 && random.chance(often) {
                left = random.log(1.0, 3000.0) as u64;
                stalls += 1;
            }
            left = u64::saturating_sub(left, 1);
            (left > 0).then_some(Command::Stall)
        };
        let run = match seed % 3 {
            0 => case.run::<f32>(seed, &mut |_| script()),
            1 => case.run::<f64>(seed, &mut |_| script()),
            _ => case.run::<Fixed>(seed, &mut |_| script()),
        };
        runs.add(seed, run);
    }
    println!("{stalls} stalls");
    runs.print_and_assert();
    assert!(runs.ran > 80 && stalls > 1000 && runs.starvations > 30, "{} {stalls}", runs.ran);
}

/// Stalls of a producer, as the ticks see them.
pub(super) struct Stalls {
    /// Ticks until items come again; [`Stalls::UNTIL_REST`] for as long as motion lasts, and some.
    left: Cell<u64>,
    count: Cell<u64>,
    /// Ended at rest.
    at_rest: Cell<u64>,
    often: f64,
    random: RefCell<Random>,
}

impl Stalls {
    const UNTIL_REST: u64 = u64::MAX;

    pub(super) fn new(seed: u64, often: Option<(f64, f64)>) -> Self {
        let mut random = Random::new(seed ^ 0x17E45);
        let often = often.map_or(0.0, |(least, most)| random.log(least, most));
        let zero = Cell::new(0);
        Self { left: zero.clone(), count: zero.clone(), at_rest: zero, often, random: random.into() }
    }

    /// Before the next item: whether there is one.
    fn has_item(&self) -> bool {
        if self.left.get() > 0 {
            return false;
        }
        let mut random = self.random.borrow_mut();
        if random.chance(self.often) {
            let is_long = random.chance(0.5);
            let ticks = random.log(1.0, 300.0) as u64;
            self.left.set(if is_long { Self::UNTIL_REST } else { ticks });
            self.count.set(self.count.get() + 1);
        }
        self.left.get() == 0
    }

    pub(super) fn tick(&self, state: ExecState) {
        let left = self.left.get();
        let is_at_rest = matches!(state, ExecState::Idle | ExecState::Held);
        if left == Self::UNTIL_REST {
            if is_at_rest {
                self.left.set(self.random.borrow_mut().log(1.0, 30.0) as u64);
                self.at_rest.set(self.at_rest.get() + 1);
            }
        } else {
            self.left.set(left.saturating_sub(1));
        }
    }
}

/// Items that come late.
pub(super) struct Late<'a, I> {
    pub(super) items: I,
    pub(super) stalls: &'a Stalls,
}

impl<I: Iterator<Item = Result<Item<3>, Infallible>>> Source<3> for Late<'_, I> {
    type Error = Infallible;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<3>, Infallible>>> {
        if self.stalls.has_item() { Poll::Ready(self.items.next()) } else { Poll::Pending }
    }
}

fn with_stalls<R: Number>(case: &Case, seed: u64, stalls: &Stalls) -> Result<Run, String> {
    let executable = Executable::new::<R>(&case.plan).map_err(|error| error.to_string())?;
    let source = Late { items: executable.supplied(), stalls };
    execute_from::<R, _>(&case.setup(seed), source, &mut |seen| {
        stalls.tick(seen.executed.state);
        None
    })
}

/// Items, from pieces of a micrometre to moves of a metre, that come late at random, half of them not before motion has
/// come to rest: each stall ends in a legal stop on the path or before motion had to brake, and motion continues smoothly;
/// nothing is lost, nothing repeated. The long form is `MOTION_TEST_PROGRAMS=9000`: more than 10⁵ stalls.
#[test]
fn late_items_are_waited_for_on_the_path() {
    let (mut runs, mut count, mut at_rest) = (Runs::default(), 0, 0);
    let (mut shortest_mm, mut longest_mm) = (f64::INFINITY, 0.0_f64);
    for seed in seeds(150) {
        let Some(case) = Case::random(seed, 6_000.0) else { continue };
        for placed in case.path.stretches.iter().flat_map(|stretch| &stretch.moves) {
            shortest_mm = shortest_mm.min(placed.element.length_mm);
            longest_mm = longest_mm.max(placed.element.length_mm);
        }
        let stalls = Stalls::new(seed, Some((1e-2, 0.7)));
        let run = match seed % 3 {
            0 => with_stalls::<f32>(&case, seed, &stalls),
            1 => with_stalls::<f64>(&case, seed, &stalls),
            _ => with_stalls::<Fixed>(&case, seed, &stalls),
        };
        count += stalls.count.get();
        at_rest += stalls.at_rest.get();
        runs.add(seed, run);
    }
    println!("{count} stalls, {at_rest} of them until rest; moves of {shortest_mm:e} to {longest_mm:e} mm");
    runs.print_and_assert();
    assert!(runs.ran > 40 && at_rest > 500 && runs.rests > 300, "{} {at_rest} {}", runs.ran, runs.rests);
    assert!(shortest_mm < 2e-3 && longest_mm > 100.0, "{shortest_mm} to {longest_mm}");
}
