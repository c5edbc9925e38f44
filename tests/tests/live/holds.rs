//! Held before every tick, and let go again: each time legal, at rest soon, at the same end.
//!
//! The long form, `MOTION_TEST_EVERY=1 MOTION_TEST_PROGRAMS=200`, takes every tick of the stringer in every number type
//! and of 200 random programs.

use motion_host::machine::Machine;
use motion_kernel::live::State;
use motion_kernel::num::Fixed;

use super::{Case, Runs, planned};
use motion_tests::check::bounds::Number;
use motion_tests::check::geometry::{Arc, Move, UNITS_PER_MM};
use motion_tests::check::live::Command;
use motion_tests::check::program::{self, Asked, Generated};
use motion_tests::from_env;
use motion_tests::random::Random;

/// What the holds of a program came to.
#[derive(Default)]
struct Held {
    holds: u64,
    /// Ticks from the command to rest.
    longest_stop: u64,
    /// Ticks that a held run takes more than one without a hold.
    slowest: u64,
    runs: Runs,
}

impl Held {
    /// Held before every `every`th tick from `first` on.
    fn before_ticks<R: Number>(&mut self, case: &Case, seed: u64, first: u64, every: u64) {
        let free = match case.run::<R>(seed, &mut |_| None) {
            Ok(run) => run,
            Err(error) => return self.runs.add(seed, Err(error)),
        };
        for at in (first..free.ticks).step_by(every as usize) {
            let mut held_at = None;
            let run = case.run::<R>(seed, &mut |seen| {
                if seen.ticks == at {
                    return Some(Command::Hold);
                }
                if seen.state == State::Held && held_at.is_none() {
                    held_at = Some(seen.ticks);
                    return Some(Command::Resume);
                }
                None
            });
            self.holds += 1;
            let run = run.and_then(|run| match held_at {
                Some(held) if run.state == State::Done => {
                    self.longest_stop = self.longest_stop.max(held - at);
                    self.slowest = self.slowest.max(run.ticks.saturating_sub(free.ticks));
                    Ok(run)
                }
                held => Err(format!("held {held:?}, {:?}", run.state)),
            });
            self.runs.add(seed, run.map_err(|error| format!("held before tick {at}: {error}")));
        }
    }

    fn print_and_assert(&self, name: &str) {
        println!(
            "{name}: {} holds; the longest stop took {} ticks, the slowest run {} more",
            self.holds, self.longest_stop, self.slowest
        );
        self.runs.print_and_assert();
    }
}

/// A program that has all that a ramp can be in.
#[test]
fn held_before_every_tick_of_a_corner() {
    let mm = |mm: f64| (mm * UNITS_PER_MM).round() as i64;
    // A corner of a millimetre at less than the feed before and after it.
    let points = [[12.0, 0.0], [12.9, 0.02], [14.0, 0.05], [30.0, 0.5]].map(|[x, y]| [mm(x), mm(y), 0]);
    let program = program::lines(&points, 2400.0);
    let case = Case::of(&program, Machine::reference(), 10_000.0).expect("a short program");
    let every = 3 * from_env("MOTION_TEST_EVERY").unwrap_or(7);
    let mut held = Held::default();
    held.before_ticks::<f32>(&case, 0, 0, every);
    held.before_ticks::<f64>(&case, 0, every / 3, every);
    held.before_ticks::<Fixed>(&case, 0, 2 * every / 3, every);
    held.print_and_assert("corner");
    // From 40 mm/s: a ramp given up at its half, 3 t1/2, and a ramp to rest; as much again to start.
    assert!(held.longest_stop < 900, "{}", held.longest_stop);
}

/// At its feed a blend leaves next to nothing of the jerk: 40 mm/s³ here, with which a stop takes 2.4 s.
#[test]
fn a_blend_does_not_hold_up_a_stop() {
    let machine = Machine::reference();
    let text = "G64 P0.05\nF4800\nG1 X40\nG1 X60 Y3\nG1 X100 Y3\nM2\n";
    let plan = planned(text, &machine, 10_000.0).expect("a plan");
    assert_eq!(plan.blocks.iter().filter(|block| block.kind == "blend").count(), 2);
    let case = Case::compiled::<f64>(plan, machine).expect("a path");
    let mut held = Held::default();
    held.before_ticks::<f64>(&case, 0, 0, from_env("MOTION_TEST_EVERY").unwrap_or(31));
    held.print_and_assert("blends");
    // From 80 mm/s: 0.26 s at the least, 2.2 times that and two of S1's rises.
    assert!(held.longest_stop < 1544, "{}", held.longest_stop);
}

/// The published test part, as its text says.
fn stringer() -> Generated {
    let units = |mm: f64| (mm * UNITS_PER_MM).round() as i64;
    let mut asked = Vec::new();
    let mut from = [0; 3];
    let moves = [
        ([50.0, 0.0], None),
        ([53.863_703_305, 2.964_723_820], Some(([0.0, 4.0], false))),
        ([73.182_219_831, 2.964_723_820], Some(([9.659_258_263, -2.588_190_451], true))),
        ([77.045_923_136, 0.0], Some(([3.863_703_305, 1.035_276_180], false))),
        ([102.045_923_136, 0.0], None),
    ];
    for ([x, y], arc) in moves {
        let to = [units(x), units(y), 0];
        let arc = arc.map(|(offset, is_clockwise): ([f64; 2], bool)| Arc {
            axes: [0, 1, 2],
            offset: offset.map(units),
            is_clockwise,
        });
        asked.push(Asked::Move(Move { from, to, arc, feed_mm_min: 5000.0 }));
        from = to;
    }
    Generated { text: include_str!("../../../host/src/cli/stringer.ngc").to_owned(), asked }
}

#[test]
fn held_before_every_tick_of_the_stringer() {
    let case = Case::of(&stringer(), Machine::reference(), 10_000.0).expect("a plan");
    let every = from_env("MOTION_TEST_EVERY").unwrap_or(101);
    let mut held = Held::default();
    held.before_ticks::<f32>(&case, 0, 0, every);
    held.before_ticks::<f64>(&case, 0, every / 3, every);
    held.before_ticks::<Fixed>(&case, 0, 2 * every / 3, every);
    held.print_and_assert("stringer");
    // What brakes is finished or what accelerates given up, and then comes a ramp to rest, on the arcs with what their
    // ceilings leave of the limits.
    let longest = case.setup(0).response_ticks;
    assert!(held.longest_stop <= longest, "{}, expected {longest} at most", held.longest_stop);
}

#[test]
fn held_before_every_tick_of_random_programs() {
    let programs = from_env("MOTION_TEST_PROGRAMS").unwrap_or(20);
    let first = from_env("MOTION_TEST_SEED").unwrap_or(1);
    let (mut held, mut found) = (Held::default(), 0);
    for seed in first.. {
        if found == programs {
            break;
        }
        let Some(case) = Case::random(seed, 3_000.0) else { continue };
        found += 1;
        let every = from_env("MOTION_TEST_EVERY").unwrap_or(97);
        let first = Random::new(seed).below(every as usize) as u64;
        match seed % 3 {
            0 => held.before_ticks::<f32>(&case, seed, first, every),
            1 => held.before_ticks::<f64>(&case, seed, first, every),
            _ => held.before_ticks::<Fixed>(&case, seed, first, every),
        }
    }
    held.print_and_assert("random programs");
    assert!(held.holds > 3 * programs, "{}", held.holds);
}
