//! Corner blends against the programmed path: distance both ways, continuity, every tick's limits, and the time that
//! they save.
//!
//! The oracle is the programmed geometry itself: distances from lines and arcs in closed form, polynomials of the
//! compiled pieces evaluated here. `MOTION_TEST_SEED` is the first seed, `MOTION_TEST_PROGRAMS` how many.
//!
//! - `asked`: programmed moves, at random too, and what they mean;
//! - `compiled`: the pieces of a plan, held against them;
//! - `driven`: the executed ticks, held against the limits;
//! - `tolerance`, `limits`, `kinks`, `time`, `modes`, `sections`: the tests.

mod asked;
mod compiled;
mod driven;
mod kinks;
mod limits;
mod modes;
mod sections;
mod time;
mod tolerance;

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, Plan, plan_program};
use motion_tests::check::geometry::{Vector, dot, minus, norm};

use self::asked::Asked;
use self::compiled::{compiled, continuous, distance};
use self::driven::{Worst, driven};

fn along(a: Vector, direction: Vector, length: f64) -> Vector {
    [a[0] + direction[0] * length, a[1] + direction[1] * length, a[2] + direction[2] * length]
}

/// To 10⁻¹⁰ mm, as G-code has them.
fn rounded(mm: f64) -> f64 {
    (mm * 1e10).round() / 1e10
}

/// A program without its words of path mode, and without tape marks, which have to be first.
fn without_path_mode(text: &str) -> String {
    let line = |line: &str| {
        let mut words: Vec<&str> = line.split_whitespace().collect();
        if words.iter().any(|word| word.eq_ignore_ascii_case("G64")) {
            words.retain(|word| !word.starts_with(['P', 'p', 'Q', 'q']));
        }
        words.retain(|word| !["G61", "G64"].iter().any(|mode| word.eq_ignore_ascii_case(mode)));
        words.join(" ") + "\n"
    };
    text.lines().filter(|line| !line.starts_with('%')).map(line).collect()
}

fn planned(text: &str, machine: &Machine) -> Result<Plan, String> {
    let program = gcode::read("corners.ngc", text.as_bytes()).map_err(|error| error.to_string())?;
    plan_program("corners.ngc", &program, machine, Mode::Spanning).map_err(|error| error.to_string())
}

/// A program of `asked` moves, held against them at so many points a move, and against every limit in every tick; what its
/// ticks came to, and its greatest distance over the tolerance.
fn judged(
    (asked, tolerance, text): (&[Asked], f64, &str),
    machine: &Machine,
    samples: usize,
) -> Result<(Worst, f64), String> {
    let plan = planned(text, machine)?;
    let stretches = compiled(&plan);
    continuous(&stretches, 3)?;
    let ratio = distance(asked, &stretches, tolerance, samples);
    if ratio > 1.0 + 1e-6 {
        return Err(format!("{ratio} times the tolerance"));
    }
    let found = driven::<f64>(&plan, machine)?;
    found.check().map(|()| (found, ratio))
}

fn seeds(count: u64) -> impl Iterator<Item = u64> {
    let first = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(1);
    first..first + motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(count)
}

fn assert_none(failures: &[String]) {
    let shown: Vec<_> = failures.iter().take(8).map(String::as_str).collect();
    assert!(failures.is_empty(), "{} failed:\n{}", failures.len(), shown.join("\n"));
}
