//! What planning a program takes: lines a second on one core, from G-code to checked blocks.
//!
//! ```text
//! cargo bench -p motion-tests --bench rate [-- FILE...]
//! ```
//!
//! The samples, exact and blended with either law; or these programs, named from `tests/` on, with the plateau and the
//! reference machine's path limits times √3, so that only the axes bind. The table gives the best of some rounds.
//! A program that is refused has a row that says so.

use std::hint::black_box;
use std::time::Instant;

use motion_host::compare::{Path, on};
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_program};
use motion_tests::bench;
use motion_tests::check::machine;
use motion_tests::samples::SAMPLES;

const ROUNDS: usize = 3;
const PATHS: [Path; 3] = [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)];

fn main() {
    let Some(files) = bench::asked() else { return };
    println!("| program | path | law | lines | time [s] | lines a second |");
    println!("|---|---|---|---:|---:|---:|");
    if files.is_empty() {
        for (name, text) in SAMPLES {
            for path in PATHS {
                machine::references().iter().for_each(|machine| row(name, text.as_bytes(), path, machine));
            }
        }
    }
    let machine = bound_by_axes();
    for file in files {
        match std::fs::read(&file) {
            Ok(text) => row(&file, &text, Path::Blended(0.05), &machine),
            Err(error) => println!("| {file} | {error} | | | | |"),
        }
    }
}

/// The reference machine, on which only the axes bind.
fn bound_by_axes() -> Machine {
    let mut machine = Machine::reference();
    let path = &mut machine.path;
    for limit in [&mut path.feed_mm_s, &mut path.accel_mm_s2, &mut path.jerk_mm_s3, &mut path.snap_mm_s4] {
        *limit *= 3.0_f64.sqrt();
    }
    machine
}

fn row(name: &str, text: &[u8], path: Path, machine: &Machine) {
    let lines = text.iter().filter(|&&byte| byte == b'\n').count();
    let law = machine.path.pulse.name();
    print!("| {name} | {path} | {law} | {lines} | ");
    let mut least_s = f64::INFINITY;
    let mut time_s = 0.0;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        match planned_s(name, black_box(text), path, machine) {
            Ok(planned_s) => time_s = planned_s,
            // A row is one line.
            Err(error) => return println!("{} | |", error.lines().next().unwrap_or_default()),
        }
        least_s = least_s.min(start.elapsed().as_secs_f64());
    }
    println!("{time_s:.4} | {:.0} |", lines as f64 / least_s);
}

/// The time of a program's plan \[s\].
fn planned_s(name: &str, text: &[u8], path: Path, machine: &Machine) -> Result<f64, String> {
    let program = gcode::read(name, text).map_err(|error| error.to_string())?;
    let plan = plan_program(name, &on(&program, path), machine, Mode::Spanning);
    plan.map(|plan| plan.time_s).map_err(|error| error.to_string())
}
