//! Long runs, which are smoothed in sections: the same items however they are read, within limits and tolerance, soon.

use motion_host::gcode::{ReadOptions, Reading};
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Stream};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Item;
use motion_tests::check::machine;
use motion_tests::random::Random;
use motion_tests::samples::SAMPLES;

use super::asked::{Asked, corners, program};
use super::driven::Worst;
use super::{assert_none, judged, planned, rounded, seeds};

/// Programs, by seeds; and those whose ticks are looked at, some hundred thousand each.
const LONG: u64 = 6;
const DRIVEN: u64 = 4;

/// Moves without a stop for some sections, slow enough that a few hundred take more than one.
fn long(random: &mut Random) -> (Vec<Asked>, f64, String) {
    let lengths = if random.chance(0.5) { (0.5, 5.0) } else { (0.05, 0.8) };
    let moves = 150 + random.below(300);
    let asked = corners(random, moves, lengths, (1e-3, 1.2));
    let tolerance = rounded(random.log(2e-3, 0.1));
    let text = program(&asked, tolerance, random.log(200.0, 3000.0));
    (asked, tolerance, text)
}

/// Items of a program that is planned while it is read; and how many steps had been read when the first one came.
fn streamed<R: Real>(text: &str, machine: &Machine) -> Result<(Vec<Item<3>>, usize), String> {
    let options = ReadOptions::default();
    let mut reading = Reading::new("corners.ngc", text.as_bytes(), &options);
    let mut stream = Stream::<R, 3>::new("corners.ngc", machine);
    let (mut items, mut steps, mut before) = (Vec::new(), 0, None);
    while let Some(batch) = reading.next_batch().map_err(|error| error.to_string())? {
        steps += batch.steps.len();
        let taken = stream.take(&batch, &mut |streamed| items.push(streamed.item));
        taken.map_err(|error| error.to_string())?;
        before = before.or((!items.is_empty()).then_some(steps));
    }
    stream.end(&mut |streamed| items.push(streamed.item)).map_err(|error| error.to_string())?;
    Ok((items, before.unwrap_or(steps)))
}

fn same_items<R: Real>(text: &str, machine: &Machine) -> Result<usize, String> {
    let plan = planned(text, machine)?;
    let whole = Executable::new::<R>(&plan).map_err(|error| error.to_string())?.items;
    let (items, before) = streamed::<R>(text, machine)?;
    match whole.iter().zip(&items).position(|(whole, item)| whole != item) {
        Some(index) => {
            Err(format!("item {index}: {:?} in the stream, {:?} of the whole", items[index], whole[index]))
        }
        None if whole.len() != items.len() => {
            Err(format!("{} items in the stream, {} of the whole", items.len(), whole.len()))
        }
        None => Ok(before),
    }
}

#[test]
fn a_stream_has_the_items_of_the_whole_program() {
    let mut failures = Vec::new();
    for seed in seeds(LONG) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        machine.path.pulse = machine::pulse(&random);
        let (_, _, text) = long(&mut random);
        let is_fixed = random.chance(0.5);
        let same =
            if is_fixed { same_items::<Fixed>(&text, &machine) } else { same_items::<f32>(&text, &machine) };
        match same {
            // The reader hands on some 256 steps at a time.
            Ok(before) if before > 512 => {
                failures.push(format!("MOTION_TEST_SEED={seed}: first at {before}"))
            }
            Ok(_) => {}
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}")),
        }
    }
    for (name, text) in SAMPLES {
        if let Err(error) = same_items::<f32>(text, &Machine::reference()) {
            failures.push(format!("{name}: {error}"));
        }
    }
    assert_none(&failures);
}

/// Over the cuts, too: within every limit in every tick, continuous to the third derivative, within the tolerance.
#[test]
fn sections_keep_limits_and_tolerance() {
    let mut failures = Vec::new();
    let mut worst = Worst::default();
    for seed in seeds(DRIVEN) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        machine.path.pulse = machine::pulse(&random);
        machine.path.accel_step_mm_s2 = 1e-3;
        let (asked, tolerance, text) = long(&mut random);
        match judged((&asked, tolerance, &text), &machine, 4) {
            Ok((found, _)) => worst = worst.max(found),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}")),
        }
    }
    println!("{worst:?}");
    assert_none(&failures);
}

/// A run without a stop is driven through its cuts: the feed is 0 at its ends alone.
#[test]
fn cuts_make_no_stop() {
    for (path, height, least_mm_s) in [("G64 P0.01", 5.0, 15.0), ("G61", 0.0, 24.999)] {
        let text: String = (1..=2000_u32)
            .map(|index| {
                let x = 0.4 * f64::from(index);
                format!("X{x:.3} Y{:.3}\n", height * (0.05 * x).sin())
            })
            .collect();
        let text = format!("G21 G90 {path}\nG1 F1500\n{text}");
        let plan = planned(&text, &Machine::reference()).expect("a plan");
        assert_eq!(plan.stretches, 1, "{path}");
        // A step takes 16 ms: three sections, and what the reader hands on at a time.
        let (_, before) = streamed::<f32>(&text, &Machine::reference()).expect("items");
        assert!(before <= 1024, "{path}: the first item behind {before} steps");
        let inside = &plan.feed[1..];
        let least = inside.iter().map(|ramp| ramp.planned.ramp.from_mm_s).fold(f64::INFINITY, f64::min);
        println!("{path}: {} s, {least} mm/s at least", plan.time_s);
        assert!(least > least_mm_s, "{path}: {least} mm/s");
    }
}
