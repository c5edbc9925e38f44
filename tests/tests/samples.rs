//! The samples on the reference machine: how long they take, exact and blended, with either law, beside the
//! least time on the same path.

use motion_host::compare::acceleration::acceleration_time_s;
use motion_host::compare::{Path, bound, in_mode, on};
use motion_host::gcode;
use motion_host::gcode::PathMode;
use motion_host::planning::{Mode, plan_program};
use motion_host::simulate::run;
use motion_tests::check::machine;
use motion_tests::figures::{Table, hold};
use motion_tests::samples::SAMPLES;

const PATHS: [Path; 3] = [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)];

#[test]
fn the_samples_take_as_long_as_published() {
    let columns =
        ["program", "path", "law", "time [s]", "least [s]", "acceleration alone [s]", "at a limit [%]"];
    let mut table = Table::new(&columns);
    for (name, text) in SAMPLES {
        let program = gcode::read(name, text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        for path in PATHS {
            for machine in machine::references() {
                let plan = plan_program(name, &on(&program, path), &machine, Mode::Spanning)
                    .unwrap_or_else(|error| panic!("{error}"));
                let summary = run(&plan, &machine, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"));
                let (time_s, least_s) = (plan.time_s, bound::least_time_s(&plan));
                let acceleration_s = acceleration_time_s(&plan, &machine);
                assert!(acceleration_s <= 1.001 * least_s, "{name}, {path}: {acceleration_s} of {least_s} s");
                let is_driven = (summary.time_s - time_s).abs() <= machine.tick_s;
                assert!(least_s <= time_s && is_driven, "{name}, {path}: {least_s}, {time_s} s");
                table.row(&[
                    name.to_owned(),
                    path.to_string(),
                    machine.path.pulse.name().to_owned(),
                    format!("{time_s:.4}"),
                    format!("{least_s:.4}"),
                    format!("{acceleration_s:.4}"),
                    format!("{:.1}", 100.0 * summary.limit_active_share),
                ]);
            }
        }
    }
    // No sample may get slower.
    hold("samples", &table, 0.0005).unwrap_or_else(|error| panic!("{error}"));
}

/// From 1 µm to 0.2 mm, with and without as much for merging lines.
#[test]
fn a_larger_tolerance_is_not_slower() {
    const TOLERANCES_MM: [f64; 8] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2];
    const SLOWER_MAX: f64 = 1.002;
    for (name, text) in SAMPLES {
        let program = gcode::read(name, text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        for machine in machine::references() {
            for is_merged in [false, true] {
                let mut least_s = f64::INFINITY;
                for tolerance_mm in TOLERANCES_MM {
                    let merging_mm = is_merged.then_some(tolerance_mm);
                    let blend = PathMode::Blend { tolerance_mm: Some(tolerance_mm), merging_mm };
                    let plan = plan_program(name, &in_mode(&program, blend), &machine, Mode::Spanning)
                        .unwrap_or_else(|error| panic!("{error}"));
                    assert!(
                        plan.time_s <= SLOWER_MAX * least_s,
                        "{name} within {tolerance_mm} mm takes {} s, within less {least_s} s",
                        plan.time_s
                    );
                    least_s = least_s.min(plan.time_s);
                }
            }
        }
    }
}
