//! Plans against the least time there is under the same limits, found numerically: `tests/optimum` makes the
//! committed files that are read here.
//!
//! For moves the least time is exact to the grid (10⁻⁵). For lists it is the best motion that was found,
//! which keeps every limit: the optimum may be less, never more.

mod moves;
mod states;
mod stops;

use motion_kernel::law::{Law, Limits, Pulse};
use serde_json::Value;

/// How much a figure may grow: the last digit, which rounding may change.
const GROWTH: f64 = 0.001;

/// One machine of a committed file: its limits and its cases.
struct Machine {
    name: String,
    limits: Limits<f64>,
    cases: Value,
}

impl Machine {
    fn law(&self, pulse: Pulse) -> Law<f64> {
        Law::new(pulse, self.limits).expect("positive")
    }

    /// Its limits, as tables name it.
    fn name(&self) -> String {
        let limits = self.limits;
        format!("A {}, J {:e}, DJ {:e}", limits.accel_mm_s2, limits.jerk_mm_s3, limits.snap_mm_s4)
    }

    fn cases(&self, group: &str) -> &[Value] {
        self.cases[group].as_array().expect("cases")
    }
}

fn machines(file: &str) -> Vec<Machine> {
    let read: Value = serde_json::from_str(file).expect("JSON");
    let machine = |cases: &Value| Machine {
        name: cases["name"].as_str().expect("a name").to_owned(),
        limits: Limits {
            accel_mm_s2: number(cases, "accel_mm_s2"),
            jerk_mm_s3: number(cases, "jerk_mm_s3"),
            snap_mm_s4: number(cases, "snap_mm_s4"),
        },
        cases: cases.clone(),
    };
    read.as_array().expect("machines").iter().map(machine).collect()
}

fn number(of: &Value, name: &str) -> f64 {
    of[name].as_f64().unwrap_or_else(|| panic!("{name} in {of}"))
}
