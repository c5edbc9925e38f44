//! The samples on the reference machine: how long they take, exact and blended, with either law, beside the
//! least time on the same path.

use motion_host::compare::acceleration::acceleration_time_s;
use motion_host::compare::{Path, bound, on};
use motion_host::gcode;
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
