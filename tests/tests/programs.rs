//! Random programs through the whole pipeline, every tick checked against the promises.
//!
//! `cargo test` runs some thousand; the long form runs ten thousand and prints the totals:
//! `cargo test --release -p motion-tests --test suite programs:: -- --ignored --nocapture`.
//! `MOTION_TEST_SEED` is the first seed, `MOTION_TEST_PROGRAMS` how many; with a single program its
//! text is printed.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use motion_host::planning::Mode;
use motion_host::simulate::run;
use motion_kernel::num::Fixed;
use motion_tests::check::totals::Totals;
use motion_tests::check::{drive, geometry, machine, planned, program};
use motion_tests::random::Random;

/// Programs in the form that runs with every `cargo test`, and in the long form.
const PROGRAMS: u64 = 1200;
const PROGRAMS_LONG: u64 = 12_000;
/// Programs on the simulated machine.
const SIMULATED: u64 = 100;
/// Ticks that the long form has to reach.
const TICKS_LONG: u64 = 100_000_000;

/// One seed: a machine, a program, a planning mode, a number type.
fn one(seed: u64, is_shown: bool) -> Result<Totals, String> {
    let mut random = Random::new(seed);
    let machine = machine::any(&mut random);
    let fragments = 1 + random.below(24);
    let program = program::generate(&mut random, fragments, machine.path.feed_mm_s);
    if is_shown {
        println!("{}\n{machine:#?}", program.text);
    }
    let mode = if random.chance(0.5) { Mode::Spanning } else { Mode::PerBlock };
    let (number, result) = match random.below(5) {
        0 | 1 => ("f32", drive::execute::<f32>(&program, &machine, mode, seed)),
        2 => ("f64", drive::execute::<f64>(&program, &machine, mode, seed)),
        _ => ("fixed", drive::execute::<Fixed>(&program, &machine, mode, seed)),
    };
    result.map_err(|error| format!("{number} {mode:?}: {error}"))
}

/// Runs the seeds on all cores; all failures, and the totals.
fn many(programs: u64) -> (Totals, Vec<String>) {
    let first = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(1);
    let programs = motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(programs);
    let next = AtomicU64::new(0);
    let results = Mutex::new((Totals::default(), Vec::new()));
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let mut totals = Totals::default();
                let mut failures = Vec::new();
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= programs {
                        break;
                    }
                    match one(first + index, programs == 1) {
                        Ok(figures) => totals.add(&figures),
                        Err(error) => failures.push(format!("MOTION_TEST_SEED={}: {error}", first + index)),
                    }
                }
                let mut results = results.lock().expect("no worker panics");
                results.0.add(&totals);
                results.1.append(&mut failures);
            });
        }
    });
    results.into_inner().expect("no worker panics")
}

fn assert_none(failures: &[String]) {
    let shown: Vec<_> = failures.iter().take(20).map(String::as_str).collect();
    assert!(failures.is_empty(), "{} programs failed:\n{}", failures.len(), shown.join("\n"));
}

#[test]
fn every_tick_of_random_programs_keeps_the_promises() {
    let (totals, failures) = many(PROGRAMS);
    println!("{totals}");
    assert_none(&failures);
}

/// A short block between two ceilings at a high feed: the change of feed it has room for is a few units in
/// the last place, and a ramp of such a change can't be as long as the block to the step. At 280 mm/s in
/// f64 that is a block of about a micrometre.
#[test]
fn blocks_whose_change_of_feed_is_a_few_last_places_are_planned() {
    let reference = motion_host::machine::Machine::reference();
    let mut failures = Vec::new();
    for step in 1..=400 {
        let length_mm = 1e-5 * 1.03_f64.powi(step);
        let text = format!("G61 G1 X200 F17000\nX{:.10} F18000\nX400 F17999\nM2\n", 200.0 + length_mm);
        if let Err(refused) = planned(&text, &reference) {
            failures.push(format!("{length_mm:e} mm: {refused}"));
        }
    }
    assert_none(&failures);
}

/// Kinks whose junction feed lies around the programmed feed: neither merging nor planning may pass one faster.
#[test]
fn kinks_around_the_programmed_feed_keep_the_acceleration_step() {
    let reference = motion_host::machine::Machine::reference();
    let mm = |mm: f64| (mm * geometry::UNITS_PER_MM).round() as i64;
    for percent in 50..150_u32 {
        // v·φ/τ is the step at 50 mm/s for 100 %.
        let angle = 0.01 * f64::from(percent) * reference.path.accel_step_mm_s2 * reference.tick_s / 50.0;
        let points = [[30.0, 0.0], [30.0 + 30.0 * angle.cos(), 30.0 * angle.sin()]];
        let program = program::lines(&points.map(|[x, y]| [mm(x), mm(y), 0]), 3000.0);
        for mode in [Mode::Spanning, Mode::PerBlock] {
            let done = drive::execute::<f64>(&program, &reference, mode, u64::from(percent));
            assert!(done.is_ok(), "{percent} % {mode:?}: {done:?}");
        }
    }
}

/// Through the whole kernel and the simulated drives: no fault, the planned time, at rest where the program
/// ends.
#[test]
fn random_programs_run_on_the_simulated_machine() {
    for seed in 1..=SIMULATED {
        let mut random = Random::new(seed);
        let machine = machine::gentle(&mut random);
        let fragments = 1 + random.below(4);
        let program = program::generate(&mut random, fragments, 30.0);
        let Ok(plan) = planned(&program.text, &machine) else { continue };
        let mut end_mm = [0.0; 3];
        let mut ticks = 0_u64;
        let mut observe = |tick: &motion_host::trace::TraceRow| {
            assert_eq!(tick.tick, ticks, "seed {seed}: a tick without a record");
            ticks += 1;
            end_mm = tick.axes.map(|axis| axis.set_mm);
        };
        let summary = run(&plan, &machine, &mut observe).expect("a run");
        assert!(summary.faults.is_empty(), "seed {seed}: {:?}", summary.faults);
        let last = program.asked.iter().rev().find_map(|asked| match asked {
            program::Asked::Move(step) => Some(step.to.map(geometry::mm)),
            _ => None,
        });
        for (found, asked) in end_mm.into_iter().zip(last.unwrap_or_default()) {
            assert!(
                (found - asked).abs() <= 2.4e-10,
                "seed {seed}: ends at {found} mm, programmed {asked} mm"
            );
        }
        for axis in &summary.axes {
            assert!(
                axis.following_error_um_max < 1000.0 && axis.output_v_max < 10.0,
                "seed {seed}: {axis:?}"
            );
            assert!(axis.end_error_counts.abs() <= 100, "seed {seed}: {axis:?}");
        }
    }
}

#[test]
#[ignore = "takes minutes: the long form of the test above"]
fn every_tick_of_ten_thousand_programs_keeps_the_promises() {
    let (totals, failures) = many(PROGRAMS_LONG);
    println!("{totals}");
    assert_none(&failures);
    if motion_tests::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(totals.programs >= 10_000 && totals.ticks >= TICKS_LONG, "{totals}");
    }
}
