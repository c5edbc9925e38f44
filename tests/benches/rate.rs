//! What planning a program takes: lines a second on one core, from G-code to checked blocks.
//!
//! ```text
//! cargo bench -p motion-tests --bench rate [-- FILE...]
//! ```
//!
//! The samples, exact and blended with either law; or these programs (names from `tests/` on), with the plateau and the reference machine's path
//! limits times √3, so that only the axes bind. The table gives the best of some rounds. Programs that are refused
//! have a row that says so.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use motion_host::compare::{Path, on};
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_program};
use motion_tests::check::machine;
use motion_tests::samples::SAMPLES;

const ROUNDS: usize = 3;
const PATHS: [Path; 3] = [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // Whoever builds all targets and runs them wants to see that they run, not to wait for figures.
    if !arguments.iter().any(|argument| argument == "--bench") {
        return;
    }
    let files: Vec<PathBuf> =
        arguments.iter().filter(|argument| !argument.starts_with("--")).map(PathBuf::from).collect();
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
        let name = file.file_stem().unwrap_or(file.as_os_str()).to_string_lossy();
        match std::fs::read(&file) {
            Ok(text) => row(&name, &text, Path::Blended(0.05), &machine),
            Err(error) => println!("| {name} | {error} | | | | |", name = file.display()),
        }
    }
}

fn first_line(error: &impl std::fmt::Display) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
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
    let mut least_s = f64::INFINITY;
    let mut time_s = 0.0;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let program = match gcode::read(name, black_box(text)) {
            Ok(program) => program,
            Err(error) => {
                return println!("| {name} | {path} | {law} | {lines} | {} | |", first_line(&error));
            }
        };
        match plan_program(name, &on(&program, path), machine, Mode::Spanning) {
            Ok(plan) => time_s = plan.time_s,
            Err(error) => {
                return println!("| {name} | {path} | {law} | {lines} | {} | |", first_line(&error));
            }
        }
        least_s = least_s.min(start.elapsed().as_secs_f64());
    }
    println!("| {name} | {path} | {law} | {lines} | {time_s:.4} | {:.0} |", lines as f64 / least_s);
}
